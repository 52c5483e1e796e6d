//! Curves of single runs, and means with bands over several repeats.

use super::metric_display::MetricDisplay;
use crate::plot::axis::Scale;
use lumbre_light::math::t_test::mean_and_interval;

/// Number of positions at which the mean of repeats is computed.
const STEPS: usize = 72;

/// Measurements of one metric of one run in display form, ascending and positive in x.
#[derive(Clone, Debug, PartialEq)]
pub struct MetricCurve {
    /// Points `(x, drawn value)`.
    pub points: Vec<(f64, f64)>,
    scale: Scale,
}

impl MetricCurve {
    /// Creates a curve of the points that the axes accept. A second point at the same x replaces
    /// the first one; points that go back in x are dropped.
    pub fn new(shown: MetricDisplay, points: impl IntoIterator<Item = (f64, f64)>) -> MetricCurve {
        let mut accepted: Vec<(f64, f64)> = Vec::new();
        for (x, y) in points {
            let Some(y) = shown.drawn_value(y).filter(|_| Scale::Log.accepts(x)) else {
                continue;
            };
            match accepted.last_mut() {
                Some(last) if last.0 == x => last.1 = y,
                Some(last) if last.0 > x => {}
                _ => accepted.push((x, y)),
            }
        }
        MetricCurve {
            points: accepted,
            scale: shown.scale,
        }
    }

    /// Returns the first and the last x, or `None` if there are no points.
    pub fn span(&self) -> Option<(f64, f64)> {
        Some((self.points.first()?.0, self.points.last()?.0))
    }

    /// Interpolates the drawn value at `x` linearly in the scales of the axes. Returns `None`
    /// outside of the curve, with a relative tolerance of 1e-6 for rounding.
    pub fn at(&self, x: f64) -> Option<f64> {
        let (low, high) = self.span()?;
        if x < low * (1.0 - 1e-6) || x > high * (1.0 + 1e-6) {
            return None;
        }
        let after = self
            .points
            .partition_point(|(px, _)| *px < x)
            .min(self.points.len() - 1);
        let (x1, y1) = self.points[after];
        if x1 == x {
            return Some(y1);
        }
        let Some((x0, y0)) = after.checked_sub(1).map(|before| self.points[before]) else {
            return Some(y1);
        };
        let fraction = ((x.ln() - x0.ln()) / (x1.ln() - x0.ln())).clamp(0.0, 1.0);
        let [from, to] = [y0, y1].map(|y| self.scale.scaled(y));
        Some(self.scale.unscaled(from + fraction * (to - from)))
    }
}

/// Mean of several repeats with its band.
#[derive(Clone, Debug, PartialEq)]
pub struct Band {
    /// Points `(x, mean)`. The mean is geometric on a logarithmic axis.
    pub mean: Vec<(f64, f64)>,
    /// Lower and upper end at each point; empty for a single run.
    pub ends: Vec<(f64, f64)>,
    /// Meaning of the ends.
    pub kind: BandKind,
}

/// Meaning of the ends of a band.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum BandKind {
    /// Single run without a band.
    Single,
    /// Range of two runs, which are too few for a confidence interval.
    Range,
    /// 95 % confidence interval of the mean by Student's t, computed in the scale of the axis.
    Confidence,
}

impl BandKind {
    /// Returns the kind for a number of runs.
    pub fn for_runs(runs: usize) -> BandKind {
        match runs {
            0 | 1 => BandKind::Single,
            2 => BandKind::Range,
            _ => BandKind::Confidence,
        }
    }
}

/// Mean and spread of one value over several repeats.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Mean over the repeats, geometric on a logarithmic axis.
    pub mean: f64,
    /// Lower and upper end, as described by [`BandKind::for_runs`]. Both are the mean for a single
    /// run.
    pub ends: (f64, f64),
}

impl Spread {
    /// Computes the spread of values that the scale accepts. Returns `None` if there are none.
    pub fn from_values(scale: Scale, values: &[f64]) -> Option<Spread> {
        let scaled: Vec<f64> = values.iter().map(|v| scale.scaled(*v)).collect();
        let (mean, half) = mean_and_interval(&scaled);
        let ends = match BandKind::for_runs(scaled.len()) {
            BandKind::Confidence => (mean - half.unwrap_or(0.0), mean + half.unwrap_or(0.0)),
            _ => scaled
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| {
                    (a.min(*v), b.max(*v))
                }),
        };
        (!values.is_empty()).then(|| Spread {
            mean: scale.unscaled(mean),
            ends: (scale.unscaled(ends.0), scale.unscaled(ends.1)),
        })
    }
}

