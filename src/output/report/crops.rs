//! Crops at equal time and at equal error: the reference with zoom boxes, the same windows of every series with the
//! error of each below, and the FLIP map of every whole picture.

use std::collections::BTreeMap;

use super::Pictures;
use super::convergence::{COLUMN, FULL, SCREEN};
use super::films::{colour_bar, suffix};
use super::item::{Item, Kind, Provenance};
use super::shots::{self, Moment, Shot, Truths};
use super::study::{Options, Shown, Study};
use super::tables::{common_error, common_time};
use crate::film::Image;
use crate::metrics::tonemap::Tonemap;
use crate::metrics::{Better, MetricSpec};
use crate::output::labels::significant;
use crate::output::plot::style::{FAINT, INK};
use crate::output::plot::svg::{Anchor, Drawing, Font, text_width};
use crate::output::{OutputError, png};

/// Most series in one figure; more would be stamps.
const MOST: usize = 7;

/// Colours of the zoom boxes, told apart by lightness too, and the width of their lines.
const BOXES: [&str; 4] = ["#e69f00", "#56b4e9", "#cc79a7", "#f0e442"];
const BOX: f64 = 1.3;

const GAP: f64 = 3.0;
const HEAD: f64 = 21.0;
const UNDER: f64 = 10.5;

const NAME: Font = Font::strong(8.0);
const SMALL: Font = Font::new(7.0, FAINT);
const NUMBER: Font = Font::new(7.2, INK);

/// The figures of all facets that have a reference and kept pictures.
pub fn all(
    study: &Study,
    options: &Options,
    pictures: &Pictures,
    notes: &mut Vec<String>,
) -> Result<Vec<Item>, OutputError> {
    let mut items = Vec::new();
    let leading = leading(study);
    for facet in 0..study.facets.len() {
        let Some(truths) = shots::references(study, facet, pictures, notes) else { continue };
        let time = common_time(study, options, facet).map(|t| (Moment::Time(t), "equal-time"));
        let error = leading.and_then(|m| Some((Moment::Error(m, common_error(study, facet, m)?), "equal-error")));
        for (moment, name) in [time, error].into_iter().flatten() {
            let mut taken = shots::shots(study, facet, moment, &truths, pictures, notes);
            if taken.len() > MOST {
                notes.push(format!("crops show the first {MOST} of {} series", taken.len()));
                taken.truncate(MOST);
            }
            if taken.is_empty() {
                continue;
            }
            let (truth, words) = &truths.all[0];
            let sheet = Sheet { study, facet, truths: &truths, truth, words, shots: &taken, moment, leading };
            items.push(sheet.item(options, name, notes)?);
        }
    }
    Ok(items)
}

/// The metric by which equal error is meant and whose value stands below crops: of what is measured the first of these,
/// or else any error. FLIP has a row of its own.
pub(super) fn leading(study: &Study) -> Option<usize> {
    let named = |name: &&str| study.metrics.iter().position(|m| m.row.name == *name);
    let known = ["relmse", "rmse", "mse", "mae"].iter().find_map(named);
    known.or_else(|| study.metrics.iter().position(|m| m.row.better == Better::Lower))
}

struct Sheet<'a> {
    study: &'a Study<'a>,
    facet: usize,
    truths: &'a Truths,
    /// The reference that is shown, the first.
    truth: &'a Image,
    words: &'a str,
    shots: &'a [Shot],
    moment: Moment,
    leading: Option<usize>,
}

