//! Light with a finite speed, and materials that re-emit it later: compared with analytic truth,
//! with each other, and with a film by another program.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "helpers of tests may fail and talk as tests do"
)]

mod common;

#[path = "transient/arrival.rs"]
mod arrival;
#[path = "transient/bunny.rs"]
mod bunny;
#[path = "transient/composed.rs"]
mod composed;
#[path = "transient/loaders.rs"]
mod loaders;
#[path = "transient/mitransient.rs"]
mod mitransient;
