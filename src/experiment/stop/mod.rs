//! Stop rules as data: what they mean, when they can be relied on to end ([`limits`]), and how they read ([`words`], [`read`]).

mod limits;
mod plateau;
mod read;
mod words;

pub use limits::StopError;

use super::event::WaveRow;
use super::spec::HookError;
use crate::metrics::MetricSpec;
use plateau::Slope;

/// How a threshold is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Comparison {
    /// `<`
    Less,
    /// `<=`
    LessEqual,
    /// `>`
    Greater,
    /// `>=`
    GreaterEqual,
}

impl Comparison {
    /// Whether `a` compares with `b` in this way; never when either is not a number.
    pub fn holds(self, a: f64, b: f64) -> bool {
        match self {
            Comparison::Less => a < b,
            Comparison::LessEqual => a <= b,
            Comparison::Greater => a > b,
            Comparison::GreaterEqual => a >= b,
        }
    }

    /// The sign as scripts write it.
    pub fn symbol(self) -> &'static str {
        match self {
            Comparison::Less => "<",
            Comparison::LessEqual => "<=",
            Comparison::Greater => ">",
            Comparison::GreaterEqual => ">=",
        }
    }
}

/// When a cell is finished.
#[derive(Clone, Debug, PartialEq)]
pub enum StopRule {
    /// Render time in seconds has been spent.
    Time(f64),
    /// Every pixel has this many samples; waves are cut so that it is exact.
    Samples(u64),
    /// This many waves were rendered.
    Waves(u64),
    /// A metric compares with a value in `hold` consecutive measurements.
    When {
        /// Metric column.
        column: String,
        /// Comparison.
        op: Comparison,
        /// Threshold.
        value: f64,
        /// Consecutive measurements.
        hold: u32,
    },
    /// A metric's error has stopped falling: over the last factor `over` of render time, its exponent is significantly
    /// greater than `exponent`.
    Plateau {
        /// Metric column.
        column: String,
        /// The exponent of render time below which an error still falls; a Monte Carlo error has -0.5.
        exponent: f64,
        /// How far back it is looked, as a factor of render time above 1.
        over: f64,
        /// The probability at which chance is ruled out, above 0 and below 1.
        p: f64,
    },
    /// At least this many invalid (NaN or infinite) samples were met.
    Nan(u64),
    /// A function of the script says so; the number is the script room's own.
    Predicate(usize),
    /// Any of these; the first that holds is the reason.
    Any(Vec<StopRule>),
    /// All of these.
    All(Vec<StopRule>),
    /// Not this.
    Not(Box<StopRule>),
}

impl StopRule {
    /// Shows the rule and every part of it, parts after what they are part of.
    pub fn visit<'a>(&'a self, see: &mut dyn FnMut(&'a StopRule)) {
        see(self);
        match self {
            StopRule::Any(parts) | StopRule::All(parts) => parts.iter().for_each(|part| part.visit(see)),
            StopRule::Not(part) => part.visit(see),
            _ => {}
        }
    }

    /// Whether the rule holds after the measurements `rows` (oldest first), and if so, why, in words.
    ///
    /// The answer depends on the rows alone, so a run that is read back from disk is judged like a live one. A metric
    /// that was not measured, or is not a number, never compares. `metrics` are those of the rows; `ask` calls the
    /// script's predicates, from left to right and only as long as the parts before leave the answer open.
    ///
    /// # Errors
    /// When a predicate fails.
    pub fn check(
        &self,
        rows: &[WaveRow],
        metrics: &[MetricSpec],
        ask: &mut dyn FnMut(usize) -> Result<bool, HookError>,
    ) -> Result<Option<String>, HookError> {
        let Some(last) = rows.last() else { return Ok(None) };
        let holds = match self {
            StopRule::Time(seconds) => last.render_s >= *seconds,
            StopRule::Samples(samples) => last.samples >= *samples,
            StopRule::Waves(waves) => last.wave >= *waves,
            StopRule::Nan(count) => last.invalid >= *count,
            StopRule::Predicate(id) => ask(*id)?,
            StopRule::When { column, op, value, hold } => {
                let place = metrics.iter().position(|m| m.column == *column);
                let measured = |row: &WaveRow| place.and_then(|i| row.metrics.get(i)).copied();
                let hold = *hold as usize;
                let recent = &rows[rows.len().saturating_sub(hold)..];
                recent.len() == hold && recent.iter().all(|row| measured(row).is_some_and(|x| op.holds(x, *value)))
            }
            StopRule::Plateau { column, exponent, over, p } => {
                let place = metrics.iter().position(|m| m.column == *column);
                let error = |row: &WaveRow| place.and_then(|i| metrics[i].distance(*row.metrics.get(i)?));
                Slope::of(rows, *over, error).is_some_and(|slope| slope.p_steeper(*exponent) < *p)
            }
            StopRule::Any(parts) => {
                for part in parts {
                    if let Some(reason) = part.check(rows, metrics, ask)? {
                        return Ok(Some(reason));
                    }
                }
                return Ok(None);
            }
            StopRule::All(parts) => {
                let mut reasons = Vec::new();
                for part in parts {
                    match part.check(rows, metrics, ask)? {
                        Some(reason) => reasons.push(reason),
                        None => return Ok(None),
                    }
                }
                return Ok((!reasons.is_empty()).then(|| reasons.join(", and ")));
            }
            StopRule::Not(part) => part.check(rows, metrics, ask)?.is_none(),
        };
        Ok(holds.then(|| self.describe()))
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
        names.map(|name| MetricSpec::new(name, name, Default::default()).unwrap()).into()
    }

