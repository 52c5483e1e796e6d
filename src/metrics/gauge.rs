//! Many pictures measured against one reference: what follows from the reference alone is computed once, and every tone
//! map is applied once to each picture, however many metrics look through it.

use super::tonemap::Tonemap;
use super::{MetricError, MetricSpec, Prepared};
use crate::film::{Image, SharedImage};

/// Metrics and the reference that they measure against. Besides the reference it holds a copy of it for every tone map,
/// and what the metrics have prepared: 20 bytes a pixel for FLIP.
pub struct Gauge<'a> {
    metrics: &'a [MetricSpec],
    reference: SharedImage,
    /// The tone maps that metrics ask for, each once, with the reference behind them.
    views: Vec<(Tonemap, Image)>,
    /// What each metric has prepared.
    prepared: Vec<Option<Prepared>>,
}

impl<'a> Gauge<'a> {
    /// Prepares metrics for a reference.
    pub fn new(metrics: &'a [MetricSpec], reference: SharedImage) -> Gauge<'a> {
        let mut views: Vec<(Tonemap, Image)> = Vec::new();
        for on in metrics.iter().filter_map(MetricSpec::tonemap) {
            if !views.iter().any(|(known, _)| *known == on) {
                views.push((on, on.apply(&reference)));
            }
        }
        let mut gauge = Gauge { metrics, reference, views, prepared: Vec::new() };
        let prepare = |spec: &MetricSpec| spec.row.prepare.map(|prepare| prepare(gauge.truth(spec), spec));
        gauge.prepared = metrics.iter().map(prepare).collect();
        gauge
    }

    /// The values of all metrics for an image, in their order: those of [`MetricSpec::eval`].
    ///
    /// # Errors
    /// When its size is another than the reference's, or too small for a metric.
    pub fn eval(&self, image: &Image) -> Result<Vec<f64>, MetricError> {
        for spec in self.metrics {
            spec.check_sizes(image, &self.reference)?;
        }
        let seen: Vec<Image> = self.views.iter().map(|(on, _)| on.apply(image)).collect();
        let value = |(spec, prepared): (&MetricSpec, &Option<Prepared>)| {
            let image = self.view(spec).map_or(image, |view| &seen[view]);
            match prepared {
                Some(of) => of(image),
                None => (spec.row.eval)(image, self.truth(spec), spec),
            }
        };
        Ok(self.metrics.iter().zip(&self.prepared).map(value).collect())
    }

    /// The place of a metric's tone map, if it has one.
    fn view(&self, spec: &MetricSpec) -> Option<usize> {
        let on = spec.tonemap()?;
        self.views.iter().position(|(known, _)| *known == on)
    }

    /// The reference as a metric sees it.
    fn truth(&self, spec: &MetricSpec) -> &Image {
        self.view(spec).map_or(&self.reference, |view| &self.views[view].1)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::sync::Arc;

    use super::*;
    use crate::metrics::METRICS;
    use crate::value::Value;

    #[test]
    fn every_metric_has_the_same_value_as_alone() {
        let picture = |seed: f32| {
            Image::from_fn(40, 27, |x, y| [0, 1, 2].map(|c| ((x * 7 + y * 3 + c) as f32 * seed).sin().abs() * 1.5))
        };
        let on = Value::Map(BTreeMap::from([("kind".to_owned(), Value::from("srgb"))]));
        let mut metrics: Vec<MetricSpec> = Vec::new();
        for row in METRICS {
            metrics.push(MetricSpec::new(row.name, row.name, BTreeMap::new()).unwrap());
            let shown = BTreeMap::from([("on".to_owned(), on.clone())]);
            metrics.extend(MetricSpec::new(&format!("{}_on", row.name), row.name, shown));
        }
        let reference = Arc::new(picture(0.7));
        let gauge = Gauge::new(&metrics, Arc::clone(&reference));
        assert_eq!(gauge.views.len(), 1);
        for seed in [0.31, 0.7] {
            let image = picture(seed);
            let alone: Vec<u64> = metrics.iter().map(|m| m.eval(&image, &reference).unwrap().to_bits()).collect();
            let together: Vec<u64> = gauge.eval(&image).unwrap().iter().map(|x| x.to_bits()).collect();
            assert_eq!(together, alone);
        }
        assert!(matches!(gauge.eval(&Image::new(40, 26)), Err(MetricError::Size { .. })));
    }
}
