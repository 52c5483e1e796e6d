//! The smoke pass: renders one small sample of every configuration before the night begins, so that
//! errors are found while the user is still watching.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use super::active_run::RunRequest;
use super::attempt::AttemptError;
use super::open::{advance, catch_panic};
use super::state::NightRunner;
use crate::experiment::event::Event;
use crate::experiment::forecast::WorkloadKey;
use crate::experiment::outcome::{CellRef, Level};
use crate::experiment::plan::ReferenceSource;
use lumbre_light::transport::integrator::external::is_external;
use lumbre_light::transport::integrator::integrator;
use lumbre_render::Settings;
use lumbre_render::external::technique_of;
use lumbre_render::{Advance, Until};

/// Greatest width and height of the rendered pictures in pixels. The pass detects errors, not slow
/// runs or lack of memory.
const MAX_SIDE: u32 = 64;

/// Time after which the rest is left to the night, without that in which drivers compile shaders: it
/// may be minutes on the first day of a driver, and the night would have to wait for them as well.
const MAX_TIME: Duration = Duration::from_secs(60);

/// Returns whether the pass has taken too long, if drivers have compiled for this many seconds of it.
fn is_over(elapsed: Duration, compiling_s: f64) -> bool {
    elapsed.as_secs_f64() - compiling_s > MAX_TIME.as_secs_f64()
}

impl NightRunner<'_, '_> {
    /// Renders one small sample of every unfinished cell and reference, except for repeats, and
    /// returns the cells that will fail, with their reasons.
    pub(super) fn smoke(&mut self, order: &[CellRef]) -> BTreeMap<CellRef, String> {
        let start = Instant::now();
        let mut failed = BTreeMap::new();
        let (mut tested, mut compiling_s) = (0, 0.0);
        // Cells by configuration, in order.
        let mut open: Vec<Vec<CellRef>> = Vec::new();
        let mut known = BTreeMap::new();
        for cell in order {
            let index = *known.entry(self.configuration(*cell)).or_insert_with(|| {
                open.push(Vec::new());
                open.len() - 1
            });
            open[index].push(*cell);
        }
        open.retain(|cells| self.history.finished_run(self.plan, cells[0]).is_none());
        for cells in &open {
            if self.control.stop_requested() || is_over(start.elapsed(), compiling_s) {
                break;
            }
            tested += 1;
            let error = match self.render_smoke_sample(cells[0]) {
                Ok(pipeline_s) => {
                    compiling_s += pipeline_s;
                    continue;
                }
                Err(error) => error,
            };
            // A lost device may recover, and a run may have a fallback: the night decides then.
            // A cancelled sample shows nothing.
            let may_succeed = match error {
                AttemptError::DeviceLost(_) | AttemptError::Cancelled => true,
                AttemptError::Backend(_) => self.has_fallback(cells[0]),
                AttemptError::Other(_) => false,
            };
            if !may_succeed {
                let reason = format!("failed in the smoke pass: {}", error.into_reason());
                failed.extend(cells.iter().map(|cell| (*cell, reason.clone())));
            }
        }
        let seconds = start.elapsed().as_secs_f64();
        let (all, failing) = (open.len(), failed.len());
        let text = format!(
            "smoke pass: tested {tested} of {all} configurations in {seconds:.1} s; {failing} runs \
             would fail"
        );
        let level = if failing > 0 {
            Level::Warn
        } else {
            Level::Info
        };
        // A sink that fails here fails again when a result is recorded.
        let _ = self.emit(&Event::Message {
            level,
            cell: None,
            text,
        });
        failed
    }

    /// Returns a key that distinguishes cells except for their seeds. All references are different.
    fn configuration(&self, cell: CellRef) -> (bool, usize, [u8; 32]) {
        match cell {
            CellRef::Reference(i) => (true, i, [0; 32]),
            CellRef::Cell(i) => {
                let cell = &self.plan.cells[i];
                // Repeats of a point share their scene and differ only in their seeds.
                let scene = std::sync::Arc::as_ptr(&cell.scene) as usize;
                let config = blake3::hash(format!("{:?}", cell.config).as_bytes());
                (false, scene, config.into())
            }
        }
    }

    /// Whether a run has a fallback backend.
    fn has_fallback(&self, cell: CellRef) -> bool {
        match cell {
            CellRef::Cell(i) => self.plan.cells[i].config.fallback.is_some(),
            CellRef::Reference(i) => match &self.plan.references[i].source {
                ReferenceSource::Render { config, .. } => config.fallback.is_some(),
                ReferenceSource::File { .. } => false,
            },
        }
    }

    /// Renders one sample of a cell or reference at a small size, and records its throughput. Returns
    /// the seconds in which the driver compiled shaders.
    fn render_smoke_sample(&mut self, cell: CellRef) -> Result<f64, AttemptError> {
        let plan = self.plan;
        let (config, scene, seed, stop) = match cell {
            CellRef::Cell(i) => {
                let cell = &plan.cells[i];
                (&cell.config, &cell.scene, cell.seed, &cell.stop)
            }
            CellRef::Reference(i) => match &plan.references[i].source {
                ReferenceSource::Render {
                    config,
                    scene,
                    seeds,
                    stop,
                    ..
                } => (config, scene, seeds[0], stop),
                ReferenceSource::File { .. } => return Ok(0.0),
            },
        };
        let [width, height] = config.resolution.unwrap_or(scene.resolution);
        let shrink = width.max(height).div_ceil(MAX_SIDE).max(1);
        let small = [width.div_ceil(shrink), height.div_ceil(shrink)];
        let resolution = (!has_fixed_size(config)).then_some(small);
        let seeds = &[seed];
        let request = RunRequest {
            cell,
            config,
            scene,
            seeds,
            stop: stop.clone(),
            shard: None,
            reference: None,
            resolution,
        };
        let scene = self.compiled(&request)?;
        let mut renderer = Some(self.open(&request, &scene, None)?);
        let pipeline_s = (renderer.as_ref()).map_or(0.0, |r| r.open_stats().pipeline_s);
        let stats = {
            let cancelled = self.cancellation();
            let until = Until::Cancelled(&cancelled);
            advance(
                &mut renderer,
                &Advance {
                    until,
                    ..Advance::by(1)
                },
            )?
        };
        self.throughput.record_smoke_sample(
            WorkloadKey::from_config(config),
            stats.paths as f64 / stats.render_s,
        );
        catch_panic("closing the backend", || drop(renderer))?;
        Ok(pipeline_s)
    }
}

/// Whether a run is rendered by another program whose pictures have one size only.
fn has_fixed_size(config: &Settings) -> bool {
    integrator(&config.integrator)
        .filter(|row| is_external(row))
        .and_then(|row| technique_of(row, &config.integrator, &config.params).ok())
        .is_some_and(|technique| technique.has_fixed_size())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn compiling_does_not_use_up_the_time_of_the_pass() {
        let after = Duration::from_secs(200);
        assert!(is_over(after, 0.0) && is_over(after, 139.0));
        assert!(!is_over(after, 141.0) && !is_over(MAX_TIME, 0.0));
    }
}
