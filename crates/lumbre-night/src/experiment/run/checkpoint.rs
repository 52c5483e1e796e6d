//! Checkpoints of active runs: when they are due and how much time they may take; and stored sums
//! of references, which longer references continue.

use std::time::Instant;

use super::active_run::RunRequest;
use super::attempt::Attempt;
use super::state::NightRunner;
use crate::experiment::outcome::{CellRef, Level};
use crate::experiment::run_progress::Checkpoint;
use crate::experiment::shards::WorkUnit;

/// Default render time between two checkpoints, seconds.
const DEFAULT_INTERVAL_S: f64 = 60.0;

/// Smallest ratio of render time to the time of writing a checkpoint, so that writing takes at most
/// 1 %.
const MIN_INTERVAL_PER_COST: f64 = 100.0;

impl NightRunner<'_, '_> {
    /// Stores a checkpoint if one is due or was requested.
    pub(super) fn save_checkpoint_if_due(
        &mut self,
        request: &RunRequest<'_>,
        attempt: &mut Attempt,
    ) {
        let interval_s = match self.plan.night.checkpoint_s {
            Some(seconds) => seconds,
            None => DEFAULT_INTERVAL_S.max(MIN_INTERVAL_PER_COST * attempt.checkpoints.cost_s),
        };
        self.checkpoint_requests += u64::from(self.control.checkpoint.take());
        let requests =
            std::mem::replace(&mut attempt.checkpoints.requests, self.checkpoint_requests);
        let requested = requests != self.checkpoint_requests;
        if requested || attempt.progress.render_s() - attempt.checkpoints.at_s >= interval_s {
            let stored = self.save_checkpoint(request, attempt);
            if requested {
                let samples = attempt.progress.samples();
                let text = match (stored, attempt.checkpoints.unsupported) {
                    (true, _) => {
                        format!("wrote the requested checkpoint after {samples} samples per pixel")
                    }
                    (false, true) => {
                        "no checkpoint: this backend does not support checkpoints".to_owned()
                    }
                    (false, false) => return,
                };
                // A failed message does not affect the checkpoint.
                let _ = self.emit_message(Level::Info, request.cell, text);
            }
        }
    }

    /// Returns the sums of a shorter reference that this one can continue: one with the same stem
    /// that its own stop rule would not have ended earlier.
    pub(super) fn shorter_reference(&self, request: &RunRequest<'_>) -> Option<Checkpoint> {
        let WorkUnit::Run(CellRef::Reference(reference)) = request.unit() else {
            return None;
        };
        let limit = request.stop.sample_limit();
        let shorter =
            self.history
                .shorter_reference(self.plan, reference, limit.unwrap_or(u64::MAX))?;
        let exact = limit == Some(shorter.progress.samples());
        // An error of a predicate occurs again when the run evaluates its stop rule.
        let continues = !matches!(
            self.stop_cause(&request.stop, &shorter.progress.rows),
            Ok(Some(_))
        );
        (shorter.progress.between_waves() && (exact || continues)).then_some(shorter)
    }

    /// Stores the sums of a finished reference for longer ones. A failure is only reported.
    pub(super) fn save_sums(&mut self, reference: usize, attempt: &Attempt) {
        let Some(renderer) = &attempt.renderer else {
            return;
        };
        let stored = self
            .history
            .save_sums(self.plan, reference, &attempt.progress, &|to| {
                renderer.save(to)
            });
        if let Err(error) = stored {
            let text = format!(
                "its sums could not be stored, so longer references will start from zero: {error}"
            );
            // A failed message does not affect the reference.
            let _ = self.emit_message(Level::Warn, CellRef::Reference(reference), text);
        }
    }

    /// Stores a checkpoint and returns whether it did. A failure is reported once, and rendering
    /// continues.
    pub(super) fn save_checkpoint(
        &mut self,
        request: &RunRequest<'_>,
        attempt: &mut Attempt,
    ) -> bool {
        let Some(renderer) = attempt.renderer.as_ref().filter(|r| r.film().samples > 0) else {
            return false;
        };
        if attempt.checkpoints.unsupported {
            return false;
        }
        let start = Instant::now();
        let stored =
            self.history
                .save_checkpoint(self.plan, request.unit(), &attempt.progress, &|to| {
                    renderer.save(to)
                });
        let state = &mut attempt.checkpoints;
        (state.at_s, state.cost_s) = (attempt.progress.render_s(), start.elapsed().as_secs_f64());
        state.unsupported = matches!(stored, Ok(false));
        match stored {
            Ok(stored) => {
                state.failed = false;
                state.stored |= stored;
                stored
            }
            Err(error) => {
                if !std::mem::replace(&mut state.failed, true) {
                    let text =
                        format!("could not write a checkpoint; rendering continues: {error}");
                    // A failed message does not affect the run.
                    let _ = self.emit_message(Level::Warn, request.cell, text);
                }
                false
            }
        }
    }
}
