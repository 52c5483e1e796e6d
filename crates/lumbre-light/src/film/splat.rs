//! Sums of splats, to which any thread may add in any order with identical results.
//!
//! Light paths end on pixels other than the one whose sample traced them, so threads contend for
//! pixels in a random order. [`SplatSums`] accumulates in [fixed point](super::fixed_point), so its
//! bits do not depend on that order.
//!
//! Pixels are grouped into stripes with one lock each. A thread collects its splats in a
//! [`SplatBuffer`] and flushes them by stripe, so that one lock serves many splats and the stripe
//! stays in the cache while they are added.

use std::io::{self, Write};
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::fixed_point::{PixelSums, combine_sums, is_addable};
use super::prefetch::prefetch;
use super::state::{CheckpointMismatch, StateReader, write_u64s};

/// Number of pixels of a stripe: 24 KiB of sums.
const STRIPE: usize = 256;

/// Number of splats per stripe that a [`SplatBuffer`] collects before it is full. With fewer,
/// almost every splat would pay for a lock and for cache misses on its stripe.
const SPLATS_PER_STRIPE: usize = 48;

/// Minimum and maximum capacity of a buffer in splats, for any number of stripes: 1 MiB, and 8 MiB
/// for films with a time axis.
const CAPACITY_RANGE: [usize; 2] = [1 << 16, 1 << 19];

/// Number of splats by which a pixel's sums are prefetched ahead, about the latency of memory.
const PREFETCH_DISTANCE: usize = 8;

/// Sums of splats and of their squares, `[y][x][rgb]`, which are combined with the sums of a
/// [`Film`](super::Film). A stripe without splats takes no memory.
#[derive(Debug)]
pub struct SplatSums {
    stripes: Vec<Mutex<Vec<PixelSums>>>,
    pixels: usize,
}

impl SplatSums {
    /// Creates empty sums for `pixels` pixels, 96 bytes each.
    pub fn new(pixels: usize) -> SplatSums {
        SplatSums {
            stripes: (0..pixels.div_ceil(STRIPE))
                .map(|_| Mutex::default())
                .collect(),
            pixels,
        }
    }

    /// Returns the number of stripes.
    pub fn stripes(&self) -> usize {
        self.stripes.len()
    }

    /// Allocates the memory of a stripe, so that the first splat on it does not wait for the
    /// allocation.
    pub fn reserve(&self, stripe: usize) {
        let mut stripe = self.lock_stripe(stripe);
        if stripe.capacity() < STRIPE {
            // The operating system provides pages only when they are written to.
            let landed = stripe.len();
            stripe.resize(
                STRIPE,
                PixelSums {
                    sum: [1; 3],
                    square: [1; 3],
                },
            );
            stripe.truncate(landed);
        }
    }

    /// Resets all sums; their memory stays allocated.
    pub fn clear(&mut self) {
        for stripe in &mut self.stripes {
            stripe
                .get_mut()
                .unwrap_or_else(PoisonError::into_inner)
                .clear();
        }
    }

