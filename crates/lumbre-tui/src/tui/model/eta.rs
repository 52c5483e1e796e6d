//! Progress of a run towards its stop rule, and an estimate of the remaining time.

use super::curve::Curve;
use lumbre_metrics::{Better, MetricSpec};
use lumbre_night::experiment::stop::Comparison;
use lumbre_night::experiment::{StopRule, WaveRow};

/// Estimated remaining time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Eta {
    /// Remaining time in seconds.
    pub seconds: f64,
    /// Whether the run may end earlier, because another condition of the rule (for example a
    /// predicate of the script) may be met first.
    pub at_most: bool,
    /// Whether the estimate extrapolates a power law fitted to the error so far.
    pub forecast: bool,
}

impl Eta {
    /// Returns the estimate for this run followed by `next`.
    pub fn then(self, next: Eta) -> Eta {
        Eta {
            seconds: self.seconds + next.seconds,
            at_most: self.at_most || next.at_most,
            forecast: self.forecast || next.forecast,
        }
    }
}

/// Error of a metric as a power law of render time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorPowerLaw {
    /// Natural logarithm of the error after one second.
    pub ln_a: f64,
    /// Exponent of render time.
    pub slope: f64,
    /// Best value of a metric that grows towards it, where the error is zero; `None` for errors.
    perfect: Option<f64>,
    /// Whether the metric is in dB: `-20 log10(error)`.
    decibel: bool,
}

impl ErrorPowerLaw {
    /// Converts a metric's value to an error that falls to zero.
    fn error(perfect: Option<f64>, decibel: bool, value: f64) -> f64 {
        match perfect {
            _ if decibel => 10f64.powf(-value / 20.0),
            Some(perfect) => perfect - value,
            None => value,
        }
    }

    /// Render time in seconds after which the metric satisfies `op value`; `None` if the power law
    /// never reaches it.
    pub fn seconds_until(&self, op: Comparison, value: f64) -> Option<f64> {
        let rising = self.decibel || self.perfect.is_some();
        let wanted = match op {
            Comparison::Less | Comparison::LessEqual => !rising,
            Comparison::Greater | Comparison::GreaterEqual => rising,
        };
        let error = ErrorPowerLaw::error(self.perfect, self.decibel, value);
        let sound = wanted && error > 0.0 && self.slope < -0.02;
        let seconds = ((error.ln() - self.ln_a) / self.slope).exp();
        (sound && seconds.is_finite()).then_some(seconds)
    }
}

/// Fits the error of the metric `column` over the last three doublings of render time.
pub fn fit(curve: &Curve, metrics: &[MetricSpec], column: &str) -> Option<ErrorPowerLaw> {
    let index = metrics.iter().position(|m| m.column == column)?;
    let row = metrics[index].row;
    let rising = row.better == Better::Higher;
    let (decibel, perfect) = (
        rising && row.unit == "dB",
        (rising && row.perfect.is_finite()).then_some(row.perfect),
    );
    if rising && !decibel && perfect.is_none() {
        return None;
    }
    let error = |row: &WaveRow| {
        Some(ErrorPowerLaw::error(
            perfect,
            decibel,
            *row.metrics.get(index)?,
        ))
    };
    let (ln_a, slope) = curve.fit(|row| row.render_s, error)?;
    Some(ErrorPowerLaw {
        ln_a,
        slope,
        perfect,
        decibel,
    })
}

/// Returns the completed fraction of `rule`, in `0..=1`, from its time, sample and wave limits.
pub fn fraction(rule: &StopRule, row: &WaveRow) -> Option<f64> {
    let share = |done: f64, whole: f64| {
        Some(if whole > 0.0 {
            (done / whole).clamp(0.0, 1.0)
        } else {
            1.0
        })
    };
    match rule {
        StopRule::Time(s) => share(row.render_s, *s),
        StopRule::Samples(n) => share(row.samples as f64, *n as f64),
        StopRule::Waves(n) => share(row.wave as f64, *n as f64),
        StopRule::When { .. }
        | StopRule::Plateau { .. }
        | StopRule::Nan(_)
        | StopRule::Predicate(_)
        | StopRule::Not(_) => None,
        StopRule::Any(rules) => rules
            .iter()
            .filter_map(|r| fraction(r, row))
            .reduce(f64::max),
        StopRule::All(rules) => rules
            .iter()
            .map(|r| fraction(r, row))
            .try_fold(1.0f64, |least, f| f.map(|f| least.min(f))),
    }
}

