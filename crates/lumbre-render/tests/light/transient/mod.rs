//! Light with a finite speed, and materials that re-emit it after a delay: compared with closed
//! forms, between integrators, and with a render by another program.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "test helpers may panic and print"
)]

mod arrival;
pub mod composed;
mod media;
mod mitransient;
