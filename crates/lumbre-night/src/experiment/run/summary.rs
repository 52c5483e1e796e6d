//! Results of a night.

use crate::experiment::night::Night;
use crate::experiment::outcome::CellRef;

/// Summary of a night.
#[derive(Clone, Debug, Default)]
pub struct NightSummary {
    /// The night as it ended. Runs that were not reached are pending.
    pub night: Night,
    /// Whether the user or a signal ended the night early. Skipping a single cell does not count.
    pub interrupted: bool,
    /// References that disagree with a second technique, in the order of the plan.
    pub disagreements: Vec<Disagreement>,
    /// Cells that need another kind of worker, with the reason.
    pub other_workers: Vec<(CellRef, String)>,
}

impl NightSummary {
    /// Returns the summary of a night that has just begun.
    pub(super) fn of(night: Night) -> NightSummary {
        NightSummary {
            night,
            ..NightSummary::default()
        }
    }
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
        summary: Box<NightSummary>,
    },
}
