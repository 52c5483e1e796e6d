//! Backoff of a night that can only wait for other processes, so that a thousand waiting workers do
//! not overload the file system that they share.

/// Number of other processes' runs that are polled at a time while waiting.
pub const BATCH: usize = 8;
/// Greatest number of ticks between two polls, before random variation.
const MAX_TICKS: u64 = 600;
/// Seconds of a tick, which is the time that [`Seams::wait`](super::Seams::wait) waits.
pub const TICK_S: f64 = 0.05;

/// Waits a tenth of the time waited so far, but at least one tick and at most half a minute, with a
/// random variation of a quarter. A run that becomes available is thus noticed within about a tenth
/// of the time that it took.
#[derive(Debug)]
pub struct Backoff {
    /// Ticks waited since the last progress.
    waited: u64,
    /// State of the random number generator.
    seed: u64,
}

impl Backoff {
    /// Starts without any time waited. Different seeds make processes that start at the same time
    /// poll at different times.
    pub fn new(seed: u64) -> Backoff {
        Backoff { waited: 0, seed }
    }

    /// Starts over after progress.
    pub fn reset(&mut self) {
        self.waited = 0;
    }

    /// Returns the number of ticks until the next poll.
    pub fn next_ticks(&mut self) -> u64 {
        let longest = (self.waited / 10).clamp(1, MAX_TICKS);
        self.seed = self
            .seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let spread = longest / 2;
        let ticks = longest - spread / 2
            + if spread > 0 {
                (self.seed >> 33) % (spread + 1)
            } else {
                0
            };
        self.waited += ticks;
        ticks
    }

    /// Splits other processes' runs into those to poll next and the rest. Before any waiting, all
    /// are polled.
    pub(super) fn next_batch<T>(&self, mut all: Vec<T>) -> (Vec<T>, Vec<T>) {
        if self.waited == 0 {
            return (all, Vec::new());
        }
        let rest = all.split_off(all.len().min(BATCH));
        (all, rest)
    }
}

#[cfg(test)]
mod tests {
    use crate::experiment::outcome::CellRef;
    use crate::experiment::run::backoff::*;

    #[test]
    fn polls_become_rarer_up_to_half_a_minute() {
        let mut backoff = Backoff::new(7);
        let ticks: Vec<u64> = (0..400).map(|_| backoff.next_ticks()).collect();
        assert!(ticks[..10].iter().all(|n| *n == 1), "{ticks:?}");
        assert!(ticks.iter().all(|n| (1..=MAX_TICKS * 5 / 4).contains(n)));
        let last = &ticks[300..];
        assert!(last.iter().all(|n| *n >= MAX_TICKS * 3 / 4) && last.iter().any(|n| *n != last[0]));
        backoff.reset();
        assert_eq!(backoff.next_ticks(), 1);
    }

    #[test]
    fn few_runs_are_polled_at_a_time_while_waiting() {
        let all: Vec<CellRef> = (0..40).map(CellRef::Cell).collect();
        let mut backoff = Backoff::new(1);
        assert_eq!(backoff.next_batch(all.clone()).0.len(), 40);
        backoff.next_ticks();
        let (now, later) = backoff.next_batch(all.clone());
        assert_eq!((now.len(), later.len()), (BATCH, 40 - BATCH));
        assert_eq!([now, later].concat(), all);
    }
}
