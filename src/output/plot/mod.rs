//! Figures of a night as SVG, one for each combination of facet values: error against render time
//! or samples (module `convergence`), and final values over an axis of the sweep (module `sweep`).
//!
//! [`figures`] collects the data of each figure as a [`figure::Figure`], which reports use as well;
//! the module `draw` draws it.
//! Only cells are drawn, since references have no metrics. Curves of interrupted and failed cells
//! show the measurements up to that point. Repeats of a cell are drawn as their mean with its
//! confidence interval, over the range that all of them cover.

pub(super) mod axis;
mod convergence;
pub(super) mod draw;
pub(super) mod figure;
mod grouping;
pub(super) mod raster;
pub(super) mod sheet;
pub(super) mod sizes;
pub(super) mod style;
pub(super) mod svg;
mod sweep;
mod text_outlines;

use std::collections::{BTreeMap, BTreeSet};

pub use raster::rasterize;
pub use sheet::files as sheets;
pub use svg::escape;

use super::devices::{DEVICE, Devices};
use super::format;
use super::metric_display::MetricDisplay;
use super::quantity::is_finished;
use super::report::series::BIASED;
use crate::columns::{FIGURE, names};
use crate::experiment::plan::Plan;
use crate::experiment::spec::{FigureKind, FigureSpec};
use crate::experiment::{CellRef, CellResult, WaveRow};
use axis::{Axis, Scale};
use figure::{Figure, Line, Panel, SeriesEntry, covered};
use grouping::{axis_pairs, group_axes};
use lumbre_metrics::MetricSpec;
use style::{Colour, style};

/// Maximum length of a file stem in bytes, so that all file systems accept it with its extension.
const LONGEST_STEM: usize = 120;

/// Names of axes and the text of their values.
type AxisPairs = Vec<(String, String)>;

/// Data of a figure, before it is drawn.
struct FigureContent {
    /// Notes on what lines average, and on axes; may be empty.
    notes: String,
    x_label: String,
    panels: Vec<MetricPanel>,
}

/// Panel of one quantity with the runs of its lines.
struct MetricPanel {
    column: String,
    panel: Panel,
    /// First cell and number of runs of each line.
    runs: Vec<(usize, usize)>,
}

/// Files of one figure.
#[derive(Clone, Debug, PartialEq)]
pub struct FigureFiles {
    /// Unique file name without extension, of letters, digits, `-`, `_`, `=` and `.`.
    pub stem: String,
    /// Picture as SVG.
    pub svg: String,
    /// Data of the picture as CSV, with the columns:
    /// - one for each axis, with the cell's values;
    /// - `metric`: the quantity drawn;
    /// - `x`: position in the unit of the horizontal axis, or the value of the swept axis;
    /// - `mean`: the value. Over repeats the mean, which is geometric on a logarithmic axis; where
    ///   the distance from the best value is drawn, as of SSIM, the best value without the mean
    ///   distance;
    /// - `low`, `high`: 95 % confidence interval of the mean for three or more repeats, range for
    ///   two, empty for one;
    /// - `runs`: number of runs.
    pub csv: String,
}

