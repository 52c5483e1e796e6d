//! Marks the best value of a table row if it is significantly better than every other one.
//!
//! The best mean is compared with every other by Welch's test over repeats, on logarithms for
//! metrics with a logarithmic axis and for times and rates. All tests must be significant at 5 %
//! with Holm's correction.

use crate::output::plot::axis::Scale;
use crate::output::quantity::{Bound, RunValue};
use crate::output::report::metric_display::MetricDisplay;
use lumbre_light::math::t_test::welch_p;

/// Significance level of bold values.
const ALPHA: f64 = 0.05;

/// Order of values and the scale on which they are compared.
#[derive(Clone, Copy)]
pub(super) enum Ranking {
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
    /// Converts a value to the scale of the test, on which smaller is better. Returns `None` for
    /// bounds and for values that the scale does not accept.
    fn score(self, value: &RunValue) -> Option<f64> {
        let x = &value.number;
        if value.bound != Bound::Exact {
            return None;
        }
        match self {
            Ranking::Unranked => None,
            Ranking::LowerError(display) => display.drawn_value(*x).map(|y| {
                if display.scale == Scale::Log {
                    y.ln()
                } else {
                    -y
                }
            }),
            Ranking::HigherRate => (*x > 0.0).then(|| -x.ln()),
            Ranking::ShorterTime => (*x > 0.0).then(|| x.ln()),
        }
    }
}

/// Returns the index of the best of several samples if it is significantly better than every other.
/// Samples with a value that has no score are ignored. With an upper bound, which may be better than
/// any other value, there is no best one.
pub(super) fn significant_best(samples: &[Vec<RunValue>], ranking: Ranking) -> Option<usize> {
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
    use super::*;

    fn exact(values: &[f64]) -> Vec<RunValue> {
        values.iter().map(|v| RunValue::exact(*v)).collect()
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
