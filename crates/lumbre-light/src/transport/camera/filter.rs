//! Pixel filters, sampled by importance.
//!
//! Every filter is the product of one profile in x and the same profile in y, each integrating to
//! one over the offset in pixels. A camera ray's offset is drawn with that density, so every camera
//! sample has weight one. For light paths [`FilterSpec::choose_pixel`] draws a pixel's column or
//! row with probability proportional to the density at the distance of its centre, and returns the
//! sum of those densities as weight.

use std::f32::consts::{PI, TAU};

use serde::{Deserialize, Serialize};

use crate::math::real::Real;

/// A pixel filter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FilterSpec {
    /// The shape of the filter.
    #[serde(rename = "filter")]
    pub kind: FilterKind,
    /// Half width in pixels, at which the filter ends: a box of radius 0.5 is the pixel. For
    /// [`FilterKind::AntialiasingRadius`] half a standard deviation.
    pub radius: f32,
}

crate::named! {
    /// The shape of a pixel filter.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
    #[serde(rename_all = "snake_case")]
    pub enum FilterKind {
        /// Constant density up to the radius.
        Box = "box",
        /// Density that falls linearly from the centre to the radius.
        Tent = "tent",
        /// Gaussian with sigma a third of the radius, truncated at the radius in x and in y.
        Gauss = "gauss",
        /// The minimum four-term window of [Harris 1978], which ends smoothly at the radius.
        BlackmanHarris = "blackman_harris",
        /// The filter of S0 under its own name: a Gaussian with sigma twice the radius, not
        /// truncated (an offset beyond 5.4 sigma is less likely than one 24-bit random number and
        /// is never drawn). The source also shifts the offset so that it is about the pixel's
        /// corner; that shift moves the whole picture and is left out.
        AntialiasingRadius = "antialiasing_radius",
    }
}

/// Content of a film beyond its first and its last column, or row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilmEdge {
    /// More of the picture, which no pixel shows.
    Open,
    /// The other end of the film.
    Wraps,
    /// The film itself, mirrored.
    Reflects,
}

impl FilmEdge {
    /// Returns the index on a film of `count` pixels that the pixel with an index counted beyond
    /// its edges is.
    fn fold(self, index: i64, count: u32) -> u32 {
        let count = i64::from(count);
        let folded = match self {
            FilmEdge::Open => index,
            FilmEdge::Wraps => index.rem_euclid(count),
            FilmEdge::Reflects => {
                let period = index.rem_euclid(2 * count);
                period.min(2 * count - 1 - period)
            }
        };
        folded as u32
    }
}

impl FilterSpec {
    /// The filter that is the pixel's own square.
    pub const PIXEL: FilterSpec = FilterSpec {
        kind: FilterKind::Box,
        radius: 0.5,
    };

    /// Samples an offset from the pixel's centre, in pixels; scalar or vectorised.
    #[inline(always)]
    pub fn sample<R: Real>(&self, [u, v]: [R; 2]) -> [R; 2] {
        [self.offset(u), self.offset(v)]
    }

    /// Samples one coordinate of the offset.
    #[inline(always)]
    fn offset<R: Real>(&self, u: R) -> R {
        let radius = R::splat(self.radius);
        match self.kind {
            FilterKind::Box => (R::splat(2.0) * u - R::splat(1.0)) * radius,
            FilterKind::Tent => u.map_lanes(tent) * radius,
            FilterKind::Gauss => u.map_lanes(truncated_normal) * radius / R::splat(SIGMAS),
            FilterKind::BlackmanHarris => u.map_lanes(blackman_harris) * radius,
            FilterKind::AntialiasingRadius => u.map_lanes(wide_normal) * R::splat(2.0) * radius,
        }
    }

    /// Returns the density of one coordinate of [`FilterSpec::sample`] at an offset `x`, per pixel.
    /// A filter of radius zero has no density: returns zero everywhere.
    #[inline]
    pub fn density(&self, x: f32) -> f32 {
        let r = self.radius;
        if r <= 0.0 || x.abs() > self.reach() {
            return 0.0;
        }
        let gauss = |sigma: f32| (-0.5 * (x / sigma) * (x / sigma)).exp() / (sigma * TAU.sqrt());
        match self.kind {
            FilterKind::Box => 0.5 / r,
            FilterKind::Tent => (1.0 - x.abs() / r) / r,
            FilterKind::Gauss => gauss(r / SIGMAS) / (1.0 - 2.0 * TAIL),
            FilterKind::BlackmanHarris => {
                let c = |k: f32| (k * PI * x / r).cos();
                (HARRIS[0] + HARRIS[1] * c(1.0) + HARRIS[2] * c(2.0) + HARRIS[3] * c(3.0))
                    / (2.0 * r * HARRIS[0])
            }
            FilterKind::AntialiasingRadius => gauss(2.0 * r),
        }
    }

