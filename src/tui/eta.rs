//! How much of a stop rule is behind a run, and how long the rest will take.

use crate::experiment::{StopRule, WaveRow};

/// Time that is left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eta {
    /// Seconds.
    pub seconds: f64,
    /// Whether it may well be less: another part of the rule, such as a metric's threshold, may hold before.
    pub at_most: bool,
}

/// The part of `rule` that is behind the run, in `0..=1`, as far as time, samples and waves tell.
pub fn fraction(rule: &StopRule, row: &WaveRow) -> Option<f64> {
    let share = |done: f64, whole: f64| Some(if whole > 0.0 { (done / whole).clamp(0.0, 1.0) } else { 1.0 });
    match rule {
        StopRule::Time(s) => share(row.render_s, *s),
        StopRule::Samples(n) => share(row.samples as f64, *n as f64),
        StopRule::Waves(n) => share(row.wave as f64, *n as f64),
        StopRule::When { .. } | StopRule::Nan(_) | StopRule::Predicate(_) | StopRule::Not(_) => None,
        StopRule::Any(rules) => rules.iter().filter_map(|r| fraction(r, row)).reduce(f64::max),
        StopRule::All(rules) => {
            rules.iter().map(|r| fraction(r, row)).try_fold(1.0f64, |least, f| f.map(|f| least.min(f)))
        }
    }
}

/// The render time that is left to a run, from the limits of time and samples; waves grow, so their count tells
/// nothing about time.
pub fn render_left(rule: &StopRule, row: &WaveRow) -> Option<Eta> {
    let sure = |seconds: f64| Some(Eta { seconds: seconds.max(0.0), at_most: false });
    match rule {
        StopRule::Time(s) => sure(s - row.render_s),
        StopRule::Samples(n) if row.samples > 0 => {
            sure(n.saturating_sub(row.samples) as f64 * row.render_s / row.samples as f64)
        }
        StopRule::Any(rules) => {
            let known: Vec<Eta> = rules.iter().filter_map(|r| render_left(r, row)).collect();
            let least = known.iter().map(|eta| eta.seconds).reduce(f64::min)?;
            // An invalid sample is an accident that nobody expects; it does not make the estimate less sure.
            let open = rules.iter().any(|r| !matches!(r, StopRule::Nan(_)) && render_left(r, row).is_none());
            Some(Eta { seconds: least, at_most: open || known.iter().any(|eta| eta.at_most) })
        }
        StopRule::All(rules) => {
            rules.iter().map(|r| render_left(r, row)).try_fold(Eta { seconds: 0.0, at_most: false }, |most, eta| {
                let eta = eta?;
                Some(Eta { seconds: most.seconds.max(eta.seconds), at_most: most.at_most || eta.at_most })
            })
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::stop::Comparison;

    fn row() -> WaveRow {
        WaveRow { wave: 3, samples: 64, render_s: 2.0, ..WaveRow::default() }
    }

    fn threshold() -> StopRule {
        StopRule::When { column: "rmse".into(), op: Comparison::Less, value: 0.01, hold: 1 }
    }

    #[test]
    fn limits_tell_what_is_done() {
        assert_eq!(fraction(&StopRule::Samples(256), &row()), Some(0.25));
        assert_eq!(fraction(&StopRule::Time(4.0), &row()), Some(0.5));
        assert_eq!(fraction(&StopRule::Time(0.0), &row()), Some(1.0));
        assert_eq!(fraction(&threshold(), &row()), None);
        let any = StopRule::Any(vec![StopRule::Samples(256), threshold(), StopRule::Time(4.0)]);
        assert_eq!(fraction(&any, &row()), Some(0.5));
        assert_eq!(fraction(&StopRule::All(vec![StopRule::Samples(256), StopRule::Time(4.0)]), &row()), Some(0.25));
        assert_eq!(fraction(&StopRule::All(vec![StopRule::Samples(256), threshold()]), &row()), None);
    }

    #[test]
    fn the_rest_follows_from_the_speed_so_far() {
        let left = |rule| render_left(&rule, &row());
        assert_eq!(left(StopRule::Samples(256)), Some(Eta { seconds: 6.0, at_most: false }));
        assert_eq!(left(StopRule::Time(1.0)), Some(Eta { seconds: 0.0, at_most: false }));
        let any = StopRule::Any(vec![StopRule::Samples(256), threshold(), StopRule::Time(4.0)]);
        assert_eq!(left(any), Some(Eta { seconds: 2.0, at_most: true }));
        let all = StopRule::All(vec![StopRule::Samples(256), StopRule::Time(4.0)]);
        assert_eq!(left(all), Some(Eta { seconds: 6.0, at_most: false }));
        let guarded = StopRule::Any(vec![StopRule::Samples(256), StopRule::Nan(1)]);
        assert_eq!(left(guarded), Some(Eta { seconds: 6.0, at_most: false }));
        assert_eq!(left(threshold()), None);
        assert_eq!(render_left(&StopRule::Samples(8), &WaveRow::default()), None);
    }
}
