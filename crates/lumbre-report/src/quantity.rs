//! Final values of finished runs, as shown in tables and in figures over an axis: how each is
//! computed, named and described.

use super::format;
use lumbre_metrics::{Better, MetricSpec};
use lumbre_night::experiment::WaveRow;
use lumbre_night::experiment::night::run::Run;
use lumbre_night::experiment::spec::TableValue;
use lumbre_render::OpenStats;

/// Relation of a number to the true one, or to those of several runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Bound {
    /// The number itself.
    #[default]
    Exact,
    /// A lower bound: a run ended after this many seconds without reaching the threshold.
    Lower,
    /// An upper bound: the first measurement, after this many seconds, had reached the threshold.
    Upper,
    /// The median of runs of which some have only a bound.
    Median,
}

impl Bound {
    /// Returns the sign before the number in tables; empty for an exact one.
    pub fn sign(self) -> &'static str {
        match self {
            Bound::Exact => "",
            Bound::Lower => "> ",
            Bound::Upper => "≤ ",
            Bound::Median => "median ",
        }
    }

    /// Returns the name in CSV files; empty for an exact number.
    pub fn name(self) -> &'static str {
        match self {
            Bound::Exact => "",
            Bound::Lower => "lower",
            Bound::Upper => "upper",
            Bound::Median => "median",
        }
    }

    /// Returns a sentence that explains the sign; empty for an exact number.
    pub fn explanation(self) -> &'static str {
        match self {
            Bound::Exact => "",
            Bound::Lower => "`> t`: not reached within t seconds.",
            Bound::Upper => "`≤ t`: reached at the first measurement, after t seconds.",
            Bound::Median => {
                "`median t`: of all runs, of which some did not reach it or had reached it at the \
                 first measurement; with its 95 % confidence interval."
            }
        }
    }

    /// Whether the number itself is not known.
    pub fn is_open(self) -> bool {
        matches!(self, Bound::Lower | Bound::Upper)
    }

    /// Returns the explanations of the signs that occur among `bounds`, each once, joined by
    /// spaces.
    pub fn explanations(bounds: &[Bound]) -> String {
        let occurring = [Bound::Lower, Bound::Upper, Bound::Median]
            .into_iter()
            .filter(|bound| bounds.contains(bound));
        occurring
            .map(Bound::explanation)
            .collect::<Vec<_>>()
            .join(" ")
    }
}

/// Value of one run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunValue {
    /// Number in the unit of the value.
    pub number: f64,
    /// Relation of the number to the true one.
    pub bound: Bound,
    /// The number with the noise of the reference at the lower and the upper end of its interval,
    /// where that differs.
    pub noise_ends: Option<[f64; 2]>,
}

impl RunValue {
    /// Creates a value that is known.
    pub fn exact(number: f64) -> RunValue {
        RunValue::bounded(number, Bound::Exact)
    }

    /// Creates a value that is known with the noise of the reference as estimated, and at both ends
    /// of its interval.
    pub fn at_each_noise([number, low, high]: [f64; 3]) -> RunValue {
        RunValue {
            noise_ends: Some([low, high]),
            ..RunValue::exact(number)
        }
    }

    /// Creates a value that may be a bound.
    pub fn bounded(number: f64, bound: Bound) -> RunValue {
        RunValue {
            number,
            bound,
            noise_ends: None,
        }
    }

    /// Returns the number with the noise of the reference as estimated, and at both ends of its
    /// interval.
    pub fn at_noise(&self) -> [f64; 3] {
        let [low, high] = self.noise_ends.unwrap_or([self.number; 2]);
        [self.number, low, high]
    }
}

/// Returns the time from which on a curve of (time, value) stayed at a threshold or better, or `None`
/// for an empty curve: the first passage would reward a run that was lucky once. `reached` says whether a value is at least as good, `scale` the scale on which
/// values are nearly linear in the logarithm of time, as an error is on a logarithmic one.
///
/// Between measurements the time is interpolated. It is a bound if the first measurement had
/// reached the threshold, or the last had not.
pub fn crossing(
    curve: &[(f64, f64)],
    threshold: f64,
    reached: impl Fn(f64) -> bool,
    scale: impl Fn(f64) -> f64,
) -> Option<RunValue> {
    let (last_time, _) = *curve.last()?;
    let bound = |number, bound| Some(RunValue::bounded(number, bound));
    let last_missed = curve.iter().rposition(|(_, value)| !reached(*value));
    let index = last_missed.map_or(0, |missed| missed + 1);
    if index == curve.len() {
        return bound(last_time, Bound::Lower);
    }
    let (after, value_after) = curve[index];
    let Some((before, value_before)) = index.checked_sub(1).map(|i| curve[i]) else {
        return bound(after, Bound::Upper);
    };
    let [from, to, at] = [value_before, value_after, threshold].map(scale);
    let share = (at - from) / (to - from);
    let time = before * (after / before).powf(share);
    // A value that the scale does not accept, such as an error of 0, gives no time between.
    let is_between = share < 1.0 && (before..after).contains(&time);
    Some(RunValue::exact(if is_between { time } else { after }))
}