    /// Returns the largest absolute offset in pixels.
    #[inline]
    pub fn reach(&self) -> f32 {
        if self.kind == FilterKind::AntialiasingRadius {
            2.0 * MAX_SIGMAS * self.radius
        } else {
            self.radius
        }
    }

    /// Chooses the column (or row) among `count` that receives a light path at the film position
    /// `q`, in pixels from the edge, with probability proportional to [`FilterSpec::density`] at
    /// the distance to its centre. Also returns the sum of the densities, which is the weight.
    /// Returns `None` if no pixel's filter covers the position or the radius is 0.
    #[inline]
    pub fn choose_pixel(
        &self,
        q: f32,
        (count, edge): (u32, FilmEdge),
        u: f32,
    ) -> Option<(u32, f32)> {
        if *self == FilterSpec::PIXEL {
            // Exactly one pixel's centre is within half a pixel.
            return (q >= 0.0 && q < count as f32).then(|| ((q as u32).min(count - 1), 1.0));
        }
        let reach = self.reach();
        if reach <= 0.0 || !(q + reach >= 0.0 && q - reach <= count as f32) {
            return None;
        }
        let (mut first, mut end) = ((q - reach - 0.5).ceil(), (q + reach - 0.5).floor() + 1.0);
        if edge == FilmEdge::Open {
            (first, end) = (first.max(0.0), end.clamp(0.0, count as f32));
        }
        let (first, end) = (first as i64, end as i64);
        let density = |i: i64| self.density(q - i as f32 - 0.5);
        let total: f32 = (first..end).map(density).sum();
        if total <= 0.0 {
            return None;
        }
        let mut rest = u * total;
        let mut chosen = None;
        for i in first..end {
            let d = density(i);
            if d > 0.0 {
                chosen = Some(i);
                if rest < d {
                    break;
                }
            }
            rest -= d;
        }
        chosen.map(|i| (edge.fold(i, count), total))
    }
}

/// Coefficients of the window [Harris 1978, table 1].
const HARRIS: [f32; 4] = [0.358_75, 0.488_29, 0.141_28, 0.011_68];

/// Maximum deviation of a normal distribution that a 24-bit random number can produce, in standard
/// deviations.
const MAX_SIGMAS: f32 = 5.5;

/// Samples a number in `-1..=1` whose density falls linearly from 0 to both ends, by inversion.
fn tent(u: f32) -> f32 {
    if u < 0.5 {
        (2.0 * u).sqrt() - 1.0
    } else {
        1.0 - (2.0 * (1.0 - u)).max(0.0).sqrt()
    }
}

/// Samples a number in `-1..=1` with the density of the Blackman-Harris window, by inverting its
/// distribution function: Newton steps safeguarded by bisection.
fn blackman_harris(u: f32) -> f32 {
    let [a0, a1, a2, a3] = HARRIS.map(f64::from);
    let pi = std::f64::consts::PI;
    // The window is symmetric: only the upper half is inverted.
    let target = (f64::from(u) - 0.5).abs();
    let (mut low, mut high) = (0.0f64, 1.0f64);
    let mut x = (0.9 * target).min(0.5);
    for _ in 0..40 {
        let (s, c) = (pi * x).sin_cos();
        // Sine and cosine of two and three times the angle.
        let (s2, c2) = (2.0 * s * c, c * c - s * s);
        let (s3, c3) = (s2 * c + c2 * s, c2 * c - s2 * s);
        let mass = 0.5 * (x + (a1 * s + a2 * s2 / 2.0 + a3 * s3 / 3.0) / (pi * a0)) - target;
        let density = 0.5 * (1.0 + (a1 * c + a2 * c2 + a3 * c3) / a0);
        if mass > 0.0 {
            high = x
        } else {
            low = x
        }
        let step = x - mass / density;
        let next = if step > low && step < high {
            step
        } else {
            0.5 * (low + high)
        };
        if (next - x).abs() < 1e-9 {
            break;
        }
        x = next;
    }
    (x as f32).copysign(u - 0.5)
}

