//! Static analysis of stop rules: whether a rule is valid, whether it must end a run, and when.

use super::{Comparison, StopRule};
use lumbre_light::value::suggest;
use lumbre_metrics::{Better, METRICS, MetricSpec};

/// Why a stop rule is invalid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StopError {
    /// `any` or `all` without rules.
    #[error("`stop.{combinator}` is empty: it needs at least one rule")]
    Empty {
        /// Name of the combinator, `any` or `all`.
        combinator: &'static str,
    },
    /// An argument out of range.
    #[error("`{rule}` is not a valid stop rule: {expected}")]
    Amount {
        /// Description of the rule.
        rule: String,
        /// Condition that the argument must fulfil.
        expected: &'static str,
    },
    /// A metric that is not measured.
    #[error("the stop rule uses `{column}`, which is not measured ({help})")]
    UnknownColumn {
        /// Column as written.
        column: String,
        /// The most similar column, or all of them.
        help: String,
    },
    /// A rule that no measurement can fulfil.
    #[error("`{rule}` can never hold: {reason}")]
    Never {
        /// Description of the rule.
        rule: String,
        /// Reason why it cannot hold.
        reason: String,
    },
}

impl StopRule {
    /// Checks the rule for a run that measures `metrics`; `measured` is whether it has a reference
    /// to measure them against.
    ///
    /// # Errors
    /// When a combination is empty, an argument is out of range, a column is unknown, or the rule
    /// can never hold.
    pub fn validate(&self, metrics: &[MetricSpec], measured: bool) -> Result<(), StopError> {
        let columns: Vec<String> = metrics.iter().map(|m| m.column.clone()).collect();
        self.validate_parts(&columns)?;
        let reason = if let Some(reason) = self.unreachable(metrics) {
            reason
        } else if self.is_possible(measured.then_some(metrics)) {
            return Ok(());
        } else if measured {
            "its clauses exclude one another".to_owned()
        } else {
            "there is no reference to measure against".to_owned()
        };
        Err(StopError::Never {
            rule: self.describe(),
            reason,
        })
    }

    /// Returns a sentence on the first threshold in the rule that no value of its metric reaches.
    /// Beside other clauses it is a mistake too, since it never ends a run.
    fn unreachable(&self, metrics: &[MetricSpec]) -> Option<String> {
        match self {
            StopRule::When { column, .. } if !self.is_possible(Some(metrics)) => {
                let metric = metrics.iter().find(|m| m.column == *column)?;
                Some(format!(
                    "the best value of `{column}` is {}",
                    metric.row.perfect
                ))
            }
            StopRule::Any(parts) | StopRule::All(parts) => {
                parts.iter().find_map(|part| part.unreachable(metrics))
            }
            _ => None,
        }
    }

