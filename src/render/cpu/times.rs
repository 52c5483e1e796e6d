//! The sums behind a film with a time axis.
//!
//! They keep the promises of the main film: own samples are added in the order of their index by one thread, splats in whole
//! numbers. What is refused there is refused here. And they are the picture: where there is a time axis, the film's sums
//! are those of its slots, added in their order, so that the two have the same bits.

use std::io::{self, Write};
use std::mem::take;
use std::sync::OnceLock;

use glam::Vec3;
use rayon::prelude::*;

use super::bins::{Bins, Slot};
use super::brought::Part;
use crate::film::Film;
use crate::film::prefetch::prefetch;
use crate::film::splat::{self, SplatSums};
use crate::film::state::{Misfit, Saved, write_words};
use crate::film::time::{TimeCube, bytes, total};
use crate::render::Job;
use crate::transport::flight::Timing;

/// All sums of a run by time.
pub(super) struct TimeSums {
    timing: Timing,
    bins: Bins,
    /// In the same order; from the first splat on, where their memory was not had beforehand.
    splats: OnceLock<SplatSums>,
}

/// What the sums of a row of pixels are added to.
pub(super) type TimeRow<'a> = &'a mut [Slot];

impl TimeSums {
    /// Those that a job asks for, if any, made ready by the threads of the pool in which this is called.
    ///
    /// # Errors
    /// When they are too large; in words.
    pub(super) fn of(job: &Job) -> Result<Option<TimeSums>, String> {
        let Some(timing) = &job.timing else { return Ok(None) };
        let pixels = u64::from(job.resolution[0]) * u64::from(job.resolution[1]);
        bytes(&timing.axis, pixels, job.integrator.splats)?;
        let n = pixels as usize * timing.axis.slots();
        let mut bins = Bins::new(n, job.integrator.splats);
        let splats = bins.splats.take().map_or_else(OnceLock::new, OnceLock::from);
        Ok(Some(TimeSums { timing: timing.clone(), bins, splats }))
    }

    /// The sums of every row of pixels, each to be taken by whoever renders it, and where splats go. Without a time axis
    /// there is nothing to take.
    pub(super) fn rows(times: &mut Option<TimeSums>, height: u32) -> (Vec<Option<TimeRow<'_>>>, Option<Landing<'_>>) {
        match times {
            None => ((0..height).map(|_| None).collect(), None),
            Some(TimeSums { timing, bins: Bins { slots, .. }, splats }) => {
                let n = slots.len();
                let rows = slots.chunks_mut((n / (height as usize).max(1)).max(1)).map(Some).collect();
                (rows, Some(Landing { timing, splats, size: n }))
            }
        }
    }

    /// The film whose sums are those of the slots, splats included; `own` is what samples brought to their own pixels.
    pub(super) fn film(&self, own: &Film) -> Film {
        let n = self.timing.axis.slots();
        let mut film = own.clone();
        for (sum, slots) in film.sum.iter_mut().zip(self.bins.slots.chunks_exact(n)) {
            *sum = total(slots.iter().map(|slot| slot.sum));
        }
        let Some(splats) = self.splats.get() else { return film };
        let mut landed = vec![([0.0; 3], [0.0; 3]); film.sum.len()];
        // What lies in slots without splats is added in between, in the order of the slots.
        let mut sums = vec![[0.0; 3]; film.sum.len()];
        let mut next = 0;
        let mut own_up_to = |until: usize, sums: &mut Vec<[f64; 3]>| {
            for i in next..until {
                let sum = &mut sums[i / n];
                (0..3).for_each(|c| sum[c] += self.bins.slots[i].sum[c]);
            }
            next = until + 1;
        };
        splats.each(|i, splat, squares| {
            own_up_to(i, &mut sums);
            let (all, pixel) = (&mut sums[i / n], &mut landed[i / n]);
            for c in 0..3 {
                all[c] += self.bins.slots[i].sum[c] + splat[c];
                pixel.0[c] += splat[c];
                pixel.1[c] += squares[c];
            }
        });
        own_up_to(self.bins.slots.len(), &mut sums);
        for (pixel, landed) in landed.into_iter().enumerate() {
            let own = (film.sum[pixel], film.sum2[pixel]);
            film.sum2[pixel] = splat::join(landed, own, film.samples).1;
            film.sum[pixel] = sums[pixel];
        }
        film
    }

