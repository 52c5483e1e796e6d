//! Convergence figures: error against render time or samples, one SVG for each combination of facet values.
//!
//! Here the figure's data is gathered; the module `layout` places and draws it. Only cells are drawn: references have no
//! metrics. Interrupted and failed cells are drawn as far as they were measured.

pub(super) mod axis;
mod layout;
pub(super) mod raster;
pub(super) mod sheet;
pub(super) mod style;
pub(super) mod svg;

use std::collections::{BTreeMap, BTreeSet};

pub use raster::rasterize;
pub use sheet::sheets;

use super::labels;
use crate::experiment::plan::Plan;
use crate::experiment::spec::{FigureSpec, FigureX};
use crate::experiment::{CellRef, CellResult, WaveRow};
use axis::Scale;
use style::{Style, style};

/// Longest file stem in bytes, so that it fits every file system with a suffix and an extension.
const LONGEST_STEM: usize = 120;

/// Axis names with the text of their values.
type Pairs = Vec<(String, String)>;

/// One picture's data.
struct Figure {
    title: String,
    /// One line below the title, empty if there is nothing to say.
    subtitle: String,
    description: String,
    x_label: &'static str,
    panels: Vec<Panel>,
    legend: Vec<(String, Style)>,
}

/// One metric of a picture.
struct Panel {
    heading: String,
    /// The metric's column, where it has a name of its own, and its options in words.
    details: String,
    y_label: String,
    scale: Scale,
    curves: Vec<Curve>,
}

/// The measurements of one cell.
struct Curve {
    style: Style,
    /// Whether other cells have the same style: then it is drawn thin.
    shared: bool,
    /// Points that have a place on the axes, in the order of measurement.
    points: Vec<(f64, f64)>,
}

/// The figures of a specification: a file stem (letters, digits, `-`, `_`, `=` and `.`, unique) and an SVG for each
/// combination of facet values of which anything was measured, in the order of the plan.
///
/// Errors have a logarithmic axis; a metric with a best value of 1, such as SSIM, is drawn as 1 − value; PSNR has a
/// linear axis. Values without a place on their axis (zero, negative, NaN) are left out. Curves with the same value of
/// `by` look alike in all figures of the specification.
pub fn figures(plan: &Plan, spec: &FigureSpec, results: &[CellResult]) -> Vec<(String, String)> {
    let rows: BTreeMap<usize, &[WaveRow]> = results
        .iter()
        .filter_map(|r| match r.cell {
            CellRef::Cell(cell) if cell < plan.cells.len() && !r.rows.is_empty() => Some((cell, r.rows.as_slice())),
            _ => None,
        })
        .collect();
    let by = curve_axes(plan, spec);
    let mut styles: Vec<Pairs> = Vec::new();
    // Of every facet the measured cells, each with the number of its look.
    let mut facets: Vec<(Pairs, Vec<(usize, usize)>)> = Vec::new();
    for cell in 0..plan.cells.len() {
        let curve = pairs(plan, &by, cell);
        let look = styles.iter().position(|s| *s == curve).unwrap_or_else(|| {
            styles.push(curve);
            styles.len() - 1
        });
        if !rows.contains_key(&cell) {
            continue;
        }
        let facet = pairs(plan, &spec.facet, cell);
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
            (stem, layout::draw(&gather(plan, spec, &rows, &styles, facet, cells)))
        })
        .collect()
}

/// The axes that distinguish curves: `by`, or else all that vary and are no facet.
fn curve_axes(plan: &Plan, spec: &FigureSpec) -> Vec<String> {
    let varies = |axis: &&String| {
        let first = labels::axis_value(plan, 0, axis);
        (0..plan.cells.len()).any(|cell| labels::axis_value(plan, cell, axis) != first)
    };
    match &spec.by {
        Some(by) => vec![by.clone()],
        None => plan.axes.iter().filter(|a| !spec.facet.contains(a)).filter(varies).cloned().collect(),
    }
}

/// The values of some axes at a cell.
fn pairs(plan: &Plan, axes: &[String], cell: usize) -> Pairs {
    let pair = |axis: &String| labels::axis_value(plan, cell, axis).map(|v| (axis.clone(), v.to_string()));
    axes.iter().filter_map(pair).collect()
}

