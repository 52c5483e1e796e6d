//! How many samples the next wave has.

use crate::experiment::event::WaveRow;
use crate::experiment::standing::Standing;
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
        size.min(self.mark(last.samples, stop) - last.samples)
    }

    /// How many samples are likely to be asked for after the next so many: the rest of the wave or, where they end it, the wave
    /// after it; none where limits end the run. Whether a threshold is reached is seen only when they are measured.
    pub(super) fn expected(&self, standing: &Standing, samples: u64, stop: &StopRule) -> u64 {
        let left = standing.left.saturating_sub(samples);
        if left > 0 {
            return left;
        }
        let after = standing.samples() + samples;
        if stop.sample_limit().is_some_and(|limit| limit <= after) {
            return 0;
        }
        // Not a number where nothing is known yet, which makes no sample.
        let rate = standing.rate();
        let seconds = stop.time_limit_s().map_or(f64::INFINITY, |limit_s| limit_s - standing.render_s());
        let by_limit = (seconds * rate - samples as f64) as u64;
        self.size.min(((self.every_s * rate) as u64).max(1)).min(by_limit).min(self.mark(after, stop) - after)
    }

    /// The next number of samples at which a wave ends.
    fn mark(&self, samples: u64, stop: &StopRule) -> u64 {
        let power = if self.pow2 { (samples + 1).next_power_of_two() } else { u64::MAX };
        stop.next_sample_mark(samples).unwrap_or(u64::MAX).min(power)
    }
}

/// The most samples that may be begun before a call asks for them: three quarters of one of `slice_s`, since rates vary and
/// what the call does not ask for is thrown away.
pub(super) fn beforehand(standing: &Standing, slice_s: f64) -> u64 {
    // Not a number where nothing is known yet, which makes no sample.
    (0.75 * slice_s * standing.rate()) as u64
}

/// Samples of the next call of the renderer: the wave in progress, or as many of it as take about `slice_s`.
pub(super) fn slice(standing: &Standing, slice_s: f64) -> u64 {
    let rate = standing.rate();
    if rate.is_finite() { standing.left.min(((slice_s * rate) as u64).max(1)) } else { standing.left }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::WaveStats;

    #[test]
    fn what_follows_is_the_rest_of_the_wave_or_the_next_one_as_far_as_limits_leave_it() {
        let part = WaveStats { samples: 100, render_s: 10.0, ..WaveStats::default() };
        let at = |left: u64| Standing { left, part: part.clone(), ..Standing::default() };
        let waves = Waves { every_s: 8.0, pow2: false, size: 60 };
        let (time, samples) = (StopRule::Time(20.0), StopRule::Samples(140));
        for (left, next, stop, more) in [
            (50, 30, &StopRule::Time(1e9), 20),
            (50, 50, &StopRule::Time(1e9), 60),
            (50, 50, &time, 50),
            (50, 50, &StopRule::Time(15.0), 0),
            (50, 50, &StopRule::Time(12.0), 0),
            (30, 30, &samples, 10),
            (40, 40, &samples, 0),
            (40, 40, &StopRule::Any(vec![time.clone(), StopRule::Samples(170)]), 30),
            (40, 40, &StopRule::Waves(9), 60),
        ] {
            assert_eq!(waves.expected(&at(left), next, stop), more, "{left} {next} {stop:?}");
        }
        let never = StopRule::Waves(9);
        assert_eq!(Waves { every_s: 2.0, ..Waves::new(1.0, false).from(60) }.expected(&at(5), 5, &never), 20);
        assert_eq!(Waves::new(8.0, true).from(60).expected(&at(5), 5, &never), 128 - 105);
        let fresh = Standing { left: 1, ..Standing::default() };
        assert_eq!(waves.expected(&fresh, 1, &time), 0, "nobody knows how long a sample takes");
    }

    #[test]
    fn no_wave_is_smaller_than_was_expected_on_a_steady_clock() {
        for (every_s, seconds, stop) in
            [(0.5, 0.003, StopRule::Samples(3000)), (0.5, 1e-4, StopRule::Time(3.0)), (0.2, 0.07, StopRule::Time(5.0))]
        {
            let (mut waves, mut standing, mut exact) = (Waves::new(every_s, true), Standing::default(), 0);
            let mut expected = None;
            for _ in 0..40 {
                standing.left = waves.next(&standing.rows, &stop);
                if let Some(more) = expected.replace(waves.expected(&standing, standing.left, &stop)) {
                    assert!(more <= standing.left, "{more} expected, {} asked for: {stop:?}", standing.left);
                    exact += u32::from(more == standing.left);
                }
                let samples = standing.left;
                standing.count(&WaveStats { samples, render_s: samples as f64 * seconds, ..WaveStats::default() });
                let row = standing.close_wave();
                let done = stop.sample_limit().is_some_and(|n| row.samples >= n)
                    || stop.time_limit_s().is_some_and(|s| row.render_s >= s);
                standing.rows.push(row);
                if done {
                    assert_eq!(expected, Some(0), "nothing is begun after the last wave: {stop:?}");
                    break;
                }
            }
            assert!(exact > 3, "{exact}");
        }
    }

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