    /// Locks a stripe. Its sums are valid even if a thread panicked while holding the lock.
    fn lock_stripe(&self, index: usize) -> MutexGuard<'_, Vec<PixelSums>> {
        self.stripes[index]
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }

    /// Locks a stripe and fills it with zeros if it is empty.
    fn lock_filled(&self, index: usize) -> MutexGuard<'_, Vec<PixelSums>> {
        let mut stripe = self.lock_stripe(index);
        if stripe.is_empty() {
            stripe.resize(
                STRIPE.min(self.pixels - index * STRIPE),
                PixelSums::default(),
            );
        }
        stripe
    }

    /// Prefetches the sums of splats on one stripe, if the stripe has any.
    fn fetch(&self, splats: &[(u32, [f32; 3])]) {
        let stripe = self.lock_stripe(splats[0].0 as usize / STRIPE);
        for (pixel, _) in splats {
            stripe
                .get(*pixel as usize % STRIPE)
                .into_iter()
                .for_each(prefetch);
        }
    }

    /// Adds a splat to a pixel, from any thread. Returns whether it was counted completely. A splat
    /// that is not finite, or is beyond [`MAX_SPLAT`](super::fixed_point::MAX_SPLAT), is not added;
    /// if its square overflows, the variance of this pixel is invalid.
    #[must_use]
    pub fn add(&self, pixel: usize, value: [f32; 3]) -> bool {
        is_addable(value) && self.lock_filled(pixel / STRIPE)[pixel % STRIPE].add(value)
    }

    fn at(&self, pixel: usize) -> PixelSums {
        self.lock_stripe(pixel / STRIPE)
            .get(pixel % STRIPE)
            .copied()
            .unwrap_or_default()
    }

    /// Calls `visit` with the index, sums and sums of squares of each pixel, in order, skipping
    /// stripes without splats.
    pub fn for_each(&self, mut visit: impl FnMut(usize, [f64; 3], [f64; 3])) {
        for i in 0..self.stripes.len() {
            for (k, sums) in self.lock_stripe(i).iter().enumerate() {
                visit(i * STRIPE + k, sums.sums(), sums.squares());
            }
        }
    }

    /// Returns the sum of a pixel.
    pub fn sum(&self, pixel: usize) -> [f64; 3] {
        self.at(pixel).sums()
    }

    /// Returns the sum of squares of a pixel.
    pub fn sum_of_squares(&self, pixel: usize) -> [f64; 3] {
        self.at(pixel).squares()
    }

    /// Writes the sums, if there are any. A stripe without splats takes one word.
    ///
    /// # Errors
    /// Returns any error of the writer.
    pub fn save(splats: Option<&SplatSums>, to: &mut dyn Write) -> io::Result<()> {
        let Some(splats) = splats else {
            return write_u64s(to, [0]);
        };
        write_u64s(to, [splats.pixels as u64])?;
        (0..splats.stripes.len()).try_for_each(|i| {
            let stripe = splats.lock_stripe(i);
            write_u64s(
                to,
                [stripe.len() as u64]
                    .into_iter()
                    .chain(stripe.iter().flat_map(PixelSums::words)),
            )
        })
    }

    /// Reads sums of `pixels` pixels that [`SplatSums::save`] wrote, `None` if there were none.
    ///
    /// # Errors
    /// Returns [`CheckpointMismatch`] if they are of another number of pixels or incomplete.
    pub fn restore(
        pixels: usize,
        from: &mut StateReader<'_>,
    ) -> Result<Option<SplatSums>, CheckpointMismatch> {
        match from.read_u64()? {
            0 => Ok(None),
            saved if saved == pixels as u64 => {
                let splats = SplatSums::new(pixels);
                for i in 0..splats.stripes.len() {
                    match from.read_u64()? {
                        0 => {}
                        n => {
                            let mut stripe = splats.lock_filled(i);
                            if n != stripe.len() as u64 {
                                return Err(CheckpointMismatch);
                            }
                            for sums in stripe.iter_mut() {
                                *sums = PixelSums::read(from)?;
                            }
                        }
                    }
                }
                Ok(Some(splats))
            }
            _ => Err(CheckpointMismatch),
        }
    }

    /// Returns sum and sum of squares of a pixel for samples and splats together, given those of
    /// its own `samples` samples; see [`Film`](super::Film).
    pub fn combined(
        &self,
        pixel: usize,
        own: [f64; 3],
        own2: [f64; 3],
        samples: u64,
    ) -> ([f64; 3], [f64; 3]) {
        combine_sums(
            (self.sum(pixel), self.sum_of_squares(pixel)),
            (own, own2),
            samples,
        )
    }
}

/// Splats of one thread, collected before they are added to [`SplatSums`].
#[derive(Debug)]
pub struct SplatBuffer {
    /// Number of splats at which the buffer is full.
    capacity: usize,
    splats: Vec<(u32, [f32; 3])>,
    /// Splats sorted by stripe during a flush, and the index at which each stripe begins.
    sorted: Vec<(u32, [f32; 3])>,
    starts: Vec<u32>,
    locks: u64,
}

impl SplatBuffer {
    /// Creates a buffer for sums of `pixels` pixels.
    pub fn new(pixels: usize) -> SplatBuffer {
        let capacity = (pixels.div_ceil(STRIPE) * SPLATS_PER_STRIPE)
            .clamp(CAPACITY_RANGE[0], CAPACITY_RANGE[1]);
        SplatBuffer {
            capacity,
            splats: Vec::new(),
            sorted: Vec::new(),
            starts: Vec::new(),
            locks: 0,
        }
    }

