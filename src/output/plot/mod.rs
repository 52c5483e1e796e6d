//! Figures, one SVG for each combination of facet values: error against render time or samples, and in the module `sweep`
//! what runs have in the end over an axis of the sweep.
//!
//! Here the figure's data is gathered; the module `layout` places and draws it. Only cells are drawn: references have no
//! metrics. Interrupted and failed cells are drawn as far as they were measured. Repeats of a cell are drawn as their mean
//! and its confidence interval, over what all of them reach.

pub(super) mod axis;
mod layout;
pub(super) mod raster;
pub(super) mod sheet;
pub(super) mod style;
pub(super) mod svg;
mod sweep;

use std::collections::{BTreeMap, BTreeSet};
use std::slice::from_ref;

pub use raster::rasterize;
pub use sheet::sheets;

use super::bound::{change, follows};
use super::devices::{DEVICE, Devices};
use super::labels;
use super::report::curve::{Band, BandKind, Curve as Repeat, band};
use super::report::study::Shown;
use super::table::is_finished;
use crate::experiment::plan::Plan;
use crate::experiment::spec::{FigureKind, FigureSpec, FigureX};
use crate::experiment::{CellRef, CellResult, WaveRow};
use crate::metrics::MetricSpec;
use axis::Scale;
use style::{Style, style};

/// Longest file stem in bytes, so that it fits every file system with a suffix and an extension.
const LONGEST_STEM: usize = 120;

/// Axis names with the text of their values.
type Pairs = Vec<(String, String)>;

/// One picture's data.
struct Figure {
    title: String,
    /// What stands small below the title, empty if there is nothing to say.
    subtitle: String,
    description: String,
    x_label: String,
    across: Across,
    panels: Vec<Panel>,
    legend: Vec<(String, Style)>,
}

/// What lies on the horizontal axis.
enum Across {
    /// Numbers.
    Numbers(Scale),
    /// Whole numbers.
    Whole(Scale),
    /// Names, each at its number from zero.
    Names(Vec<String>),
}

/// One metric of a picture.
struct Panel {
    column: String,
    heading: String,
    /// The metric's column, where it has a name of its own, and its options in words.
    details: String,
    y_label: String,
    scale: Scale,
    curves: Vec<Curve>,
}

/// The measurements of one cell, or what those of its repeats say together.
struct Curve {
    style: Style,
    /// Whether other curves have the same style: then it is drawn thin.
    shared: bool,
    /// Points that have a place on the axes, in the order of measurement.
    points: Vec<(f64, f64)>,
    /// Of the mean of several repeats, the lower and the upper end at each point.
    ends: Vec<(f64, f64)>,
    /// What the ends are.
    kind: BandKind,
    /// The first cell.
    cell: usize,
    /// Runs behind it.
    runs: usize,
}

/// A figure as files: a stem (letters, digits, `-`, `_`, `=` and `.`, unique), the picture, and its data.
#[derive(Clone, Debug, PartialEq)]
pub struct FigureFiles {
    /// The name of its files, without extension.
    pub stem: String,
    /// The picture.
    pub svg: String,
    /// What is drawn, as comma-separated values: the cell's axes, `metric` (what is drawn), `x` in the unit of the
    /// horizontal axis (over an axis of the sweep its value), `mean` as drawn (of a metric with a best value of 1, what is left to it; over repeats, geometric on a logarithmic axis),
    /// `low`, `high` (the 95 % confidence interval of the mean over three repeats or more, the range of two, empty for
    /// one), and `runs`.
    pub csv: String,
}

