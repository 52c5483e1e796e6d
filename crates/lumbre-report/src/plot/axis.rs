//! Axes of figures: scale, range, ticks and tick labels.

use super::svg::{TickLabel, text_width};

/// Mapping of values to positions along an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Logarithmic; only positive values can be drawn.
    Log,
    /// Linear; all finite values can be drawn.
    Linear,
}

impl Scale {
    /// Converts a value to the number that is averaged: the natural logarithm on a logarithmic scale.
    pub fn scaled(self, value: f64) -> f64 {
        if self == Scale::Log {
            value.ln()
        } else {
            value
        }
    }

    /// Converts a number of [`Scale::scaled`] back to a value.
    pub fn unscaled(self, scaled: f64) -> f64 {
        if self == Scale::Log {
            scaled.exp()
        } else {
            scaled
        }
    }

    /// Returns whether a value can be drawn on such an axis.
    pub fn accepts(self, value: f64) -> bool {
        value.is_finite() && (self == Scale::Linear || value > 0.0)
    }

    /// Returns a suitable scale for values of unknown magnitude: logarithmic if all are positive
    /// and the largest is more than ten times the smallest, otherwise linear.
    pub fn for_values(values: impl IntoIterator<Item = f64>) -> Scale {
        let finite = values.into_iter().filter(|v| v.is_finite());
        let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| {
            (a.min(v), b.max(v))
        });
        if low > 0.0 && high > 10.0 * low {
            Scale::Log
        } else {
            Scale::Linear
        }
    }

    fn forward(self, value: f64) -> f64 {
        if self == Scale::Log {
            value.log10()
        } else {
            value
        }
    }

    fn back(self, place: f64) -> f64 {
        if self == Scale::Log {
            10f64.powf(place)
        } else {
            place
        }
    }
}

/// An axis with its range and ticks.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    scale: Scale,
    low: f64,
    high: f64,
    /// Labelled ticks in ascending order.
    pub ticks: Vec<(f64, TickLabel)>,
    /// Positions of the fine grid lines, without the labelled ones.
    pub minor: Vec<f64>,
    /// Whether the ticks are names rather than numbers.
    pub named: bool,
}

/// Padding beyond the outermost values, as a fraction of the range.
const PADDING: f64 = 0.04;
/// Minimum length of a logarithmic axis, in decades.
const FEWEST_DECADES: f64 = 0.3;
/// Numbers that are labelled without a power of ten.
const PLAIN: std::ops::Range<f64> = 1e-4..1e5;
/// Minimum length of a linear axis, as a fraction of its largest absolute value.
const SHORTEST_LINEAR: f64 = 0.02;

impl Axis {
    /// Creates an axis that covers all values that its scale accepts. Returns `None` if there are
    /// none.
    pub fn new(scale: Scale, values: impl IntoIterator<Item = f64>) -> Option<Axis> {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for value in values.into_iter().filter(|v| scale.accepts(*v)) {
            let place = scale.forward(value);
            (low, high) = (low.min(place), high.max(place));
        }
        if low > high {
            return None;
        }
        let shortest = match scale {
            Scale::Log => FEWEST_DECADES,
            Scale::Linear if low == 0.0 && high == 0.0 => 1.0,
            Scale::Linear => SHORTEST_LINEAR * low.abs().max(high.abs()),
        };
        let widen = ((shortest - (high - low)) / 2.0).max(0.0);
        (low, high) = (low - widen, high + widen);
        let padding = PADDING * (high - low);
        (low, high) = (low - padding, high + padding);
        let (at, minor) = match scale {
            Scale::Log => log_ticks(low, high),
            Scale::Linear => linear_ticks(low, high),
        };
        let plain = at
            .iter()
            .all(|v| *v == 0.0 || PLAIN.contains(&rounded(v.abs())));
        let ticks = at.iter().map(|v| (*v, label(*v, plain))).collect();
        Some(Axis {
            scale,
            low,
            high,
            ticks,
            minor,
            named: false,
        })
    }

    /// Creates an axis of names, each at its index. Returns `None` if there are none.
    pub fn named(names: &[String]) -> Option<Axis> {
        let ticks: Vec<(f64, TickLabel)> = names
            .iter()
            .enumerate()
            .map(|(i, name)| (i as f64, TickLabel::Plain(name.clone())))
            .collect();
        let high = names.len() as f64 - 0.5;
        (!names.is_empty()).then_some(Axis {
            scale: Scale::Linear,
            low: -0.5,
            high,
            ticks,
            minor: Vec::new(),
            named: true,
        })
    }

    /// Returns the height of the widest name when rotated by 90°, in text of `size`. Returns 0 if
    /// the ticks are numbers, or if the names fit side by side in `length`.
    pub fn rotated_label_extent(&self, length: f64, size: f64) -> f64 {
        let width = |label: &TickLabel| match label {
            TickLabel::Plain(text) if self.named => text_width(text, size),
            _ => 0.0,
        };
        let widest = self
            .ticks
            .iter()
            .map(|(_, label)| width(label))
            .fold(0.0, f64::max);
        if widest + 0.35 * size > length / self.ticks.len() as f64 {
            widest
        } else {
            0.0
        }
    }

