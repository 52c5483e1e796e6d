//! The anisotropic GGX distribution of microfacet normals with Smith's separable masking and
//! shadowing.
//!
//! All directions are on the upper side: `z > 0`.

use std::f32::consts::{FRAC_1_PI, TAU};

use glam::Vec3;

use crate::math::real::{Mask, Real, Vector};
use crate::math::trig;

/// Minimum alpha, the bound that the program of S0 and Mitsuba use as well.
pub const MIN_ALPHA: f32 = 0.001;

/// A surface of GGX microfacets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ggx<R = f32> {
    /// Roughness along the tangent and the bitangent.
    pub alpha: [R; 2],
}

/// The components of a unit half vector that densities of microfacets depend on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfVector<R = f32> {
    /// Squared cosine with the normal.
    pub along2: R,
    /// Squared length of the tangential part.
    pub across2: R,
    /// Squared length of the tangential part with each axis times alpha of the other axis.
    pub stretched2: R,
}

impl<R: Real> HalfVector<R> {
    /// Builds the half vector from the sum of two unit vectors, given by its normal component
    /// `along`, the squared tangential parts, and its squared length. Also returns the cosine
    /// between the half vector and either direction. For a zero sum the half vector is the normal.
    #[inline(always)]
    pub fn from_sum(along: R, across2: R, stretched2: R, length2: R) -> (HalfVector<R>, R) {
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        let scale = one / length2;
        let half = HalfVector {
            along2: along * along * scale,
            across2: across2 * scale,
            stretched2: stretched2 * scale,
        };
        let cos = (R::splat(0.5) * length2.sqrt()).min(one);
        let none = !scale.is_finite();
        if !none.any() {
            return (half, cos);
        }
        let half = HalfVector {
            along2: R::select(none, one, half.along2),
            across2: R::select(none, zero, half.across2),
            stretched2: R::select(none, zero, half.stretched2),
        };
        (half, R::select(none, zero, cos))
    }
}

/// Returns the aspect of microfacets with this anisotropy: the factor of alpha along the bitangent,
/// and the divisor along the tangent [Burley 2012].
#[inline]
pub fn aspect(anisotropic: f32) -> f32 {
    (1.0 - 0.9 * anisotropic).sqrt()
}

impl<R: Real> Ggx<R> {
    /// Builds the surface from perceptual roughness and the [`aspect`] of its microfacets: alpha =
    /// roughness^2.
    #[inline(always)]
    pub fn new(roughness: R, aspect: R) -> Ggx<R> {
        let (alpha, least) = (roughness * roughness, R::splat(MIN_ALPHA));
        Ggx {
            alpha: [(alpha / aspect).max(least), (alpha * aspect).max(least)],
        }
    }

    /// Returns the half vector of two directions with this sum, and its cosine with them: see
    /// [`HalfVector::from_sum`].
    #[inline(always)]
    pub fn half(&self, sum: R::Vec3) -> (HalfVector<R>, R) {
        let [ax, ay] = self.alpha;
        let (sx, sy) = (sum.x(), sum.y());
        let (x, y) = (sx * ay, sy * ax);
        HalfVector::from_sum(
            sum.z(),
            sx * sx + sy * sy,
            x * x + y * y,
            sum.length_squared(),
        )
    }

    /// Returns the density D of microfacet normals per solid angle and area of the macroscopic
    /// surface [Walter et al. 2007].
    #[inline(always)]
    pub fn d(&self, h: R::Vec3) -> R {
        let [hx, hy, hz] = [h.x(), h.y(), h.z()];
        let (x, y) = (hx * self.alpha[1], hy * self.alpha[0]);
        self.d_at(&HalfVector {
            along2: hz * hz,
            across2: hx * hx + hy * hy,
            stretched2: x * x + y * y,
        })
    }

    /// Returns the same density for a half vector.
    #[inline(always)]
    pub fn d_at(&self, h: &HalfVector<R>) -> R {
        // 1 / (pi ax ay ((x / ax)^2 + (y / ay)^2 + z^2)^2), with one division.
        let area = self.alpha[0] * self.alpha[1];
        let s = h.stretched2 + h.along2 * (area * area);
        R::splat(FRAC_1_PI) * area * area * area / (s * s)
    }

