//! Events of a night and the interfaces through which it reaches the outside.
//!
//! A night emits [`Event`]s to its [`Sink`]s (recorder, dashboard, log), reads and stores results
//! through a [`History`], and obeys the [`NightControls`] that the user and signal handlers set.

use std::collections::BTreeSet;
use std::io::{self, Write};
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use super::bias_check::BiasCheckResult;
use super::forecast::Forecast;
use super::night::Night;
use super::night::reference::BiasCheckSummary;
use super::noise_floor::{HalfImages, NoiseFloors};
use super::outcome::{CellRef, Level, Outcome, WaveRow};
use super::plan::Plan;
use super::run_progress::{Checkpoint, Claim, ReportedOutcome, RunProgress};
use super::shards::{Shard, WorkUnit};
use lumbre_light::film::layer::LayerImage;
use lumbre_light::film::time::TimeCube;
use lumbre_light::film::{Film, Image, SharedImage};
use lumbre_render::{OpenStats, Settings};

/// One event of a night.
#[derive(Clone, Debug)]
pub enum Event {
    /// The night begins; always the first event.
    NightStarted {
        /// The night as it begins.
        night: Arc<Night>,
    },
    /// The renderer of a cell or reference is open; the first wave follows.
    CellStarted {
        /// The cell or reference.
        cell: CellRef,
        /// Cost of opening the renderer.
        open: OpenStats,
        /// The image that it will be measured against.
        reference: Option<SharedImage>,
        /// Measurements of an earlier process, if the run resumes from a checkpoint.
        resumed: Option<Arc<Vec<WaveRow>>>,
        /// Settings of the run, for readers whose plan does not have them.
        settings: Option<Arc<Settings>>,
    },
    /// Another process renders a run, whose waves are not reported.
    RunActive {
        /// The cell or reference.
        cell: CellRef,
    },
    /// The noise floors of a reference are known. Emitted once a night for each reference that has
    /// halves, before the first cell that is measured against it starts.
    NoiseFloors {
        /// Index into [`Plan::references`].
        reference: usize,
        /// The value that the true picture would measure against this reference, in the order of
        /// the plan's columns; no run can be expected to measure better. `None` for metrics that
        /// have no floor.
        floors: NoiseFloors,
    },
    /// A wave ended and was measured.
    Wave {
        /// The cell or reference.
        cell: CellRef,
        /// Its latest measurement.
        row: WaveRow,
        /// Seconds spent on this measurement, outside the render clock.
        measure_s: f64,
        /// The picture so far. `None` if it is not known yet; an [`Event::Picture`] follows.
        image: Option<SharedImage>,
        /// For references, the [noise](lumbre_light::film::Film::relative_noise) of the picture
        /// relative to its mean.
        noise: Option<f64>,
        /// Whether the samples per pixel have just reached a power of two.
        pow2: bool,
    },
    /// A newer picture of a run that another process renders.
    Picture {
        /// The cell or reference.
        cell: CellRef,
        /// The picture so far, or of the end.
        image: SharedImage,
    },
    /// An image of a layer of a run that another process rendered.
    Layer {
        /// The cell or reference.
        cell: CellRef,
        /// The image and its layer.
        layer: Arc<LayerImage>,
    },
    /// The time-resolved film of a run so far. Emitted after waves that have doubled its samples,
    /// if a sink [wants it](Sink::wants_times) and the film is small enough to copy.
    Times {
        /// The cell or reference.
        cell: CellRef,
        /// Radiance by pixel and time bin.
        times: Arc<TimeCube>,
    },
    /// A reference was compared with the same picture by a second technique.
    BiasCheck {
        /// Index of the reference into [`Plan::references`].
        reference: usize,
        /// The result in short.
        check: BiasCheckSummary,
        /// Index of the second picture and the result of the comparison; only in the process that
        /// compared them.
        compared: Option<(usize, Arc<BiasCheckResult>)>,
    },
    /// The renderer of a reference's shard is open. Waves of the reference follow, counted from the
    /// beginning of the shard. The reference itself starts when all of its shards are joined.
    ShardStarted {
        /// Shard of the reference.
        shard: Shard,
        /// Cost of opening the renderer.
        open: OpenStats,
        /// Measurements of an earlier process, if the shard resumes from a checkpoint.
        resumed: Option<Arc<Vec<WaveRow>>>,
    },
    /// Another process renders a shard of a reference, whose waves are not reported.
    ShardActive {
        /// Shard of the reference.
        shard: Shard,
    },
    /// A shard of a reference ended. Recorders store its sums when they receive this.
    ShardFinished {
        /// Shard of the reference.
        shard: Shard,
        /// Outcome of the shard.
        outcome: Outcome,
        /// Its last measurement.
        last: Option<WaveRow>,
        /// Its sums, if it is done and still claimed by this process.
        sums: Option<Arc<Checkpoint>>,
    },
    /// A reference has been rendered; its [`Event::CellFinished`] follows.
    Halves {
        /// Index into [`Plan::references`].
        reference: usize,
        /// Films of its two independent halves.
        halves: [Arc<Film>; 2],
    },
    /// A cell or reference ended. Recorders write its results when they receive this, before the
    /// night continues.
    CellFinished {
        /// The cell or reference.
        cell: CellRef,
        /// Outcome of the run.
        outcome: Outcome,
        /// The film; `None` if it was cached, ended before its first wave, or panicked while
        /// rendering.
        film: Option<Arc<Film>>,
        /// The picture, if it is not the mean of the film but was denoised.
        denoised: Option<SharedImage>,
        /// Images of the requested layers; empty unless it is done.
        layers: Arc<Vec<LayerImage>>,
        /// The time-resolved film, if requested; `None` unless it is done.
        times: Option<Arc<TimeCube>>,
        /// Its measurements, oldest first; only the last one if no more are known.
        rows: Arc<Vec<WaveRow>>,
        /// Noise floors of its reference, if known.
        floors: NoiseFloors,
        /// Cost of opening its renderer, if known.
        open: Option<OpenStats>,
    },
    /// A new estimate of the remaining time. Emitted before the first run and at intervals between
    /// runs, never while a run is in progress.
    Forecast(Forecast),
    /// A line of text for the user.
    Message {
        /// Severity of the message.
        level: Level,
        /// The cell or reference that it is about, if any.
        cell: Option<CellRef>,
        /// Text of the line.
        text: String,
    },
    /// The night is over; always the last event.
    NightFinished,
}

