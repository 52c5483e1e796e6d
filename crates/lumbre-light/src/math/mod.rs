//! Mathematics independent of light transport: frames, warps, random numbers, distributions, SIMD
//! vectors, and statistical tests.

/// Implements force-inlined methods whose body is one expression.
#[macro_export]
macro_rules! inlined {
    ($($name:ident $(<const $n:ident: $word:ty>)? ($($arg:tt)*) -> $out:ty = $body:expr;)*) => {$(
        #[inline(always)]
        fn $name $(<const $n: $word>)? ($($arg)*) -> $out {
            $body
        }
    )*};
}

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
