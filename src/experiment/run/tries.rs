//! What becomes of a try that came to nothing: another one, on the same backend or another, or the end of the run.

use super::cell::Running;
use super::night::Night;
use crate::experiment::event::Level;
use crate::render::RenderError;

/// Why a try of a run came to nothing.
pub(super) enum Broken {
    /// The device or the process that rendered is gone; another try may succeed.
    Lost(String),
    /// The backend cannot do it.
    Backend(String),
    /// Anything else.
    Other(String),
}

impl From<String> for Broken {
    fn from(reason: String) -> Broken {
        Broken::Other(reason)
    }
}

impl From<RenderError> for Broken {
    fn from(error: RenderError) -> Broken {
        let reason = error.to_string();
        match error {
            RenderError::Lost { .. } => Broken::Lost(reason),
            RenderError::Unsupported { .. } | RenderError::Failed { .. } => Broken::Backend(reason),
        }
    }
}

impl Broken {
    /// What happened.
    pub(super) fn reason(self) -> String {
        let (Broken::Lost(reason) | Broken::Backend(reason) | Broken::Other(reason)) = self;
        reason
    }
}

/// How often a run is tried again whose device was lost.
const MOST_LOSSES: u32 = 3;

/// How a run is tried.
#[derive(Default)]
pub(super) struct Try {
    /// From its first sample, whatever was kept.
    pub(super) anew: bool,
    /// How often its device was lost so far.
    losses: u32,
    /// On another backend than its own.
    pub(super) backend: Option<&'static str>,
}

impl Night<'_, '_> {
    /// Decides how a run is tried again that came to nothing, and says so; false if there is no time left for it.
    ///
    /// A device that was lost is tried again a few times. What a backend cannot do after that another one does, if the
    /// script has left the choice to the program: from the first sample, since two clocks do not add up.
    pub(super) fn try_again(&mut self, run: &mut Running<'_>, broken: Broken) -> Result<bool, String> {
        let cell = run.work.cell;
        let kept = run.is_kept();
        let how = &mut run.how;
        let lost = matches!(broken, Broken::Lost(_));
        if lost && (self.control.stop_requested() || self.late()) {
            self.say(Level::Warn, cell, broken.reason())?;
            return Ok(false);
        }
        if lost && how.losses < MOST_LOSSES {
            how.losses += 1;
            how.anew = how.anew && !kept;
            let (reason, losses) = (broken.reason(), how.losses);
            let text = format!("{reason}; it is tried again from its newest checkpoint ({losses} of {MOST_LOSSES})");
            self.say(Level::Warn, cell, text)?;
            return Ok(true);
        }
        let fallback =
            run.work.config.fallback.filter(|_| how.backend.is_none() && !matches!(broken, Broken::Other(_)));
        let Some(backend) = fallback else { return Err(broken.reason()) };
        *how = Try { anew: true, losses: 0, backend: Some(backend) };
        let text = format!("{}; as its backend is `auto`, it is rendered by `{backend}` instead", broken.reason());
        self.say(Level::Warn, cell, text)?;
        Ok(true)
    }
}