    /// All that is known so far.
    pub(super) fn cube(&self, [width, height]: [u32; 2], samples: u64) -> TimeCube {
        let mut cube = TimeCube {
            axis: self.timing.axis,
            width,
            height,
            samples,
            sum: self.bins.slots.iter().map(|slot| slot.sum).collect(),
            square: self.bins.slots.iter().map(|slot| slot.square).collect(),
        };
        if let Some(splats) = self.splats.get() {
            splats.each(|i, splat, squares| {
                let own = (cube.sum[i], cube.square[i].map(f64::from));
                let (all, squared) = splat::join((splat, squares), own, samples);
                (cube.sum[i], cube.square[i]) = (all, squared.map(|q| q as f32));
            });
        }
        cube
    }

    /// Writes all sums; slots without light are left out.
    pub(super) fn save(&self, to: &mut dyn Write) -> io::Result<()> {
        let slots = &self.bins.slots;
        let lit = |i: &usize| slots[*i].sum != [0.0; 3] || slots[*i].square != [0.0; 3];
        write_words(to, [slots.len() as u64, (0..slots.len()).filter(lit).count() as u64])?;
        let words = (0..slots.len()).filter(lit).flat_map(|i| {
            let [a, b, c] = slots[i].square.map(|q| u64::from(q.to_bits()));
            let [x, y, z] = slots[i].sum.map(f64::to_bits);
            [i as u64 | a << 32, x, y, z, b | c << 32]
        });
        write_words(to, words)?;
        SplatSums::save(self.splats.get(), to)
    }

    /// Takes the sums of the same axis and picture.
    pub(super) fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Misfit> {
        let lit = [from.word()?, from.word()?];
        if lit[0] != self.bins.slots.len() as u64 {
            return Err(Misfit);
        }
        for _ in 0..lit[1] {
            let (place, sum) = (from.word()?, [from.word()?, from.word()?, from.word()?]);
            let rest = from.word()?;
            let i = (place & u64::from(u32::MAX)) as usize;
            let slot = self.bins.slots.get_mut(i).ok_or(Misfit)?;
            slot.sum = sum.map(f64::from_bits);
            slot.square = [place >> 32, rest & u64::from(u32::MAX), rest >> 32].map(|q| f32::from_bits(q as u32));
        }
        let splats = SplatSums::restore(self.bins.slots.len(), from)?;
        let ready = self.splats.take().is_some();
        if let (true, Some(splats)) = (ready, &splats) {
            (0..splats.stripes()).into_par_iter().for_each(|stripe| splats.reserve(stripe));
        }
        self.splats = splats.map_or_else(OnceLock::new, OnceLock::from);
        Ok(())
    }
}

impl Drop for TimeSums {
    fn drop(&mut self) {
        self.bins.splats = self.splats.take();
        self.bins.leave();
    }
}

/// Where splats of films with a time axis go.
#[derive(Clone, Copy)]
pub(super) struct Landing<'a> {
    timing: &'a Timing,
    splats: &'a OnceLock<SplatSums>,
    size: usize,
}

impl<'a> Landing<'a> {
    /// The sums.
    pub(super) fn sums(&self) -> &'a SplatSums {
        self.splats.get_or_init(|| SplatSums::new(self.size))
    }

    /// How many slots there are.
    pub(super) fn size(&self) -> usize {
        self.size
    }

    /// Hands each share of a splat on a pixel to `push` with its place among the sums, and says whether all were taken.
    pub(super) fn splat(
        &self,
        pixel: usize,
        (value, length): (Vec3, f64),
        mut push: impl FnMut(usize, [f32; 3]) -> bool,
    ) -> bool {
        let first = pixel * self.timing.axis.slots();
        let mut taken = true;
        let place = self.timing.axis.place(length);
        Part::each(self.timing, 0, value, place, |part| taken &= push(first + part.slot as usize, part.value));
        taken
    }
}

/// The last sample that brought anything to a slot, by its number, and all of that so far.
#[derive(Clone, Copy, Default)]
struct Latest {
    value: [f32; 3],
    sample: u32,
}

/// Puts what the samples of a row bring to their own pixels into its slots.
pub(super) struct Gathering<'a> {
    timing: &'a Timing,
    row: &'a mut [Slot],
    /// What the sample in progress has brought so far, of paths that go one by one.
    parts: Vec<Part>,
    /// Of every slot.
    latest: Vec<Latest>,
    /// Samples so far.
    samples: u32,
}

