//! Light with a finite speed, and materials that re-emit it after a delay: compared with closed
//! forms, between integrators, and with a render by another program.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "test helpers may panic and print"
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
