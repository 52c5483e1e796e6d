//! Opening of renderers: scene compilation, warm-up, and resuming from checkpoints.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::SystemTime;

use super::active_run::RunRequest;
use super::attempt::{AttemptError, RetryState};
use super::scenes::{RunScene, SHARE, WITHOUT_LIMIT};
use super::state::NightRunner;
use super::waves::SLICE_S;
use crate::experiment::memory;
use crate::experiment::outcome::{CellRef, Level};
use crate::experiment::plan::identity;
use crate::experiment::run_progress::RunProgress;
use crate::experiment::spec::Warmup;
use lumbre_light::scene::compile::compile_sharing;
use lumbre_light::scene::desc::hash_without_camera;
use lumbre_light::transport::integrator::external::is_external;
use lumbre_render::cpu::kept_bytes;
use lumbre_render::denoise;
use lumbre_render::external::{self, Access};
use lumbre_render::hierarchy::LaneMode;
use lumbre_render::reference_halves::ReferenceHalves;
use lumbre_render::{Advance, Job, RenderError, Renderer, Until, WaveStats};

/// Point from which a newly opened run continues.
#[derive(Default)]
pub(super) struct ResumePoint {
    /// Progress so far.
    pub(super) progress: RunProgress,
    /// Whether the run continues a checkpoint or a shorter reference.
    pub(super) resumed: bool,
    /// Message about it, if any.
    pub(super) message: Option<(Level, String)>,
}

