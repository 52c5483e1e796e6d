//! Delays of materials: distributions of the time between absorbing and re-emitting light.
//!
//! A delay is an optical length in scene units, like every time here; divided by the speed of light
//! it is a time. A material whose BSDF is `f(wo, wi) p(delay)` is separable; a weighted sum of such
//! materials is composed. A delay is drawn from `p` itself, so its density cancels in every
//! estimator and in every weight of multiple importance sampling, whichever strategy found the
//! path. Weights do not involve delays, and the steady image is the same with any of them.
//!
//! # Difference from the source
//! Table 3.1 of S2 normalises the Epanechnikov profile by 3/4; its integral is then
//! `sigma`. Here it is `3 / (4 sigma)`, for which the inverse distribution function in that table
//! is correct.

mod mixture;
mod profile;

pub use mixture::mixture;
pub use profile::{Profile, profile_at, sample_all};

/// Revision of the bits of delays; raising it invalidates films with a time axis. 2: exponential
/// delays are logarithms of `1 - u`, which differ from those of `1 + x` in the last digit.
pub const REVISION: u32 = 2;
