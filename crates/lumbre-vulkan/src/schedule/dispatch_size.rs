//! Splits waves into dispatches that take about [`TARGET_S`] each. Operating systems declare a
//! device lost if a dispatch takes seconds, and a long dispatch cannot be interrupted. Several
//! dispatches are submitted together, so that the device stays busy while the host wakes up.

/// Target duration of a dispatch in seconds.
pub const TARGET_S: f64 = 0.08;

/// Work of the first dispatch, when nothing has been measured yet, in pixel samples.
const START: f64 = 16_384.0;

/// Maximum growth of a dispatch over the previous one.
const GROWTH: f64 = 8.0;

/// Maximum number of samples per pixel in one dispatch, since a pixel's rays and the film's invalid
/// samples are counted in 32 bits.
pub const MAX_SAMPLES: u64 = 1 << 16;

/// Number of dispatches of one submission.
pub const DISPATCHES_PER_SUBMISSION: usize = 4;

/// Maximum number of speculative dispatches: no more than the host needs time for between waves.
pub const MAX_SPECULATIVE_DISPATCHES: usize = 8;

/// Part of a wave: a number of samples of every pixel of some rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DispatchRange {
    /// Number of samples of the wave that precede it.
    pub done: u64,
    /// Number of samples of every pixel.
    pub samples: u32,
    /// Index of the first row.
    pub row: u32,
    /// Number of rows.
    pub rows: u32,
}

impl DispatchRange {
    /// Returns the work in pixel samples.
    pub fn work(&self, width: u32) -> f64 {
        f64::from(width) * f64::from(self.rows) * f64::from(self.samples)
    }

    /// Returns whether this dispatch renders rows that the `previous` one, or one before that, may
    /// have rendered. Dispatches of the same samples have rows of their own and may run at the same
    /// time: what they share is added atomically.
    pub fn overlaps(&self, previous: &DispatchRange) -> bool {
        self.done != previous.done
    }
}

/// Splits a wave into dispatches: all rows of some samples, then of the next samples.
#[derive(Clone, Copy, Debug)]
pub struct WaveSplitter {
    size: [u32; 2],
    samples: u64,
    /// Greatest number of samples in one dispatch.
    at_once: u64,
    /// Greatest number of rows in one dispatch.
    most_rows: u32,
    /// Start of the next dispatch; has no samples before the first row of new ones.
    next: DispatchRange,
}

impl WaveSplitter {
    /// Starts to split a wave of `samples` samples.
    pub fn new(size: [u32; 2], samples: u64) -> WaveSplitter {
        WaveSplitter {
            size,
            samples,
            at_once: MAX_SAMPLES,
            most_rows: size[1],
            next: DispatchRange {
                done: 0,
                samples: 0,
                row: 0,
                rows: 0,
            },
        }
    }

    /// Limits the samples of a pixel in one dispatch.
    pub fn at_once(self, at_once: u64) -> WaveSplitter {
        WaveSplitter { at_once, ..self }
    }

    /// Limits the rows in one dispatch.
    pub fn rows(self, rows: u32) -> WaveSplitter {
        WaveSplitter {
            most_rows: self.most_rows.min(rows),
            ..self
        }
    }

    /// Returns the next dispatch.
    fn next_dispatch(&mut self, pacer: &DispatchPacer) -> Option<DispatchRange> {
        let [width, height] = self.size;
        if self.next.row == height {
            (self.next.done, self.next.row) = (self.next.done + u64::from(self.next.samples), 0);
        }
        if self.next.done >= self.samples {
            return None;
        }
        if self.next.row == 0 {
            let left = (self.samples - self.next.done).min(self.at_once);
            self.next.samples = pacer.samples([width, self.most_rows], left);
        }
        let range = DispatchRange {
            rows: pacer.rows(
                width,
                self.next.samples,
                self.most_rows.min(height - self.next.row),
            ),
            ..self.next
        };
        self.next.row += range.rows;
        Some(range)
    }

