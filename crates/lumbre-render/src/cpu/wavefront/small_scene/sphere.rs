//! Sphere test of one ray per lane; the vectorised counterpart of `bvh::intersect::sphere`, with
//! the same bits.

use crate::cpu::bvh::intersect_lanes::Candidates;
use lumbre_light::math::real::{Real, Vector};

/// Intersects the rays with a sphere; returns the nearest hits. The caller compares `t` with the
/// maximum distances.
#[inline(always)]
pub(super) fn intersect_sphere<R: Real>(
    rays: [R::Vec3; 2],
    center: R::Vec3,
    radius: f32,
) -> Candidates<R> {
    intersect_sphere_twice(rays, center, radius)[0]
}

/// Intersects the rays with a sphere; returns the nearest hits, and those at which the rays leave
/// the sphere that they have entered.
#[inline(always)]
pub(super) fn intersect_sphere_twice<R: Real>(
    [origin, dir]: [R::Vec3; 2],
    center: R::Vec3,
    radius: f32,
) -> [Candidates<R>; 2] {
    let zero = R::splat(0.0);
    let f = origin - center;
    let b = -f.dot(dir);
    let nearest = f + dir * b;
    let r2 = R::splat(radius * radius);
    let discriminant = r2 - nearest.length_squared();
    let c = f.length_squared() - r2;
    let q = b + discriminant.sqrt().copysign(b);
    let (t0, t1) = (c / q, q);
    let ordered = t0.lt(t1);
    let (near, far) = (R::select(ordered, t0, t1), R::select(ordered, t1, t0));
    let missed = discriminant.lt(zero) | Real::eq(q, zero);
    let enters = near.gt(zero);
    let first = R::select(missed, zero, R::select(enters, near, far));
    let second = R::select(missed | !enters, zero, far);
    [candidates(first), candidates(second)]
}

/// Returns the hits at these distances; none where a distance is zero.
#[inline(always)]
fn candidates<R: Real>(t: R) -> Candidates<R> {
    let zero = R::splat(0.0);
    Candidates {
        t: R::select(t.gt(zero), t, R::splat(f32::INFINITY)),
        v: zero,
        w: zero,
        divisor: R::splat(1.0),
    }
}
