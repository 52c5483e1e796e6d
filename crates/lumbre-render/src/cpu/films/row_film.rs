//! Accumulates the samples of one row of pixels. One thread owns a row while it is rendered; only
//! splats leave it, through a buffer.

use std::sync::OnceLock;

use glam::Vec3;

use super::bin_pool;
use super::contributions::{SampleId, TimedContributions};
use super::layers::LayerRowFilm;
use super::time_film::{TimeRowFilm, TimedSplats};
use lumbre_light::film::splat::{SplatBuffer, SplatSums};
use lumbre_light::transport::contribution::Contribution;

/// Number of contributions by which the slots of a time axis are prefetched before they are
/// updated. Such films are larger than caches.
const PREFETCH_DISTANCE: usize = 48;

/// Statistics of a row, merged over all rows of a wave.
#[derive(Clone, Copy, Default)]
pub(crate) struct RowStats {
    /// Number of rays traced.
    pub rays: u64,
    /// Number of samples and contributions that were rejected.
    pub invalid: u64,
    /// Sample index, row and column of the first rejection, ordered by these three.
    pub first_invalid: Option<[u64; 3]>,
}

impl RowStats {
    /// Merges the statistics of two rows.
    pub fn merge(self, other: RowStats) -> RowStats {
        RowStats {
            rays: self.rays + other.rays,
            invalid: self.invalid + other.invalid,
            first_invalid: [self.first_invalid, other.first_invalid]
                .into_iter()
                .flatten()
                .min(),
        }
    }
}

/// Destination of splats, the contributions of samples to pixels other than their own.
#[derive(Clone, Copy)]
pub(crate) struct SplatTarget<'a> {
    /// Width and height of the picture in pixels.
    pub resolution: [u32; 2],
    /// Splat sums of a film without a time axis, allocated for the first splat.
    pub plain: &'a OnceLock<SplatSums>,
    /// Slots that splats are added to, if the film has a time axis.
    pub timed: Option<TimedSplats<'a>>,
}

impl<'a> SplatTarget<'a> {
    /// Returns the splat sums, allocating them if needed.
    pub fn sums(&self) -> &'a SplatSums {
        match &self.timed {
            Some(timed) => timed.sums(),
            None => self.plain.get_or_init(|| SplatSums::new(self.pixels())),
        }
    }

    /// Returns an empty buffer for splats.
    pub fn buffer(&self) -> SplatBuffer {
        bin_pool::take_buffer(self.timed.map_or(self.pixels(), |timed| timed.slots()))
    }

    /// Returns the number of pixels of the picture.
    fn pixels(&self) -> usize {
        let [width, height] = self.resolution.map(|n| n as usize);
        width * height
    }

    /// Returns the index of a pixel, or `None` if it is outside the picture.
    pub fn pixel_index(&self, [x, y]: [u32; 2]) -> Option<usize> {
        let [width, height] = self.resolution;
        (x < width && y < height).then(|| y as usize * width as usize + x as usize)
    }
}

/// Accumulates the samples of one row of pixels, which one thread adds in the order of their index.
pub(crate) struct RowFilm<'a> {
    y: u32,
    sum: &'a mut [[f64; 3]],
    sum2: &'a mut [[f64; 3]],
    time_film: Option<TimeRowFilm<'a>>,
    splats: SplatTarget<'a>,
    buffer: SplatBuffer,
    stats: RowStats,
}

impl<'a> RowFilm<'a> {
    /// Creates the accumulator of row `y`; splats are collected in `buffer`.
    pub fn new(
        y: u32,
        [sum, sum2]: [&'a mut [[f64; 3]]; 2],
        time_film: Option<TimeRowFilm<'a>>,
        splats: SplatTarget<'a>,
        buffer: SplatBuffer,
    ) -> RowFilm<'a> {
        RowFilm {
            y,
            sum,
            sum2,
            time_film,
            splats,
            buffer,
            stats: RowStats::default(),
        }
    }

    /// Adds a contribution of a sample in column `x` to the time bins of its own pixel; `length` is
    /// the optical length of the path. Does nothing without a time axis.
    #[inline]
    pub fn add_timed(&mut self, x: u32, value: Vec3, length: f64) {
        if let Some(time_film) = &mut self.time_film {
            time_film.add_timed(x, value, length);
        }
    }