/// The figures of a specification, one for each combination of facet values of which anything was measured, in the order
/// of the plan.
///
/// Errors have a logarithmic axis; a metric with a best value of 1, such as SSIM, is drawn as 1 − value, bias without its
/// sign; PSNR has a linear axis. Values without a place on their axis (zero, negative, NaN) are left out. Curves with the same value of
/// `by` look alike in all figures of the specification. Over an axis of the sweep other values than metrics have a
/// logarithmic axis where they span more than a factor of ten; what follows from it, as axes that are zipped with it do, tells no
/// lines apart, and is named below the title.
///
/// Times of several devices never share an axis: each device that `devices` names then has figures of its own, as if it
/// were one more facet.
pub fn figures(plan: &Plan, spec: &FigureSpec, results: &[CellResult], devices: &Devices) -> Vec<FigureFiles> {
    let timed = spec.is_timed() && devices.several();
    // Doubles of the A/A check are no results.
    let shown = |cell: usize| plan.cells.get(cell).is_some_and(|c| c.control.is_none() && spec.shows(&c.point));
    let measured: BTreeMap<usize, &CellResult> = results
        .iter()
        .filter_map(|r| match r.cell {
            CellRef::Cell(cell) if shown(cell) && !r.rows.is_empty() => Some((cell, r)),
            _ => None,
        })
        .filter(|(_, r)| matches!(spec.kind, FigureKind::Convergence { .. }) || is_finished(plan, r))
        .collect();
    let Apart { by, facet: facet_axes, bound, remarks } = apart(plan, spec);
    let mut styles: Vec<Pairs> = Vec::new();
    // Of every facet the measured cells, each with the number of its look.
    let mut facets: Vec<(Pairs, Vec<(usize, usize)>)> = Vec::new();
    for cell in 0..plan.cells.len() {
        let curve = pairs(plan, &by, cell);
        let look = styles.iter().position(|s| *s == curve).unwrap_or_else(|| {
            styles.push(curve);
            styles.len() - 1
        });
        if !measured.contains_key(&cell) {
            continue;
        }
        let mut facet = pairs(plan, &facet_axes, cell);
        if timed {
            facet.push((DEVICE.to_owned(), devices.of(cell).to_owned()));
        }
        match facets.iter_mut().find(|(values, _)| *values == facet) {
            Some((_, cells)) => cells.push((cell, look)),
            None => facets.push((facet, vec![(cell, look)])),
        }
    }
    let mut taken = BTreeSet::new();
    facets
        .iter()
        .map(|(facet, cells)| {
            let stem = unique_stem(&spec.name, facet, &mut taken);
            let night = Gathered { plan, measured: &measured, styles: &styles, facet, cells };
            let (figure, csv) = match &spec.kind {
                FigureKind::Convergence { x, y } => {
                    let figure = night.convergence(*x, y);
                    let csv = csv(plan, &figure);
                    (figure, csv)
                }
                FigureKind::Sweep { over, y } => sweep::figure(&night, over, y, &bound, &remarks),
            };
            FigureFiles { stem, svg: layout::draw(&figure), csv }
        })
        .collect()
}

/// What a figure tells apart.
struct Apart {
    /// The axes that distinguish curves: `by`, or else all that vary and are no facet.
    by: Vec<String>,
    /// The axes that distinguish pictures.
    facet: Vec<String>,
    /// Of a sweep, the axes that neither do, because they follow from the horizontal axis and from what was asked for.
    bound: Vec<String>,
    /// What is to be said of axes that tell nothing apart.
    remarks: Vec<String>,
}

fn apart(plan: &Plan, spec: &FigureSpec) -> Apart {
    let (mut by, mut facet) = (spec.by.clone(), spec.facet.clone());
    let (mut bound, mut remarks) = (Vec::new(), Vec::new());
    if let FigureKind::Sweep { over, .. } = &spec.kind {
        let shown: Vec<usize> = (0..plan.cells.len())
            .filter(|i| plan.cells[*i].control.is_none() && spec.shows(&plan.cells[*i].point))
            .collect();
        let single = |axis: &&String| follows(shown.iter().map(|cell| ((), labels::axis_value(plan, *cell, axis))));
        let follow = |from: &[String], axis: &String| {
            follows(shown.iter().map(|cell| (pairs(plan, from, *cell), labels::axis_value(plan, *cell, axis))))
        };
        remarks.extend([over].into_iter().chain(&by).filter(single).map(|axis| format!("{axis} has a single value")));
        // Where each value of what was asked for has a single place, there would be no lines.
        let tied = |axis: &String| !single(&axis) && follow(from_ref(over), axis) && follow(from_ref(axis), over);
        by = by.filter(|axis| !tied(axis));
        facet.retain(|axis| !tied(axis));
        let fixed: Vec<String> = [over].into_iter().chain(&facet).chain(&by).cloned().collect();
        let free = plan.axes.iter().filter(|axis| !fixed.contains(axis) && !single(axis));
        bound = free.filter(|axis| follow(&fixed, axis)).cloned().collect();
        let along: Vec<String> = bound.iter().filter(|axis| follow(from_ref(over), axis)).cloned().collect();
        remarks.extend(change(&along).map(|change| format!("{change} with {over}")));
    }
    let varies = |axis: &&String| {
        let first = labels::axis_value(plan, 0, axis);
        (0..plan.cells.len()).any(|cell| labels::axis_value(plan, cell, axis) != first)
    };
    let over = |axis: &&String| !matches!(&spec.kind, FigureKind::Sweep { over, .. } if over == *axis);
    let free = |axis: &&String| !facet.contains(axis) && !bound.contains(axis);
    let by = match by {
        Some(by) => vec![by],
        None => plan.axes.iter().filter(free).filter(over).filter(varies).cloned().collect(),
    };
    Apart { by, facet, bound, remarks }
}

