//! Evaluation time of the metrics.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use lumbre::cli::bench::backends::{PROTOCOL, protocol_metrics};
use lumbre_light::film::Image;
use lumbre_light::math::rng::{pcg4d, unit};
use lumbre_light::math::stats::median;
use lumbre_metrics::evaluator::Evaluator;
use lumbre_metrics::{METRICS, MetricSpec};
use lumbre_night::experiment::processor_time;

/// Width and height of the images in pixels.
pub(super) const SIZE: [u32; 2] = [1280, 720];

/// Evaluation time of one metric, or of several together.
pub struct MetricCost {
    metric: String,
    seconds: f64,
    /// CPU time of all threads in seconds, if the system reports it.
    processor_s: Option<f64>,
}

/// Times every metric with its default options on two noisy images, and the metrics of the protocol
/// together as a night evaluates them, with a fixed reference. Returns medians of `repeats`
/// evaluations after a warm-up, on as many threads as there are cores.
pub fn measure(repeats: usize) -> Vec<MetricCost> {
    let (image, reference) = (picture(1), Arc::new(picture(2)));
    let pid = std::process::id();
    let time = |metric: String, run: &dyn Fn()| {
        run();
        let (mut seconds, mut processor) = (Vec::new(), Vec::new());
        for _ in 0..repeats {
            let (start, before) = (Instant::now(), processor_time::process_time(pid));
            run();
            seconds.push(start.elapsed().as_secs_f64());
            processor.extend(
                before
                    .zip(processor_time::process_time(pid))
                    .map(|(before, after)| (after - before).as_secs_f64()),
            );
        }
        let processor_s = (!processor.is_empty()).then(|| median(processor));
        MetricCost {
            metric,
            seconds: median(seconds),
            processor_s,
        }
    };
    // The values are irrelevant; the images have equal sizes, large enough for every window.
    let time_metric = |spec: MetricSpec| {
        time(spec.row.name.to_owned(), &|| {
            drop(std::hint::black_box(spec.eval(&image, &reference)))
        })
    };
    let mut rows: Vec<MetricCost> = METRICS
        .iter()
        .filter_map(|m| spec(m.name))
        .map(time_metric)
        .collect();
    let protocol = protocol_metrics();
    let evaluator = Evaluator::new(&protocol, Arc::clone(&reference));
    rows.push(time(PROTOCOL.join(" + "), &|| {
        drop(std::hint::black_box(evaluator.eval(&image)))
    }));
    rows
}

fn spec(name: &str) -> Option<MetricSpec> {
    MetricSpec::new(name, name, BTreeMap::new()).ok()
}

/// Returns an image of colour patches with noise of a given seed.
pub(super) fn picture(seed: u32) -> Image {
    Image::from_fn(SIZE[0], SIZE[1], |x, y| {
        [0, 1, 2].map(|c| {
            let [grain, patch] =
                [pcg4d([x, y, c, seed]), pcg4d([x / 16, y / 16, c, 0])].map(|w| unit(w[0]));
            0.2 * grain + 0.7 * patch
        })
    })
}

/// Formats the times as text.
pub fn table(rows: &[MetricCost]) -> String {
    let line = |row: &MetricCost| {
        let spent = row
            .processor_s
            .map_or_else(String::new, |s| format!(", {:.1} ms CPU time", s * 1e3));
        format!(
            "{:<37}{:>9.1} ms{spent}\n",
            format!("{}, {}x{}", row.metric, SIZE[0], SIZE[1]),
            row.seconds * 1e3
        )
    };
    rows.iter().map(line).collect()
}
