//! Sizes of waves and slices.

use crate::experiment::outcome::WaveRow;
use crate::experiment::run_progress::RunProgress;
use crate::experiment::stop::StopRule;

/// Render time of a slice, seconds: the greatest delay before a request of the user takes effect.
/// Slices change neither pictures nor which samples are measured.
pub(super) const SLICE_S: f64 = 1.0;

/// Determines the sizes of waves. They double from one sample up to what fits into the longest time
/// between two measurements, and end exactly at every number of samples that occurs in the stop
/// rule and, if snapshots require it, at every power of two. Sizes do not change the picture, only
/// when it is measured.
#[derive(Debug)]
pub(super) struct WaveSizer {
    /// Longest render time between two measurements, seconds.
    every_s: f64,
    /// Whether waves end at every power of two of samples per pixel.
    pow2: bool,
    /// Greatest number of samples of the next wave.
    pub(super) next_wave_max: u64,
}

impl WaveSizer {
    /// Sizes for a run from its first sample.
    pub(super) fn new(every_s: f64, pow2: bool) -> WaveSizer {
        WaveSizer {
            every_s,
            pow2,
            next_wave_max: 1,
        }
    }

    /// Sizes for a resumed run, with the greatest number of samples of its next wave.
    pub(super) fn resume(self, next_wave_max: u64) -> WaveSizer {
        WaveSizer {
            next_wave_max: next_wave_max.max(1),
            ..self
        }
    }

    /// Returns the size of the next wave, at least 1, after the measurements so far.
    pub(super) fn next(&mut self, rows: &[WaveRow], stop: &StopRule) -> u64 {
        let Some(last) = rows.last() else {
            self.next_wave_max = 2;
            return 1;
        };
        let before_last = rows.len().checked_sub(2).map(|i| &rows[i]);
        let samples = last.samples - before_last.map_or(0, |row| row.samples);
        let seconds = last.render_s - before_last.map_or(0.0, |row| row.render_s);
        let mut size = self.next_wave_max;
        if seconds > 0.0 {
            let rate = samples as f64 / seconds;
            size = size.min((self.every_s * rate) as u64);
            if let Some(limit_s) = stop.time_limit_s() {
                // Rounded up, so that the limit is exceeded by less than one sample.
                size = size.min(((limit_s - last.render_s) * rate).ceil() as u64);
            }
        }
        let size = size.max(1);
        self.next_wave_max = size.saturating_mul(2);
        size.min(self.next_mark(last.samples, stop) - last.samples)
    }

    /// Returns how many samples are likely to be requested after the next `samples`: the rest of
    /// the wave or, if they complete it, the following wave; 0 if a limit ends the run. Whether a
    /// threshold is reached is not known before they are measured.
    pub(super) fn lookahead(&self, progress: &RunProgress, samples: u64, stop: &StopRule) -> u64 {
        let left = progress.samples_left.saturating_sub(samples);
        if left > 0 {
            return left;
        }
        let after = progress.samples() + samples;
        if stop.sample_limit().is_some_and(|limit| limit <= after) {
            return 0;
        }
        // NaN before the first sample, which becomes 0 samples below.
        let rate = progress.rate();
        let seconds = stop
            .time_limit_s()
            .map_or(f64::INFINITY, |limit_s| limit_s - progress.render_s());
        let by_limit = (seconds * rate - samples as f64) as u64;
        self.next_wave_max
            .min(((self.every_s * rate) as u64).max(1))
            .min(by_limit)
            .min(self.next_mark(after, stop) - after)
    }

    /// Returns the next number of samples per pixel at which a wave must end.
    fn next_mark(&self, samples: u64, stop: &StopRule) -> u64 {
        let power = if self.pow2 {
            (samples + 1).next_power_of_two()
        } else {
            u64::MAX
        };
        stop.next_sample_mark(samples)
            .unwrap_or(u64::MAX)
            .min(power)
    }
}

/// Returns the greatest number of samples that may be started before they are requested: those of
/// three quarters of a slice, since rates vary and samples that are not requested are discarded.
pub(super) fn max_lookahead(progress: &RunProgress, slice_s: f64) -> u64 {
    // NaN before the first sample, which becomes 0.
    (0.75 * slice_s * progress.rate()) as u64
}

