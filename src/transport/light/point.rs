//! Lights that are points: the same intensity in every direction.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use super::{DirectSample, EmissionSample, LightId, LightPoint};
use crate::math::warp;
use crate::scene::compile::PointLight;

/// Density per solid angle of every direction of emission.
pub(super) const PDF_W: f32 = 1.0 / (4.0 * PI);

fn at(light: &PointLight, i: u32, normal: Vec3) -> LightPoint {
    LightPoint { light: LightId::Point(i), position: light.position, normal, uv: Vec2::ZERO }
}

/// Light that arrives at `from`; `None` at the light itself.
#[inline]
pub(super) fn sample_direct(light: &PointLight, i: u32, from: Vec3) -> Option<DirectSample> {
    let to = light.position - from;
    let distance = to.length();
    let radiance = light.intensity / (distance * distance);
    let wi = to / distance;
    let usable = distance > 0.0 && radiance.is_finite();
    usable.then(|| DirectSample { wi, distance, radiance, pdf_w: 1.0, delta: true, point: at(light, i, -wi) })
}

/// A direction uniform over the sphere.
#[inline]
pub(super) fn sample_emission(light: &PointLight, i: u32, v: [f32; 2]) -> EmissionSample {
    let dir = warp::uniform_sphere(v);
    EmissionSample { point: at(light, i, dir), dir, radiance: light.intensity, pdf_a: 1.0, pdf_w: PDF_W, cos: 1.0 }
}
