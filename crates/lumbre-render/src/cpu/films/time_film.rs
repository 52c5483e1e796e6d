//! Films with a time axis. [`TimeFilm`] holds the sums of all slots, [`TimeRowFilm`] accumulates
//! the samples of one row of pixels.
//!
//! Invariants: one thread adds the samples of a pixel in the order of their index, splats are added
//! in fixed point, and a sample that the picture rejects is rejected here too. The sum of a pixel
//! of the picture is the sum of its slots in their order, so that both have the same bits.

use std::io::{self, Write};
use std::mem::take;
use std::sync::OnceLock;

use glam::Vec3;
use rayon::prelude::*;

use super::bin_pool::{Slot, SlotMemory};
use super::contributions::TimedContribution;
use crate::Job;
use lumbre_light::film::Film;
use lumbre_light::film::fixed_point;
use lumbre_light::film::prefetch::prefetch;
use lumbre_light::film::splat::SplatSums;
use lumbre_light::film::state::{CheckpointMismatch, StateReader, write_u64s};
use lumbre_light::film::time::{TimeCube, bytes, sum_slots};
use lumbre_light::transport::time_settings::Timing;

/// Sums of a film with a time axis.
pub(crate) struct TimeFilm {
    timing: Timing,
    memory: SlotMemory,
    /// Splat sums in the order of the slots; allocated for the first splat unless they were
    /// allocated beforehand.
    splats: OnceLock<SplatSums>,
}

/// Slots of one row of pixels, `[x][slot]`.
pub(crate) type SlotRow<'a> = &'a mut [Slot];

impl TimeFilm {
    /// Creates the film of a job, or returns `None` if it has no time axis. Memory is cleared by
    /// the threads of the current pool.
    ///
    /// # Errors
    /// Returns a message if the film exceeds the limit of [`bytes`].
    pub(crate) fn for_job(job: &Job) -> Result<Option<TimeFilm>, String> {
        let Some(timing) = &job.settings.timing else {
            return Ok(None);
        };
        let pixels = u64::from(job.resolution[0]) * u64::from(job.resolution[1]);
        bytes(&timing.axis, pixels, job.integrator.splats)?;
        let n = pixels as usize * timing.axis.slots();
        let mut memory = SlotMemory::new(n, job.integrator.splats);
        let splats = memory
            .splats
            .take()
            .map_or_else(OnceLock::new, OnceLock::from);
        Ok(Some(TimeFilm {
            timing: timing.clone(),
            memory,
            splats,
        }))
    }

    /// Splits the film into rows, each for the thread that renders it, and returns the destination
    /// of splats. Without a time axis every row is `None`.
    pub(crate) fn rows(
        times: &mut Option<TimeFilm>,
        height: u32,
    ) -> (Vec<Option<SlotRow<'_>>>, Option<TimedSplats<'_>>) {
        match times {
            None => ((0..height).map(|_| None).collect(), None),
            Some(TimeFilm {
                timing,
                memory: SlotMemory { slots, .. },
                splats,
            }) => {
                let n = slots.len();
                let rows = slots
                    .chunks_mut((n / (height as usize).max(1)).max(1))
                    .map(Some)
                    .collect();
                (
                    rows,
                    Some(TimedSplats {
                        timing,
                        splats,
                        slots: n,
                    }),
                )
            }
        }
    }