/// Returns the time from which on a metric stayed at a threshold, as [`crossing`] does. `curve` has
/// the render time in seconds and the metric's value of each measurement.
pub fn time_to(better: Better, curve: &[(f64, f64)], threshold: f64) -> Option<RunValue> {
    let magnitude = |value: f64| match better {
        Better::Lower | Better::NearZero => value.abs().ln(),
        Better::Higher => value,
    };
    let reached = |value| reaches(better, value, threshold);
    crossing(curve, threshold, reached, magnitude)
}

/// Returns the value of a run at its last measurement, or `None` if the run has no such value.
/// `metric` returns the value of the metric with an index in `metrics`.
pub fn run_value(
    metrics: &[MetricSpec],
    value: &TableValue,
    run: &Run,
    metric: impl Fn(&WaveRow, usize) -> Option<f64>,
) -> Option<RunValue> {
    let last = run.rows.last()?;
    Some(match value {
        TableValue::Metric(name) => {
            RunValue::exact(metric(last, format::column(metrics, name)?.0)?)
        }
        TableValue::TimeTo { column, threshold } => {
            let (index, spec) = format::column(metrics, column)?;
            metric(last, index)?;
            let point = |row: &WaveRow| Some((row.render_s, metric(row, index)?));
            let curve: Vec<(f64, f64)> = run.rows.iter().filter_map(point).collect();
            time_to(spec.row.better, &curve, *threshold)?
        }
        TableValue::Run(column) => {
            let unknown = OpenStats::default();
            let open = run.open.as_ref().unwrap_or(&unknown);
            RunValue::exact((column.row().value)(last, open)?)
        }
    })
}

/// Returns whether a metric value is at least as good as a threshold.
pub fn reaches(better: Better, value: f64, threshold: f64) -> bool {
    match better {
        Better::Lower => value <= threshold,
        Better::Higher => value >= threshold,
        Better::NearZero => value.abs() <= threshold,
    }
}

/// Returns the comparison sign of a threshold, such as `≤`.
pub fn threshold_sign(better: Better) -> &'static str {
    match better {
        Better::Lower => "≤",
        Better::Higher => "≥",
        Better::NearZero => "of either sign ≤",
    }
}

/// Returns the axis label of a value, with its unit.
pub fn label(metrics: &[MetricSpec], value: &TableValue) -> String {
    match value {
        TableValue::Metric(column) => {
            let metric = format::column(metrics, column).map(|(_, m)| m);
            metric.map_or(column.clone(), |m| {
                format::with_unit(m.row.label, &m.unit())
            })
        }
        TableValue::TimeTo { .. } => "time to threshold (s)".to_owned(),
        TableValue::Run(column) => column.row().label.to_owned(),
    }
}

/// Returns the description of a value, as the beginning of a sentence.
pub fn title(metrics: &[MetricSpec], value: &TableValue) -> String {
    match value {
        TableValue::Metric(column) => match format::column(metrics, column) {
            Some((_, m)) => {
                let unit = m.unit();
                let unit = if unit.is_empty() {
                    String::new()
                } else {
                    format!(" in {unit}")
                };
                format!(
                    "{}{unit} after the last wave",
                    format::metric_description(m)
                )
            }
            None => format!("`{column}` (not measured)"),
        },
        TableValue::TimeTo { column, threshold } => match format::column(metrics, column) {
            Some((_, m)) => {
                let sign = threshold_sign(m.row.better);
                format!(
                    "Render time in seconds until {} {sign} {threshold} for good",
                    format::metric_description(m)
                )
            }
            None => format!("Render time until `{column}` (not measured)"),
        },
        TableValue::Run(column) => column.row().description.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_threshold_is_reached_from_the_side_of_worse_values() {
        let times = [1.0, 10.0, 100.0];
        let curve = |values: [f64; 3]| times.into_iter().zip(values).collect::<Vec<_>>();
        let time = |better, values| {
            let found = time_to(better, &curve(values), 0.1).unwrap();
            ((found.number * 1e6).round() / 1e6, found.bound)
        };
        for (better, values, expected) in [
            (Better::Lower, [1.0, 0.1, 0.01], (10.0, Bound::Exact)),
            (
                Better::Lower,
                [1.0, 1.0, 0.01],
                (10f64.powf(1.5), Bound::Exact),
            ),
            (Better::Lower, [0.1, 0.1, 0.1], (1.0, Bound::Upper)),
            // It was lucky at first.
            (
                Better::Lower,
                [0.01, 1.0, 0.01],
                (10f64.powf(1.5), Bound::Exact),
            ),
            (Better::Lower, [0.01, 0.01, 0.2], (100.0, Bound::Lower)),
            (Better::Lower, [1.0, 0.5, 0.2], (100.0, Bound::Lower)),
            (Better::Higher, [0.0, 0.1, 0.2], (10.0, Bound::Exact)),
            (Better::Higher, [0.0, 0.05, 0.09], (100.0, Bound::Lower)),
            // A signed error counts by its size.
            (Better::NearZero, [-1.0, -0.1, 0.01], (10.0, Bound::Exact)),
            (Better::NearZero, [-1.0, -0.5, -0.2], (100.0, Bound::Lower)),
            (
                Better::NearZero,
                [1.0, -1.0, 0.01],
                (10f64.powf(1.5), Bound::Exact),
            ),
        ] {
            let expected = ((expected.0 * 1e6).round() / 1e6, expected.1);
            assert_eq!(time(better, values), expected, "{better:?} {values:?}");
        }
        assert_eq!(time_to(Better::Lower, &[], 0.1), None);
    }
}
