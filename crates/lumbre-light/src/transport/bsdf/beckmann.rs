//! The Beckmann distribution of microfacet normals (Gaussian slopes): density, Smith masking, and
//! sampling of visible normals [Heitz & d'Eon 2014].

use std::f32::consts::{FRAC_1_PI, PI};

use glam::Vec3;

/// 1 / sqrt(pi).
const INV_SQRT_PI: f32 = 0.564_189_6;

/// Maximum number of Newton steps when inverting the distribution of slopes. With bisection as a
/// safeguard it needs 4 on average.
const MAX_STEPS: u32 = 24;

/// A surface of Beckmann microfacets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beckmann {
    /// Root mean square slope times sqrt 2, along the tangent and the bitangent; positive.
    pub alpha: [f32; 2],
}

impl Beckmann {
    /// Returns the density of microfacet normals per solid angle and area of the macroscopic
    /// surface.
    #[inline]
    pub fn d(&self, h: Vec3) -> f32 {
        if h.z <= 0.0 {
            return 0.0;
        }
        let [ax, ay] = self.alpha;
        let (x, y) = (h.x / (ax * h.z), h.y / (ay * h.z));
        let z2 = h.z * h.z;
        FRAC_1_PI * (-(x * x + y * y)).exp() / (ax * ay * z2 * z2)
    }

    /// Returns Smith's masking over the cosine, `G1(w) / z`, in a form that stays finite: with `a =
    /// z / r`, `G1 = 2 / (1 + erf a + exp(-a^2) / (a sqrt pi))`.
    #[inline]
    pub fn masking_over_cos(&self, w: Vec3) -> f32 {
        let r = (self.alpha[0] * w.x).hypot(self.alpha[1] * w.y);
        let a = w.z / r.max(1e-20);
        2.0 / (w.z * (1.0 + erf(a)) + r * INV_SQRT_PI * (-a * a).exp())
    }

    /// Samples a microfacet normal on the upper side with the density of those visible from `wo`.
    #[inline]
    pub fn sample(&self, wo: Vec3, u: [f32; 2]) -> Vec3 {
        let [ax, ay] = self.alpha;
        let stretched = Vec3::new(ax * wo.x, ay * wo.y, wo.z).normalize_or(Vec3::Z);
        let across = stretched.x.hypot(stretched.y);
        let (cos, sin) = if across > 1e-9 {
            (stretched.x / across, stretched.y / across)
        } else {
            (1.0, 0.0)
        };
        let along = visible_slope(stretched.z / across.max(1e-9), u[0]);
        let aside = erf_inv(2.0 * u[1] - 1.0);
        let slope = [
            ax * (cos * along - sin * aside),
            ay * (sin * along + cos * aside),
        ];
        Vec3::new(-slope[0], -slope[1], 1.0).normalize_or(Vec3::Z)
    }
}

/// Samples the slope along the viewer's direction, whose cotangent is `cot`, with density
/// proportional to `max(0, cot - x) exp(-x^2)`, by inverting the distribution function. Microfacets
/// that face away from the viewer have a positive slope.
#[inline]
fn visible_slope(cot: f32, u: f32) -> f32 {
    // Beyond this the factor (cot - x) is constant over the Gaussian.
    if cot > 1e4 {
        return erf_inv(2.0 * u - 1.0);
    }
    let cumulative = |x: f32| 0.5 * cot * (1.0 + erf(x)) + 0.5 * INV_SQRT_PI * (-x * x).exp();
    let goal = u.clamp(0.0, 1.0 - 1e-7) * cumulative(cot);
    let (mut low, mut high) = (-6.0f32, cot.min(6.0));
    let mut x = erf_inv((2.0 * u - 1.0).clamp(-0.999_99, 0.999_99)).clamp(low, high);
    for _ in 0..MAX_STEPS {
        let miss = cumulative(x) - goal;
        if miss > 0.0 {
            high = x;
        } else {
            low = x;
        }
        let slope = (cot - x).max(0.0) * INV_SQRT_PI * (-x * x).exp();
        let next = x - miss / slope;
        let next = if next > low && next < high {
            next
        } else {
            0.5 * (low + high)
        };
        if (next - x).abs() < 1e-6 * (1.0 + x.abs()) {
            return next;
        }
        x = next;
    }
    x
}