/// The values of some axes at a cell.
fn pairs(plan: &Plan, axes: &[String], cell: usize) -> Pairs {
    let pair = |axis: &String| labels::axis_value(plan, cell, axis).map(|v| (axis.clone(), v.to_string()));
    axes.iter().filter_map(pair).collect()
}

/// What one picture is made of.
struct Gathered<'a> {
    plan: &'a Plan,
    measured: &'a BTreeMap<usize, &'a CellResult>,
    styles: &'a [Pairs],
    facet: &'a [(String, String)],
    /// Its cells, each with the number of its look.
    cells: &'a [(usize, usize)],
}

impl Gathered<'_> {
    fn rows(&self, cell: usize) -> &[WaveRow] {
        &self.measured[&cell].rows
    }

    fn convergence(&self, x: FigureX, y: &[String]) -> Figure {
        let plan = self.plan;
        // Repeats of one point, together, with their look.
        let mut groups: Vec<(usize, Vec<usize>)> = Vec::new();
        for (cell, look) in self.cells {
            let point = &plan.cells[*cell].point;
            match groups.last_mut().filter(|(_, group)| plan.cells[group[0]].point == *point) {
                Some((_, group)) => group.push(*cell),
                None => groups.push((*look, vec![*cell])),
            }
        }
        let shared = |look: usize| groups.iter().filter(|(l, _)| *l == look).count() > 1;
        let panels = y.iter().filter_map(|column| {
            let (index, metric) = labels::column(plan, column)?;
            let shown = Shown::of(metric);
            let single = |cell: usize| -> Vec<(f64, f64)> {
                let rows = self.rows(cell).iter();
                let points = rows.filter_map(|r| Some((x_of(x, r), shown.value(*r.metrics.get(index)?)?)));
                points.filter(|(x, _)| Scale::Log.holds(*x)).collect()
            };
            let curves = groups.iter().map(|(look, group)| {
                let (style, shared, cell, runs) = (style(*look), shared(*look), group[0], group.len());
                let together = if runs > 1 { self.repeats(group, x, index, metric) } else { None };
                let (points, ends, kind) = match together {
                    Some(band) => (band.mean, band.ends, band.kind),
                    None => (single(cell), Vec::new(), BandKind::Single),
                };
                Curve { style, shared, points, ends, kind, cell, runs }
            });
            Some(panel(column, metric, curves.collect()))
        });
        let x_label = match x {
            FigureX::RenderS => "render time (s)",
            FigureX::Samples => "samples per pixel",
        };
        self.figure(panels.collect(), subtitle(&groups), x_label.to_owned(), Across::Numbers(Scale::Log))
    }

    /// The figure of these panels.
    fn figure(&self, panels: Vec<Panel>, subtitle: String, x_label: String, across: Across) -> Figure {
        let mut looks: Vec<usize> = self.cells.iter().map(|(_, look)| *look).collect();
        looks.sort_unstable();
        looks.dedup();
        let facet: Vec<String> = self.facet.iter().map(|(axis, value)| format!("{axis} = {value}")).collect();
        let entry = |look: &usize| {
            let text = legend_text(self.plan, &self.styles[*look], self.cells, *look);
            (!text.is_empty()).then(|| (text, style(*look)))
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
            legend: looks.iter().filter_map(entry).collect(),
        }
    }

    /// What several repeats say together of one metric.
    fn repeats(&self, group: &[usize], x: FigureX, index: usize, metric: &MetricSpec) -> Option<Band> {
        let points = |cell: &usize| {
            let points = self.rows(*cell).iter().filter_map(move |r| Some((x_of(x, r), *r.metrics.get(index)?)));
            Repeat::new(Shown::of(metric), points)
        };
        band(&group.iter().map(points).collect::<Vec<_>>())
    }

    /// Where the numbers come from, for the picture's metadata.
    fn description(&self) -> String {
        let plan = self.plan;
        let mut text = format!("lumbre {}\nplan {} {}", env!("CARGO_PKG_VERSION"), plan.name, plan.hash);
        for (index, _) in self.cells {
            let cell = &plan.cells[*index];
            let samples = self.rows(*index).last().map_or(0, |r| r.samples);
            text += &format!("\nrun {} {} seed={} samples={samples}", cell.id, cell.path, cell.seed);
        }
        text
    }
}

