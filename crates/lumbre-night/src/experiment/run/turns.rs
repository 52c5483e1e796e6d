//! Rendering of active runs in turns of one slice each, until the stop rule holds, the user
//! intervenes, or something fails.

use std::sync::Arc;
use std::time::Instant;

use super::active_run::{ActiveRun, EndedRun, RunRequest};
use super::attempt::{AttemptError, CheckpointState};
use super::open::{advance, catch_panic};
use super::state::NightRunner;
use super::waves::{SLICE_S, WaveSizer, max_lookahead, slice_samples};
use crate::experiment::event::Event;
use crate::experiment::memory;
use crate::experiment::noise_floor::NoiseFloors;
use crate::experiment::outcome::{CellRef, EndCause, Level, Outcome, WaveRow};
use crate::experiment::run_progress::RunProgress;
use crate::experiment::shards::WorkUnit;
use crate::experiment::spec::Snapshots;
use crate::experiment::stop::StopRule;
use lumbre_light::film::time::bytes;
use lumbre_light::transport::time_settings::Timing;
use lumbre_metrics::evaluator::Evaluator;
use lumbre_render::cpu::kept_bytes;
use lumbre_render::{Advance, Until};

/// Render time of a slice of an interleaved run, seconds. Short turns make the conditions of the
/// techniques more alike.
const INTERLEAVED_SLICE_S: f64 = 0.5;

/// Greatest size of a time-resolved film that is copied for display while a run renders: 256 MiB,
/// which takes a tenth of a second.
const MAX_SHOWN_BYTES: u64 = 256 << 20;

/// Action after a turn of a run.
enum AfterTurn {
    /// The run continues.
    Continue,
    /// The run has ended.
    End(Outcome),
    /// The user wants the run again from its first sample.
    Restart,
}

