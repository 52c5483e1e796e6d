//! Spherical lights seen from outside: directions uniform over the cone that the sphere subtends.

use std::f32::consts::TAU;

use crate::math::Frame;
use crate::math::real::{Real, Vector};
use crate::math::trig;

/// A direction to a sphere with the point of its front in that direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct ConeSample<R: Real> {
    /// Unit direction to the point.
    pub wi: R::Vec3,
    /// Unit normal of the sphere at the point.
    pub normal: R::Vec3,
    /// Density per solid angle: one over the solid angle of the cone; 0 from inside, where only the
    /// back of the sphere is visible.
    pub pdf_w: R,
}

/// The cone of directions from a point to a sphere.
struct SubtendedCone<R: Real> {
    /// Unit direction to the centre.
    axis: R::Vec3,
    /// Sine of the half angle.
    sin: R,
    /// One minus the cosine of the half angle, accurate also for narrow cones.
    one_minus_cos: R,
    /// Whether the point is outside the sphere.
    outside: R::Mask,
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> SubtendedCone<R> {
    #[inline(always)]
    fn new(center: V, r: R, from: V) -> SubtendedCone<R> {
        let to = center - from;
        let d = to.length();
        let sin = r / d;
        let cos = ((d - r) / d * ((d + r) / d)).sqrt();
        let one_minus_cos = sin * sin / (R::splat(1.0) + cos);
        SubtendedCone {
            axis: to / d,
            sin,
            one_minus_cos,
            outside: d.gt(r) & d.is_finite() & one_minus_cos.gt(R::splat(0.0)),
        }
    }

    /// Returns the density per solid angle; 0 from inside.
    #[inline(always)]
    fn pdf_w(&self) -> R {
        let pdf_w = R::splat(1.0) / (R::splat(TAU) * self.one_minus_cos);
        R::select(self.outside, pdf_w, R::splat(0.0))
    }
}

/// Samples directions uniform over the cones that spheres subtend.
#[inline(always)]
pub(super) fn sample<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(
    center: V,
    radius: R,
    from: V,
    u: [R; 2],
) -> ConeSample<R> {
    let (zero, one) = (R::splat(0.0), R::splat(1.0));
    let cone = SubtendedCone::new(center, radius, from);
    let q = u[0] * cone.one_minus_cos;
    let cos = one - q;
    let sin2 = q * (R::splat(2.0) - q);
    let sin = sin2.sqrt();
    let (sin_phi, cos_phi) = trig::sin_cos(R::splat(TAU) * u[1]);
    // The angle at the centre between the sampled point and the nearest point of the sphere is the
    // angle at the sampled point, by the law of sines, minus the one at `from`. Its sine is
    // computed separately: near the surface the cosine has no digits of it.
    let rim = (sin / cone.sin).min(one);
    let rim_cos = ((one - rim) * (one + rim)).sqrt();
    let sin_center = (rim * cos - rim_cos * sin).max(zero);
    let cos_center = rim_cos * cos + rim * sin;
    let frame = Frame::from_normal(cone.axis);
    let local = V::new(sin_center * cos_phi, sin_center * sin_phi, -cos_center);
    ConeSample {
        wi: frame.to_world(V::new(sin * cos_phi, sin * sin_phi, cos)),
        normal: frame.to_world(local).normalize_or(-cone.axis),
        pdf_w: cone.pdf_w(),
    }
}

/// Returns the density per solid angle at `from` with which [`sample`] samples points `at` with the
/// normal `normal`; zero from inside and for points that the sphere itself occludes.
#[inline(always)]
pub(super) fn pdf_w<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(
    [center, at, normal]: [V; 3],
    radius: R,
    from: V,
) -> R {
    let zero = R::splat(0.0);
    let cone = SubtendedCone::new(center, radius, from);
    R::select((from - at).dot(normal).gt(zero), cone.pdf_w(), zero)
}