    /// Returns the picture: its sums are those of the slots, splats included. `own` has the sums of
    /// squares of the samples' contributions to their own pixels.
    pub(crate) fn film(&self, own: &Film) -> Film {
        let n = self.timing.axis.slots();
        let mut film = own.clone();
        for (sum, slots) in film.sum.iter_mut().zip(self.memory.slots.chunks_exact(n)) {
            *sum = sum_slots(slots.iter().map(|slot| slot.sum));
        }
        let Some(splats) = self.splats.get() else {
            return film;
        };
        let mut splat_sums = vec![([0.0; 3], [0.0; 3]); film.sum.len()];
        // Slots without splats are added between those with splats, so that all are added in order.
        let mut sums = vec![[0.0; 3]; film.sum.len()];
        let mut next = 0;
        let mut add_slots_until = |until: usize, sums: &mut Vec<[f64; 3]>| {
            for i in next..until {
                let sum = &mut sums[i / n];
                (0..3).for_each(|c| sum[c] += self.memory.slots[i].sum[c]);
            }
            next = until + 1;
        };
        splats.for_each(|i, splat, squares| {
            add_slots_until(i, &mut sums);
            let (all, pixel) = (&mut sums[i / n], &mut splat_sums[i / n]);
            for c in 0..3 {
                all[c] += self.memory.slots[i].sum[c] + splat[c];
                pixel.0[c] += splat[c];
                pixel.1[c] += squares[c];
            }
        });
        add_slots_until(self.memory.slots.len(), &mut sums);
        for (pixel, splat_sums) in splat_sums.into_iter().enumerate() {
            let own = (film.sum[pixel], film.sum2[pixel]);
            film.sum2[pixel] = fixed_point::combine_sums(splat_sums, own, film.samples).1;
            film.sum[pixel] = sums[pixel];
        }
        film
    }

    /// Returns the sums of all slots, splats included.
    pub(crate) fn cube(&self, [width, height]: [u32; 2], samples: u64) -> TimeCube {
        let mut cube = TimeCube {
            axis: self.timing.axis,
            width,
            height,
            samples,
            sum: self.memory.slots.iter().map(|slot| slot.sum).collect(),
            square: self.memory.slots.iter().map(|slot| slot.square).collect(),
        };
        if let Some(splats) = self.splats.get() {
            splats.for_each(|i, splat, squares| {
                let own = (cube.sum[i], cube.square[i].map(f64::from));
                let (all, squared) = fixed_point::combine_sums((splat, squares), own, samples);
                (cube.sum[i], cube.square[i]) = (all, squared.map(|q| q as f32));
            });
        }
        cube
    }

    /// Writes all sums. Slots whose sums are zero are left out.
    pub(crate) fn save(&self, to: &mut dyn Write) -> io::Result<()> {
        let slots = &self.memory.slots;
        let nonzero = |i: &usize| slots[*i].sum != [0.0; 3] || slots[*i].square != [0.0; 3];
        write_u64s(
            to,
            [
                slots.len() as u64,
                (0..slots.len()).filter(nonzero).count() as u64,
            ],
        )?;
        let words = (0..slots.len()).filter(nonzero).flat_map(|i| {
            let [a, b, c] = slots[i].square.map(|q| u64::from(q.to_bits()));
            let [x, y, z] = slots[i].sum.map(f64::to_bits);
            [i as u64 | a << 32, x, y, z, b | c << 32]
        });
        write_u64s(to, words)?;
        SplatSums::save(self.splats.get(), to)
    }

    /// Reads the sums of a film with the same axis and resolution.
    pub(crate) fn restore(&mut self, from: &mut StateReader<'_>) -> Result<(), CheckpointMismatch> {
        let [slots, nonzero] = [from.read_u64()?, from.read_u64()?];
        if slots != self.memory.slots.len() as u64 {
            return Err(CheckpointMismatch);
        }
        for _ in 0..nonzero {
            let (first, sum) = (
                from.read_u64()?,
                [from.read_u64()?, from.read_u64()?, from.read_u64()?],
            );
            let last = from.read_u64()?;
            let i = (first & u64::from(u32::MAX)) as usize;
            let slot = self.memory.slots.get_mut(i).ok_or(CheckpointMismatch)?;
            slot.sum = sum.map(f64::from_bits);
            slot.square = [first >> 32, last & u64::from(u32::MAX), last >> 32]
                .map(|q| f32::from_bits(q as u32));
        }
        let splats = SplatSums::restore(self.memory.slots.len(), from)?;
        let preallocated = self.splats.take().is_some();
        if let (true, Some(splats)) = (preallocated, &splats) {
            (0..splats.stripes())
                .into_par_iter()
                .for_each(|stripe| splats.reserve(stripe));
        }
        self.splats = splats.map_or_else(OnceLock::new, OnceLock::from);
        Ok(())
    }
}

