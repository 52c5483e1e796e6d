//! Checkpoints of the run in progress: when they are due, and what they may cost.

use std::time::Instant;

use super::cell::Progress;
use super::night::Night;
use crate::experiment::event::{CellRef, Level};

/// Render time between two checkpoints in seconds, where nobody says otherwise.
const EVERY_S: f64 = 60.0;

/// A checkpoint that took a second is not written again before so many seconds have been rendered: at most 1 %.
const DEAREST: f64 = 100.0;

/// What became of the checkpoints of a run.
#[derive(Debug, Default)]
pub(super) struct Kept {
    /// Render time at the last one.
    pub(super) at_s: f64,
    /// What it cost, in seconds.
    cost_s: f64,
    /// There is one of this try.
    pub(super) any: bool,
    /// The last one could not be written.
    lost: bool,
    /// Nobody keeps any, or the backend cannot be saved.
    never: bool,
}

impl Night<'_, '_> {
    /// Keeps a checkpoint if it is time for one or somebody asked for it.
    pub(super) fn keep_if_due(&mut self, cell: CellRef, progress: &mut Progress) {
        let every_s = match self.plan.night.checkpoint_s {
            Some(seconds) => seconds,
            None => EVERY_S.max(DEAREST * progress.kept.cost_s),
        };
        let asked = self.control.take_checkpoint();
        if asked || progress.standing.render_s() - progress.kept.at_s >= every_s {
            let kept = self.keep(cell, progress);
            if asked {
                let samples = progress.standing.samples();
                let text = match (kept, progress.kept.never) {
                    (true, _) => format!("checkpoint after {samples} samples per pixel, as asked"),
                    (false, true) => "no checkpoint: this backend cannot be saved".to_owned(),
                    (false, false) => return,
                };
                // The checkpoint is there whether or not it can be told.
                let _ = self.say(Level::Info, cell, text);
            }
        }
    }

    /// Keeps a checkpoint of what is rendered so far, and says whether it did. If it cannot be written the night goes
    /// on, and says so once.
    pub(super) fn keep(&mut self, cell: CellRef, progress: &mut Progress) -> bool {
        let Some(renderer) = progress.renderer.as_ref().filter(|r| r.film().samples > 0) else { return false };
        if progress.kept.never {
            return false;
        }
        let start = Instant::now();
        let kept = self.history.keep(self.plan, cell, &progress.standing, &|to| renderer.save(to));
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
                    let _ = self.say(Level::Warn, cell, text);
                }
                false
            }
        }
    }
}
