//! How long measuring a picture takes.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use serde_json::{Value as Json, json};

use crate::experiment::processor;
use crate::film::Image;
use crate::math::rng::{pcg4d, unit};
use crate::math::stats::median;
use crate::metrics::gauge::Gauge;
use crate::metrics::{METRICS, MetricSpec};

/// The pictures' width and height in pixels.
pub(super) const SIZE: [u32; 2] = [1280, 720];

/// The metrics of the first source's protocol, which `scripts/overnight.lua` measures every half second.
pub(super) const PROTOCOL: [&str; 4] = ["mse", "rmse", "ssim", "flip"];

/// The time that one metric takes, or several together.
pub struct Row {
    metric: String,
    seconds: f64,
    /// Processor time of all threads, where the system tells.
    processor_s: Option<f64>,
}

/// Times every metric with its default options on a noisy picture and another of the same, and those of the protocol
/// together as a night measures them, whose reference stays the same: the median of `repeats` after one for warming up,
/// on as many threads as there are cores.
pub fn measure(repeats: usize) -> Vec<Row> {
    let (image, reference) = (picture(1), Arc::new(picture(2)));
    let me = std::process::id();
    let time = |metric: String, run: &dyn Fn()| {
        run();
        let (mut seconds, mut processor) = (Vec::new(), Vec::new());
        for _ in 0..repeats {
            let (start, before) = (Instant::now(), processor::of_process(me));
            run();
            seconds.push(start.elapsed().as_secs_f64());
            processor
                .extend(before.zip(processor::of_process(me)).map(|(before, after)| (after - before).as_secs_f64()));
        }
        let processor_s = (!processor.is_empty()).then(|| median(processor));
        Row { metric, seconds: median(seconds), processor_s }
    };
    // The values are of no interest; sizes agree and suffice for every window.
    let alone = |spec: MetricSpec| {
        time(spec.row.name.to_owned(), &|| drop(std::hint::black_box(spec.eval(&image, &reference))))
    };
    let mut rows: Vec<Row> = METRICS.iter().filter_map(|m| spec(m.name)).map(alone).collect();
    let protocol = of_a_night();
    let gauge = Gauge::new(&protocol, Arc::clone(&reference));
    rows.push(time(PROTOCOL.join(" + "), &|| drop(std::hint::black_box(gauge.eval(&image)))));
    rows
}

fn spec(name: &str) -> Option<MetricSpec> {
    MetricSpec::new(name, name, BTreeMap::new()).ok()
}

/// The metrics that the example of a night measures.
pub(super) fn of_a_night() -> Vec<MetricSpec> {
    PROTOCOL.iter().filter_map(|name| spec(name)).collect()
}

/// Patches of colour under noise of a given seed.
pub(super) fn picture(seed: u32) -> Image {
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
        let spent = row.processor_s.map_or_else(String::new, |s| format!(", {:.1} ms of processor time", s * 1e3));
        format!("{:<37}{:>9.1} ms{spent}\n", format!("{}, {}x{}", row.metric, SIZE[0], SIZE[1]), row.seconds * 1e3)
    };
    rows.iter().map(line).collect()
}

/// Seconds by metric, of the clock and of processors.
pub fn to_json(rows: &[Row]) -> Json {
    let seconds: serde_json::Map<_, _> = rows.iter().map(|r| (r.metric.clone(), r.seconds.into())).collect();
    let spent: serde_json::Map<_, _> = rows.iter().map(|r| (r.metric.clone(), r.processor_s.into())).collect();
    json!({ "width": SIZE[0], "height": SIZE[1], "seconds": seconds, "processor_s": spent })
}
