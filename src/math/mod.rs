//! Mathematics without light: frames, warps, random numbers, distributions and the statistics of tests.

pub mod discovery;
pub mod distribution;
pub mod elementary;
pub mod frame;
#[cfg(target_arch = "x86_64")]
pub(crate) mod lanes;
pub mod piecewise;
pub mod real;
pub mod rng;
pub mod stats;
pub mod student;
pub mod warp;

pub use frame::Frame;
