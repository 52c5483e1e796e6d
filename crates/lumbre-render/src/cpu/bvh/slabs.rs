//! Test of a ray against the boxes of a node's eight children.
//!
//! Invariant: no box that the ray meets is missed because of rounding.

use super::simd::{LaneArray, Simd8};
use lumbre_light::transport::ray::Ray;

/// Factor on the far distance of a slab test, so that no box is missed because of rounding [Ize
/// 2013].
pub(crate) const SLAB_SLACK: f32 = 1.000_000_5;

/// Bound of the error of an offset, as a fraction of it: two roundings of the offset, one of the
/// product that it is added to, and one to spare.
pub(crate) const OFFSET_ERROR: f32 = 1.0 / (1 << 22) as f32;

/// Returns the inverse of a component of a direction. A zero component would give 0 * inf = NaN on
/// a box's plane. A tiny one gives the same result and stays finite.
#[inline(always)]
pub(super) fn nonzero_inverse(d: f32) -> f32 {
    1.0 / if d.abs() < 1e-20 {
        1e-20f32.copysign(d)
    } else {
        d
    }
}

/// Returns a component of the origin for the distances at which a ray leaves boxes. If it does not
/// move along this axis, it stays inside a box whose bound it lies in, but with the tiny component
/// of [`nonzero_inverse`] it would leave at distance 0. So it begins a little further inside.
#[inline(always)]
fn exit_origin(o: f32, d: f32) -> f32 {
    if d.abs() < 1e-20 {
        // At least 1e-7, so that the distance is at least 1e13, and a unit in the last place.
        o - (1e-7 + o.abs() * 1.2e-7).copysign(d)
    } else {
        o
    }
}

/// Returns the offsets of the distances at which a ray enters and leaves slabs of one axis: minus
/// the distance to the origin, less or more by a bound of the rounding errors. Those of the
/// distances themselves are proportional to them, and [`SLAB_SLACK`] covers them.
#[inline(always)]
fn offsets(o: f32, d: f32, inverse: f32) -> (f32, f32) {
    let (enter, leave) = (o * inverse, exit_origin(o, d) * inverse);
    (
        -enter - enter.abs() * OFFSET_ERROR,
        -leave + leave.abs() * OFFSET_ERROR,
    )
}

/// Ray with the precomputed values of the box test. The distance to a bound is the bound times the
/// inverse of the direction, plus an offset.
pub(super) struct Slabs<L> {
    inverse: [L; 3],
    /// Offsets of the distances at which the ray enters boxes.
    entry: [L; 3],
    /// Offsets of the distances at which the ray leaves boxes.
    exit: [L; 3],
    /// Index of the bound that the ray meets first on each axis: 0 for the least, 1 for the
    /// greatest.
    first: [usize; 3],
}

impl<L: Simd8> Slabs<L> {
    #[inline(always)]
    pub fn new(ray: &Ray) -> Slabs<L> {
        let (o, d) = (ray.origin, ray.dir);
        let (x, y, z) = (
            nonzero_inverse(d.x),
            nonzero_inverse(d.y),
            nonzero_inverse(d.z),
        );
        let (enter_x, leave_x) = offsets(o.x, d.x, x);
        let (enter_y, leave_y) = offsets(o.y, d.y, y);
        let (enter_z, leave_z) = offsets(o.z, d.z, z);
        Slabs {
            inverse: [L::splat(x), L::splat(y), L::splat(z)],
            entry: [L::splat(enter_x), L::splat(enter_y), L::splat(enter_z)],
            exit: [L::splat(leave_x), L::splat(leave_y), L::splat(leave_z)],
            first: [
                usize::from(x < 0.0),
                usize::from(y < 0.0),
                usize::from(z < 0.0),
            ],
        }
    }

    /// Returns a bit mask of the boxes that the ray meets before `t_max`, and the distances at
    /// which it enters them.
    #[inline(always)]
    pub fn intersect(&self, bounds: &[[LaneArray; 3]; 2], t_max: f32) -> (u32, L) {
        let [x, y, z] = self.first;
        let near = self
            .enter(bounds, x, 0)
            .max(self.enter(bounds, y, 1))
            .max(self.enter(bounds, z, 2));
        let far = self
            .leave(bounds, 1 - x, 0)
            .min(self.leave(bounds, 1 - y, 1))
            .min(self.leave(bounds, 1 - z, 2));
        let near = near.max(L::splat(0.0));
        (
            near.le(far.mul(L::splat(SLAB_SLACK)).min(L::splat(t_max))),
            near,
        )
    }

    /// Returns the distances to the bound of all boxes on one axis that the ray meets first.
    #[inline(always)]
    fn enter(&self, bounds: &[[LaneArray; 3]; 2], bound: usize, axis: usize) -> L {
        L::load(&bounds[bound][axis]).mul_add(self.inverse[axis], self.entry[axis])
    }

    /// Returns the distances to the other bound.
    #[inline(always)]
    fn leave(&self, bounds: &[[LaneArray; 3]; 2], bound: usize, axis: usize) -> L {
        L::load(&bounds[bound][axis]).mul_add(self.inverse[axis], self.exit[axis])
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::cpu::bvh::simd::{LANES, Portable};

    #[test]
    fn a_ray_in_the_plane_of_a_bound_meets_the_box() {
        // Lanes differ in their bounds along x; all of them are from 2 to 5 along the ray.
        let low = [0.0, 1.0, -3.0, 100.0, 0.5, 0.0, 2.0, 1e-3];
        let high = low.map(|x: f32| x + 1.0);
        let bounds =
            |x: [f32; LANES], along: f32| [LaneArray(x), LaneArray(x), LaneArray([along; LANES])];
        let bounds = [bounds(low, 2.0), bounds(high, 5.0)];
        for lane in 0..LANES {
            for edge in [low[lane], high[lane]] {
                for zero in [0.0, -0.0] {
                    let ray = Ray {
                        origin: Vec3::new(edge, edge, 0.0),
                        dir: Vec3::new(zero, zero, 1.0),
                    };
                    let (met, _) = Slabs::<Portable>::new(&ray).intersect(&bounds, 10.0);
                    assert!(met & 1 << lane != 0, "{edge} {zero}");
                }
            }
        }
    }
}
