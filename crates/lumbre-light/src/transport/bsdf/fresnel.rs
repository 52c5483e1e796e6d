//! Fresnel reflectance of dielectrics, and Schlick's approximation for metals.

use crate::math::real::{Mask, Real, Vector};

/// Reflection and refraction of unpolarised light at a dielectric interface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DielectricFresnel<R = f32> {
    /// Reflectance in the range 0..=1.
    pub reflectance: R,
    /// Cosine of the refracted direction, positive; 0 under total internal reflection.
    pub cos_t: R,
    /// Index of the far side over that of the near side.
    pub eta: R,
}

/// Evaluates the exact Fresnel equations for `cos_i` (positive outside, negative inside) and the
/// index `ior` of the inside relative to the outside.
#[inline(always)]
pub fn dielectric<R: Real>(cos_i: R, ior: R) -> DielectricFresnel<R> {
    let (zero, one) = (R::splat(0.0), R::splat(1.0));
    let outside = cos_i.ge(zero);
    let eta = if (!outside).any() {
        R::select(outside, ior, one / ior)
    } else {
        ior
    };
    let cos_i = cos_i.abs().min(one);
    let cos2_t = one - (one - cos_i * cos_i) / (eta * eta);
    let total = cos2_t.le(zero);
    if !(!total).any() {
        return DielectricFresnel {
            reflectance: one,
            cos_t: zero,
            eta,
        };
    }
    let cos_t = cos2_t.sqrt();
    // Compute both amplitudes with one division.
    let (along, across) = (eta * cos_i + cos_t, cos_i + eta * cos_t);
    let scale = one / (along * across);
    let parallel = (eta * cos_i - cos_t) * across * scale;
    let perpendicular = (cos_i - eta * cos_t) * along * scale;
    let reflectance = R::splat(0.5) * (parallel * parallel + perpendicular * perpendicular);
    DielectricFresnel {
        reflectance: R::select(total, one, reflectance),
        cos_t: R::select(total, zero, cos_t),
        eta,
    }
}

/// Returns the reflectance of a metal whose reflectance at normal incidence is `f0` [Schlick 1994].
#[inline(always)]
pub fn schlick<V: Vector>(f0: V, cos: V::Scalar) -> V {
    f0 + (V::splat(Real::splat(1.0)) - f0) * schlick_weight(cos)
}

/// Returns `(1 - |cos|)^5`, the blend of Schlick's reflectance from normal incidence to white.
#[inline(always)]
pub fn schlick_weight<R: Real>(cos: R) -> R {
    let m = (R::splat(1.0) - cos.abs()).clamp(0.0, 1.0);
    let m2 = m * m;
    m2 * m2 * m
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn normal_incidence_brewster_and_total_reflection() {
        assert!((dielectric(1.0, 1.5).reflectance - 0.04).abs() < 1e-6);
        assert!((dielectric(-1.0, 1.5).reflectance - 0.04).abs() < 1e-6);
        // At Brewster's angle the parallel part vanishes: R = ((n^2 - 1) / (n^2 + 1))^2 / 2.
        let n = 1.5f32;
        let r = dielectric(n.atan().cos(), n).reflectance;
        let expected = 0.5 * ((n * n - 1.0) / (n * n + 1.0)).powi(2);
        assert!((r - expected).abs() < 1e-6);
        // From inside, beyond the critical angle.
        assert_eq!(dielectric(-0.5, 1.5).reflectance, 1.0);
        assert!((dielectric(1e-6, 1.5).reflectance - 1.0).abs() < 1e-4);
    }

    #[test]
    fn reflectance_is_the_same_from_both_sides_of_one_path() {
        for ior in [1.1, 1.5, 2.5, 0.7] {
            for i in 1..50 {
                let cos = i as f32 / 50.0;
                let outside = dielectric(cos, ior);
                if outside.cos_t > 0.0 {
                    let inside = dielectric(-outside.cos_t, ior);
                    assert!(
                        (outside.reflectance - inside.reflectance).abs() < 2e-5,
                        "{ior} {cos}"
                    );
                    assert!((inside.cos_t - cos).abs() < 1e-4);
                }
            }
        }
    }

    #[test]
    fn schlick_runs_from_f0_to_white() {
        let f0 = Vec3::new(0.9, 0.5, 0.1);
        assert_eq!(schlick(f0, 1.0), f0);
        assert_eq!(schlick(f0, 0.0), Vec3::ONE);
    }
}