    /// Returns whether its capacity is the one that [`new`](Self::new) chooses for `pixels` pixels.
    pub fn serves(&self, pixels: usize) -> bool {
        self.capacity == SplatBuffer::new(pixels).capacity
    }

    /// Collects a splat for a pixel, whose index must be below 2^32. Returns whether it can be
    /// added, as [`SplatSums::add`] does.
    #[inline]
    #[must_use]
    pub fn push(&mut self, pixel: usize, value: [f32; 3]) -> bool {
        let is_addable = is_addable(value);
        if is_addable {
            self.splats.push((pixel as u32, value));
        }
        is_addable
    }

    /// Returns the number of locks taken by flushes since the last call.
    pub fn take_locks(&mut self) -> u64 {
        std::mem::take(&mut self.locks)
    }

    /// Returns whether the buffer is empty.
    pub fn is_empty(&self) -> bool {
        self.splats.is_empty()
    }

    /// Returns whether the buffer should be [flushed](Self::flush).
    #[inline]
    pub fn is_full(&self) -> bool {
        self.splats.len() >= self.capacity
    }

    /// Adds all collected splats to `sums`. Returns the number of splats whose squares overflowed.
    #[must_use]
    pub fn flush(&mut self, sums: &SplatSums) -> u64 {
        // Counting sort: two passes for any number of stripes.
        self.starts.clear();
        self.starts.resize(sums.stripes.len() + 1, 0);
        for (pixel, _) in &self.splats {
            self.starts[*pixel as usize / STRIPE + 1] += 1;
        }
        for i in 1..self.starts.len() {
            self.starts[i] += self.starts[i - 1];
        }
        self.sorted.resize(self.splats.len(), Default::default());
        for splat in self.splats.drain(..) {
            let next = &mut self.starts[splat.0 as usize / STRIPE];
            self.sorted[*next as usize] = splat;
            *next += 1;
        }
        let mut overflowed = 0;
        let mut groups = self
            .sorted
            .chunk_by(|a, b| a.0 as usize / STRIPE == b.0 as usize / STRIPE)
            .peekable();
        while let Some(group) = groups.next() {
            let at = group[0].0 as usize / STRIPE;
            // With many stripes, their locks are not in the cache either.
            if let Some(soon) = sums.stripes.get(at + 2) {
                prefetch(soon);
            }
            // With few splats per stripe, as in films with a time axis, the first splats of the
            // next stripe are needed soon.
            if let Some(next) = groups
                .peek()
                .filter(|next| next.len() <= 2 * SPLATS_PER_STRIPE)
            {
                sums.fetch(&next[..next.len().min(2 * PREFETCH_DISTANCE)]);
                self.locks += 1;
            }
            let mut stripe = sums.lock_filled(at);
            self.locks += 1;
            for (i, (pixel, value)) in group.iter().enumerate() {
                if let Some((later, _)) = group.get(i + PREFETCH_DISTANCE) {
                    prefetch(&stripe[*later as usize % STRIPE]);
                }
                overflowed += u64::from(!stripe[*pixel as usize % STRIPE].add(*value));
            }
        }
        overflowed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::fixed_point::MAX_SPLAT;
    use crate::film::fixed_point::tests::word;

    #[test]
    fn carries_and_signs_survive_any_order() {
        let values = [
            1.5f32, -3.25e9, 7e-9, MAX_SPLAT, -MAX_SPLAT, 300.0, -299.0, 1e-12, 3.25e9,
        ];
        let forwards = SplatSums::new(2);
        let backwards = SplatSums::new(2);
        for v in values {
            assert!(forwards.add(1, [v, -v, 0.0]));
        }
        for v in values.into_iter().rev() {
            assert!(backwards.add(1, [v, -v, 0.0]));
        }
        assert_eq!(forwards.sum(1), backwards.sum(1));
        let [sum, negative, zero] = forwards.sum(1);
        assert!((sum - 2.500_000_007_001).abs() < 1e-12, "{sum}");
        assert_eq!((sum, zero), (-negative, 0.0));
        assert_eq!(forwards.sum(0), [0.0; 3]);
    }

    #[test]
    fn reserving_memory_changes_no_sum() {
        // The last stripe is shorter than the others.
        let splats = SplatSums::new(STRIPE + 3);
        for pixel in [0, STRIPE - 1, STRIPE, STRIPE + 2] {
            assert!(splats.add(pixel, [pixel as f32 + 1.0; 3]));
        }
        (0..splats.stripes()).for_each(|stripe| splats.reserve(stripe));
        for pixel in [0, STRIPE - 1, STRIPE, STRIPE + 2] {
            assert_eq!(splats.sum(pixel), [pixel as f64 + 1.0; 3]);
        }
        assert_eq!(
            (splats.sum(1), splats.sum(STRIPE + 1)),
            ([0.0; 3], [0.0; 3])
        );
    }

    #[test]
    fn a_splat_with_an_invalid_channel_is_refused_completely() {
        let splats = SplatSums::new(1);
        let mut buffer = SplatBuffer::new(1);
        for bad in [f32::NAN, f32::INFINITY, -f32::INFINITY, 2.0 * MAX_SPLAT] {
            assert!(!splats.add(0, [1.0, bad, 1.0]));
            assert!(!buffer.push(0, [1.0, bad, 1.0]));
        }
        assert_eq!(buffer.flush(&splats), 0);
        assert_eq!(splats.sum(0), [0.0; 3]);
    }

    #[test]
    fn concurrent_threads_lose_nothing_with_and_without_a_buffer() {
        // Three stripes and a bit, so that buffers are sorted and flushed in several parts.
        let pixels = 3 * STRIPE + 7;
        let splat = |t: u32, i: u32| {
            let v = 200.0 + (i % 7 + t) as f32;
            (
                word(t << 16 | i) as usize % pixels,
                [v, -v, if i.is_multiple_of(2) { v } else { -v }],
            )
        };
        let splats = SplatSums::new(pixels);
        std::thread::scope(|scope| {
            for t in 0..4u32 {
                let splats = &splats;
                scope.spawn(move || {
                    let mut buffer = SplatBuffer {
                        capacity: 7000,
                        ..SplatBuffer::new(pixels)
                    };
                    for i in 0..20_000u32 {
                        let (pixel, value) = splat(t, i);
                        assert!(if t == 0 {
                            splats.add(pixel, value)
                        } else {
                            buffer.push(pixel, value)
                        });
                        if buffer.is_full() {
                            assert_eq!(buffer.flush(splats), 0);
                        }
                    }
                    assert_eq!(buffer.flush(splats), 0);
                });
            }
        });
        let one_by_one = SplatSums::new(pixels);
        for t in 0..4u32 {
            for i in 0..20_000u32 {
                let (pixel, value) = splat(t, i);
                assert!(one_by_one.add(pixel, value));
            }
        }
        for pixel in 0..pixels {
            assert_eq!(splats.at(pixel), one_by_one.at(pixel));
        }
        assert!((0..pixels).map(|p| splats.sum(p)[0]).sum::<f64>() > 1.6e7);
    }

    #[test]
    fn the_capacity_grows_with_the_stripes_within_limits() {
        let capacity = |stripes: usize| SplatBuffer::new(stripes * STRIPE).capacity;
        assert_eq!(
            [1, 100, 2000, 1 << 20].map(capacity),
            [
                CAPACITY_RANGE[0],
                CAPACITY_RANGE[0],
                2000 * SPLATS_PER_STRIPE,
                CAPACITY_RANGE[1]
            ]
        );
        assert!(
            SplatBuffer::new(STRIPE).serves(2 * STRIPE)
                && !SplatBuffer::new(STRIPE).serves(2000 * STRIPE)
        );
        let mut buffer = SplatBuffer {
            capacity: 2,
            ..SplatBuffer::new(1)
        };
        let full = [0; 2].map(|_| buffer.push(0, [1.0; 3]) && buffer.is_full());
        assert_eq!(full, [false, true]);
    }

    #[test]
    fn a_flush_counts_overflowed_squares() {
        let splats = SplatSums::new(1);
        splats.lock_filled(0)[0].square = [u128::MAX; 3];
        let mut buffer = SplatBuffer::new(1);
        assert!(buffer.push(0, [1.0; 3]) && buffer.push(0, [0.0; 3]));
        assert_eq!(buffer.flush(&splats), 1);
        assert!(!splats.add(0, [f32::NAN; 3]));
    }
}
