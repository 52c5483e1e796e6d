//! Figures of a night as SVG, one for each combination of facet values: error against render time
//! or samples (module `convergence`), and final values over an axis of the sweep (module `sweep`).
//!
//! [`figures`] collects the data of each figure as a [`Figure`], which the module `layout` draws.
//! Only cells are drawn, since references have no metrics. Curves of interrupted and failed cells
//! show the measurements up to that point. Repeats of a cell are drawn as their mean with its
//! confidence interval, over the range that all of them cover.

pub(super) mod axis;
mod convergence;
mod grouping;
mod layout;
pub(super) mod raster;
pub(super) mod sheet;
pub(super) mod style;
pub(super) mod svg;
mod sweep;
mod text_outlines;

use std::collections::{BTreeMap, BTreeSet};

pub use raster::rasterize;
pub use sheet::sheets;
pub use svg::escape;

use super::devices::{DEVICE, Devices};
use super::format;
use super::report::metric_display::MetricDisplay;
use super::report::repeats::BandKind;
use super::report::study::BIASED;
use super::table::is_finished;
use crate::experiment::plan::Plan;
use crate::experiment::spec::{FigureKind, FigureSpec};
use crate::experiment::{CellRef, CellResult, WaveRow};
use crate::metrics::MetricSpec;
use axis::Scale;
use grouping::{axis_pairs, group_axes};
use style::{Style, style};

/// Maximum length of a file stem in bytes, so that all file systems accept it with its extension.
const LONGEST_STEM: usize = 120;

/// Names of axes and the text of their values.
type AxisPairs = Vec<(String, String)>;

/// Content of one picture.
struct Figure {
    title: String,
    /// Small text below the title; may be empty.
    subtitle: String,
    description: String,
    x_label: String,
    across: HorizontalAxis,
    panels: Vec<MetricPanel>,
    legend: Vec<(String, Style)>,
}

/// Kind of the horizontal axis.
enum HorizontalAxis {
    /// Real numbers on a scale.
    Numbers(Scale),
    /// Integers, with ticks at integers only.
    Integers(Scale),
    /// Names, each at its index.
    Names(Vec<String>),
}

/// Panel of one metric.
struct MetricPanel {
    column: String,
    heading: String,
    /// Column of the metric, if its name differs, and the metric's options.
    details: String,
    y_label: String,
    scale: Scale,
    curves: Vec<PlotCurve>,
}

