//! The built program: its commands, nights on many processes, the dashboard, and device workers.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "test helpers may panic and print"
)]

mod cli;
#[cfg(unix)]
mod cluster;
#[path = "../common/mod.rs"]
mod common;
mod frozen;
mod terminal;
mod worker;
