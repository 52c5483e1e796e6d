//! Figures, tables and sheets that a script requests, drawn and printed at the end of a night, and
//! shown first in its report.
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

use super::item::ReportItem;
use super::study::Study;
use crate::provenance::Provenance;
use crate::table::Table;
use lumbre_night::experiment::{CellRef, Night, Outcome};

/// Heading under which a report lists what its script requests.
pub(super) const SECTION: &str = "Requested by the script";

/// Returns what the script of a study requests, figures before tables, each in the order of the
/// script. Only studies of one night have it: what one script requests need not suit another.
pub(super) fn items(study: &Study) -> Vec<ReportItem> {
    let [stored] = study.nights else {
        return Vec::new();
    };
    let shown = night(stored, |cell, _| match cell {
        CellRef::Cell(i) => stored.runs.get(i)?.device.clone(),
        CellRef::Reference(_) => None,
    });
    let provenance = Provenance::from_members(study.all());
    let mut items = Vec::new();
    for spec in &shown.plan.figures {
        items.extend(figures(&shown, spec).into_iter().map(|files| ReportItem {
            extra: vec![("csv", files.csv.into_bytes())],
            ..ReportItem::figure(
                SECTION,
                format!("requested/{}", files.stem),
                files.title,
                format!("Figure `{}` of the script.", spec.name),
                files.svg,
                provenance.clone(),
            )
        }));
    }
    let tables = shown
        .plan
        .tables
        .iter()
        .flat_map(|spec| tables(&shown, spec));
    items.extend(tables.map(|table| {
        let stem = format!("requested/{}", table.name);
        let table = Table {
            section: SECTION.to_owned(),
            ..table
        };
        ReportItem {
            stem,
            ..ReportItem::table(table)
        }
    }));
    items
}

/// Returns a night as figures and tables show it at its end: without duplicate cells of the A/A
/// check. `device` returns the device of a run with this outcome; times of different devices are
/// shown separately, unless every backend has a single device, since the comparison of devices is
/// intended then.
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
        if device != run.device {
            Arc::make_mut(run).device = device;
        }
    }
    shown.without_doubles()
}

#[cfg(test)]
mod tests;
