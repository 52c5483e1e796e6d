//! Crops at equal time and at equal error: the reference with marked windows, the same windows of
//! every series with their errors, and the FLIP map of every complete picture.

use std::collections::BTreeMap;

use super::Pictures;
use super::films::{colour_bar, file_suffix};
use super::item::ReportItem;
use super::series::Series;
use super::snapshots;
use super::snapshots::{Disagreement, FacetReferences, Moment, Snapshot};
use super::study::{ReportOptions, Study};
use super::tables::{common_error, common_time};
use crate::format::significant;
use crate::plot::sizes::{COLUMN, FULL, SCREEN};
use crate::plot::style::{FAINT, INK};
use crate::plot::svg::{Anchor, Drawing, Font, wrap};
use crate::provenance::Provenance;
use crate::{OutputError, png};
use lumbre_light::film::Image;
use lumbre_metrics::MetricSpec;
use lumbre_metrics::tonemap::Tonemap;

/// Maximum number of series in one figure; more crops would be too small.
const MOST: usize = 7;

/// Colours of the marked windows, which differ in lightness too.
const BOXES: [&str; 4] = ["#e69f00", "#56b4e9", "#cc79a7", "#f0e442"];
/// Line width of the marked windows.
const BOX: f64 = 1.3;

/// Space between pictures.
const GAP: f64 = 3.0;
/// Space above the pictures for names of one line and facts.
const HEAD: f64 = 21.0;
/// Distance between lines of names.
const NAME_LINE: f64 = 9.0;
/// Distance between small lines.
const SMALL_LINE: f64 = 8.0;
/// Space below a picture for its error.
const UNDER: f64 = 10.5;

const NAME: Font = Font::strong(8.0);
const SMALL: Font = Font::new(7.0, FAINT);
const NUMBER: Font = Font::new(7.2, INK);
/// Font of a warning below the figure.
const WARNING: Font = Font::new(7.0, "#b3261e");

/// Draws the figures of all facets that have a reference and stored pictures.
pub fn all(
    study: &Study,
    options: &ReportOptions,
    pictures: &Pictures,
    notes: &mut Vec<String>,
) -> Result<Vec<ReportItem>, OutputError> {
    let mut items = Vec::new();
    let error_metric = study.error_metric();
    for facet in 0..study.facets.len() {
        let Some(references) = snapshots::references(study, facet, pictures, notes) else {
            continue;
        };
        let time = common_time(study, options, facet).and_then(|time| {
            let common = snapshots::common_stored_time(study, facet, time, &references);
            if common.is_none() {
                let note = "crops at equal time are left out: the techniques have no pictures that \
                            were kept within 5 % of the same render time. More time, or runs that end \
                            by `stop.time`, would have some";
                if !notes.iter().any(|known| known == note) {
                    notes.push(note.to_owned());
                }
            }
            Some((Moment::Time(common?), "equal-time"))
        });
        let error = error_metric.and_then(|m| {
            Some((
                Moment::Error(m, common_error(study, facet, m)?),
                "equal-error",
            ))
        });
        for (moment, name) in [time, error].into_iter().flatten() {
            let mut snapshots =
                snapshots::nearest_snapshots(study, facet, moment, &references, pictures, notes);
            if snapshots.len() > MOST {
                notes.push(format!(
                    "crops show only the first {MOST} of {} series",
                    snapshots.len()
                ));
                snapshots.truncate(MOST);
            }
            if snapshots.is_empty() {
                continue;
            }
            let disagreements = error_metric
                .map(|metric| references.disagreements(&study.metrics[metric]))
                .unwrap_or_default();
            let figure = CropFigure {
                study,
                facet,
                references: &references,
                reference: &references.all[0].image,
                description: &references.all[0].description,
                disagreements: &disagreements,
                snapshots: &snapshots,
                moment,
                error_metric,
            };
            items.push(figure.item(options, name, notes)?);
        }
    }
    Ok(items)
}

