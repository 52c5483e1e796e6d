//! What happens during a night, told to everyone who listens.

use std::io::{self, Write};
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use super::agree::Agreement;
use super::floors::{Floors, HalfImages};
use super::forecast::Forecast;
use super::plan::Plan;
use super::standing::{Checkpoint, Claim, Settled, Standing};
use crate::film::layer::LayerImage;
use crate::film::time::TimeCube;
use crate::film::{Film, Image, SharedImage};
use crate::render::OpenStats;

/// A cell of the plan, or one of its references.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum CellRef {
    /// Index into [`Plan::cells`].
    Cell(usize),
    /// Index into [`Plan::references`].
    Reference(usize),
}

/// One measurement: the state of a run at the end of a wave.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WaveRow {
    /// Number of the wave, from 1.
    pub wave: u64,
    /// Samples per pixel so far.
    pub samples: u64,
    /// Seconds inside the renderer so far.
    pub render_s: f64,
    /// Seconds that the cell has taken, everything included; while it takes turns with others, its own turns alone.
    pub wall_s: f64,
    /// Seconds spent measuring so far, which are no part of `render_s`.
    pub measure_s: f64,
    /// Camera paths so far.
    pub paths: u64,
    /// Rays so far.
    pub rays: u64,
    /// Invalid samples so far.
    pub invalid: u64,
    /// Column, row and sample of the first invalid sample.
    pub first_invalid: Option<[u64; 3]>,
    /// Metrics in the order of the plan's columns; empty for references, and without a reference.
    pub metrics: Vec<f64>,
}

impl WaveRow {
    /// Million camera paths per second of render time; zero before the first wave.
    pub fn mpaths_per_s(&self) -> f64 {
        if self.render_s > 0.0 { self.paths as f64 / self.render_s / 1e6 } else { 0.0 }
    }

    /// Frames per second of render time, a frame being one sample of every pixel; zero before the first wave.
    pub fn fps(&self) -> f64 {
        if self.render_s > 0.0 { self.samples as f64 / self.render_s } else { 0.0 }
    }
}

/// How a cell ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// Finished by its stop rule; the text says which part of it.
    Done(String),
    /// It was there already, in this folder.
    Cached(std::path::PathBuf),
    /// It failed; the night goes on.
    Failed(String),
    /// The user or a signal ended the night first.
    Interrupted,
}

/// Importance of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// A few lines per cell.
    Info,
    /// Something was done otherwise than asked.
    Warn,
    /// A result was lost.
    Error,
}

/// Something that happened.
#[derive(Clone, Debug)]
pub enum Event {
    /// The night begins.
    NightStarted {
        /// The whole plan.
        plan: Arc<Plan>,
    },
    /// A cell's renderer is open; the first wave follows.
    CellStarted {
        /// Which.
        cell: CellRef,
        /// What opening cost.
        open: OpenStats,
        /// The image it will be measured against.
        reference: Option<SharedImage>,
        /// The measurements of an earlier process, if the run goes on from its checkpoint.
        resumed: Option<Arc<Vec<WaveRow>>>,
    },
    /// What the noise of a reference leaves to be measured is known. Told once a night for a reference with halves,
    /// before the first cell that is measured against it starts.
    Floors {
        /// Index into [`Plan::references`].
        reference: usize,
        /// The value that the true picture would have, in the order of the plan's columns; `None` for metrics of which
        /// that cannot be said. No run can be measured to be better.
        floors: Floors,
    },
    /// A wave ended and was measured.
    Wave {
        /// Which.
        cell: CellRef,
        /// The measurement.
        row: WaveRow,
        /// Seconds spent measuring it, outside the clock.
        measure_s: f64,
        /// The picture so far.
        image: SharedImage,
        /// Whether the samples per pixel have just reached a power of two.
        pow2: bool,
    },
    /// The light by time so far of a run whose film has a time axis, where somebody shows it and it is small enough to be
    /// copied: told after waves that have doubled its samples. See [`Sink::shows_times`].
    Times {
        /// Which.
        cell: CellRef,
        /// The light.
        times: Arc<TimeCube>,
    },
    /// A reference was compared with the same picture by a second technique; see [`Plan::references`].
    Agreement {
        /// Index of the reference.
        reference: usize,
        /// Index of the second picture.
        with: usize,
        /// What was found.
        found: Arc<Agreement>,
    },
    /// A reference has been rendered; its [`Event::CellFinished`] follows.
    Halves {
        /// Index into [`Plan::references`].
        reference: usize,
        /// Its two independent halves.
        halves: [Arc<Film>; 2],
    },
    /// A cell ended. Recorders write its results when they hear this, before the night goes on.
    CellFinished {
        /// Which.
        cell: CellRef,
        /// How.
        outcome: Outcome,
        /// The sums; none if it was cached, ended before its first wave, or panicked while rendering.
        film: Option<Arc<Film>>,
        /// The images of the layers that it was asked for; empty unless it is done.
        layers: Arc<Vec<LayerImage>>,
        /// Its light by time, if it was asked for; none unless it is done.
        times: Option<Arc<TimeCube>>,
        /// Its measurements, oldest first.
        rows: Arc<Vec<WaveRow>>,
    },
    /// What is left of the night was reckoned anew: told before the first run, and now and then between runs. No run is
    /// in progress then.
    Forecast(Forecast),
    /// A line for people.
    Message {
        /// Importance.
        level: Level,
        /// The cell it is about, if any.
        cell: Option<CellRef>,
        /// The line.
        text: String,
    },
    /// The night is over.
    NightFinished,
}

