//! Execution of a plan: the state machine of a night.
//!
//! References are rendered first, each once, then the cells in the order of the plan. Runs that an
//! earlier night finished are not rendered again. Between two waves, and only then, the night
//! measures, emits events, evaluates stop rules and handles requests of the user. Only the time
//! inside the renderer counts as render time.
//!
//! Waves longer than a second are rendered in slices, between which requests are handled and
//! checkpoints are written. Runs that another process works on are deferred until all others have
//! ended; then the night waits for them or takes them over, polling less and less often.
//!
//! A failed cell (its scene does not compile, its renderer fails or panics, a sink cannot record
//! it, its reference is not available) is recorded with the reason, and the night continues.

mod active_run;
pub mod backoff;
mod bias_check;
mod cells;
mod checkpoint;
mod night;
mod noise_floor;
mod open;
mod references;
mod retry;
mod smoke;
mod turns;
mod waves;
mod work_units;

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use night::NightRunner;

use super::comparison_groups::StartOffset;
use super::event::{CellRef, History, NightControls, Outcome, Sink, WaveRow};
use super::forecast::ThroughputHistory;
use super::noise_floor::NoiseFloors;
use super::plan::Plan;
use super::spec::ScriptHooks;
use lumbre_light::scene::CompiledScene;
use lumbre_render::{Job, OpenStats, RenderError, Renderer};

/// Result of one cell or reference of the plan.
#[derive(Clone, Debug)]
pub struct CellResult {
    /// The cell or reference.
    pub cell: CellRef,
    /// Outcome of the run.
    pub outcome: Outcome,
    /// Measurements, oldest first.
    pub rows: Arc<Vec<WaveRow>>,
    /// Noise floors of its reference, in the order of the plan's columns; empty if not known.
    pub floors: NoiseFloors,
    /// Cost of opening its renderer.
    pub open: OpenStats,
}

/// Summary of a night.
#[derive(Clone, Debug, Default)]
pub struct NightSummary {
    /// Results of references, then of cells, in the order of the plan. Those that were not reached
    /// are omitted.
    pub results: Vec<CellResult>,
    /// Whether the user or a signal ended the night early. Skipping a single cell does not count.
    pub interrupted: bool,
    /// References that disagree with a second technique, in the order of the plan.
    pub disagreements: Vec<Disagreement>,
    /// Cells that need another kind of worker, with the reason.
    pub other_workers: Vec<(CellRef, String)>,
}

/// A reference that disagrees with a second technique.
#[derive(Clone, Debug)]
pub struct Disagreement {
    /// Index of the reference into [`Plan::references`].
    pub reference: usize,
    /// Index of the second picture.
    pub with: usize,
    /// Description of the disagreement in one sentence.
    pub found: String,
}

/// Failure of a night as a whole.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// A sink could not start; nothing was rendered.
    #[error("cannot start: {reason}")]
    Start {
        /// Error of the sink.
        reason: String,
    },
    /// Everything was rendered and recorded, but a sink could not finish.
    #[error("all cells were recorded, but the night could not be finished: {reason}")]
    Finish {
        /// Error of the sink.
        reason: String,
        /// Summary of the night.
        summary: NightSummary,
    },
}

/// Opens a renderer on the backend of this name.
pub type Open<'a> =
    &'a dyn Fn(&str, Arc<CompiledScene>, Job) -> Result<Box<dyn Renderer>, RenderError>;

/// Access of a night to the outside world other than its sinks, which tests replace.
pub struct Seams<'a> {
    /// Opens the renderer of a run.
    pub open: Open<'a>,
    /// Waits one tick, while the night is paused or only runs of other processes remain.
    pub wait: &'a dyn Fn(),
}

/// Duration of one tick of waiting.
const TICK: Duration = Duration::from_millis(50);

/// Options of a night.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Number of threads of every renderer; 0 for one per core.
    pub threads: usize,
    /// Number of failed runs after which the night ends.
    pub max_fails: Option<usize>,
    /// Whether one small sample of every cell is rendered before the night begins.
    pub smoke: bool,
    /// Time at which the night ends, finished or not. References are then rendered when a cell
    /// first needs them, and cells come from coarse to fine: [`Plan::coarse_to_fine`].
    pub deadline: Option<SystemTime>,
    /// Bytes of memory that interleaved runs may take together; `None` for the free memory of the
    /// machine.
    pub memory: Option<u64>,
    /// Cells and references to render; `None` for all of them.
    pub only: Option<BTreeSet<CellRef>>,
    /// Throughputs of earlier nights, for the forecast.
    pub throughput: ThroughputHistory,
    /// Cells and references that are known to be finished, for the forecast.
    pub done: BTreeSet<CellRef>,
    /// Offset at which to start in the order, if this process is one of many workers. Ignored with
    /// a deadline, which has the same order for all workers. Bias checks, which need all
    /// references, are then left to the worker that closes the night.
    pub start: Option<StartOffset>,
}

impl From<usize> for Options {
    /// Default options with this number of threads.
    fn from(threads: usize) -> Options {
        Options {
            threads,
            ..Options::default()
        }
    }
}

/// Runs a night. The options may be just the number of threads.
///
/// # Errors
/// When a sink fails to receive the first or the last event of the night. Other failures are those
/// of cells.
pub fn run(
    plan: &Arc<Plan>,
    hooks: &dyn ScriptHooks,
    history: &dyn History,
    sinks: &mut [&mut dyn Sink],
    control: &NightControls,
    options: impl Into<Options>,
) -> Result<NightSummary, RunError> {
    let seams = Seams {
        open: &crate::backends::open,
        wait: &|| std::thread::sleep(TICK),
    };
    run_with(&seams, plan, hooks, history, sinks, control, options)
}

/// Runs a night like [`run`], with replaced access to the outside world.
///
/// # Errors
/// The same as for [`run`].
pub fn run_with(
    seams: &Seams<'_>,
    plan: &Arc<Plan>,
    hooks: &dyn ScriptHooks,
    history: &dyn History,
    sinks: &mut [&mut dyn Sink],
    control: &NightControls,
    options: impl Into<Options>,
) -> Result<NightSummary, RunError> {
    NightRunner::new(seams, plan, hooks, history, sinks, control, options.into()).run()
}
