//! Parallel light from infinitely far away.

use glam::Vec3;

use super::bounds::BoundingSphere;
use super::{DirectSample, EmissionSample, LightId};
use crate::scene::compile::DirectionalLight;

/// Returns light that arrives at `from`.
#[inline]
pub(super) fn sample_direct(
    light: &DirectionalLight,
    i: u32,
    from: Vec3,
    ball: &BoundingSphere,
) -> DirectSample {
    DirectSample {
        wi: -light.direction,
        distance: f32::INFINITY,
        radiance: light.irradiance,
        pdf_w: 1.0,
        delta: true,
        point: ball.outside(LightId::Directional(i), from, -light.direction),
    }
}

/// Samples a ray through a point uniform over the disk that covers the scene.
#[inline]
pub(super) fn sample_emission(
    light: &DirectionalLight,
    i: u32,
    ball: &BoundingSphere,
    u: [f32; 2],
) -> EmissionSample {
    EmissionSample {
        point: ball.on_disk(LightId::Directional(i), light.direction, u),
        dir: light.direction,
        radiance: light.irradiance,
        pdf_a: ball.pdf_a(),
        pdf_w: 1.0,
        cos: 1.0,
    }
}

/// Returns whether `dir` is the light's only direction of emission.
#[inline]
pub(super) fn shines_into(light: &DirectionalLight, dir: Vec3) -> bool {
    dir.dot(light.direction) > 1.0 - 1e-6
}
