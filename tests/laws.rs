//! Rules for the code base: imports between modules, lengths of files, and the documentation that
//! every table row needs.
#![allow(clippy::unwrap_used, reason = "test helpers may panic")]

#[cfg(feature = "vulkan")]
#[path = "laws/backends.rs"]
mod backends;
#[path = "laws/dependencies.rs"]
mod dependencies;
#[path = "laws/documents.rs"]
mod documents;
#[path = "laws/files.rs"]
mod files;
#[path = "laws/formats.rs"]
mod formats;
#[path = "laws/imports.rs"]
mod imports;
#[path = "laws/lanes.rs"]
mod lanes;
#[path = "laws/reference.rs"]
mod reference;
#[cfg(feature = "vulkan")]
#[path = "laws/shaders.rs"]
mod shaders;
#[path = "laws/source.rs"]
mod source;
#[path = "laws/tables.rs"]
mod tables;
#[path = "laws/twins.rs"]
mod twins;
#[path = "laws/words.rs"]
mod words;