impl Event {
    /// The cell or reference that it is about, if it is about one.
    pub fn cell(&self) -> Option<CellRef> {
        match self {
            Event::CellStarted { cell, .. }
            | Event::Wave { cell, .. }
            | Event::Times { cell, .. }
            | Event::CellFinished { cell, .. } => Some(*cell),
            Event::Floors { reference, .. } | Event::Agreement { reference, .. } | Event::Halves { reference, .. } => {
                Some(CellRef::Reference(*reference))
            }
            Event::Message { cell, .. } => *cell,
            Event::NightStarted { .. } | Event::Forecast(_) | Event::NightFinished => None,
        }
    }
}

/// Why a listener could not do its part.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct SinkError(pub String);

/// Someone who listens. Sinks are called in line on the control thread, between waves.
pub trait Sink {
    /// Hears an event.
    ///
    /// # Errors
    /// When a result could not be recorded; the cell then counts as failed.
    fn hear(&mut self, event: &Event) -> Result<(), SinkError>;

    /// Whether it wants to hear [`Event::Times`], which costs a copy of all bins.
    fn shows_times(&self) -> bool {
        false
    }
}

/// Writes the state of a renderer, and says whether it could: [`Renderer::save`](crate::render::Renderer::save).
pub type Save<'a> = &'a dyn Fn(&mut dyn Write) -> io::Result<bool>;

/// Finds what earlier nights left, keeps what this one must not lose, and knows who else is at work.
///
/// What only some keep has a default: nothing is kept, and nobody else is there.
pub trait History {
    /// The folder and final measurements of a finished run with this identity.
    fn done(&self, plan: &Plan, cell: CellRef) -> Option<FinishedRun>;

    /// What other workers say that they have made of a run, where that is enough: one of many does not read what
    /// thousands of runs came to.
    fn settled(&self, _plan: &Plan, _cell: CellRef) -> Option<Settled> {
        None
    }

    /// The image of a finished reference, or of an image file that a script named.
    ///
    /// # Errors
    /// When it is there but cannot be read.
    fn image(&self, plan: &Plan, reference: usize) -> Result<Option<Image>, SinkError>;

    /// The standard error of every pixel of a finished reference, if it was kept with it.
    ///
    /// # Errors
    /// When it is there but cannot be read.
    fn noise(&self, _plan: &Plan, _reference: usize) -> Result<Option<Image>, SinkError> {
        Ok(None)
    }

    /// The two halves of a finished reference, if it was kept with them.
    ///
    /// # Errors
    /// When they are there but cannot be read.
    fn halves(&self, _plan: &Plan, _reference: usize) -> Result<Option<HalfImages>, SinkError> {
        Ok(None)
    }

    /// Makes a run this process's own, so that no other one works on it, until [`History::release`].
    ///
    /// # Errors
    /// When it cannot be known whether another process has it.
    fn claim(&self, _plan: &Plan, _cell: CellRef) -> Result<Claim, SinkError> {
        Ok(Claim::Ours)
    }

    /// Whether a claim that was granted still holds. It is lost when this process stood still for so long that others
    /// took it for dead.
    fn holds(&self, _plan: &Plan, _cell: CellRef) -> bool {
        true
    }

    /// Gives a claim back.
    fn release(&self, _plan: &Plan, _cell: CellRef) {}

    /// The newest valid checkpoint of an unfinished run.
    fn checkpoint(&self, _plan: &Plan, _cell: CellRef) -> Option<Checkpoint> {
        None
    }

    /// The sums of the longest finished reference of which this one is a continuation: it has the same stem, and at most
    /// so many samples per pixel.
    fn beginning(&self, _plan: &Plan, _reference: usize, _most: u64) -> Option<Checkpoint> {
        None
    }

    /// Keeps the sums of a finished reference, from which longer ones with its stem go on, and says whether it did.
    ///
    /// # Errors
    /// When they could not be written; what was kept before is still there.
    fn keep_sums(
        &self,
        _plan: &Plan,
        _reference: usize,
        _standing: &Standing,
        _save: Save<'_>,
    ) -> Result<bool, SinkError> {
        Ok(false)
    }

