//! One run: open, then turn after turn until the stop rule holds, the user intervenes, or something fails.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Instant;

use super::checkpoint::Kept;
use super::night::Night;
use super::tries::{Broken, Try};
use super::waves::{Waves, beforehand, slice};
use crate::experiment::event::{CellRef, Event, FinishedRun, Level, Outcome, WaveRow};
use crate::experiment::floors::Floors;
use crate::experiment::memory;
use crate::experiment::parts::{Part, Piece};
use crate::experiment::plan::identity;
use crate::experiment::spec::{CellConfig, Snapshots, Warmup};
use crate::experiment::standing::Standing;
use crate::experiment::stop::StopRule;
use crate::film::layer::LayerImage;
use crate::film::time::{TimeCube, bytes};
use crate::film::{Film, Image, SharedImage};
use crate::metrics::gauge::Gauge;
use crate::render::cpu::kept_bytes;
use crate::render::halves::Halves;
use crate::render::hierarchy::{AccelSpec, InLanes};
use crate::render::{Job, OpenStats, RenderError, Renderer, WaveStats, external};
use crate::scene::compile::compile_sharing;
use crate::scene::{CompiledScene, SceneDesc};
use crate::transport::flight::Timing;
use crate::transport::integrator::external::is_external;
use crate::transport::integrator::integrator;
use crate::transport::sampler::sampler;

/// How long the user may have to wait to be heard, in seconds of render time: longer waves are cut into slices. That
/// changes no picture, and neither which samples are measured.
const SLICE_S: f64 = 1.0;

/// The same for runs that take turns: the shorter the turns, the more alike is what they find.
const TURN_S: f64 = 0.5;

/// The most bytes of light by time that are copied to be shown while a run renders: 256 MiB, a tenth of a second.
const MAX_SHOWN_BYTES: u64 = 256 << 20;

/// What a run is to render.
#[derive(Clone)]
pub(super) struct Work<'a> {
    pub(super) cell: CellRef,
    pub(super) config: &'a CellConfig,
    pub(super) scene: &'a Arc<SceneDesc>,
    /// One, or those of two halves.
    pub(super) seeds: &'a [u64],
    pub(super) stop: StopRule,
    /// Where it is one of several parts of a reference.
    pub(super) part: Option<Part>,
    pub(super) reference: Option<SharedImage>,
    /// A size other than the configuration's.
    pub(super) resolution: Option<[u32; 2]>,
}

impl Work<'_> {
    /// What of it one process at a time works on.
    pub(super) fn piece(&self) -> Piece {
        self.part.map_or(Piece::Run(self.cell), Piece::Part)
    }
}

/// What became of a run.
pub(super) struct Ended {
    pub(super) outcome: Outcome,
    pub(super) film: Option<Arc<Film>>,
    pub(super) layers: Arc<Vec<LayerImage>>,
    pub(super) times: Option<Arc<TimeCube>>,
    pub(super) rows: Vec<WaveRow>,
    /// Where it is a reference that is done.
    pub(super) halves: Option<[Arc<Film>; 2]>,
    /// The noise floors of what it was measured against.
    pub(super) floors: Floors,
    /// What opening it cost.
    pub(super) open: OpenStats,
}

impl Ended {
    pub(super) fn cached(run: FinishedRun) -> Ended {
        let FinishedRun { folder, rows, floors, open } = run;
        Ended { rows, floors, open, ..Ended::only(Outcome::Cached(folder)) }
    }

    pub(super) fn failed(reason: String) -> Ended {
        Ended::only(Outcome::Failed(reason))
    }

    /// An end that brought nothing.
    pub(super) fn only(outcome: Outcome) -> Ended {
        Ended {
            outcome,
            film: None,
            layers: Arc::default(),
            times: None,
            rows: Vec::new(),
            halves: None,
            floors: Floors::default(),
            open: OpenStats::default(),
        }
    }
}

/// What follows a turn.
enum Next {
    /// Another one.
    Turn,
    /// The run is over.
    End(Outcome),
    /// The user wants it from its first sample.
    Restart,
}

/// How a run begins.
#[derive(Default)]
struct Resumed {
    standing: Standing,
    goes_on: bool,
    /// What there is to say about it.
    word: Option<(Level, String)>,
}

