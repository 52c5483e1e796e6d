//! Laws of the code base: who may import whom, how large a file may be, what every table row owes its reader.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

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
#[path = "laws/source.rs"]
mod source;
#[path = "laws/tables.rs"]
mod tables;
#[path = "laws/twins.rs"]
mod twins;