/// Draws the figures of a specification: one for each combination of facet values with any
/// measurement, in plan order.
///
/// Errors have a logarithmic axis. A metric with a best value of 1, such as SSIM, is drawn as
/// 1 − value, bias without its sign. PSNR has a linear axis. Values that the axis does not accept
/// (zero, negative or NaN) are left out. Curves with the same value of `by` have the same style in
/// all figures of the specification. Over an axis of the sweep, values other than metrics have a
/// logarithmic axis if they span more than a factor of ten. Axes that are determined by the swept
/// axis, such as axes zipped with it, do not distinguish lines and are named below the title.
///
/// Times of several devices never share an axis. If `devices` has several, each has separate
/// figures, as if the device were an additional facet.
pub fn figures(
    plan: &Plan,
    spec: &FigureSpec,
    results: &[CellResult],
    devices: &Devices,
) -> Vec<FigureFiles> {
    let measured = measured_cells(plan, spec, results);
    let grouping = group_axes(plan, spec);
    let split_devices = spec.is_timed() && devices.is_mixed();
    let mut style_indices: BTreeMap<AxisPairs, usize> = BTreeMap::new();
    let mut facet_indices: BTreeMap<AxisPairs, usize> = BTreeMap::new();
    // For every facet, its measured cells and their style indices.
    let mut facets: Vec<(AxisPairs, Vec<(usize, usize)>)> = Vec::new();
    for cell in 0..plan.cells.len() {
        let curve = axis_pairs(plan, &grouping.by, cell);
        let next = style_indices.len();
        let style_index = *style_indices.entry(curve).or_insert(next);
        if !measured.contains_key(&cell) {
            continue;
        }
        let mut facet = axis_pairs(plan, &grouping.facet, cell);
        if split_devices {
            facet.push((DEVICE.to_owned(), devices.device_of(cell).to_owned()));
        }
        let index = *facet_indices.entry(facet.clone()).or_insert(facets.len());
        if index == facets.len() {
            facets.push((facet, Vec::new()));
        }
        facets[index].1.push((cell, style_index));
    }
    let mut styles = vec![AxisPairs::new(); style_indices.len()];
    for (curve, index) in style_indices {
        styles[index] = curve;
    }
    if matches!(spec.kind, FigureKind::Convergence { .. }) && !split_devices {
        keep_compared(&mut facets);
    }
    let is_integrator = |axis: &&String| format::is_integrator_axis(plan, axis);
    let integrator_axes = plan.axes.iter().filter(is_integrator).collect();
    let biased = plan.biased_references();
    let mut taken = BTreeSet::new();
    facets
        .iter()
        .map(|(facet, cells)| {
            let data = FigureData {
                plan,
                measured: &measured,
                styles: &styles,
                integrator_axes: &integrator_axes,
                biased: &biased,
                facet,
                cells,
            };
            let (content, csv) = match &spec.kind {
                FigureKind::Convergence { x, y } => convergence::figure(&data, *x, y),
                FigureKind::Sweep { over, y } => {
                    sweep::figure(&data, over, y, &grouping.dependent, &grouping.remarks)
                }
            };
            FigureFiles {
                stem: unique_stem(&spec.name, facet, &mut taken),
                svg: draw::draw(&data.figure(content)),
                csv,
            }
        })
        .collect()
}

/// Removes the facets in which nothing is compared, since all curves have one style, unless all
/// facets are of this kind.
fn keep_compared(facets: &mut Vec<(AxisPairs, Vec<(usize, usize)>)>) {
    let is_compared = |(_, cells): &(AxisPairs, Vec<(usize, usize)>)| {
        cells.iter().any(|(_, style)| *style != cells[0].1)
    };
    if facets.iter().any(is_compared) {
        facets.retain(is_compared);
    }
}

/// Returns the results to draw by cell. Duplicate runs of the A/A check are left out, and for a
/// sweep also runs that have not finished.
fn measured_cells<'a>(
    plan: &Plan,
    spec: &FigureSpec,
    results: &'a [CellResult],
) -> BTreeMap<usize, &'a CellResult> {
    let is_shown = |cell: usize| {
        plan.cells
            .get(cell)
            .is_some_and(|c| c.double_of.is_none() && spec.shows(&c.point))
    };
    results
        .iter()
        .filter_map(|r| match r.cell {
            CellRef::Cell(cell) if is_shown(cell) && !r.rows.is_empty() => Some((cell, r)),
            _ => None,
        })
        .filter(|(_, r)| {
            matches!(spec.kind, FigureKind::Convergence { .. }) || is_finished(plan, r)
        })
        .collect()
}

/// Cells and styles of one picture.
struct FigureData<'a> {
    plan: &'a Plan,
    measured: &'a BTreeMap<usize, &'a CellResult>,
    /// Values that distinguish curves, by style index.
    styles: &'a [AxisPairs],
    /// Axes whose values are the integrators of the cells.
    integrator_axes: &'a BTreeSet<&'a String>,
    /// Notes on biased references.
    biased: &'a [String],
    facet: &'a [(String, String)],
    /// Indices of the cells and their style indices.
    cells: &'a [(usize, usize)],
}