    /// Returns the dispatches of the next submission, at most `max`; empty once the wave is done.
    pub fn next_dispatches(&mut self, pacer: &DispatchPacer, max: usize) -> Vec<DispatchRange> {
        // Before anything has been measured, one dispatch is submitted.
        let count = if pacer.budget.is_some() { max } else { 1 };
        (0..count)
            .map_while(|_| self.next_dispatch(pacer))
            .collect()
    }

    /// Returns whether no dispatch is left.
    pub fn is_done(&self) -> bool {
        let row_done = self.next.row == self.size[1];
        self.next.done
            + if row_done {
                u64::from(self.next.samples)
            } else {
                0
            }
            >= self.samples
    }

    /// Returns the rest of a wave of `samples` samples that starts with the dispatches returned so
    /// far, or `None` if those include samples beyond its end.
    pub fn rest_of(self, samples: u64) -> Option<WaveSplitter> {
        // Before the first row and after the last one, no sample is partially done.
        let begun = if self.next.row == 0 {
            0
        } else {
            u64::from(self.next.samples)
        };
        (self.next.done + begun <= samples).then_some(WaveSplitter { samples, ..self })
    }
}

/// Estimates the work of the next dispatch from those so far.
#[derive(Clone, Debug, Default)]
pub struct DispatchPacer {
    /// Work of the next dispatch in pixel samples, once measured.
    budget: Option<f64>,
}

impl DispatchPacer {
    /// Returns how many of `left` samples of every pixel the next dispatches get; at least one.
    fn samples(&self, [width, height]: [u32; 2], left: u64) -> u32 {
        let frame = f64::from(width) * f64::from(height);
        ((self.budget.unwrap_or(START) / frame) as u64).clamp(1, left.clamp(1, MAX_SAMPLES)) as u32
    }

    /// Returns how many of `left` rows the next dispatch gets; at least one.
    fn rows(&self, width: u32, samples: u32, left: u32) -> u32 {
        let row = f64::from(width) * f64::from(samples);
        ((self.budget.unwrap_or(START) / row) as u32).clamp(1, left.max(1))
    }

    /// Records the duration of a dispatch of `work` pixel samples.
    pub fn record(&mut self, work: f64, seconds: f64) {
        let fits = work * TARGET_S / seconds.max(1e-6);
        self.budget = Some(fits.min(work * GROWTH).max(1.0));
    }
}

#[cfg(test)]
mod tests {
    use crate::schedule::dispatch_size::*;

    /// Returns the durations of all dispatches of a wave if a pixel sample takes `cost` seconds.
    fn dispatches(size: [u32; 2], samples: u64, cost: f64) -> Vec<f64> {
        let (mut pacer, mut cut, mut durations) = (
            DispatchPacer::default(),
            WaveSplitter::new(size, samples),
            Vec::new(),
        );
        let mut rows = vec![0u64; size[1] as usize];
        loop {
            let next_dispatches = cut.next_dispatches(&pacer, DISPATCHES_PER_SUBMISSION);
            assert_eq!(
                cut.is_done(),
                cut.clone().next_dispatches(&pacer, 1).is_empty()
            );
            if next_dispatches.is_empty() {
                break;
            }
            // Rows since the last barrier of the submission are rendered once.
            let mut since_barrier: Vec<&DispatchRange> = Vec::new();
            for range in &next_dispatches {
                if since_barrier
                    .last()
                    .is_some_and(|last| range.overlaps(last))
                {
                    since_barrier.clear();
                }
                let end = range.row + range.rows;
                let is_apart = |other: &&DispatchRange| {
                    end <= other.row || other.row + other.rows <= range.row
                };
                assert!(since_barrier.iter().all(is_apart), "{range:?}");
                since_barrier.push(range);
                durations.push(range.work(size[0]) * cost);
                for row in &mut rows[range.row as usize..][..range.rows as usize] {
                    assert_eq!(*row, range.done, "samples come in order, each once");
                    *row += u64::from(range.samples);
                }
            }
            let work = next_dispatches
                .iter()
                .map(|range| range.work(size[0]))
                .sum::<f64>()
                / next_dispatches.len() as f64;
            pacer.record(work, work * cost);
        }
        assert!(
            rows.iter().all(|row| *row == samples),
            "exactly the requested samples"
        );
        durations
    }

