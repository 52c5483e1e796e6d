//! What can be said of a rule before anything renders: whether it makes sense, whether it must end, and when.

use super::StopRule;
use crate::value::suggest;

/// Why a stop rule makes no sense.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StopError {
    /// `any` or `all` of nothing.
    #[error("`stop.{combinator}` is empty: it needs at least one rule")]
    Empty {
        /// `any` or `all`.
        combinator: &'static str,
    },
    /// A count of zero, or a time that is negative or not finite.
    #[error("`{rule}` asks for nothing that can be waited for: {expected}")]
    Amount {
        /// The rule in words.
        rule: String,
        /// What was expected.
        expected: &'static str,
    },
    /// A metric that is not measured.
    #[error("the stop rule compares `{column}`, which is not measured ({help})")]
    UnknownColumn {
        /// The column as written.
        column: String,
        /// The nearest column, or all of them.
        help: String,
    },
    /// A rule that no measurement can fulfil.
    #[error("`{rule}` can never hold: {reason}")]
    Never {
        /// The rule in words.
        rule: String,
        /// Why.
        reason: &'static str,
    },
}

impl StopRule {
    /// Checks that the rule makes sense for a run that measures `columns`; `measured` says whether it has a reference
    /// to measure them against.
    ///
    /// # Errors
    /// An empty combination, an amount that cannot be waited for, an unknown column, or a rule that can never hold.
    pub fn validate(&self, columns: &[String], measured: bool) -> Result<(), StopError> {
        self.validate_parts(columns)?;
        if self.is_possible(measured) {
            return Ok(());
        }
        let reason =
            if measured { "its parts exclude one another" } else { "there is no reference to measure against" };
        Err(StopError::Never { rule: self.describe(), reason })
    }

    fn validate_parts(&self, columns: &[String]) -> Result<(), StopError> {
        let amount = |sane: bool, expected: &'static str| {
            if sane { Ok(()) } else { Err(StopError::Amount { rule: self.describe(), expected }) }
        };
        match self {
            StopRule::Time(s) => amount(s.is_finite() && *s >= 0.0, "a time is finite and not negative"),
            StopRule::Samples(n) | StopRule::Waves(n) | StopRule::Nan(n) => amount(*n > 0, "a count is at least 1"),
            StopRule::When { column, value, hold, .. } => {
                if !columns.contains(column) {
                    return Err(unknown_column(column, columns));
                }
                amount(*hold > 0, "`hold` is at least 1")?;
                amount(!value.is_nan(), "the threshold is a number")
            }
            StopRule::Plateau { column, exponent, over, p } => {
                if !columns.contains(column) {
                    return Err(unknown_column(column, columns));
                }
                amount(*exponent < 0.0 && exponent.is_finite(), "an exponent below 0")?;
                amount(*over > 1.0 && over.is_finite(), "a factor above 1")?;
                amount(*p > 0.0 && *p < 1.0, "a probability above 0 and below 1")
            }
            StopRule::Predicate(_) => Ok(()),
            StopRule::Any(parts) | StopRule::All(parts) => {
                if parts.is_empty() {
                    let combinator = if matches!(self, StopRule::Any(_)) { "any" } else { "all" };
                    return Err(StopError::Empty { combinator });
                }
                parts.iter().try_for_each(|part| part.validate_parts(columns))
            }
            StopRule::Not(part) => part.validate_parts(columns),
        }
    }

    /// Whether some measurement fulfils the rule.
    fn is_possible(&self, measured: bool) -> bool {
        match self {
            StopRule::When { .. } | StopRule::Plateau { .. } => measured,
            StopRule::Any(parts) => parts.iter().any(|p| p.is_possible(measured)),
            StopRule::All(parts) => parts.iter().all(|p| p.is_possible(measured)),
            StopRule::Not(part) => !part.is_certain(measured),
            _ => true,
        }
    }

    /// Whether every measurement fulfils the rule.
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

    /// Whether the rule must end every run sooner or later, whatever it measures.
    pub fn must_end(&self) -> bool {
        let leaf = |rule: &StopRule| match rule {
            StopRule::Time(_) | StopRule::Samples(_) | StopRule::Waves(_) => Some(()),
            _ => None,
        };
        self.limit(false, &leaf).is_some()
    }

    /// The smallest number of samples per pixel that ends the run for certain, if there is one.
    pub fn sample_limit(&self) -> Option<u64> {
        self.limit(false, &|rule| if let StopRule::Samples(n) = rule { Some(*n) } else { None })
    }

    /// The smallest render time in seconds that ends the run for certain, if there is one.
    pub fn time_limit_s(&self) -> Option<f64> {
        self.limit(false, &|rule| if let StopRule::Time(s) = rule { Some(*s) } else { None })
    }

    /// The next number of samples above `current` that the rule names anywhere; a wave that ended there exactly lets
    /// every part of the rule be met exactly.
    pub fn next_sample_mark(&self, current: u64) -> Option<u64> {
        match self {
            StopRule::Samples(n) => (*n > current).then_some(*n),
            StopRule::Any(parts) | StopRule::All(parts) => {
                parts.iter().filter_map(|part| part.next_sample_mark(current)).min()
            }
            StopRule::Not(part) => part.next_sample_mark(current),
            _ => None,
        }
    }

    /// The amount at which the rule holds for certain, given the amounts of its leaves. A leaf under an odd number of
    /// negations gives none: it holds early, not late. `any` ends with its first part, `all` with its last, and a
    /// negation swaps the two.
    fn limit<T: PartialOrd + Copy>(&self, negated: bool, leaf: &dyn Fn(&StopRule) -> Option<T>) -> Option<T> {
        match self {
            StopRule::Not(part) => part.limit(!negated, leaf),
            StopRule::Any(parts) | StopRule::All(parts) => {
                let limits = parts.iter().map(|part| part.limit(negated, leaf));
                if matches!(self, StopRule::Any(_)) != negated {
                    limits.flatten().reduce(|a, b| if b < a { b } else { a })
                } else {
                    limits.reduce(|a, b| a.zip(b).map(|(a, b)| if b > a { b } else { a })).flatten()
                }
            }
            _ if negated => None,
            _ => leaf(self),
        }
    }
}

