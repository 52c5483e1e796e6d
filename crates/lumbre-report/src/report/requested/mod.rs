//! Figures, tables and sheets that a script requests, drawn and printed at the end of a night.
//!
//! Runs are grouped by the axes of the request as in a report, and lines and means are those of
//! reports.

mod caption;
mod figures;
mod roles;
mod sheets;
mod tables;

pub use figures::{FigureFiles, figures};
pub use sheets::{RunFiles, sheets};
pub use tables::tables;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use lumbre_night::experiment::{CellRef, Night, Outcome};

/// Returns a night as figures and tables show it at its end: without duplicate cells of the A/A
/// check and without noise floors. `device` returns the device of a run with this outcome; times of
/// different devices are shown separately, unless every backend has a single device, since the
/// comparison of devices is intended then.
pub fn night(night: &Night, device: impl Fn(CellRef, &Outcome) -> Option<String>) -> Night {
    let known = night.runs.iter().enumerate().filter_map(|(i, run)| {
        let device = device(CellRef::Cell(i), run.state.outcome()?)?;
        Some((i, (run.backend.as_str(), device)))
    });
    let mut known: BTreeMap<usize, (&str, String)> = known.collect();
    let pairs: BTreeSet<_> = known.values().collect();
    let backends: BTreeSet<&str> = known.values().map(|(backend, _)| *backend).collect();
    if backends.len() == pairs.len() {
        known.clear();
    }
    let devices: BTreeMap<usize, String> = known
        .into_iter()
        .map(|(i, (_, device))| (i, device))
        .collect();
    let mut shown = night.clone();
    for (i, run) in shown.runs.iter_mut().enumerate() {
        let device = devices.get(&i).cloned();
        if device.is_some() || !run.floors.is_empty() {
            let run = Arc::make_mut(run);
            (run.device, run.floors) = (device, Vec::new());
        }
    }
    shown.without_doubles()
}

#[cfg(test)]
mod tests;
