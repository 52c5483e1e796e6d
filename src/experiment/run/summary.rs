//! Results of a night.

use std::sync::Arc;

use crate::experiment::noise_floor::NoiseFloors;
use crate::experiment::outcome::{CellRef, Outcome, WaveRow};
use lumbre_render::OpenStats;

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
    /// Index of the reference into [`Plan::references`](crate::experiment::Plan::references).
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
