//! Scenes: the description ([`desc`]), and its compilation to the flat arrays that a backend renders
//! ([`mod@compile`]). The crate `lumbre-scene-io` reads and writes files of scenes.
//!
//! This module contains no light transport.

pub mod compile;
pub mod desc;
#[cfg(test)]
pub mod fixtures;
pub mod noise;
pub mod note;
pub mod shape;
pub mod simple;

use std::path::PathBuf;

pub use compile::{CompiledScene, compile};
pub use desc::SceneDesc;
pub use note::Note;

/// Reason why a scene cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SceneError {
    /// A file could not be read at all.
    #[error("cannot read {}: {reason}", file.display())]
    Unreadable {
        /// File that could not be read.
        file: PathBuf,
        /// Error message of the operating system.
        reason: String,
    },
    /// A file could not be written.
    #[error("cannot write {}: {reason}", file.display())]
    Unwritable {
        /// File that could not be written.
        file: PathBuf,
        /// Error message of the operating system.
        reason: String,
    },
    /// A file violates its format.
    #[error("{}: {place}: {problem}", file.display())]
    Malformed {
        /// File that violates its format.
        file: PathBuf,
        /// Line and column, byte offset, or key path.
        place: String,
        /// Description of what was found and what was expected.
        problem: String,
    },
    /// The file's name matches no supported format.
    #[error("{}: unknown scene format ({help}supported: {known})", file.display())]
    UnknownFormat {
        /// File with the unknown format.
        file: PathBuf,
        /// Remedy, followed by `; `; empty if nothing is known about the file.
        help: String,
        /// Supported file extensions.
        known: String,
    },
    /// A scene script in Lua failed; the text names file and line.
    #[error("{0}")]
    Script(String),
    /// A change by path (`set`) names nothing in the scene, or has a value of the wrong type.
    #[error(transparent)]
    Edit(#[from] crate::value::schema::SchemaError),
}

impl SceneError {
    /// Creates an error about a place in a file; an empty file stands for none.
    pub fn malformed(
        file: impl Into<PathBuf>,
        place: impl Into<String>,
        problem: impl Into<String>,
    ) -> SceneError {
        SceneError::Malformed {
            file: file.into(),
            place: place.into(),
            problem: problem.into(),
        }
    }
}
