//! Stop rules as data: evaluation, validation and guaranteed limits ([`limits`]), descriptions and
//! the canonical form ([`format`](mod@format)), and reading that form ([`parse`]).

mod format;
mod limits;
mod parse;
mod plateau;

pub use limits::StopError;

use super::hook_error::HookError;
use super::outcome::{EndCause, WaveRow};
use lumbre_metrics::MetricSpec;
use plateau::Slope;

/// Comparison of a metric with a threshold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Comparison {
    /// Less than, `<`.
    Less,
    /// Less than or equal to, `<=`.
    LessEqual,
    /// Greater than, `>`.
    Greater,
    /// Greater than or equal to, `>=`.
    GreaterEqual,
}

impl Comparison {
    /// Whether the comparison of `a` with `b` holds; false if either is NaN.
    pub fn holds(self, a: f64, b: f64) -> bool {
        match self {
            Comparison::Less => a < b,
            Comparison::LessEqual => a <= b,
            Comparison::Greater => a > b,
            Comparison::GreaterEqual => a >= b,
        }
    }

    /// Operator as written in scripts.
    pub fn symbol(self) -> &'static str {
        match self {
            Comparison::Less => "<",
            Comparison::LessEqual => "<=",
            Comparison::Greater => ">",
            Comparison::GreaterEqual => ">=",
        }
    }
}

/// Rule that determines when a run is finished.
#[derive(Clone, Debug, PartialEq)]
pub enum StopRule {
    /// At least this many seconds of render time were spent.
    Time(f64),
    /// Every pixel has this many samples. Waves are sized so that the number is exact.
    Samples(u64),
    /// This many waves were rendered.
    Waves(u64),
    /// A metric fulfils a comparison in `hold` consecutive measurements.
    When {
        /// Column of the metric.
        column: String,
        /// Comparison with the threshold.
        op: Comparison,
        /// Threshold in units of the metric.
        value: f64,
        /// Number of consecutive measurements.
        hold: u32,
    },
    /// The error of a metric has stopped falling. Over the last factor `over` of render time, its
    /// exponent as a power of time is significantly greater than `exponent`.
    Plateau {
        /// Column of the metric.
        column: String,
        /// Exponent of render time, below 0, that counts as still falling; a Monte Carlo error has
        /// -0.5.
        exponent: f64,
        /// Factor of render time, above 1, over which the exponent is estimated: 4 is the last
        /// three quarters.
        over: f64,
        /// Significance level, above 0 and below 1.
        p: f64,
    },
    /// At least this many invalid (NaN or infinite) samples occurred.
    Nan(u64),
    /// A function of the script returns true. The number is assigned by the script module.
    Predicate(usize),
    /// Any of these rules holds; the first one is the reason.
    Any(Vec<StopRule>),
    /// All of these rules hold.
    All(Vec<StopRule>),
    /// This rule does not hold.
    Not(Box<StopRule>),
}

impl StopRule {
    /// Calls a function on the rule and on every rule within it, outer rules first.
    pub fn visit<'a>(&'a self, visitor: &mut dyn FnMut(&'a StopRule)) {
        visitor(self);
        match self {
            StopRule::Any(parts) | StopRule::All(parts) => {
                parts.iter().for_each(|part| part.visit(visitor))
            }
            StopRule::Not(part) => part.visit(visitor),
            _ => {}
        }
    }

    /// Returns the rule with this part of its times, samples and waves, at least one of each.
    /// Thresholds of metrics and functions of the script stay.
    pub fn divided(self, by: u64) -> StopRule {
        let all = |parts: Vec<StopRule>| parts.into_iter().map(|part| part.divided(by)).collect();
        match self {
            StopRule::Time(seconds) => StopRule::Time(seconds / by as f64),
            StopRule::Samples(samples) => StopRule::Samples(samples.div_ceil(by)),
            StopRule::Waves(waves) => StopRule::Waves(waves.div_ceil(by)),
            StopRule::Any(parts) => StopRule::Any(all(parts)),
            StopRule::All(parts) => StopRule::All(all(parts)),
            StopRule::Not(part) => StopRule::Not(Box::new(part.divided(by))),
            StopRule::When { .. }
            | StopRule::Plateau { .. }
            | StopRule::Nan(_)
            | StopRule::Predicate(_) => self,
        }
    }