    /// Checks arguments and columns of the rule and of all rules within it.
    fn validate_parts(&self, columns: &[String]) -> Result<(), StopError> {
        let amount = |valid: bool, expected: &'static str| {
            if valid {
                Ok(())
            } else {
                Err(StopError::Amount {
                    rule: self.describe(),
                    expected,
                })
            }
        };
        match self {
            StopRule::Time(s) => amount(
                s.is_finite() && *s >= 0.0,
                "the time must be finite and not negative",
            ),
            StopRule::Samples(n) | StopRule::Waves(n) | StopRule::Nan(n) => {
                amount(*n > 0, "the count must be at least 1")
            }
            StopRule::When {
                column,
                value,
                hold,
                ..
            } => {
                if !columns.contains(column) {
                    return Err(unknown_column(column, columns));
                }
                amount(*hold > 0, "`hold` must be at least 1")?;
                amount(!value.is_nan(), "the threshold must not be NaN")
            }
            StopRule::Plateau {
                column,
                exponent,
                over,
                p,
            } => {
                if !columns.contains(column) {
                    return Err(unknown_column(column, columns));
                }
                amount(
                    *exponent < 0.0 && exponent.is_finite(),
                    "the exponent must be below 0",
                )?;
                amount(
                    *over > 1.0 && over.is_finite(),
                    "the factor must be above 1",
                )?;
                amount(
                    *p > 0.0 && *p < 1.0,
                    "the probability must be above 0 and below 1",
                )
            }
            StopRule::Predicate(_) => Ok(()),
            StopRule::Any(parts) | StopRule::All(parts) => {
                if parts.is_empty() {
                    let combinator = if matches!(self, StopRule::Any(_)) {
                        "any"
                    } else {
                        "all"
                    };
                    return Err(StopError::Empty { combinator });
                }
                parts
                    .iter()
                    .try_for_each(|part| part.validate_parts(columns))
            }
            StopRule::Not(part) => part.validate_parts(columns),
        }
    }

    /// Whether the rule can hold for some measurements. Without metrics nothing is measured.
    fn is_possible(&self, metrics: Option<&[MetricSpec]>) -> bool {
        match self {
            StopRule::When {
                column, op, value, ..
            } => {
                let metric = metrics.and_then(|all| all.iter().find(|m| m.column == *column));
                metric.is_some_and(|metric| is_reachable(metric, *op, *value))
            }
            StopRule::Plateau { .. } => metrics.is_some(),
            StopRule::Any(parts) => parts.iter().any(|p| p.is_possible(metrics)),
            StopRule::All(parts) => parts.iter().all(|p| p.is_possible(metrics)),
            StopRule::Not(part) => !part.is_certain(metrics),
            _ => true,
        }
    }

    /// Whether the rule holds for all measurements.
    fn is_certain(&self, metrics: Option<&[MetricSpec]>) -> bool {
        match self {
            StopRule::Time(s) => *s <= 0.0,
            StopRule::Samples(n) | StopRule::Waves(n) => *n <= 1,
            StopRule::Any(parts) => parts.iter().any(|p| p.is_certain(metrics)),
            StopRule::All(parts) => parts.iter().all(|p| p.is_certain(metrics)),
            StopRule::Not(part) => !part.is_possible(metrics),
            _ => false,
        }
    }

    /// Whether the rule ends every run eventually, whatever is measured.
    pub fn must_end(&self) -> bool {
        let leaf = |rule: &StopRule| match rule {
            StopRule::Time(_) | StopRule::Samples(_) | StopRule::Waves(_) => Some(()),
            _ => None,
        };
        self.limit(false, &leaf).is_some()
    }

    /// Smallest number of samples per pixel that is certain to end the run, if there is one.
    pub fn sample_limit(&self) -> Option<u64> {
        self.limit(false, &|rule| {
            if let StopRule::Samples(n) = rule {
                Some(*n)
            } else {
                None
            }
        })
    }

    /// Smallest render time in seconds that is certain to end the run, if there is one.
    pub fn time_limit_s(&self) -> Option<f64> {
        self.limit(false, &|rule| {
            if let StopRule::Time(s) = rule {
                Some(*s)
            } else {
                None
            }
        })
    }

    /// Next number of samples per pixel above `current` that occurs in the rule. Waves that end at
    /// these numbers let every sample limit be met exactly.
    pub fn next_sample_mark(&self, current: u64) -> Option<u64> {
        match self {
            StopRule::Samples(n) => (*n > current).then_some(*n),
            StopRule::Any(parts) | StopRule::All(parts) => parts
                .iter()
                .filter_map(|part| part.next_sample_mark(current))
                .min(),
            StopRule::Not(part) => part.next_sample_mark(current),
            _ => None,
        }
    }

    /// Amount at which the rule is certain to hold, given the amounts of its leaves. A leaf under
    /// an odd number of negations has none, since its negation holds early and not late. `any`
    /// takes the minimum of its rules, `all` the maximum, and a negation swaps the two.
    fn limit<T: PartialOrd + Copy>(
        &self,
        negated: bool,
        leaf: &dyn Fn(&StopRule) -> Option<T>,
    ) -> Option<T> {
        match self {
            StopRule::Not(part) => part.limit(!negated, leaf),
            StopRule::Any(parts) | StopRule::All(parts) => {
                let limits = parts.iter().map(|part| part.limit(negated, leaf));
                if matches!(self, StopRule::Any(_)) != negated {
                    limits.flatten().reduce(|a, b| if b < a { b } else { a })
                } else {
                    limits
                        .reduce(|a, b| a.zip(b).map(|(a, b)| if b > a { b } else { a }))
                        .flatten()
                }
            }
            _ if negated => None,
            _ => leaf(self),
        }
    }
}

/// Returns whether some value of a metric compares with a threshold as asked. Values end at the
/// perfect one.
fn is_reachable(metric: &MetricSpec, op: Comparison, threshold: f64) -> bool {
    let perfect = metric.row.perfect;
    let reaches_best = op.holds(perfect, threshold);
    match (metric.row.better, op) {
        (Better::Lower, Comparison::Less | Comparison::LessEqual)
        | (Better::Higher, Comparison::Greater | Comparison::GreaterEqual) => reaches_best,
        _ => true,
    }
}

