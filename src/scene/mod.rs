//! Scenes: what a file or a script says ([`desc`]), how files are read ([`load`]), how one value is changed
//! ([`edit`]), the flat arrays that a backend renders ([`mod@compile`]), and files for another renderer ([`export`]).
//!
//! Paths inside a scene file resolve against the file that names them. What a loader cannot honour becomes a
//! [`Note`]; what it cannot understand is a [`SceneError`]. Nothing here knows how light moves.

pub mod compile;
pub mod desc;
pub mod edit;
pub mod export;
pub mod load;
pub mod names;
pub mod noise;
pub mod shape;

use std::path::PathBuf;

pub use compile::{CompiledScene, compile};
pub use desc::SceneDesc;

/// Something in a scene file that could not be honoured, or was done otherwise than it says.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Note {
    /// The file that says it; empty where a whole scene is meant, whatever file it came from.
    pub file: PathBuf,
    /// Where in it: a key path such as `materials[2].displacementtexture`, or a line.
    pub place: String,
    /// What was done instead.
    pub message: String,
}

impl std::fmt::Display for Note {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.file.as_os_str().is_empty() {
            return write!(f, "{}: {}", self.place, self.message);
        }
        write!(f, "{}: {}: {}", self.file.display(), self.place, self.message)
    }
}

/// Why a scene cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SceneError {
    /// A file could not be read at all.
    #[error("cannot read {}: {reason}", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// What the system said.
        reason: String,
    },
    /// A file could not be written.
    #[error("cannot write {}: {reason}", file.display())]
    Unwritable {
        /// The file.
        file: PathBuf,
        /// What the system said.
        reason: String,
    },
    /// A file is not what its format says.
    #[error("{}: {place}: {problem}", file.display())]
    Malformed {
        /// The file.
        file: PathBuf,
        /// Line and column, byte, or key path.
        place: String,
        /// What was found and what was expected.
        problem: String,
    },
    /// No format knows the file.
    #[error("{}: not a scene format that Lumbre knows (known: {known})", file.display())]
    UnknownFormat {
        /// The file.
        file: PathBuf,
        /// The known extensions.
        known: String,
    },
    /// A scene written in Lua is wrong; the text names file and line.
    #[error("{0}")]
    Script(String),
    /// A change by path (`set`) names nothing in the scene, or has a value of the wrong kind.
    #[error(transparent)]
    Edit(#[from] crate::value::schema::SchemaError),
}