    /// Labels several axes in one format: all with powers of ten if one of them needs these.
    pub fn share_format(axes: &mut [&mut Axis]) {
        let is_power = |(_, label): &(f64, TickLabel)| matches!(label, TickLabel::Power { .. });
        if !axes.iter().any(|axis| axis.ticks.iter().any(is_power)) {
            return;
        }
        for axis in axes.iter_mut().filter(|axis| !axis.named) {
            for (value, text) in &mut axis.ticks {
                *text = label(*value, false);
            }
        }
    }

    /// Removes ticks that are not integers.
    pub fn keep_integer_ticks(&mut self) {
        self.ticks.retain(|(value, _)| value.fract() == 0.0);
        self.minor.retain(|value| value.fract() == 0.0);
    }

    /// Returns the values at the lower and the upper end.
    pub fn range(&self) -> [f64; 2] {
        [self.low, self.high].map(|place| self.scale.back(place))
    }

    /// Returns the position of a value: 0 at the lower end, 1 at the upper end.
    pub fn position(&self, value: f64) -> f64 {
        (self.scale.forward(value) - self.low) / (self.high - self.low)
    }
}

/// Returns labelled values and fine grid lines of a logarithmic axis. `low` and `high` are
/// exponents of ten.
fn log_ticks(low: f64, high: f64) -> (Vec<f64>, Vec<f64>) {
    let decades = high - low;
    let within = |v: &f64| (low..=high).contains(&v.log10());
    let exponents = low.floor() as i32..=high.ceil() as i32;
    let multiples = |factors: &[f64]| -> Vec<f64> {
        let all = exponents
            .clone()
            .flat_map(|e| factors.iter().map(move |f| power(*f, e)));
        all.filter(within).collect()
    };
    let every = (decades / 8.0).ceil() as i32;
    let ticks = if every > 1 {
        exponents
            .clone()
            .filter(|e| e.rem_euclid(every) == 0)
            .map(|e| power(1.0, e))
            .filter(within)
            .collect()
    } else if decades >= 3.0 {
        multiples(&[1.0])
    } else if decades >= 1.0 {
        multiples(&[1.0, 2.0, 5.0])
    } else {
        multiples(&[1.0, 2.0, 3.0, 5.0, 7.0])
    };
    if ticks.len() < 3 && decades < 1.0 {
        let (ticks, minor) = linear_ticks(Scale::Log.back(low), Scale::Log.back(high));
        return (ticks, minor);
    }
    let fine: Vec<f64> = if every > 1 {
        multiples(&[1.0])
    } else {
        multiples(&[1., 2., 3., 4., 5., 6., 7., 8., 9.])
    };
    let minor = fine.into_iter().filter(|v| !ticks.contains(v)).collect();
    (ticks, minor)
}

/// Computes `factor * 10^exponent`, rounded so that 3e-1 equals the literal 0.3.
fn power(factor: f64, exponent: i32) -> f64 {
    rounded(factor * 10f64.powi(exponent))
}

/// Returns labelled values and fine grid lines of a linear axis: about five labels, in steps of 1,
/// 2 or 5 times a power of ten.
fn linear_ticks(low: f64, high: f64) -> (Vec<f64>, Vec<f64>) {
    let rough = (high - low) / 5.0;
    let exponent = rough.log10().floor() as i32;
    let decade = 10f64.powi(exponent);
    let factor = [1.0, 2.0, 5.0, 10.0].into_iter().min_by(|a, b| {
        let miss = |f: &f64| (f * decade / rough).ln().abs();
        miss(a).total_cmp(&miss(b))
    });
    let factor = factor.unwrap_or(1.0);
    let parts = if factor == 2.0 { 4 } else { 5 };
    let step = factor * decade / f64::from(parts);
    let (first, last) = ((low / step).ceil() as i64, (high / step).floor() as i64);
    let (ticks, minor): (Vec<i64>, Vec<i64>) =
        (first..=last).partition(|i| i % i64::from(parts) == 0);
    let values = |multiples: Vec<i64>| {
        multiples
            .into_iter()
            .map(|i| rounded(i as f64 * step))
            .collect()
    };
    (values(ticks), values(minor))
}

/// Rounds to 12 significant digits, which removes the rounding errors of binary fractions.
fn rounded(x: f64) -> f64 {
    format!("{x:.11e}").parse().unwrap_or(x)
}