impl<'a> Gathering<'a> {
    /// For one row.
    pub(super) fn new(landing: Landing<'a>, row: TimeRow<'a>) -> Gathering<'a> {
        let timing = landing.timing;
        Gathering { timing, row, parts: Vec::new(), latest: vec![Latest::default(); timing.axis.slots()], samples: 0 }
    }

    /// Takes light for the sample's own pixel, which is in column `x`, and the optical length of its path.
    #[inline]
    pub(super) fn own(&mut self, x: u32, value: Vec3, length: f64) {
        Part::each(self.timing, 0, value, self.timing.axis.place(length), |part| {
            prefetch(&self.row[x as usize * self.latest.len() + part.slot as usize]);
            self.parts.push(part);
        });
    }

    /// Ends a sample of column `x`; `counts` is whether the picture took it. Returns whether there was room for squares.
    #[inline]
    pub(super) fn close(&mut self, x: u32, counts: bool) -> bool {
        let mut parts = take(&mut self.parts);
        let mut room = true;
        if counts {
            self.add::<0>(1, |_| x, &parts, |_| room = false);
        }
        parts.clear();
        self.parts = parts;
        room
    }

    /// Adds all parts of so many samples, sample by sample; `column` says where each of them is. Tells `full` the sample of
    /// every part for whose square there was no room. So many slots are fetched ahead.
    ///
    /// Sums are added part by part, so that what comes together rounds none: a film's picture does not know when its light
    /// arrives. The square is that of all that a sample brings to a slot.
    #[inline(always)]
    pub(super) fn add<const FETCHED: usize>(
        &mut self,
        samples: u32,
        column: impl Fn(u32) -> u32,
        parts: &[Part],
        mut full: impl FnMut(u32),
    ) {
        let Gathering { row, latest, .. } = self;
        let slots = latest.len();
        let place = |part: &Part| column(part.path) as usize * slots + part.slot as usize;
        parts.iter().take(FETCHED).for_each(|part| prefetch(&row[place(part)]));
        // Where the number of a sample comes again after 2^32 others, a part may be taken for one that comes twice.
        let first = self.samples.wrapping_add(1);
        for (i, part) in parts.iter().enumerate() {
            if FETCHED > 0
                && let Some(ahead) = parts.get(i + FETCHED)
            {
                prefetch(&row[place(ahead)]);
            }
            let slot = &mut row[place(part)];
            slot.add(part.value);
            let latest = &mut latest[part.slot as usize];
            let sample = first.wrapping_add(part.path);
            let room = if latest.sample == sample {
                let before = latest.value;
                latest.value = [0, 1, 2].map(|c| before[c] + part.value[c]);
                slot.add_to_square(before, latest.value)
            } else {
                *latest = Latest { value: part.value, sample };
                slot.add_square(part.value)
            };
            if !room {
                full(part.path);
            }
        }
        self.samples = self.samples.wrapping_add(samples);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::time::TimeAxis;

    #[test]
    fn what_a_sample_brings_to_a_slot_has_one_square_and_what_overflows_is_told() {
        let timing = Timing::plain(TimeAxis { start: 0.0, bin: 1.0, bins: 4 });
        let splats = OnceLock::new();
        let mut row = vec![Slot::default(); 2 * timing.axis.slots()];
        let landing = Landing { timing: &timing, splats: &splats, size: row.len() };
        let mut gathering = Gathering::new(landing, &mut row);
        let mut sample = |parts: &[(f32, f64)], counts: bool| {
            parts.iter().for_each(|(value, length)| gathering.own(1, Vec3::splat(*value), *length));
            gathering.close(1, counts)
        };
        assert!(sample(&[(1.5, 0.2), (2.0, 2.5), (0.5, 0.9)], true));
        assert!(sample(&[(1.0, 0.5), (8.0, 9.0)], true));
        assert!(sample(&[(7.0, 0.5)], false), "what the picture has refused is dropped");
        assert!(!sample(&[(1e20, -1.0)], true), "no room for its square");
        let of = |slot: usize| (row[6 + slot].sum[1], row[6 + slot].square[1]);
        assert_eq!([of(1), of(2), of(3), of(5)], [(3.0, 5.0), (0.0, 0.0), (2.0, 4.0), (8.0, 64.0)]);
        assert_eq!(of(0), (f64::from(1e20f32), f32::INFINITY));
        assert!(row[..6].iter().all(|slot| *slot == Slot::default()), "another pixel");
    }
}