impl Sheet<'_> {
    fn item(&self, options: &Options, name: &str, notes: &mut Vec<String>) -> Result<Item, OutputError> {
        let windows = self.windows(options, notes);
        let tonemap = shots::exposure(self.truth);
        let runs: Vec<&str> = self.shots.iter().map(|s| s.run.as_str()).collect();
        let members = (0..self.study.series.len()).flat_map(|s| self.study.members(self.facet, s));
        let provenance = Provenance::of(members.filter(|m| runs.contains(&m.run.id.as_str())));
        let label = self.study.facet_label(self.facet);
        let what = if name == "equal-time" { "equal time" } else { "equal error" };
        let title = if label.is_empty() { format!("Crops at {what}") } else { format!("{label} at {what}") };
        let svg = self.draw(&windows, tonemap, &title, &provenance.text())?;
        let stem = format!("figures/crops-{name}{}", suffix(&label));
        let caption = self.caption(tonemap);
        Ok(Item { kind: Kind::Figure, stem, title, caption, svg: Some(svg), grid: None, extra: Vec::new(), provenance })
    }

    fn caption(&self, tonemap: Tonemap) -> String {
        let at = match self.moment {
            Moment::Time(t) => format!("Kept pictures nearest to {} s of render time", significant(t, 3)),
            Moment::Error(metric, error) => {
                let spec = &self.study.metrics[metric];
                let value = significant(Shown::of(spec).back(error), 3);
                format!("Kept pictures nearest to {} = {value}", spec.row.label)
            }
            Moment::End => "Final pictures".to_owned(),
        };
        let number = self.leading.map_or(String::new(), |m| {
            format!(" Below each crop: {} of that window.", self.study.metrics[m].row.label)
        });
        let own = self.truths.owner(0).map_or(String::new(), |series| {
            let name = &self.study.series[series].label;
            format!(" Each series is measured against the reference of its own; the one shown is that of {name}.")
        });
        let clock = self.study.clock();
        let clock = if clock.is_empty() { String::new() } else { format!(" Rendered {clock}.") };
        format!(
            "{at}; samples and seconds of each are above it. Left: the reference ({}), {tonemap}. Right: windows of the first repeat.{number} Bottom: FLIP of the whole picture, from 0 (black) \
             to 1 (pale yellow), with its mean.{own}{clock}",
            self.words
        )
        .replace("Rendered times", "Times")
    }

    /// The windows that were asked for, as far as they are inside; or two, where the series differ most.
    fn windows(&self, options: &Options, notes: &mut Vec<String>) -> Vec<[u32; 4]> {
        let inside = |w: &[u32; 4]| shots::crop(self.truth, *w).is_some();
        if let Some(outside) = options.crops.iter().find(|w| !inside(w)) {
            notes.push(format!(
                "the window {outside:?} is not inside the {}x{} pixels of {}",
                self.truth.width,
                self.truth.height,
                self.study.facet_label(self.facet)
            ));
        }
        let asked: Vec<[u32; 4]> = options.crops.iter().filter(|w| inside(w)).copied().take(BOXES.len()).collect();
        if asked.is_empty() { self.choose() } else { asked }
    }

    /// Two windows of a fifth of the picture's width that do not overlap and in which the worst and the best series
    /// differ most in relative error.
    fn choose(&self) -> Vec<[u32; 4]> {
        let (width, height) = (self.truth.width, self.truth.height);
        let w = (width / 5).max(8).min(width);
        let h = (w * 3 / 4).max(1).min(height);
        let (dx, dy) = ((w / 3).max(1), (h / 3).max(1));
        let places = (0..=(height - h) / dy).flat_map(|j| (0..=(width - w) / dx).map(move |i| [i * dx, j * dy, w, h]));
        let mut ranked: Vec<(f64, [u32; 4])> = places.map(|place| (self.spread(place), place)).collect();
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
        let apart = |a: &[u32; 4], b: &[u32; 4]| a[0].abs_diff(b[0]) > w + w / 4 || a[1].abs_diff(b[1]) > h + h / 4;
        let Some(first) = ranked.first().map(|(_, place)| *place) else { return Vec::new() };
        let second = ranked.iter().map(|(_, place)| *place).find(|place| apart(place, &first));
        std::iter::once(first).chain(second).collect()
    }

    /// How much the worst series' error in a window exceeds the best's: roots of mean squares, relative per pixel.
    fn spread(&self, [x, y, w, h]: [u32; 4]) -> f64 {
        let error = |shot: &Shot| {
            let pixels = (y..y + h).flat_map(|j| (x..x + w).map(move |i| (i, j)));
            let square = |(i, j): (u32, u32)| -> f64 {
                let (a, r) = (shot.image.at(i, j), self.truths.of(shot).at(i, j));
                let one = |c: usize| {
                    let (a, r) = (f64::from(a[c]), f64::from(r[c]));
                    // A single wild sample must not choose the window.
                    ((a - r).powi(2) / (r * r + 1e-2)).min(4.0)
                };
                (one(0) + one(1) + one(2)) / 3.0
            };
            (pixels.map(square).sum::<f64>() / f64::from(w * h)).sqrt()
        };
        let errors = self.shots.iter().map(error).filter(|e| e.is_finite());
        let (low, high) = errors.fold((f64::INFINITY, 0.0f64), |(a, b), e| (a.min(e), b.max(e)));
        if self.shots.len() < 2 { high } else { high - low }
    }

    /// The whole sheet; `about` becomes its description.
    fn draw(&self, windows: &[[u32; 4]], tonemap: Tonemap, title: &str, about: &str) -> Result<String, OutputError> {
        let mut drawing = Drawing::default();
        let columns = self.shots.len() + 1;
        let whole = f64::from(self.truth.height) / f64::from(self.truth.width);
        // The reference takes as much as the crops beside it leave, but not more than a third of the page.
        let width = if columns <= 2 { COLUMN * 1.4 } else { FULL };
        let left = if columns <= 4 { 0.3 * width } else { 0.22 * width };
        let column = (width - left - 2.0 * GAP - (columns - 1) as f64 * GAP) / columns as f64;
        let at = |i: usize| left + 2.0 * GAP + i as f64 * (column + GAP);
        drawing.text((0.0, 8.0), NAME, Anchor::Start, "reference");
        drawing.text((0.0, 17.0), SMALL, Anchor::Start, &shorten(self.words, SMALL.size, left));
        drawing.image([0.0, HEAD, left, left * whole], &png::encode(self.truth, tonemap, &[])?);
        for (i, window) in windows.iter().enumerate() {
            let zoom = left / f64::from(self.truth.width);
            let [x, y, w, h] = window.map(|v| f64::from(v) * zoom);
            drawing.outline([x, HEAD + y, w, h], BOXES[i], BOX);
        }
        for (i, shot) in self.shots.iter().enumerate() {
            let series = &self.study.series[shot.series];
            drawing.text((at(i), 8.0), NAME, Anchor::Start, &shorten(&series.full(), NAME.size, column));
            let facts = format!("{} spp, {} s", shot.samples, significant(shot.render_s, 2));
            drawing.text((at(i), 17.0), SMALL, Anchor::Start, &facts);
        }
        drawing.text((at(columns - 1), 8.0), NAME, Anchor::Start, "reference");
        let mut y = HEAD;
        for (number, window) in windows.iter().enumerate() {
            let height = column * f64::from(window[3]) / f64::from(window[2]);
            let images = self.shots.iter().map(|s| &s.image).chain([self.truth]);
            for (i, image) in images.enumerate() {
                let Some(part) = shots::crop(image, *window) else { continue };
                let place = [at(i), y, column, height];
                drawing.image(place, &png::encode(&part, tonemap, &[])?);
                let inset = BOX / 2.0;
                let inner = [place[0] + inset, place[1] + inset, place[2] - BOX, place[3] - BOX];
                drawing.outline(inner, BOXES[number], BOX);
                let truth = self.shots.get(i).and_then(|shot| shots::crop(self.truths.of(shot), *window));
                let value = self.leading.zip(truth).and_then(|(metric, truth)| {
                    let spec = &self.study.metrics[metric];
                    Some((spec, spec.eval(&part, &truth).ok()?))
                });
                if let Some((spec, value)) = value {
                    let text = format!("{} {}", spec.row.label, significant(value, 3));
                    drawing.text((at(i), y + height + 8.0), NUMBER, Anchor::Start, &text);
                }
            }
            y += height + UNDER + GAP;
        }
        let bottom = self.flip_row(&mut drawing, tonemap, y + 1.0, &at, column, whole)?;
        let height = bottom.max(HEAD + left * whole + 2.0);
        self.colour_bar(&mut drawing, left, HEAD + left * whole, y + 1.0, column * whole);
        Ok(drawing.finish_scaled(width, height, SCREEN, title, about))
    }

    /// FLIP maps of the whole pictures, and where the row ends.
    fn flip_row(
        &self,
        drawing: &mut Drawing,
        tonemap: Tonemap,
        y: f64,
        at: &impl Fn(usize) -> f64,
        column: f64,
        whole: f64,
    ) -> Result<f64, OutputError> {
        let Some(flip) = flip(self.study, tonemap) else { return Ok(y) };
        for (i, shot) in self.shots.iter().enumerate() {
            let Ok(map) = flip.error_map(&shot.image, self.truths.of(shot)) else { continue };
            drawing.image([at(i), y, column, column * whole], &png::encode_map(&map, [0.0, 1.0], &[])?);
            let mean = map.values.iter().map(|v| f64::from(*v)).sum::<f64>() / map.values.len().max(1) as f64;
            let text = format!("FLIP {}", significant(mean, 3));
            drawing.text((at(i), y + column * whole + 8.0), NUMBER, Anchor::Start, &text);
        }
        Ok(y + column * whole + UNDER)
    }

    /// The scale of the FLIP maps, left of them where the reference leaves room.
    fn colour_bar(&self, drawing: &mut Drawing, left: f64, above: f64, y: f64, height: f64) {
        let (x, width) = (left - 7.0, 5.0);
        let top = y.max(above + 12.0);
        let length = y + height - top;
        if length < 18.0 {
            return;
        }
        colour_bar(drawing, [x, top, width, length], [0.0, 1.0]);
        drawing.text((x - 2.5, top + 5.5), SMALL, Anchor::End, "FLIP 1");
        drawing.text((x - 2.5, top + length), SMALL, Anchor::End, "0");
    }
}

/// The FLIP that the study measures, or the one of what the figure shows.
pub(super) fn flip(study: &Study, tonemap: Tonemap) -> Option<MetricSpec> {
    let own = study.metrics.iter().find(|m| m.row.name == "flip").cloned();
    let shown = || BTreeMap::from([("on".to_owned(), tonemap.to_value())]);
    own.or_else(|| MetricSpec::new("flip", "flip", shown()).ok())
}

/// Text that fits into a width, cut with an ellipsis.
pub(super) fn shorten(text: &str, size: f64, width: f64) -> String {
    if text_width(text, size) <= width {
        return text.to_owned();
    }
    let mut short: String = text.to_owned();
    while !short.is_empty() && text_width(&short, size) + 0.64 * size > width {
        short.pop();
    }
    short.trim_end().to_owned() + "…"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_names_are_cut_where_their_column_ends() {
        assert_eq!(shorten("bdpt", 8.0, 100.0), "bdpt");
        let cut = shorten("a very long name of a series", 8.0, 60.0);
        assert!(cut.ends_with('…') && text_width(&cut, 8.0) <= 61.0, "{cut}");
    }
}