impl<'a> NightRunner<'a, '_> {
    /// Renders one run until it ends.
    pub(super) fn render_run(&mut self, request: RunRequest<'a>) -> EndedRun {
        let mut run = ActiveRun::new(request);
        loop {
            if let Some(outcome) = self.take_turn(&mut run, true, true) {
                return self.end_run(run, outcome);
            }
        }
    }

    /// Renders runs in turns until all have ended, and records each when it ends. The run with the
    /// least render time has the next turn, so that at any moment all have rendered for about the
    /// same time and a slowdown of the machine affects all of them. Requests of the user that
    /// concern one run apply to the first one, which the dashboard shows.
    pub(super) fn render_interleaved(&mut self, mut runs: Vec<(ActiveRun<'a>, NoiseFloors)>) {
        let alone = runs.len() == 1;
        while let Some(next) = least_rendered(&runs) {
            let Some(outcome) = self.take_turn(&mut runs[next].0, next == 0, alone) else {
                continue;
            };
            let (run, floors) = runs.remove(next);
            let cell = run.request.cell;
            let ended = self.end_run(run, outcome);
            self.finish(cell, EndedRun { floors, ..ended });
            self.history.release(self.plan, cell.into());
            if next == 0 {
                // A request that came too late for this run must not apply to the next.
                self.control.skip.take();
                self.control.restart.take();
            }
        }
    }

    /// Makes the result of a run that has ended, and stores its checkpoint or the sums of a
    /// reference.
    fn end_run(&mut self, run: ActiveRun<'_>, outcome: Outcome) -> EndedRun {
        let ActiveRun {
            request,
            mut attempt,
            layers,
            denoised,
            ..
        } = run;
        if outcome == Outcome::Interrupted {
            self.save_checkpoint(&request, &mut attempt);
        }
        if let (WorkUnit::Run(CellRef::Reference(reference)), Outcome::Done(_)) =
            (request.unit(), &outcome)
        {
            self.save_sums(reference, &attempt);
        }
        let renderer = attempt.renderer.as_ref().filter(|r| r.film().samples > 0);
        let film = renderer.map(|r| Arc::new(r.film().clone()));
        let finished = renderer.filter(|_| matches!(outcome, Outcome::Done(_)));
        let times = finished.and_then(|r| r.times()).map(Arc::new);
        let halves = finished.and_then(|r| r.halves());
        let open = renderer.map(|r| r.open_stats().clone()).unwrap_or_default();
        let rows = attempt.progress.rows;
        EndedRun {
            outcome,
            film,
            denoised,
            layers: Arc::new(layers),
            times,
            rows,
            halves,
            floors: NoiseFloors::default(),
            open,
        }
    }

    /// Renders a slice of a run, and returns its outcome if it ended. Requests of the user that
    /// concern one run apply to the run that `leads`. A run that is `alone` is not interleaved.
    fn take_turn(&mut self, run: &mut ActiveRun<'a>, leads: bool, alone: bool) -> Option<Outcome> {
        run.turn_start = (Instant::now(), run.attempt.progress.wall_s);
        run.turns += 1;
        let next = if run.waves.is_some() {
            self.render_slice(run, leads, alone)
        } else if self.control.stop_requested() || self.deadline_passed() {
            // Opening a large scene takes long; do not start it when the night is to stop.
            Ok(AfterTurn::End(Outcome::Interrupted))
        } else {
            self.begin(run).map(|()| AfterTurn::Continue)
        };
        let next = next.and_then(|next| {
            // Only finished runs record their layers.
            if let (AfterTurn::End(Outcome::Done(_)), Some(renderer)) =
                (&next, &mut run.attempt.renderer)
            {
                run.layers = renderer.layer_images()?;
                // A run that ends where an earlier process left it was not measured by this one.
                let picture = catch_panic("denoising", || renderer.picture())??;
                run.denoised = picture.denoised.then_some(picture.image);
            }
            Ok(next)
        });
        match next {
            Ok(AfterTurn::Continue) => {
                run.attempt.progress.wall_s = run.wall_s();
                None
            }
            Ok(AfterTurn::End(outcome)) => Some(outcome),
            Ok(AfterTurn::Restart) => {
                run.discard_attempt();
                run.retry.from_scratch = true;
                None
            }
            Err(AttemptError::Cancelled) => Some(Outcome::Interrupted),
            Err(error) => match self.prepare_retry(run, error) {
                Ok(retry) => {
                    run.discard_attempt();
                    (!retry).then_some(Outcome::Interrupted)
                }
                Err(reason) => Some(Outcome::Failed(reason)),
            },
        }
    }

    /// Opens the renderer of a run and resumes from its checkpoint, if there is one.
    fn begin(&mut self, run: &mut ActiveRun<'a>) -> Result<(), AttemptError> {
        let request = run.request.clone();
        let scene = self.compiled(&request)?;
        self.warm_up(&request, &scene, &run.retry)?;
        let (renderer, resume_point) = self.resume(&request, &scene, &run.retry)?;
        let open = renderer.open_stats().clone();
        let attempt = &mut run.attempt;
        attempt.renderer = Some(renderer);
        attempt.progress = resume_point.progress;
        attempt.checkpoints =
            CheckpointState::new(attempt.progress.render_s(), self.checkpoint_requests);
        run.turn_start.1 = attempt.progress.wall_s;
        if run.evaluator.is_none() {
            let metrics = &self.plan.measure.metrics;
            let reference = request.reference.as_ref();
            run.evaluator = catch_panic("measuring", || {
                reference.map(|reference| Evaluator::new(metrics, Arc::clone(reference)))
            })?;
        }
        let resumed = resume_point
            .resumed
            .then(|| Arc::new(attempt.progress.rows.clone()));
        let mut waves = WaveSizer::new(
            self.plan.measure.every_s,
            self.plan.measure.snapshots == Snapshots::Pow2,
        );
        if resume_point.resumed {
            waves = waves.resume(attempt.progress.next_wave_max);
        }
        run.waves = Some(waves);
        let reference = request.reference.clone();
        self.emit(&match request.shard {
            Some(shard) => Event::ShardStarted {
                shard,
                open,
                resumed,
            },
            None => Event::CellStarted {
                cell: request.cell,
                open,
                reference,
                resumed,
                settings: None,
            },
        })?;
        if let Some((level, text)) = resume_point.message {
            self.emit_message(level, request.cell, text)?;
        }
        Ok(())
    }

    /// Continues the wave in progress or starts the next one, for one slice. Measures the wave if
    /// it is complete.
    fn render_slice(
        &mut self,
        run: &mut ActiveRun<'a>,
        leads: bool,
        alone: bool,
    ) -> Result<AfterTurn, AttemptError> {
        let progress = &mut run.attempt.progress;
        if progress.between_waves() {
            let rows = &progress.rows;
            // Also evaluated for the last measurement of an earlier process, which may have been
            // killed before it evaluated the rule.
            if !rows.is_empty()
                && let Some(cause) = self.stop_cause(&run.request.stop, rows)?
            {
                self.warn_of_threshold(run.request.cell, &run.request.stop, rows)?;
                return Ok(AfterTurn::End(Outcome::Done(cause)));
            }
            let Some(waves) = &mut run.waves else {
                return Err("the renderer is not open".to_owned().into());
            };
            progress.samples_left = waves.next(rows, &run.request.stop);
            progress.next_wave_max = waves.next_wave_max;
        }
        if progress.samples_left > 0
            && let Some(next) = self.render_samples(run, leads, alone)?
        {
            return Ok(next);
        }
        if run.attempt.progress.samples_left == 0 {
            self.measure_wave(run)?;
        }
        Ok(AfterTurn::Continue)
    }

    /// Renders as many samples of the wave in progress as take about one slice, and stores a
    /// checkpoint if one is due. A request of the user may end the run instead.
    fn render_samples(
        &mut self,
        run: &mut ActiveRun<'a>,
        leads: bool,
        alone: bool,
    ) -> Result<Option<AfterTurn>, AttemptError> {
        let cell = run.request.cell;
        run.attempt.progress.wall_s = run.wall_s();
        let asked = Instant::now();
        let request = self.handle_requests(cell, &run.attempt.progress, leads)?;
        // Pauses are not part of the run's time, from which forecasts are made.
        run.turn_start.0 += asked.elapsed();
        if request.is_some() {
            return Ok(request);
        }
        let attempt = &mut run.attempt;
        let slice_s = if alone { SLICE_S } else { INTERLEAVED_SLICE_S };
        let slice_s = self
            .plan
            .night
            .checkpoint_s
            .map_or(slice_s, |every_s| every_s.min(slice_s));
        let samples = match &attempt.renderer {
            Some(renderer) if renderer.whole_waves() => attempt.progress.samples_left,
            _ => slice_samples(&attempt.progress, slice_s),
        };
        // An interleaved run must not keep the device busy during the turn of another.
        let waves = run.waves.as_ref().filter(|_| alone);
        let more = waves.map_or(0, |waves| {
            waves.lookahead(&attempt.progress, samples, &run.request.stop)
        });
        let more = more.min(max_lookahead(&attempt.progress, slice_s));
        let (control, stops) = (self.control, self.cancellation());
        let cancelled = || stops() || (leads && (control.skip.get() || control.restart.get()));
        let request = Advance {
            samples,
            more,
            until: Until::Cancelled(&cancelled),
        };
        let stats = match advance(&mut attempt.renderer, &request) {
            Err(AttemptError::Cancelled) => {
                return Ok(self.handle_requests(cell, &attempt.progress, leads)?);
            }
            stats => stats?,
        };
        let first_invalid = stats.invalid > 0
            && attempt.progress.current_wave.invalid == 0
            && attempt.progress.rows.iter().all(|row| row.invalid == 0);
        attempt.progress.add(&stats);
        if first_invalid {
            let text = attempt.progress.describe_invalid();
            self.emit_message(Level::Warn, cell, text)?;
        }
        run.attempt.progress.wall_s = run.wall_s();
        self.save_checkpoint_if_due(&run.request, &mut run.attempt);
        Ok(None)
    }

    /// Returns the clause by which a run with these measurements is finished, or `None` if it is not.
    pub(super) fn stop_cause(
        &self,
        rule: &StopRule,
        rows: &[WaveRow],
    ) -> Result<Option<EndCause>, String> {
        let columns = self.plan.columns();
        let mut predicate = |id| self.hooks.predicate(id, &columns, rows);
        rule.check(rows, &self.plan.measure.metrics, &mut predicate)
            .map_err(|e| e.to_string())
    }

    /// Measures a complete wave.
    fn measure_wave(&mut self, run: &mut ActiveRun<'a>) -> Result<(), AttemptError> {
        let Some(renderer) = &mut run.attempt.renderer else {
            return Err("the renderer is not open".to_owned().into());
        };
        let picture = catch_panic("denoising", || renderer.picture())??;
        run.attempt.progress.current_wave.render_s += picture.extra_s;
        run.denoised = picture.denoised.then(|| Arc::clone(&picture.image));
        let image = picture.image;
        let start = Instant::now();
        let noise = match run.request.cell {
            CellRef::Reference(_) => renderer.film().relative_noise(),
            CellRef::Cell(_) => None,
        };
        let metrics = match &run.evaluator {
            Some(evaluator) => {
                catch_panic("measuring", || evaluator.eval(&image))?.map_err(|e| e.to_string())?
            }
            None => Vec::new(),
        };
        let measure_s = start.elapsed().as_secs_f64();
        let wall_s = run.wall_s();
        let progress = &mut run.attempt.progress;
        let before_s = progress.rows.last().map_or(0.0, |row| row.measure_s);
        let row = WaveRow {
            wall_s,
            measure_s: before_s + measure_s,
            metrics,
            ..progress.close_wave()
        };
        let pow2 = row.samples.is_power_of_two();
        progress.rows.push(row.clone());
        let (cell, samples) = (run.request.cell, row.samples);
        self.emit(&Event::Wave {
            cell,
            row,
            measure_s,
            image: Some(image),
            noise,
            pow2,
        })?;
        if samples >= 2 * run.times_samples && self.wants_times(&run.request) {
            run.times_samples = samples;
            if let Some(times) = run
                .attempt
                .renderer
                .as_ref()
                .and_then(|renderer| renderer.times())
            {
                self.emit(&Event::Times {
                    cell,
                    times: Arc::new(times),
                })?;
            }
        }
        Ok(())
    }

    /// Whether a sink wants the time-resolved film of a run, and it is small enough to be copied.
    fn wants_times(&self, request: &RunRequest<'_>) -> bool {
        let pixels = memory::pixels(request.config);
        let small = |timing: &Timing| {
            bytes(&timing.axis, pixels, false).is_ok_and(|bytes| bytes <= MAX_SHOWN_BYTES)
        };
        request.config.timing.as_ref().is_some_and(small)
            && self.sinks.iter().any(|sink| sink.wants_times())
    }

    /// Handles the requests of the user before the next samples, and waits while the night is
    /// paused.
    fn handle_requests(
        &mut self,
        cell: CellRef,
        progress: &RunProgress,
        leads: bool,
    ) -> Result<Option<AfterTurn>, String> {
        let (samples, render_s) = (progress.samples(), progress.render_s());
        if leads
            && !self.control.stop_requested()
            && self.control.pause_if_reached(samples, render_s).is_some()
        {
            let text = format!("paused as requested after {samples} samples per pixel");
            self.emit_message(Level::Info, cell, text)?;
        }
        loop {
            if self.control.stop_requested() || self.deadline_passed() {
                return Ok(Some(AfterTurn::End(Outcome::Interrupted)));
            }
            if leads && self.control.skip.take() {
                let text = format!("skipped on request after {samples} samples per pixel");
                self.emit_message(Level::Warn, cell, text)?;
                return Ok(Some(AfterTurn::End(Outcome::Interrupted)));
            }
            if leads && self.control.restart.take() {
                let text = format!("restarted on request after {samples} samples per pixel");
                self.emit_message(Level::Warn, cell, text)?;
                return Ok(Some(AfterTurn::Restart));
            }
            if !self.control.paused.get() {
                return Ok(None);
            }
            (self.seams.wait)();
        }
    }
}

/// Returns the index of the run with the least render time; among equals, the fewest turns.
fn least_rendered(runs: &[(ActiveRun<'_>, NoiseFloors)]) -> Option<usize> {
    let clock = |index: &usize| runs[*index].0.clock();
    (0..runs.len()).min_by(|a, b| {
        let ((a_s, a_turns), (b_s, b_turns)) = (clock(a), clock(b));
        a_s.total_cmp(&b_s).then(a_turns.cmp(&b_turns))
    })
}

/// Returns an error message if runs that are rendered in turns do not fit into memory together.
/// `given` is the limit that the user set, in bytes.
pub(super) fn memory_shortage(
    runs: &[(ActiveRun<'_>, NoiseFloors)],
    given: Option<u64>,
) -> Option<String> {
    let limit = memory::free(given, kept_bytes())?;
    let need = runs
        .iter()
        .map(|(run, _)| memory::run_bytes(run.request.config))
        .sum();
    memory::shortage(runs.len(), need, &limit)
}
