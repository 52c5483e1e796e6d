//! The sums behind a film with a time axis.
//!
//! They keep the promises of the main film: own samples are added in the order of their index by one thread, splats in whole
//! numbers. What is refused there is refused here. And they are the picture: where there is a time axis, the film's sums
//! are those of its slots, added in their order, so that the two have the same bits.

use std::io::{self, Write};
use std::sync::OnceLock;

use glam::Vec3;
use rayon::prelude::*;

use super::bins::Bins;
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
pub(super) struct TimeRow<'a> {
    sum: &'a mut [[f64; 3]],
    square: &'a mut [[f32; 3]],
}

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
            Some(TimeSums { timing, bins: Bins { sum, square, .. }, splats }) => {
                let n = sum.len();
                let row = (n / (height as usize).max(1)).max(1);
                let rows = sum.chunks_mut(row).zip(square.chunks_mut(row));
                let rows = rows.map(|(sum, square)| Some(TimeRow { sum, square })).collect();
                (rows, Some(Landing { timing, splats, size: n }))
            }
        }
    }

    /// The film whose sums are those of the slots, splats included; `own` is what samples brought to their own pixels.
    pub(super) fn film(&self, own: &Film) -> Film {
        let n = self.timing.axis.slots();
        let mut film = own.clone();
        for (sum, slots) in film.sum.iter_mut().zip(self.bins.sum.chunks_exact(n)) {
            *sum = total(slots);
        }
        let Some(splats) = self.splats.get() else { return film };
        let mut landed = vec![([0.0; 3], [0.0; 3]); film.sum.len()];
        // What lies in slots without splats is added in between, in the order of the slots.
        let mut sums = vec![[0.0; 3]; film.sum.len()];
        let mut next = 0;
        let mut own_up_to = |until: usize, sums: &mut Vec<[f64; 3]>| {
            for i in next..until {
                let sum = &mut sums[i / n];
                (0..3).for_each(|c| sum[c] += self.bins.sum[i][c]);
            }
            next = until + 1;
        };
        splats.each(|i, splat, squares| {
            own_up_to(i, &mut sums);
            let (all, pixel) = (&mut sums[i / n], &mut landed[i / n]);
            for c in 0..3 {
                all[c] += self.bins.sum[i][c] + splat[c];
                pixel.0[c] += splat[c];
                pixel.1[c] += squares[c];
            }
        });
        own_up_to(self.bins.sum.len(), &mut sums);
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
            sum: self.bins.sum.clone(),
            square: self.bins.square.clone(),
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
        let lit = |i: &usize| self.bins.sum[*i] != [0.0; 3] || self.bins.square[*i] != [0.0; 3];
        write_words(to, [self.bins.sum.len() as u64, (0..self.bins.sum.len()).filter(lit).count() as u64])?;
        let words = (0..self.bins.sum.len()).filter(lit).flat_map(|i| {
            let [a, b, c] = self.bins.square[i].map(|q| u64::from(q.to_bits()));
            let [x, y, z] = self.bins.sum[i].map(f64::to_bits);
            [i as u64 | a << 32, x, y, z, b | c << 32]
        });
        write_words(to, words)?;
        SplatSums::save(self.splats.get(), to)
    }

    /// Takes the sums of the same axis and picture.
    pub(super) fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Misfit> {
        let lit = [from.word()?, from.word()?];
        if lit[0] != self.bins.sum.len() as u64 {
            return Err(Misfit);
        }
        for _ in 0..lit[1] {
            let (place, sum) = (from.word()?, [from.word()?, from.word()?, from.word()?]);
            let rest = from.word()?;
            let i = (place & u64::from(u32::MAX)) as usize;
            let (Some(at), Some(square)) = (self.bins.sum.get_mut(i), self.bins.square.get_mut(i)) else {
                return Err(Misfit);
            };
            *at = sum.map(f64::from_bits);
            *square = [place >> 32, rest & u64::from(u32::MAX), rest >> 32].map(|q| f32::from_bits(q as u32));
        }
        let splats = SplatSums::restore(self.bins.sum.len(), from)?;
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

    /// Hands each share of a splat on a pixel to `push` with its place among the sums, and says whether all were taken.
    pub(super) fn splat(
        &self,
        pixel: usize,
        (value, length): (Vec3, f64),
        mut push: impl FnMut(usize, [f32; 3]) -> bool,
    ) -> bool {
        let Timing { axis, filter, .. } = self.timing;
        let mut taken = true;
        filter.spread(axis, axis.place(length), |slot, share| {
            let value = if share == 1.0 { value } else { value * share as f32 };
            taken &= push(pixel * axis.slots() + slot, value.to_array());
        });
        taken
    }
}

/// Where a row's samples gather before they are added to the sums.
pub(super) struct Gathering<'a> {
    timing: &'a Timing,
    row: TimeRow<'a>,
    /// What the sample in progress has brought, by slot.
    values: Vec<[f64; 3]>,
    /// The slots that hold any of it.
    touched: Vec<u32>,
}

impl<'a> Gathering<'a> {
    /// For one row.
    pub(super) fn new(landing: Landing<'a>, row: TimeRow<'a>) -> Gathering<'a> {
        let timing = landing.timing;
        Gathering { timing, row, values: vec![[0.0; 3]; timing.axis.slots()], touched: Vec::new() }
    }

    /// Takes light for the sample's own pixel, which is in column `x`, and the optical length of its path.
    #[inline]
    pub(super) fn own(&mut self, x: u32, value: Vec3, length: f64) {
        let Timing { axis, filter, .. } = self.timing;
        let (values, touched) = (&mut self.values, &mut self.touched);
        let first = x as usize * values.len();
        let value = value.as_dvec3().to_array();
        filter.spread(axis, axis.place(length), |slot, share| {
            let sums = &mut values[slot];
            if *sums == [0.0; 3] {
                touched.push(slot as u32);
                // Films are larger than caches, and the end of the sample is far away.
                prefetch(&self.row.sum[first + slot]);
                prefetch(&self.row.square[first + slot]);
            }
            (0..3).for_each(|c| sums[c] += value[c] * share);
        });
    }

    /// Ends a sample of column `x`; `counts` is whether the picture took it. Returns whether there was room for squares.
    #[inline]
    pub(super) fn close(&mut self, x: u32, counts: bool) -> bool {
        let first = x as usize * self.values.len();
        let mut room = true;
        for slot in self.touched.drain(..) {
            let slot = slot as usize;
            let value = std::mem::take(&mut self.values[slot]);
            if !counts {
                continue;
            }
            let (sum, square) = (&mut self.row.sum[first + slot], &mut self.row.square[first + slot]);
            for c in 0..3 {
                sum[c] += value[c];
                square[c] += (value[c] * value[c]) as f32;
                room &= square[c].is_finite();
            }
        }
        room
    }
}
