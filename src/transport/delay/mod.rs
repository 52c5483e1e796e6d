//! How long a material keeps light before it gives it back: distributions of delays.
//!
//! A delay is an optical length in scene units, like every time here: divided by the speed of light it is a time. A
//! material whose BSDF is `f(wo, wi) p(delay)` is separable; a weighted sum of such is composed. A delay is drawn from
//! `p` itself, so its density stands above and below the fraction line of every estimator and of every weight of multiple
//! importance sampling, for whichever strategy found the path, and cancels: no weight knows of delays, and a picture is the same
//! with any of them.
//!
//! # Where this is not what the source does
//! Table 3.1 of the third document normalises the profile of Epanechnikov by 3/4; its integral is then `sigma`. Here it
//! is `3 / (4 sigma)`, for which the inverse of the distribution function in that table is the right one.

mod profile;

pub use profile::{Profile, at, sample_all};

/// Raised with every change of the bits of delays, so that films with a time axis are rendered again. 2: exponential delays
/// are logarithms of `1 - u`, which differ from those of `1 + x` in their last digit.
pub const REVISION: u32 = 2;
