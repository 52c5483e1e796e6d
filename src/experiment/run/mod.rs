//! The state machine of a night.
//!
//! References come first, each once, then the cells in the order of the plan. What an earlier night finished is not
//! rendered again. A wave is the only moment at which anything but rendering happens: measuring, telling the sinks,
//! asking the stop rule, hearing the user. Of all this only the time inside the renderer counts as render time.
//!
//! Waves longer than a second are rendered in slices, between which the user is heard and checkpoints are written.
//! What another process works on is put off until all else is done, and then waited for or taken over; the longer the
//! wait, the rarer the looks.
//!
//! A cell that fails (its scene does not compile, its renderer fails or panics, a sink cannot record it, its reference
//! is missing) is recorded with the reason, and the night goes on.

mod agreement;
mod cell;
mod checkpoint;
mod floors;
mod night;
pub mod patience;
mod smoke;
mod tries;
mod waves;

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use super::event::{CellRef, Control, History, Outcome, Sink, WaveRow};
use super::floors::Floors;
use super::forecast::Paces;
use super::groups::Begin;
use super::plan::Plan;
use super::spec::ScriptHooks;
use crate::render::{self, Job, OpenStats, RenderError, Renderer};
use crate::scene::CompiledScene;

/// How one cell or reference of the plan ended.
#[derive(Clone, Debug)]
pub struct CellResult {
    /// Which.
    pub cell: CellRef,
    /// How.
    pub outcome: Outcome,
    /// Its measurements, oldest first.
    pub rows: Arc<Vec<WaveRow>>,
    /// The noise floors of what it was measured against, in the order of the plan's columns; empty if not known.
    pub floors: Floors,
    /// What opening it cost.
    pub open: OpenStats,
}

/// How the night ended.
#[derive(Clone, Debug, Default)]
pub struct NightSummary {
    /// References first, then cells, in the order of the plan; those never reached are missing.
    pub results: Vec<CellResult>,
    /// Whether the user or a signal ended it before all was done. A cell that was given up alone does not count.
    pub interrupted: bool,
    /// The references that a second technique contradicts, in the order of the plan.
    pub disagreements: Vec<Disagreement>,
    /// Cells that are for another kind of worker, and why.
    pub apart: Vec<(CellRef, String)>,
}

/// A reference that a second technique contradicts.
#[derive(Clone, Debug)]
pub struct Disagreement {
    /// Index of the reference into [`Plan::references`].
    pub reference: usize,
    /// Index of the second picture.
    pub with: usize,
    /// What was found, in a sentence.
    pub found: String,
}

/// Why a night as a whole failed.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// A sink could not prepare; nothing was rendered.
    #[error("cannot start: {reason}")]
    Start {
        /// What the sink said.
        reason: String,
    },
    /// Everything was rendered and recorded, but a sink could not close the night.
    #[error("all cells were recorded, but the night cannot be closed: {reason}")]
    Finish {
        /// What the sink said.
        reason: String,
        /// How the night ended otherwise.
        summary: NightSummary,
    },
}

/// Opens a backend by name.
pub type Open<'a> = &'a dyn Fn(&str, Arc<CompiledScene>, Job) -> Result<Box<dyn Renderer>, RenderError>;

/// Where the outside world enters a night besides its sinks, so that tests can stand in for it.
pub struct Seams<'a> {
    /// Opens a run.
    pub open: Open<'a>,
    /// Waits a moment while the night is paused, or while all that is left is with other processes.
    pub wait: &'a dyn Fn(),
}

/// How long a paused night sleeps before it looks again.
const PAUSE_STEP: Duration = Duration::from_millis(50);

/// How a night is carried out, where it is not as usual.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Threads of every renderer; 0 is one for each core.
    pub threads: usize,
    /// The night ends once so many cells have failed.
    pub max_fails: Option<usize>,
    /// Whether one sample of every cell is tried, at a small size, before the night begins.
    pub smoke: bool,
    /// When the night ends, finished or not. References are then rendered when a cell first needs them, and cells come
    /// from coarse to fine: [`Plan::coarse_to_fine`].
    pub deadline: Option<SystemTime>,
    /// Bytes of memory that runs which take turns may take together; where it is not said, what the machine has free.
    pub memory: Option<u64>,
    /// The cells and references to carry out, where it is not all of them.
    pub only: Option<BTreeSet<CellRef>>,
    /// How fast runs of earlier nights were, for the forecast.
    pub paces: Paces,
    /// What is known to be done already, for the forecast too.
    pub done: BTreeSet<CellRef>,
    /// Where this process begins, if it is one of many workers. Without a deadline, whose order is the same for all. What
    /// takes all references, comparing them, is then left to whoever closes the night.
    pub begin: Option<Begin>,
}

impl From<usize> for Options {
    /// As usual, on so many threads.
    fn from(threads: usize) -> Options {
        Options { threads, ..Options::default() }
    }
}

/// Carries out a plan. Options may be just the number of threads.
///
/// # Errors
/// When a sink cannot hear the night's first or last event; everything in between is a cell's failure.
pub fn run(
    plan: &Arc<Plan>,
    hooks: &dyn ScriptHooks,
    history: &dyn History,
    sinks: &mut [&mut dyn Sink],
    control: &Control,
    options: impl Into<Options>,
) -> Result<NightSummary, RunError> {
    let seams = Seams { open: &render::open, wait: &|| std::thread::sleep(PAUSE_STEP) };
    run_with(&seams, plan, hooks, history, sinks, control, options)
}

/// [`run`] with the outside world exchanged.
///
/// # Errors
/// As [`run`].
pub fn run_with(
    seams: &Seams<'_>,
    plan: &Arc<Plan>,
    hooks: &dyn ScriptHooks,
    history: &dyn History,
    sinks: &mut [&mut dyn Sink],
    control: &Control,
    options: impl Into<Options>,
) -> Result<NightSummary, RunError> {
    night::Night::new(seams, plan, hooks, history, sinks, control, options.into()).carry_out()
}