/// Computes the band of repeats over the range of x that all of them cover. A single run is its own
/// mean. Returns `None` if there are no points or the runs do not overlap.
pub fn band(curves: &[MetricCurve]) -> Option<Band> {
    let curves: Vec<&MetricCurve> = curves.iter().filter(|c| !c.points.is_empty()).collect();
    let scale = curves.first()?.scale;
    if let [only] = curves.as_slice() {
        return Some(Band {
            mean: only.points.clone(),
            ends: Vec::new(),
            kind: BandKind::Single,
        });
    }
    let low = curves
        .iter()
        .filter_map(|c| c.span())
        .map(|(low, _)| low)
        .fold(f64::NEG_INFINITY, f64::max);
    let high = curves
        .iter()
        .filter_map(|c| c.span())
        .map(|(_, high)| high)
        .fold(f64::INFINITY, f64::min);
    if low > high {
        return None;
    }
    let kind = BandKind::for_runs(curves.len());
    let mut band = Band {
        mean: Vec::new(),
        ends: Vec::new(),
        kind,
    };
    for step in 0..STEPS {
        let x = low * (high / low).powf(step as f64 / (STEPS - 1) as f64);
        let values: Vec<f64> = curves.iter().filter_map(|c| c.at(x)).collect();
        if values.len() < curves.len() {
            continue;
        }
        let Some(spread) = Spread::from_values(scale, &values) else {
            continue;
        };
        band.mean.push((x, spread.mean));
        band.ends.push(spread.ends);
        if low == high {
            break;
        }
    }
    Some(band)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use lumbre_metrics::MetricSpec;

    fn rmse(points: &[(f64, f64)]) -> MetricCurve {
        MetricCurve::new(
            MetricDisplay::for_metric(&MetricSpec::new("rmse", "rmse", BTreeMap::new()).unwrap()),
            points.iter().copied(),
        )
    }

    #[test]
    fn a_power_law_is_interpolated_exactly() {
        let points = [
            (1.0, 3.0),
            (1.0, 1.0),
            (100.0, 0.1),
            (50.0, 9.0),
            (200.0, 0.0),
        ];
        let curve = rmse(&points);
        assert_eq!(
            curve.points,
            [(1.0, 1.0), (100.0, 0.1)],
            "the last point at an x counts; points that go back in x or are zero are dropped"
        );
        assert!((curve.at(10.0).unwrap() - 0.1f64.sqrt()).abs() < 1e-12);
        assert_eq!((curve.at(0.5), curve.at(101.0)), (None, None));
        assert_eq!((curve.at(1.0), curve.at(100.0)), (Some(1.0), Some(0.1)));
    }

    #[test]
    fn the_band_of_three_is_a_t_interval_of_logarithms() {
        let factors = [0.5, 1.0, 2.0];
        let curves: Vec<MetricCurve> = factors
            .iter()
            .map(|f| rmse(&[(1.0, *f), (4.0, f / 2.0)]))
            .collect();
        let band = band(&curves).unwrap();
        assert_eq!(band.kind, BandKind::Confidence);
        let (x, mean) = band.mean[0];
        assert!((x - 1.0).abs() < 1e-12 && (mean - 1.0).abs() < 1e-12);
        // Logarithms are -ln 2, 0, ln 2: standard deviation ln 2, t = 4.30265.
        let half = 4.302_652_73 * 2f64.ln() / 3f64.sqrt();
        assert!(
            (band.ends[0].1.ln() - half).abs() < 1e-6 && (band.ends[0].0.ln() + half).abs() < 1e-6
        );
    }

    #[test]
    fn two_runs_have_a_range_where_they_overlap() {
        let band = band(&[
            rmse(&[(1.0, 1.0), (4.0, 0.5)]),
            rmse(&[(2.0, 0.8), (8.0, 0.4)]),
        ])
        .unwrap();
        assert_eq!(band.kind, BandKind::Range);
        assert!(
            (band.mean[0].0 - 2.0).abs() < 1e-12
                && (band.mean.last().unwrap().0 - 4.0).abs() < 1e-9
        );
        assert!((band.ends[0].1 - 0.8).abs() < 1e-9, "{:?}", band.ends[0]);
        assert_eq!(
            super::band(&[rmse(&[(1.0, 1.0)]), rmse(&[(2.0, 1.0)])]),
            None
        );
        assert_eq!(
            super::band(&[rmse(&[(1.0, 1.0)])]).unwrap().kind,
            BandKind::Single
        );
    }
}
