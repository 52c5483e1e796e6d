//! Figures and tables that a script requests, drawn and printed at the end of a night.
//!
//! [`night`] collects the results that are still in memory. Runs are grouped by the axes of the
//! request as in a report, and lines and means are those of reports.

mod caption;
mod figures;
mod roles;
mod tables;

pub use figures::{FigureFiles, figures};
pub use tables::tables;

use std::collections::{BTreeMap, BTreeSet};

use crate::experiment::night_results::{NightResults, RunResult, RunState};
use crate::experiment::plan::Plan;
use crate::experiment::{CellRef, CellResult, Outcome};

/// Collects the results of a plan, whose cells without a result are pending. Duplicate cells of the
/// A/A check are left out, as are files, references and what only files state. `device` returns the
/// device of a result; times of different devices are shown separately.
pub fn night(
    plan: &Plan,
    results: &[CellResult],
    device: impl Fn(&CellResult) -> Option<String>,
) -> NightResults {
    let mut devices = mixed_devices(plan, results, device);
    let by_cell: BTreeMap<CellRef, &CellResult> = results.iter().map(|r| (r.cell, r)).collect();
    let cells = plan.cells.iter().enumerate();
    let runs = cells.filter(|(_, cell)| cell.double_of.is_none());
    let run = |(index, cell): (usize, &crate::experiment::Cell)| {
        let result = by_cell.get(&CellRef::Cell(index));
        let state = match result.map(|result| &result.outcome) {
            Some(Outcome::Done(cause)) => RunState::Done(cause.clause.clone()),
            Some(Outcome::Cached(_)) => RunState::Done(String::new()),
            Some(Outcome::Failed(_) | Outcome::Interrupted) => RunState::Unfinished,
            None => RunState::Pending,
        };
        RunResult {
            id: cell.id.to_string(),
            path: cell.path.clone(),
            point: cell.point.clone(),
            repeat: u64::from(cell.repeat),
            seed: cell.seed,
            integrator: cell.config.integrator.clone(),
            denoise: cell.config.denoise.as_ref().map(|d| d.name().to_owned()),
            scene: cell.config.scene.clone(),
            device: devices.remove(&index),
            state,
            rows: result.map(|result| result.rows.clone()).unwrap_or_default(),
            open: result.map(|result| result.open.clone()),
            ..RunResult::default()
        }
    };
    NightResults {
        name: plan.name.clone(),
        plan: plan.hash.clone(),
        seed: plan.seed,
        axes: plan.axes.clone(),
        metrics: plan.measure.metrics.clone(),
        report: plan.report.clone(),
        runs: runs.map(run).collect(),
        ..NightResults::default()
    }
}

/// Returns the device of every cell for which it is known; none if every backend has a single
/// device, since the comparison of devices is intended then.
fn mixed_devices(
    plan: &Plan,
    results: &[CellResult],
    device: impl Fn(&CellResult) -> Option<String>,
) -> BTreeMap<usize, String> {
    let known = results.iter().filter_map(|result| match result.cell {
        CellRef::Cell(cell) => Some((cell, device(result)?)),
        CellRef::Reference(_) => None,
    });
    let known: BTreeMap<usize, String> = known.collect();
    let backend = |cell: &usize| Some(plan.cells.get(*cell)?.config.backend.as_str());
    let pairs = known.iter();
    let pairs: BTreeSet<_> = pairs
        .filter_map(|(cell, d)| Some((backend(cell)?, d)))
        .collect();
    let backends: BTreeSet<&str> = pairs.iter().map(|(backend, _)| *backend).collect();
    if backends.len() == pairs.len() {
        return BTreeMap::new();
    }
    known
}

#[cfg(test)]
mod tests;
