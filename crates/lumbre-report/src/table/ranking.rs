//! Marks the best value of a table row if it is significantly better than every other one.
//!
//! The best mean is compared with every other by Welch's test over repeats, on logarithms for
//! metrics with a logarithmic axis and for times and rates. All tests must be significant at 5 %
//! with Holm's correction. Means and their intervals are computed on the same scale.

use super::Interval;
use crate::metric_display::MetricDisplay;
use crate::plot::axis::Scale;
use crate::quantity::{Bound, RunValue};
use lumbre_light::math::t_test::{mean_and_interval, welch_p};

/// Significance level of bold values.
const ALPHA: f64 = 0.05;

/// Order of values and the scale on which they are compared.
#[derive(Clone, Copy)]
pub enum Ranking {
    /// No value is better than another.
    Unranked,
    /// A smaller error is better. Errors are compared on the scale of their axis.
    LowerError(MetricDisplay),
    /// A higher positive rate is better. Rates are compared by their logarithms.
    HigherRate,
    /// A shorter positive time is better. Times are compared by their logarithms.
    ShorterTime,
}

impl Ranking {
    /// Converts a value to the scale on which it is averaged and compared: a logarithm for rates,
    /// times and errors with a logarithmic axis. Returns `None` if the scale does not accept it.
    pub fn scaled(self, value: f64) -> Option<f64> {
        match self {
            Ranking::Unranked => Some(value),
            Ranking::LowerError(display) => {
                let drawn = display.drawn_value(value)?;
                Some(display.scale.scaled(drawn))
            }
            Ranking::HigherRate | Ranking::ShorterTime => (value > 0.0).then(|| value.ln()),
        }
    }

    /// Converts a number on the scale of [`Ranking::scaled`] back to a value.
    fn unscaled(self, scaled: f64) -> f64 {
        match self {
            Ranking::Unranked => scaled,
            Ranking::LowerError(display) => display.metric_value(display.scale.unscaled(scaled)),
            Ranking::HigherRate | Ranking::ShorterTime => scaled.exp(),
        }
    }

    /// Returns the mean of some values on the scale of comparison with its 95 % confidence interval
    /// by Student's t, both converted back. There is no interval for a single value. If the scale
    /// does not accept a value, such as an error of 0, returns the arithmetic mean without an
    /// interval.
    pub fn mean(self, values: &[f64]) -> (f64, Option<Interval>) {
        let scaled: Option<Vec<f64>> = values.iter().map(|value| self.scaled(*value)).collect();
        let Some(scaled) = scaled else {
            return (values.iter().sum::<f64>() / values.len() as f64, None);
        };
        let (mean, half) = mean_and_interval(&scaled);
        let interval = half.filter(|half| half.is_finite()).map(|half| {
            let ends = [self.unscaled(mean - half), self.unscaled(mean + half)];
            match self {
                Ranking::Unranked => Interval::Half(half),
                Ranking::HigherRate | Ranking::ShorterTime => Interval::Factor(half.exp()),
                Ranking::LowerError(display) => match (display.scale, display.complement()) {
                    (Scale::Linear, _) => Interval::Half(half),
                    (Scale::Log, None) => Interval::Factor(half.exp()),
                    (Scale::Log, Some(_)) => {
                        Interval::Ends(ends[0].min(ends[1]), ends[0].max(ends[1]))
                    }
                },
            }
        });
        (self.unscaled(mean), interval)
    }

    /// Converts a value to a number of which smaller is better. Returns `None` for bounds and for
    /// values that the scale of comparison does not accept.
    fn score(self, value: &RunValue) -> Option<f64> {
        if value.bound != Bound::Exact {
            return None;
        }
        let scaled = self.scaled(value.number)?;
        match self {
            Ranking::Unranked => None,
            Ranking::HigherRate => Some(-scaled),
            Ranking::LowerError(display) if display.scale == Scale::Linear => Some(-scaled),
            Ranking::LowerError(_) | Ranking::ShorterTime => Some(scaled),
        }
    }
}

