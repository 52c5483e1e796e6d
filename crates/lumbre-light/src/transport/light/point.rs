//! Point lights: with the same intensity in every direction, or with the intensity of a spot
//! light's cone.

use std::f32::consts::{PI, TAU};

use glam::Vec3;

use super::{DirectSample, EmissionSample, LightId, LightPoint};
use crate::math::{Frame, warp};
use crate::scene::compile::{Cone, PointLight, Uv};

fn at(light: &PointLight, i: u32, normal: Vec3) -> LightPoint {
    LightPoint {
        light: LightId::Point(i),
        position: light.position,
        normal,
        uv: Uv::default(),
    }
}

/// Returns one minus the cosine of a unit direction with the axis.
#[inline]
fn height(cone: &Cone, dir: Vec3) -> f32 {
    0.5 * (dir - cone.axis).length_squared()
}

/// Returns the fraction of the intensity in a unit direction, from 0 to 1.
#[inline]
pub(super) fn falloff(cone: &Cone, dir: Vec3) -> f32 {
    if cone.is_whole() {
        return 1.0;
    }
    let height = height(cone, dir);
    if height <= cone.beam_height {
        return 1.0;
    }
    if height >= cone.cutoff_height {
        return 0.0;
    }
    if cone.smooth {
        let t = (cone.cutoff_height - height) / (cone.cutoff_height - cone.beam_height);
        return t * t;
    }
    let angle = 2.0 * (dir - cone.axis).length().atan2((dir + cone.axis).length());
    ((cone.cutoff - angle) / (cone.cutoff - cone.beam)).clamp(0.0, 1.0)
}

/// Returns the density per solid angle of a direction of emission: uniform over the whole cone.
#[inline]
pub(super) fn pdf_w(cone: &Cone, dir: Vec3) -> f32 {
    if cone.is_whole() {
        return 1.0 / (4.0 * PI);
    }
    if height(cone, dir) <= cone.cutoff_height {
        1.0 / (TAU * cone.cutoff_height)
    } else {
        0.0
    }
}

/// Returns light that arrives at `from`; `None` at the light itself and outside its cone.
#[inline]
pub(super) fn sample_direct(light: &PointLight, i: u32, from: Vec3) -> Option<DirectSample> {
    let to = light.position - from;
    let distance = to.length();
    let wi = to / distance;
    let fraction = falloff(&light.cone, -wi);
    let radiance = light.intensity * fraction / (distance * distance);
    let usable = distance > 0.0 && fraction > 0.0 && radiance.is_finite();
    usable.then(|| DirectSample {
        wi,
        distance,
        radiance,
        pdf_w: 1.0,
        delta: true,
        point: at(light, i, -wi),
    })
}

/// Samples a direction uniform over the cone.
#[inline]
pub(super) fn sample_emission(light: &PointLight, i: u32, v: [f32; 2]) -> EmissionSample {
    let cone = &light.cone;
    let dir = if cone.is_whole() {
        warp::uniform_sphere(v)
    } else {
        let height = v[0] * cone.cutoff_height;
        let r = (height * (2.0 - height)).max(0.0).sqrt();
        let (sin, cos) = (TAU * v[1]).sin_cos();
        Frame::from_normal(cone.axis).to_world(Vec3::new(r * cos, r * sin, 1.0 - height))
    };
    let radiance = light.intensity * falloff(cone, dir);
    EmissionSample {
        point: at(light, i, dir),
        dir,
        radiance,
        pdf_a: 1.0,
        pdf_w: pdf_w(cone, dir),
        cos: 1.0,
    }
}
