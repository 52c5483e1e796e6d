//! Where a cell or reference stands. Cheap to clone, since every frame is drawn from a clone of all of them.

use std::sync::Arc;

use crate::experiment::{Outcome, WaveRow};
use crate::tui::words;

/// Where a cell or reference stands.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum State {
    /// Its turn has not come.
    #[default]
    Waiting,
    /// It renders.
    Running,
    /// Finished; the text says by which part of its stop rule.
    Done(Arc<str>),
    /// An earlier night had finished it.
    Cached,
    /// It failed, for this reason.
    Failed(Arc<str>),
    /// The night ended first.
    Interrupted,
}

/// A cell or reference as the plan pane shows it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Entry {
    /// Where it stands.
    pub state: State,
    /// Its newest measurement.
    pub last: Option<Arc<WaveRow>>,
}

/// How many cells (or references) there are in each state. The sum is their number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Waiting.
    pub waiting: usize,
    /// Running.
    pub running: usize,
    /// Done in this night.
    pub done: usize,
    /// Done by an earlier night.
    pub cached: usize,
    /// Failed.
    pub failed: usize,
    /// Interrupted.
    pub interrupted: usize,
}

impl Counts {
    /// Counts entries by their state.
    pub fn of(entries: &[Entry]) -> Counts {
        let mut counts = Counts::default();
        for entry in entries {
            match entry.state {
                State::Waiting => counts.waiting += 1,
                State::Running => counts.running += 1,
                State::Done(_) => counts.done += 1,
                State::Cached => counts.cached += 1,
                State::Failed(_) => counts.failed += 1,
                State::Interrupted => counts.interrupted += 1,
            }
        }
        counts
    }

    /// Those that need nothing more: done, cached or failed.
    pub fn settled(&self) -> usize {
        self.done + self.cached + self.failed
    }

    /// All of them.
    pub fn total(&self) -> usize {
        self.settled() + self.waiting + self.running + self.interrupted
    }
}

impl From<&Outcome> for State {
    fn from(outcome: &Outcome) -> State {
        match outcome {
            Outcome::Done(reason) => State::Done(words::clean(reason).into()),
            Outcome::Cached(_) => State::Cached,
            Outcome::Failed(reason) => State::Failed(words::clean(reason).into()),
            Outcome::Interrupted => State::Interrupted,
        }
    }
}

/// Mean wall time in seconds of the entries that were done in this night.
pub(super) fn mean_wall_s(entries: &[Entry]) -> Option<f64> {
    let done = entries.iter().filter(|e| matches!(e.state, State::Done(_))).filter_map(|e| e.last.as_ref());
    let (sum, n) = done.fold((0.0, 0u32), |(sum, n), row| (sum + row.wall_s, n + 1));
    (n > 0).then(|| sum / f64::from(n))
}