/// Returns the number of samples of the next call of the renderer: the rest of the wave in
/// progress, or as many as take about `slice_s` seconds.
pub(super) fn slice_samples(progress: &RunProgress, slice_s: f64) -> u64 {
    let rate = progress.rate();
    if rate.is_finite() {
        progress.samples_left.min(((slice_s * rate) as u64).max(1))
    } else {
        progress.samples_left
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumbre_render::WaveStats;

    #[test]
    fn lookahead_is_the_rest_of_the_wave_or_the_next_one_within_limits() {
        let current_wave = WaveStats {
            samples: 100,
            render_s: 10.0,
            ..WaveStats::default()
        };
        let at = |left: u64| RunProgress {
            samples_left: left,
            current_wave: current_wave.clone(),
            ..RunProgress::default()
        };
        let waves = WaveSizer {
            every_s: 8.0,
            pow2: false,
            next_wave_max: 60,
        };
        let (time, samples) = (StopRule::Time(20.0), StopRule::Samples(140));
        for (left, next, stop, more) in [
            (50, 30, &StopRule::Time(1e9), 20),
            (50, 50, &StopRule::Time(1e9), 60),
            (50, 50, &time, 50),
            (50, 50, &StopRule::Time(15.0), 0),
            (50, 50, &StopRule::Time(12.0), 0),
            (30, 30, &samples, 10),
            (40, 40, &samples, 0),
            (
                40,
                40,
                &StopRule::Any(vec![time.clone(), StopRule::Samples(170)]),
                30,
            ),
            (40, 40, &StopRule::Waves(9), 60),
        ] {
            assert_eq!(
                waves.lookahead(&at(left), next, stop),
                more,
                "{left} {next} {stop:?}"
            );
        }
        let never = StopRule::Waves(9);
        assert_eq!(
            WaveSizer {
                every_s: 2.0,
                ..WaveSizer::new(1.0, false).resume(60)
            }
            .lookahead(&at(5), 5, &never),
            20
        );
        assert_eq!(
            WaveSizer::new(8.0, true)
                .resume(60)
                .lookahead(&at(5), 5, &never),
            128 - 105
        );
        let fresh = RunProgress {
            samples_left: 1,
            ..RunProgress::default()
        };
        assert_eq!(
            waves.lookahead(&fresh, 1, &time),
            0,
            "the time of a sample is not known yet"
        );
    }

    #[test]
    fn no_wave_is_smaller_than_its_lookahead_on_a_steady_clock() {
        for (every_s, seconds, stop) in [
            (0.5, 0.003, StopRule::Samples(3000)),
            (0.5, 1e-4, StopRule::Time(3.0)),
            (0.2, 0.07, StopRule::Time(5.0)),
        ] {
            let (mut waves, mut progress, mut exact) =
                (WaveSizer::new(every_s, true), RunProgress::default(), 0);
            let mut expected = None;
            for _ in 0..40 {
                progress.samples_left = waves.next(&progress.rows, &stop);
                if let Some(more) =
                    expected.replace(waves.lookahead(&progress, progress.samples_left, &stop))
                {
                    assert!(
                        more <= progress.samples_left,
                        "{more} expected, {} asked for: {stop:?}",
                        progress.samples_left
                    );
                    exact += u32::from(more == progress.samples_left);
                }
                let samples = progress.samples_left;
                progress.add(&WaveStats {
                    samples,
                    render_s: samples as f64 * seconds,
                    ..WaveStats::default()
                });
                let row = progress.close_wave();
                let done = stop.sample_limit().is_some_and(|n| row.samples >= n)
                    || stop.time_limit_s().is_some_and(|s| row.render_s >= s);
                progress.rows.push(row);
                if done {
                    assert_eq!(
                        expected,
                        Some(0),
                        "nothing is started after the last wave: {stop:?}"
                    );
                    break;
                }
            }
            assert!(exact > 3, "{exact}");
        }
    }

    /// Sample counts after each wave on a clock of `seconds` per sample.
    fn totals(every_s: f64, pow2: bool, stop: &StopRule, seconds: f64, count: usize) -> Vec<u64> {
        let mut waves = WaveSizer::new(every_s, pow2);
        let mut rows: Vec<WaveRow> = Vec::new();
        for _ in 0..count {
            let samples = rows.last().map_or(0, |r| r.samples) + waves.next(&rows, stop);
            rows.push(WaveRow {
                samples,
                render_s: samples as f64 * seconds,
                ..WaveRow::default()
            });
        }
        rows.iter().map(|row| row.samples).collect()
    }

    #[test]
    fn waves_double_up_to_the_time_between_measurements() {
        let stop = StopRule::Samples(1 << 40);
        assert_eq!(totals(1e9, false, &stop, 1.0, 5), [1, 3, 7, 15, 31]);
        // 0.125 s a sample: at most 8 samples fit into a second.
        assert_eq!(
            totals(1.0, false, &stop, 0.125, 7),
            [1, 3, 7, 15, 23, 31, 39]
        );
        assert_eq!(totals(0.0, false, &stop, 0.125, 3), [1, 2, 3]);
    }

    #[test]
    fn sample_limits_and_powers_of_two_are_hit_exactly() {
        assert_eq!(
            totals(1e9, false, &StopRule::Samples(10), 1.0, 4),
            [1, 3, 7, 10]
        );
        assert_eq!(totals(1e9, false, &StopRule::Samples(1), 1.0, 1), [1]);
        let stop = StopRule::All(vec![StopRule::Samples(5), StopRule::Samples(12)]);
        assert_eq!(totals(1e9, false, &stop, 1.0, 4), [1, 3, 5, 12]);
        assert_eq!(
            totals(1e9, true, &StopRule::Samples(20), 1.0, 6),
            [1, 2, 4, 8, 16, 20]
        );
        // Three samples fit: powers of two are still met.
        assert_eq!(
            totals(3.0, true, &StopRule::Waves(99), 1.0, 8),
            [1, 2, 4, 7, 8, 11, 14, 16]
        );
    }

    #[test]
    fn a_time_limit_is_exceeded_by_less_than_a_sample() {
        let stop = StopRule::Time(10.25);
        assert_eq!(totals(1e9, false, &stop, 1.0, 4), [1, 3, 7, 11]);
        assert_eq!(totals(1e9, false, &stop, 64.0, 1), [1]);
    }

    #[test]
    fn a_clock_that_stands_still_does_not_stop_the_waves() {
        assert_eq!(
            totals(1.0, false, &StopRule::Waves(9), 0.0, 4),
            [1, 3, 7, 15]
        );
    }
}
