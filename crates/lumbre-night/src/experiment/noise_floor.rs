//! Noise floors of references, and errors with the noise of the reference subtracted.

use std::sync::Arc;

use super::plan::Plan;
use lumbre_light::film::Image;
use lumbre_metrics::MetricSpec;
use lumbre_metrics::floor::{Floor, Halves};

/// The value that the true picture would measure against one reference, for each metric in the
/// order of the plan's columns; `None` for metrics without a floor. Empty if the noise of the
/// reference is not known.
pub type NoiseFloors = Arc<Vec<Option<Floor>>>;

/// Pictures of the two independent halves of a reference.
#[derive(Clone, Debug, PartialEq)]
pub struct HalfImages {
    /// Mean over the samples of each half.
    pub means: [Image; 2],
    /// Samples per pixel of each half.
    pub samples: [u64; 2],
}

/// Relative difference of two halves up to which a pixel has no noise.
const ROUNDING: f32 = 1e-5;

impl HalfImages {
    /// Returns the shares of pixels without noise: black ones, which are background or which no
    /// path has lit, and others, which are background of one colour.
    pub fn shares_without_noise(&self) -> [f64; 2] {
        let [a, b] = &self.means;
        let is_equal = |(a, b): (&f32, &f32)| (a - b).abs() <= ROUNDING * a.abs().max(b.abs());
        let pixels = a.data.iter().zip(&b.data);
        let equal = pixels.filter(|(a, b)| a.iter().zip(*b).all(is_equal));
        let (black, coloured): (Vec<_>, Vec<_>) = equal.partition(|(a, _)| **a == [0.0; 3]);
        [black, coloured].map(|some| some.len() as f64 / a.data.len().max(1) as f64)
    }
}

/// Returns the noise floor of each metric against a reference. A metric that cannot be computed has
/// none; its error is reported when it is measured.
pub fn floors(
    metrics: &[MetricSpec],
    reference: &Image,
    halves: &HalfImages,
) -> Vec<Option<Floor>> {
    let means = [&halves.means[0], &halves.means[1]];
    let floor = |m: &MetricSpec| {
        m.floor(
            reference,
            Halves {
                means,
                samples: halves.samples,
            },
        )
        .ok()
        .flatten()
    };
    metrics.iter().map(floor).collect()
}

/// Returns the columns of net errors, from which the noise of the reference is subtracted, such as
/// `rmse_net` for `rmse`, each with the index of its metric. Omitted are metrics without a floor or
/// without a net error, and columns whose name a script has given to another metric.
pub fn net_columns(plan: &Plan, floors: &[Option<Floor>]) -> Vec<(usize, String)> {
    let metrics = &plan.measure.metrics;
    let known = metrics
        .iter()
        .zip(floors)
        .enumerate()
        .filter(|(_, (m, f))| f.is_some_and(|f| m.net(1.0, f.value).is_some()));
    let named = known.map(|(i, (m, _))| (i, format!("{}_net", m.column)));
    named
        .filter(|(_, name)| metrics.iter().all(|m| m.column != *name))
        .collect()
}

/// Returns the values of [`net_columns`] for the given metric values; NaN where a value is missing.
pub fn net_values(plan: &Plan, floors: &[Option<Floor>], metrics: &[f64]) -> Vec<f64> {
    let net = |(i, _): (usize, String)| {
        let value = metrics.get(i).copied().zip(floors[i]);
        value
            .and_then(|(value, floor)| plan.measure.metrics[i].net(value, floor.value))
            .unwrap_or(f64::NAN)
    };
    net_columns(plan, floors).into_iter().map(net).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_that_differ_by_rounding_only_have_no_noise() {
        let half = |noise: f32| {
            Image::from_fn(4, 1, |x, _| match x {
                0 => [0.0; 3],
                1 | 2 => [0.7 * (1.0 + 0.1 * noise * 1e-6), 0.2, 0.1],
                _ => [1.0 + noise, 0.5, 0.5],
            })
        };
        let halves = HalfImages {
            means: [half(0.0), half(0.5)],
            samples: [8, 9],
        };
        assert_eq!(halves.shares_without_noise(), [0.25, 0.5]);
    }
}