impl FigureData<'_> {
    fn rows(&self, cell: usize) -> &[WaveRow] {
        &self.measured[&cell].rows
    }

    /// Builds the figure, with title, provenance and series.
    fn figure(&self, content: FigureContent) -> Figure {
        let facet: Vec<String> = self
            .facet
            .iter()
            .map(|(axis, value)| format!("{axis} = {}", self.plan.report.name(value)))
            .collect();
        let facet = facet.join(", ");
        let name = self.plan.name.clone();
        let title = if facet.is_empty() {
            name
        } else {
            format!("{name}: {facet}")
        };
        let config = |cell: usize| &self.plan.cells[cell].config;
        let is_raw = |(cell, _): &&(usize, usize)| config(*cell).denoise.is_none();
        let style_of = |(_, style): &(usize, usize)| *style;
        let drawn: BTreeSet<usize> = self.cells.iter().map(style_of).collect();
        // A series is denoised, which makes its pictures biased, if all of its cells are.
        let raw: BTreeSet<usize> = self.cells.iter().filter(is_raw).map(style_of).collect();
        let is_drawn = |index: usize| drawn.contains(&index);
        let mut notes = vec![content.notes];
        let entries = (0..self.styles.len()).map(|index| {
            let (mut label, long) = self.label(index);
            if let Some(long) = long.filter(|long| is_drawn(index) && *long != label) {
                notes.push(format!("{label}: {long}"));
            }
            if !label.is_empty() && !raw.contains(&index) {
                label += BIASED;
            }
            SeriesEntry {
                label: if is_drawn(index) {
                    label
                } else {
                    String::new()
                },
                style: style(index).coloured(self.colour(index)),
            }
        });
        let series = entries.collect();
        notes.extend_from_slice(self.biased);
        notes.retain(|note| !note.is_empty());
        Figure {
            title,
            heading: facet,
            notes: notes.join("; "),
            description: self.description(),
            x_label: content.x_label,
            panels: content.panels.into_iter().map(|p| p.panel).collect(),
            series,
        }
    }

    /// Lists program, plan and runs for the picture's metadata.
    fn description(&self) -> String {
        let plan = self.plan;
        let mut text = format!(
            "{}\nplan {} {}",
            crate::text::program(),
            plan.name,
            plan.hash
        );
        for (index, _) in self.cells {
            let cell = &plan.cells[*index];
            let samples = self.rows(*index).last().map_or(0, |r| r.samples);
            text += &format!(
                "\nrun {} {} seed={} samples={samples}",
                cell.id, cell.path, cell.seed
            );
        }
        text
    }

    /// Returns the label of a series, such as `depth = 5` or `bpt`, and the long name of its
    /// integrator if that is all that the label says. If no axis distinguishes series, it is the
    /// integrator, or empty if there are several.
    fn label(&self, index: usize) -> (String, Option<&'static str>) {
        let report = &self.plan.report;
        let values = &self.styles[index];
        let integrator = |short: &str| (report.name(short), format::integrator_long_name(short));
        match values.as_slice() {
            [] => {
                let mut integrators = self
                    .cells
                    .iter()
                    .filter(|(_, style)| *style == index)
                    .map(|(cell, _)| &self.plan.cells[*cell].config.integrator);
                let first = integrators
                    .next()
                    .filter(|first| integrators.all(|other| other == *first));
                first.map_or((String::new(), None), |name| integrator(name))
            }
            [(axis, value)] if self.integrator_axes.contains(axis) => integrator(value),
            values => {
                let pair = |(axis, value): &(String, String)| {
                    if self.integrator_axes.contains(axis) {
                        report.name(value)
                    } else {
                        format!("{axis} = {}", report.name(value))
                    }
                };
                let pairs: Vec<String> = values.iter().map(pair).collect();
                (pairs.join(", "), None)
            }
        }
    }

    /// Returns the colour that the script gives to a series by one of its values.
    fn colour(&self, index: usize) -> Option<Colour> {
        let mut values = self.styles[index].iter();
        values.find_map(|(_, value)| self.plan.report.colour(value).and_then(Colour::parse))
    }
}

