//! Conversion of metrics to drawn values.

use crate::plot::axis::Scale;
use lumbre_metrics::floor::Noise;
use lumbre_metrics::{Better, MetricSpec};

/// Conversion of a metric to its drawn value. Errors have a logarithmic axis. A metric with a best
/// value of 1 is drawn as 1 − value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MetricDisplay {
    /// Scale of the axis.
    pub scale: Scale,
    /// Best value, if the distance from it is drawn.
    complement: Option<f64>,
    /// Whether the absolute value is drawn.
    magnitude: bool,
    /// Whether the metric is the root of a mean squared error.
    root: bool,
}

impl MetricDisplay {
    /// Returns the display of a metric.
    pub fn for_metric(metric: &MetricSpec) -> MetricDisplay {
        let (scale, complement) = match metric.row.perfect {
            best if best == f64::INFINITY => (Scale::Linear, None),
            0.0 => (Scale::Log, None),
            best => (Scale::Log, Some(best)),
        };
        MetricDisplay {
            scale,
            complement,
            magnitude: metric.row.better == Better::NearZero,
            root: metric.row.noise == Noise::AddsSquared,
        }
    }

    /// Converts a value of the metric to the drawn value, or `None` if the axis does not accept it.
    pub fn drawn_value(self, value: f64) -> Option<f64> {
        let value = if self.magnitude { value.abs() } else { value };
        let value = self.complement.map_or(value, |best| best - value);
        self.scale.accepts(value).then_some(value)
    }

    /// Returns the best value if the distance from it is drawn.
    pub fn complement(self) -> Option<f64> {
        self.complement
    }

    /// Returns whether the absolute value is drawn.
    pub fn is_magnitude(self) -> bool {
        self.magnitude
    }

    /// Returns whether the metric is the root of a mean squared error.
    pub fn is_root(self) -> bool {
        self.root
    }

    /// Converts a drawn value back to a value of the metric. The sign of an absolute value is lost.
    pub fn metric_value(self, drawn: f64) -> f64 {
        self.complement.map_or(drawn, |best| best - drawn)
    }

    /// Converts the ends of an interval of drawn values back to values of the metric, the lower one
    /// first.
    pub fn metric_ends(self, (low, high): (f64, f64)) -> (f64, f64) {
        match self.complement {
            Some(best) => (best - high, best - low),
            None => (low, high),
        }
    }

    /// Returns the label of the drawn value, such as `RMSE`, `1 − SSIM` or `|bias|`.
    pub fn label(self, metric: &MetricSpec) -> String {
        let has_own_column = metric.column != metric.row.name;
        let name = if has_own_column {
            format!("{} ({})", metric.row.label, metric.column)
        } else {
            metric.row.label.to_owned()
        };
        match self.complement {
            Some(best) => format!("{best} − {name}"),
            None if self.magnitude => format!("|{name}|"),
            None => name,
        }
    }
}
