//! Retry of failed attempts: again on the same backend, on a fallback, or not at all.

use super::active_run::ActiveRun;
use super::attempt::{AttemptError, RetryState};
use super::state::NightRunner;
use crate::experiment::outcome::Level;

/// Number of retries after losses of the device.
const MAX_RETRIES: u32 = 3;

impl NightRunner<'_, '_> {
    /// Decides how a failed run is retried and reports it. Returns false if the night ends before a
    /// retry.
    ///
    /// A lost device is retried a few times. After that, and for other failures of the backend, the
    /// run is moved to its fallback, if the script chose `auto`. It then starts from the first
    /// sample, since render times of two backends cannot be added.
    ///
    /// # Errors
    /// The reason of the failure, if the run is not retried.
    pub(super) fn prepare_retry(
        &mut self,
        run: &mut ActiveRun<'_>,
        error: AttemptError,
    ) -> Result<bool, String> {
        let cell = run.request.cell;
        let has_checkpoint = run.has_checkpoint();
        let retry = &mut run.retry;
        let lost = matches!(error, AttemptError::DeviceLost(_));
        if lost && (self.control.stop_requested() || self.deadline_passed()) {
            self.emit_message(Level::Warn, cell, error.into_reason())?;
            return Ok(false);
        }
        if lost && retry.device_losses < MAX_RETRIES {
            retry.device_losses += 1;
            retry.from_scratch = retry.from_scratch && !has_checkpoint;
            let (reason, losses) = (error.into_reason(), retry.device_losses);
            let text = format!(
                "{reason}; retrying from the newest checkpoint (retry {losses} of {MAX_RETRIES})"
            );
            self.emit_message(Level::Warn, cell, text)?;
            return Ok(true);
        }
        let fallback = run
            .request
            .config
            .fallback
            .filter(|_| retry.backend.is_none() && !matches!(error, AttemptError::Other(_)));
        let Some(backend) = fallback else {
            return Err(error.into_reason());
        };
        *retry = RetryState {
            from_scratch: true,
            device_losses: 0,
            backend: Some(backend),
        };
        let text = format!(
            "{}; rendering by `{backend}` instead, since the backend is `auto`",
            error.into_reason()
        );
        self.emit_message(Level::Warn, cell, text)?;
        Ok(true)
    }
}