    /// Returns Smith's masking over the cosine, `G1(w) / z` [Heitz 2014], in a form that stays
    /// finite.
    #[inline(always)]
    pub fn masking_over_cos(&self, w: R::Vec3) -> R {
        let (x, y) = (self.alpha[0] * w.x(), self.alpha[1] * w.y());
        self.masking_at(w.z(), x * x + y * y)
    }

    /// Returns the same masking for a direction with cosine `cos` whose tangential part, each axis
    /// times its alpha, has the squared length `spread2`.
    #[inline(always)]
    pub fn masking_at(&self, cos: R, spread2: R) -> R {
        R::splat(2.0) / (cos + (cos * cos + spread2).sqrt())
    }

    /// Samples a microfacet normal with the density of those visible from `wo` [Heitz 2018], by
    /// spherical caps [Dupuy & Benyoub 2023].
    #[inline(always)]
    pub fn sample(&self, wo: R::Vec3, u: [R; 2]) -> R::Vec3 {
        let [ax, ay] = self.alpha;
        let (zero, one, up) = (R::splat(0.0), R::splat(1.0), R::Vec3::broadcast(Vec3::Z));
        let w = R::Vec3::new(ax * wo.x(), ay * wo.y(), wo.z()).normalize_or(up);
        let (sin, cos) = trig::sin_cos(R::splat(TAU) * u[0]);
        let z = (one - u[1]) * (one + w.z()) - w.z();
        let r = (one - z * z).max(zero).sqrt();
        let h = R::Vec3::new(r * cos, r * sin, z) + w;
        R::Vec3::new(ax * h.x(), ay * h.y(), h.z().max(zero)).normalize_or(up)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::{pcg4d, unit};
    use crate::math::warp::uniform_sphere;

    /// Integrates over the upper hemisphere with uniform samples.
    fn hemisphere(n: u32, f: impl Fn(Vec3) -> f32) -> f64 {
        let sum: f64 = (0..n)
            .map(|i| {
                let u = pcg4d([i, 3, 5, 7]).map(unit);
                let mut w = uniform_sphere([u[0], u[1]]);
                w.z = w.z.abs();
                f64::from(f(w))
            })
            .sum();
        sum * std::f64::consts::TAU / f64::from(n)
    }

    #[test]
    fn microfacets_cover_the_surface_once_and_visible_ones_the_projected_surface() {
        for (roughness, anisotropic) in [(1.0, 0.0), (0.7, 0.0), (0.8, 0.8)] {
            let ggx = Ggx::new(roughness, aspect(anisotropic));
            let area = hemisphere(400_000, |h| ggx.d(h) * h.z);
            assert!(
                (area - 1.0).abs() < 0.02,
                "{roughness} {anisotropic}: {area}"
            );
            for wo in [
                Vec3::Z,
                Vec3::new(0.6, 0.0, 0.8),
                Vec3::new(0.3, 0.9, 0.3).normalize_or(Vec3::Z),
            ] {
                let seen = hemisphere(400_000, |h| {
                    ggx.masking_over_cos(wo) * ggx.d(h) * wo.dot(h).max(0.0)
                });
                assert!(
                    (seen - 1.0).abs() < 0.02,
                    "{roughness} {anisotropic} {wo}: {seen}"
                );
            }
        }
    }

    #[test]
    fn samples_are_unit_normals_that_face_the_viewer() {
        for roughness in [0.001, 0.1, 1.0] {
            for i in 0..2000 {
                let u = pcg4d([i, 1, 2, 9]).map(unit);
                let wo = uniform_sphere([u[0] * 0.5, u[1]]);
                let h = Ggx::new(roughness, aspect(0.5)).sample(wo, [u[2], u[3]]);
                assert!(
                    (h.length() - 1.0).abs() < 1e-5 && h.z >= 0.0 && wo.dot(h) > -1e-4,
                    "{wo} {h}"
                );
            }
        }
    }
}