fn label(value: f64, plain: bool) -> TickLabel {
    let with_minus = |x: f64| rounded(x).to_string().replace('-', "−");
    if plain || value == 0.0 {
        return TickLabel::Plain(with_minus(value));
    }
    let exponent = rounded(value.abs().log10()).floor() as i32;
    let factor = rounded(value / 10f64.powi(exponent));
    TickLabel::Power {
        factor: (factor != 1.0).then(|| with_minus(factor)),
        exponent,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis) -> Vec<String> {
        let text = |label: &TickLabel| match label {
            TickLabel::Plain(text) => text.clone(),
            TickLabel::Power { factor, exponent } => {
                format!(
                    "{}10^{exponent}",
                    factor.as_ref().map(|f| format!("{f}x")).unwrap_or_default()
                )
            }
        };
        axis.ticks.iter().map(|(_, label)| text(label)).collect()
    }

    #[test]
    fn logarithmic_labels_fit_the_range() {
        let log = |low: f64, high: f64| labels(&Axis::new(Scale::Log, [low, high]).unwrap());
        assert_eq!(log(0.01, 100.0), ["0.01", "0.1", "1", "10", "100"]);
        assert_eq!(log(0.03, 1.1), ["0.05", "0.1", "0.2", "0.5", "1"]);
        assert_eq!(log(0.1, 0.8), ["0.1", "0.2", "0.3", "0.5", "0.7"]);
        assert_eq!(
            log(1e-7, 1e-3),
            ["10^-7", "10^-6", "10^-5", "10^-4", "10^-3"]
        );
        assert_eq!(log(2e-5, 3e-4), ["2x10^-5", "5x10^-5", "10^-4", "2x10^-4"]);
        assert_eq!(log(1e-4, 0.1), ["0.0001", "0.001", "0.01", "0.1"]);
        assert_eq!(log(1e-20, 1e20).len(), 7);
        assert_eq!(log(1.1, 1.9), ["1", "1.2", "1.4", "1.6", "1.8", "2"]);
    }

    #[test]
    fn axes_of_one_figure_share_their_format() {
        let axis = |low, high| Axis::new(Scale::Log, [low, high]).unwrap();
        let (mut wide, mut near) = (axis(1e-7, 1e-3), axis(0.03, 1.1));
        Axis::share_format(&mut [&mut wide, &mut near]);
        assert_eq!(labels(&wide)[0], "10^-7");
        assert_eq!(
            labels(&near),
            ["5x10^-2", "10^-1", "2x10^-1", "5x10^-1", "10^0"]
        );
        let (mut far, mut near) = (axis(0.01, 100.0), axis(0.03, 1.1));
        Axis::share_format(&mut [&mut far, &mut near]);
        assert_eq!(labels(&near)[0], "0.05");
    }

    #[test]
    fn linear_labels_are_round() {
        let linear = |low: f64, high: f64| labels(&Axis::new(Scale::Linear, [low, high]).unwrap());
        assert_eq!(linear(12.0, 38.0), ["15", "20", "25", "30", "35"]);
        assert_eq!(linear(-1.0, 1.0), ["−1", "−0.5", "0", "0.5", "1"]);
    }

    #[test]
    fn names_are_spaced_evenly_and_scales_suit_their_values() {
        let axis = Axis::named(&["a".to_owned(), "b".to_owned()]).unwrap();
        assert_eq!(
            ([0.0, 1.0].map(|v| axis.position(v)), labels(&axis)),
            ([0.25, 0.75], vec!["a".into(), "b".into()])
        );
        assert_eq!(Axis::named(&[]), None);
        let fitting = |values: &[f64]| Scale::for_values(values.iter().copied());
        assert_eq!(fitting(&[1.0, 5.0, f64::INFINITY]), Scale::Linear);
        assert_eq!(
            (fitting(&[1.0, 11.0]), fitting(&[0.0, 11.0]), fitting(&[])),
            { (Scale::Log, Scale::Linear, Scale::Linear) }
        );
        let mut axis = Axis::new(Scale::Log, [1.0, 1.9]).unwrap();
        axis.keep_integer_ticks();
        assert_eq!(labels(&axis), ["1", "2"]);
    }

    #[test]
    fn one_value_and_no_value() {
        let axis = Axis::new(Scale::Log, [0.5]).unwrap();
        assert!((axis.position(0.5) - 0.5).abs() < 1e-12);
        assert!(axis.ticks.len() >= 2, "{axis:?}");
        let axis = Axis::new(Scale::Linear, [30.0]).unwrap();
        assert!(
            (axis.position(30.0) - 0.5).abs() < 1e-9 && axis.ticks.len() >= 2,
            "{axis:?}"
        );
        assert!(Axis::new(Scale::Linear, [0.0]).is_some());
        assert_eq!(
            Axis::new(Scale::Log, [0.0, -1.0, f64::NAN, f64::INFINITY]),
            None
        );
        assert_eq!(Axis::new(Scale::Linear, []), None);
    }

    #[test]
    fn every_tick_lies_on_the_axis_and_the_fine_grid_avoids_labels() {
        for (low, high) in [(1e-9, 1e3), (0.2, 0.21), (3.0, 40.0), (0.001, 0.9)] {
            for scale in [Scale::Log, Scale::Linear] {
                let axis = Axis::new(scale, [low, high]).unwrap();
                for value in axis.ticks.iter().map(|(v, _)| v).chain(&axis.minor) {
                    assert!(
                        (0.0..=1.0).contains(&axis.position(*value)),
                        "{value} on {low}..{high} {scale:?}"
                    );
                }
                assert!(
                    axis.ticks.iter().all(|(v, _)| !axis.minor.contains(v)),
                    "{axis:?}"
                );
                assert!(axis.ticks.len() >= 3, "{axis:?}");
            }
        }
    }
}
