//! Pixel filters, sampled by importance.

/// A pixel filter, sampled by importance: every sample has weight one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterSpec {
    /// Its shape.
    pub kind: FilterKind,
    /// Half width in pixels: a box of radius 0.5 is the pixel; a Gaussian is cut off here, at three sigma.
    pub radius: f32,
}

/// The shapes of pixel filters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilterKind {
    /// Constant.
    Box,
    /// Gaussian with sigma a third of the radius, truncated at the radius in x and in y.
    Gauss,
}

impl FilterSpec {
    /// Offset from the pixel's centre in pixels, each coordinate in `-radius..=radius`.
    #[inline]
    pub fn sample(&self, u: [f32; 2]) -> [f32; 2] {
        match self.kind {
            FilterKind::Box => u.map(|u| (2.0 * u - 1.0) * self.radius),
            FilterKind::Gauss => u.map(|u| truncated_normal(u) * self.radius / SIGMAS),
        }
    }
}

/// Radius of the truncated Gaussian in standard deviations.
const SIGMAS: f32 = 3.0;

/// Mass of the standard normal distribution outside three standard deviations, on one side.
const TAIL: f32 = 1.349_898e-3;

/// A standard normal number conditioned on its absolute value being at most three, by inversion.
fn truncated_normal(u: f32) -> f32 {
    let p = TAIL + u * (1.0 - 2.0 * TAIL);
    inverse_normal_cdf(p).clamp(-SIGMAS, SIGMAS)
}

/// The quantile of the standard normal distribution for `p` in (0, 1): the single-precision polynomial for the inverse
/// error function of [Giles 2010, table 5], relative error below 1e-6.
fn inverse_normal_cdf(p: f32) -> f32 {
    const CENTRE: [f32; 9] = [
        2.810_226_4e-8,
        3.432_739_3e-7,
        -3.523_387_7e-6,
        -4.391_506_5e-6,
        2.185_808_7e-4,
        -1.253_725e-3,
        -4.177_681_6e-3,
        2.466_407_3e-1,
        1.501_409_4,
    ];
    const TAILS: [f32; 9] = [
        -2.002_142_6e-4,
        1.009_505_6e-4,
        1.349_343_2e-3,
        -3.673_428_4e-3,
        5.739_507_7e-3,
        -7.622_461_3e-3,
        9.438_870_5e-3,
        1.001_674,
        2.832_976_8,
    ];
    let x = 2.0 * p - 1.0;
    let w = -((1.0 - x) * (1.0 + x)).ln();
    let (coefficients, w) = if w < 5.0 { (CENTRE, w - 2.5) } else { (TAILS, w.sqrt() - 3.0) };
    std::f32::consts::SQRT_2 * x * coefficients.iter().fold(0.0, |sum, c| sum * w + c)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{rng, stats};

    /// The standard normal distribution function by its power series, accurate for |x| <= 4.
    fn normal_cdf(x: f64) -> f64 {
        let (mut term, mut sum, mut k) = (x, x, 1.0);
        while term.abs() > 1e-15 {
            k += 2.0;
            term *= x * x / k;
            sum += term;
        }
        0.5 + sum * (-0.5 * x * x).exp() / std::f64::consts::TAU.sqrt()
    }

    #[test]
    fn quantiles_match_published_values() {
        for (p, x) in [(0.5, 0.0), (0.975, 1.959_964), (0.01, -2.326_348), (0.998, 2.878_162)] {
            assert!((inverse_normal_cdf(p) - x).abs() < 1e-4, "{p}: {}", inverse_normal_cdf(p));
        }
        for i in 1..1000 {
            let p = i as f32 / 1000.0;
            assert!((normal_cdf(f64::from(inverse_normal_cdf(p))) - f64::from(p)).abs() < 1e-6, "{p}");
        }
    }

    #[test]
    fn gaussian_has_its_density_and_stays_within_its_radius() {
        let f = FilterSpec { kind: FilterKind::Gauss, radius: 1.5 };
        let n = 100_000u32;
        let mut observed = vec![0.0; 30];
        for i in 0..n {
            let [x, y] = f.sample([rng::unit(rng::pcg4d([i, 1, 2, 3])[0]), 0.5]);
            assert!(x.abs() <= 1.5 && y.abs() < 1e-5);
            observed[(((x + 1.5) * 10.0) as usize).min(29)] += 1.0;
        }
        let cdf = |x: f64| (normal_cdf(x / 0.5) - f64::from(TAIL)) / (1.0 - 2.0 * f64::from(TAIL));
        let expected: Vec<f64> = (0..30)
            .map(|i| f64::from(n) * (cdf(f64::from(i + 1) / 10.0 - 1.5) - cdf(f64::from(i) / 10.0 - 1.5)))
            .collect();
        assert!(stats::chi_square_p(&observed, &expected, 0) > 0.001);
    }

    #[test]
    fn box_covers_its_square() {
        let f = FilterSpec { kind: FilterKind::Box, radius: 0.5 };
        assert_eq!(f.sample([0.0, 0.5]), [-0.5, 0.0]);
        assert!(f.sample([0.999_999_9, 0.0])[0] < 0.5);
    }
}
