//! The experiment room through its public face: plans of sweeps, identities of runs, and whole nights on the mock
//! backend's fake clock.

#![allow(clippy::unwrap_used, reason = "the helpers of a test may panic like the test itself")]

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
#[path = "experiment/lanes.rs"]
mod lanes;
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
