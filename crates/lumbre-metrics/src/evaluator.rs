//! Measures many images against one reference.
//!
//! Everything that depends on the reference alone is computed once, and each tone map is applied
//! once to each image, however many metrics use it.

use super::tonemap::Tonemap;
use super::{MetricError, MetricSpec, Prepared};
use lumbre_light::film::{Image, SharedImage};

/// A list of metrics, prepared for one reference. Holds a tone-mapped copy of the reference for
/// every tone map, and the prepared state of each metric (20 bytes per pixel for FLIP).
pub struct Evaluator<'a> {
    metrics: &'a [MetricSpec],
    reference: SharedImage,
    /// Tone maps that the metrics use, each once, with the tone-mapped reference.
    views: Vec<(Tonemap, Image)>,
    /// Prepared state of each metric.
    prepared: Vec<Option<Prepared>>,
}

impl<'a> Evaluator<'a> {
    /// Prepares metrics for a reference.
    pub fn new(metrics: &'a [MetricSpec], reference: SharedImage) -> Evaluator<'a> {
        let mut views: Vec<(Tonemap, Image)> = Vec::new();
        for on in metrics.iter().filter_map(MetricSpec::tonemap) {
            if !views.iter().any(|(known, _)| *known == on) {
                views.push((on, on.apply(&reference)));
            }
        }
        let mut gauge = Evaluator {
            metrics,
            reference,
            views,
            prepared: Vec::new(),
        };
        let prepare = |spec: &MetricSpec| {
            spec.row
                .prepare
                .map(|prepare| prepare(gauge.truth(spec), spec))
        };
        gauge.prepared = metrics.iter().map(prepare).collect();
        gauge
    }

    /// Returns the values of all metrics for an image, in the order of the metrics; equal to
    /// [`MetricSpec::eval`].
    ///
    /// # Errors
    /// When the size differs from that of the reference, or is too small for a metric.
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

    /// Index of a metric's tone map, if it has one.
    fn view(&self, spec: &MetricSpec) -> Option<usize> {
        let on = spec.tonemap()?;
        self.views.iter().position(|(known, _)| *known == on)
    }

    /// Reference as the metric receives it, tone-mapped if it has a tone map.
    fn truth(&self, spec: &MetricSpec) -> &Image {
        self.view(spec)
            .map_or(&self.reference, |view| &self.views[view].1)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::sync::Arc;

    use crate::METRICS;
    use crate::evaluator::*;
    use lumbre_light::value::Value;

    #[test]
    fn every_metric_has_the_same_value_as_alone() {
        let picture = |seed: f32| {
            Image::from_fn(40, 27, |x, y| {
                [0, 1, 2].map(|c| ((x * 7 + y * 3 + c) as f32 * seed).sin().abs() * 1.5)
            })
        };
        let on = Value::Map(BTreeMap::from([("kind".to_owned(), Value::from("srgb"))]));
        let mut metrics: Vec<MetricSpec> = Vec::new();
        for row in METRICS {
            metrics.push(MetricSpec::new(row.name, row.name, BTreeMap::new()).unwrap());
            let shown = BTreeMap::from([("on".to_owned(), on.clone())]);
            metrics.extend(MetricSpec::new(
                &format!("{}_on", row.name),
                row.name,
                shown,
            ));
        }
        let reference = Arc::new(picture(0.7));
        let gauge = Evaluator::new(&metrics, Arc::clone(&reference));
        assert_eq!(gauge.views.len(), 1);
        for seed in [0.31, 0.7] {
            let image = picture(seed);
            let alone: Vec<u64> = metrics
                .iter()
                .map(|m| m.eval(&image, &reference).unwrap().to_bits())
                .collect();
            let together: Vec<u64> = gauge
                .eval(&image)
                .unwrap()
                .iter()
                .map(|x| x.to_bits())
                .collect();
            assert_eq!(together, alone);
        }
        assert!(matches!(
            gauge.eval(&Image::new(40, 26)),
            Err(MetricError::Size { .. })
        ));
    }

    #[test]
    fn metrics_of_one_reference_may_have_different_tone_maps() {
        let metric = |exposure: f64| {
            let map = [
                ("kind", Value::from("srgb")),
                ("exposure", Value::Num(exposure)),
            ];
            let map = map.map(|(key, value)| (key.to_owned(), value));
            let options = BTreeMap::from([("on".to_owned(), Value::Map(map.into()))]);
            MetricSpec::new(&format!("rmse_{exposure}"), "rmse", options).unwrap()
        };
        let metrics = [metric(-3.0), metric(0.0), metric(1.0)];
        let flat = |x: f32| Image::from_fn(4, 4, |_, _| [x; 3]);
        let reference = Arc::new(flat(0.4));
        let together = Evaluator::new(&metrics, Arc::clone(&reference)).eval(&flat(0.2));
        let alone = metrics
            .each_ref()
            .map(|metric| metric.eval(&flat(0.2), &reference));
        assert_eq!(together.unwrap(), alone.map(Result::unwrap));
    }
}
