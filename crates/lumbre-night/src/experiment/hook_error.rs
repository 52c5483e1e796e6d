//! The error of a function of a script.

/// An error of a script's function, formatted for the user.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
pub struct HookError(pub Box<dyn std::error::Error + Send + Sync>);
