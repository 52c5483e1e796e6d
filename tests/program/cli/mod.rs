//! The program end to end, mostly on the mock backend: its output, its files and its exit status.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "test helpers may panic and print, as tests do"
)]

mod anisotropy;
mod compare;
mod compare_techniques;
mod damage;
mod denoise;
mod errors;
mod evidence;
mod external;
mod external_commands;
mod external_pictures;
mod kill;
mod limits;
mod nights;
#[cfg(unix)]
mod notices;
mod overrides;
mod page_server;
#[cfg(unix)]
mod plugins;
mod reading;
mod readme;
mod recipes;
#[cfg(unix)]
mod references;
mod render;
mod report;
mod reproduce;
mod sheets;
mod signals;
mod studies;
mod survive;
mod terminal_text;
mod tev;
mod trace;
mod verify;
pub mod workplace;
