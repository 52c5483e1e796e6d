//! How long measuring a picture takes.

use std::collections::BTreeMap;
use std::time::Instant;

use serde_json::{Value as Json, json};

use crate::film::Image;
use crate::math::rng::{pcg4d, unit};
use crate::math::stats::median;
use crate::metrics::{METRICS, MetricSpec};

/// The pictures' width and height in pixels.
const SIZE: [u32; 2] = [1280, 720];

/// The time that one metric takes.
pub struct Row {
    metric: &'static str,
    seconds: f64,
}

/// Times every metric with its default options on a noisy picture and another of the same: the median of `repeats`
/// after one for warming up, on as many threads as there are cores.
pub fn measure(repeats: usize) -> Vec<Row> {
    let (image, reference) = (picture(1), picture(2));
    let row = |spec: MetricSpec| {
        let run = || {
            let start = Instant::now();
            // The value is of no interest; sizes agree and suffice for every window.
            let _ = std::hint::black_box(spec.eval(&image, &reference));
            start.elapsed().as_secs_f64()
        };
        run();
        Row { metric: spec.row.name, seconds: median((0..repeats).map(|_| run())) }
    };
    METRICS.iter().filter_map(|m| MetricSpec::new(m.name, m.name, BTreeMap::new()).ok()).map(row).collect()
}

/// Patches of colour under noise of a given seed.
fn picture(seed: u32) -> Image {
    Image::from_fn(SIZE[0], SIZE[1], |x, y| {
        [0, 1, 2].map(|c| {
            let [grain, patch] = [pcg4d([x, y, c, seed]), pcg4d([x / 16, y / 16, c, 0])].map(|w| unit(w[0]));
            0.2 * grain + 0.7 * patch
        })
    })
}

/// The lines of the table for people.
pub fn table(rows: &[Row]) -> String {
    let line = |row: &Row| {
        format!("{:<37}{:>9.1} ms\n", format!("{} of {}x{}", row.metric, SIZE[0], SIZE[1]), row.seconds * 1e3)
    };
    rows.iter().map(line).collect()
}

/// Seconds by metric.
pub fn to_json(rows: &[Row]) -> Json {
    let seconds: serde_json::Map<_, _> = rows.iter().map(|r| (r.metric.to_owned(), r.seconds.into())).collect();
    json!({ "width": SIZE[0], "height": SIZE[1], "seconds": seconds })
}
