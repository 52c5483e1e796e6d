//! The experiment module through its public interface: plans of sweeps, run ids, and whole nights
//! with the fake clock of the mock backend.

#![allow(
    clippy::unwrap_used,
    reason = "the helpers of a test may panic like the test itself"
)]

#[path = "experiment/errors.rs"]
mod errors;
#[path = "experiment/fairness.rs"]
mod fairness;
#[path = "experiment/fixtures.rs"]
mod fixtures;
#[path = "experiment/identity.rs"]
mod identity;
#[path = "experiment/intervention.rs"]
mod intervention;
#[path = "experiment/listeners.rs"]
mod listeners;
#[path = "experiment/lost.rs"]
mod lost;
#[path = "experiment/night.rs"]
mod night;
#[path = "experiment/references.rs"]
mod references;
#[path = "experiment/survival.rs"]
mod survival;
#[path = "experiment/sweep.rs"]
mod sweep;
#[path = "experiment/vectorised.rs"]
mod vectorised;
