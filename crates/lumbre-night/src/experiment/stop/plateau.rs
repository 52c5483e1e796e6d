//! Detection of a plateau: whether an error has stopped falling.
//!
//! A Monte Carlo error falls like a power of time with exponent -1/2. Successive measurements of
//! one picture are strongly correlated, since they contain nearly the same samples. The squared
//! error of a mean over time t is that of a random walk divided by t squared, so two of its
//! logarithms, at t and u > t, have the correlation t/u: deviations from the power law are an
//! Ornstein-Uhlenbeck process in the logarithm of time, which is Markov. Dividing each step by the
//! standard deviation of its innovation leaves independent deviates, to which least squares and
//! Student's t apply (generalised least squares [Aitken 1936] with that correlation). Ordinary
//! least squares on the measurements would mistake chance for significance.

use crate::experiment::outcome::WaveRow;
use lumbre_light::math::t_test::two_sided_p;

/// Smallest number of measurements for an estimate.
const MIN_POINTS: usize = 8;

/// Smallest factor of render time between two measurements that are used; closer ones add little
/// information.
const MIN_STEP: f64 = 1.06;

/// Estimated exponent of an error as a power of render time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Slope {
    /// Exponent of render time.
    pub(super) exponent: f64,
    /// Standard error of the exponent.
    pub(super) error: f64,
    /// Degrees of freedom of the estimate.
    pub(super) dof: f64,
}

impl Slope {
    /// Estimates the exponent over the last factor `over` of render time. Returns `None` if the run
    /// is not that old, has fewer than eight usable measurements of a positive error, or its newest
    /// measurement has none.
    pub(super) fn estimate(
        rows: &[WaveRow],
        over: f64,
        error: impl Fn(&WaveRow) -> Option<f64>,
    ) -> Option<Slope> {
        let last = rows.last()?;
        let from_s = last.render_s / over;
        if rows.first()?.render_s > from_s {
            return None;
        }
        let mut points: Vec<(f64, f64)> = Vec::new();
        for row in rows.iter().rev().take_while(|row| row.render_s >= from_s) {
            let near = points
                .last()
                .is_some_and(|later| row.render_s * MIN_STEP > later.0);
            match error(row).filter(|e| *e > 0.0 && e.is_finite() && row.render_s > 0.0) {
                Some(e) if !near => points.push((row.render_s, e)),
                None if points.is_empty() => return None,
                _ => {}
            }
        }
        points.reverse();
        if points.len() < MIN_POINTS {
            None
        } else {
            fit_power_law(&points)
        }
    }

    /// One-sided p-value: the probability of an exponent at least this large if the true one is
    /// `expected`.
    pub(super) fn p_steeper(self, expected: f64) -> f64 {
        let t = (self.exponent - expected) / self.error;
        let half = 0.5 * two_sided_p(t, self.dof);
        if t > 0.0 { half } else { 1.0 - half }
    }
}