impl Drop for TimeFilm {
    fn drop(&mut self) {
        self.memory.splats = self.splats.take();
        self.memory.recycle();
    }
}

/// Destination of splats in films with a time axis.
#[derive(Clone, Copy)]
pub(crate) struct TimedSplats<'a> {
    timing: &'a Timing,
    splats: &'a OnceLock<SplatSums>,
    slots: usize,
}

impl<'a> TimedSplats<'a> {
    /// Returns the splat sums, allocating them if needed.
    pub(crate) fn sums(&self) -> &'a SplatSums {
        self.splats.get_or_init(|| SplatSums::new(self.slots))
    }

    /// Returns the number of slots of the film.
    pub(crate) fn slots(&self) -> usize {
        self.slots
    }

    /// Distributes a splat over the slots of a pixel: calls `push` with the index of each slot and
    /// its share of the radiance. `length` is the optical length of the path. Returns whether all
    /// shares were accepted.
    pub(crate) fn splat(
        &self,
        pixel: usize,
        (value, length): (Vec3, f64),
        mut push: impl FnMut(usize, [f32; 3]) -> bool,
    ) -> bool {
        let first = pixel * self.timing.axis.slots();
        let mut all_accepted = true;
        let position = self.timing.axis.bin_position(length);
        TimedContribution::for_each_slot(self.timing, 0, value, position, |contribution| {
            all_accepted &= push(first + contribution.slot as usize, contribution.value)
        });
        all_accepted
    }
}

/// Number of the last sample that contributed to a slot, and its contribution so far.
#[derive(Clone, Copy, Default)]
struct Latest {
    value: [f32; 3],
    sample: u32,
}

/// Accumulates the samples of one row of pixels in the slots of their own pixels.
pub(crate) struct TimeRowFilm<'a> {
    timing: &'a Timing,
    row: &'a mut [Slot],
    /// Contributions of the current sample; used only on the scalar path.
    timed: Vec<TimedContribution>,
    /// Last contribution to each slot, in any pixel of the row: a sample contributes to one pixel.
    latest: Vec<Latest>,
    /// Number of samples so far, modulo 2^32; samples are numbered by it, from 1.
    samples: u32,
}

