//! State of a cell or reference in the plan. Cheap to clone, since every frame clones all entries.

use std::sync::Arc;

use crate::experiment::{Outcome, WaveRow};
use crate::tui::format;

/// State of a cell or reference.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum EntryState {
    /// Not started yet.
    #[default]
    Waiting,
    /// Rendering at this moment.
    Running,
    /// Finished in this night; the text names the stop condition that was met.
    Done(Arc<str>),
    /// Finished by an earlier night.
    Cached,
    /// Failed; the text is the reason.
    Failed(Arc<str>),
    /// Started but not finished when the night ended.
    Interrupted,
}

/// A cell or reference as the plan pane shows it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlanEntry {
    /// Current state of the cell.
    pub state: EntryState,
    /// Newest measurement of the cell.
    pub last: Option<Arc<WaveRow>>,
}

/// Number of cells (or references) in each state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StateCounts {
    /// Number of waiting entries.
    pub waiting: usize,
    /// Number of running entries.
    pub running: usize,
    /// Number of entries finished in this night.
    pub done: usize,
    /// Number of entries finished by an earlier night.
    pub cached: usize,
    /// Number of failed entries.
    pub failed: usize,
    /// Number of interrupted entries.
    pub interrupted: usize,
}

impl StateCounts {
    /// StateCounts entries by state.
    pub fn from_entries(entries: &[PlanEntry]) -> StateCounts {
        let mut counts = StateCounts::default();
        for entry in entries {
            match entry.state {
                EntryState::Waiting => counts.waiting += 1,
                EntryState::Running => counts.running += 1,
                EntryState::Done(_) => counts.done += 1,
                EntryState::Cached => counts.cached += 1,
                EntryState::Failed(_) => counts.failed += 1,
                EntryState::Interrupted => counts.interrupted += 1,
            }
        }
        counts
    }

    /// Number of entries that need no more work: done, cached or failed.
    pub fn settled(&self) -> usize {
        self.done + self.cached + self.failed
    }

    /// Number of all entries.
    pub fn total(&self) -> usize {
        self.settled() + self.waiting + self.running + self.interrupted
    }
}

impl From<&Outcome> for EntryState {
    fn from(outcome: &Outcome) -> EntryState {
        match outcome {
            Outcome::Done(cause) => EntryState::Done(format::clean(&cause.clause).into()),
            Outcome::Cached(_) => EntryState::Cached,
            Outcome::Failed(reason) => EntryState::Failed(format::clean(reason).into()),
            Outcome::Interrupted => EntryState::Interrupted,
        }
    }
}

/// Mean wall time, in seconds, of the entries finished in this night; `None` if there are none.
pub(in crate::tui) fn mean_wall_s(entries: &[PlanEntry]) -> Option<f64> {
    let done = entries
        .iter()
        .filter(|e| matches!(e.state, EntryState::Done(_)))
        .filter_map(|e| e.last.as_ref());
    let (sum, n) = done.fold((0.0, 0u32), |(sum, n), row| (sum + row.wall_s, n + 1));
    (n > 0).then(|| sum / f64::from(n))
}