/// Returns the index of the best of several samples if it is significantly better than every other.
/// Samples with a value that has no score are ignored. With an upper bound, which may be better than
/// any other value, there is no best one.
pub fn significant_best(samples: &[Vec<RunValue>], ranking: Ranking) -> Option<usize> {
    let scores = |list: &Vec<RunValue>| -> Option<Vec<f64>> {
        list.iter().map(|value| ranking.score(value)).collect()
    };
    let columns: Vec<(usize, Vec<f64>)> = samples
        .iter()
        .enumerate()
        .filter(|(_, list)| !list.is_empty())
        .filter_map(|(i, list)| Some((i, scores(list)?)))
        .collect();
    let is_open = |value: &RunValue| matches!(value.bound, Bound::Upper | Bound::Either);
    if columns.len() < 2 || samples.iter().flatten().any(is_open) {
        return None;
    }
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let (best, best_scores) = columns
        .iter()
        .min_by(|a, b| mean(&a.1).total_cmp(&mean(&b.1)))?;
    let mut p: Vec<f64> = columns
        .iter()
        .filter(|(i, _)| i != best)
        .map(|(_, other)| welch_p(best_scores, other))
        .collect();
    p.sort_by(f64::total_cmp);
    let tests = p.len();
    p.iter()
        .enumerate()
        .all(|(i, p)| *p <= ALPHA / (tests - i) as f64)
        .then_some(*best)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use lumbre_metrics::MetricSpec;

    fn exact(values: &[f64]) -> Vec<RunValue> {
        values.iter().map(|v| RunValue::exact(*v)).collect()
    }

    #[test]
    fn a_mean_and_its_interval_are_on_the_scale_of_the_test() {
        // Logarithms -ln 2, 0 and ln 2: standard deviation ln 2, t = 4.30265.
        let factor = (4.302_652_73 * 2f64.ln() / 3f64.sqrt()).exp();
        let (mean, interval) = Ranking::HigherRate.mean(&[0.5, 1.0, 2.0]);
        assert!((mean - 1.0).abs() < 1e-12);
        assert!(matches!(interval, Some(Interval::Factor(f)) if (f - factor).abs() < 1e-5));
        let ssim = MetricSpec::new("ssim", "ssim", BTreeMap::new()).unwrap();
        let ranking = Ranking::LowerError(MetricDisplay::for_metric(&ssim));
        let (mean, interval) = ranking.mean(&[0.5, 0.75, 0.875]);
        assert!((mean - 0.75).abs() < 1e-12);
        let Some(Interval::Ends(low, high)) = interval else {
            panic!("{interval:?} is not symmetric around the mean");
        };
        assert!((1.0 - low - 0.25 * factor).abs() < 1e-5);
        assert!((1.0 - high - 0.25 / factor).abs() < 1e-5);
        assert_eq!(Ranking::Unranked.mean(&[3.0]), (3.0, None));
        assert_eq!(
            Ranking::ShorterTime.mean(&[0.0, 1.0]),
            (0.5, None),
            "a logarithm of zero has no mean"
        );
    }

    /// Returns times whose Welch test against `times_with_p(1.0)` has this p-value. Their logarithms
    /// are -1, 0 and 1 plus a mean, so the test has 4 degrees of freedom.
    fn times_with_p(p: f64) -> Vec<RunValue> {
        // Student's t distribution in closed form for 4 degrees of freedom, inverted by bisection.
        let p_of = |t: f64| 1.0 - t * (t * t + 6.0) / (t * t + 4.0).powf(1.5);
        let (mut low, mut high) = (0.0, 100.0);
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            if p_of(middle) > p {
                low = middle;
            } else {
                high = middle;
            }
        }
        let mean = low * (2.0f64 / 3.0).sqrt();
        exact(&[-1.0, 0.0, 1.0].map(|x| f64::exp(x + mean)))
    }

    #[test]
    fn the_tests_of_the_best_are_corrected_by_holm() {
        // The i-th smallest of n p-values must be at most 0.05 / (n - i), counted from 0.
        for (p, is_best) in [
            (&[0.049][..], true),
            (&[0.051], false),
            (&[0.049, 0.024], true),
            (&[0.049, 0.026], false),
            (&[0.051, 0.001], false),
            // Bonferroni's correction would compare all three with 0.0167.
            (&[0.049, 0.016, 0.024], true),
            (&[0.016, 0.024, 0.049], true),
            (&[0.024, 0.049, 0.001], true),
            (&[0.016, 0.016, 0.016], true),
            (&[0.049, 0.017, 0.024], false),
            (&[0.026, 0.001, 0.026], false),
        ] {
            let best = std::iter::once(times_with_p(1.0));
            let samples: Vec<_> = best.chain(p.iter().map(|p| times_with_p(*p))).collect();
            let expected = is_best.then_some(0);
            assert_eq!(
                significant_best(&samples, Ranking::ShorterTime),
                expected,
                "{p:?}"
            );
        }
    }

    #[test]
    fn the_best_must_differ_significantly_from_every_other() {
        let clear = [
            exact(&[1.0, 1.01, 0.99]),
            exact(&[2.0, 2.02, 1.98]),
            exact(&[3.0, 3.1, 2.9]),
        ];
        assert_eq!(significant_best(&clear, Ranking::ShorterTime), Some(0));
        assert_eq!(significant_best(&clear, Ranking::HigherRate), Some(2));
        assert_eq!(significant_best(&clear, Ranking::Unranked), None);
        let ranked = |name: &str| {
            let metric = MetricSpec::new(name, name, BTreeMap::new()).unwrap();
            Ranking::LowerError(MetricDisplay::for_metric(&metric))
        };
        let quality = [exact(&[0.90, 0.91, 0.89]), exact(&[0.98, 0.981, 0.979])];
        assert_eq!(significant_best(&quality, ranked("ssim")), Some(1));
        assert_eq!(significant_best(&clear, ranked("psnr")), Some(2));
        assert_eq!(significant_best(&clear, ranked("rmse")), Some(0));
        let close = [
            exact(&[1.0, 1.01, 0.99]),
            exact(&[1.0, 1.02, 0.985]),
            exact(&[3.0, 3.1, 2.9]),
        ];
        assert_eq!(
            significant_best(&close, Ranking::ShorterTime),
            None,
            "the second is as good"
        );
        assert_eq!(
            significant_best(&[exact(&[1.0]), exact(&[9.0])], Ranking::ShorterTime),
            None,
            "single runs cannot be tested"
        );
        assert_eq!(
            significant_best(&[exact(&[1.0, 1.1])], Ranking::ShorterTime),
            None,
            "there is no other value"
        );
    }
}
