//! Hits of primitives with masks, which are evaluated ray by ray, as [`is_masked_out`] is for a
//! single ray.

use super::SmallScene;
use super::nearest::NearestHits;
use crate::cpu::bvh::intersect_lanes::Candidates;
use lumbre_light::math::real::Mask;
use lumbre_light::math::simd::{Lanes, active_lanes};
use lumbre_light::scene::compile::NONE;
use lumbre_light::transport::ray::{Hit, Ray};
use lumbre_light::transport::surface::is_masked_out;

/// Nearest hits so far, stored as arrays for the mask test.
struct PreviousHits<const N: usize> {
    t: [f32; N],
    primitive: [f32; N],
    /// Bit mask of the lanes with a hit.
    lanes: u32,
}

impl SmallScene {
    /// Updates the nearest hits with those of a primitive with a mask, in the lanes where the mask
    /// does not remove them. With `ANY` it updates only lanes without a hit.
    #[inline(always)]
    pub(super) fn update_masked<R: Lanes<N>, const N: usize, const ANY: bool>(
        &self,
        group: &[(Ray, f32)],
        candidate: Candidates<R>,
        primitive: u32,
        best: &mut NearestHits<R>,
    ) {
        let mut near = candidate.t.le(best.t) & candidate.t.lt(best.limit);
        if ANY {
            near = near & best.without_hit();
        }
        if near.any() {
            let hits = [
                candidate.t.store(),
                (candidate.v / candidate.divisor).store(),
                (candidate.w / candidate.divisor).store(),
            ];
            let hit_lanes = best.hit_lanes().bits();
            let previous = PreviousHits {
                t: best.t.store(),
                primitive: best.primitive.store(),
                lanes: hit_lanes,
            };
            let accepted_lanes =
                R::load(&self.accepted(group, primitive, &hits, near.bits(), &previous))
                    .gt(R::splat(0.0));
            best.update(
                accepted_lanes,
                Candidates {
                    t: R::select(accepted_lanes, candidate.t, best.t),
                    ..candidate
                },
                primitive,
            );
        }
    }

    /// Returns 1 for each given lane whose hit at `[t, u, v]` is not removed by the mask and is
    /// nearer than the previous one, or equally near with a lesser primitive index. Returns 0 for
    /// all other lanes.
    #[inline(never)]
    fn accepted<const N: usize>(
        &self,
        group: &[(Ray, f32)],
        primitive: u32,
        [t, u, v]: &[[f32; N]; 3],
        lanes: u32,
        previous: &PreviousHits<N>,
    ) -> [f32; N] {
        let mut accepted_lanes = [0.0; N];
        for lane in active_lanes(lanes) {
            let hit = Hit {
                t: t[lane],
                primitive,
                instance: NONE,
                uv: [u[lane], v[lane]],
            };
            let wins_tie =
                previous.lanes & 1 << lane != 0 && primitive < previous.primitive[lane].to_bits();
            let better = hit.t < previous.t[lane] || wins_tie;
            if better && !is_masked_out(&self.scene, &group[lane].0, &hit) {
                accepted_lanes[lane] = 1.0;
            }
        }
        accepted_lanes
    }
}