/// Returns the heading of a panel of a metric column, and the label of its axis.
fn metric_labels(column: &str, metric: &MetricSpec) -> [String; 2] {
    let (display, row) = (MetricDisplay::for_metric(metric), metric.row);
    let named = (column != row.name).then(|| format!("column {column}"));
    let (heading, label) = match display.complement() {
        Some(best) => (
            format!("{best} − {}", row.long_name),
            format!("{best} − {}", row.label),
        ),
        None if display.is_magnitude() => (
            format!("{} (absolute value)", capitalised(row.long_name)),
            format!("|{}|", row.label),
        ),
        None => (capitalised(row.long_name), row.label.to_owned()),
    };
    let details = [named.unwrap_or_default(), metric.describe_options()];
    let parts = [heading].into_iter().chain(details);
    let parts: Vec<String> = parts.filter(|part| !part.is_empty()).collect();
    [parts.join(", "), format::with_unit(&label, &metric.unit())]
}

/// Marks the lines that share a series with another line as thin.
fn mark_shared(lines: &mut [Line]) {
    let mut counts: BTreeMap<usize, usize> = BTreeMap::new();
    for line in lines.iter() {
        *counts.entry(line.series).or_default() += 1;
    }
    for line in lines {
        line.thin = counts[&line.series] > 1;
    }
}

/// Describes what each line averages. Takes the style index and the runs of each line.
fn subtitle(groups: &[(usize, Vec<usize>)]) -> String {
    let runs = || groups.iter().map(|(_, group)| group.len());
    let (least, most) = (runs().min().unwrap_or(0), runs().max().unwrap_or(0));
    let count = if least == most {
        most.to_string()
    } else {
        format!("{least} to {most}")
    };
    match most {
        0 | 1 if groups.windows(2).any(|two| two[0].0 == two[1].0) => {
            "one thin line per run".to_owned()
        }
        0 | 1 => String::new(),
        2 => format!("mean of {count} repeats; band: range of the two repeats"),
        _ => format!(
            "mean of {count} repeats; band: 95 % confidence interval of the mean \
             (of two repeats: their range)"
        ),
    }
}

/// Gives all panels the horizontal axis that covers them all, and each its vertical axis.
fn set_axes(panels: &mut [MetricPanel], scales: &[Scale], x_axis: impl Fn(&[f64]) -> Option<Axis>) {
    let lines = panels.iter().flat_map(|panel| &panel.panel.lines);
    let runs = lines.flat_map(|line| {
        let curves = line.curves.iter().flat_map(|curve| &curve.points);
        curves.chain(line.points())
    });
    let values: Vec<f64> = runs.map(|(x, _)| *x).collect();
    let x_axis = x_axis(&values);
    for (panel, scale) in panels.iter_mut().zip(scales) {
        let values = covered(&panel.panel.lines, None, *scale);
        panel.panel.axes = x_axis.clone().zip(Axis::new(*scale, values));
    }
}

fn csv_header(plan: &Plan) -> Vec<String> {
    let mut header = plan.axes.clone();
    header.extend(names(&FIGURE));
    header
}

/// Returns the values of a cell on all axes.
fn axis_fields(plan: &Plan, cell: usize) -> Vec<String> {
    let value = |axis: &String| {
        format::axis_value(plan, cell, axis)
            .map(ToString::to_string)
            .unwrap_or_default()
    };
    plan.axes.iter().map(value).collect()
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters
        .next()
        .map(|first| first.to_uppercase().chain(letters).collect())
        .unwrap_or_default()
}

/// Returns a stem such as `convergence_scene=box_depth=5`, reduced to characters that are safe in
/// file names and different from all stems in `taken`.
fn unique_stem(name: &str, facet: &[(String, String)], taken: &mut BTreeSet<String>) -> String {
    let parts = std::iter::once(name.to_owned())
        .chain(facet.iter().map(|(axis, value)| format!("{axis}={value}")));
    let safe = |c: char| {
        if c.is_ascii_alphanumeric() || "-_=.".contains(c) {
            c
        } else {
            '_'
        }
    };
    let mut stem: String = parts
        .collect::<Vec<_>>()
        .join("_")
        .chars()
        .map(safe)
        .take(LONGEST_STEM)
        .collect();
    if stem.is_empty() || stem.starts_with('.') {
        stem.insert(0, '_');
    }
    let mut unique = stem.clone();
    let mut number = 2;
    // Some file systems ignore case, so stems must differ in more than case.
    while !taken.insert(unique.to_lowercase()) {
        unique = format!("{stem}-{number}");
        number += 1;
    }
    unique
}

#[cfg(test)]
mod tests;
