//! The thread that measures: errors of pictures against a reference, and the difference between two
//! pictures.
//!
//! It measures the newest pictures only, and rests after each measurement, so that it leaves most of
//! the processor to the renderer and never delays the keys.

use std::io;
use std::sync::{Arc, Condvar, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::reference::{Reference, metrics};
use super::session::{Frame, SLOTS, Slot, lock};
use lumbre_metrics::MetricSpec;
use lumbre_metrics::evaluator::Evaluator;
use lumbre_metrics::floor::Halves;
use lumbre_night::experiment::WaveRow;

/// Time of rest after a measurement, in units of the time that it took.
const REST: f64 = 2.0;

/// Longest rest, so that the end of the thread does not take long.
const LONGEST_REST: Duration = Duration::from_millis(500);

/// The difference between the pictures of both slots.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// Index of the metric in [`metrics`].
    pub metric: usize,
    /// Value of the first picture against the second, or why there is none.
    pub value: Result<f64, String>,
    /// Expected value of two pictures with this noise that agree otherwise, if it is known.
    pub noise: Option<f64>,
    /// Samples per pixel of both pictures.
    pub samples: [u64; SLOTS],
}

/// A picture to measure, with the number of its request.
type Measurable = (u64, Arc<Frame>);

/// Next comparison to measure.
#[derive(Default)]
struct Wanted {
    reference: Option<Arc<Reference>>,
    pictures: [Option<Measurable>; SLOTS],
    pair: Option<(usize, [Arc<Frame>; SLOTS])>,
    closed: bool,
}

/// Results since they were last taken.
#[derive(Debug, Default)]
pub struct Measured {
    /// New measurements: slot, number of the request, and the values of all metrics.
    pub rows: Vec<(Slot, u64, WaveRow)>,
    /// Number of a reference with its noise floors by metric.
    pub floors: Option<(u64, Vec<Option<f64>>)>,
    /// Latest difference of the two settings.
    pub difference: Option<Difference>,
}

#[derive(Default)]
struct Shared {
    wanted: Mutex<Wanted>,
    changed: Condvar,
    measured: Mutex<Measured>,
}

/// A thread that measures. It ends when this is dropped.
pub struct Meter {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Meter {
    /// Starts the thread.
    ///
    /// # Errors
    /// If the thread cannot be started.
    pub fn start() -> io::Result<Meter> {
        let shared = Arc::new(Shared::default());
        let own = Arc::clone(&shared);
        let thread = std::thread::Builder::new()
            .name("measure".to_owned())
            .spawn(move || run(&own))?;
        Ok(Meter {
            shared,
            thread: Some(thread),
        })
    }

    /// Changes what is wanted.
    fn want(&self, change: impl FnOnce(&mut Wanted)) {
        change(&mut lock(&self.shared.wanted));
        self.shared.changed.notify_all();
    }

    /// Sets or removes the reference.
    pub fn set_reference(&self, reference: Option<Arc<Reference>>) {
        self.want(|wanted| {
            wanted.reference = reference;
            wanted.pictures = Default::default();
        });
    }

    /// Measures a picture of a slot against the reference, instead of one that waits.
    pub fn measure(&self, slot: Slot, request: u64, frame: Arc<Frame>) {
        self.want(|wanted| wanted.pictures[slot.index()] = Some((request, frame)));
    }

    /// Measures the difference of two pictures by the metric with this index, instead of a pair that
    /// waits.
    pub fn compare(&self, metric: usize, frames: [Arc<Frame>; SLOTS]) {
        self.want(|wanted| wanted.pair = Some((metric, frames)));
    }

    /// Returns what was measured since the last call.
    pub fn take(&self) -> Measured {
        std::mem::take(&mut lock(&self.shared.measured))
    }
}

impl Drop for Meter {
    fn drop(&mut self) {
        self.want(|wanted| wanted.closed = true);
        if let Some(thread) = self.thread.take() {
            // The panic hook has reported a panic of the thread.
            let _ = thread.join();
        }
    }
}

/// The reference with everything that depends on it alone.
struct Prepared<'a> {
    number: u64,
    /// Indices of the metrics that its size allows.
    indices: Vec<usize>,
    evaluator: Evaluator<'a>,
}

