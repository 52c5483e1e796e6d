//! Reference halves. A reference is rendered twice, with two seeds and half of the samples each.
//! Their mean is the reference, and their difference is an estimate of its noise.
//!
//! The halves use two seeds rather than the even and odd samples of one, because samples of one
//! seed need not be independent: those of `sobol` are stratified, so halves of one seed would
//! differ by more than the noise of the whole.

use std::io::{self, Write};
use std::sync::Arc;

use super::{Advance, OpenStats, RenderError, Renderer, WaveStats};
use lumbre_light::film::Film;
use lumbre_light::film::layer::{LayerFilm, LayerSource};
use lumbre_light::film::state::{CheckpointMismatch, write_u64s};

/// Two runs of one job with different seeds, presented as one run whose samples are split evenly;
/// the first half gets the odd one. Both are open at the same time: unless the scene has a
/// [`SceneKeeper`](crate::cpu::kept_scenes::SceneKeeper), its hierarchy is in memory twice.
pub struct ReferenceHalves {
    halves: [Box<dyn Renderer>; 2],
    joint: Film,
    open_stats: OpenStats,
}

impl ReferenceHalves {
    /// Combines two runs that have equally many samples, or of which the first has one more.
    pub fn new(halves: [Box<dyn Renderer>; 2]) -> ReferenceHalves {
        let [first, second] = [0, 1].map(|i: usize| halves[i].open_stats());
        // Equal to the bit, it is the time of one hierarchy that both use.
        let shared = first.accel_build_s == second.accel_build_s;
        let second_build_s = if shared { 0.0 } else { second.accel_build_s };
        let open_stats = OpenStats {
            upload_s: first.upload_s + second.upload_s,
            pipeline_s: first.pipeline_s + second.pipeline_s,
            accel_build_s: first.accel_build_s + second_build_s,
            ..first.clone()
        };
        let joint = Film::pooled(halves[0].film(), halves[1].film());
        ReferenceHalves {
            halves,
            joint,
            open_stats,
        }
    }

    /// Returns how many of `total` samples each half has.
    pub fn split(total: u64) -> [u64; 2] {
        [total - total / 2, total / 2]
    }
}

impl Renderer for ReferenceHalves {
    fn render(&mut self, request: &Advance<'_>) -> Result<WaveStats, RenderError> {
        let wanted = ReferenceHalves::split(self.joint.samples + request.samples);
        let mut wave = WaveStats::default();
        for (half, wanted) in self.halves.iter_mut().zip(wanted) {
            // A program with a time limit of its own may have rendered more than was requested.
            let missing = wanted.saturating_sub(half.film().samples);
            if missing == 0 {
                continue;
            }
            let missing = Advance {
                samples: missing,
                more: 0,
                ..*request
            };
            match half.render(&missing) {
                // The first half's samples are kept; the next call completes the second half.
                Err(RenderError::Cancelled { .. }) if wave.samples > 0 => break,
                rendered => wave.add(&rendered?),
            }
        }
        self.joint = Film::pooled(self.halves[0].film(), self.halves[1].film());
        Ok(wave)
    }

    fn whole_waves(&self) -> bool {
        self.halves.iter().any(|half| half.whole_waves())
    }

    fn film(&self) -> &Film {
        &self.joint
    }

    fn halves(&self) -> Option<[Arc<Film>; 2]> {
        let [first, second] = [0, 1].map(|i: usize| self.halves[i].film());
        (second.samples > 0).then(|| [first, second].map(|film| Arc::new(film.clone())))
    }

    fn layers(&self) -> &[LayerFilm] {
        self.halves[0].layers()
    }

    fn layer(&self, index: usize) -> Result<Film, RenderError> {
        let film = self.layers().get(index);
        if film.is_some_and(|film| matches!(film.layer.row().source, LayerSource::FirstIndex(_))) {
            return self.halves[0].layer(index);
        }
        let [first, second] = [0, 1].map(|i: usize| self.halves[i].layer(index));
        Ok(Film::pooled(&first?, &second?))
    }