    #[test]
    fn dispatches_approach_the_target_on_slow_and_fast_devices() {
        for (size, samples, cost) in [
            ([1280, 720], 64, 1e-9),
            ([1280, 720], 4, 1e-6),
            ([64, 36], 4096, 1e-6),
        ] {
            let durations = dispatches(size, samples, cost);
            assert!(
                durations.iter().all(|s| *s <= 0.1),
                "{size:?} {cost}: {durations:?}"
            );
            let total: f64 = durations.iter().sum();
            assert!(
                durations.len() as f64 <= 16.0 + total / 0.02,
                "{size:?} {cost}: {} dispatches",
                durations.len()
            );
        }
    }

    #[test]
    fn speculative_dispatches_fit_any_wave_with_their_samples() {
        let (size, mut pacer) = ([64, 36], DispatchPacer::default());
        pacer.record(64.0 * 36.0 * 3.0, TARGET_S);
        let rows_of = |first: Vec<DispatchRange>, mut rest: WaveSplitter| {
            let mut rows = [0u64; 36];
            let mut next_dispatches = first;
            while !next_dispatches.is_empty() {
                for range in next_dispatches {
                    for row in &mut rows[range.row as usize..][..range.rows as usize] {
                        assert_eq!(*row, range.done, "samples come in order, each once");
                        *row += u64::from(range.samples);
                    }
                }
                next_dispatches = rest.next_dispatches(&pacer, DISPATCHES_PER_SUBMISSION);
            }
            rows
        };
        for begun in 1..4 {
            let mut ahead = WaveSplitter::new(size, 100);
            let first = ahead.next_dispatches(&pacer, begun);
            let has = 3 * begun as u64;
            assert_eq!(
                first
                    .last()
                    .map(|range| range.done + u64::from(range.samples)),
                Some(has)
            );
            assert!(
                ahead.rest_of(has - 1).is_none(),
                "a shorter wave has fewer samples"
            );
            for samples in [has, has + 1, 50, 200] {
                assert_eq!(
                    rows_of(first.clone(), ahead.rest_of(samples).unwrap()),
                    [samples; 36]
                );
            }
        }
    }

    #[test]
    fn a_whole_wave_can_be_speculative() {
        let (size, mut pacer) = ([64, 36], DispatchPacer::default());
        pacer.record(64.0 * 36.0 * 3.0, TARGET_S);
        for samples in [1, 3, 5] {
            let mut ahead = WaveSplitter::new(size, samples);
            let first = ahead.next_dispatches(&pacer, MAX_SPECULATIVE_DISPATCHES);
            assert_eq!(
                first
                    .iter()
                    .map(|range| u64::from(range.samples))
                    .sum::<u64>(),
                samples
            );
            let mut rest = ahead
                .rest_of(samples)
                .expect("the wave has exactly these samples");
            assert!(rest.is_done() && rest.next_dispatches(&pacer, 1).is_empty());
            assert!(ahead.rest_of(samples - 1).is_none());
            let more: u64 = ahead
                .rest_of(samples + 2)
                .unwrap()
                .next_dispatches(&pacer, 4)
                .iter()
                .map(|range| u64::from(range.samples))
                .sum();
            assert_eq!(more, 2);
        }
    }

    #[test]
    fn slow_pixels_are_still_rendered() {
        assert_eq!(
            dispatches([256, 256], 2, 3.0).len(),
            1 + 192 + 256,
            "the first is an estimate, the rest go row by row"
        );
    }
}
