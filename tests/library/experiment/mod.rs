//! The experiment module through its public interface: plans of sweeps, run ids, and whole nights
//! with the fake clock of the mock backend.

#![allow(
    clippy::unwrap_used,
    reason = "the helpers of a test may panic like the test itself"
)]

mod aa_check;
mod checkpoints;
mod errors;
mod fairness;
mod fixtures;
mod golden_ids;
mod identity;
mod intervention;
mod listeners;
mod lost;
mod many_cells;
mod night;
mod references;
mod survival;
mod sweep;
mod vectorised;