    /// Keeps a checkpoint of a run that is claimed, and says whether it did.
    ///
    /// # Errors
    /// When it could not be written; the one before is still there.
    fn keep(&self, _plan: &Plan, _cell: CellRef, _standing: &Standing, _save: Save<'_>) -> Result<bool, SinkError> {
        Ok(false)
    }
}

/// A run that an earlier night finished.
#[derive(Clone, Debug, PartialEq)]
pub struct FinishedRun {
    /// Its folder.
    pub folder: std::path::PathBuf,
    /// Its measurements, oldest first.
    pub rows: Vec<WaveRow>,
    /// The noise floors of what it was measured against, if they were known.
    pub floors: Floors,
    /// What opening it cost.
    pub open: OpenStats,
}

/// A limit at which the night pauses by itself, for someone who wants to look. It is no stop rule: those decide what a
/// run is, and cannot change while it renders.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PauseAt {
    /// Samples per pixel of the current cell.
    Samples(u64),
    /// Seconds of render time of the current cell.
    RenderS(f64),
}

impl PauseAt {
    /// Whether a cell that is so far has reached it.
    pub fn reached(self, samples: u64, render_s: f64) -> bool {
        match self {
            PauseAt::Samples(limit) => samples >= limit,
            PauseAt::RenderS(limit) => render_s >= limit,
        }
    }
}

/// What the user and signals want, shared between threads. The night looks between waves.
#[derive(Debug, Default)]
pub struct Control {
    stop: AtomicU8,
    after_cell: AtomicBool,
    paused: AtomicBool,
    pause_at: Mutex<Option<PauseAt>>,
    skip: AtomicBool,
    restart: AtomicBool,
    checkpoint: AtomicBool,
}

impl Control {
    /// Asks the night to end after this wave. Asked twice, callers may leave at once.
    pub fn request_stop(&self) -> u8 {
        self.stop.fetch_add(1, Ordering::SeqCst).saturating_add(1)
    }

    /// Whether the night should end.
    pub fn stop_requested(&self) -> bool {
        self.stop.load(Ordering::SeqCst) > 0
    }

    /// Asks the night to end after the current cell, or takes that back, and says which.
    pub fn toggle_stop_after_cell(&self) -> bool {
        !self.after_cell.fetch_xor(true, Ordering::SeqCst)
    }

    /// Whether the night should end before it starts another cell.
    pub fn stops_after_cell(&self) -> bool {
        self.after_cell.load(Ordering::SeqCst)
    }

    /// Switches pause on or off and says which.
    pub fn toggle_pause(&self) -> bool {
        !self.paused.fetch_xor(true, Ordering::SeqCst)
    }

    /// Pauses, or goes on.
    pub fn set_paused(&self, paused: bool) {
        self.paused.store(paused, Ordering::SeqCst);
    }

    /// Whether rendering should wait.
    pub fn paused(&self) -> bool {
        self.paused.load(Ordering::SeqCst)
    }

    /// Sets or removes the limit at which the night pauses by itself; it holds once.
    pub fn set_pause_at(&self, limit: Option<PauseAt>) {
        *self.pause_at.lock().unwrap_or_else(PoisonError::into_inner) = limit;
    }

    /// The limit at which the night pauses by itself.
    pub fn pause_at(&self) -> Option<PauseAt> {
        *self.pause_at.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Pauses if a cell that is so far has reached the limit, and says whether it did; the limit is then gone.
    pub fn pause_if_reached(&self, samples: u64, render_s: f64) -> Option<PauseAt> {
        let mut limit = self.pause_at.lock().unwrap_or_else(PoisonError::into_inner);
        let reached = limit.take_if(|limit| limit.reached(samples, render_s))?;
        self.set_paused(true);
        Some(reached)
    }

    /// Asks the current cell to be given up.
    pub fn request_skip(&self) {
        self.skip.store(true, Ordering::SeqCst);
    }

    /// Asks for a checkpoint at the next opportunity.
    pub fn request_checkpoint(&self) {
        self.checkpoint.store(true, Ordering::SeqCst);
    }

    /// Takes the request for a checkpoint.
    pub fn take_checkpoint(&self) -> bool {
        self.checkpoint.swap(false, Ordering::SeqCst)
    }

    /// Takes the request to give up the current cell.
    pub fn take_skip(&self) -> bool {
        self.skip.swap(false, Ordering::SeqCst)
    }

    /// Asks the current cell to be rendered again from its first sample.
    pub fn request_restart(&self) {
        self.restart.store(true, Ordering::SeqCst);
    }

    /// Takes the request to render the current cell again.
    pub fn take_restart(&self) -> bool {
        self.restart.swap(false, Ordering::SeqCst)
    }
}