/// Radius of the truncated Gaussian in standard deviations.
const SIGMAS: f32 = 3.0;

/// Mass of the standard normal distribution outside three standard deviations, on one side.
const TAIL: f32 = 1.349_898e-3;

/// Samples a standard normal number truncated to an absolute value of at most three, by inversion.
fn truncated_normal(u: f32) -> f32 {
    let p = TAIL + u * (1.0 - 2.0 * TAIL);
    inverse_normal_cdf(p).clamp(-SIGMAS, SIGMAS)
}

/// Samples a standard normal number, by inversion.
fn wide_normal(u: f32) -> f32 {
    inverse_normal_cdf(middle_of_step(u)).clamp(-MAX_SIGMAS, MAX_SIGMAS)
}

/// Returns the middle of the 2^-24 wide step of a sample number, so that 0 is not mapped to
/// infinity. The middle of the last step would round to 1, so it is kept below.
fn middle_of_step(u: f32) -> f32 {
    (u + 0.5 / 16_777_216.0).min(1.0 - 0.5 * f32::EPSILON)
}

/// Returns the quantile of the standard normal distribution for `p` in (0, 1), by the
/// single-precision polynomial for the inverse error function of [Giles 2010, table 5]; relative
/// error below 1e-6.
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
    let (coefficients, w) = if w < 5.0 {
        (CENTRE, w - 2.5)
    } else {
        (TAILS, w.sqrt() - 3.0)
    };
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
        for (p, x) in [
            (0.5, 0.0),
            (0.975, 1.959_964),
            (0.01, -2.326_348),
            (0.998, 2.878_162),
        ] {
            assert!(
                (inverse_normal_cdf(p) - x).abs() < 1e-4,
                "{p}: {}",
                inverse_normal_cdf(p)
            );
        }
        for i in 1..1000 {
            let p = i as f32 / 1000.0;
            assert!(
                (normal_cdf(f64::from(inverse_normal_cdf(p))) - f64::from(p)).abs() < 1e-6,
                "{p}"
            );
        }
    }

    #[test]
    fn gaussian_has_its_density_and_stays_within_its_radius() {
        let f = FilterSpec {
            kind: FilterKind::Gauss,
            radius: 1.5,
        };
        let n = 100_000u32;
        let mut observed = vec![0.0; 30];
        for i in 0..n {
            let [x, y] = f.sample([rng::unit(rng::pcg4d([i, 1, 2, 3])[0]), 0.5]);
            assert!(x.abs() <= 1.5 && y.abs() < 1e-5);
            observed[(((x + 1.5) * 10.0) as usize).min(29)] += 1.0;
        }
        let cdf = |x: f64| (normal_cdf(x / 0.5) - f64::from(TAIL)) / (1.0 - 2.0 * f64::from(TAIL));
        let expected: Vec<f64> = (0..30)
            .map(|i| {
                f64::from(n) * (cdf(f64::from(i + 1) / 10.0 - 1.5) - cdf(f64::from(i) / 10.0 - 1.5))
            })
            .collect();
        assert!(stats::chi_square_p(&observed, &expected, 0) > 0.001);
    }

    /// Tests one coordinate by chi-square against the integral of the density, and the density's
    /// total mass; significance 0.001 is split over five filters.
    #[test]
    fn every_filter_has_the_density_that_it_says() {
        for kind in FilterKind::ALL {
            let name = kind.name();
            let f = FilterSpec { kind, radius: 1.25 };
            let (cells, reach) = (60usize, f64::from(f.reach()));
            let n = 200_000u32;
            let mut observed = vec![0.0; cells];
            for i in 0..n {
                let x = f64::from(f.sample([rng::unit(rng::pcg4d([i, 4, 5, 6])[1]), 0.5])[0]);
                observed[(((x / reach + 1.0) * 0.5 * cells as f64) as usize).min(cells - 1)] += 1.0;
            }
            let step = 2.0 * reach / cells as f64;
            let mass = |c: usize| {
                let at = |j: usize| -reach + step * (c as f64 + (j as f64 + 0.5) / 64.0);
                (0..64)
                    .map(|j| f64::from(f.density(at(j) as f32)))
                    .sum::<f64>()
                    * step
                    / 64.0
            };
            let masses: Vec<f64> = (0..cells).map(mass).collect();
            let total: f64 = masses.iter().sum();
            assert!((total - 1.0).abs() < 1e-4, "{name}: {total}");
            let expected: Vec<f64> = masses.iter().map(|m| m / total * f64::from(n)).collect();
            let p = stats::chi_square_p(&observed, &expected, 0);
            assert!(
                p > stats::sidak(0.001, FilterKind::ALL.len()),
                "{name}: p = {p}"
            );
            assert_eq!(FilterKind::from_name(name), Some(kind));
            assert_eq!(kind.name(), name);
        }
    }

    fn open(count: u32) -> (u32, FilmEdge) {
        (count, FilmEdge::Open)
    }

    #[test]
    fn films_of_spheres_wrap_around_and_are_reflected_at_the_poles() {
        let folded = |edge: FilmEdge| [-9, -5, -1, 0, 3, 4, 7, 8, 11].map(|i| edge.fold(i, 4));
        assert_eq!(folded(FilmEdge::Wraps), [3, 3, 3, 0, 3, 0, 3, 0, 3]);
        assert_eq!(folded(FilmEdge::Reflects), [0, 3, 0, 0, 3, 3, 0, 0, 3]);
        let f = FilterSpec {
            kind: FilterKind::Tent,
            radius: 1.0,
        };
        // A quarter of a pixel from the edge: three quarters of the filter of the first pixel, one
        // quarter of that of the one before.
        for (edge, before) in [(FilmEdge::Wraps, 3), (FilmEdge::Reflects, 0)] {
            assert_eq!(f.choose_pixel(0.25, (4, edge), 0.1), Some((before, 1.0)));
            assert_eq!(f.choose_pixel(0.25, (4, edge), 0.9), Some((0, 1.0)));
        }
    }

    #[test]
    fn pixels_are_chosen_in_proportion_to_what_they_want() {
        for kind in FilterKind::ALL {
            let name = kind.name();
            for (radius, q) in [(0.5, 3.2f32), (1.3, 0.4), (2.0, 6.9)] {
                let f = FilterSpec { kind, radius };
                let wanted: Vec<f32> = (0..7).map(|i| f.density(q - i as f32 - 0.5)).collect();
                let total: f32 = wanted.iter().sum();
                let n = 1000;
                let mut counts = [0.0f32; 7];
                for i in 0..n {
                    let (pixel, weight) = f
                        .choose_pixel(q, open(7), (i as f32 + 0.5) / n as f32)
                        .unwrap();
                    assert!((weight / total - 1.0).abs() < 1e-5, "{name}");
                    counts[pixel as usize] += 1.0;
                }
                for (count, wanted) in counts.iter().zip(&wanted) {
                    assert!(
                        (count / n as f32 - wanted / total).abs() < 2.0 / n as f32,
                        "{name} {counts:?} {wanted}"
                    );
                }
            }
            assert_eq!(
                FilterSpec { kind, radius: 0.0 }.choose_pixel(1.5, open(4), 0.5),
                None,
                "{name}"
            );
            assert_eq!(
                FilterSpec { kind, radius: 0.5 }.choose_pixel(f32::NAN, open(4), 0.5),
                None,
                "{name}"
            );
        }
        assert_eq!(FilterSpec::PIXEL.choose_pixel(-0.1, open(4), 0.5), None);
        assert_eq!(FilterSpec::PIXEL.choose_pixel(4.0, open(4), 0.5), None);
    }

    #[test]
    fn the_first_and_the_last_number_stay_within_reach() {
        for kind in FilterKind::ALL {
            let name = kind.name();
            let f = FilterSpec { kind, radius: 1.25 };
            for u in [0.0, 1.0 - 0.5 * f32::EPSILON] {
                let [x, y] = f.sample([u, u]);
                assert!(
                    x.abs() <= f.reach() && x == y && (x < 0.0) == (u == 0.0),
                    "{name}: {x}"
                );
            }
        }
    }

    #[test]
    fn box_covers_its_square() {
        let f = FilterSpec {
            kind: FilterKind::Box,
            radius: 0.5,
        };
        assert_eq!(f.sample([0.0, 0.5]), [-0.5, 0.0]);
        assert!(f.sample([0.999_999_9, 0.0])[0] < 0.5);
    }
}
