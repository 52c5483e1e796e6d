//! Ideal diffuse reflection, on both sides of a surface.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::LobeSample;
use crate::math::warp;

/// `albedo / pi` where both directions are on one side, else black.
#[inline]
pub fn eval(albedo: Vec3, wo: Vec3, wi: Vec3) -> Vec3 {
    if wo.z * wi.z > 0.0 { albedo * FRAC_1_PI } else { Vec3::ZERO }
}

/// Density of [`sample`] per solid angle.
#[inline]
pub fn pdf_w(wo: Vec3, wi: Vec3) -> f32 {
    if wo.z * wi.z > 0.0 { warp::cosine_hemisphere_pdf_w(wi.z.abs()) } else { 0.0 }
}

/// A direction on the side of `wo` with the density of the cosine; `None` for a grazing one of no weight.
#[inline]
pub fn sample(albedo: Vec3, wo: Vec3, u: [f32; 2]) -> Option<LobeSample> {
    let mut wi = warp::cosine_hemisphere(u);
    if wi.z <= 0.0 || wo.z == 0.0 {
        return None;
    }
    wi.z = wi.z.copysign(wo.z);
    Some(LobeSample { wi, weight: albedo, eta: 1.0 })
}
