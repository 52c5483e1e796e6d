//! How much work one dispatch gets, so that it takes about [`TARGET_S`]: systems take a device for lost whose dispatches
//! last seconds, and a long one cannot be interrupted. A few of them are handed over together, so that the device goes on
//! while the host wakes up.

/// Seconds that a dispatch shall take.
pub const TARGET_S: f64 = 0.08;

/// Samples of pixels in the first dispatch, when nothing is known yet.
const START: f64 = 16_384.0;

/// By how much a dispatch may grow over the one before.
const GROWTH: f64 = 8.0;

/// The most samples of a pixel in one dispatch, whose counters have 32 bits.
const MOST_SAMPLES: u64 = 1 << 16;

/// Dispatches of one submission.
pub const TOGETHER: usize = 4;

/// Dispatches of a wave that nobody has asked for yet, at most; no more than the host needs between waves, and so few that
/// their rays can be counted in 32 bits at 6 Grays/s.
pub const AHEAD: usize = 8;

/// A part of a wave: so many samples of every pixel of some rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// Samples of the wave that came before.
    pub done: u64,
    /// Samples of every pixel.
    pub samples: u32,
    /// The first row.
    pub row: u32,
    /// The number of rows.
    pub rows: u32,
}

impl Part {
    /// Samples of pixels.
    pub fn work(&self, width: u32) -> f64 {
        f64::from(width) * f64::from(self.rows) * f64::from(self.samples)
    }
}

/// A wave that is being cut into parts: all rows of some samples, then of the next.
#[derive(Clone, Copy, Debug)]
pub struct Cut {
    size: [u32; 2],
    samples: u64,
    /// Where the next part begins; of no samples before a row of new ones.
    next: Part,
}

impl Cut {
    /// A wave of so many samples.
    pub fn new(size: [u32; 2], samples: u64) -> Cut {
        Cut { size, samples, next: Part { done: 0, samples: 0, row: 0, rows: 0 } }
    }

    /// The next part.
    fn part(&mut self, pace: &Pace) -> Option<Part> {
        let [width, height] = self.size;
        if self.next.row == height {
            (self.next.done, self.next.row) = (self.next.done + u64::from(self.next.samples), 0);
        }
        if self.next.done >= self.samples {
            return None;
        }
        if self.next.row == 0 {
            self.next.samples = pace.samples(self.size, self.samples - self.next.done);
        }
        let part = Part { rows: pace.rows(width, self.next.samples, height - self.next.row), ..self.next };
        self.next.row += part.rows;
        Some(part)
    }

    /// The parts of the next submission, at most so many; none once the wave is done.
    pub fn parts(&mut self, pace: &Pace, most: usize) -> Vec<Part> {
        // Before anything is known, one is enough to learn from.
        let together = if pace.budget.is_some() { most } else { 1 };
        (0..together).map_while(|_| self.part(pace)).collect()
    }

    /// Whether no part is left.
    pub fn is_done(&self) -> bool {
        let row_done = self.next.row == self.size[1];
        self.next.done + if row_done { u64::from(self.next.samples) } else { 0 } >= self.samples
    }

    /// The rest of a wave of so many samples whose first parts are those that this one has given; none if it has given samples
    /// that such a wave has not.
    pub fn of(self, samples: u64) -> Option<Cut> {
        // Before a first row, and after the last, nothing of the samples named last is under way.
        let begun = if self.next.row == 0 { 0 } else { u64::from(self.next.samples) };
        (self.next.done + begun <= samples).then_some(Cut { samples, ..self })
    }
}

/// What the dispatches so far have taught.
#[derive(Clone, Debug, Default)]
pub struct Pace {
    /// Samples of pixels that the next dispatch may have.
    budget: Option<f64>,
}

impl Pace {
    /// How many of `left` samples of every pixel the next dispatches shall have; at least one.
    fn samples(&self, [width, height]: [u32; 2], left: u64) -> u32 {
        let frame = f64::from(width) * f64::from(height);
        ((self.budget.unwrap_or(START) / frame) as u64).clamp(1, left.clamp(1, MOST_SAMPLES)) as u32
    }

    /// How many of `left` rows the next dispatch shall have; at least one.
    fn rows(&self, width: u32, samples: u32, left: u32) -> u32 {
        let row = f64::from(width) * f64::from(samples);
        ((self.budget.unwrap_or(START) / row) as u32).clamp(1, left.max(1))
    }

