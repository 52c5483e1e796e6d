//! Static analysis of stop rules: whether a rule is valid, whether it must end a run, and when.

use super::StopRule;
use lumbre_light::value::suggest;

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
        reason: &'static str,
    },
}

impl StopRule {
    /// Checks the rule for a run that measures `columns`; `measured` is whether it has a reference
    /// to measure them against.
    ///
    /// # Errors
    /// When a combination is empty, an argument is out of range, a column is unknown, or the rule
    /// can never hold.
    pub fn validate(&self, columns: &[String], measured: bool) -> Result<(), StopError> {
        self.validate_parts(columns)?;
        if self.is_possible(measured) {
            return Ok(());
        }
        let reason = if measured {
            "its clauses exclude one another"
        } else {
            "there is no reference to measure against"
        };
        Err(StopError::Never {
            rule: self.describe(),
            reason,
        })
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

    /// Whether the rule can hold for some measurements.
    fn is_possible(&self, measured: bool) -> bool {
        match self {
            StopRule::When { .. } | StopRule::Plateau { .. } => measured,
            StopRule::Any(parts) => parts.iter().any(|p| p.is_possible(measured)),
            StopRule::All(parts) => parts.iter().all(|p| p.is_possible(measured)),
            StopRule::Not(part) => !part.is_certain(measured),
            _ => true,
        }
    }

    /// Whether the rule holds for all measurements.
    fn is_certain(&self, measured: bool) -> bool {
        match self {
            StopRule::Time(s) => *s <= 0.0,
            StopRule::Samples(n) | StopRule::Waves(n) => *n <= 1,
            StopRule::Any(parts) => parts.iter().any(|p| p.is_certain(measured)),
            StopRule::All(parts) => parts.iter().all(|p| p.is_certain(measured)),
            StopRule::Not(part) => !part.is_possible(measured),
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

/// Makes the error for a column that is not measured, with a suggestion.
fn unknown_column(column: &str, columns: &[String]) -> StopError {
    let help = match suggest::nearest(column, columns.iter().map(String::as_str)) {
        Some(near) => format!("did you mean `{near}`?"),
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
    use super::super::Comparison;
    use super::*;
    use StopRule::{All, Any, Nan, Predicate, Samples, Time, Waves};

    fn when(column: &str) -> StopRule {
        StopRule::When {
            column: column.into(),
            op: Comparison::Less,
            value: 0.1,
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
        let columns = ["rmse".to_owned(), "ssim".to_owned()];
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
                "uses `flip`, which is not measured (measured: rmse, ssim)",
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
