//! Mathematics independent of light transport: frames, warps, random numbers, distributions, SIMD
//! vectors, and statistical tests.

pub mod distribution;
pub mod exponential;
pub mod false_discovery_rate;
pub mod frame;
pub mod luminance;
pub mod piecewise;
pub mod real;
pub mod rng;
pub mod simd;
pub mod stats;
pub mod t_test;
pub mod trig;
pub mod warp;

pub use frame::Frame;