/// Fits a power law to points of time and error, in ascending order of time, by generalised least
/// squares. Returns `None` if the points are degenerate.
fn fit_power_law(points: &[(f64, f64)]) -> Option<Slope> {
    let mut sums = [0.0; 5];
    let mut rows = Vec::new();
    let mut before: Option<(f64, f64)> = None;
    for (t, e) in points {
        let (correlation, scale) = match before {
            None => (0.0, 1.0),
            Some((t0, _)) => (t0 / t, 1.0 / (1.0 - (t0 / t).powi(2)).sqrt()),
        };
        let (x0, y0) = before.map_or((0.0, 0.0), |(t, e)| (t.ln(), e.ln()));
        let one = (1.0 - correlation) * scale;
        let (x, y) = (
            (t.ln() - correlation * x0) * scale,
            (e.ln() - correlation * y0) * scale,
        );
        for (sum, product) in sums
            .iter_mut()
            .zip([one * one, one * x, x * x, one * y, x * y])
        {
            *sum += product;
        }
        rows.push((one, x, y));
        before = Some((*t, *e));
    }
    let [s11, s1x, sxx, s1y, sxy] = sums;
    let determinant = s11 * sxx - s1x * s1x;
    if determinant.is_nan() || determinant <= 1e-12 * s11 * sxx {
        return None;
    }
    let exponent = (s11 * sxy - s1x * s1y) / determinant;
    let level = (sxx * s1y - s1x * sxy) / determinant;
    let dof = points.len() as f64 - 2.0;
    let residual: f64 = rows
        .iter()
        .map(|(one, x, y)| (y - level * one - exponent * x).powi(2))
        .sum();
    Some(Slope {
        exponent,
        error: (residual / dof * s11 / determinant).sqrt(),
        dof,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumbre_light::math::rng::{normal, pcg4d, unit};

    /// Rows of a mean over `pixels` pixels whose samples have variance 1, with a constant offset.
    fn rows(seed: u32, pixels: usize, offset: f64, count: usize) -> Vec<WaveRow> {
        let mut sums = vec![0.0; pixels];
        let mut drawn = 0;
        let mut deviate = || {
            drawn += 1;
            let [a, b, ..] = pcg4d([seed, drawn, 17, 4]);
            f64::from(normal([unit(a), unit(b)]))
        };
        let mut rows = Vec::new();
        for n in 1..=count {
            sums.iter_mut().for_each(|sum| *sum += deviate());
            let squares: f64 = sums
                .iter()
                .map(|sum| (sum / n as f64 + offset).powi(2))
                .sum();
            let rmse = (squares / pixels as f64).sqrt();
            rows.push(WaveRow {
                samples: n as u64,
                render_s: n as f64,
                metrics: vec![rmse],
                ..WaveRow::default()
            });
        }
        rows
    }

    fn rmse(row: &WaveRow) -> Option<f64> {
        row.metrics.first().copied()
    }

    #[test]
    fn the_exponent_of_noise_is_minus_half_and_its_test_has_its_level() {
        // 200 runs of 300 measurements each. The exponent is -1/2 on average, and a two-sided test
        // of it at 10 % rejects in about 10 % of the runs: 20 +- 4.2, here within four standard
        // errors.
        let (mut rejected, mut sum) = (0, 0.0);
        for seed in 0..200 {
            let slope = Slope::estimate(&rows(seed, 40, 0.0, 300), 4.0, rmse).unwrap();
            let p = slope.p_steeper(-0.5);
            rejected += u32::from(!(0.05..=0.95).contains(&p));
            sum += slope.exponent / 200.0;
        }
        assert!((sum + 0.5).abs() < 0.05, "{sum}");
        assert!((4..=37).contains(&rejected), "{rejected}");
    }

    #[test]
    fn a_constant_error_is_a_plateau_and_a_falling_one_is_not() {
        for seed in 0..20 {
            let flat = Slope::estimate(&rows(seed, 40, 1.0, 300), 4.0, rmse).unwrap();
            assert!(flat.p_steeper(-0.1) < 0.01, "{flat:?}");
            let falls = Slope::estimate(&rows(seed, 400, 0.0, 300), 4.0, rmse).unwrap();
            assert!(falls.p_steeper(-0.1) > 0.01, "{falls:?}");
        }
    }

    #[test]
    fn short_histories_give_no_estimate() {
        let all = rows(1, 10, 0.0, 64);
        assert!(Slope::estimate(&all, 4.0, rmse).is_some());
        assert_eq!(
            Slope::estimate(&all[..6], 4.0, rmse),
            None,
            "six measurements"
        );
        assert_eq!(
            Slope::estimate(&all[40..], 4.0, rmse),
            None,
            "they begin too late"
        );
        assert_eq!(Slope::estimate(&all, 4.0, |_| Some(f64::NAN)), None);
        assert_eq!(
            Slope::estimate(&all, 4.0, |_| Some(0.0)),
            None,
            "zero has no logarithm"
        );
        let exact = Slope::estimate(&all, 4.0, |row| Some(row.render_s.powf(-0.25))).unwrap();
        assert!(
            (exact.exponent + 0.25).abs() < 1e-9 && exact.error < 1e-9,
            "{exact:?}"
        );
    }

    #[test]
    fn the_test_of_the_exponent_is_one_sided() {
        let slope = |deviates: f64| Slope {
            exponent: -0.1 + 0.02 * deviates,
            error: 0.02,
            dof: 1e6,
        };
        // The normal distribution above 0, 1.6449, -1.6449 and 2.3263 standard deviations.
        for (deviates, expected) in [(0.0, 0.5), (1.6449, 0.05), (-1.6449, 0.95), (2.3263, 0.01)] {
            let p = slope(deviates).p_steeper(-0.1);
            assert!((p - expected).abs() < 1e-4, "{deviates}: {p}");
        }
    }
}
