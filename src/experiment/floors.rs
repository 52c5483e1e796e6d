//! The noise floors of a reference, and errors without them.

use std::sync::Arc;

use super::plan::Plan;
use crate::film::Image;
use crate::metrics::MetricSpec;
use crate::metrics::floor::Halves;

/// The value that the true picture would have against one reference, for each metric in the order of the plan's
/// columns; `None` for metrics of which that cannot be said. Empty where nothing is known of the reference's noise.
pub type Floors = Arc<Vec<Option<f64>>>;

/// The pictures of a reference's two independent halves.
#[derive(Clone, Debug, PartialEq)]
pub struct HalfImages {
    /// Their means over samples.
    pub means: [Image; 2],
    /// Their samples per pixel.
    pub samples: [u64; 2],
}

/// The floors of a reference. A metric that cannot be computed has none here, and says so where it is measured.
pub fn floors(metrics: &[MetricSpec], reference: &Image, halves: &HalfImages) -> Vec<Option<f64>> {
    let means = [&halves.means[0], &halves.means[1]];
    let floor = |m: &MetricSpec| m.floor(reference, Halves { means, samples: halves.samples }).ok().flatten();
    metrics.iter().map(floor).collect()
}

/// The columns of errors from which the reference's own is taken off, and for each the index of its metric:
/// `rmse_net` for `rmse`. Metrics without a floor, or of which it cannot be taken off, have none; nor have those whose
/// name a script has given to another metric.
pub fn net_columns(plan: &Plan, floors: &[Option<f64>]) -> Vec<(usize, String)> {
    let metrics = &plan.measure.metrics;
    let known = metrics.iter().zip(floors).enumerate().filter(|(_, (m, f))| f.is_some_and(|f| m.net(1.0, f).is_some()));
    let named = known.map(|(i, (m, _))| (i, format!("{}_net", m.column)));
    named.filter(|(_, name)| metrics.iter().all(|m| m.column != *name)).collect()
}

/// The values of [`net_columns`], given those of the metrics.
pub fn net_values(plan: &Plan, floors: &[Option<f64>], metrics: &[f64]) -> Vec<f64> {
    let net = |(i, _): (usize, String)| {
        let value = metrics.get(i).copied().zip(floors[i]);
        value.and_then(|(value, floor)| plan.measure.metrics[i].net(value, floor)).unwrap_or(f64::NAN)
    };
    net_columns(plan, floors).into_iter().map(net).collect()
}
