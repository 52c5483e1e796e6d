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

use std::collections::BTreeMap;
use std::path::PathBuf;

use crate::experiment::night_results::{NightResults, RunResult, RunState};
use crate::experiment::plan::Plan;
use crate::experiment::{CellRef, CellResult, Outcome};
use crate::output::devices::Devices;

/// Collects the results of a plan, whose cells without a result are pending. Duplicate cells of the
/// A/A check are left out, as are files, references and what only files state.
pub fn night(plan: &Plan, results: &[CellResult], devices: &Devices) -> NightResults {
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
            folder: PathBuf::new(),
            point: cell.point.clone(),
            repeat: u64::from(cell.repeat),
            seed: cell.seed,
            integrator: cell.config.integrator.clone(),
            denoise: cell.config.denoise.as_ref().map(|d| d.name().to_owned()),
            scene: cell.config.scene.clone(),
            max_depth: None,
            resolution: None,
            device: devices.device_of(index).map(str::to_owned),
            lanes: None,
            peer: None,
            lost_share: None,
            state,
            rows: result.map(|result| result.rows.clone()).unwrap_or_default(),
            reference: None,
            pictures: Vec::new(),
            films: Vec::new(),
            open: result.map(|result| result.open.clone()),
            floors: Vec::new(),
        }
    };
    NightResults {
        folder: PathBuf::new(),
        name: plan.name.clone(),
        plan: plan.hash.clone(),
        seed: plan.seed,
        axes: plan.axes.clone(),
        metrics: plan.measure.metrics.clone(),
        report: plan.report.clone(),
        order: String::new(),
        machine: None,
        runs: runs.map(run).collect(),
        references: Vec::new(),
        notes: Vec::new(),
    }
}

#[cfg(test)]
mod tests;