impl Event {
    /// Returns the end of a run of which no more is known than its outcome and measurements.
    pub fn ended(cell: CellRef, outcome: Outcome, rows: Vec<WaveRow>) -> Event {
        Event::CellFinished {
            cell,
            outcome,
            film: None,
            denoised: None,
            layers: Arc::default(),
            times: None,
            rows: Arc::new(rows),
            floors: NoiseFloors::default(),
            open: None,
        }
    }

    /// The cell or reference that the event is about, if any.
    pub fn cell(&self) -> Option<CellRef> {
        match self {
            Event::CellStarted { cell, .. }
            | Event::RunActive { cell }
            | Event::Wave { cell, .. }
            | Event::Picture { cell, .. }
            | Event::Layer { cell, .. }
            | Event::Times { cell, .. }
            | Event::CellFinished { cell, .. } => Some(*cell),
            Event::NoiseFloors { reference, .. }
            | Event::BiasCheck { reference, .. }
            | Event::Halves { reference, .. } => Some(CellRef::Reference(*reference)),
            Event::ShardStarted { shard, .. }
            | Event::ShardActive { shard }
            | Event::ShardFinished { shard, .. } => Some(CellRef::Reference(shard.reference)),
            Event::Message { cell, .. } => *cell,
            Event::NightStarted { .. } | Event::Forecast(_) | Event::NightFinished => None,
        }
    }
}

/// Why a sink or a history could not carry out a request.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct SinkError(pub String);

/// A receiver of events. Sinks are called in line on the control thread, between waves.
pub trait Sink {
    /// Receives an event.
    ///
    /// # Errors
    /// When a result could not be recorded; the cell then counts as failed.
    fn receive(&mut self, event: &Event) -> Result<(), SinkError>;

    /// Whether to emit [`Event::Times`], which costs a copy of all time bins.
    fn wants_times(&self) -> bool {
        false
    }
}

/// Writes the state of a renderer and returns whether the renderer could save it:
/// [`Renderer::save`](lumbre_render::Renderer::save).
pub type SaveState<'a> = &'a dyn Fn(&mut dyn Write) -> io::Result<bool>;