/// Estimates the remaining render time of a run from its time and sample limits, and from the
/// fitted `power_law` of each metric. Wave limits are ignored because waves grow in size.
pub fn render_left(
    rule: &StopRule,
    row: &WaveRow,
    power_law: &dyn Fn(&str) -> Option<ErrorPowerLaw>,
) -> Option<Eta> {
    let sure = |seconds: f64| {
        Some(Eta {
            seconds: seconds.max(0.0),
            ..Eta::default()
        })
    };
    match rule {
        StopRule::Time(s) => sure(s - row.render_s),
        StopRule::Samples(n) if row.samples > 0 => {
            sure(n.saturating_sub(row.samples) as f64 * row.render_s / row.samples as f64)
        }
        StopRule::When {
            column, op, value, ..
        } => {
            let seconds = (power_law(column)?.seconds_until(*op, *value)? - row.render_s).max(0.0);
            Some(Eta {
                seconds,
                at_most: false,
                forecast: true,
            })
        }
        StopRule::Any(rules) => left_of_any(rules, row, power_law),
        StopRule::All(rules) => left_of_all(rules, row, power_law),
        _ => None,
    }
}

/// Returns the smallest estimate of the rules; an upper bound if some rule has no estimate.
fn left_of_any(
    rules: &[StopRule],
    row: &WaveRow,
    power_law: &dyn Fn(&str) -> Option<ErrorPowerLaw>,
) -> Option<Eta> {
    let known: Vec<Eta> = rules
        .iter()
        .filter_map(|r| render_left(r, row, power_law))
        .collect();
    let least = known
        .iter()
        .copied()
        .reduce(|a, b| if b.seconds < a.seconds { b } else { a })?;
    // Invalid samples are rare, so a limit on them does not make the estimate less certain.
    let open = rules
        .iter()
        .any(|r| !matches!(r, StopRule::Nan(_)) && render_left(r, row, power_law).is_none());
    Some(Eta {
        at_most: least.at_most || open,
        ..least
    })
}

/// Returns the largest estimate of the rules; `None` if some rule has no estimate.
fn left_of_all(
    rules: &[StopRule],
    row: &WaveRow,
    power_law: &dyn Fn(&str) -> Option<ErrorPowerLaw>,
) -> Option<Eta> {
    rules
        .iter()
        .map(|r| render_left(r, row, power_law))
        .try_fold(Eta::default(), |most, eta| {
            let eta = eta?;
            let later = if eta.seconds > most.seconds {
                eta
            } else {
                most
            };
            Some(Eta {
                at_most: most.at_most || eta.at_most,
                forecast: most.forecast || eta.forecast,
                ..later
            })
        })
}

#[cfg(test)]
mod tests {
    use crate::tui::model::eta::*;
    use lumbre_night::experiment::stop::Comparison;

    fn row() -> WaveRow {
        WaveRow {
            wave: 3,
            samples: 64,
            render_s: 2.0,
            ..WaveRow::default()
        }
    }

    fn threshold() -> StopRule {
        StopRule::When {
            column: "rmse".into(),
            op: Comparison::Less,
            value: 0.01,
            hold: 1,
        }
    }

    #[test]
    fn limits_give_the_completed_fraction() {
        assert_eq!(fraction(&StopRule::Samples(256), &row()), Some(0.25));
        assert_eq!(fraction(&StopRule::Time(4.0), &row()), Some(0.5));
        assert_eq!(fraction(&StopRule::Time(0.0), &row()), Some(1.0));
        assert_eq!(fraction(&threshold(), &row()), None);
        let any = StopRule::Any(vec![
            StopRule::Samples(256),
            threshold(),
            StopRule::Time(4.0),
        ]);
        assert_eq!(fraction(&any, &row()), Some(0.5));
        assert_eq!(
            fraction(
                &StopRule::All(vec![StopRule::Samples(256), StopRule::Time(4.0)]),
                &row()
            ),
            Some(0.25)
        );
        assert_eq!(
            fraction(
                &StopRule::All(vec![StopRule::Samples(256), threshold()]),
                &row()
            ),
            None
        );
    }

