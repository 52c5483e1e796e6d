//! Chart axes: range, ticks and labels.

/// Mapping of values to positions along an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AxisScale {
    /// Equal distances for equal differences.
    Linear,
    /// Equal distances for equal ratios; only positive values can be placed.
    Log,
}

/// A tick and its label.
#[derive(Clone, Debug, PartialEq)]
pub struct Tick {
    /// Value at which the tick is drawn.
    pub value: f64,
    /// Label of the tick, in ASCII.
    pub label: String,
}

/// A chart axis with its range and ticks.
#[derive(Clone, Debug, PartialEq)]
pub struct ChartAxis {
    scale: AxisScale,
    /// Ends of the range; powers of ten on a logarithmic axis.
    low: f64,
    high: f64,
    /// Ticks in ascending order.
    pub ticks: Vec<Tick>,
}

impl ChartAxis {
    /// Creates an axis that covers all placeable `values`, with about `wanted` ticks.
    pub fn covering(
        values: impl Iterator<Item = f64>,
        scale: AxisScale,
        wanted: usize,
    ) -> ChartAxis {
        let positions = values.filter_map(|v| position(scale, v));
        let (low, high) = positions.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| {
            (l.min(p), h.max(p))
        });
        let (low, high) = if low.is_finite() {
            (low, high)
        } else {
            (0.0, 1.0)
        };
        // A single point or a constant curve still needs some margin.
        let least = match scale {
            AxisScale::Log => 0.1,
            AxisScale::Linear => low.abs().max(high.abs()).max(1e-6) * 0.02,
        };
        let pad = ((high - low) * 0.05).max((least - (high - low)).max(0.0) * 0.5);
        let (low, high) = (low - pad, high + pad);
        let wanted = wanted.max(2);
        let ticks = match scale {
            AxisScale::Log => log_ticks(low, high, wanted),
            AxisScale::Linear => linear_ticks(low, high, wanted),
        };
        ChartAxis {
            scale,
            low,
            high,
            ticks,
        }
    }

    /// Position of a value between the ends of the axis, in `0..=1`; `None` if it lies outside.
    pub fn position(&self, value: f64) -> Option<f64> {
        let share = (position(self.scale, value)? - self.low) / (self.high - self.low);
        (-1e-9..=1.0 + 1e-9)
            .contains(&share)
            .then(|| share.clamp(0.0, 1.0))
    }
}

fn position(scale: AxisScale, value: f64) -> Option<f64> {
    match scale {
        AxisScale::Linear => value.is_finite().then_some(value),
        AxisScale::Log => (value > 0.0 && value.is_finite()).then(|| value.log10()),
    }
}

/// Returns ticks at powers of ten: every n-th power if there are more than `wanted`; with 2 and
/// 5 (or finer steps) between them if there are fewer than two.
fn log_ticks(low: f64, high: f64, wanted: usize) -> Vec<Tick> {
    let decades = (high.floor() - low.ceil()).max(0.0) as i32 + 1;
    let step = (decades as usize).div_ceil(wanted).max(1) as i32;
    let first = low.ceil() as i32;
    let mut ticks: Vec<Tick> = (first..=high.floor() as i32)
        .filter(|k| k.rem_euclid(step) == 0)
        .map(|k| Tick {
            value: 10f64.powi(k),
            label: power_label(k),
        })
        .collect();
    if ticks.len() >= 2 {
        return ticks;
    }
    for mantissas in [
        &[1.0, 2.0, 5.0][..],
        &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0][..],
    ] {
        ticks.clear();
        for k in low.floor() as i32..=high.floor() as i32 {
            for m in mantissas {
                let value = m * 10f64.powi(k);
                if (low..=high).contains(&value.log10()) {
                    ticks.push(Tick {
                        value,
                        label: step_label(value, if *m == 1.5 { k - 1 } else { k }),
                    });
                }
            }
        }
        if ticks.len() >= 2 {
            return ticks;
        }
    }
    // The range is narrower than the finest step: use even steps.
    let inside = linear_ticks(10f64.powf(low), 10f64.powf(high), wanted);
    if inside.len() >= 2 { inside } else { ticks }
}

