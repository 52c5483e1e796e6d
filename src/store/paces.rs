//! How fast earlier nights rendered, from their plans and the index.

use std::path::Path;

use serde_json::Value as Json;

use super::archive::read_json;
use super::index::Index;
use super::layout;
use crate::experiment::forecast::{Kind, Pace, Paces};

/// The paces of every finished run below `out` whose plan says what it rendered, the nights in the order of their names.
/// The index is kept up to date on the way.
pub fn archived_paces(out: &Path) -> Paces {
    let mut paces = Paces::default();
    let mut index = Index::open(out);
    for folder in layout::folders_in(out) {
        let Some(plan) = read_json(&folder.join("plan.json")) else { continue };
        let stops = plan["stops"].as_array().map_or(&[][..], Vec::as_slice);
        for cell in plan["cells"].as_array().into_iter().flatten() {
            let Some((kind, pixels)) = kind(cell) else { continue };
            let place = folder.join("runs").join(cell["folder"].as_str().unwrap_or_default());
            let finished = index.finished(&place, "done.json");
            let Some((samples, render_s)) = finished.and_then(|f| f.samples.zip(f.render_s)) else { continue };
            if samples == 0 || render_s <= 0.0 {
                continue;
            }
            let stop = cell["stop"].as_u64().and_then(|i| stops.get(usize::try_from(i).ok()?));
            let words = stop.and_then(|stop| stop["words"].as_str()).map(str::to_owned);
            let ended = words.map(|words| (render_s, words));
            paces.learn(kind, Pace { paths_per_s: samples as f64 * pixels / render_s, ended, overhead: 1.0 });
        }
    }
    index.save();
    paces
}

/// What a cell of a plan renders, and its pixels.
fn kind(cell: &Json) -> Option<(Kind, f64)> {
    let text = |key: &str| cell[key].as_str().map(str::to_owned);
    let kind = Kind {
        integrator: text("integrator")?,
        scene: text("scene")?,
        backend: text("backend")?,
        max_depth: u32::try_from(cell["max_depth"].as_u64()?).ok()?,
    };
    Some((kind, cell["resolution"][0].as_f64()? * cell["resolution"][1].as_f64()?))
}
