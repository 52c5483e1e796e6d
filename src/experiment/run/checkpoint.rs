//! Checkpoints of the run in progress: when they are due, and what they may cost; and the sums of references that longer
//! ones go on from.

use std::time::Instant;

use super::cell::{Progress, Work};
use super::night::Night;
use crate::experiment::event::{CellRef, Level};
use crate::experiment::parts::Piece;
use crate::experiment::standing::Checkpoint;

/// Render time between two checkpoints in seconds, where nobody says otherwise.
const EVERY_S: f64 = 60.0;

/// A checkpoint that took a second is not written again before so many seconds have been rendered: at most 1 %.
const DEAREST: f64 = 100.0;

/// What became of the checkpoints of a run.
#[derive(Debug, Default)]
pub(super) struct Kept {
    /// Render time at the last one.
    at_s: f64,
    /// What it cost, in seconds.
    cost_s: f64,
    /// There is one of this try.
    pub(super) any: bool,
    /// The last one could not be written.
    lost: bool,
    /// Nobody keeps any, or the backend cannot be saved.
    never: bool,
    /// The last request for a checkpoint that was heard: requests are for all runs that take turns.
    asked: u64,
}

impl Kept {
    /// What there is when a run begins after so much render time and so many requests.
    pub(super) fn at(render_s: f64, asked: u64) -> Kept {
        Kept { at_s: render_s, asked, ..Kept::default() }
    }
}

impl Night<'_, '_> {
    /// Keeps a checkpoint if it is time for one or somebody asked for it.
    pub(super) fn keep_if_due(&mut self, work: &Work<'_>, progress: &mut Progress) {
        let every_s = match self.plan.night.checkpoint_s {
            Some(seconds) => seconds,
            None => EVERY_S.max(DEAREST * progress.kept.cost_s),
        };
        self.asked += u64::from(self.control.take_checkpoint());
        let asked = std::mem::replace(&mut progress.kept.asked, self.asked) != self.asked;
        if asked || progress.standing.render_s() - progress.kept.at_s >= every_s {
            let kept = self.keep(work, progress);
            if asked {
                let samples = progress.standing.samples();
                let text = match (kept, progress.kept.never) {
                    (true, _) => format!("checkpoint after {samples} samples per pixel, as asked"),
                    (false, true) => "no checkpoint: this backend cannot be saved".to_owned(),
                    (false, false) => return,
                };
                // The checkpoint is there whether or not it can be told.
                let _ = self.say(Level::Info, work.cell, text);
            }
        }
    }

    /// What a reference can go on from: a shorter one with its stem that its own rule would not have ended before.
    pub(super) fn beginning(&self, work: &Work<'_>) -> Option<Checkpoint> {
        let Piece::Run(CellRef::Reference(place)) = work.piece() else { return None };
        let limit = work.stop.sample_limit();
        let found = self.history.beginning(self.plan, place, limit.unwrap_or(u64::MAX))?;
        let exact = limit == Some(found.standing.samples());
        // What fails here fails again where it is told.
        let early = !matches!(self.stops(&work.stop, &found.standing.rows), Ok(Some(_)));
        (found.standing.between_waves() && (exact || early)).then_some(found)
    }

    /// Keeps the sums of a finished reference for longer ones. Nothing is lost where that fails, and it is said.
    pub(super) fn keep_sums(&mut self, place: usize, progress: &Progress) {
        let Some(renderer) = &progress.renderer else { return };
        let kept = self.history.keep_sums(self.plan, place, &progress.standing, &|to| renderer.save(to));
        if let Err(error) = kept {
            let text = format!("its sums could not be kept, so that a longer one will start anew: {error}");
            // The reference itself is not in danger.
            let _ = self.say(Level::Warn, CellRef::Reference(place), text);
        }
    }

    /// Keeps a checkpoint of what is rendered so far, and says whether it did. If it cannot be written the night goes
    /// on, and says so once.
    pub(super) fn keep(&mut self, work: &Work<'_>, progress: &mut Progress) -> bool {
        let Some(renderer) = progress.renderer.as_ref().filter(|r| r.film().samples > 0) else { return false };
        if progress.kept.never {
            return false;
        }
        let start = Instant::now();
        let kept = self.history.keep(self.plan, work.piece(), &progress.standing, &|to| renderer.save(to));
        let state = &mut progress.kept;
        (state.at_s, state.cost_s) = (progress.standing.render_s(), start.elapsed().as_secs_f64());
        state.never = matches!(kept, Ok(false));
        match kept {
            Ok(kept) => {
                state.lost = false;
                state.any |= kept;
                kept
            }
            Err(error) => {
                if !std::mem::replace(&mut state.lost, true) {
                    let text = format!("no checkpoint could be written, and the night goes on: {error}");
                    // Telling may fail as well; the run itself is not in danger.
                    let _ = self.say(Level::Warn, work.cell, text);
                }
                false
            }
        }
    }
}
