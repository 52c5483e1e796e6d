//! The sums of a row of pixels, and how what samples bring gets there.

use std::sync::OnceLock;

use glam::Vec3;

use super::bins;
use super::brought::{Named, Parts};
use super::times::{Gathering, Landing};
use crate::film::splat::{SplatBuffer, SplatSums};

/// Slots that are fetched before the first of them is added to: films are larger than caches.
const AHEAD: usize = 48;

/// What the rows of a wave report, merged without order.
#[derive(Clone, Copy, Default)]
pub(super) struct RowStats {
    /// Rays that were traced.
    pub rays: u64,
    /// Contributions that were refused.
    pub invalid: u64,
    /// Sample, row, column: the order in which "first" is meant.
    pub first_invalid: Option<[u64; 3]>,
}

impl RowStats {
    /// Those of both.
    pub fn merge(self, other: RowStats) -> RowStats {
        RowStats {
            rays: self.rays + other.rays,
            invalid: self.invalid + other.invalid,
            first_invalid: [self.first_invalid, other.first_invalid].into_iter().flatten().min(),
        }
    }
}

/// Where light goes that samples bring to other pixels than their own.
#[derive(Clone, Copy)]
pub(super) struct Splats<'a> {
    /// Width and height of the picture.
    pub resolution: [u32; 2],
    /// Sums without a time axis, made when there is a use for them.
    pub plain: &'a OnceLock<SplatSums>,
    /// Where there is one.
    pub landing: Option<Landing<'a>>,
}

impl<'a> Splats<'a> {
    /// The sums.
    pub fn sums(&self) -> &'a SplatSums {
        match &self.landing {
            Some(landing) => landing.sums(),
            None => self.plain.get_or_init(|| SplatSums::new(self.size())),
        }
    }

    /// A buffer for them.
    pub fn buffer(&self) -> SplatBuffer {
        bins::buffer(self.landing.map_or(self.size(), |landing| landing.size()))
    }

    /// How many pixels the picture has.
    fn size(&self) -> usize {
        let [width, height] = self.resolution.map(|n| n as usize);
        width * height
    }

    /// The index of a pixel, if the picture has it.
    pub fn place(&self, [x, y]: [u32; 2]) -> Option<usize> {
        let [width, height] = self.resolution;
        (x < width && y < height).then(|| y as usize * width as usize + x as usize)
    }
}

/// A row of pixels while its samples are taken, by one thread in the order of their index.
pub(super) struct RowSums<'a> {
    y: u32,
    sum: &'a mut [[f64; 3]],
    sum2: &'a mut [[f64; 3]],
    by_time: Option<Gathering<'a>>,
    splats: Splats<'a>,
    buffer: SplatBuffer,
    stats: RowStats,
}

impl<'a> RowSums<'a> {
    /// Row `y`, whose splats gather in `buffer` on their way.
    pub fn new(
        y: u32,
        [sum, sum2]: [&'a mut [[f64; 3]]; 2],
        by_time: Option<Gathering<'a>>,
        splats: Splats<'a>,
        buffer: SplatBuffer,
    ) -> RowSums<'a> {
        RowSums { y, sum, sum2, by_time, splats, buffer, stats: RowStats::default() }
    }

    /// Takes what the path of a sample in column `x` brings to its own pixel, and the optical length of it all.
    #[inline]
    pub fn part(&mut self, x: u32, value: Vec3, length: f64) {
        if let Some(by_time) = &mut self.by_time {
            by_time.own(x, value, length);
        }
    }

    /// Takes what a path brings to another pixel. Returns `None` if it was refused, which light of no value never is, and else
    /// the pixel's index, if the picture has it.
    #[inline]
    pub fn splat(&mut self, pixel: [u32; 2], value: Vec3, length: f64) -> Option<Option<usize>> {
        let place = self.splats.place(pixel);
        if value == Vec3::ZERO {
            return Some(place);
        }
        let at = place?;
        let buffer = &mut self.buffer;
        let taken = match &self.splats.landing {
            Some(landing) => landing.splat(at, (value, length), |i, v| buffer.push(i, v)),
            None => buffer.push(at, value.to_array()),
        };
        taken.then_some(place)
    }

    /// Adds what a sample has brought to its own pixel to the picture's sums, of which a time axis leaves only squares, if that
    /// is a number; whether it is.
    #[inline]
    pub fn add(&mut self, x: u32, value: Vec3) -> bool {
        let finite = value.is_finite();
        if finite {
            let value = value.as_dvec3().to_array();
            // With a time axis the picture is the sum of its slots.
            if self.by_time.is_none() {
                (0..3).for_each(|c| self.sum[x as usize][c] += value[c]);
            }
            (0..3).for_each(|c| self.sum2[x as usize][c] += value[c] * value[c]);
        }
        finite
    }

    /// Ends a sample whose [parts](Self::part) were taken, if the picture took it. Returns whether there was room for them.
    #[inline]
    pub fn close(&mut self, x: u32, counts: bool) -> bool {
        self.by_time.as_mut().is_none_or(|by_time| by_time.close(x, counts))
    }

    /// Hands its splats over if they have become many. Says that so many contributions of a sample were refused, and so many
    /// splats as found no room now.
    #[inline]
    pub fn refused(&mut self, x: u32, sample: u64, mut invalid: u64) {
        if self.buffer.is_full() {
            invalid += self.buffer.flush(self.splats.sums());
        }
        if invalid > 0 {
            let first_invalid = Some([sample, u64::from(self.y), u64::from(x)]);
            self.stats = self.stats.merge(RowStats { rays: 0, invalid, first_invalid });
        }
    }

    /// What it reports, when it has traced so many rays, and the buffer.
    pub fn end(self, rays: u64) -> (RowStats, SplatBuffer) {
        (RowStats { rays, ..self.stats }, self.buffer)
    }
}

/// Samples that go together.
#[cfg_attr(not(target_arch = "x86_64"), expect(dead_code, reason = "paths go alone"))]
impl RowSums<'_> {
    /// Takes what a sample brings to the pixel with this column and row, and the optical length of the path.
    #[inline]
    pub fn elsewhere(&mut self, (x, sample): Named, pixel: [u32; 2], value: Vec3, length: f64) {
        let invalid = self.splat(pixel, value, length).is_none();
        self.refused(x, sample, u64::from(invalid));
    }

    /// Takes all that samples bring to their own pixels, and, where there is a time axis, what that is made of. All they
    /// bring to others comes before.
    pub fn own(&mut self, named: &[Named], values: &[Vec3], parts: Option<&mut Parts>) {
        let mut refused: Vec<u32> = Vec::new();
        for (path, ((x, _), value)) in named.iter().zip(values).enumerate() {
            if !self.add(*x, *value) {
                refused.push(path as u32);
            }
        }
        if let (Some(by_time), Some(parts)) = (&mut self.by_time, parts) {
            refused.iter().for_each(|path| parts.refuse(*path));
            let column = |path: u32| named[path as usize].0;
            by_time.add::<AHEAD>(named.len() as u32, column, parts.sorted(), |path| {
                if refused.last() != Some(&path) {
                    refused.push(path);
                }
            });
        }
        for (x, sample) in refused.into_iter().map(|path| named[path as usize]) {
            self.refused(x, sample, 1);
        }
    }
}
