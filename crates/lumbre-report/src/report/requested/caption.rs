//! Captions of requested tables.

use crate::format;
use crate::quantity::{self, Bound};
use crate::report::study::{Study, is_integrator_axis};
use crate::table::TableCell;
use lumbre_night::experiment::spec::TableSpec;

/// Labels and cells of a row.
type Row = (Vec<String>, Vec<TableCell>);

/// Builds the caption: the value, the number of runs averaged, notation, runs and points that are
/// left out, and long names.
pub(super) fn caption(study: &Study, spec: &TableSpec, rows: &[Row]) -> String {
    let mut sentences = vec![format!(
        "{}, {}.",
        quantity::title(&study.metrics, &spec.value),
        averaging(study, spec, rows)
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
    match study.all().filter(|m| !m.run.is_done()).count() {
        0 => {}
        1 => sentences.push("1 run has not finished and is left out.".to_owned()),
        n => sentences.push(format!("{n} runs have not finished and are left out.")),
    }
    let absent = study.nights.iter().flat_map(|night| &night.plan.absent);
    sentences.extend(absent.map(|(reason, count)| match count {
        1 => format!("1 point is left out: {reason}."),
        _ => format!("{count} points are left out: {reason}."),
    }));
    sentences.extend(study.bias_sentences());
    sentences.extend(long_names(study, spec));
    sentences.join(" ")
}

fn cells(rows: &[Row]) -> impl Iterator<Item = &TableCell> {
    rows.iter().flat_map(|(_, cells)| cells)
}

/// Describes what a cell averages, such as `mean of 4 runs (over radius, repeats)`.
fn averaging(study: &Study, spec: &TableSpec, rows: &[Row]) -> String {
    let runs = || cells(rows).map(|c| c.runs).filter(|n| *n > 0);
    let (least, most) = (runs().min().unwrap_or(0), runs().max().unwrap_or(0));
    let in_table = |axis: &String| spec.rows.contains(axis) || spec.cols.contains(axis);
    let mut over = study.axes();
    over.retain(|axis| !in_table(axis) && study.values(axis).len() > 1);
    if study.all().any(|m| m.run.repeat > 0) {
        over.push("repeats".to_owned());
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
fn long_names(study: &Study, spec: &TableSpec) -> Option<String> {
    let mut axes = spec.rows.iter().chain(&spec.cols);
    let axis = axes.find(|axis| is_integrator_axis(study.nights, axis))?;
    let values = study.values(axis).into_iter();
    let named: Vec<String> = values
        .filter_map(|name| Some((study.name(&name), format::integrator_long_name(&name)?)))
        .filter(|(name, long)| name != long)
        .map(|(name, long)| format!("{name}: {long}"))
        .collect();
    (!named.is_empty()).then(|| named.join("; ") + ".")
}