/// Returns ticks in steps of 1, 2 or 5 times a power of ten.
fn linear_ticks(low: f64, high: f64, wanted: usize) -> Vec<Tick> {
    let raw = (high - low) / wanted as f64;
    if raw <= 0.0 || !raw.is_finite() {
        return Vec::new();
    }
    let decade = raw.log10().floor() as i32;
    let power = 10f64.powi(decade);
    let (step, digits) = match raw / power {
        m if m <= 1.0 => (power, decade),
        m if m <= 2.0 => (2.0 * power, decade),
        m if m <= 5.0 => (5.0 * power, decade),
        _ => (10.0 * power, decade + 1),
    };
    let first = (low / step).ceil();
    (0..=(high / step - first).floor().max(-1.0) as i64)
        .map(|i| (first + i as f64) * step)
        .map(|value| Tick {
            value,
            label: step_label(value, digits),
        })
        .collect()
}

/// Formats a power of ten: `0.001` to `10000` in full, others as `1e-5`.
fn power_label(k: i32) -> String {
    match k {
        0..=4 => 10i64.pow(k as u32).to_string(),
        -3..=-1 => format!("{:.*}", -k as usize, 10f64.powi(k)),
        _ => format!("1e{k}"),
    }
}

/// Formats a number whose last digit has the value `10^digit`.
fn step_label(value: f64, digit: i32) -> String {
    let size = value.abs();
    if size != 0.0 && !(1e-4..1e5).contains(&size) {
        let (full, short) = (format!("{value:e}"), format!("{value:.2e}"));
        return if full.len() <= short.len() {
            full
        } else {
            short
        };
    }
    // Adding zero avoids the label `-0`.
    format!("{:.*}", (-digit).max(0) as usize, value + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &ChartAxis) -> Vec<&str> {
        axis.ticks.iter().map(|t| t.label.as_str()).collect()
    }

    #[test]
    fn wide_ranges_have_powers_of_ten() {
        assert_eq!(
            labels(&ChartAxis::covering(
                [0.003, 40.0].into_iter(),
                AxisScale::Log,
                6
            )),
            ["0.01", "0.1", "1", "10"]
        );
        assert_eq!(
            labels(&ChartAxis::covering(
                [1e-9, 1.0].into_iter(),
                AxisScale::Log,
                3
            )),
            ["1e-8", "1e-4", "1"]
        );
    }

    #[test]
    fn narrow_ranges_have_steps_between() {
        assert_eq!(
            labels(&ChartAxis::covering(
                [0.012, 0.06].into_iter(),
                AxisScale::Log,
                6
            )),
            ["0.02", "0.05"]
        );
        let narrow = ChartAxis::covering([0.0151, 0.0155].into_iter(), AxisScale::Log, 4);
        assert!(narrow.ticks.len() >= 2, "{narrow:?}");
        assert_eq!(
            labels(&ChartAxis::covering(
                [0.5, 0.9].into_iter(),
                AxisScale::Linear,
                4
            )),
            ["0.6", "0.8"]
        );
        assert_eq!(
            labels(&ChartAxis::covering(
                [-1.0, 24.0].into_iter(),
                AxisScale::Linear,
                3
            )),
            ["0", "10", "20"]
        );
    }

    #[test]
    fn every_tick_and_every_value_is_within_the_axis() {
        for scale in [AxisScale::Log, AxisScale::Linear] {
            for range in [
                [1e-12, 1e12],
                [0.5, 0.5],
                [3.0, 3.001],
                [0.02, 7.0],
                [1e5, 2e5],
            ] {
                let axis = ChartAxis::covering(range.into_iter(), scale, 5);
                assert!(
                    range.iter().all(|v| axis.position(*v).is_some()),
                    "{scale:?} {range:?}"
                );
                assert!(
                    axis.ticks.iter().all(|t| axis.position(t.value).is_some()),
                    "{axis:?}"
                );
                assert!(axis.ticks.len() <= 30, "{axis:?}");
            }
        }
        assert_eq!(
            ChartAxis::covering([1.0].into_iter(), AxisScale::Log, 4).position(-1.0),
            None
        );
        let nothing = ChartAxis::covering([f64::NAN, -2.0].into_iter(), AxisScale::Log, 4);
        assert!(nothing.position(5.0).is_some());
    }
}