    /// Adds a splat to a pixel. Returns `None` if it was rejected, and otherwise the pixel's index,
    /// which is `None` outside the picture. Zero radiance is never rejected; other radiance is
    /// rejected outside the picture.
    #[inline]
    pub fn splat(&mut self, pixel: [u32; 2], value: Vec3, length: f64) -> Option<Option<usize>> {
        let index = self.splats.pixel_index(pixel);
        if value == Vec3::ZERO {
            return Some(index);
        }
        let at = index?;
        let buffer = &mut self.buffer;
        let accepted = match &self.splats.timed {
            Some(timed) => timed.splat(at, (value, length), |i, v| buffer.push(i, v)),
            None => buffer.push(at, value.to_array()),
        };
        accepted.then_some(index)
    }

    /// Adds the radiance of a sample to its own pixel if it is finite, and returns whether it is.
    /// With a time axis only the squares are added here, since the picture is the sum of its slots.
    #[inline]
    pub fn add_sample(&mut self, x: u32, value: Vec3) -> bool {
        let finite = value.is_finite();
        if finite {
            let value = value.as_dvec3().to_array();
            if self.time_film.is_none() {
                (0..3).for_each(|c| self.sum[x as usize][c] += value[c]);
            }
            (0..3).for_each(|c| self.sum2[x as usize][c] += value[c] * value[c]);
        }
        finite
    }

    /// Ends a sample whose contributions were passed to [`add_timed`](Self::add_timed); `accepted`
    /// is whether the picture accepted it. Returns whether the sums of squares stayed finite.
    #[inline]
    pub fn finish_sample(&mut self, x: u32, accepted: bool) -> bool {
        self.time_film
            .as_mut()
            .is_none_or(|time_film| time_film.finish_sample(x, accepted))
    }

    /// Counts `invalid` rejected contributions of a sample. Also flushes the splat buffer if it is
    /// full, and counts the splats whose squares overflowed.
    #[inline]
    pub fn record_invalid(&mut self, x: u32, sample: u64, mut invalid: u64) {
        if self.buffer.is_full() {
            invalid += self.buffer.flush(self.splats.sums());
        }
        if invalid > 0 {
            let first_invalid = Some([sample, u64::from(self.y), u64::from(x)]);
            self.stats = self.stats.merge(RowStats {
                rays: 0,
                invalid,
                first_invalid,
            });
        }
    }

    /// Ends the row after `rays` rays. Returns its statistics and the splat buffer.
    pub fn finish(self, rays: u64) -> (RowStats, SplatBuffer) {
        (RowStats { rays, ..self.stats }, self.buffer)
    }
}

/// Batches of vectorised samples.
impl RowFilm<'_> {
    /// Adds a splat of the sample `id` to the picture and to the layers that need it.
    #[inline]
    pub fn splat_from_sample(
        &mut self,
        (x, sample): SampleId,
        c: &Contribution,
        layers: Option<&LayerRowFilm>,
    ) {
        let invalid = match self.splat(c.pixel, c.value, c.length) {
            None => 1,
            Some(Some(pixel)) => layers.map_or(0, |layers| layers.splat(pixel, c)),
            Some(None) => 0,
        };
        self.record_invalid(x, sample, invalid);
    }

    /// Adds a batch of samples to their own pixels: their radiance `values` and, with a time axis,
    /// the contributions `timed` that it is the sum of. Their splats must have been added before.
    pub fn add_batch(
        &mut self,
        ids: &[SampleId],
        values: &[Vec3],
        timed: Option<&mut TimedContributions>,
    ) {
        let mut rejected: Vec<u32> = Vec::new();
        for (path, ((x, _), value)) in ids.iter().zip(values).enumerate() {
            if !self.add_sample(*x, *value) {
                rejected.push(path as u32);
            }
        }
        if let (Some(time_film), Some(timed)) = (&mut self.time_film, timed) {
            rejected.iter().for_each(|path| timed.discard(*path));
            let column = |path: u32| ids[path as usize].0;
            time_film.add_batch::<PREFETCH_DISTANCE>(
                ids.len() as u32,
                column,
                timed.sorted(),
                |path| {
                    if rejected.last() != Some(&path) {
                        rejected.push(path);
                    }
                },
            );
        }
        for (x, sample) in rejected.into_iter().map(|path| ids[path as usize]) {
            self.record_invalid(x, sample, 1);
        }
    }
}
