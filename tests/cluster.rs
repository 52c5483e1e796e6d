//! Nights of many workers: plan snapshots, processes with skewed clocks on one folder, and a real
//! Slurm if it is installed.
#![cfg(unix)]
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "test helpers may panic and print, as tests do"
)]

mod common;

#[path = "cluster/disk_full.rs"]
mod disk_full;
#[path = "cluster/night.rs"]
mod night;
#[path = "cluster/plan_snapshot.rs"]
mod plan_snapshot;
#[path = "cluster/planner.rs"]
mod planner;
#[path = "cluster/queue.rs"]
mod queue;
#[path = "cluster/shards.rs"]
mod shards;
#[path = "cluster/slurm.rs"]
mod slurm;
#[path = "cluster/workers.rs"]
mod workers;
#[allow(dead_code, reason = "the `cli` test binary uses the rest")]
#[path = "cli/workplace.rs"]
mod workplace;