fn gather(
    plan: &Plan,
    spec: &FigureSpec,
    rows: &BTreeMap<usize, &[WaveRow]>,
    styles: &[Pairs],
    facet: &[(String, String)],
    cells: &[(usize, usize)],
) -> Figure {
    let runs = |look: usize| cells.iter().filter(|(_, l)| *l == look).count();
    let (least, most) =
        cells.iter().map(|(_, look)| runs(*look)).fold((usize::MAX, 0), |(a, b), n| (a.min(n), b.max(n)));
    let each = if least == most { most.to_string() } else { format!("{least} to {most}") };
    let mut looks: Vec<usize> = cells.iter().map(|(_, look)| *look).collect();
    looks.sort_unstable();
    looks.dedup();
    let facet_text: Vec<String> = facet.iter().map(|(axis, value)| format!("{axis} = {value}")).collect();
    let panels = spec.y.iter().filter_map(|column| {
        let (index, metric) = labels::column(plan, column)?;
        let (row, unit) = (metric.row, metric.unit());
        let unit = if unit.is_empty() { String::new() } else { format!(" ({unit})") };
        let (scale, complement) = match row.perfect {
            best if best == f64::INFINITY => (Scale::Linear, None),
            0.0 => (Scale::Log, None),
            best => (Scale::Log, Some(best)),
        };
        let value = |x: f64| complement.map_or(x, |best| best - x);
        let prefix = complement.map_or(String::new(), |best| format!("{best} − "));
        let curves = cells.iter().map(|(cell, look)| Curve {
            style: style(*look),
            shared: runs(*look) > 1,
            points: rows[cell]
                .iter()
                .filter_map(|r| Some((x_of(spec.x, r), value(*r.metrics.get(index)?))))
                .filter(|(x, y)| Scale::Log.holds(*x) && scale.holds(*y))
                .collect(),
        });
        let named = (column != row.name).then(|| format!("column {column}"));
        let details = named.into_iter().chain([metric.describe_options()]).filter(|d| !d.is_empty());
        Some(Panel {
            heading: if prefix.is_empty() { capitalised(row.long_name) } else { format!("{prefix}{}", row.long_name) },
            details: details.collect::<Vec<_>>().join(", "),
            y_label: format!("{prefix}{}{unit}", row.label),
            scale,
            curves: curves.collect(),
        })
    });
    Figure {
        title: std::iter::once(plan.name.clone())
            .chain((!facet_text.is_empty()).then(|| facet_text.join(", ")))
            .collect::<Vec<_>>()
            .join(": "),
        subtitle: if most > 1 { format!("{each} runs of each, one thin line per run") } else { String::new() },
        description: description(plan, rows, cells),
        x_label: match spec.x {
            FigureX::RenderS => "render time (s)",
            FigureX::Samples => "samples per pixel",
        },
        panels: panels.collect(),
        legend: looks.iter().map(|look| (legend_text(plan, &styles[*look], cells, *look), style(*look))).collect(),
    }
}

fn x_of(x: FigureX, row: &WaveRow) -> f64 {
    match x {
        FigureX::RenderS => row.render_s,
        FigureX::Samples => row.samples as f64,
    }
}

/// What the legend says of a curve: `depth = 5`, or `bpt (backward path tracing)` where the axis is the integrator.
fn legend_text(plan: &Plan, curve: &[(String, String)], cells: &[(usize, usize)], look: usize) -> String {
    let with_long_name = |short: &str| match labels::integrator_long_name(short) {
        Some(long) => format!("{short} ({long})"),
        None => short.to_owned(),
    };
    let part = |(axis, value): &(String, String)| {
        if labels::is_integrator_axis(plan, axis) { with_long_name(value) } else { format!("{axis} = {value}") }
    };
    if curve.is_empty() {
        let cell = cells.iter().find(|(_, l)| *l == look).map(|(cell, _)| *cell);
        return cell.map_or(String::new(), |cell| with_long_name(&plan.cells[cell].config.integrator));
    }
    curve.iter().map(part).collect::<Vec<_>>().join(", ")
}

/// Where the numbers come from, for the picture's metadata.
fn description(plan: &Plan, rows: &BTreeMap<usize, &[WaveRow]>, cells: &[(usize, usize)]) -> String {
    let mut text = format!("lumbre {}\nplan {} {}", env!("CARGO_PKG_VERSION"), plan.name, plan.hash);
    for (index, _) in cells {
        let cell = &plan.cells[*index];
        let samples = rows[index].last().map_or(0, |r| r.samples);
        text += &format!("\nrun {} {} seed={} samples={samples}", cell.id, cell.path, cell.seed);
    }
    text
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
