//! Tables over axes: one number for each combination of row and column, averaged over all other
//! axes and repeats.
//!
//! [`tables`] computes them from the results of a night.

mod caption;

use std::collections::{BTreeMap, BTreeSet};

use super::ranking::Ranking;
use super::{Digits, Table, TableCell};
use crate::experiment::plan::Plan;
use crate::experiment::spec::TableSpec;
use crate::experiment::{CellRef, CellResult};
use crate::output::devices::Devices;
use crate::output::format;
use crate::output::provenance::Provenance;
use crate::output::quantity::{self, Bound, RunValue, is_finished};

/// Labels of a row and of a column.
type CellKey = (Vec<String>, Vec<String>);

/// Computes the tables of a specification: one table, or one for each device if the value is a
/// time and the night used several devices.
pub fn tables(
    plan: &Plan,
    spec: &TableSpec,
    results: &[CellResult],
    devices: &Devices,
) -> Vec<Table> {
    if !(devices.is_mixed() && spec.value.is_clock()) {
        return vec![build(plan, spec, results)];
    }
    let missing = count_unfinished(plan, results);
    let device_table = |(i, device): (usize, &str)| {
        let is_on_device = |cell: usize| devices.device_of(cell) == device;
        let on_device =
            |r: &&CellResult| matches!(r.cell, CellRef::Cell(cell) if is_on_device(cell));
        let table = build_from(plan, spec, results.iter().filter(on_device), missing);
        let rows = table
            .rows
            .into_iter()
            .filter(|row| row.1.iter().any(|c| c.runs > 0))
            .collect();
        Table {
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
pub fn build(plan: &Plan, spec: &TableSpec, results: &[CellResult]) -> Table {
    build_from(plan, spec, results.iter(), count_unfinished(plan, results))
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
) -> Table {
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
        let cells = column_keys.iter().map(cell).collect();
        let labels = labels.iter().map(|label| plan.report.name(label));
        (labels.collect(), cells)
    };
    let rows: Vec<(Vec<String>, Vec<TableCell>)> = distinct_labels(plan, &spec.rows)
        .into_iter()
        .map(row)
        .collect();
    Table {
        name: spec.name.clone(),
        section: String::new(),
        title: spec.name.clone(),
        caption: caption::caption(plan, spec, &rows, missing),
        unit: String::new(),
        label_headers: spec.rows.clone(),
        groups: vec![(String::new(), column_keys.len())],
        columns: column_keys
            .iter()
            .map(|values| column_header(plan, spec, values))
            .collect(),
        rows,
        digits: Digits::Significant(4),
        provenance: Provenance::default(),
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

/// Averages the values of some runs, given with their cell indices. The mean has an interval only
/// if all runs are repeats of one configuration, since otherwise the interval has no meaning.
fn average(plan: &Plan, samples: &[(usize, RunValue)]) -> TableCell {
    let values: Vec<RunValue> = samples.iter().map(|(_, value)| *value).collect();
    let mean = TableCell::mean(&values, Ranking::Unranked);
    let are_repeats = samples
        .windows(2)
        .all(|two| plan.cells[two[0].0].point == plan.cells[two[1].0].point);
    TableCell {
        interval: mean
            .interval
            .filter(|_| are_repeats && mean.bound == Bound::Exact),
        ..mean
    }
}

#[cfg(test)]
mod tests;