    /// Evaluates the rule after the measurements `rows`, oldest first. Returns the clause that
    /// holds, or `None` if none does.
    ///
    /// The result depends on the rows alone, so a run that is read back from disk is treated like a
    /// live one. A comparison with a metric that was not measured or is NaN is false. `metrics` are
    /// those of the rows. `predicate` calls a predicate of the script; predicates are evaluated
    /// from left to right with short-circuiting.
    ///
    /// # Errors
    /// When a predicate fails.
    pub fn check(
        &self,
        rows: &[WaveRow],
        metrics: &[MetricSpec],
        predicate: &mut dyn FnMut(usize) -> Result<bool, HookError>,
    ) -> Result<Option<EndCause>, HookError> {
        let Some(last) = rows.last() else {
            return Ok(None);
        };
        let holds = match self {
            StopRule::Time(seconds) => last.render_s >= *seconds,
            StopRule::Samples(samples) => last.samples >= *samples,
            StopRule::Waves(waves) => last.wave >= *waves,
            StopRule::Nan(count) => last.invalid >= *count,
            StopRule::Predicate(id) => predicate(*id)?,
            StopRule::When {
                column,
                op,
                value,
                hold,
            } => {
                let index = metrics.iter().position(|m| m.column == *column);
                let measured = |row: &WaveRow| index.and_then(|i| row.metrics.get(i)).copied();
                let hold = *hold as usize;
                let recent = &rows[rows.len().saturating_sub(hold)..];
                recent.len() == hold
                    && recent
                        .iter()
                        .all(|row| measured(row).is_some_and(|x| op.holds(x, *value)))
            }
            StopRule::Plateau {
                column,
                exponent,
                over,
                p,
            } => {
                let index = metrics.iter().position(|m| m.column == *column);
                let error =
                    |row: &WaveRow| index.and_then(|i| metrics[i].distance(*row.metrics.get(i)?));
                Slope::estimate(rows, *over, error)
                    .is_some_and(|slope| slope.p_steeper(*exponent) < *p)
            }
            StopRule::Any(parts) => {
                for part in parts {
                    if let Some(cause) = part.check(rows, metrics, predicate)? {
                        return Ok(Some(cause));
                    }
                }
                return Ok(None);
            }
            StopRule::All(parts) => {
                let mut causes = Vec::new();
                for part in parts {
                    match part.check(rows, metrics, predicate)? {
                        Some(cause) => causes.push(cause),
                        None => return Ok(None),
                    }
                }
                let is_limit = causes.len() == 1 && causes[0].is_limit;
                let clauses: Vec<String> = causes.into_iter().map(|c| c.clause).collect();
                return Ok((!clauses.is_empty()).then(|| EndCause {
                    clause: clauses.join(", and "),
                    is_limit,
                }));
            }
            StopRule::Not(part) => part.check(rows, metrics, predicate)?.is_none(),
        };
        Ok(holds.then(|| EndCause {
            clause: self.describe(),
            is_limit: matches!(self, StopRule::Time(_) | StopRule::Samples(_)),
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(ssim: &[f64]) -> Vec<WaveRow> {
        let row = |(i, x): (usize, &f64)| WaveRow {
            wave: i as u64 + 1,
            samples: 4 * (i as u64 + 1),
            render_s: 0.5 * (i as f64 + 1.0),
            invalid: i as u64 / 2,
            metrics: vec![100.0 - i as f64, *x],
            ..WaveRow::default()
        };
        ssim.iter().enumerate().map(row).collect()
    }

    fn specs<const N: usize>(names: [&str; N]) -> Vec<MetricSpec> {
        names
            .map(|name| MetricSpec::new(name, name, Default::default()).unwrap())
            .into()
    }

    fn above(hold: u32) -> StopRule {
        StopRule::When {
            column: "ssim".into(),
            op: Comparison::Greater,
            value: 0.95,
            hold,
        }
    }

    fn not(rule: StopRule) -> StopRule {
        StopRule::Not(Box::new(rule))
    }

    fn reason(rule: &StopRule, ssim: &[f64]) -> Option<String> {
        let cause = rule.check(&rows(ssim), &specs(["rmse", "ssim"]), &mut |id| Ok(id == 1));
        cause.unwrap().map(|cause| cause.clause)
    }

    #[test]
    fn every_rule_on_fake_measurements() {
        use StopRule::{All, Any, Nan, Predicate, Samples, Time, Waves};
        let climbing = [0.2, 0.96, 0.94, 0.97, 0.98, 0.99];
        let cases: &[(StopRule, &[f64], bool)] = &[
            (Time(1.0), &climbing[..1], false),
            (Time(1.0), &climbing[..2], true),
            (Samples(8), &climbing[..1], false),
            (Samples(8), &climbing[..2], true),
            (Waves(3), &climbing[..2], false),
            (Waves(3), &climbing[..3], true),
            (Nan(1), &climbing[..2], false),
            (Nan(1), &climbing[..3], true),
            (Predicate(0), &climbing, false),
            (Predicate(1), &climbing, true),
            (above(1), &climbing[..1], false),
            (above(1), &climbing[..2], true),
            (above(2), &climbing[..4], false),
            (above(2), &climbing[..5], true),
            (above(3), &climbing[..5], false),
            (above(3), &climbing, true),
            (above(3), &[0.99, 0.99], false),
            (above(1), &[f64::NAN], false),
            (not(above(1)), &[f64::NAN], true),
            (not(above(1)), &[0.99], false),
            (Any(vec![above(1), Time(1.0)]), &[0.1], false),
            (Any(vec![above(1), Time(1.0)]), &[0.1, 0.1], true),
            (All(vec![above(1), Time(1.0)]), &[0.1, 0.1], false),
            (All(vec![above(1), Time(1.0)]), &[0.99], false),
            (All(vec![above(1), Time(1.0)]), &[0.1, 0.99], true),
            (All(vec![not(Samples(8)), Nan(0)]), &[0.1], true),
            (All(vec![not(Samples(8)), Nan(0)]), &[0.1, 0.1], false),
            (not(not(Samples(8))), &[0.1, 0.1], true),
            (Any(vec![]), &climbing, false),
            (All(vec![]), &climbing, false),
            (Time(0.0), &[], false),
            (not(Time(1.0)), &[], false),
        ];
        for (rule, ssim, expected) in cases {
            assert_eq!(
                reason(rule, ssim).is_some(),
                *expected,
                "{rule:?} after {ssim:?}"
            );
        }
    }

    #[test]
    fn a_plateau_is_where_the_error_stops_falling() {
        let plateau = StopRule::Plateau {
            column: "ssim".into(),
            exponent: -0.1,
            over: 4.0,
            p: 0.01,
        };
        let ssim = |error: &dyn Fn(f64) -> f64| -> Vec<f64> {
            // A ripple provides the residuals from which significance is estimated.
            (1..=64)
                .map(|n| 1.0 - error(0.5 * f64::from(n)) * (1.0 + 0.001 * f64::from(n % 3)))
                .collect()
        };
        let (falls, stays) = (
            ssim(&|t| 0.2 / t.sqrt()),
            ssim(&|t| (0.01 / t + 0.01).sqrt()),
        );
        assert_eq!(reason(&plateau, &falls), None);
        assert_eq!(
            reason(&plateau, &stays).unwrap(),
            "the error of ssim falls more slowly than time^-0.1 over the last factor of 4 in \
             render time (p < 0.01)"
        );
        assert_eq!(reason(&plateau, &stays[..6]), None, "too early to tell");
    }

    #[test]
    fn the_reason_names_the_clause_that_held() {
        let rule = StopRule::Any(vec![above(2), StopRule::Time(1.0), StopRule::Samples(8)]);
        assert_eq!(reason(&rule, &[0.1, 0.2]).unwrap(), "1 s of render time");
        assert_eq!(
            reason(&rule, &[0.96, 0.97]).unwrap(),
            "ssim > 0.95 held for 2 measurements"
        );
        let rule = StopRule::All(vec![StopRule::Samples(8), not(above(1))]);
        assert_eq!(
            reason(&rule, &[0.1, 0.2]).unwrap(),
            "8 samples per pixel, and not (ssim > 0.95)"
        );
    }

    #[test]
    fn one_limit_alone_ends_a_run_by_a_limit() {
        let is_limit = |rule: StopRule| {
            let cause = rule.check(&rows(&[0.96, 0.97]), &specs(["rmse", "ssim"]), &mut |_| {
                Ok(true)
            });
            cause.unwrap().unwrap().is_limit
        };
        let (time, samples) = (StopRule::Time(1.0), StopRule::Samples(8));
        assert!(is_limit(time.clone()) && is_limit(samples.clone()));
        assert!(!is_limit(above(2)) && !is_limit(StopRule::Waves(2)));
        let later = StopRule::Time(9.0);
        for (parts, expected) in [
            (vec![time.clone(), above(2)], true),
            (vec![later.clone(), samples.clone()], true),
            (vec![later, above(2)], false),
        ] {
            assert_eq!(
                is_limit(StopRule::Any(parts.clone())),
                expected,
                "{parts:?}"
            );
        }
        assert!(is_limit(StopRule::All(vec![samples.clone()])));
        for parts in [vec![samples.clone(), above(2)], vec![time, samples]] {
            assert!(!is_limit(StopRule::All(parts.clone())), "{parts:?}");
        }
    }

    #[test]
    fn a_comparison_with_an_unmeasured_metric_is_false() {
        let unmeasured = [WaveRow {
            wave: 1,
            samples: 1,
            ..WaveRow::default()
        }];
        assert!(
            above(1)
                .check(&unmeasured, &specs(["ssim"]), &mut |_| Ok(true))
                .unwrap()
                .is_none()
        );
        assert!(
            above(1)
                .check(&rows(&[0.99]), &specs(["psnr"]), &mut |_| Ok(true))
                .unwrap()
                .is_none()
        );
    }

    #[test]
    fn predicates_are_short_circuited_and_their_errors_are_returned() {
        let mut asked = Vec::new();
        let rule = StopRule::Any(vec![StopRule::Time(0.5), StopRule::Predicate(4)]);
        rule.check(&rows(&[0.1]), &[], &mut |id| {
            asked.push(id);
            Ok(false)
        })
        .unwrap();
        assert!(asked.is_empty());
        let fails = StopRule::Predicate(4).check(&rows(&[0.1]), &[], &mut |_| {
            Err(HookError("no such field".into()))
        });
        assert_eq!(fails.unwrap_err().to_string(), "no such field");
    }
}