/// How far a run is.
#[derive(Default)]
pub(super) struct Progress {
    /// Taken away when it panics: its sums can no longer be trusted.
    pub(super) renderer: Option<Box<dyn Renderer>>,
    pub(super) standing: Standing,
    pub(super) kept: Kept,
}

/// A run in progress.
pub(super) struct Running<'a> {
    pub(super) work: Work<'a>,
    progress: Progress,
    /// There once it has begun.
    waves: Option<Waves>,
    /// What it is measured with, once it has begun and where it has a reference.
    gauge: Option<Gauge<'a>>,
    /// How it is tried.
    pub(super) how: Try,
    /// Its layers, once it is done.
    layers: Vec<LayerImage>,
    /// Samples per pixel at which its light by time was shown last.
    shown: u64,
    /// Turns that it has had.
    turns: u64,
    /// When its turn began, and what its wall clock showed then.
    turn: (Instant, f64),
}

impl<'a> Running<'a> {
    pub(super) fn new(work: Work<'a>) -> Running<'a> {
        let turn = (Instant::now(), 0.0);
        let (how, layers) = (Try::default(), Vec::new());
        Running { work, progress: Progress::default(), waves: None, gauge: None, how, layers, shown: 0, turns: 0, turn }
    }

    /// Render time so far, and turns.
    pub(super) fn clock(&self) -> (f64, u64) {
        (self.progress.standing.render_s(), self.turns)
    }

    /// Whether a checkpoint of this try is kept.
    pub(super) fn is_kept(&self) -> bool {
        self.progress.kept.any
    }

    /// Forgets what was rendered, so that the next turn begins.
    fn rewind(&mut self) {
        (self.progress, self.waves, self.shown) = (Progress::default(), None, 0);
    }

    fn wall_s(&self) -> f64 {
        self.turn.1 + self.turn.0.elapsed().as_secs_f64()
    }
}

impl<'a> Night<'a, '_> {
    /// Renders one run to its end, whatever that is.
    pub(super) fn perform(&mut self, work: Work<'a>) -> Ended {
        let mut run = Running::new(work);
        loop {
            if let Some(outcome) = self.turn(&mut run, true, true) {
                return self.ended(run, outcome);
            }
        }
    }

