//! Tables of a report: sampling rates, errors at equal time, times to equal error or to a
//! threshold, final values, efficiency, and acceleration structures.
//!
//! The best value of a row is bold only if it is significantly better than every other one. The
//! module `ranking` describes the test.

mod errors;
mod rates;

use super::ReportError;
use super::item::ReportItem;
use super::study::{Member, ReportOptions, Study};
use crate::provenance::Provenance;
use crate::quantity::{Bound, RunValue};
use crate::table::ranking::Ranking;
use crate::table::{Digits, Table, TableCell, TableKind};
pub(super) use errors::{common_error, common_time, equal_time};
use lumbre_night::experiment::night::run::Run;

/// Explanation of bold and ± at the end of captions. The HTML page shows it once.
pub(super) const TEST: &str = "Bold: best value of its row and group, significantly better than \
    every other at 5 % (repeats as pairs, corrected for all pairs of the row). Means and intervals \
    are on the scale of the test. ×÷: geometric mean, and the factor by which its 95 % confidence \
    interval reaches down and up. ±, and ends in parentheses: 95 % confidence interval of the \
    mean.";

/// Explanation of the dagger at the end of captions.
const AT_FLOOR: &str = "†: at least half of the squared error can be noise of the reference.";

/// SSIM threshold of the default time-to-threshold table [S0].
const SSIM_THRESHOLD: f64 = 0.95;

/// Builds every table that the study has data for.
///
/// # Errors
/// Returns an error if an option names an unknown metric column.
pub fn all(
    study: &Study,
    options: &ReportOptions,
    notes: &mut Vec<String>,
) -> Result<Vec<ReportItem>, ReportError> {
    let mut tables = Vec::new();
    for metric in 0..study.metrics.len() {
        tables.extend(equal_time(study, options, metric));
        tables.extend(
            errors::equal_error(study, metric).filter(|table| !repeats_one_of(&tables, table)),
        );
        tables.push(errors::final_values(study, metric));
    }
    tables.extend(errors::efficiency(study));
    tables.push(rates::sampling_rates(study));
    tables.extend(rates::relative_rates(study));
    for (column, threshold) in thresholds(study, options)? {
        let metric = study
            .metrics
            .iter()
            .position(|m| m.column == column)
            .unwrap_or(0);
        tables.push(errors::time_to(study, metric, threshold));
    }
    tables.extend(rates::acceleration_structures(study));
    for sentence in study.bias_sentences() {
        for table in &mut tables {
            table.caption += &format!(" {sentence}");
        }
    }
    let unfinished = study.all().filter(|m| !m.run.is_done()).count();
    if unfinished > 0 {
        notes.push(format!(
            "{unfinished} of {} runs have not finished; tables leave them out",
            study.all().count()
        ));
    }
    let has_values = |table: &Table| {
        table
            .rows
            .iter()
            .flat_map(|(_, cells)| cells)
            .any(|cell| cell.value.is_some())
    };
    Ok(tables
        .into_iter()
        .filter(has_values)
        .map(ReportItem::table)
        .collect())
}

/// Returns whether a table of times to an equal error has the numbers of another one in every cell,
/// as that of MSE has those of RMSE.
fn repeats_one_of(tables: &[Table], table: &Table) -> bool {
    let mut times = tables
        .iter()
        .filter(|other| matches!(other.kind, TableKind::EqualError(_)));
    times.any(|other| {
        let (own, theirs) = (table.cells(), other.cells());
        own.len() == theirs.len() && own.iter().zip(theirs).all(|(a, b)| is_same_number(a, b))
    })
}

/// Returns whether two cells have the same number up to rounding, or none.
fn is_same_number(a: &TableCell, b: &TableCell) -> bool {
    match (a.value, b.value) {
        (Some(x), Some(y)) => a.bound == b.bound && (x - y).abs() <= 1e-9 * x.abs(),
        (x, y) => x == y,
    }
}

/// Returns the thresholds of the options, and the default threshold of every SSIM column without
/// one.
fn thresholds(study: &Study, options: &ReportOptions) -> Result<Vec<(String, f64)>, ReportError> {
    let known = |column: &String| study.metrics.iter().any(|m| m.column == *column);
    let mut thresholds = options.thresholds.clone();
    if let Some((column, _)) = thresholds.iter().find(|(column, _)| !known(column)) {
        let all: Vec<&str> = study.metrics.iter().map(|m| m.column.as_str()).collect();
        return Err(ReportError::NoColumn {
            column: column.clone(),
            known: all.join(", "),
        });
    }
    for metric in study.metrics.iter().filter(|m| m.row.name == "ssim") {
        if !thresholds
            .iter()
            .any(|(column, _)| *column == metric.column)
        {
            thresholds.push((metric.column.clone(), SSIM_THRESHOLD));
        }
    }
    Ok(thresholds)
}

