//! The sums behind a film with a time axis.
//!
//! They keep the promises of the main film: own samples are added in the order of their index by one thread, splats in whole
//! numbers. What is refused there is refused here. And they are the picture: where there is a time axis, the film's sums
//! are those of its slots, added in their order, so that the two have the same bits.

use std::io::{self, Write};
use std::sync::OnceLock;

use crate::film::Film;
use crate::film::splat::SplatSums;
use crate::film::state::{Misfit, Saved, write_words};
use crate::film::time::{TimeCube, bytes, total};
use crate::render::Job;
use crate::transport::contribution::Contribution;
use crate::transport::flight::Timing;

/// All sums of a run by time.
pub(super) struct TimeSums {
    timing: Timing,
    /// `[y][x][slot][rgb]`. Pages that no light has reached are not there yet.
    sum: Vec<[f64; 3]>,
    square: Vec<[f32; 3]>,
    /// From the first splat on, in the same order.
    splats: OnceLock<SplatSums>,
}

/// What the sums of a row of pixels are added to.
pub(super) struct TimeRow<'a> {
    sum: &'a mut [[f64; 3]],
    square: &'a mut [[f32; 3]],
}

impl TimeSums {
    /// Those that a job asks for, if any.
    ///
    /// # Errors
    /// When they are too large; in words.
    pub(super) fn of(job: &Job) -> Result<Option<TimeSums>, String> {
        let Some(timing) = &job.timing else { return Ok(None) };
        let pixels = u64::from(job.resolution[0]) * u64::from(job.resolution[1]);
        bytes(&timing.axis, pixels, job.integrator.splats)?;
        let n = pixels as usize * timing.axis.slots();
        let (sum, square) = (vec![[0.0; 3]; n], vec![[0.0; 3]; n]);
        Ok(Some(TimeSums { timing: timing.clone(), sum, square, splats: OnceLock::new() }))
    }

    /// The sums of every row of pixels, each to be taken by whoever renders it, and where splats go. Without a time axis
    /// there is nothing to take.
    pub(super) fn rows(times: &mut Option<TimeSums>, height: u32) -> (Vec<Option<TimeRow<'_>>>, Option<Landing<'_>>) {
        match times {
            None => ((0..height).map(|_| None).collect(), None),
            Some(TimeSums { timing, sum, square, splats }) => {
                let n = sum.len();
                let row = (n / (height as usize).max(1)).max(1);
                let rows = sum.chunks_mut(row).zip(square.chunks_mut(row));
                let rows = rows.map(|(sum, square)| Some(TimeRow { sum, square })).collect();
                (rows, Some(Landing { timing, splats, size: n }))
            }
        }
    }

    /// Makes the sums of the film those of its slots.
    pub(super) fn fill(&self, film: &mut Film) {
        for (sum, slots) in film.sum.iter_mut().zip(self.sum.chunks_exact(self.timing.axis.slots())) {
            *sum = total(slots);
        }
    }

    /// Own sums and splats together.
    pub(super) fn join(&self, own: &Film, joint: &mut Film) {
        let n = self.timing.axis.slots();
        let Some(splats) = self.splats.get() else { return };
        joint.samples = own.samples;
        for (pixel, (sum, sum2)) in joint.sum.iter_mut().zip(&mut joint.sum2).enumerate() {
            let mut squares = [0.0; 3];
            let slot = |i: usize| {
                let landed = splats.sum(i);
                [0, 1, 2].map(|c| self.sum[i][c] + landed[c])
            };
            *sum = [0.0; 3];
            for i in pixel * n..(pixel + 1) * n {
                let (all, squared) = (slot(i), splats.sum_of_squares(i));
                for c in 0..3 {
                    sum[c] += all[c];
                    squares[c] += squared[c];
                }
            }
            let landed = [0, 1, 2].map(|c| sum[c] - own.sum[pixel][c]);
            let joined = crate::film::splat::join((landed, squares), (own.sum[pixel], own.sum2[pixel]), own.samples);
            *sum2 = joined.1;
        }
    }

    /// Whether any splat has landed.
    pub(super) fn has_splats(&self) -> bool {
        self.splats.get().is_some()
    }

    /// All that is known so far.
    pub(super) fn cube(&self, [width, height]: [u32; 2], samples: u64) -> TimeCube {
        let mut cube = TimeCube {
            axis: self.timing.axis,
            width,
            height,
            samples,
            sum: self.sum.clone(),
            square: self.square.clone(),
        };
        if let Some(splats) = self.splats.get() {
            for (i, (sum, square)) in cube.sum.iter_mut().zip(&mut cube.square).enumerate() {
                let (all, squared) = splats.join(i, *sum, square.map(f64::from), samples);
                (*sum, *square) = (all, squared.map(|q| q as f32));
            }
        }
        cube
    }

    /// Writes all sums; slots without light are left out.
    pub(super) fn save(&self, to: &mut dyn Write) -> io::Result<()> {
        let lit = |i: &usize| self.sum[*i] != [0.0; 3] || self.square[*i] != [0.0; 3];
        write_words(to, [self.sum.len() as u64, (0..self.sum.len()).filter(lit).count() as u64])?;
        let words = (0..self.sum.len()).filter(lit).flat_map(|i| {
            let [a, b, c] = self.square[i].map(|q| u64::from(q.to_bits()));
            let [x, y, z] = self.sum[i].map(f64::to_bits);
            [i as u64 | a << 32, x, y, z, b | c << 32]
        });
        write_words(to, words)?;
        SplatSums::save(self.splats.get(), to)
    }

    /// Takes the sums of the same axis and picture.
    pub(super) fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Misfit> {
        let lit = [from.word()?, from.word()?];
        if lit[0] != self.sum.len() as u64 {
            return Err(Misfit);
        }
        for _ in 0..lit[1] {
            let (place, sum) = (from.word()?, [from.word()?, from.word()?, from.word()?]);
            let rest = from.word()?;
            let i = (place & u64::from(u32::MAX)) as usize;
            let (Some(at), Some(square)) = (self.sum.get_mut(i), self.square.get_mut(i)) else { return Err(Misfit) };
            *at = sum.map(f64::from_bits);
            *square = [place >> 32, rest & u64::from(u32::MAX), rest >> 32].map(|q| f32::from_bits(q as u32));
        }
        let splats = SplatSums::restore(self.sum.len(), from)?;
        self.splats = splats.map_or_else(OnceLock::new, OnceLock::from);
        Ok(())
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
    pub(super) fn splat(&self, pixel: usize, c: &Contribution, mut push: impl FnMut(usize, [f32; 3]) -> bool) -> bool {
        let Timing { axis, filter, .. } = self.timing;
        let mut taken = true;
        filter.spread(axis, axis.place(c.length), |slot, share| {
            let value = if share == 1.0 { c.value } else { c.value * share as f32 };
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

    /// Takes a contribution to the sample's own pixel.
    #[inline]
    pub(super) fn own(&mut self, c: &Contribution) {
        let Timing { axis, filter, .. } = self.timing;
        let (values, touched) = (&mut self.values, &mut self.touched);
        let value = c.value.as_dvec3().to_array();
        filter.spread(axis, axis.place(c.length), |slot, share| {
            let sums = &mut values[slot];
            if *sums == [0.0; 3] {
                touched.push(slot as u32);
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
