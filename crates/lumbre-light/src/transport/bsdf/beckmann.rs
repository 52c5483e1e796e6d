//! The Beckmann distribution of microfacet normals (Gaussian slopes): density, Smith masking, and
//! sampling of visible normals [Heitz & d'Eon 2014].

use std::f32::consts::{FRAC_1_PI, PI};

use glam::Vec3;

use crate::math::exponential::{exp, hypot};
use crate::math::real::{Mask, Real, Vector};

/// 1 / sqrt(pi).
const INV_SQRT_PI: f32 = 0.564_189_6;

/// Maximum number of Newton steps when inverting the distribution of slopes. With bisection as a
/// safeguard it needs 4 on average.
const MAX_STEPS: u32 = 24;

/// A surface of Beckmann microfacets, scalar or vectorised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beckmann<R = f32> {
    /// Root mean square slope times sqrt 2, along the tangent and the bitangent; positive.
    pub alpha: [R; 2],
}

impl<R: Real> Beckmann<R> {
    /// Returns the density of microfacet normals per solid angle and area of the macroscopic
    /// surface.
    #[inline(always)]
    pub fn d(&self, h: R::Vec3) -> R {
        let zero = R::splat(0.0);
        let [ax, ay] = self.alpha;
        let (x, y) = (h.x() / (ax * h.z()), h.y() / (ay * h.z()));
        let z2 = h.z() * h.z();
        let d = R::splat(FRAC_1_PI) * exp(-(x * x + y * y)) / (ax * ay * z2 * z2);
        R::select(h.z().le(zero), zero, d)
    }

    /// Returns Smith's masking over the cosine, `G1(w) / z`, in a form that stays finite: with `a =
    /// z / r`, `G1 = 2 / (1 + erf a + exp(-a^2) / (a sqrt pi))`.
    #[inline(always)]
    pub fn masking_over_cos(&self, w: R::Vec3) -> R {
        let r = hypot(self.alpha[0] * w.x(), self.alpha[1] * w.y());
        let a = w.z() / r.max(R::splat(1e-20));
        let gauss = exp(-a * a);
        R::splat(2.0)
            / (w.z() * (R::splat(1.0) + erf(a, gauss)) + r * R::splat(INV_SQRT_PI) * gauss)
    }

    /// Samples a microfacet normal on the upper side with the density of those visible from `wo`.
    #[inline(always)]
    pub fn sample(&self, wo: R::Vec3, u: [R; 2]) -> R::Vec3 {
        let [ax, ay] = self.alpha;
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        let up = R::Vec3::broadcast(Vec3::Z);
        let stretched = R::Vec3::new(ax * wo.x(), ay * wo.y(), wo.z()).normalize_or(up);
        let across = hypot(stretched.x(), stretched.y());
        let inclined = across.gt(R::splat(1e-9));
        let cos = R::select(inclined, stretched.x() / across, one);
        let sin = R::select(inclined, stretched.y() / across, zero);
        let along = visible_slope(stretched.z() / across.max(R::splat(1e-9)), u[0]);
        let aside = erf_inv(R::splat(2.0) * u[1] - one);
        let slope = [
            ax * (cos * along - sin * aside),
            ay * (sin * along + cos * aside),
        ];
        R::Vec3::new(-slope[0], -slope[1], one).normalize_or(up)
    }
}

