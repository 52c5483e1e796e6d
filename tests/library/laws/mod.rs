//! Rules for the code base: circles of imports, names, and the documentation that every table row
//! needs.
#![allow(clippy::unwrap_used, reason = "test helpers may panic")]

#[cfg(feature = "vulkan")]
mod backends;
mod bugs;
mod circles;
mod dependencies;
mod documents;
mod files;
mod formats;
mod lanes;
mod licences;
mod records;
mod reference;
#[cfg(feature = "vulkan")]
mod shaders;
mod source;
mod tables;
mod twins;
mod words;