    /// Learns from a dispatch of so many samples of pixels.
    pub fn record(&mut self, work: f64, seconds: f64) {
        let fits = work * TARGET_S / seconds.max(1e-6);
        self.budget = Some(fits.min(work * GROWTH).max(1.0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Dispatches until `samples` are done, where a sample of a pixel takes `cost` seconds; their durations.
    fn dispatches(size: [u32; 2], samples: u64, cost: f64) -> Vec<f64> {
        let (mut pace, mut cut, mut durations) = (Pace::default(), Cut::new(size, samples), Vec::new());
        let mut rows = vec![0u64; size[1] as usize];
        loop {
            let parts = cut.parts(&pace, TOGETHER);
            assert_eq!(cut.is_done(), cut.clone().parts(&pace, 1).is_empty());
            if parts.is_empty() {
                break;
            }
            for part in &parts {
                durations.push(part.work(size[0]) * cost);
                for row in &mut rows[part.row as usize..][..part.rows as usize] {
                    assert_eq!(*row, part.done, "samples come in order, and none twice");
                    *row += u64::from(part.samples);
                }
            }
            let work = parts.iter().map(|part| part.work(size[0])).sum::<f64>() / parts.len() as f64;
            pace.record(work, work * cost);
        }
        assert!(rows.iter().all(|row| *row == samples), "all that was asked for, and no more");
        durations
    }

    #[test]
    fn dispatches_come_near_their_time_on_slow_and_on_fast_devices() {
        for (size, samples, cost) in [([1280, 720], 64, 1e-9), ([1280, 720], 4, 1e-6), ([64, 36], 4096, 1e-6)] {
            let durations = dispatches(size, samples, cost);
            assert!(durations.iter().all(|s| *s <= 0.1), "{size:?} {cost}: {durations:?}");
            let total: f64 = durations.iter().sum();
            assert!(durations.len() as f64 <= 16.0 + total / 0.02, "{size:?} {cost}: {} dispatches", durations.len());
        }
    }

    #[test]
    fn what_was_begun_of_one_wave_is_the_beginning_of_any_that_has_its_samples() {
        let (size, mut pace) = ([64, 36], Pace::default());
        pace.record(64.0 * 36.0 * 3.0, TARGET_S);
        let rows_of = |first: Vec<Part>, mut rest: Cut| {
            let mut rows = [0u64; 36];
            let mut parts = first;
            while !parts.is_empty() {
                for part in parts {
                    for row in &mut rows[part.row as usize..][..part.rows as usize] {
                        assert_eq!(*row, part.done, "samples come in order, and none twice");
                        *row += u64::from(part.samples);
                    }
                }
                parts = rest.parts(&pace, TOGETHER);
            }
            rows
        };
        for begun in 1..4 {
            let mut ahead = Cut::new(size, 100);
            let first = ahead.parts(&pace, begun);
            let has = 3 * begun as u64;
            assert_eq!(first.last().map(|part| part.done + u64::from(part.samples)), Some(has));
            assert!(ahead.of(has - 1).is_none(), "a shorter wave has not all of them");
            for samples in [has, has + 1, 50, 200] {
                assert_eq!(rows_of(first.clone(), ahead.of(samples).unwrap()), [samples; 36]);
            }
        }
    }

    #[test]
    fn all_of_a_wave_may_have_been_begun() {
        let (size, mut pace) = ([64, 36], Pace::default());
        pace.record(64.0 * 36.0 * 3.0, TARGET_S);
        for samples in [1, 3, 5] {
            let mut ahead = Cut::new(size, samples);
            let first = ahead.parts(&pace, AHEAD);
            assert_eq!(first.iter().map(|part| u64::from(part.samples)).sum::<u64>(), samples);
            let mut rest = ahead.of(samples).expect("nothing is left of it, and nothing is too much");
            assert!(rest.is_done() && rest.parts(&pace, 1).is_empty());
            assert!(ahead.of(samples - 1).is_none());
            let more: u64 =
                ahead.of(samples + 2).unwrap().parts(&pace, 4).iter().map(|part| u64::from(part.samples)).sum();
            assert_eq!(more, 2);
        }
    }

    #[test]
    fn a_pixel_that_takes_seconds_still_gets_its_turn() {
        assert_eq!(dispatches([256, 256], 2, 3.0).len(), 1 + 192 + 256, "the first is a guess, and then row by row");
    }
}