/// Makes the error for a column that is not measured, with a suggestion.
fn unknown_column(column: &str, columns: &[String]) -> StopError {
    let help = match suggest::nearest(column, columns.iter().map(String::as_str)) {
        Some(near) => format!("did you mean `{near}`?"),
        None if !columns.is_empty() && METRICS.iter().any(|metric| metric.name == column) => {
            format!("add `{column} = metric.{column}()` to x:measure")
        }
        None if columns.is_empty() => "no metrics are measured here".to_owned(),
        None => format!("measured: {}", columns.join(", ")),
    };
    StopError::UnknownColumn {
        column: column.to_owned(),
        help,
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use StopRule::{All, Any, Nan, Predicate, Samples, Time, Waves};

    fn when(column: &str) -> StopRule {
        threshold(column, Comparison::Less, 0.1)
    }

    fn threshold(column: &str, op: Comparison, value: f64) -> StopRule {
        StopRule::When {
            column: column.into(),
            op,
            value,
            hold: 1,
        }
    }

    fn plateau(column: &str, over: f64) -> StopRule {
        StopRule::Plateau {
            column: column.into(),
            exponent: -0.1,
            over,
            p: 0.01,
        }
    }

    fn not(rule: StopRule) -> StopRule {
        StopRule::Not(Box::new(rule))
    }

    #[test]
    fn limits_follow_any_all_and_not() {
        let cases: &[(StopRule, Option<u64>, Option<f64>, bool)] = &[
            (Samples(8), Some(8), None, true),
            (Time(3.0), None, Some(3.0), true),
            (Waves(5), None, None, true),
            (when("rmse"), None, None, false),
            (plateau("rmse", 4.0), None, None, false),
            (Predicate(0), None, None, false),
            (Nan(1), None, None, false),
            (
                Any(vec![Samples(8), Samples(4), when("rmse")]),
                Some(4),
                None,
                true,
            ),
            (All(vec![Samples(8), Samples(4)]), Some(8), None, true),
            (All(vec![Samples(8), when("rmse")]), None, None, false),
            (All(vec![Samples(8), Time(2.0)]), None, None, true),
            (
                Any(vec![Time(9.0), All(vec![Time(2.0), Time(5.0)]), Samples(4)]),
                Some(4),
                Some(5.0),
                true,
            ),
            (not(Samples(8)), None, None, false),
            (not(not(Samples(8))), Some(8), None, true),
            (
                not(All(vec![not(Samples(8)), not(Samples(4))])),
                Some(4),
                None,
                true,
            ),
            (
                not(Any(vec![not(Samples(8)), not(Samples(4))])),
                Some(8),
                None,
                true,
            ),
        ];
        for (rule, samples, time, ends) in cases {
            assert_eq!(rule.sample_limit(), *samples, "{rule:?}");
            assert_eq!(rule.time_limit_s(), *time, "{rule:?}");
            assert_eq!(rule.must_end(), *ends, "{rule:?}");
        }
    }

    #[test]
    fn sample_marks_come_in_order() {
        let rule = All(vec![
            Samples(64),
            Any(vec![Samples(10), not(Samples(100))]),
            Time(1.0),
        ]);
        assert_eq!(rule.next_sample_mark(0), Some(10));
        assert_eq!(rule.next_sample_mark(10), Some(64));
        assert_eq!(rule.next_sample_mark(99), Some(100));
        assert_eq!(rule.next_sample_mark(100), None);
    }

    #[test]
    fn invalid_rules_are_rejected_with_a_reason() {
        let metric = |name: &str| MetricSpec::new(name, name, BTreeMap::new()).unwrap();
        let columns = [metric("rmse"), metric("ssim")];
        let cases: &[(StopRule, bool, &str)] = &[
            (
                Any(vec![]),
                true,
                "`stop.any` is empty: it needs at least one rule",
            ),
            (
                Any(vec![Time(1.0), All(vec![])]),
                true,
                "`stop.all` is empty: it needs at least one rule",
            ),
            (
                when("rsme"),
                true,
                "uses `rsme`, which is not measured (did you mean `rmse`?)",
            ),
            (
                when("flip"),
                true,
                "uses `flip`, which is not measured (add `flip = metric.flip()` to x:measure)",
            ),
            (
                when("noise"),
                true,
                "uses `noise`, which is not measured (measured: rmse, ssim)",
            ),
            (
                threshold("rmse", Comparison::Less, 0.0),
                true,
                "`rmse < 0` can never hold: the best value of `rmse` is 0",
            ),
            (
                Any(vec![
                    Time(1.0),
                    threshold("ssim", Comparison::GreaterEqual, 1.5),
                ]),
                true,
                "can never hold: the best value of `ssim` is 1",
            ),
            (
                when("rmse"),
                false,
                "`rmse < 0.1` can never hold: there is no reference to measure against",
            ),
            (All(vec![Time(1.0), when("rmse")]), false, "can never hold"),
            (
                not(Samples(1)),
                true,
                "can never hold: its clauses exclude one another",
            ),
            (Samples(0), true, "the count must be at least 1"),
            (Nan(0), true, "the count must be at least 1"),
            (Time(f64::INFINITY), true, "the time must be finite"),
            (Time(-1.0), true, "the time must be finite"),
            (
                plateau("flip", 4.0),
                true,
                "uses `flip`, which is not measured",
            ),
            (plateau("rmse", 1.0), true, "the factor must be above 1"),
            (
                plateau("rmse", 4.0),
                false,
                "can never hold: there is no reference",
            ),
        ];
        for (rule, measured, message) in cases {
            let error = rule.validate(&columns, *measured).unwrap_err().to_string();
            assert!(error.contains(message), "{rule:?}: {error}");
        }
        for rule in [
            when("rmse"),
            Any(vec![when("rmse"), Time(1.0)]),
            not(when("ssim")),
            threshold("rmse", Comparison::LessEqual, 0.0),
            threshold("ssim", Comparison::Less, 2.0),
            Time(0.0),
            Predicate(3),
        ] {
            assert_eq!(rule.validate(&columns, true), Ok(()), "{rule:?}");
        }
        assert_eq!(
            Any(vec![when("rmse"), Time(1.0)]).validate(&columns, false),
            Ok(())
        );
    }
}
