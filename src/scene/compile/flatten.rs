//! Placeholder during bring-up.
use super::CompiledScene;
use crate::scene::{Note, SceneDesc, SceneError};

/// Compiles.
///
/// # Errors
/// None yet.
pub fn compile(_desc: &SceneDesc) -> Result<(CompiledScene, Vec<Note>), SceneError> {
    Err(SceneError::UnknownFormat { file: Default::default(), known: String::new() })
}
