//! Scales on which values are averaged and compared: logarithms for metrics with a logarithmic axis
//! and for times and rates.

use super::Interval;
use crate::comparison::{Comparison, Score, ScoreScale};
use crate::metric_display::MetricDisplay;
use crate::plot::axis::Scale;
use crate::quantity::{Bound, RunValue};
use lumbre_light::math::t_test::mean_and_interval;

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

    /// Converts a value to a number of which smaller is better; NaN if the scale of comparison does
    /// not accept it.
    fn score(self, value: f64) -> f64 {
        let scaled = self.scaled(value).unwrap_or(f64::NAN);
        match self {
            Ranking::HigherRate => -scaled,
            Ranking::LowerError(display) if display.scale == Scale::Linear => -scaled,
            Ranking::Unranked | Ranking::LowerError(_) | Ranking::ShorterTime => scaled,
        }
    }

    fn score_scale(self) -> ScoreScale {
        match self {
            Ranking::LowerError(display) if display.scale == Scale::Linear => ScoreScale::Linear,
            Ranking::LowerError(display) if display.is_root() => ScoreScale::LogarithmOfRoot,
            _ => ScoreScale::Logarithm,
        }
    }

    /// Compares the values of some columns, each with the number of its repeat. A lower bound, such
    /// as the time of a run that did not reach a threshold, counts as that time, which favours its
    /// column: if that leads, or with an upper bound, nothing is compared.
    pub fn compare(self, columns: &[Vec<(u32, RunValue)>]) -> Option<Comparison> {
        let has = |column: &[(u32, RunValue)], bound| {
            column.iter().any(|(_, value)| value.bound == bound)
        };
        let is_open = columns.iter().any(|column| has(column, Bound::Upper));
        if matches!(self, Ranking::Unranked) || is_open {
            return None;
        }
        let score = |(repeat, value): &(u32, RunValue)| Score {
            repeat: *repeat,
            at_noise: value.at_noise().map(|number| self.score(number)),
        };
        let scores = |column: &Vec<(u32, RunValue)>| column.iter().map(score).collect();
        let arms: Vec<Vec<Score>> = columns.iter().map(scores).collect();
        let comparison = Comparison::new(&arms, self.score_scale())?;
        (!has(&columns[comparison.best], Bound::Lower)).then_some(comparison)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use lumbre_metrics::MetricSpec;

    fn exact(values: &[f64]) -> Vec<(u32, RunValue)> {
        let values = values.iter().map(|v| RunValue::exact(*v));
        (0..).zip(values).collect()
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

    fn significant_best(columns: &[Vec<(u32, RunValue)>], ranking: Ranking) -> Option<usize> {
        let comparison = ranking.compare(columns)?;
        comparison.is_significant().then_some(comparison.best)
    }

    #[test]
    fn a_column_that_missed_the_threshold_may_be_beaten_and_never_leads() {
        let missed = |times: &[f64]| {
            let mut column = exact(times);
            column[0].1.bound = Bound::Lower;
            column
        };
        let fast = || exact(&[1.0, 1.01, 0.99]);
        let slow = [fast(), missed(&[4.0, 3.9, 3.8])];
        assert_eq!(significant_best(&slow, Ranking::ShorterTime), Some(0));
        let lucky = [fast(), missed(&[0.2, 0.21, 0.19])];
        assert_eq!(Ranking::ShorterTime.compare(&lucky), None);
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
