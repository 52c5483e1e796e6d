//! How many samples the next wave has.

use crate::experiment::event::WaveRow;
use crate::experiment::stop::StopRule;

/// Sizes waves: they double from one sample up to what fits into the longest time between two measurements, end
/// exactly at every number of samples that the stop rule names, and, where snapshots ask for it, at every power of
/// two. None of this changes a picture, only when it is looked at.
#[derive(Debug)]
pub(super) struct Waves {
    every_s: f64,
    pow2: bool,
    /// Most samples of the next wave.
    pub(super) size: u64,
}

impl Waves {
    pub(super) fn new(every_s: f64, pow2: bool) -> Waves {
        Waves { every_s, pow2, size: 1 }
    }

    /// The same in a run that goes on, whose next wave may have so many samples.
    pub(super) fn from(self, growth: u64) -> Waves {
        Waves { size: growth.max(1), ..self }
    }

    /// The size of the next wave, at least 1, given the measurements so far.
    pub(super) fn next(&mut self, rows: &[WaveRow], stop: &StopRule) -> u64 {
        let Some(last) = rows.last() else {
            self.size = 2;
            return 1;
        };
        let before = rows.len().checked_sub(2).map(|i| &rows[i]);
        let samples = last.samples - before.map_or(0, |row| row.samples);
        let seconds = last.render_s - before.map_or(0.0, |row| row.render_s);
        let mut size = self.size;
        if seconds > 0.0 {
            let rate = samples as f64 / seconds;
            size = size.min((self.every_s * rate) as u64);
            if let Some(limit_s) = stop.time_limit_s() {
                // Rounded up: the limit is to be reached, by less than one sample too many.
                size = size.min(((limit_s - last.render_s) * rate).ceil() as u64);
            }
        }
        let size = size.max(1);
        self.size = size.saturating_mul(2);
        let mark = stop.next_sample_mark(last.samples).unwrap_or(u64::MAX);
        let power = if self.pow2 { (last.samples + 1).next_power_of_two() } else { u64::MAX };
        size.min(mark.min(power) - last.samples)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sample counts after each wave on a clock of `seconds` per sample.
    fn totals(every_s: f64, pow2: bool, stop: &StopRule, seconds: f64, count: usize) -> Vec<u64> {
        let mut waves = Waves::new(every_s, pow2);
        let mut rows: Vec<WaveRow> = Vec::new();
        for _ in 0..count {
            let samples = rows.last().map_or(0, |r| r.samples) + waves.next(&rows, stop);
            rows.push(WaveRow { samples, render_s: samples as f64 * seconds, ..WaveRow::default() });
        }
        rows.iter().map(|row| row.samples).collect()
    }

    #[test]
    fn waves_double_up_to_the_time_between_measurements() {
        let stop = StopRule::Samples(1 << 40);
        assert_eq!(totals(1e9, false, &stop, 1.0, 5), [1, 3, 7, 15, 31]);
        // 0.125 s a sample: at most 8 samples fit into a second.
        assert_eq!(totals(1.0, false, &stop, 0.125, 7), [1, 3, 7, 15, 23, 31, 39]);
        assert_eq!(totals(0.0, false, &stop, 0.125, 3), [1, 2, 3]);
    }

    #[test]
    fn sample_limits_and_powers_of_two_are_hit_exactly() {
        assert_eq!(totals(1e9, false, &StopRule::Samples(10), 1.0, 4), [1, 3, 7, 10]);
        assert_eq!(totals(1e9, false, &StopRule::Samples(1), 1.0, 1), [1]);
        let stop = StopRule::All(vec![StopRule::Samples(5), StopRule::Samples(12)]);
        assert_eq!(totals(1e9, false, &stop, 1.0, 4), [1, 3, 5, 12]);
        assert_eq!(totals(1e9, true, &StopRule::Samples(20), 1.0, 6), [1, 2, 4, 8, 16, 20]);
        // Three samples fit: powers of two are still met.
        assert_eq!(totals(3.0, true, &StopRule::Waves(99), 1.0, 8), [1, 2, 4, 7, 8, 11, 14, 16]);
    }

    #[test]
    fn a_time_limit_is_overstepped_by_less_than_a_sample() {
        let stop = StopRule::Time(10.25);
        assert_eq!(totals(1e9, false, &stop, 1.0, 4), [1, 3, 7, 11]);
        assert_eq!(totals(1e9, false, &stop, 64.0, 1), [1]);
    }

    #[test]
    fn a_clock_that_stands_still_does_not_stop_the_waves() {
        assert_eq!(totals(1.0, false, &StopRule::Waves(9), 0.0, 4), [1, 3, 7, 15]);
    }
}
