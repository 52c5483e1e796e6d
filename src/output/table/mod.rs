//! Tables over axes: one number for each combination of row and column, averaged over all other
//! axes and repeats.
//!
//! [`tables`] computes [`TableData`] from the results of a night. It is written as Markdown or CSV.

mod caption;
pub(super) mod export;

use std::collections::{BTreeMap, BTreeSet};

use super::devices::Devices;
use super::format;
use super::quantity::{self, Bound, RunValue};
use crate::experiment::plan::Plan;
use crate::experiment::spec::TableSpec;
use crate::experiment::{CellRef, CellResult, Outcome};
use lumbre_light::math::t_test::mean_and_interval;

/// A computed table.
#[derive(Clone, Debug, PartialEq)]
pub struct TableData {
    /// Name of the table and of its files.
    pub name: String,
    /// Description of the numbers, with long names, units, and the number of runs averaged.
    pub caption: String,
    /// Names of the axes that form the rows, which head the label columns.
    pub row_axes: Vec<String>,
    /// Headers of the value columns.
    pub columns: Vec<String>,
    /// Rows in plan order.
    pub rows: Vec<TableRow>,
}

/// One row of a table.
#[derive(Clone, Debug, PartialEq)]
pub struct TableRow {
    /// Values of the row's axes.
    pub labels: Vec<String>,
    /// One cell for each value column.
    pub cells: Vec<TableCell>,
}

/// One number of a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TableCell {
    /// Mean of the runs' values.
    pub value: CellValue,
    /// Number of finished runs averaged.
    pub runs: usize,
    /// Half-width of the 95 % confidence interval of the mean, by Student's t. `None` unless all
    /// runs are repeats of one configuration, since otherwise the interval has no meaning.
    pub ci95_half: Option<f64>,
}

/// Value of a cell of a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CellValue {
    /// No finished run has this value.
    Empty,
    /// Mean over the runs.
    Mean(f64),
    /// Bound of the mean time in seconds, not exact: a run that did not reach the threshold enters
    /// the mean with its total render time, and one that had reached it at its first measurement
    /// with the time of that.
    Bounded(f64, Bound),
}

/// Labels of a row and of a column.
type CellKey = (Vec<String>, Vec<String>);

/// Computes the tables of a specification: one table, or one for each device if the value is a
/// time and the night used several devices.
pub fn tables(
    plan: &Plan,
    spec: &TableSpec,
    results: &[CellResult],
    devices: &Devices,
) -> Vec<TableData> {
    if !(devices.is_mixed() && spec.value.is_clock()) {
        return vec![build(plan, spec, results)];
    }
    let missing = count_unfinished(plan, results);
    let device_table = |(i, device): (usize, &str)| {
        let is_on_device = |cell: usize| devices.device_of(cell) == device;
        let on_device =
            |r: &&CellResult| matches!(r.cell, CellRef::Cell(cell) if is_on_device(cell));
        let table = build_from(plan, spec, results.iter().filter(on_device), missing);
        let rows: Vec<TableRow> = table
            .rows
            .into_iter()
            .filter(|row| row.cells.iter().any(|c| c.runs > 0))
            .collect();
        TableData {
            name: format!("{}-device-{}", spec.name, i + 1),
            caption: format!("{} Only runs on {device}.", table.caption),
            rows,
            ..table
        }
    };
    devices
        .names()
        .into_iter()
        .enumerate()
        .map(device_table)
        .collect()
}

/// Computes a table. Runs that failed, were interrupted or never started are left out. The caption
/// reports their number.
pub fn build(plan: &Plan, spec: &TableSpec, results: &[CellResult]) -> TableData {
    build_from(plan, spec, results.iter(), count_unfinished(plan, results))
}

/// Returns whether a result is a finished run that tables include. Duplicate runs of the A/A check
/// are not included.
pub(super) fn is_finished(plan: &Plan, result: &CellResult) -> bool {
    let is_result = |cell: usize| plan.cells.get(cell).is_some_and(|c| c.double_of.is_none());
    matches!(result.cell, CellRef::Cell(cell) if is_result(cell))
        && matches!(result.outcome, Outcome::Done(_) | Outcome::Cached(_))
}

