//! The program end to end, mostly on the mock backend: its output, its files and its exit status.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "test helpers may panic and print, as tests do"
)]

mod common;

#[path = "cli/compare.rs"]
mod compare;
#[path = "cli/damage.rs"]
mod damage;
#[path = "cli/errors.rs"]
mod errors;
#[path = "cli/external.rs"]
mod external;
#[path = "cli/kill.rs"]
mod kill;
#[path = "cli/nights.rs"]
mod nights;
#[path = "cli/reading.rs"]
mod reading;
#[path = "cli/readme.rs"]
mod readme;
#[path = "cli/recipes.rs"]
mod recipes;
#[cfg(unix)]
#[path = "cli/references.rs"]
mod references;
#[path = "cli/report.rs"]
mod report;
#[path = "cli/reproduce.rs"]
mod reproduce;
#[path = "cli/signals.rs"]
mod signals;
#[path = "cli/survive.rs"]
mod survive;
#[path = "cli/trace.rs"]
mod trace;
#[path = "cli/verify.rs"]
mod verify;
#[path = "cli/workplace.rs"]
mod workplace;
