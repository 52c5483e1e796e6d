//! Maps from the unit square to directions and surfaces, with their densities. Functions generic
//! over [`Real`] give the same bits per lane as for `f32`.

use std::f32::consts::{FRAC_PI_4, PI, TAU};

use glam::Vec2;

use super::real::{Real, Vector};
use super::trig;

/// Maps to the unit disk, area-preserving and nearly conformal [Shirley & Chiu 1997].
#[inline]
pub fn concentric_disk(u: [f32; 2]) -> Vec2 {
    Vec2::from_array(concentric_disk_lanes(u))
}

/// Computes [`concentric_disk`], scalar or vectorised.
#[inline(always)]
pub fn concentric_disk_lanes<R: Real>(u: [R; 2]) -> [R; 2] {
    let (zero, one, two) = (R::splat(0.0), R::splat(1.0), R::splat(2.0));
    let a = two * u[0] - one;
    let b = two * u[1] - one;
    // Measure the angle from the nearer axis, so that it is at most pi / 4.
    let nearer_x = a.abs().gt(b.abs());
    let (r, other) = (R::select(nearer_x, a, b), R::select(nearer_x, b, a));
    let (sin, cos) = trig::sin_cos_small(R::splat(FRAC_PI_4) * (other / r));
    let (near, far) = (r * cos, r * sin);
    let middle = a.eq(zero) & b.eq(zero);
    [
        R::select(middle, zero, R::select(nearer_x, near, far)),
        R::select(middle, zero, R::select(nearer_x, far, near)),
    ]
}

/// Returns a direction of the upper hemisphere with density `cos / pi` per solid angle (Malley's
/// method).
#[inline(always)]
pub fn cosine_hemisphere<R: Real>(u: [R; 2]) -> R::Vec3 {
    let [x, y] = concentric_disk_lanes(u);
    R::Vec3::new(
        x,
        y,
        (R::splat(1.0) - (x * x + y * y)).max(R::splat(0.0)).sqrt(),
    )
}

/// Returns the density of [`cosine_hemisphere`] per solid angle.
#[inline(always)]
pub fn cosine_hemisphere_pdf_w<R: Real>(cos_theta: R) -> R {
    cos_theta.max(R::splat(0.0)) / R::splat(PI)
}

/// Returns a direction of the whole sphere with density `1 / (4 pi)` per solid angle.
#[inline(always)]
pub fn uniform_sphere<R: Real>(u: [R; 2]) -> R::Vec3 {
    let one = R::splat(1.0);
    let z = one - R::splat(2.0) * u[0];
    let r = (one - z * z).max(R::splat(0.0)).sqrt();
    let (sin, cos) = trig::sin_cos(R::splat(TAU) * u[1]);
    R::Vec3::new(r * cos, r * sin, z)
}

/// Returns barycentric weights of the second and third corner of a triangle, uniform over its area
/// [Heitz 2019].
#[inline(always)]
pub fn uniform_triangle<R: Real>([u, v]: [R; 2]) -> [R; 2] {
    let upper = v.gt(u);
    let half = R::select(upper, u, v) * R::splat(0.5);
    let rest = R::select(upper, v, u) - half;
    [R::select(upper, half, rest), R::select(upper, rest, half)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng;
    use crate::math::stats::chi_square_p;

    /// Tests the points of a warp against the expected masses of cells, by chi-square. Four tests
    /// share the significance 0.001.
    fn check(n_cells: usize, cell_of: impl Fn([f32; 2]) -> usize, mass: impl Fn(usize) -> f64) {
        let n = 200_000u32;
        let mut observed = vec![0.0; n_cells];
        for i in 0..n {
            let w = rng::pcg4d([i, 5, 77, 3]);
            observed[cell_of([rng::unit(w[0]), rng::unit(w[1])])] += 1.0;
        }
        let expected: Vec<f64> = (0..n_cells).map(|c| mass(c) * f64::from(n)).collect();
        let p = chi_square_p(&observed, &expected, 0);
        assert!(p > 0.001 / 4.0, "p = {p}");
    }

    #[test]
    fn disk_is_uniform() {
        let cell = |u: [f32; 2]| {
            let d = concentric_disk(u);
            let ring = ((d.length_squared() * 8.0) as usize).min(7);
            let sector = (((d.y.atan2(d.x) + PI) / TAU * 16.0) as usize).min(15);
            ring * 16 + sector
        };
        check(128, cell, |_| 1.0 / 128.0);
    }

    #[test]
    fn hemisphere_follows_the_cosine() {
        // The mass of a band of cosines [a, b] is b^2 - a^2.
        let cell = |u: [f32; 2]| {
            let w = cosine_hemisphere(u);
            let band = ((w.z * 10.0) as usize).min(9);
            let sector = (((w.y.atan2(w.x) + PI) / TAU * 8.0) as usize).min(7);
            band * 8 + sector
        };
        let mass = |c: usize| {
            let band = (c / 8) as f64;
            (((band + 1.0) / 10.0).powi(2) - (band / 10.0).powi(2)) / 8.0
        };
        check(80, cell, mass);
        assert!((cosine_hemisphere_pdf_w(1.0) - 1.0 / PI).abs() < 1e-7);
        assert_eq!(cosine_hemisphere_pdf_w(-0.5), 0.0);
    }

    #[test]
    fn sphere_is_uniform() {
        let cell = |u: [f32; 2]| {
            let w = uniform_sphere(u);
            let band = (((w.z + 1.0) * 5.0) as usize).min(9);
            let sector = (((w.y.atan2(w.x) + PI) / TAU * 8.0) as usize).min(7);
            band * 8 + sector
        };
        check(80, cell, |_| 1.0 / 80.0);
    }

    #[test]
    fn triangle_is_uniform() {
        // The cells are the 64 small triangles of an 8 x 8 subdivision.
        let cell = |u: [f32; 2]| {
            let [b1, b2] = uniform_triangle(u);
            let (x, y) = (b1 * 8.0, b2 * 8.0);
            let (i, j) = ((x as usize).min(7), (y as usize).min(7));
            let upper = usize::from(x.fract() + y.fract() > 1.0);
            // Rows shrink: row j has 2 * (8 - j) - 1 cells.
            let before: usize = (0..j).map(|r| 2 * (8 - r) - 1).sum();
            before + (2 * i + upper).min(2 * (8 - j) - 2)
        };
        check(64, cell, |_| 1.0 / 64.0);
    }
}
