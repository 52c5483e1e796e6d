//! Medians of times of which some are only known to be longer or shorter.

use crate::quantity::{Bound, RunValue};

/// Quantile of the normal distribution for an interval of 95 %.
const Z: f64 = 1.959_963_984_540_054;

/// Median of some times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Median {
    /// The median, or a bound of it.
    pub time: f64,
    /// [`Bound::Median`], or how the median relates to `time`.
    pub bound: Bound,
    /// Ends of its 95 % confidence interval, of which the upper one may be infinite; `None` for a
    /// bound.
    pub interval: Option<[f64; 2]>,
}

/// Returns the median of some times, of which those with a lower bound are censored [Kaplan and
/// Meier 1958]. One with an upper bound counts as that time. The interval is that of [Brookmeyer and
/// Crowley 1982] with the logarithms of logarithms of survival. Returns `None` without times.
pub fn median(times: &[RunValue]) -> Option<Median> {
    let mut times = times.to_vec();
    // Of equal times those that were reached come first: the others are longer.
    let order = |t: &RunValue| (t.number, t.bound == Bound::Lower);
    times.sort_by(|a, b| {
        let ((x, a), (y, b)) = (order(a), order(b));
        x.total_cmp(&y).then(a.cmp(&b))
    });
    let last = times.last()?.number;
    let (mut survival, mut hazard) = (1.0, 0.0);
    let (mut found, mut low, mut high) = (None, None, f64::INFINITY);
    let mut first = 0;
    while first < times.len() {
        let time = times[first].number;
        let equal = times[first..]
            .iter()
            .take_while(|t| t.number.total_cmp(&time).is_eq());
        let (mut count, mut reached, mut is_upper) = (0, 0, false);
        for value in equal {
            count += 1;
            reached += usize::from(value.bound != Bound::Lower);
            is_upper |= value.bound == Bound::Upper;
        }
        let at_risk = (times.len() - first) as f64;
        let events = reached as f64;
        survival *= 1.0 - events / at_risk;
        hazard += events / (at_risk * (at_risk - events));
        let [lower, upper] = survival_interval(survival, hazard);
        if survival <= 0.5 && found.is_none() {
            found = Some((time, is_upper));
        }
        if lower <= 0.5 && low.is_none() {
            low = Some(time);
        }
        if upper <= 0.5 {
            high = high.min(time);
        }
        first += count;
    }
    Some(match found {
        None => Median {
            time: last,
            bound: Bound::Lower,
            interval: None,
        },
        Some((time, true)) => Median {
            time,
            bound: Bound::Upper,
            interval: None,
        },
        Some((time, false)) => Median {
            time,
            bound: Bound::Median,
            interval: low.filter(|_| times.len() > 1).map(|low| [low, high]),
        },
    })
}

/// Returns the 95 % interval of a survival from Greenwood's sum.
fn survival_interval(survival: f64, hazard: f64) -> [f64; 2] {
    if survival <= 0.0 || survival >= 1.0 {
        return [survival; 2];
    }
    let error = hazard.sqrt() / survival.ln().abs();
    [1.0, -1.0].map(|sign| survival.powf((sign * Z * error).exp()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(times: &[(f64, Bound)]) -> Median {
        let times: Vec<RunValue> = times
            .iter()
            .map(|(time, bound)| RunValue::bounded(*time, *bound))
            .collect();
        median(&times).unwrap()
    }

    /// Medians and intervals by `lifelines` 0.30, from times with 1 for those that were reached.
    #[test]
    fn medians_are_those_of_another_program() {
        let none = f64::INFINITY;
        let check = |times: &[f64], reached: &[u8], median: f64, interval: [f64; 2]| {
            let bound = |reached: &u8| [Bound::Lower, Bound::Exact][usize::from(*reached)];
            let bounds = reached.iter().map(bound);
            let times: Vec<_> = times.iter().copied().zip(bounds).collect();
            let expected = Median {
                time: median,
                bound: Bound::Median,
                interval: Some(interval),
            };
            assert_eq!(of(&times), expected, "{times:?}");
        };
        let five = [1.0, 2.0, 3.0, 4.0, 5.0];
        check(&five, &[1; 5], 3.0, [1.0, 5.0]);
        check(&five, &[1, 1, 1, 0, 0], 3.0, [1.0, none]);
        let eight = [8.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];
        check(&eight, &[0, 1, 0, 1, 1, 0, 1, 1], 6.0, [1.0, none]);
        let ten = [2.0, 2.0, 3.0, 5.0, 8.0, 8.0, 9.0, 12.0, 15.0, 20.0];
        check(&ten, &[1, 1, 0, 1, 1, 1, 0, 1, 0, 1], 8.0, [2.0, 20.0]);
    }

    #[test]
    fn a_median_that_is_not_reached_is_a_bound() {
        let (exact, lower, upper) = (Bound::Exact, Bound::Lower, Bound::Upper);
        let found = of(&[(1.0, exact), (2.0, lower), (4.0, lower)]);
        assert_eq!((found.time, found.bound), (4.0, Bound::Lower));
        let found = of(&[(1.0, upper), (1.0, upper), (4.0, lower)]);
        assert_eq!((found.time, found.bound), (1.0, Bound::Upper));
        let found = of(&[(1.0, upper), (2.0, exact), (4.0, lower)]);
        assert_eq!((found.time, found.bound), (2.0, Bound::Median));
        assert_eq!(median(&[]), None);
        assert!(of(&[(f64::NAN, exact)]).time.is_nan());
    }
}