/// Content of one figure.
struct CropFigure<'a> {
    study: &'a Study<'a>,
    facet: usize,
    references: &'a FacetReferences,
    /// Reference shown: the one with the least noise.
    reference: &'a Image,
    /// Description of the reference shown.
    description: &'a str,
    /// References that differ from the one shown by more than their noise.
    disagreements: &'a [Disagreement],
    snapshots: &'a [Snapshot],
    moment: Moment,
    /// Metric of the numbers below crops, as index into the study's metrics.
    error_metric: Option<usize>,
}

/// Positions of the pictures of a figure, in points.
struct CropLayout {
    /// Width of the figure.
    width: f64,
    /// Width of the reference at the left.
    left: f64,
    /// Width of a column of crops.
    column: f64,
    /// Height of the reference picture divided by its width.
    aspect: f64,
    /// Names above the reference and above each column, as lines.
    names: Vec<Vec<String>>,
    /// Height of the names and facts above the pictures.
    head: f64,
}

impl CropLayout {
    /// Returns the layout for a reference and the series beside it, whose names are in columns.
    fn new(reference: &Image, reference_name: &str, series: &[&Series]) -> CropLayout {
        let columns = series.len() + 1;
        // The reference is as large as the crops beside it allow, up to a third of the page.
        let width = if columns <= 2 { COLUMN * 1.4 } else { FULL };
        let left = if columns <= 4 {
            0.3 * width
        } else {
            0.22 * width
        };
        let column = (width - left - 2.0 * GAP - (columns - 1) as f64 * GAP) / columns as f64;
        let mut names = vec![wrap(reference_name, NAME.size, left)];
        names.extend(series.iter().map(|s| s.label_lines(NAME.size, column)));
        names.push(wrap(reference_name, NAME.size, column));
        let lines = names.iter().map(Vec::len).max().unwrap_or(1);
        CropLayout {
            width,
            left,
            column,
            aspect: f64::from(reference.height) / f64::from(reference.width),
            names,
            head: HEAD + NAME_LINE * (lines - 1) as f64,
        }
    }

    /// Draws a name in lines that end above the facts.
    fn draw_name(&self, drawing: &mut Drawing, x: f64, name: &[String]) {
        for (i, line) in name.iter().rev().enumerate() {
            let y = self.head - 13.0 - NAME_LINE * i as f64;
            drawing.text((x, y), NAME, Anchor::Start, line);
        }
    }

    /// Returns the left edge of a column of crops.
    fn x(&self, column: usize) -> f64 {
        self.left + 2.0 * GAP + column as f64 * (self.column + GAP)
    }
}

