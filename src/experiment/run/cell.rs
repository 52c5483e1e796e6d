//! One run: open, then wave after wave until the stop rule holds, the user intervenes, or something fails.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Instant;

use super::checkpoint::Kept;
use super::night::Night;
use super::waves::Waves;
use crate::experiment::event::{CellRef, Event, FinishedRun, Level, Outcome, WaveRow};
use crate::experiment::floors::Floors;
use crate::experiment::spec::{CellConfig, Snapshots};
use crate::experiment::standing::Standing;
use crate::experiment::stop::StopRule;
use crate::film::layer::LayerImage;
use crate::film::time::TimeCube;
use crate::film::{Film, Image, SharedImage};
use crate::render::halves::Halves;
use crate::render::{Job, OpenStats, RenderError, Renderer, WaveStats};
use crate::scene::compile::compile_sharing;
use crate::scene::{CompiledScene, SceneDesc};
use crate::transport::integrator::integrator;
use crate::transport::sampler::sampler;

/// How long the user may have to wait to be heard, in seconds of render time: longer waves are cut into slices. That
/// changes no picture, and neither which samples are measured.
const SLICE_S: f64 = 1.0;

/// What a run is to render.
pub(super) struct Work<'a> {
    pub(super) cell: CellRef,
    pub(super) config: &'a CellConfig,
    pub(super) scene: &'a Arc<SceneDesc>,
    /// One, or those of two halves.
    pub(super) seeds: &'a [u64],
    pub(super) stop: &'a StopRule,
    pub(super) reference: Option<SharedImage>,
    /// A size other than the configuration's.
    pub(super) resolution: Option<[u32; 2]>,
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
        Ended { outcome: Outcome::Cached(folder), rows, floors, open, ..Ended::failed(String::new()) }
    }

    pub(super) fn failed(reason: String) -> Ended {
        Ended {
            outcome: Outcome::Failed(reason),
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

/// What follows when waves no longer do.
enum Next {
    /// The run is over.
    End(Outcome),
    /// The user wants it from its first sample.
    Restart,
}

/// Why a try of a run came to nothing.
pub(super) enum Broken {
    /// The device or the process that rendered is gone; another try may succeed.
    Lost(String),
    /// The backend cannot do it.
    Backend(String),
    /// Anything else.
    Other(String),
}

impl From<String> for Broken {
    fn from(reason: String) -> Broken {
        Broken::Other(reason)
    }
}

impl From<RenderError> for Broken {
    fn from(error: RenderError) -> Broken {
        let reason = error.to_string();
        match error {
            RenderError::Lost { .. } => Broken::Lost(reason),
            RenderError::Unsupported { .. } | RenderError::Failed { .. } => Broken::Backend(reason),
        }
    }
}

impl Broken {
    /// What happened.
    pub(super) fn reason(self) -> String {
        let (Broken::Lost(reason) | Broken::Backend(reason) | Broken::Other(reason)) = self;
        reason
    }
}

/// How often a run is tried again whose device was lost.
const MOST_LOSSES: u32 = 3;

/// How a run is tried.
#[derive(Default)]
struct Try {
    /// From its first sample, whatever was kept.
    anew: bool,
    /// How often its device was lost so far.
    losses: u32,
    /// On another backend than its own.
    backend: Option<&'static str>,
}

/// How a run begins.
#[derive(Default)]
struct Resumed {
    standing: Standing,
    goes_on: bool,
    /// What there is to say about it.
    word: Option<(Level, String)>,
}

/// A run in progress.
#[derive(Default)]
pub(super) struct Progress {
    /// Taken away when it panics: its sums can no longer be trusted.
    pub(super) renderer: Option<Box<dyn Renderer>>,
    pub(super) standing: Standing,
    pub(super) kept: Kept,
}

impl Night<'_, '_> {
    /// Renders one run to its end, whatever that is.
    pub(super) fn perform(&mut self, work: &Work<'_>) -> Ended {
        let mut progress = Progress::default();
        let mut how = Try::default();
        let mut layers = Vec::new();
        let outcome = loop {
            let ended = self.render(work, &mut progress, &how).and_then(|next| {
                // Only what is finished is recorded.
                if let (Next::End(Outcome::Done(_)), Some(renderer)) = (&next, &progress.renderer) {
                    layers = layer_images(renderer.as_ref())?;
                }
                Ok(next)
            });
            match ended {
                Ok(Next::End(outcome)) => break outcome,
                Ok(Next::Restart) => (progress, how.anew) = (Progress::default(), true),
                Err(broken) => match self.try_again(work, &mut how, &progress, broken) {
                    Ok(true) => progress = Progress::default(),
                    Ok(false) => {
                        progress = Progress::default();
                        break Outcome::Interrupted;
                    }
                    Err(reason) => break Outcome::Failed(reason),
                },
            }
        };
        if outcome == Outcome::Interrupted {
            self.keep(work.cell, &mut progress);
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

    /// Decides how a run is tried again that came to nothing, and says so; false if there is no time left for it.
    ///
    /// A device that was lost is tried again a few times. What a backend cannot do after that another one does, if the
    /// script has left the choice to the program: from the first sample, since two clocks do not add up.
    fn try_again(
        &mut self,
        work: &Work<'_>,
        how: &mut Try,
        progress: &Progress,
        broken: Broken,
    ) -> Result<bool, String> {
        let lost = matches!(broken, Broken::Lost(_));
        if lost && (self.control.stop_requested() || self.late()) {
            self.say(Level::Warn, work.cell, broken.reason())?;
            return Ok(false);
        }
        if lost && how.losses < MOST_LOSSES {
            how.losses += 1;
            how.anew = how.anew && !progress.kept.any;
            let (reason, losses) = (broken.reason(), how.losses);
            let text = format!("{reason}; it is tried again from its newest checkpoint ({losses} of {MOST_LOSSES})");
            self.say(Level::Warn, work.cell, text)?;
            return Ok(true);
        }
        let fallback = work.config.fallback.filter(|_| how.backend.is_none() && !matches!(broken, Broken::Other(_)));
        let Some(backend) = fallback else { return Err(broken.reason()) };
        *how = Try { anew: true, losses: 0, backend: Some(backend) };
        let text = format!("{}; as its backend is `auto`, it is rendered by `{backend}` instead", broken.reason());
        self.say(Level::Warn, work.cell, text)?;
        Ok(true)
    }

    fn render(&mut self, work: &Work<'_>, progress: &mut Progress, how: &Try) -> Result<Next, Broken> {
        let started = Instant::now();
        let scene = self.compiled(work)?;
        let (renderer, resumed) = self.resume(work, scene, how)?;
        let open = renderer.open_stats().clone();
        progress.renderer = Some(renderer);
        progress.standing = resumed.standing;
        progress.kept.at_s = progress.standing.render_s();
        let before_s = progress.standing.wall_s;
        let wall_s = || before_s + started.elapsed().as_secs_f64();
        let rows = resumed.goes_on.then(|| Arc::new(progress.standing.rows.clone()));
        let reference = work.reference.clone();
        self.emit(&Event::CellStarted { cell: work.cell, open, reference, resumed: rows })?;
        if let Some((level, text)) = resumed.word {
            self.say(level, work.cell, text)?;
        }
        let plan = self.plan;
        let columns = plan.columns();
        let mut waves = Waves::new(plan.measure.every_s, plan.measure.snapshots == Snapshots::Pow2);
        if resumed.goes_on {
            waves = waves.from(progress.standing.growth);
        }
        let slice_s = plan.night.checkpoint_s.map_or(SLICE_S, |every_s| every_s.min(SLICE_S));
        loop {
            let standing = &mut progress.standing;
            if standing.between_waves() {
                let hooks = self.hooks;
                let rows = &standing.rows;
                let mut ask = |id| hooks.predicate(id, &columns, rows);
                // Also asked of what an earlier process measured last, which may have been cut off before it asked.
                if !rows.is_empty()
                    && let Some(reason) = work.stop.check(rows, &columns, &mut ask).map_err(|e| e.to_string())?
                {
                    return Ok(Next::End(Outcome::Done(reason)));
                }
                standing.left = waves.next(rows, work.stop);
                standing.growth = waves.size;
            }
            while progress.standing.left > 0 {
                progress.standing.wall_s = wall_s();
                if let Some(next) = self.obey(work.cell, &progress.standing)? {
                    return Ok(next);
                }
                let stats = advance(&mut progress.renderer, slice(&progress.standing, slice_s))?;
                let first = stats.invalid > 0
                    && progress.standing.part.invalid == 0
                    && progress.standing.rows.iter().all(|row| row.invalid == 0);
                progress.standing.count(&stats);
                if first {
                    self.say(Level::Warn, work.cell, invalid_words(&progress.standing))?;
                }
                progress.standing.wall_s = wall_s();
                self.keep_if_due(work.cell, progress);
            }
            let Some(renderer) = &progress.renderer else { return Err("the renderer is gone".to_owned().into()) };
            let measuring = Instant::now();
            let image = Arc::new(renderer.film().mean());
            let metrics = self.measure(&image, work.reference.as_deref())?;
            let measure_s = measuring.elapsed().as_secs_f64();
            let before_s = progress.standing.rows.last().map_or(0.0, |row| row.measure_s);
            let measured_s = before_s + measure_s;
            let row = WaveRow { wall_s: wall_s(), measure_s: measured_s, metrics, ..progress.standing.close_wave() };
            let pow2 = row.samples.is_power_of_two();
            progress.standing.rows.push(row.clone());
            self.emit(&Event::Wave { cell: work.cell, row, measure_s, image, pow2 })?;
        }
    }

    /// Opens the renderer of a run, and goes on from its checkpoint if there is one that fits, unless it is to be
    /// rendered anew.
    fn resume(
        &mut self,
        work: &Work<'_>,
        scene: Arc<CompiledScene>,
        how: &Try,
    ) -> Result<(Box<dyn Renderer>, Resumed), Broken> {
        let mut renderer = self.open(work, Arc::clone(&scene), how.backend)?;
        let checkpoint = if how.anew { None } else { self.history.checkpoint(self.plan, work.cell) };
        let Some(checkpoint) = checkpoint else {
            return Ok((renderer, Resumed::default()));
        };
        let taken = guard("reading a checkpoint", || renderer.restore(&checkpoint.state));
        if let Ok(Err(lost @ RenderError::Lost { .. })) = taken {
            return Err(lost.into());
        }
        if let Err(problem) = taken.and_then(|taken| taken.map_err(|e| e.to_string())) {
            drop(renderer);
            let word = format!("its checkpoint does not fit, and it starts again: {problem}");
            let resumed = Resumed { word: Some((Level::Warn, word)), ..Resumed::default() };
            return Ok((self.open(work, scene, how.backend)?, resumed));
        }
        let standing = checkpoint.standing;
        let word = format!("goes on from its checkpoint after {} samples per pixel", standing.samples());
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
            accel: config.accel,
            seed: 0,
            threads: self.options.threads,
        };
        let open = |seed: u64| -> Result<Box<dyn Renderer>, Broken> {
            let job = Job { seed, ..job.clone() };
            Ok(guard("opening the backend", || (self.seams.open)(backend, Arc::clone(&scene), job))??)
        };
        match work.seeds {
            [seed] => open(*seed),
            [first, second] => Ok(Box::new(Halves::new([open(*first)?, open(*second)?]))),
            _ => Err("a run has one seed, or those of two halves".to_owned().into()),
        }
    }

    /// The metrics of a picture in the order of the plan's columns; none without a reference.
    fn measure(&self, image: &Image, reference: Option<&Image>) -> Result<Vec<f64>, String> {
        let Some(reference) = reference else { return Ok(Vec::new()) };
        let metrics = self.plan.measure.metrics.iter();
        let values = guard("measuring", || metrics.map(|m| m.eval(image, reference)).collect::<Result<_, _>>())?;
        values.map_err(|e| e.to_string())
    }

    /// Does what the user wants before the next samples, and waits while the night is paused.
    fn obey(&mut self, cell: CellRef, standing: &Standing) -> Result<Option<Next>, String> {
        let (samples, render_s) = (standing.samples(), standing.render_s());
        if !self.control.stop_requested() && self.control.pause_if_reached(samples, render_s).is_some() {
            self.say(Level::Info, cell, format!("paused as asked, after {samples} samples per pixel"))?;
        }
        loop {
            if self.control.stop_requested() || self.late() {
                return Ok(Some(Next::End(Outcome::Interrupted)));
            }
            if self.control.take_skip() {
                self.say(Level::Warn, cell, format!("given up on request after {samples} samples per pixel"))?;
                return Ok(Some(Next::End(Outcome::Interrupted)));
            }
            if self.control.take_restart() {
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

pub(super) fn advance(slot: &mut Option<Box<dyn Renderer>>, samples: u64) -> Result<WaveStats, Broken> {
    let Some(mut renderer) = slot.take() else { return Err("the renderer is gone".to_owned().into()) };
    let stats = guard("rendering", || renderer.advance(samples))?;
    *slot = Some(renderer);
    match stats {
        Ok(stats) if stats.samples == 0 => Err(format!("the renderer added none of {samples} samples").into()),
        stats => Ok(stats?),
    }
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

/// Samples of the next call of the renderer: the wave in progress, or as many of it as take about `slice_s`.
fn slice(standing: &Standing, slice_s: f64) -> u64 {
    let rate = standing.samples() as f64 / standing.render_s();
    if rate.is_finite() { standing.left.min(((slice_s * rate) as u64).max(1)) } else { standing.left }
}

fn invalid_words(standing: &Standing) -> String {
    let place = match standing.part.first_invalid {
        Some([x, y, sample]) => format!(", the first at column {x}, row {y}, sample {sample}"),
        None => String::new(),
    };
    let wave = standing.rows.len() + 1;
    format!("{} invalid samples (NaN or infinite) in wave {wave}{place}; they count as black", standing.part.invalid)
}