impl<'a> NightRunner<'a, '_> {
    /// Returns the compiled scene of a run, from the cache if it is there.
    pub(super) fn compiled(&mut self, request: &RunRequest<'_>) -> Result<RunScene, String> {
        let (desc, sharing) = (request.scene, request.config.accel.instances);
        let hash = hash_without_camera(desc);
        let (scene, notes) = match self.scenes.get(hash, sharing) {
            Some(compiled) => RunScene::new(compiled, desc).map_err(|e| e.to_string())?,
            None => {
                // Dropped first, so that two large scenes need not fit into memory.
                let kept = kept_bytes() + self.scenes.bytes();
                let free = memory::free(self.options.memory, kept);
                self.scenes
                    .shrink_to(free.map_or(WITHOUT_LIMIT, |limit| limit.bytes / SHARE));
                let compile = || compile_sharing(desc, sharing);
                let (compiled, notes) =
                    catch_panic("compiling the scene", compile)?.map_err(|e| e.to_string())?;
                let compiled = Arc::new(compiled);
                self.scenes.add(hash, sharing, Arc::clone(&compiled));
                let view = None;
                (RunScene { compiled, view }, notes)
            }
        };
        for note in notes {
            if self.reported_notes.insert(note.clone()) {
                self.emit_message(Level::Warn, request.cell, note.to_string())?;
            }
        }
        Ok(scene)
    }

    /// Renders the warm-up of a cell, if the plan has one, and discards it.
    pub(super) fn warm_up(
        &mut self,
        request: &RunRequest<'a>,
        scene: &RunScene,
        retry: &RetryState,
    ) -> Result<(), AttemptError> {
        let (Some(warmup), CellRef::Cell(_)) = (self.plan.night.warmup, request.cell) else {
            return Ok(());
        };
        let seeds = [identity::warmup_seed()];
        let request = RunRequest {
            seeds: &seeds,
            ..request.clone()
        };
        let mut renderer = Some(self.open(&request, scene, retry.backend)?);
        let mut done = WaveStats::default();
        loop {
            let rate = done.samples as f64 / done.render_s;
            let max_samples = done.samples_in(SLICE_S);
            let next = match warmup {
                Warmup::Time(seconds) if done.render_s < seconds => {
                    max_samples.min(((seconds - done.render_s) * rate) as u64 + 1)
                }
                Warmup::Samples(samples) => max_samples.min(samples.saturating_sub(done.samples)),
                Warmup::Time(_) => 0,
            };
            if next == 0 || self.control.stop_requested() || self.deadline_passed() {
                break;
            }
            let cancelled = self.cancellation();
            let request = Advance {
                until: Until::Cancelled(&cancelled),
                ..Advance::by(next)
            };
            done.add(&advance(&mut renderer, &request)?);
        }
        catch_panic("closing the backend", || drop(renderer))?;
        let text = format!(
            "warmed up for {:.2} s with {} samples per pixel, which are discarded",
            done.render_s, done.samples
        );
        Ok(self.emit_message(Level::Info, request.cell, text)?)
    }

    /// Opens the renderer of a run. Resumes from its checkpoint or from a shorter reference, if
    /// there is one that matches and the run is not to start from scratch.
    pub(super) fn resume(
        &mut self,
        request: &RunRequest<'a>,
        scene: &RunScene,
        retry: &RetryState,
    ) -> Result<(Box<dyn Renderer>, ResumePoint), AttemptError> {
        let mut renderer = self.open(request, scene, retry.backend)?;
        let own = if retry.from_scratch {
            None
        } else {
            self.history.checkpoint(self.plan, request.unit())
        };
        let (checkpoint, origin) = match own {
            Some(own) => (own, "resumes from its checkpoint after"),
            None => match self
                .shorter_reference(request)
                .filter(|_| !retry.from_scratch)
            {
                Some(shorter) => (shorter, "continues a shorter reference after"),
                None => return Ok((renderer, ResumePoint::default())),
            },
        };
        let restored = catch_panic("reading a checkpoint", || {
            renderer.restore(&checkpoint.state)
        });
        if let Ok(Err(lost @ RenderError::Lost { .. })) = restored {
            return Err(lost.into());
        }
        if let Err(problem) = restored.and_then(|restored| restored.map_err(|e| e.to_string())) {
            drop(renderer);
            let text = format!(
                "its checkpoint does not match, so it starts from the first sample: {problem}"
            );
            let start = ResumePoint {
                message: Some((Level::Warn, text)),
                ..ResumePoint::default()
            };
            return Ok((self.open(request, scene, retry.backend)?, start));
        }
        let progress = checkpoint.progress;
        let text = format!("{origin} {} samples per pixel", progress.samples());
        Ok((
            renderer,
            ResumePoint {
                progress,
                resumed: true,
                message: Some((Level::Info, text)),
            },
        ))
    }

    /// Opens the renderer of a run on `backend`, or on the run's own backend if that is `None`.
    pub(super) fn open(
        &self,
        request: &RunRequest<'_>,
        scene: &RunScene,
        backend: Option<&str>,
    ) -> Result<Box<dyn Renderer>, AttemptError> {
        let backend = backend.unwrap_or(&request.config.backend);
        let job = self.job(request, scene)?;
        let open = |seed: u64| -> Result<Box<dyn Renderer>, AttemptError> {
            let job = Job {
                seed,
                ..job.clone()
            };
            let start = |job: Job| {
                if is_external(job.integrator) {
                    let access = Access {
                        commands: self.plan.commands_allowed,
                        cancelled: &self.cancellation(),
                    };
                    external::open(request.scene, &request.config.integrator, &job, &access)
                } else {
                    (self.seams.open)(backend, Arc::clone(&scene.compiled), job)
                }
            };
            let open = || denoise::open(job.clone(), start);
            Ok(catch_panic("opening the backend", open)??)
        };
        match request.seeds {
            [seed] => open(*seed),
            [first, second] => Ok(Box::new(ReferenceHalves::new([
                open(*first)?,
                open(*second)?,
            ]))),
            _ => Err("a run has one seed, or those of two halves"
                .to_owned()
                .into()),
        }
    }

    /// Returns a function that tells whether the night is to stop, for renderers that wait for
    /// another program.
    pub(super) fn cancellation(&self) -> impl Fn() -> bool + use<'a> {
        let (control, deadline) = (self.control, self.options.deadline);
        move || control.stop_requested() || deadline.is_some_and(|until| SystemTime::now() >= until)
    }

    /// Makes the job of a run, with seed 0.
    fn job(&self, request: &RunRequest<'_>, scene: &RunScene) -> Result<Job, String> {
        let (desc, threads) = (request.scene, self.options.threads);
        let mut job = request
            .config
            .job(desc.resolution, desc.max_depth, threads)?;
        job.view.clone_from(&scene.view);
        job.resolution = request.resolution.unwrap_or(job.resolution);
        job.first_sample = request.shard.map_or(0, |shard| shard.first / 2);
        if let CellRef::Reference(_) = request.cell {
            // Times of references are not compared, so they are vectorised wherever possible.
            job.settings.accel.lanes = LaneMode::Always;
        }
        Ok(job)
    }
}

/// Renders what is requested. The slot is empty afterwards if the renderer panicked.
pub(super) fn advance(
    slot: &mut Option<Box<dyn Renderer>>,
    request: &Advance<'_>,
) -> Result<WaveStats, AttemptError> {
    let Some(mut renderer) = slot.take() else {
        return Err("the renderer is not open".to_owned().into());
    };
    let stats = catch_panic("rendering", || renderer.render(request))?;
    *slot = Some(renderer);
    match stats {
        Ok(stats) if stats.samples == 0 => {
            let samples = request.samples;
            Err(format!("the renderer returned none of {samples} requested samples").into())
        }
        stats => Ok(stats?),
    }
}

/// Calls a function and turns a panic into an error message; `doing` describes the activity.
pub(super) fn catch_panic<T>(doing: &str, work: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(work))
        .map_err(|payload| format!("panic while {doing}: {}", panic_message(&*payload)))
}

fn panic_message(payload: &(dyn Any + Send)) -> &str {
    let text = payload.downcast_ref::<&'static str>().copied();
    text.or_else(|| payload.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("no message")
}
