//! Light transport on the CPU, compared with analytic truth, brute force, other integrators and
//! images by other programs.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "test helpers may panic and print"
)]

#[path = "../../../../tests/common/mod.rs"]
mod common;
mod render;
mod transient;
