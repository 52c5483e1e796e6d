//! Ideal diffuse reflection on both sides of a surface, scalar or vectorised.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::LobeSample;
use crate::math::real::{Real, Vector};
use crate::math::warp;

/// Returns `albedo / pi` if both directions are on the same side, else black.
#[inline(always)]
pub fn eval<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(albedo: V, wo: V, wi: V) -> V {
    V::select(
        (wo.z() * wi.z()).gt(R::splat(0.0)),
        albedo * R::splat(FRAC_1_PI),
        V::broadcast(Vec3::ZERO),
    )
}

/// Returns the density of [`sample`] per solid angle.
#[inline(always)]
pub fn pdf_w<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(wo: V, wi: V) -> R {
    let zero = R::splat(0.0);
    R::select(
        (wo.z() * wi.z()).gt(zero),
        warp::cosine_hemisphere_pdf_w(wi.z().abs()),
        zero,
    )
}

/// Samples a direction on the side of `wo` with cosine density; the mask is unset for a grazing
/// direction of zero weight.
#[inline(always)]
pub fn sample<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(
    albedo: V,
    wo: V,
    u: [R; 2],
) -> (R::Mask, LobeSample<V>) {
    let zero = R::splat(0.0);
    let wi = warp::cosine_hemisphere(u);
    let some = wi.z().gt(zero) & !wo.z().eq(zero);
    let wi = V::new(wi.x(), wi.y(), wi.z().copysign(wo.z()));
    (
        some,
        LobeSample {
            wi,
            weight: albedo,
            eta: R::splat(1.0),
        },
    )
}