    fn above(hold: u32) -> StopRule {
        StopRule::When { column: "ssim".into(), op: Comparison::Greater, value: 0.95, hold }
    }

    fn not(rule: StopRule) -> StopRule {
        StopRule::Not(Box::new(rule))
    }

    fn reason(rule: &StopRule, ssim: &[f64]) -> Option<String> {
        rule.check(&rows(ssim), &specs(["rmse", "ssim"]), &mut |id| Ok(id == 1)).unwrap()
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
            assert_eq!(reason(rule, ssim).is_some(), *expected, "{rule:?} after {ssim:?}");
        }
    }

    #[test]
    fn a_plateau_is_where_the_logarithm_of_the_error_stays() {
        let plateau = StopRule::Plateau { column: "ssim".into(), exponent: -0.1, over: 4.0, p: 0.01 };
        let ssim = |error: &dyn Fn(f64) -> f64| -> Vec<f64> {
            // A ripple, so that there is something from which significance can be told.
            (1..=64).map(|n| 1.0 - error(0.5 * f64::from(n)) * (1.0 + 0.001 * f64::from(n % 3))).collect()
        };
        let (falls, stays) = (ssim(&|t| 0.2 / t.sqrt()), ssim(&|t| (0.01 / t + 0.01).sqrt()));
        assert_eq!(reason(&plateau, &falls), None);
        assert_eq!(
            reason(&plateau, &stays).unwrap(),
            "the error of ssim falls more slowly than time to the power -0.1 over the last factor 4 (p < 0.01)"
        );
        assert_eq!(reason(&plateau, &stays[..6]), None, "too early to tell");
    }

    #[test]
    fn the_reason_names_the_part_that_held() {
        let rule = StopRule::Any(vec![above(2), StopRule::Time(1.0), StopRule::Samples(8)]);
        assert_eq!(reason(&rule, &[0.1, 0.2]).unwrap(), "1 s of render time");
        assert_eq!(reason(&rule, &[0.96, 0.97]).unwrap(), "ssim > 0.95 held for 2 measurements");
        let rule = StopRule::All(vec![StopRule::Samples(8), not(above(1))]);
        assert_eq!(reason(&rule, &[0.1, 0.2]).unwrap(), "8 samples per pixel, and not (ssim > 0.95)");
    }

    #[test]
    fn a_metric_that_was_not_measured_never_compares() {
        let unmeasured = [WaveRow { wave: 1, samples: 1, ..WaveRow::default() }];
        assert!(above(1).check(&unmeasured, &specs(["ssim"]), &mut |_| Ok(true)).unwrap().is_none());
        assert!(above(1).check(&rows(&[0.99]), &specs(["psnr"]), &mut |_| Ok(true)).unwrap().is_none());
    }

    #[test]
    fn predicates_are_asked_only_while_the_answer_is_open_and_their_errors_surface() {
        let mut asked = Vec::new();
        let rule = StopRule::Any(vec![StopRule::Time(0.5), StopRule::Predicate(4)]);
        rule.check(&rows(&[0.1]), &[], &mut |id| {
            asked.push(id);
            Ok(false)
        })
        .unwrap();
        assert!(asked.is_empty());
        let fails = StopRule::Predicate(4).check(&rows(&[0.1]), &[], &mut |_| Err(HookError("no such field".into())));
        assert_eq!(fails.unwrap_err().to_string(), "no such field");
    }
}