/// Counts the runs of a plan that tables leave out because they have not finished.
fn count_unfinished(plan: &Plan, results: &[CellResult]) -> usize {
    let planned = plan
        .cells
        .iter()
        .filter(|cell| cell.double_of.is_none())
        .count();
    planned.saturating_sub(
        results
            .iter()
            .filter(|result| is_finished(plan, result))
            .count(),
    )
}

/// Computes a table from a subset of the results. `missing` is the number of unfinished runs.
fn build_from<'a>(
    plan: &Plan,
    spec: &TableSpec,
    results: impl Iterator<Item = &'a CellResult>,
    missing: usize,
) -> TableData {
    let mut samples: BTreeMap<CellKey, Vec<(usize, RunValue)>> = BTreeMap::new();
    for result in results.filter(|result| is_finished(plan, result)) {
        let CellRef::Cell(cell) = result.cell else {
            continue;
        };
        if let Some(value) = quantity::run_value(plan, &spec.value, result) {
            samples
                .entry((
                    axis_labels(plan, &spec.rows, cell),
                    axis_labels(plan, &spec.cols, cell),
                ))
                .or_default()
                .push((cell, value));
        }
    }
    let column_keys = distinct_labels(plan, &spec.cols);
    let row = |labels: Vec<String>| {
        let cell = |column: &Vec<String>| {
            let values = samples.get(&(labels.clone(), column.clone()));
            average(plan, values.map_or(&[], Vec::as_slice))
        };
        TableRow {
            cells: column_keys.iter().map(cell).collect(),
            labels: labels.iter().map(|label| plan.report.name(label)).collect(),
        }
    };
    let rows: Vec<TableRow> = distinct_labels(plan, &spec.rows)
        .into_iter()
        .map(row)
        .collect();
    TableData {
        name: spec.name.clone(),
        caption: caption::caption(plan, spec, &rows, missing),
        row_axes: spec.rows.clone(),
        columns: column_keys
            .iter()
            .map(|values| column_header(plan, spec, values))
            .collect(),
        rows,
    }
}

/// Returns the values of a cell on some axes; an en dash where the cell has no value.
fn axis_labels(plan: &Plan, axes: &[String], cell: usize) -> Vec<String> {
    let value = |axis: &String| {
        format::axis_value(plan, cell, axis).map_or("–".to_owned(), ToString::to_string)
    };
    axes.iter().map(value).collect()
}

/// Returns the distinct combinations of values on some axes, in plan order.
fn distinct_labels(plan: &Plan, axes: &[String]) -> Vec<Vec<String>> {
    let mut seen = BTreeSet::new();
    (0..plan.cells.len())
        .map(|cell| axis_labels(plan, axes, cell))
        .filter(|labels| seen.insert(labels.clone()))
        .collect()
}

fn column_header(plan: &Plan, spec: &TableSpec, values: &[String]) -> String {
    if spec.cols.is_empty() {
        return quantity::label(plan, &spec.value);
    }
    let pairs: Vec<String> = spec
        .cols
        .iter()
        .zip(values)
        .map(|(axis, v)| format!("{axis} = {}", plan.report.name(v)))
        .collect();
    pairs.join(", ")
}

/// Averages the values of some runs, given with their cell indices.
fn average(plan: &Plan, samples: &[(usize, RunValue)]) -> TableCell {
    let runs = samples.len();
    let values: Vec<f64> = samples.iter().map(|(_, value)| value.number).collect();
    let mean = values.iter().sum::<f64>() / runs.max(1) as f64;
    let bound = Bound::of_mean(samples.iter().map(|(_, value)| value.bound));
    let are_repeats = samples
        .windows(2)
        .all(|two| plan.cells[two[0].0].point == plan.cells[two[1].0].point);
    let ci95_half = mean_and_interval(&values)
        .1
        .filter(|half| are_repeats && bound == Bound::Exact && half.is_finite());
    let value = match (runs, bound) {
        (0, _) => CellValue::Empty,
        (_, Bound::Exact) => CellValue::Mean(mean),
        (_, bound) => CellValue::Bounded(mean, bound),
    };
    TableCell {
        value,
        runs,
        ci95_half,
    }
}

#[cfg(test)]
mod tests;