/// Measurements of one cell, or the mean of its repeats.
struct PlotCurve {
    style: Style,
    /// Whether other curves have the same style. The curve is then drawn thin.
    shared: bool,
    /// Drawable points in the order of measurement.
    points: Vec<(f64, f64)>,
    /// Lower and upper end of the band at each point; empty for a single run.
    ends: Vec<(f64, f64)>,
    /// Meaning of the ends.
    kind: BandKind,
    /// Index of the first cell.
    cell: usize,
    /// Number of runs.
    runs: usize,
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
    /// - `mean`: the drawn value. For a metric with a best value of 1, its distance from 1. Over
    ///   repeats the mean, which is geometric on a logarithmic axis;
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
    let mut styles: Vec<AxisPairs> = Vec::new();
    // For every facet, its measured cells and their style indices.
    let mut facets: Vec<(AxisPairs, Vec<(usize, usize)>)> = Vec::new();
    for cell in 0..plan.cells.len() {
        let curve = axis_pairs(plan, &grouping.by, cell);
        let style_index = styles.iter().position(|s| *s == curve).unwrap_or_else(|| {
            styles.push(curve);
            styles.len() - 1
        });
        if !measured.contains_key(&cell) {
            continue;
        }
        let mut facet = axis_pairs(plan, &grouping.facet, cell);
        if split_devices {
            facet.push((DEVICE.to_owned(), devices.device_of(cell).to_owned()));
        }
        match facets.iter_mut().find(|(values, _)| *values == facet) {
            Some((_, cells)) => cells.push((cell, style_index)),
            None => facets.push((facet, vec![(cell, style_index)])),
        }
    }
    if matches!(spec.kind, FigureKind::Convergence { .. }) && !split_devices {
        keep_compared(&mut facets);
    }
    let mut taken = BTreeSet::new();
    facets
        .iter()
        .map(|(facet, cells)| {
            let data = FigureData {
                plan,
                measured: &measured,
                styles: &styles,
                facet,
                cells,
            };
            let (figure, csv) = match &spec.kind {
                FigureKind::Convergence { x, y } => convergence::figure(&data, *x, y),
                FigureKind::Sweep { over, y } => {
                    sweep::figure(&data, over, y, &grouping.dependent, &grouping.remarks)
                }
            };
            FigureFiles {
                stem: unique_stem(&spec.name, facet, &mut taken),
                svg: layout::draw(&figure),
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
    facet: &'a [(String, String)],
    /// Indices of the cells and their style indices.
    cells: &'a [(usize, usize)],
}

impl FigureData<'_> {
    fn rows(&self, cell: usize) -> &[WaveRow] {
        &self.measured[&cell].rows
    }

    /// Builds the figure of the given panels, with title, description and legend.
    fn figure(
        &self,
        panels: Vec<MetricPanel>,
        subtitle: String,
        x_label: String,
        across: HorizontalAxis,
    ) -> Figure {
        let mut style_indices: Vec<usize> = self.cells.iter().map(|(_, index)| *index).collect();
        style_indices.sort_unstable();
        style_indices.dedup();
        let facet: Vec<String> = self
            .facet
            .iter()
            .map(|(axis, value)| format!("{axis} = {value}"))
            .collect();
        let entry = |index: &usize| {
            let text = self.legend_text(*index);
            (!text.is_empty()).then(|| (text, style(*index)))
        };
        Figure {
            title: std::iter::once(self.plan.name.clone())
                .chain((!facet.is_empty()).then(|| facet.join(", ")))
                .collect::<Vec<_>>()
                .join(": "),
            subtitle,
            description: self.description(),
            x_label,
            across,
            panels,
            legend: style_indices.iter().filter_map(entry).collect(),
        }
    }

    /// Lists program, plan and runs for the picture's metadata.
    fn description(&self) -> String {
        let plan = self.plan;
        let mut text = format!(
            "lumbre {}\nplan {} {}",
            env!("CARGO_PKG_VERSION"),
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

    /// Returns the legend text of a style, such as `depth = 5`, or `bpt (path tracing)` if
    /// the axis selects the integrator. If no axis distinguishes curves, returns the integrator, or
    /// an empty text if there are several.
    fn legend_text(&self, style_index: usize) -> String {
        let with_long_name = |short: &str| match format::integrator_long_name(short) {
            Some(long) => format!("{short} ({long})"),
            None => short.to_owned(),
        };
        let pair = |(axis, value): &(String, String)| {
            if format::is_integrator_axis(self.plan, axis) {
                with_long_name(value)
            } else {
                format!("{axis} = {value}")
            }
        };
        let denoised = |(cell, _): &(usize, usize)| self.plan.cells[*cell].config.denoise.is_some();
        let mut cells = self.cells.iter().filter(|(_, index)| *index == style_index);
        let mark = if cells.all(denoised) { BIASED } else { "" };
        let values = &self.styles[style_index];
        if values.is_empty() {
            let mut integrators = self
                .cells
                .iter()
                .filter(|(_, index)| *index == style_index)
                .map(|(cell, _)| &self.plan.cells[*cell].config.integrator);
            let first = integrators
                .next()
                .filter(|first| integrators.all(|other| other == *first));
            return first.map_or(String::new(), |name| with_long_name(name) + mark);
        }
        values.iter().map(pair).collect::<Vec<_>>().join(", ") + mark
    }
}

/// Builds the panel of a metric column.
fn metric_panel(column: &str, metric: &MetricSpec, curves: Vec<PlotCurve>) -> MetricPanel {
    let (display, row) = (MetricDisplay::for_metric(metric), metric.row);
    let named = (column != row.name).then(|| format!("column {column}"));
    let details = named
        .into_iter()
        .chain([metric.describe_options()])
        .filter(|d| !d.is_empty());
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
    MetricPanel {
        column: column.to_owned(),
        heading,
        details: details.collect::<Vec<_>>().join(", "),
        y_label: format::with_unit(&label, &metric.unit()),
        scale: display.scale,
        curves,
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

fn csv_header(plan: &Plan) -> Vec<String> {
    let mut header = plan.axes.clone();
    header.extend(["metric", "x", "mean", "low", "high", "runs"].map(str::to_owned));
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