/// Samples the slope along the viewer's direction, whose cotangent is `cot`, with density
/// proportional to `max(0, cot - x) exp(-x^2)`, by inverting the distribution function. Microfacets
/// that face away from the viewer have a positive slope.
#[inline(always)]
fn visible_slope<R: Real>(cot: R, u: R) -> R {
    let (zero, one, half) = (R::splat(0.0), R::splat(1.0), R::splat(0.5));
    let inv_sqrt_pi = R::splat(INV_SQRT_PI);
    let normal = erf_inv(R::splat(2.0) * u - one);
    // Beyond this the factor (cot - x) is constant over the Gaussian.
    let straight = cot.gt(R::splat(1e4));
    let mut open = !straight;
    if !open.any() {
        return normal;
    }
    let goal = u.clamp(0.0, 1.0 - 1e-7) * cumulative(cot, cot, exp(-cot * cot));
    let (mut low, mut high) = (R::splat(-6.0), cot.min(R::splat(6.0)));
    let start = erf_inv((R::splat(2.0) * u - one).clamp(-0.999_99, 0.999_99));
    let mut x = start.max(low).min(high);
    for _ in 0..MAX_STEPS {
        let gauss = exp(-x * x);
        let miss = cumulative(cot, x, gauss) - goal;
        let over = miss.gt(zero);
        high = R::select(over, x, high);
        low = R::select(over, low, x);
        let slope = (cot - x).max(zero) * inv_sqrt_pi * gauss;
        let newton = x - miss / slope;
        let inside = newton.gt(low) & newton.lt(high);
        let next = R::select(inside, newton, half * (low + high));
        let settled = (next - x).abs().lt(R::splat(1e-6) * (one + x.abs()));
        x = R::select(open, next, x);
        open = open & !settled;
        if !open.any() {
            break;
        }
    }
    R::select(straight, normal, x)
}

/// Returns the distribution function of [`visible_slope`] without its normalisation; `gauss` is
/// `exp(-x^2)`.
#[inline(always)]
fn cumulative<R: Real>(cot: R, x: R, gauss: R) -> R {
    let half = R::splat(0.5);
    half * cot * (R::splat(1.0) + erf(x, gauss)) + R::splat(0.5 * INV_SQRT_PI) * gauss
}

/// The error function, with absolute error below 2e-7 [Abramowitz & Stegun 1964, 7.1.26]. `gauss`
/// is `exp(-x^2)`, which callers need as well.
#[inline(always)]
fn erf<R: Real>(x: R, gauss: R) -> R {
    let (k, one) = (R::splat, R::splat(1.0));
    let t = one / (one + k(0.327_591_1) * x.abs());
    let poly =
        ((((k(1.061_405_4) * t - k(1.453_152_1)) * t + k(1.421_413_8)) * t - k(0.284_496_74)) * t
            + k(0.254_829_6))
            * t;
    (one - poly * gauss).copysign(x)
}

/// The inverse of the error function on (-1, 1), with an error of 3e-3 at the ends and far less
/// elsewhere [Winitzki 2008], refined by one step of Halley's method.
#[inline(always)]
fn erf_inv<R: Real>(y: R) -> R {
    const A: f32 = 0.147;
    let (zero, one, half) = (R::splat(0.0), R::splat(1.0), R::splat(0.5));
    let y = y.clamp(-0.999_999, 0.999_999);
    let l = (one - y * y).map_lanes(f32::ln);
    let b = R::splat(2.0 / (PI * A)) + half * l;
    let x = ((b * b - l / R::splat(A)).max(zero).sqrt() - b)
        .max(zero)
        .sqrt()
        .copysign(y);
    let miss = (erf(x, exp(-x * x)) - y) * half / R::splat(INV_SQRT_PI) * exp(x * x);
    x - miss / (one + x * miss)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::{pcg4d, unit};
    use crate::math::warp::uniform_sphere;

    #[test]
    fn the_error_function_and_its_inverse_have_their_table_values() {
        let at = |x: f32| erf(x, (-x * x).exp());
        for (x, y) in [
            (0.0f32, 0.0f32),
            (0.5, 0.520_499_9),
            (1.0, 0.842_700_8),
            (2.0, 0.995_322_3),
        ] {
            assert!((at(x) - y).abs() < 5e-7 && (at(-x) + y).abs() < 5e-7, "{x}");
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

    #[test]
    fn visible_slopes_follow_their_distribution_for_all_elevations() {
        // From grazing views to nearly vertical ones.
        for cot in [0.02f32, 0.5, 3.0, 12.0, 100.0, 1e5] {
            let below = |x: f32| cumulative(cot, x, (-x * x).exp());
            for u in [0.05f32, 0.3, 0.5, 0.8, 0.95] {
                let x = visible_slope(cot, u);
                let share = below(x) / below(cot.min(6.0));
                assert!((share - u).abs() < 2e-3, "{cot} {u}: {share} at {x}");
            }
        }
    }
}