/// Results of earlier nights, checkpoints of this one, and coordination with other processes.
///
/// The default methods are those of a history that stores nothing and is used by one process.
pub trait History {
    /// The folder and final measurements of a finished run with the same identity.
    fn finished_run(&self, plan: &Plan, cell: CellRef) -> Option<FinishedRun>;

    /// The outcome that another worker has reported for a run. Reading it is cheaper than reading
    /// the run itself, which matters to one of many workers that looks at thousands of runs.
    fn reported_outcome(&self, _plan: &Plan, _cell: CellRef) -> Option<ReportedOutcome> {
        None
    }

    /// The image of a finished reference, or of an image file that a script named.
    ///
    /// # Errors
    /// When it exists but cannot be read.
    fn image(&self, plan: &Plan, reference: usize) -> Result<Option<Image>, SinkError>;

    /// The standard error of every pixel of a finished reference, if it was stored.
    ///
    /// # Errors
    /// When it exists but cannot be read.
    fn noise(&self, _plan: &Plan, _reference: usize) -> Result<Option<Image>, SinkError> {
        Ok(None)
    }

    /// The pictures of the two halves of a finished reference, if they were stored.
    ///
    /// # Errors
    /// When they exist but cannot be read.
    fn halves(&self, _plan: &Plan, _reference: usize) -> Result<Option<HalfImages>, SinkError> {
        Ok(None)
    }

    /// Claims a run or shard for this process until [`History::release`], so that no other process
    /// works on it.
    ///
    /// # Errors
    /// When it cannot be determined whether another process has claimed it.
    fn claim(&self, _plan: &Plan, _unit: WorkUnit) -> Result<Claim, SinkError> {
        Ok(Claim::Granted)
    }

    /// Whether a granted claim is still valid. It is lost if this process was suspended for so long
    /// that others took it for dead.
    fn holds_claim(&self, _plan: &Plan, _unit: WorkUnit) -> bool {
        true
    }

    /// Releases a claim.
    fn release(&self, _plan: &Plan, _unit: WorkUnit) {}

    /// The newest valid checkpoint of an unfinished run or shard.
    fn checkpoint(&self, _plan: &Plan, _unit: WorkUnit) -> Option<Checkpoint> {
        None
    }

    /// The sums of the longest finished reference that this one can continue: one with the same
    /// stem and at most `max_samples` samples per pixel.
    fn shorter_reference(
        &self,
        _plan: &Plan,
        _reference: usize,
        _max_samples: u64,
    ) -> Option<Checkpoint> {
        None
    }

    /// Stores the sums of a finished reference, from which longer ones with its stem can continue,
    /// and returns whether it did.
    ///
    /// # Errors
    /// When they could not be written; sums stored before are still there.
    fn save_sums(
        &self,
        _plan: &Plan,
        _reference: usize,
        _progress: &RunProgress,
        _save: SaveState<'_>,
    ) -> Result<bool, SinkError> {
        Ok(false)
    }

    /// Stores a checkpoint of a claimed run or shard, and returns whether it did.
    ///
    /// # Errors
    /// When it could not be written; the previous checkpoint is still there.
    fn save_checkpoint(
        &self,
        _plan: &Plan,
        _unit: WorkUnit,
        _progress: &RunProgress,
        _save: SaveState<'_>,
    ) -> Result<bool, SinkError> {
        Ok(false)
    }

    /// The numbers of the given shards that are stored, alone or joined, and need no rendering.
    fn available_shards(&self, _plan: &Plan, _shards: &[Shard]) -> BTreeSet<usize> {
        BTreeSet::new()
    }

    /// The sums of a shard that is stored alone. A damaged one is removed and counts as missing
    /// from then on.
    fn shard(&self, _plan: &Plan, _shard: &Shard) -> Option<Checkpoint> {
        None
    }

    /// The joined sums of as many of the given shards, counted from the first, as are stored
    /// joined.
    fn joined_shards(&self, _plan: &Plan, _shards: &[Shard]) -> Option<Checkpoint> {
        None
    }

