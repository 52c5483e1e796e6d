//! Numbers of cells or references by their state.

use std::sync::Arc;

use super::reference::Reference;
use super::run::{Run, RunState};
use crate::experiment::outcome::Outcome;

/// Number of cells (or references) in each state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StateCounts {
    /// Number of those that wait, among them damaged ones.
    pub waiting: usize,
    /// Number of those that render.
    pub running: usize,
    /// Number of those finished in this night.
    pub done: usize,
    /// Number of those finished by an earlier night.
    pub cached: usize,
    /// Number of those that failed.
    pub failed: usize,
    /// Number of those that started but were not finished when the night ended.
    pub interrupted: usize,
}

impl StateCounts {
    /// Counts cells by state.
    pub fn of_runs(runs: &[Arc<Run>]) -> StateCounts {
        StateCounts::of(runs.iter().map(|run| &run.state))
    }

    /// Counts references by state.
    pub fn of_references(references: &[Arc<Reference>]) -> StateCounts {
        StateCounts::of(references.iter().map(|reference| &reference.state))
    }

    /// Counts runs or references by their states.
    pub fn of<'a>(states: impl Iterator<Item = &'a RunState>) -> StateCounts {
        let mut counts = StateCounts::default();
        for state in states {
            *match state {
                RunState::Pending | RunState::Damaged(_) => &mut counts.waiting,
                RunState::Running => &mut counts.running,
                RunState::Ended(Outcome::Done(_)) => &mut counts.done,
                RunState::Ended(Outcome::Cached(_)) => &mut counts.cached,
                RunState::Ended(Outcome::Failed(_)) => &mut counts.failed,
                RunState::Ended(Outcome::Interrupted) => &mut counts.interrupted,
            } += 1;
        }
        counts
    }

    /// Returns the number of those that need no more work: done, cached or failed.
    pub fn settled(&self) -> usize {
        self.done + self.cached + self.failed
    }

    /// Returns the word for a night that has ended with these: `finished`, or `ended` if work is
    /// left.
    pub fn end_word(&self) -> &'static str {
        match self.settled() == self.total() {
            true => "finished",
            false => "ended",
        }
    }

    /// Returns the number of all.
    pub fn total(&self) -> usize {
        self.settled() + self.waiting + self.running + self.interrupted
    }
}
