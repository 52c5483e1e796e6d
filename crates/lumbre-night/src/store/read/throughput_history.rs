//! Throughput of earlier nights, read from their plans and the index.

use std::path::Path;

use super::night_reader::NightReader;
use super::run_index::RunIndex;
use crate::experiment::CellRef;
use crate::experiment::forecast::{Throughput, ThroughputHistory, WorkloadKey};
use crate::store::schema::plan::PlannedCell;
use crate::store::schema::run::DONE;

/// Collects the throughput of every finished run below `out` whose plan records what it rendered,
/// with the nights in the order of their names. Updates the index.
pub fn throughput_history(out: &Path) -> ThroughputHistory {
    let mut history = ThroughputHistory::default();
    let mut index = RunIndex::open(out);
    for night in NightReader::all(out).into_iter().flatten() {
        let plan = night.plan();
        for (i, cell) in plan.cells.iter().enumerate() {
            let Some((workload, pixels)) = workload(cell) else {
                continue;
            };
            let finished = index.finished(&night.run_folder(CellRef::Cell(i)), DONE);
            let finished = finished.ok().flatten();
            let Some((samples, render_s)) = finished.and_then(|f| f.samples.zip(f.render_s)) else {
                continue;
            };
            if samples == 0 || render_s <= 0.0 {
                continue;
            }
            let rule = plan.stops.get(cell.stop);
            history.record(
                workload,
                Throughput {
                    paths_per_s: samples as f64 * pixels / render_s,
                    ended: rule.map(|rule| (render_s, rule.text.clone())),
                    overhead: 1.0,
                },
            );
        }
    }
    index.save();
    history
}

/// Workload of a cell of a plan, and its number of pixels; `None` if its depth or size is that of
/// the scene.
fn workload(cell: &PlannedCell) -> Option<(WorkloadKey, f64)> {
    let [width, height] = cell.resolution?;
    let workload = WorkloadKey {
        integrator: cell.integrator.clone(),
        scene: cell.scene.clone(),
        backend: cell.backend.clone(),
        max_depth: cell.max_depth?,
    };
    Some((workload, f64::from(width) * f64::from(height)))
}
