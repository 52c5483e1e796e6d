//! One attempt to render a run: its progress and checkpoints, why it failed, and what carries over to
//! the next attempt.

use crate::experiment::run_progress::RunProgress;
use lumbre_render::{RenderError, Renderer};

/// State of the checkpoints of one attempt.
#[derive(Debug, Default)]
pub(super) struct CheckpointState {
    /// Render time at the last checkpoint, seconds.
    pub(super) at_s: f64,
    /// Time that writing it took, seconds.
    pub(super) cost_s: f64,
    /// Whether a checkpoint of this attempt is stored.
    pub(super) stored: bool,
    /// Whether the last checkpoint could not be written.
    pub(super) failed: bool,
    /// Whether the history stores none or the backend cannot save its state.
    pub(super) unsupported: bool,
    /// Number of requests for a checkpoint that were handled. A request applies to all interleaved
    /// runs.
    pub(super) requests: u64,
}

impl CheckpointState {
    /// State of an attempt that starts after this render time and this number of requests.
    pub(super) fn new(render_s: f64, requests: u64) -> CheckpointState {
        CheckpointState {
            at_s: render_s,
            requests,
            ..CheckpointState::default()
        }
    }
}

/// Why an attempt to render a run failed.
pub(super) enum AttemptError {
    /// The device or the worker process was lost; another attempt may succeed.
    DeviceLost(String),
    /// The caller did not want to wait any longer; the film is as it was before.
    Cancelled,
    /// The backend failed or does not support the run.
    Backend(String),
    /// Any other error.
    Other(String),
}

impl From<String> for AttemptError {
    fn from(reason: String) -> AttemptError {
        AttemptError::Other(reason)
    }
}

impl From<RenderError> for AttemptError {
    fn from(error: RenderError) -> AttemptError {
        let reason = error.to_string();
        match error {
            RenderError::Lost { .. } => AttemptError::DeviceLost(reason),
            RenderError::Cancelled { .. } => AttemptError::Cancelled,
            RenderError::Unsupported { .. } | RenderError::Failed { .. } => {
                AttemptError::Backend(reason)
            }
        }
    }
}

impl AttemptError {
    /// Returns the error message.
    pub(super) fn into_reason(self) -> String {
        match self {
            AttemptError::Cancelled => "it was cancelled".to_owned(),
            AttemptError::DeviceLost(reason)
            | AttemptError::Backend(reason)
            | AttemptError::Other(reason) => reason,
        }
    }
}

/// State of a run that carries over from one attempt to the next.
#[derive(Default)]
pub(super) struct RetryState {
    /// Whether to ignore stored checkpoints and start from the first sample.
    pub(super) from_scratch: bool,
    /// Number of times that the device was lost.
    pub(super) device_losses: u32,
    /// Backend that replaces the run's own.
    pub(super) backend: Option<&'static str>,
}

/// State of one attempt to render a run. A retry starts with a new one.
#[derive(Default)]
pub(super) struct Attempt {
    /// The renderer; `None` before it is open and after it panicked, since its sums may then be
    /// corrupt.
    pub(super) renderer: Option<Box<dyn Renderer>>,
    /// Progress of the run.
    pub(super) progress: RunProgress,
    /// State of its checkpoints.
    pub(super) checkpoints: CheckpointState,
}