/// Creates a table over facets and series without rows.
fn empty_table(
    study: &Study,
    section: &str,
    name: &str,
    title: &str,
    caption: String,
    unit: &str,
    digits: Digits,
) -> Table {
    let groups = study.groups();
    let span = |group: &String| study.series.iter().filter(|s| s.group == *group).count();
    Table {
        name: name.to_owned(),
        kind: TableKind::Other,
        section: section.to_owned(),
        title: title.to_owned(),
        caption,
        unit: unit.to_owned(),
        label_headers: study.facet_axes.clone(),
        groups: groups
            .iter()
            .map(|group| (group.clone(), span(group)))
            .collect(),
        columns: study.series.iter().map(|s| s.label.clone()).collect(),
        rows: Vec::new(),
        digits,
        provenance: Provenance::from_members(study.all().filter(|m| m.run.is_done())),
    }
}

/// Fills a table with means over finished repeats. `value` returns the value of a run in a facet.
fn fill_table(
    study: &Study,
    mut table: Table,
    ranking: Ranking,
    value: impl Fn(usize, &Member) -> Option<RunValue>,
) -> Table {
    for facet in 0..study.facets.len() {
        let (mut samples, mut cells): (Vec<Vec<_>>, Vec<TableCell>) = Default::default();
        let mut complete = Vec::new();
        for series in 0..study.series.len() {
            let finished = study.finished(facet, series);
            let known = finished
                .iter()
                .filter_map(|m| Some((m.run, value(facet, m)?)));
            let (runs, values): (Vec<&Run>, Vec<RunValue>) = known.unzip();
            complete.push(values.len() == finished.len());
            cells.push(TableCell {
                run_ids: runs.iter().map(|run| run.id.clone()).collect(),
                ..TableCell::mean(&values, ranking)
            });
            samples.push(runs.iter().map(|run| run.repeat).zip(values).collect());
        }
        let mut first = 0;
        for (_, span) in &table.groups {
            let group = first..first + span;
            // A finished run without a value might have been better, so nothing is compared then.
            let is_complete = complete[group.clone()].iter().all(|all| *all);
            let comparison = ranking.compare(&samples[group.clone()]);
            if let Some(comparison) = comparison.filter(|_| is_complete) {
                cells[first + comparison.best].best = comparison.is_significant();
                for (cell, contrast) in cells[group].iter_mut().zip(comparison.contrasts) {
                    cell.contrast = contrast;
                }
            }
            first += span;
        }
        table.rows.push((study.facet_values(facet), cells));
    }
    let has_repeats = table
        .rows
        .iter()
        .flat_map(|(_, cells)| cells)
        .any(|cell| cell.runs > 1);
    if has_repeats && !matches!(ranking, Ranking::Unranked) {
        table.caption += " ";
        table.caption += TEST;
    }
    let cells = table.rows.iter().flat_map(|(_, cells)| cells);
    let bounds: Vec<Bound> = cells.map(|cell| cell.bound).collect();
    let explanations = Bound::explanations(&bounds);
    if !explanations.is_empty() {
        table.caption += " ";
        table.caption += &explanations;
    }
    table
}

/// Marks the cells in which a finished run's value of a metric is dominated by the noise of its
/// reference. `value` returns the metric's value of a run in a facet.
fn mark_noise_floors(
    study: &Study,
    table: &mut Table,
    metric: usize,
    value: impl Fn(usize, &Member) -> Option<f64>,
) {
    let spec = &study.metrics[metric];
    let is_at_floor = |facet: usize, member: &Member| {
        let floor = member.run.floor(&spec.column);
        let both = value(facet, member).zip(floor);
        both.is_some_and(|(value, floor)| spec.is_at_floor(value, floor.value))
    };
    let mut any = false;
    for (facet, (_, cells)) in table.rows.iter_mut().enumerate() {
        for (series, cell) in cells.iter_mut().enumerate() {
            let finished = study.finished(facet, series);
            cell.at_floor = finished.iter().any(|member| is_at_floor(facet, member));
            any |= cell.at_floor;
        }
    }
    if any {
        table.caption += " ";
        table.caption += AT_FLOOR;
    }
}

/// Appends the devices to a caption.
fn with_devices(study: &Study, caption: &str) -> String {
    match study.device_sentence("Measured") {
        Some(devices) => format!("{caption} {devices}"),
        None => caption.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_with_a_run_below_the_threshold_has_a_median() {
        let lower = RunValue::bounded(3.0, Bound::Lower);
        let two = [1.0, 2.0].map(RunValue::exact);
        let cell = TableCell::mean(&[two[0], two[1], lower], Ranking::ShorterTime);
        assert_eq!(
            (cell.bound, cell.value, cell.runs),
            (Bound::Median, Some(2.0), 3)
        );
        let cell = TableCell::mean(&[two[0], lower, lower], Ranking::ShorterTime);
        assert_eq!((cell.bound, cell.value), (Bound::Lower, Some(3.0)));
        let cell = TableCell::mean(&[], Ranking::ShorterTime);
        assert_eq!(cell, TableCell::default());
    }
}
