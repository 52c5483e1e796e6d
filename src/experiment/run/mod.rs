//! The state machine of a night.

use std::sync::Arc;

use super::event::{CellRef, Outcome, WaveRow};

/// How one cell or reference of the plan ended.
#[derive(Clone, Debug)]
pub struct CellResult {
    /// Which.
    pub cell: CellRef,
    /// How.
    pub outcome: Outcome,
    /// Its measurements, oldest first.
    pub rows: Arc<Vec<WaveRow>>,
}

/// How the night ended.
#[derive(Clone, Debug, Default)]
pub struct NightSummary {
    /// References first, then cells, in the order of the plan; those never reached are missing.
    pub results: Vec<CellResult>,
    /// Whether the user or a signal ended it before all was done.
    pub interrupted: bool,
}
