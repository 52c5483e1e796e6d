//! Nights of many workers: plan snapshots, processes with skewed clocks on one folder, and a real
//! Slurm if it is installed.
#![cfg(unix)]
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "test helpers may panic and print, as tests do"
)]

mod disk_full;
pub mod night;
mod plan_snapshot;
mod planner;
mod queue;
mod shards;
mod slurm;
mod workers;
use crate::cli::workplace;
