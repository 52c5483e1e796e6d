//! Whether an error has stopped falling.
//!
//! A Monte Carlo error falls like a power of time, with exponent -1/2. What is measured one moment after another of one
//! picture is anything but independent: both measurements contain nearly the same samples. The squared error of a mean
//! over time t is that of a random walk divided by t squared, so two of its logarithms, at t and u > t, have the
//! correlation t/u: deviations from the power law are an Ornstein-Uhlenbeck process in the logarithm of time, which is
//! Markov. Dividing each step of it by what is new in it leaves independent deviates, to which least squares and Student's
//! t apply (generalised least squares [Aitken 1936] with that correlation). Least squares on the measurements as they
//! are would take chance for significance.

use crate::experiment::event::WaveRow;
use crate::math::student::two_sided_p;

/// Fewest measurements from which anything is said.
const FEWEST: usize = 8;

/// Measurements closer in time than this factor say nothing new, and are passed over.
const STEP: f64 = 1.06;

/// The exponent with which an error falls, as far as it is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Slope {
    /// The exponent of render time.
    pub(super) exponent: f64,
    /// Its standard error.
    pub(super) error: f64,
    /// Degrees of freedom.
    pub(super) dof: f64,
}

impl Slope {
    /// The exponent over the last factor `over` of render time; `None` before there is as much, with fewer than eight
    /// measurements of a positive error, or when the newest is none.
    pub(super) fn of(rows: &[WaveRow], over: f64, error: impl Fn(&WaveRow) -> Option<f64>) -> Option<Slope> {
        let last = rows.last()?;
        let from_s = last.render_s / over;
        if rows.first()?.render_s > from_s {
            return None;
        }
        let mut points: Vec<(f64, f64)> = Vec::new();
        for row in rows.iter().rev().take_while(|row| row.render_s >= from_s) {
            let near = points.last().is_some_and(|later| row.render_s * STEP > later.0);
            match error(row).filter(|e| *e > 0.0 && e.is_finite() && row.render_s > 0.0) {
                Some(e) if !near => points.push((row.render_s, e)),
                None if points.is_empty() => return None,
                _ => {}
            }
        }
        points.reverse();
        if points.len() < FEWEST { None } else { fit(&points) }
    }

    /// The probability of a slope as flat as this, if the error fell with exponent `expected` or faster.
    pub(super) fn p_steeper(self, expected: f64) -> f64 {
        let t = (self.exponent - expected) / self.error;
        let half = 0.5 * two_sided_p(t, self.dof);
        if t > 0.0 { half } else { 1.0 - half }
    }
}

/// Fits through points of time and error, ascending in time.
fn fit(points: &[(f64, f64)]) -> Option<Slope> {
    let mut sums = [0.0; 5];
    let mut rows = Vec::new();
    let mut before: Option<(f64, f64)> = None;
    for (t, e) in points {
        let (kept, scale) = match before {
            None => (0.0, 1.0),
            Some((t0, _)) => (t0 / t, 1.0 / (1.0 - (t0 / t).powi(2)).sqrt()),
        };
        let (x0, y0) = before.map_or((0.0, 0.0), |(t, e)| (t.ln(), e.ln()));
        let one = (1.0 - kept) * scale;
        let (x, y) = ((t.ln() - kept * x0) * scale, (e.ln() - kept * y0) * scale);
        for (sum, product) in sums.iter_mut().zip([one * one, one * x, x * x, one * y, x * y]) {
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
    let left: f64 = rows.iter().map(|(one, x, y)| (y - level * one - exponent * x).powi(2)).sum();
    Some(Slope { exponent, error: (left / dof * s11 / determinant).sqrt(), dof })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::{normal, pcg4d, unit};

    /// The rows of a mean over `pixels` pixels of which each sample has variance 1, with an offset that never falls.
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
            let squares: f64 = sums.iter().map(|sum| (sum / n as f64 + offset).powi(2)).sum();
            let rmse = (squares / pixels as f64).sqrt();
            rows.push(WaveRow { samples: n as u64, render_s: n as f64, metrics: vec![rmse], ..WaveRow::default() });
        }
        rows
    }

    fn rmse(row: &WaveRow) -> Option<f64> {
        row.metrics.first().copied()
    }

    #[test]
    fn the_slope_of_noise_is_a_half_and_its_interval_is_honest() {
        // 200 runs of 300 measurements each: the exponent is -1/2 on average, and a two-sided test at 10 % that it is
        // rejects in about 10 % of them: 20 +- 4.2 of 200, here within four standard errors.
        let (mut rejected, mut sum) = (0, 0.0);
        for seed in 0..200 {
            let slope = Slope::of(&rows(seed, 40, 0.0, 300), 4.0, rmse).unwrap();
            let p = slope.p_steeper(-0.5);
            rejected += u32::from(!(0.05..=0.95).contains(&p));
            sum += slope.exponent / 200.0;
        }
        assert!((sum + 0.5).abs() < 0.05, "{sum}");
        assert!((4..=37).contains(&rejected), "{rejected}");
    }

    #[test]
    fn an_error_that_stays_is_found_and_one_that_falls_is_not() {
        for seed in 0..20 {
            let flat = Slope::of(&rows(seed, 40, 1.0, 300), 4.0, rmse).unwrap();
            assert!(flat.p_steeper(-0.1) < 0.01, "{flat:?}");
            let falls = Slope::of(&rows(seed, 400, 0.0, 300), 4.0, rmse).unwrap();
            assert!(falls.p_steeper(-0.1) > 0.01, "{falls:?}");
        }
    }

    #[test]
    fn little_history_says_nothing() {
        let all = rows(1, 10, 0.0, 64);
        assert!(Slope::of(&all, 4.0, rmse).is_some());
        assert_eq!(Slope::of(&all[..6], 4.0, rmse), None, "six measurements");
        assert_eq!(Slope::of(&all[40..], 4.0, rmse), None, "they begin too late");
        assert_eq!(Slope::of(&all, 4.0, |_| Some(f64::NAN)), None);
        assert_eq!(Slope::of(&all, 4.0, |_| Some(0.0)), None, "there is no logarithm of nothing");
        let exact = Slope::of(&all, 4.0, |row| Some(row.render_s.powf(-0.25))).unwrap();
        assert!((exact.exponent + 0.25).abs() < 1e-9 && exact.error < 1e-9, "{exact:?}");
    }
}