    /// Stores `joined`, the sums of the first few of the given shards, if any, and deletes all
    /// shards that are stored alone.
    ///
    /// # Errors
    /// When they could not be written; what was stored before is still there.
    fn save_joined_shards(
        &self,
        _plan: &Plan,
        _shards: &[Shard],
        _joined: Option<&Checkpoint>,
    ) -> Result<(), SinkError> {
        Ok(())
    }
}

/// A run that an earlier night finished.
#[derive(Clone, Debug, PartialEq)]
pub struct FinishedRun {
    /// Folder of the run.
    pub folder: std::path::PathBuf,
    /// Its measurements, oldest first.
    pub rows: Vec<WaveRow>,
    /// The noise floors of its reference, if they were known.
    pub floors: NoiseFloors,
    /// Cost of opening its renderer.
    pub open: OpenStats,
}

impl FinishedRun {
    /// Returns the event that the run was found finished.
    pub fn event(self, cell: CellRef) -> Event {
        Event::CellFinished {
            cell,
            outcome: Outcome::Cached(self.folder),
            film: None,
            denoised: None,
            layers: Arc::default(),
            times: None,
            rows: Arc::new(self.rows),
            floors: self.floors,
            open: Some(self.open),
        }
    }
}

/// A limit at which the night pauses so that the user can look. Unlike a stop rule, it is not part
/// of a run's identity and can be changed while the run renders.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PauseAt {
    /// Samples per pixel of the current cell.
    Samples(u64),
    /// Seconds of render time of the current cell.
    RenderS(f64),
}

impl PauseAt {
    /// Whether a cell with these samples per pixel and seconds of render time has reached the
    /// limit.
    pub fn reached(self, samples: u64, render_s: f64) -> bool {
        match self {
            PauseAt::Samples(limit) => samples >= limit,
            PauseAt::RenderS(limit) => render_s >= limit,
        }
    }
}

/// Request that stays until it is taken or withdrawn, shared between threads.
#[derive(Debug, Default)]
pub struct Flag(AtomicBool);

impl Flag {
    /// Makes or withdraws the request.
    pub fn set(&self, requested: bool) {
        self.0.store(requested, Ordering::SeqCst);
    }

    /// Whether the request is made.
    pub fn get(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }

    /// Returns whether the request was made, and withdraws it.
    pub fn take(&self) -> bool {
        self.0.swap(false, Ordering::SeqCst)
    }

    /// Makes the request, or withdraws it if it is made, and returns whether it is made now.
    pub fn toggle(&self) -> bool {
        !self.0.fetch_xor(true, Ordering::SeqCst)
    }
}

/// Requests of the user and of signal handlers, shared between threads. The night polls them
/// between waves and slices of waves.
#[derive(Debug, Default)]
pub struct NightControls {
    /// Number of stop requests so far.
    stop: AtomicU8,
    /// The night stops before it starts another cell.
    pub after_cell: Flag,
    /// The night is paused.
    pub paused: Flag,
    pause_at: Mutex<Option<PauseAt>>,
    /// The current cell is abandoned for this night.
    pub skip: Flag,
    /// The current cell is rendered again from its first sample.
    pub restart: Flag,
    /// A checkpoint is saved at the next opportunity.
    pub checkpoint: Flag,
}

impl NightControls {
    /// Requests the night to stop as soon as the current slice is rendered, and returns the number
    /// of such requests so far. After the second, callers may exit at once.
    pub fn request_stop(&self) -> u8 {
        self.stop.fetch_add(1, Ordering::SeqCst).saturating_add(1)
    }

    /// Whether the night should stop.
    pub fn stop_requested(&self) -> bool {
        self.stop.load(Ordering::SeqCst) > 0
    }

    /// Sets or removes the limit at which the night pauses; it applies once.
    pub fn set_pause_at(&self, limit: Option<PauseAt>) {
        *self.pause_at.lock().unwrap_or_else(PoisonError::into_inner) = limit;
    }

    /// The limit at which the night pauses.
    pub fn pause_at(&self) -> Option<PauseAt> {
        *self.pause_at.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Pauses if the current cell has reached the limit; then removes the limit and returns it.
    pub fn pause_if_reached(&self, samples: u64, render_s: f64) -> Option<PauseAt> {
        let mut limit = self.pause_at.lock().unwrap_or_else(PoisonError::into_inner);
        let reached = limit.take_if(|limit| limit.reached(samples, render_s))?;
        self.paused.set(true);
        Some(reached)
    }
}
