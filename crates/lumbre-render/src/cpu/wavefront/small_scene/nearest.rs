//! Nearest hits of one ray per lane, updated primitive by primitive.

use crate::cpu::bvh::intersect_lanes::Candidates;
use lumbre_light::math::real::Real;

/// Nearest hits so far; the fields are those of [`Candidates`].
pub(super) struct NearestHits<R: Real> {
    /// Maximum distance of each ray; negative for unused lanes.
    pub limit: R,
    /// Distance of the nearest hit, or `limit` without a hit.
    pub t: R,
    pub v: R,
    pub w: R,
    pub divisor: R,
    /// Primitive index, stored as the bits of a number.
    pub primitive: R,
}

impl<R: Real> NearestHits<R> {
    /// Creates the state without hits. `limit` is the maximum distance of each ray, or negative for
    /// unused lanes.
    #[inline(always)]
    pub(super) fn new(limit: R) -> NearestHits<R> {
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        NearestHits {
            limit,
            t: limit,
            v: zero,
            w: zero,
            divisor: one,
            primitive: zero,
        }
    }

    /// Returns the lanes with a hit.
    #[inline(always)]
    pub(super) fn hit_lanes(&self) -> R::Mask {
        self.t.lt(self.limit)
    }

    /// Returns the used lanes without a hit.
    #[inline(always)]
    pub(super) fn without_hit(&self) -> R::Mask {
        self.t.ge(self.limit) & self.limit.gt(R::splat(0.0))
    }

    /// Updates the lanes in which the candidate is nearer.
    #[inline(always)]
    pub(super) fn update_nearer(&mut self, candidate: Candidates<R>, primitive: u32) {
        self.update(candidate.t.lt(self.t), candidate, primitive);
    }

    /// Replaces the hits in the given lanes. In all others the candidate must not be nearer.
    #[inline(always)]
    pub(super) fn update(&mut self, lanes: R::Mask, candidate: Candidates<R>, primitive: u32) {
        // The minimum does not depend on `lanes`, so the test of the next primitive need not wait
        // for that mask.
        self.t = candidate.t.min(self.t);
        self.v = R::select(lanes, candidate.v, self.v);
        self.w = R::select(lanes, candidate.w, self.w);
        self.divisor = R::select(lanes, candidate.divisor, self.divisor);
        self.primitive = R::select(lanes, R::splat(f32::from_bits(primitive)), self.primitive);
    }
}
