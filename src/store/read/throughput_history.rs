//! Throughput of earlier nights, read from their plans and the index.

use std::path::Path;

use serde_json::Value as Json;

use super::archive::read_json;
use super::run_index::RunIndex;
use crate::experiment::forecast::{Throughput, ThroughputHistory, WorkloadKey};
use crate::store::layout;

/// Collects the throughput of every finished run below `out` whose plan records what it rendered,
/// with the nights in the order of their names. Updates the index.
pub fn throughput_history(out: &Path) -> ThroughputHistory {
    let mut history = ThroughputHistory::default();
    let mut index = RunIndex::open(out);
    for folder in layout::folders_in(out) {
        let Some(plan) = read_json(&folder.join("plan.json")) else {
            continue;
        };
        let stops = plan["stops"].as_array().map_or(&[][..], Vec::as_slice);
        for cell in plan["cells"].as_array().into_iter().flatten() {
            let Some((workload, pixels)) = read_workload(cell) else {
                continue;
            };
            let run_folder = folder
                .join("runs")
                .join(cell["folder"].as_str().unwrap_or_default());
            let finished = index.finished(&run_folder, "done.json");
            let Some((samples, render_s)) = finished.and_then(|f| f.samples.zip(f.render_s)) else {
                continue;
            };
            if samples == 0 || render_s <= 0.0 {
                continue;
            }
            let stop = cell["stop"]
                .as_u64()
                .and_then(|i| stops.get(usize::try_from(i).ok()?));
            let rule = stop
                .and_then(|stop| stop["words"].as_str())
                .map(str::to_owned);
            let ended = rule.map(|rule| (render_s, rule));
            history.record(
                workload,
                Throughput {
                    paths_per_s: samples as f64 * pixels / render_s,
                    ended,
                    overhead: 1.0,
                },
            );
        }
    }
    index.save();
    history
}

/// Workload of a cell of a plan, and its number of pixels.
fn read_workload(cell: &Json) -> Option<(WorkloadKey, f64)> {
    let text = |key: &str| cell[key].as_str().map(str::to_owned);
    let workload = WorkloadKey {
        integrator: text("integrator")?,
        scene: text("scene")?,
        backend: text("backend")?,
        max_depth: u32::try_from(cell["max_depth"].as_u64()?).ok()?,
    };
    Some((
        workload,
        cell["resolution"][0].as_f64()? * cell["resolution"][1].as_f64()?,
    ))
}