/// The error function, with absolute error below 2e-7 [Abramowitz & Stegun 1964, 7.1.26].
#[inline]
fn erf(x: f32) -> f32 {
    let a = x.abs();
    let t = 1.0 / (1.0 + 0.327_591_1 * a);
    let poly = ((((1.061_405_4 * t - 1.453_152_1) * t + 1.421_413_8) * t - 0.284_496_74) * t
        + 0.254_829_6)
        * t;
    (1.0 - poly * (-a * a).exp()).copysign(x)
}

/// The inverse of the error function on (-1, 1), with an error of 3e-3 at the ends and far less
/// elsewhere [Winitzki 2008], refined by one step of Halley's method.
#[inline]
fn erf_inv(y: f32) -> f32 {
    let y = y.clamp(-0.999_999, 0.999_999);
    let a = 0.147;
    let l = (1.0 - y * y).ln();
    let b = 2.0 / (PI * a) + 0.5 * l;
    let x = ((b * b - l / a).max(0.0).sqrt() - b)
        .max(0.0)
        .sqrt()
        .copysign(y);
    let miss = (erf(x) - y) * 0.5 / INV_SQRT_PI * (x * x).exp();
    x - miss / (1.0 + x * miss)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::{pcg4d, unit};
    use crate::math::warp::uniform_sphere;

    #[test]
    fn the_error_function_and_its_inverse_have_their_table_values() {
        for (x, y) in [
            (0.0f32, 0.0f32),
            (0.5, 0.520_499_9),
            (1.0, 0.842_700_8),
            (2.0, 0.995_322_3),
        ] {
            assert!(
                (erf(x) - y).abs() < 5e-7 && (erf(-x) + y).abs() < 5e-7,
                "{x}"
            );
            assert!((erf_inv(y) - x).abs() < 1e-3, "{x}: {}", erf_inv(y));
        }
    }

    /// Integrates over the upper hemisphere with uniform samples.
    fn hemisphere(n: u32, f: impl Fn(Vec3) -> f32) -> f64 {
        let value = |i| {
            let u = pcg4d([i, 3, 5, 7]).map(unit);
            let w = uniform_sphere([u[0], u[1]]);
            f64::from(f(Vec3::new(w.x, w.y, w.z.abs())))
        };
        (0..n).map(value).sum::<f64>() * std::f64::consts::TAU / f64::from(n)
    }

    #[test]
    fn microfacets_cover_the_surface_once_and_visible_ones_the_projected_surface() {
        for alpha in [[0.7, 0.7], [0.4, 0.4], [0.8, 0.4]] {
            let b = Beckmann { alpha };
            let area = hemisphere(200_000, |h| b.d(h) * h.z);
            assert!((area - 1.0).abs() < 0.02, "{alpha:?}: {area}");
            for wo in [
                Vec3::Z,
                Vec3::new(0.6, 0.0, 0.8),
                Vec3::new(0.3, 0.9, 0.2).normalize_or(Vec3::Z),
            ] {
                let seen = hemisphere(200_000, |h| {
                    b.masking_over_cos(wo) * b.d(h) * wo.dot(h).max(0.0)
                });
                assert!((seen - 1.0).abs() < 0.02, "{alpha:?} {wo}: {seen}");
            }
        }
    }

    #[test]
    fn sampled_normals_have_the_moments_of_the_visible_ones() {
        let n = 100_000;
        for alpha in [[0.5, 0.5], [0.6, 0.3]] {
            let b = Beckmann { alpha };
            for wo in [
                Vec3::Z,
                Vec3::new(0.6, 0.0, 0.8),
                Vec3::new(-0.5, 0.85, 0.1).normalize_or(Vec3::Z),
            ] {
                let density = |h: Vec3| b.masking_over_cos(wo) * b.d(h) * wo.dot(h).max(0.0);
                let moments: [fn(Vec3) -> f32; 4] = [|h| h.x, |h| h.y, |h| h.z, |h| h.x * h.y];
                for (k, moment) in moments.into_iter().enumerate() {
                    let expected = hemisphere(400_000, |h| density(h) * moment(h));
                    let drawn = |i: u32| {
                        let u = pcg4d([i, 11, k as u32, 13]).map(unit);
                        f64::from(moment(b.sample(wo, [u[0], u[1]])))
                    };
                    let mean = (0..n).map(drawn).sum::<f64>() / f64::from(n);
                    assert!(
                        (mean - expected).abs() < 0.01,
                        "{alpha:?} {wo} {k}: {mean} instead of {expected}"
                    );
                }
            }
        }
    }
}
