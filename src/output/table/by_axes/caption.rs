//! Captions of tables.

use std::collections::BTreeSet;

use crate::experiment::plan::{Cell, Plan};
use crate::experiment::spec::TableSpec;
use crate::output::format;
use crate::output::quantity::{self, Bound};
use crate::output::table::TableCell;
use lumbre_render::denoise::BIAS;

/// Labels and cells of a row.
type Row = (Vec<String>, Vec<TableCell>);

/// Builds the caption: the value, the number of runs averaged, notation, runs and points that are
/// left out, and long names. `unfinished` is the number of runs that have not finished.
pub(super) fn caption(plan: &Plan, spec: &TableSpec, rows: &[Row], unfinished: usize) -> String {
    let mut sentences = vec![format!(
        "{}, {}.",
        quantity::title(plan, &spec.value),
        averaging(plan, spec, rows)
    )];
    if cells(rows).any(|c| c.interval.is_some()) {
        sentences.push(
            "±: half-width of the 95 % confidence interval of the mean over repeats (Student's t)."
                .to_owned(),
        );
    }
    let bounds: Vec<Bound> = cells(rows).map(|c| c.bound).collect();
    let explanations = Bound::explanations(&bounds);
    if !explanations.is_empty() {
        sentences.push(explanations);
    }
    if unfinished > 0 {
        sentences.push(match unfinished {
            1 => "1 run has not finished and is left out.".to_owned(),
            n => format!("{n} runs have not finished and are left out."),
        });
    }
    sentences.extend(plan.absent().iter().map(|(reason, count)| match count {
        1 => format!("1 point is left out: {reason}."),
        _ => format!("{count} points are left out: {reason}."),
    }));
    let denoised = |cell: &Cell| cell.config.denoise.is_some();
    if plan.cells.iter().any(denoised) {
        sentences.push(BIAS.to_owned());
    }
    sentences.extend(plan.biased_references());
    sentences.extend(long_names(plan, spec));
    sentences.join(" ")
}

fn cells(rows: &[Row]) -> impl Iterator<Item = &TableCell> {
    rows.iter().flat_map(|(_, cells)| cells)
}

/// Describes what a cell averages, such as `mean of 4 runs (over radius, repeats)`.
fn averaging(plan: &Plan, spec: &TableSpec, rows: &[Row]) -> String {
    let runs = || cells(rows).map(|c| c.runs).filter(|n| *n > 0);
    let (least, most) = (runs().min().unwrap_or(0), runs().max().unwrap_or(0));
    let varies = |axis: &&String| {
        let values = (0..plan.cells.len())
            .map(|cell| format::axis_value(plan, cell, axis).map(ToString::to_string));
        values.collect::<BTreeSet<_>>().len() > 1
    };
    let in_table = |axis: &&String| spec.rows.contains(axis) || spec.cols.contains(axis);
    let mut over: Vec<&str> = plan
        .axes
        .iter()
        .filter(|a| !in_table(a))
        .filter(varies)
        .map(String::as_str)
        .collect();
    if plan.cells.iter().any(|c| c.repeat > 0) {
        over.push("repeats");
    }
    let over = if over.is_empty() || most < 2 {
        String::new()
    } else {
        format!(" (over {})", over.join(", "))
    };
    match (least, most) {
        (_, 0) => "no finished run yet".to_owned(),
        (_, 1) => "one run each".to_owned(),
        _ if least == most => format!("mean of {most} runs{over}"),
        _ => format!("mean of {least} to {most} runs{over}"),
    }
}

/// Returns long names such as `bpt: path tracing.` of the integrators in the labels.
fn long_names(plan: &Plan, spec: &TableSpec) -> Option<String> {
    let axis = spec
        .rows
        .iter()
        .chain(&spec.cols)
        .find(|axis| format::is_integrator_axis(plan, axis))?;
    let mut seen = BTreeSet::new();
    let values =
        (0..plan.cells.len()).filter_map(|cell| format::axis_value(plan, cell, axis)?.as_str());
    let named: Vec<String> = values
        .filter(|name| seen.insert(*name))
        .filter_map(|name| Some((plan.report.name(name), format::integrator_long_name(name)?)))
        .filter(|(name, long)| name != long)
        .map(|(name, long)| format!("{name}: {long}"))
        .collect();
    (!named.is_empty()).then(|| named.join("; ") + ".")
}
