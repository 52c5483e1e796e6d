//! Spherical lights seen from outside: directions uniform over the cone that the sphere subtends.

use std::f32::consts::TAU;

use glam::Vec3;

use crate::math::Frame;
use crate::math::trig;
use crate::scene::compile::Sphere;

/// A direction to a sphere with the point of its front in that direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ConeSample {
    /// Unit direction to the point.
    pub wi: Vec3,
    /// Unit normal of the sphere at the point.
    pub normal: Vec3,
    /// Density per solid angle: one over the solid angle of the cone.
    pub pdf_w: f32,
}

/// The cone of directions from a point to a sphere.
struct SubtendedCone {
    /// Unit direction to the centre.
    axis: Vec3,
    /// Sine of the half angle.
    sin: f32,
    /// One minus the cosine of the half angle, accurate also for narrow cones.
    one_minus_cos: f32,
}

impl SubtendedCone {
    /// Returns the cone; `None` from inside, where only the back of the sphere is visible.
    #[inline]
    fn new(sphere: &Sphere, from: Vec3) -> Option<SubtendedCone> {
        let to = sphere.center - from;
        let d = to.length();
        let r = sphere.radius;
        if !(d > r && d.is_finite()) {
            return None;
        }
        let sin = r / d;
        let cos = ((d - r) / d * ((d + r) / d)).sqrt();
        let one_minus_cos = sin * sin / (1.0 + cos);
        (one_minus_cos > 0.0).then(|| SubtendedCone {
            axis: to / d,
            sin,
            one_minus_cos,
        })
    }

    #[inline]
    fn pdf_w(&self) -> f32 {
        1.0 / (TAU * self.one_minus_cos)
    }
}

/// Samples a direction uniform over the subtended cone; `None` from inside.
#[inline]
pub(super) fn sample(sphere: &Sphere, from: Vec3, u: [f32; 2]) -> Option<ConeSample> {
    let cone = SubtendedCone::new(sphere, from)?;
    let q = u[0] * cone.one_minus_cos;
    let cos = 1.0 - q;
    let sin2 = q * (2.0 - q);
    let sin = sin2.sqrt();
    let (sin_phi, cos_phi) = trig::sin_cos(TAU * u[1]);
    // The angle at the centre between the sampled point and the nearest point of the sphere is the
    // angle at the sampled point, by the law of sines, minus the one at `from`. Its sine is
    // computed separately: near the surface the cosine has no digits of it.
    let rim = (sin / cone.sin).min(1.0);
    let rim_cos = ((1.0 - rim) * (1.0 + rim)).sqrt();
    let sin_center = (rim * cos - rim_cos * sin).max(0.0);
    let cos_center = rim_cos * cos + rim * sin;
    let frame = Frame::from_normal(cone.axis);
    let local = Vec3::new(sin_center * cos_phi, sin_center * sin_phi, -cos_center);
    Some(ConeSample {
        wi: frame.to_world(Vec3::new(sin * cos_phi, sin * sin_phi, cos)),
        normal: frame.to_world(local).normalize_or(-cone.axis),
        pdf_w: cone.pdf_w(),
    })
}

/// Returns the density per solid angle with which [`sample`] samples a point with the normal
/// `normal`; zero from inside and for points that the sphere itself occludes.
#[inline]
pub(super) fn pdf_w(sphere: &Sphere, from: Vec3, at: Vec3, normal: Vec3) -> f32 {
    match SubtendedCone::new(sphere, from) {
        Some(cone) if (from - at).dot(normal) > 0.0 => cone.pdf_w(),
        _ => 0.0,
    }
}
