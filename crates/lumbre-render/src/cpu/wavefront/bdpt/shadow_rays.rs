//! Shadow rays of connections, in rows of numbers.

use glam::Vec3;

use lumbre_light::math::real::Vector;
use lumbre_light::math::simd::{F32x8, Lanes};
use lumbre_light::transport::integrator::camera_path::ShadowRay;
use lumbre_light::transport::ray::Ray;

/// Returns the shadow rays between two points, each given by position and normal. In the lanes of
/// `infinite` they go from the first point towards `wi`. Each row holds origin, direction and
/// distance, and is read by [`shadow_ray`].
#[inline(always)]
pub(super) fn shadow_rays<R: Lanes<N>, const N: usize>(
    [from, n]: [R::Vec3; 2],
    [at, n_at]: [R::Vec3; 2],
    wi: R::Vec3,
    infinite: R::Mask,
) -> [F32x8; N] {
    let ShadowRay {
        origin,
        dir,
        distance,
    } = ShadowRay::<R>::between([from, n], [at, n_at], wi, infinite);
    R::transpose_store([
        origin.x(),
        origin.y(),
        origin.z(),
        dir.x(),
        dir.y(),
        dir.z(),
        distance,
        R::splat(0.0),
    ])
}

/// Returns the ray and its maximum distance from a row of [`shadow_rays`].
#[inline]
pub(super) fn shadow_ray(row: &F32x8) -> (Ray, f32) {
    let [x, y, z, dx, dy, dz, distance, _] = row.0;
    (
        Ray {
            origin: Vec3::new(x, y, z),
            dir: Vec3::new(dx, dy, dz),
        },
        distance,
    )
}
