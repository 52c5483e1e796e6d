//! How much work one dispatch gets, so that it takes about [`TARGET_S`]: systems take a device for lost whose dispatches
//! last seconds, and a long one cannot be interrupted.

/// Seconds that a dispatch shall take.
const TARGET_S: f64 = 0.08;

/// Samples of pixels in the first dispatch, when nothing is known yet.
const START: f64 = 16_384.0;

/// By how much a dispatch may grow over the one before.
const GROWTH: f64 = 8.0;

/// The most samples of a pixel in one dispatch, whose counters have 32 bits.
const MOST_SAMPLES: u64 = 1 << 16;

/// What the dispatches so far have taught.
#[derive(Clone, Debug, Default)]
pub struct Pace {
    /// Samples of pixels that the next dispatch may have.
    budget: Option<f64>,
}

impl Pace {
    /// How many of `left` samples of every pixel the next dispatches shall have; at least one.
    pub fn samples(&self, [width, height]: [u32; 2], left: u64) -> u32 {
        let frame = f64::from(width) * f64::from(height);
        ((self.budget.unwrap_or(START) / frame) as u64).clamp(1, left.clamp(1, MOST_SAMPLES)) as u32
    }

    /// How many of `left` rows the next dispatch shall have; at least one.
    pub fn rows(&self, width: u32, samples: u32, left: u32) -> u32 {
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
        let (mut pace, mut done, mut durations) = (Pace::default(), 0, Vec::new());
        while done < samples {
            let share = pace.samples(size, samples - done);
            let mut row = 0;
            while row < size[1] {
                let rows = pace.rows(size[0], share, size[1] - row);
                let work = f64::from(size[0]) * f64::from(rows) * f64::from(share);
                durations.push(work * cost);
                pace.record(work, work * cost);
                row += rows;
            }
            done += u64::from(share);
        }
        assert_eq!(done, samples, "never more than was asked for");
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
    fn a_pixel_that_takes_seconds_still_gets_its_turn() {
        assert_eq!(dispatches([256, 256], 2, 3.0).len(), 1 + 192 + 256, "the first is a guess, and then row by row");
    }
}