    /// Renders runs to their ends in turns, and tells of each when it ends. The one whose clock is furthest behind goes
    /// next, so that at any moment all have rendered for the same time, and what slows the machine slows all of them.
    /// What the user says of one run is meant for the first, which the dashboard shows.
    pub(super) fn race(&mut self, mut field: Vec<(Running<'a>, Floors)>) {
        let alone = field.len() == 1;
        while let Some(next) = furthest_behind(&field) {
            let Some(outcome) = self.turn(&mut field[next].0, next == 0, alone) else { continue };
            let (run, floors) = field.remove(next);
            let cell = run.work.cell;
            let ended = self.ended(run, outcome);
            self.finish(cell, Ended { floors, ..ended });
            self.history.release(self.plan, cell.into());
            if next == 0 {
                // A request that came too late for this run is not meant for the next.
                self.control.take_skip();
                self.control.take_restart();
            }
        }
    }

    /// What became of a run whose turns are over.
    fn ended(&mut self, run: Running<'_>, outcome: Outcome) -> Ended {
        let Running { work, mut progress, layers, .. } = run;
        if outcome == Outcome::Interrupted {
            self.keep(&work, &mut progress);
        }
        if let (Piece::Run(CellRef::Reference(place)), Outcome::Done(_)) = (work.piece(), &outcome) {
            self.keep_sums(place, &progress);
        }
        let renderer = progress.renderer.as_ref().filter(|r| r.film().samples > 0);
        let film = renderer.map(|r| Arc::new(r.film().clone()));
        let finished = renderer.filter(|_| matches!(outcome, Outcome::Done(_)));
        let times = finished.and_then(|r| r.times()).map(Arc::new);
        let halves = finished.and_then(|r| r.halves());
        let open = renderer.map(|r| r.open_stats().clone()).unwrap_or_default();
        let rows = progress.standing.rows;
        Ended { outcome, film, layers: Arc::new(layers), times, rows, halves, floors: Floors::default(), open }
    }

    /// Renders a run for a moment, and says how it ended if it did. Requests for a single run are heard if it `leads`; one that
    /// is `alone` has the next turn as well.
    fn turn(&mut self, run: &mut Running<'a>, leads: bool, alone: bool) -> Option<Outcome> {
        run.turn = (Instant::now(), run.progress.standing.wall_s);
        run.turns += 1;
        let next = match run.waves.is_some() {
            // Opening a large scene takes a while; nobody who wants to leave has to wait for that.
            false if self.control.stop_requested() || self.late() => Ok(Next::End(Outcome::Interrupted)),
            false => self.begin(run).map(|()| Next::Turn),
            true => self.advance(run, leads, alone),
        };
        let next = next.and_then(|next| {
            // Only what is finished is recorded.
            if let (Next::End(Outcome::Done(_)), Some(renderer)) = (&next, &run.progress.renderer) {
                run.layers = layer_images(renderer.as_ref())?;
            }
            Ok(next)
        });
        match next {
            Ok(Next::Turn) => {
                run.progress.standing.wall_s = run.wall_s();
                None
            }
            Ok(Next::End(outcome)) => Some(outcome),
            Ok(Next::Restart) => {
                run.rewind();
                run.how.anew = true;
                None
            }
            Err(broken) => match self.try_again(run, broken) {
                Ok(again) => {
                    run.rewind();
                    (!again).then_some(Outcome::Interrupted)
                }
                Err(reason) => Some(Outcome::Failed(reason)),
            },
        }
    }

    /// Opens the renderer of a run, and takes what there is of it.
    fn begin(&mut self, run: &mut Running<'a>) -> Result<(), Broken> {
        let work = run.work.clone();
        let scene = self.compiled(&work)?;
        self.warm_up(&work, &scene, &run.how)?;
        let (renderer, resumed) = self.resume(&work, scene, &run.how)?;
        let open = renderer.open_stats().clone();
        let progress = &mut run.progress;
        progress.renderer = Some(renderer);
        progress.standing = resumed.standing;
        progress.kept = Kept::at(progress.standing.render_s(), self.asked);
        run.turn.1 = progress.standing.wall_s;
        if run.gauge.is_none() {
            let metrics = &self.plan.measure.metrics;
            let truth = work.reference.as_ref();
            run.gauge = guard("measuring", || truth.map(|truth| Gauge::new(metrics, Arc::clone(truth))))?;
        }
        let rows = resumed.goes_on.then(|| Arc::new(progress.standing.rows.clone()));
        let mut waves = Waves::new(self.plan.measure.every_s, self.plan.measure.snapshots == Snapshots::Pow2);
        if resumed.goes_on {
            waves = waves.from(progress.standing.growth);
        }
        run.waves = Some(waves);
        let reference = work.reference.clone();
        self.emit(&match work.part {
            Some(part) => Event::PartStarted { part, open, resumed: rows },
            None => Event::CellStarted { cell: work.cell, open, reference, resumed: rows },
        })?;
        if let Some((level, text)) = resumed.word {
            self.say(level, work.cell, text)?;
        }
        Ok(())
    }

    /// Goes on with the wave in progress or begins the next, for as long as one slice takes; what then is a whole wave
    /// is measured.
    fn advance(&mut self, run: &mut Running<'a>, leads: bool, alone: bool) -> Result<Next, Broken> {
        let cell = run.work.cell;
        let plan = self.plan;
        let standing = &mut run.progress.standing;
        if standing.between_waves() {
            let rows = &standing.rows;
            // Also asked of what an earlier process measured last, which may have been cut off before it asked.
            if !rows.is_empty()
                && let Some(reason) = self.stops(&run.work.stop, rows)?
            {
                return Ok(Next::End(Outcome::Done(reason)));
            }
            let Some(waves) = &mut run.waves else { return Err("the run has not begun".to_owned().into()) };
            standing.left = waves.next(rows, &run.work.stop);
            standing.growth = waves.size;
        }
        if standing.left > 0 {
            run.progress.standing.wall_s = run.wall_s();
            let progress = &mut run.progress;
            if let Some(next) = self.obey(cell, &progress.standing, leads)? {
                return Ok(next);
            }
            let slice_s = if alone { SLICE_S } else { TURN_S };
            let slice_s = plan.night.checkpoint_s.map_or(slice_s, |every_s| every_s.min(slice_s));
            let samples = slice(&progress.standing, slice_s);
            // A device that went on with this run would work through another's turn.
            let waves = run.waves.as_ref().filter(|_| alone);
            let more = waves.map_or(0, |waves| waves.expected(&progress.standing, samples, &run.work.stop));
            let more = more.min(beforehand(&progress.standing, slice_s));
            let stats = advance_toward(&mut progress.renderer, samples, more)?;
            let first = stats.invalid > 0
                && progress.standing.part.invalid == 0
                && progress.standing.rows.iter().all(|row| row.invalid == 0);
            progress.standing.count(&stats);
            if first {
                self.say(Level::Warn, cell, progress.standing.invalid_words())?;
            }
            run.progress.standing.wall_s = run.wall_s();
            self.keep_if_due(&run.work, &mut run.progress);
        }
        if run.progress.standing.left == 0 {
            self.close_wave(run)?;
        }
        Ok(Next::Turn)
    }

    /// Why a run with these measurements is finished, if it is.
    pub(super) fn stops(&self, rule: &StopRule, rows: &[WaveRow]) -> Result<Option<String>, String> {
        let columns = self.plan.columns();
        let mut ask = |id| self.hooks.predicate(id, &columns, rows);
        rule.check(rows, &self.plan.measure.metrics, &mut ask).map_err(|e| e.to_string())
    }

    /// Measures a whole wave.
    fn close_wave(&mut self, run: &mut Running<'a>) -> Result<(), String> {
        let Some(renderer) = &run.progress.renderer else { return Err("the renderer is gone".to_owned()) };
        let measuring = Instant::now();
        let image = Arc::new(renderer.film().mean());
        let metrics = run.gauge.as_ref().map_or(Ok(Vec::new()), |gauge| measure(gauge, &image))?;
        let measure_s = measuring.elapsed().as_secs_f64();
        let wall_s = run.wall_s();
        let standing = &mut run.progress.standing;
        let before_s = standing.rows.last().map_or(0.0, |row| row.measure_s);
        let row = WaveRow { wall_s, measure_s: before_s + measure_s, metrics, ..standing.close_wave() };
        let pow2 = row.samples.is_power_of_two();
        standing.rows.push(row.clone());
        let (cell, samples) = (run.work.cell, row.samples);
        self.emit(&Event::Wave { cell, row, measure_s, image, pow2 })?;
        if samples >= 2 * run.shown && self.shows_times(&run.work) {
            run.shown = samples;
            if let Some(times) = run.progress.renderer.as_ref().and_then(|renderer| renderer.times()) {
                self.emit(&Event::Times { cell, times: Arc::new(times) })?;
            }
        }
        Ok(())
    }

    /// Whether somebody shows the light by time of a run that is small enough to be copied while it renders.
    fn shows_times(&self, work: &Work<'_>) -> bool {
        let pixels = memory::pixels(work.config);
        let small = |timing: &Timing| bytes(&timing.axis, pixels, false).is_ok_and(|bytes| bytes <= MAX_SHOWN_BYTES);
        work.config.timing.as_ref().is_some_and(small) && self.sinks.iter().any(|sink| sink.shows_times())
    }

    /// Renders what a cell of the plan has before its clock starts, and throws it away.
    fn warm_up(&mut self, work: &Work<'a>, scene: &Arc<CompiledScene>, how: &Try) -> Result<(), Broken> {
        let (Some(warmup), CellRef::Cell(_)) = (self.plan.night.warmup, work.cell) else { return Ok(()) };
        let seeds = [identity::warmup_seed()];
        let work = Work { seeds: &seeds, ..work.clone() };
        let mut renderer = Some(self.open(&work, Arc::clone(scene), how.backend)?);
        let mut done = WaveStats::default();
        loop {
            let rate = done.samples as f64 / done.render_s;
            let most = if rate.is_finite() { ((SLICE_S * rate) as u64).max(1) } else { 1 };
            let next = match warmup {
                Warmup::Time(seconds) if done.render_s < seconds => {
                    most.min(((seconds - done.render_s) * rate) as u64 + 1)
                }
                Warmup::Samples(samples) => most.min(samples.saturating_sub(done.samples)),
                Warmup::Time(_) => 0,
            };
            if next == 0 || self.control.stop_requested() || self.late() {
                break;
            }
            done.add(&advance(&mut renderer, next)?);
        }
        guard("closing the backend", || drop(renderer))?;
        let text = format!(
            "warmed up for {:.2} s with {} samples per pixel, which are thrown away",
            done.render_s, done.samples
        );
        Ok(self.say(Level::Info, work.cell, text)?)
    }

    /// Opens the renderer of a run, and goes on from its checkpoint if there is one that fits, unless it is to be
    /// rendered anew.
    fn resume(
        &mut self,
        work: &Work<'a>,
        scene: Arc<CompiledScene>,
        how: &Try,
    ) -> Result<(Box<dyn Renderer>, Resumed), Broken> {
        let mut renderer = self.open(work, Arc::clone(&scene), how.backend)?;
        let own = if how.anew { None } else { self.history.checkpoint(self.plan, work.piece()) };
        let (checkpoint, word) = match own {
            Some(own) => (own, "goes on from its checkpoint after"),
            None => match self.beginning(work).filter(|_| !how.anew) {
                Some(shorter) => (shorter, "goes on from a shorter reference after"),
                None => return Ok((renderer, Resumed::default())),
            },
        };
        let taken = guard("reading a checkpoint", || renderer.restore(&checkpoint.state));
        if let Ok(Err(lost @ RenderError::Lost { .. })) = taken {
            return Err(lost.into());
        }
        if let Err(problem) = taken.and_then(|taken| taken.map_err(|e| e.to_string())) {
            drop(renderer);
            let word = format!("what was kept of it does not fit, and it starts again: {problem}");
            let resumed = Resumed { word: Some((Level::Warn, word)), ..Resumed::default() };
            return Ok((self.open(work, scene, how.backend)?, resumed));
        }
        let standing = checkpoint.standing;
        let word = format!("{word} {} samples per pixel", standing.samples());
        Ok((renderer, Resumed { standing, goes_on: true, word: Some((Level::Info, word)) }))
    }

    /// The compiled form of a scene. The last one is kept, for cells that differ in technique, depth or seed alone.
    pub(super) fn compiled(&mut self, work: &Work<'_>) -> Result<Arc<CompiledScene>, String> {
        let sharing = work.config.accel.instances;
        if let Some((desc, before, compiled)) = &self.compiled
            && Arc::ptr_eq(desc, work.scene)
            && *before == sharing
        {
            return Ok(Arc::clone(compiled));
        }
        // Dropped first: two large scenes need not fit into memory at once.
        self.compiled = None;
        let (compiled, notes) =
            guard("compiling the scene", || compile_sharing(work.scene, sharing))?.map_err(|e| e.to_string())?;
        let compiled = Arc::new(compiled);
        self.compiled = Some((Arc::clone(work.scene), sharing, Arc::clone(&compiled)));
        for note in notes {
            if self.told.insert(note.clone()) {
                self.say(Level::Warn, work.cell, note.to_string())?;
            }
        }
        Ok(compiled)
    }

    /// Opens the renderer of a run, on its own backend or another.
    pub(super) fn open(
        &self,
        work: &Work<'_>,
        scene: Arc<CompiledScene>,
        backend: Option<&str>,
    ) -> Result<Box<dyn Renderer>, Broken> {
        let config = work.config;
        let backend = backend.unwrap_or(&config.backend);
        let name = &config.integrator;
        let job = Job {
            integrator: integrator(name).ok_or_else(|| format!("there is no integrator `{name}`"))?,
            params: config.params.clone(),
            resolution: work.resolution.or(config.resolution).unwrap_or(scene.resolution),
            max_depth: config.max_depth.unwrap_or(scene.max_depth),
            rr_start: config.rr_start,
            filter: config.filter,
            layers: config.films.clone(),
            timing: config.timing.clone(),
            sampler: sampler(&config.sampler).ok_or_else(|| format!("there is no sampler `{}`", config.sampler))?,
            // The time of references is nobody's.
            accel: match work.cell {
                CellRef::Reference(_) => AccelSpec { lanes: InLanes::Always, ..config.accel },
                CellRef::Cell(_) => config.accel,
            },
            seed: 0,
            first_sample: work.part.map_or(0, |part| part.first / 2),
            threads: self.options.threads,
        };
        let open = |seed: u64| -> Result<Box<dyn Renderer>, Broken> {
            let job = Job { seed, ..job.clone() };
            let open = || match is_external(job.integrator) {
                true => external::open(work.scene, &job),
                false => (self.seams.open)(backend, Arc::clone(&scene), job.clone()),
            };
            Ok(guard("opening the backend", open)??)
        };
        match work.seeds {
            [seed] => open(*seed),
            [first, second] => Ok(Box::new(Halves::new([open(*first)?, open(*second)?]))),
            _ => Err("a run has one seed, or those of two halves".to_owned().into()),
        }
    }

    /// Does what the user wants before the next samples, and waits while the night is paused.
    fn obey(&mut self, cell: CellRef, standing: &Standing, leads: bool) -> Result<Option<Next>, String> {
        let (samples, render_s) = (standing.samples(), standing.render_s());
        if leads && !self.control.stop_requested() && self.control.pause_if_reached(samples, render_s).is_some() {
            self.say(Level::Info, cell, format!("paused as asked, after {samples} samples per pixel"))?;
        }
        loop {
            if self.control.stop_requested() || self.late() {
                return Ok(Some(Next::End(Outcome::Interrupted)));
            }
            if leads && self.control.take_skip() {
                self.say(Level::Warn, cell, format!("given up on request after {samples} samples per pixel"))?;
                return Ok(Some(Next::End(Outcome::Interrupted)));
            }
            if leads && self.control.take_restart() {
                self.say(Level::Warn, cell, format!("rendered again on request after {samples} samples per pixel"))?;
                return Ok(Some(Next::Restart));
            }
            if !self.control.paused() {
                return Ok(None);
            }
            (self.seams.wait)();
        }
    }
}

/// The place of the run that has rendered least; of several, the one with the fewest turns.
fn furthest_behind(field: &[(Running<'_>, Floors)]) -> Option<usize> {
    let clock = |place: &usize| field[*place].0.clock();
    (0..field.len()).min_by(|a, b| {
        let ((a_s, a_turns), (b_s, b_turns)) = (clock(a), clock(b));
        a_s.total_cmp(&b_s).then(a_turns.cmp(&b_turns))
    })
}

/// The metrics of a picture in the order of the plan's columns.
fn measure(gauge: &Gauge, image: &Image) -> Result<Vec<f64>, String> {
    guard("measuring", || gauge.eval(image))?.map_err(|e| e.to_string())
}

pub(super) fn advance(slot: &mut Option<Box<dyn Renderer>>, samples: u64) -> Result<WaveStats, Broken> {
    advance_toward(slot, samples, 0)
}

fn advance_toward(slot: &mut Option<Box<dyn Renderer>>, samples: u64, more: u64) -> Result<WaveStats, Broken> {
    let Some(mut renderer) = slot.take() else { return Err("the renderer is gone".to_owned().into()) };
    let stats = guard("rendering", || renderer.advance_toward(samples, more))?;
    *slot = Some(renderer);
    match stats {
        Ok(stats) if stats.samples == 0 => Err(format!("the renderer added none of {samples} samples").into()),
        stats => Ok(stats?),
    }
}

/// Why runs cannot take turns, since all of them would be in memory at once.
pub(super) fn crowded(field: &[(Running<'_>, Floors)], memory: Option<u64>) -> Option<String> {
    if field.len() < 2 {
        return None;
    }
    let free = memory.or_else(|| memory::machine().map(|[free, _]| free + kept_bytes()))?;
    let need = field.iter().map(|(run, _)| memory::run_bytes(run.work.config)).sum();
    memory::refusal(field.len(), need, memory::Room::Free(free))
}

/// The images of a renderer's layers; the sums of one at a time are in memory twice.
fn layer_images(renderer: &dyn Renderer) -> Result<Vec<LayerImage>, RenderError> {
    let films = renderer.layers().iter().enumerate();
    films.map(|(i, film)| Ok(LayerImage { film: *film, image: film.image(&renderer.layer(i)?) })).collect()
}

/// Runs what may panic; a panic becomes a reason.
pub(super) fn guard<T>(doing: &str, work: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|payload| format!("panic while {doing}: {}", panic_text(&*payload)))
}

fn panic_text(payload: &(dyn Any + Send)) -> &str {
    let text = payload.downcast_ref::<&'static str>().copied();
    text.or_else(|| payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("no reason given")
}
