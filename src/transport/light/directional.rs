//! Parallel light from infinitely far away.

use glam::Vec3;

use super::bounds::Ball;
use super::{DirectSample, EmissionSample, LightId};
use crate::scene::compile::DirectionalLight;

/// Light that arrives at `from`.
#[inline]
pub(super) fn sample_direct(light: &DirectionalLight, i: u32, from: Vec3, ball: &Ball) -> DirectSample {
    DirectSample {
        wi: -light.direction,
        distance: f32::INFINITY,
        radiance: light.irradiance,
        pdf_w: 1.0,
        delta: true,
        point: ball.outside(LightId::Directional(i), from, -light.direction),
    }
}

/// A ray through a point uniform over the disk that covers the scene.
#[inline]
pub(super) fn sample_emission(light: &DirectionalLight, i: u32, ball: &Ball, u: [f32; 2]) -> EmissionSample {
    EmissionSample {
        point: ball.on_disk(LightId::Directional(i), light.direction, u),
        dir: light.direction,
        radiance: light.irradiance,
        pdf_a: ball.pdf_a(),
        pdf_w: 1.0,
        cos: 1.0,
    }
}

/// Whether a direction is the light's; the only one in which it shines.
#[inline]
pub(super) fn shines_into(light: &DirectionalLight, dir: Vec3) -> bool {
    dir.dot(light.direction) > 1.0 - 1e-6
}