fn unknown_column(column: &str, columns: &[String]) -> StopError {
    let help = match suggest::nearest(column, columns.iter().map(String::as_str)) {
        Some(near) => format!("did you mean `{near}`?"),
        None if columns.is_empty() => "nothing is measured here".to_owned(),
        None => format!("measured: {}", columns.join(", ")),
    };
    StopError::UnknownColumn { column: column.to_owned(), help }
}

#[cfg(test)]
mod tests {
    use super::super::Comparison;
    use super::*;
    use StopRule::{All, Any, Nan, Predicate, Samples, Time, Waves};

    fn when(column: &str) -> StopRule {
        StopRule::When { column: column.into(), op: Comparison::Less, value: 0.1, hold: 1 }
    }

    fn plateau(column: &str, over: f64) -> StopRule {
        StopRule::Plateau { column: column.into(), exponent: -0.1, over, p: 0.01 }
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
            (Any(vec![Samples(8), Samples(4), when("rmse")]), Some(4), None, true),
            (All(vec![Samples(8), Samples(4)]), Some(8), None, true),
            (All(vec![Samples(8), when("rmse")]), None, None, false),
            (All(vec![Samples(8), Time(2.0)]), None, None, true),
            (Any(vec![Time(9.0), All(vec![Time(2.0), Time(5.0)]), Samples(4)]), Some(4), Some(5.0), true),
            (not(Samples(8)), None, None, false),
            (not(not(Samples(8))), Some(8), None, true),
            (not(All(vec![not(Samples(8)), not(Samples(4))])), Some(4), None, true),
            (not(Any(vec![not(Samples(8)), not(Samples(4))])), Some(8), None, true),
        ];
        for (rule, samples, time, ends) in cases {
            assert_eq!(rule.sample_limit(), *samples, "{rule:?}");
            assert_eq!(rule.time_limit_s(), *time, "{rule:?}");
            assert_eq!(rule.must_end(), *ends, "{rule:?}");
        }
    }

    #[test]
    fn sample_marks_come_in_order() {
        let rule = All(vec![Samples(64), Any(vec![Samples(10), not(Samples(100))]), Time(1.0)]);
        assert_eq!(rule.next_sample_mark(0), Some(10));
        assert_eq!(rule.next_sample_mark(10), Some(64));
        assert_eq!(rule.next_sample_mark(99), Some(100));
        assert_eq!(rule.next_sample_mark(100), None);
    }

    #[test]
    fn senseless_rules_are_refused_with_a_reason() {
        let columns = ["rmse".to_owned(), "ssim".to_owned()];
        let cases: &[(StopRule, bool, &str)] = &[
            (Any(vec![]), true, "`stop.any` is empty: it needs at least one rule"),
            (Any(vec![Time(1.0), All(vec![])]), true, "`stop.all` is empty: it needs at least one rule"),
            (when("rsme"), true, "compares `rsme`, which is not measured (did you mean `rmse`?)"),
            (when("flip"), true, "compares `flip`, which is not measured (measured: rmse, ssim)"),
            (when("rmse"), false, "`rmse < 0.1` can never hold: there is no reference to measure against"),
            (All(vec![Time(1.0), when("rmse")]), false, "can never hold"),
            (not(Samples(1)), true, "can never hold: its parts exclude one another"),
            (Samples(0), true, "a count is at least 1"),
            (Nan(0), true, "a count is at least 1"),
            (Time(f64::INFINITY), true, "a time is finite"),
            (Time(-1.0), true, "a time is finite"),
            (plateau("flip", 4.0), true, "compares `flip`, which is not measured"),
            (plateau("rmse", 1.0), true, "a factor above 1"),
            (plateau("rmse", 4.0), false, "can never hold: there is no reference"),
        ];
        for (rule, measured, message) in cases {
            let error = rule.validate(&columns, *measured).unwrap_err().to_string();
            assert!(error.contains(message), "{rule:?}: {error}");
        }
        for rule in [when("rmse"), Any(vec![when("rmse"), Time(1.0)]), not(when("ssim")), Time(0.0), Predicate(3)] {
            assert_eq!(rule.validate(&columns, true), Ok(()), "{rule:?}");
        }
        assert_eq!(Any(vec![when("rmse"), Time(1.0)]).validate(&columns, false), Ok(()));
    }
}