/// Measures until the thread is closed.
fn run(shared: &Shared) {
    let all = metrics();
    loop {
        // The metrics that a reference allows are known when it is set.
        let reference = lock(&shared.wanted).reference.clone();
        let able: Vec<usize> = reference.as_ref().map_or_else(Vec::new, |reference| {
            let image = &reference.frame.image;
            let fits = |spec: &MetricSpec| {
                let smallest = (spec.row.smallest)(spec);
                image.width >= smallest && image.height >= smallest
            };
            (0..all.len()).filter(|i| fits(&all[*i])).collect()
        });
        let specs: Vec<MetricSpec> = able.iter().map(|i| all[*i].clone()).collect();
        let prepared = reference.map(|reference| {
            let floors = reference.floors(&all);
            lock(&shared.measured).floors = Some((reference.number, floors));
            Prepared {
                number: reference.number,
                indices: able,
                evaluator: Evaluator::new(&specs, Arc::clone(&reference.frame.image)),
            }
        });
        if serve(shared, &all, prepared.as_ref()) {
            return;
        }
    }
}

/// Measures until the reference changes. Returns whether the thread is closed.
fn serve(shared: &Shared, all: &[MetricSpec], prepared: Option<&Prepared>) -> bool {
    loop {
        let (pictures, pair) = {
            let mut wanted = lock(&shared.wanted);
            loop {
                let number = wanted.reference.as_ref().map(|reference| reference.number);
                if wanted.closed || number != prepared.map(|prepared| prepared.number) {
                    return wanted.closed;
                }
                if wanted.pair.is_some() || wanted.pictures.iter().any(Option::is_some) {
                    break;
                }
                wanted = shared
                    .changed
                    .wait(wanted)
                    .unwrap_or_else(std::sync::PoisonError::into_inner);
            }
            (std::mem::take(&mut wanted.pictures), wanted.pair.take())
        };
        let start = Instant::now();
        if let Some((metric, frames)) = pair {
            lock(&shared.measured).difference = Some(difference(all, metric, &frames));
        }
        for (slot, picture) in Slot::ALL.into_iter().zip(pictures) {
            if let (Some((request, frame)), Some(prepared)) = (picture, prepared)
                && let Some(row) = errors(all.len(), prepared, &frame)
            {
                lock(&shared.measured).rows.push((slot, request, row));
            }
        }
        std::thread::sleep(start.elapsed().mul_f64(REST).min(LONGEST_REST));
    }
}

/// Measures a picture against the reference; `None` if the sizes differ.
fn errors(count: usize, prepared: &Prepared, frame: &Frame) -> Option<WaveRow> {
    let values = prepared.evaluator.eval(&frame.image).ok()?;
    let mut metrics = vec![f64::NAN; count];
    for (index, value) in prepared.indices.iter().zip(values) {
        metrics[*index] = value;
    }
    Some(WaveRow {
        samples: frame.samples,
        render_s: frame.render_s,
        paths: frame.paths,
        rays: frame.rays,
        invalid: frame.invalid,
        metrics,
        ..WaveRow::default()
    })
}

/// Measures the difference between two pictures, and the part of it that their noise explains.
fn difference(all: &[MetricSpec], metric: usize, frames: &[Arc<Frame>; SLOTS]) -> Difference {
    let spec = &all[metric.min(all.len() - 1)];
    let [a, b] = frames;
    let noise = |frame: &Frame| {
        let (means, samples) = frame.halves()?;
        let halves = Halves {
            means: [&means[0], &means[1]],
            samples,
        };
        Some(spec.floor(&frame.image, halves).ok()??.value)
    };
    let known = spec.sum_of_noise([0.0; 2]).is_some();
    let both = known.then(|| Some([noise(a)?, noise(b)?])).flatten();
    Difference {
        metric,
        value: spec.eval(&a.image, &b.image).map_err(|e| e.to_string()),
        noise: both.and_then(|both| spec.sum_of_noise(both)),
        samples: [a.samples, b.samples],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumbre_light::film::Image;

    #[test]
    fn errors_are_at_the_places_of_their_metrics() {
        let all = metrics();
        let picture = |x: f32| Arc::new(Image::from_fn(16, 12, |_, _| [x; 3]));
        let reference = picture(0.5);
        // The first metric cannot be computed.
        let indices: Vec<usize> = (1..all.len()).collect();
        let prepared = Prepared {
            number: 1,
            indices: indices.clone(),
            evaluator: Evaluator::new(&all[1..], Arc::clone(&reference)),
        };
        let frame = Frame {
            image: picture(0.75),
            samples: 4,
            render_s: 1.0,
            paths: 1,
            rays: 1,
            invalid: 0,
            noise: None,
            variance: None,
            part: None,
            layers: Vec::new(),
        };
        let row = errors(all.len(), &prepared, &frame).unwrap();
        assert!(row.metrics[0].is_nan());
        for index in indices {
            let alone = all[index].eval(&frame.image, &reference).unwrap();
            assert_eq!(row.metrics[index], alone, "{}", all[index].column);
        }
    }
}