    fn save(&self, to: &mut dyn Write) -> io::Result<bool> {
        // Either both states are written or none, so they are buffered until both are complete.
        let mut states = [Vec::new(), Vec::new()];
        for (half, state) in self.halves.iter().zip(&mut states) {
            if !half.save(state)? {
                return Ok(false);
            }
        }
        for state in &states {
            write_u64s(to, [state.len() as u64])?;
            to.write_all(state)?;
        }
        Ok(true)
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), RenderError> {
        let mismatch = || RenderError::failed("halves", CheckpointMismatch);
        let mut rest = state;
        for half in &mut self.halves {
            let (length, after) = rest.split_first_chunk().ok_or_else(mismatch)?;
            let length = usize::try_from(u64::from_ne_bytes(*length)).map_err(|_| mismatch())?;
            let (own, after) = after.split_at_checked(length).ok_or_else(mismatch)?;
            half.restore(own)?;
            rest = after;
        }
        let counts = [0, 1].map(|i: usize| self.halves[i].film().samples);
        // The first half is ahead if a wave was cancelled between the two.
        if !rest.is_empty() || counts[0] < counts[1] {
            return Err(mismatch());
        }
        self.joint = Film::pooled(self.halves[0].film(), self.halves[1].film());
        Ok(())
    }

    fn open_stats(&self) -> &OpenStats {
        &self.open_stats
    }
}

#[cfg(test)]
mod tests {
    use crate::reference_halves::*;

    /// Run whose samples all have the same value.
    struct Constant {
        film: Film,
        value: f64,
        open_stats: OpenStats,
    }

    impl Renderer for Constant {
        fn render(&mut self, request: &Advance<'_>) -> Result<WaveStats, RenderError> {
            let samples = request.samples;
            self.film.samples += samples;
            self.film.sum[0] = [self.value * self.film.samples as f64; 3];
            self.film.sum2[0] = [self.value * self.value * self.film.samples as f64; 3];
            let first_invalid = Some([self.value as u64, 0, 0]);
            let stats = WaveStats {
                samples,
                render_s: 0.5,
                device_s: 0.25,
                idle_s: 0.125,
                ..WaveStats::default()
            };
            Ok(WaveStats {
                paths: samples,
                rays: 3,
                invalid: 1,
                first_invalid,
                ..stats
            })
        }

        fn film(&self) -> &Film {
            &self.film
        }

        fn open_stats(&self) -> &OpenStats {
            &self.open_stats
        }
    }

    fn run(value: f64) -> Box<dyn Renderer> {
        let open_stats = OpenStats {
            accel_build_s: value,
            accel_nodes: 7,
            ..OpenStats::default()
        };
        Box::new(Constant {
            film: Film::new(1, 1),
            value,
            open_stats,
        })
    }

    #[test]
    fn samples_are_dealt_out_evenly_whatever_the_waves() {
        let mut halves = ReferenceHalves::new([run(1.0), run(3.0)]);
        assert_eq!(halves.open_stats().accel_build_s, 4.0);
        let wave = halves.advance(1).unwrap();
        assert_eq!((wave.samples, wave.render_s, wave.invalid), (1, 0.5, 1));
        assert!(
            halves.halves().is_none(),
            "a single half is not an estimate"
        );
        let counts = |halves: &ReferenceHalves| halves.halves().unwrap().map(|film| film.samples);
        let wave = halves.advance(4).unwrap();
        assert_eq!(
            (wave.samples, wave.paths, wave.rays, wave.first_invalid),
            (4, 4, 6, Some([1, 0, 0]))
        );
        assert_eq!(
            [wave.render_s, wave.device_s, wave.idle_s],
            [1.0, 0.5, 0.25]
        );
        assert_eq!((counts(&halves), halves.film().samples), ([3, 2], 5));
        halves.advance(1).unwrap();
        assert_eq!(counts(&halves), [3, 3]);
        assert_eq!(halves.film().mean().at(0, 0), [2.0; 3]);
    }
}
