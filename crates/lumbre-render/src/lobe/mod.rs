//! Lobes of BSDFs and profiles of delays, evaluated and sampled: for the inspector of `lumbre
//! explore`, for `lumbre bsdf`, and for tests.
//!
//! [`mod@slice`] has the lobe in a plane, [`cells`] a partition of the sphere that resolves it, and
//! [`fit`] the comparison of samples with the density that a BSDF or a profile states.

pub mod cells;
pub mod fit;
pub mod slice;

pub use slice::{BINS, Lobe, STEPS, angle_of};
