//! The modules of the product: scripts, experiments, metrics, scene files, and the form of the code.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "test helpers may panic and print"
)]

#[path = "../common/mod.rs"]
mod common;
mod experiment;
mod laws;
mod metrics;
mod references;
mod scenes;
mod script;
mod transient_bunny;
mod transient_loaders;