impl<'a> TimeRowFilm<'a> {
    /// Creates the accumulator of one row.
    pub(crate) fn new(splats: TimedSplats<'a>, row: SlotRow<'a>) -> TimeRowFilm<'a> {
        let timing = splats.timing;
        TimeRowFilm {
            timing,
            row,
            timed: Vec::new(),
            latest: vec![Latest::default(); timing.axis.slots()],
            samples: 0,
        }
    }

    /// Adds a contribution to the sample's own pixel in column `x`; `length` is the optical length
    /// of its path.
    #[inline]
    pub(crate) fn add_timed(&mut self, x: u32, value: Vec3, length: f64) {
        TimedContribution::for_each_slot(
            self.timing,
            0,
            value,
            self.timing.axis.bin_position(length),
            |contribution| {
                prefetch(&self.row[x as usize * self.latest.len() + contribution.slot as usize]);
                self.timed.push(contribution);
            },
        );
    }

    /// Ends a sample of column `x`; `accepted` is whether the picture accepted it. Returns whether
    /// the sums of squares stayed finite.
    #[inline]
    pub(crate) fn finish_sample(&mut self, x: u32, accepted: bool) -> bool {
        let mut timed = take(&mut self.timed);
        let mut finite = true;
        if accepted {
            self.add_batch::<0>(1, |_| x, &timed, |_| finite = false);
        }
        timed.clear();
        self.timed = timed;
        finite
    }

    /// Adds the contributions of `samples` samples, sorted by sample; `column` returns the column
    /// of a sample. Calls `overflowed` with the sample of each contribution that made a sum of
    /// squares overflow. Slots are prefetched `PREFETCH` contributions ahead.
    ///
    /// Sums are updated contribution by contribution, so that rounding does not depend on how many
    /// contributions of a sample reach the same slot. The square is that of the sample's total
    /// contribution to a slot.
    #[inline(always)]
    pub(crate) fn add_batch<const PREFETCH: usize>(
        &mut self,
        samples: u32,
        column: impl Fn(u32) -> u32,
        timed: &[TimedContribution],
        mut overflowed: impl FnMut(u32),
    ) {
        let TimeRowFilm { row, latest, .. } = self;
        let slots = latest.len();
        let index = |contribution: &TimedContribution| {
            column(contribution.path) as usize * slots + contribution.slot as usize
        };
        timed
            .iter()
            .take(PREFETCH)
            .for_each(|contribution| prefetch(&row[index(contribution)]));
        // Sample numbers repeat after 2^32 samples. A contribution may then be attributed to the
        // earlier sample with the same number.
        let first = self.samples.wrapping_add(1);
        for (i, contribution) in timed.iter().enumerate() {
            if PREFETCH > 0
                && let Some(ahead) = timed.get(i + PREFETCH)
            {
                prefetch(&row[index(ahead)]);
            }
            let slot = &mut row[index(contribution)];
            slot.add(contribution.value);
            let latest = &mut latest[contribution.slot as usize];
            let sample = first.wrapping_add(contribution.path);
            let finite = if latest.sample == sample {
                let before = latest.value;
                latest.value = [0, 1, 2].map(|c| before[c] + contribution.value[c]);
                slot.replace_square(before, latest.value)
            } else {
                *latest = Latest {
                    value: contribution.value,
                    sample,
                };
                slot.add_square(contribution.value)
            };
            if !finite {
                overflowed(contribution.path);
            }
        }
        self.samples = self.samples.wrapping_add(samples);
    }
}

#[cfg(test)]
mod tests {
    use crate::cpu::films::time_film::*;
    use lumbre_light::film::time::TimeAxis;

    #[test]
    fn a_sample_adds_one_square_per_slot_and_overflow_is_reported() {
        let timing = Timing::plain(TimeAxis {
            start: 0.0,
            bin: 1.0,
            bins: 4,
        });
        let splats = OnceLock::new();
        let mut row = vec![Slot::default(); 2 * timing.axis.slots()];
        let target = TimedSplats {
            timing: &timing,
            splats: &splats,
            slots: row.len(),
        };
        let mut film = TimeRowFilm::new(target, &mut row);
        let mut sample = |timed: &[(f32, f64)], accepted: bool| {
            timed
                .iter()
                .for_each(|(value, length)| film.add_timed(1, Vec3::splat(*value), *length));
            film.finish_sample(1, accepted)
        };
        assert!(sample(&[(1.5, 0.2), (2.0, 2.5), (0.5, 0.9)], true));
        assert!(sample(&[(1.0, 0.5), (8.0, 9.0)], true));
        assert!(
            sample(&[(7.0, 0.5)], false),
            "a sample that the picture refused is dropped"
        );
        assert!(!sample(&[(1e20, -1.0)], true), "its square overflows");
        let sums_of_slot = |slot: usize| (row[6 + slot].sum[1], row[6 + slot].square[1]);
        assert_eq!(
            [
                sums_of_slot(1),
                sums_of_slot(2),
                sums_of_slot(3),
                sums_of_slot(5)
            ],
            [(3.0, 5.0), (0.0, 0.0), (2.0, 4.0), (8.0, 64.0)]
        );
        assert_eq!(sums_of_slot(0), (f64::from(1e20f32), f32::INFINITY));
        assert!(
            row[..6].iter().all(|slot| *slot == Slot::default()),
            "another pixel"
        );
    }
}