impl CropFigure<'_> {
    fn item(
        &self,
        options: &ReportOptions,
        name: &str,
        notes: &mut Vec<String>,
    ) -> Result<ReportItem, OutputError> {
        let windows = self.windows(options, notes);
        let tonemap = self.study.display_of(self.reference);
        let runs: Vec<&str> = self.snapshots.iter().map(|s| s.run.as_str()).collect();
        let members = (0..self.study.series.len()).flat_map(|s| self.study.members(self.facet, s));
        let provenance =
            Provenance::from_members(members.filter(|m| runs.contains(&m.run.id.as_str())));
        let label = self.study.facet_label(self.facet);
        let moment = if name == "equal-time" {
            "equal time"
        } else {
            "equal error"
        };
        let title = if label.is_empty() {
            format!("Crops at {moment}")
        } else {
            format!("{label} at {moment}")
        };
        let svg = self.draw(&windows, tonemap, &title, &provenance.text())?;
        Ok(ReportItem::figure(
            &format!("Crops at {moment}"),
            format!("figures/crops-{name}{}", file_suffix(&label)),
            title,
            self.caption(tonemap),
            svg,
            provenance,
        ))
    }

    fn caption(&self, tonemap: Tonemap) -> String {
        let mut sentences = vec![self.moment.sentence(self.study)];
        sentences.push("Above each: samples per pixel and render time.".to_owned());
        sentences.push(format!("Left: reference ({}).", self.description));
        sentences.push("Right: windows of the first repeat.".to_owned());
        if let Some(metric) = self.error_metric {
            sentences.push(format!(
                "Below each crop: {} of the window.",
                self.study.metrics[metric].row.label
            ));
        }
        sentences.push(
            "Bottom: FLIP map of the complete picture, from 0 (black) to 1 (pale yellow), with \
             its mean."
                .to_owned(),
        );
        sentences.push(format!("Tone map: {tonemap}."));
        if let Some(series) = self.references.owner(0) {
            sentences.push(format!(
                "Each series is compared with its own reference; the one shown is that of {}, which \
                 has the least noise if it is known.",
                self.study.series[series].label
            ));
        }
        sentences.extend(self.disagreements.iter().map(|d| self.disagreement(d)));
        sentences.extend(self.study.device_sentence("Rendered"));
        sentences.extend(self.study.bias_sentences());
        sentences.join(" ")
    }

    /// Returns the name of the reference shown.
    fn reference_name(&self) -> String {
        self.references.name(self.study, 0)
    }

    /// Returns a sentence on a reference that differs from the one shown by more than their noise.
    fn disagreement(&self, disagreement: &Disagreement) -> String {
        let name = |reference: usize| {
            let owner = self.references.owner(reference);
            owner.map_or("another series", |series| &self.study.series[series].label)
        };
        let metric = self.error_metric.map(|m| self.study.metrics[m].row.label);
        format!(
            "The references of {} and {} differ by more than their noise: {} {}, where {} is \
             expected.",
            name(disagreement.reference),
            name(0),
            metric.unwrap_or_default(),
            significant(disagreement.error, 2),
            significant(disagreement.expected, 2)
        )
    }

    /// Returns the requested windows that are inside of the picture, or two windows where the
    /// series differ most.
    fn windows(&self, options: &ReportOptions, notes: &mut Vec<String>) -> Vec<[u32; 4]> {
        let is_inside = |w: &[u32; 4]| snapshots::crop(self.reference, *w).is_some();
        if let Some(outside) = options.crops.iter().find(|w| !is_inside(w)) {
            notes.push(format!(
                "the crop {outside:?} is not inside of the {}x{} pixels of {}",
                self.reference.width,
                self.reference.height,
                self.study.facet_label(self.facet)
            ));
        }
        let requested: Vec<[u32; 4]> = options
            .crops
            .iter()
            .filter(|w| is_inside(w))
            .copied()
            .take(BOXES.len())
            .collect();
        if requested.is_empty() {
            self.select_windows()
        } else {
            requested
        }
    }

    /// Selects two separate windows, a fifth of the picture wide, in which the errors of the worst
    /// and the best series differ most.
    fn select_windows(&self) -> Vec<[u32; 4]> {
        let (width, height) = (self.reference.width, self.reference.height);
        let w = (width / 5).max(8).min(width);
        let h = (w * 3 / 4).max(1).min(height);
        let (dx, dy) = ((w / 3).max(1), (h / 3).max(1));
        let candidates = (0..=(height - h) / dy)
            .flat_map(|j| (0..=(width - w) / dx).map(move |i| [i * dx, j * dy, w, h]));
        let mut ranked: Vec<(f64, [u32; 4])> = candidates
            .map(|window| (self.error_range(window), window))
            .collect();
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
        let are_separate = |a: &[u32; 4], b: &[u32; 4]| {
            a[0].abs_diff(b[0]) > w + w / 4 || a[1].abs_diff(b[1]) > h + h / 4
        };
        let Some(first) = ranked.first().map(|(_, window)| *window) else {
            return Vec::new();
        };
        let second = ranked
            .iter()
            .map(|(_, window)| *window)
            .find(|window| are_separate(window, &first));
        std::iter::once(first).chain(second).collect()
    }

    /// Returns the difference between the errors of the worst and the best series in a window. The
    /// error is the root of the mean squared relative error. For a single series, returns its
    /// error.
    fn error_range(&self, [x, y, w, h]: [u32; 4]) -> f64 {
        let error = |snapshot: &Snapshot| {
            let reference = self.references.for_snapshot(snapshot);
            let pixels = (y..y + h).flat_map(|j| (x..x + w).map(move |i| (i, j)));
            let square = |(i, j): (u32, u32)| -> f64 {
                let (a, r) = (snapshot.image.at(i, j), reference.at(i, j));
                let channel = |c: usize| {
                    let (a, r) = (f64::from(a[c]), f64::from(r[c]));
                    // The limit keeps a single outlier from selecting the window.
                    ((a - r).powi(2) / (r * r + 1e-2)).min(4.0)
                };
                (channel(0) + channel(1) + channel(2)) / 3.0
            };
            (pixels.map(square).sum::<f64>() / f64::from(w * h)).sqrt()
        };
        let errors = self.snapshots.iter().map(error).filter(|e| e.is_finite());
        let (low, high) = errors.fold((f64::INFINITY, 0.0f64), |(a, b), e| (a.min(e), b.max(e)));
        if self.snapshots.len() < 2 {
            high
        } else {
            high - low
        }
    }

    /// Draws the figure. `description` is the description of the SVG.
    fn draw(
        &self,
        windows: &[[u32; 4]],
        tonemap: Tonemap,
        title: &str,
        description: &str,
    ) -> Result<String, OutputError> {
        let mut drawing = Drawing::default();
        let series = self.snapshots.iter().map(|s| &self.study.series[s.series]);
        let series: Vec<&Series> = series.collect();
        let layout = CropLayout::new(self.reference, &self.reference_name(), &series);
        let reference_height = layout.left * layout.aspect;
        self.draw_reference(&mut drawing, &layout, windows, tonemap)?;
        self.draw_column_heads(&mut drawing, &layout);
        let mut y = layout.head;
        for (number, window) in windows.iter().enumerate() {
            let height = layout.column * f64::from(window[3]) / f64::from(window[2]);
            self.draw_crops(&mut drawing, &layout, (number, *window), tonemap, y)?;
            y += height + UNDER + GAP;
        }
        let bottom = self.draw_flip_row(&mut drawing, &layout, tonemap, y + 1.0)?;
        let facts = [self.description.to_owned(), tonemap.to_string()];
        let facts = facts.iter().flat_map(|f| wrap(f, SMALL.size, layout.left));
        let mut under = layout.head + reference_height;
        for line in facts {
            under += SMALL_LINE;
            drawing.text((0.0, under), SMALL, Anchor::Start, &line);
        }
        let mut height = bottom.max(under + 2.0);
        let warnings = self.disagreements.iter().map(|d| self.disagreement(d));
        for line in warnings.flat_map(|w| wrap(&w, WARNING.size, layout.width)) {
            height += WARNING.size + 3.0;
            drawing.text((0.0, height - 2.0), WARNING, Anchor::Start, &line);
        }
        draw_flip_scale(
            &mut drawing,
            layout.left,
            under,
            y + 1.0,
            layout.column * layout.aspect,
        );
        Ok(drawing.finish_scaled(layout.width, height, SCREEN, title, description))
    }

    /// Draws the reference with the marked windows.
    fn draw_reference(
        &self,
        drawing: &mut Drawing,
        layout: &CropLayout,
        windows: &[[u32; 4]],
        tonemap: Tonemap,
    ) -> Result<(), OutputError> {
        layout.draw_name(drawing, 0.0, &layout.names[0]);
        drawing.image(
            [0.0, layout.head, layout.left, layout.left * layout.aspect],
            &png::encode(self.reference, tonemap, &[])?,
        );
        for (i, window) in windows.iter().enumerate() {
            let zoom = layout.left / f64::from(self.reference.width);
            let [x, y, w, h] = window.map(|v| f64::from(v) * zoom);
            drawing.outline([x, layout.head + y, w, h], BOXES[i], BOX);
        }
        Ok(())
    }

    /// Writes name, samples and render time above each column.
    fn draw_column_heads(&self, drawing: &mut Drawing, layout: &CropLayout) {
        for (i, snapshot) in self.snapshots.iter().enumerate() {
            layout.draw_name(drawing, layout.x(i), &layout.names[i + 1]);
            let facts = format!(
                "{} spp, {} s",
                snapshot.samples,
                significant(snapshot.render_s, 2)
            );
            let y = layout.head - 4.0;
            drawing.text((layout.x(i), y), SMALL, Anchor::Start, &facts);
        }
        let last = self.snapshots.len();
        layout.draw_name(drawing, layout.x(last), &layout.names[last + 1]);
    }

    /// Draws the crops of one window in all columns, with their errors.
    fn draw_crops(
        &self,
        drawing: &mut Drawing,
        layout: &CropLayout,
        (number, window): (usize, [u32; 4]),
        tonemap: Tonemap,
        y: f64,
    ) -> Result<(), OutputError> {
        let height = layout.column * f64::from(window[3]) / f64::from(window[2]);
        let images = self
            .snapshots
            .iter()
            .map(|s| &s.image)
            .chain([self.reference]);
        for (i, image) in images.enumerate() {
            let Some(crop) = snapshots::crop(image, window) else {
                continue;
            };
            let x = layout.x(i);
            drawing.image(
                [x, y, layout.column, height],
                &png::encode(&crop, tonemap, &[])?,
            );
            let inset = BOX / 2.0;
            let inner = [x + inset, y + inset, layout.column - BOX, height - BOX];
            drawing.outline(inner, BOXES[number], BOX);
            let reference = self.snapshots.get(i).and_then(|snapshot| {
                snapshots::crop(self.references.for_snapshot(snapshot), window)
            });
            let value = self
                .error_metric
                .zip(reference)
                .and_then(|(metric, reference)| {
                    let spec = &self.study.metrics[metric];
                    Some((spec, spec.eval(&crop, &reference).ok()?))
                });
            if let Some((spec, value)) = value {
                let text = format!("{} {}", spec.row.label, significant(value, 3));
                drawing.text((x, y + height + 8.0), NUMBER, Anchor::Start, &text);
            }
        }
        Ok(())
    }

    /// Draws the FLIP maps of the complete pictures and returns the bottom of the row.
    fn draw_flip_row(
        &self,
        drawing: &mut Drawing,
        layout: &CropLayout,
        tonemap: Tonemap,
        y: f64,
    ) -> Result<f64, OutputError> {
        let Some(flip) = flip_metric(self.study, tonemap) else {
            return Ok(y);
        };
        let height = layout.column * layout.aspect;
        for (i, snapshot) in self.snapshots.iter().enumerate() {
            let reference = self.references.for_snapshot(snapshot);
            let Ok(map) = flip.error_map(&snapshot.image, reference) else {
                continue;
            };
            drawing.image(
                [layout.x(i), y, layout.column, height],
                &png::encode_map(&map, [0.0, 1.0], &[])?,
            );
            let mean = map.values.iter().map(|v| f64::from(*v)).sum::<f64>()
                / map.values.len().max(1) as f64;
            drawing.text(
                (layout.x(i), y + height + 8.0),
                NUMBER,
                Anchor::Start,
                &format!("FLIP {}", significant(mean, 3)),
            );
        }
        Ok(y + height + UNDER)
    }
}

/// Draws the colour scale of the FLIP maps to their left if there is space below the reference,
/// which ends at `reference_bottom` and is `left` wide. The maps start at `y`.
fn draw_flip_scale(drawing: &mut Drawing, left: f64, reference_bottom: f64, y: f64, height: f64) {
    let (x, width) = (left - 7.0, 5.0);
    let top = y.max(reference_bottom + 12.0);
    let length = y + height - top;
    if length < 18.0 {
        return;
    }
    colour_bar(drawing, [x, top, width, length], [0.0, 1.0]);
    drawing.text((x - 2.5, top + 5.5), SMALL, Anchor::End, "FLIP 1");
    drawing.text((x - 2.5, top + length), SMALL, Anchor::End, "0");
}

/// Returns the FLIP metric of the study, or FLIP under the given tone map if none is measured.
pub(super) fn flip_metric(study: &Study, tonemap: Tonemap) -> Option<MetricSpec> {
    let measured = study.metrics.iter().find(|m| m.row.name == "flip").cloned();
    let options = || BTreeMap::from([("on".to_owned(), tonemap.to_value())]);
    measured.or_else(|| MetricSpec::new("flip", "flip", options()).ok())
}
