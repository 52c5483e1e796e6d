//! Parallel light from infinitely far away.

use super::SelectedLights;
use crate::math::real::Vector;
use crate::math::simd::Lanes;

impl<R: Lanes<N>, const N: usize> SelectedLights<'_, R, N> {
    /// Returns the unit directions in which directional lights shine.
    #[inline(always)]
    pub(super) fn direction(&self) -> R::Vec3 {
        self.vector(0)
    }

    /// Returns whether `dir` is the only direction of emission of directional lights.
    #[inline(always)]
    pub(super) fn shines_into(&self, dir: R::Vec3) -> R::Mask {
        dir.dot(self.direction()).gt(R::splat(1.0 - 1e-6))
    }
}