/// The panel of a metric's column.
fn panel(column: &str, metric: &MetricSpec, curves: Vec<Curve>) -> Panel {
    let (shown, row) = (Shown::of(metric), metric.row);
    let named = (column != row.name).then(|| format!("column {column}"));
    let details = named.into_iter().chain([metric.describe_options()]).filter(|d| !d.is_empty());
    let (heading, label) = match shown.complement() {
        Some(best) => (format!("{best} − {}", row.long_name), format!("{best} − {}", row.label)),
        None if shown.is_magnitude() => {
            (format!("{}, without its sign", capitalised(row.long_name)), format!("|{}|", row.label))
        }
        None => (capitalised(row.long_name), row.label.to_owned()),
    };
    Panel {
        column: column.to_owned(),
        heading,
        details: details.collect::<Vec<_>>().join(", "),
        y_label: labels::with_unit(&label, &metric.unit()),
        scale: shown.scale,
        curves,
    }
}

/// What the lines are, where they are more than one run each.
fn subtitle(groups: &[(usize, Vec<usize>)]) -> String {
    let runs = || groups.iter().map(|(_, group)| group.len());
    let (least, most) = (runs().min().unwrap_or(0), runs().max().unwrap_or(0));
    let each = if least == most { most.to_string() } else { format!("{least} to {most}") };
    match most {
        0 | 1 if groups.windows(2).any(|two| two[0].0 == two[1].0) => "one thin line per run".to_owned(),
        0 | 1 => String::new(),
        2 => format!("mean of {each} repeats; band: the range of the two"),
        _ => format!("mean of {each} repeats; band: 95 % confidence interval of the mean, of two repeats their range"),
    }
}

/// A figure's data.
fn csv(plan: &Plan, figure: &Figure) -> String {
    let mut header = plan.axes.clone();
    header.extend(["metric", "x", "mean", "low", "high", "runs"].map(str::to_owned));
    let mut text = labels::csv_line(&header);
    for panel in &figure.panels {
        for curve in &panel.curves {
            for (place, (x, mean)) in curve.points.iter().enumerate() {
                let axis =
                    |axis| labels::axis_value(plan, curve.cell, axis).map(ToString::to_string).unwrap_or_default();
                let mut line: Vec<String> = plan.axes.iter().map(|name| axis(name)).collect();
                let ends = curve.ends.get(place).filter(|_| curve.kind != BandKind::Single);
                let end = |end: Option<f64>| end.map(labels::exact).unwrap_or_default();
                line.extend([panel.column.clone(), labels::exact(*x), labels::exact(*mean)]);
                line.extend([end(ends.map(|e| e.0)), end(ends.map(|e| e.1)), curve.runs.to_string()]);
                text += &labels::csv_line(&line);
            }
        }
    }
    text
}

fn x_of(x: FigureX, row: &WaveRow) -> f64 {
    match x {
        FigureX::RenderS => row.render_s,
        FigureX::Samples => row.samples as f64,
    }
}

/// What the legend says of a curve: `depth = 5`, or `bpt (backward path tracing)` where the axis is the integrator. Empty
/// where nothing tells curves apart and their cells have several integrators.
fn legend_text(plan: &Plan, curve: &[(String, String)], cells: &[(usize, usize)], look: usize) -> String {
    let with_long_name = |short: &str| match labels::integrator_long_name(short) {
        Some(long) => format!("{short} ({long})"),
        None => short.to_owned(),
    };
    let part = |(axis, value): &(String, String)| {
        if labels::is_integrator_axis(plan, axis) { with_long_name(value) } else { format!("{axis} = {value}") }
    };
    if curve.is_empty() {
        let mut all = cells.iter().filter(|(_, l)| *l == look).map(|(cell, _)| &plan.cells[*cell].config.integrator);
        let first = all.next().filter(|first| all.all(|other| other == *first));
        return first.map_or(String::new(), |integrator| with_long_name(integrator));
    }
    curve.iter().map(part).collect::<Vec<_>>().join(", ")
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map(|first| first.to_uppercase().chain(letters).collect()).unwrap_or_default()
}

/// `convergence_scene=box_depth=5`, made fit for file names and different from all stems in `taken`.
fn unique_stem(name: &str, facet: &[(String, String)], taken: &mut BTreeSet<String>) -> String {
    let parts = std::iter::once(name.to_owned()).chain(facet.iter().map(|(axis, value)| format!("{axis}={value}")));
    let fit = |c: char| if c.is_ascii_alphanumeric() || "-_=.".contains(c) { c } else { '_' };
    let mut stem: String = parts.collect::<Vec<_>>().join("_").chars().map(fit).take(LONGEST_STEM).collect();
    if stem.is_empty() || stem.starts_with('.') {
        stem.insert(0, '_');
    }
    let mut unique = stem.clone();
    let mut number = 2;
    // Case is ignored, since some file systems do not tell it.
    while !taken.insert(unique.to_lowercase()) {
        unique = format!("{stem}-{number}");
        number += 1;
    }
    unique
}

#[cfg(test)]
mod tests;