    #[test]
    fn a_power_law_gives_the_time_until_any_kind_of_metric_reaches_a_value() {
        // The error is 1 after a second and falls with the square root of time.
        let law = |perfect, decibel| ErrorPowerLaw {
            ln_a: 0.0,
            slope: -0.5,
            perfect,
            decibel,
        };
        let seconds = |law: ErrorPowerLaw, op, value| {
            let seconds = law.seconds_until(op, value);
            seconds.map(|s| (s * 1e6).round() / 1e6)
        };
        let (below, above) = (Comparison::Less, Comparison::Greater);
        assert_eq!(seconds(law(None, false), below, 0.1), Some(100.0));
        assert_eq!(seconds(law(None, false), above, 0.1), None);
        assert_eq!(seconds(law(Some(1.0), false), above, 0.9), Some(100.0));
        // An error of 0.1 is 20 dB of PSNR.
        assert_eq!(seconds(law(None, true), above, 20.0), Some(100.0));
        assert_eq!(seconds(law(None, true), above, 40.0), Some(1e4));
        assert_eq!(seconds(law(None, true), below, 20.0), None);
    }

    #[test]
    fn the_remaining_time_follows_from_the_speed_so_far() {
        let left = |rule| render_left(&rule, &row(), &|_| None);
        assert_eq!(
            left(StopRule::Samples(256)),
            Some(Eta {
                seconds: 6.0,
                at_most: false,
                forecast: false
            })
        );
        assert_eq!(
            left(StopRule::Time(1.0)),
            Some(Eta {
                seconds: 0.0,
                at_most: false,
                forecast: false
            })
        );
        let any = StopRule::Any(vec![
            StopRule::Samples(256),
            threshold(),
            StopRule::Time(4.0),
        ]);
        assert_eq!(
            left(any),
            Some(Eta {
                seconds: 2.0,
                at_most: true,
                forecast: false
            })
        );
        let all = StopRule::All(vec![StopRule::Samples(256), StopRule::Time(4.0)]);
        assert_eq!(
            left(all),
            Some(Eta {
                seconds: 6.0,
                at_most: false,
                forecast: false
            })
        );
        let guarded = StopRule::Any(vec![StopRule::Samples(256), StopRule::Nan(1)]);
        assert_eq!(
            left(guarded),
            Some(Eta {
                seconds: 6.0,
                at_most: false,
                forecast: false
            })
        );
        assert_eq!(left(threshold()), None);
        assert_eq!(
            render_left(&StopRule::Samples(8), &WaveRow::default(), &|_| None),
            None
        );
    }

    #[test]
    fn a_threshold_is_forecast_from_the_power_law() {
        let metrics: Vec<MetricSpec> = ["rmse", "psnr"]
            .map(|name| MetricSpec::new(name, name, Default::default()).unwrap())
            .into();
        let rows: Vec<WaveRow> = (0..12)
            .map(|k| {
                let render_s = f64::from(1 << k) * 0.01;
                let rmse = 0.2 / render_s.sqrt();
                WaveRow {
                    samples: 1 << k,
                    render_s,
                    metrics: vec![rmse, -20.0 * rmse.log10()],
                    ..WaveRow::default()
                }
            })
            .collect();
        let (curve, row) = (Curve::from_rows(&rows), rows.last().unwrap());
        let falls = |column: &str| fit(&curve, &metrics, column);
        let when = |column: &str, op, value| StopRule::When {
            column: column.into(),
            op,
            value,
            hold: 1,
        };
        // 0.2 / sqrt(t) is 0.02 at t = 100 s, which is 34 dB less 0.02.
        for rule in [
            when("rmse", Comparison::Less, 0.02),
            when("psnr", Comparison::Greater, -20.0 * 0.02f64.log10()),
        ] {
            let eta = render_left(&rule, row, &falls).unwrap();
            assert!(
                eta.forecast && (eta.seconds - (100.0 - row.render_s)).abs() < 1e-6,
                "{rule:?} {eta:?}"
            );
        }
        let race = StopRule::Any(vec![
            when("rmse", Comparison::Less, 0.02),
            StopRule::Time(60.0),
        ]);
        let eta = render_left(&race, row, &falls).unwrap();
        assert!(
            !eta.forecast && (eta.seconds - (60.0 - row.render_s)).abs() < 1e-9,
            "the limit comes first"
        );
        assert_eq!(
            render_left(&when("rmse", Comparison::Greater, 1.0), row, &falls),
            None,
            "it falls"
        );
        assert_eq!(
            render_left(&when("ssim", Comparison::Greater, 0.9), row, &falls),
            None,
            "not measured"
        );
    }
}
