//! Sums to which any thread may add in any order, and whose bits do not depend on it.
//!
//! Light paths end on pixels other than the one whose sample traced them, so threads meet on the same pixel and their
//! order is chance. Sums of floats would show that chance in their last bits; here every value becomes a whole number
//! of fixed size first, and whole numbers add up the same in any order.

use std::io::{self, Write};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use super::state::{Misfit, Saved, write_words};

/// The greatest absolute value of one splat: 2^32. Greater ones are refused, like infinite ones.
pub const MAX_SPLAT: f32 = 4_294_967_296.0;

/// One unit of a sum is 2^-64: steps of 5.4e-20, and room for 2^31 splats of the greatest value on one pixel.
const SUM_SCALE: f64 = (1u128 << 64) as f64;

/// One unit of a sum of squares is 2^-44, with room for 2^20 squares of the greatest splat. Squares below 5.7e-14, of
/// splats below 2.4e-7, count as nothing in the sum of squares; the sum itself keeps them.
const SQUARE_SCALE: f64 = (1u64 << 44) as f64;

/// A 128-bit number to which threads add without a lock: the carry of the low word is added to the high one. Only the
/// total after all have finished is meaningful.
#[derive(Debug, Default)]
struct Wide {
    low: AtomicU64,
    high: AtomicU64,
}

impl Wide {
    /// Adds `x` modulo 2^128, and returns whether that went past the end.
    fn add(&self, x: u128) -> bool {
        let low = x as u64;
        let old = self.low.fetch_add(low, Relaxed);
        let high = ((x >> 64) as u64).wrapping_add(u64::from(old.checked_add(low).is_none()));
        high != 0 && self.high.fetch_add(high, Relaxed).checked_add(high).is_none()
    }

    fn of(words: [u64; 2]) -> Wide {
        Wide { low: words[0].into(), high: words[1].into() }
    }

    fn words(&self) -> [u64; 2] {
        [self.low.load(Relaxed), self.high.load(Relaxed)]
    }

    fn get(&self) -> u128 {
        u128::from(self.high.load(Relaxed)) << 64 | u128::from(self.low.load(Relaxed))
    }
}

/// Sums of splats, `[y][x][rgb]`.
#[derive(Debug)]
pub struct Splats {
    sums: Vec<[Wide; 3]>,
}

impl Splats {
    /// Sums of nothing for so many pixels, 48 bytes each.
    pub fn new(pixels: usize) -> Splats {
        Splats { sums: std::iter::repeat_with(Default::default).take(pixels).collect() }
    }

    /// Adds a splat to a pixel, from any thread. Returns whether it was taken: not finite, or beyond [`MAX_SPLAT`], it
    /// is not.
    #[must_use]
    pub fn add(&self, pixel: usize, value: [f32; 3]) -> bool {
        let fits = value.iter().all(|v| v.abs() <= MAX_SPLAT);
        if fits {
            for (sum, v) in self.sums[pixel].iter().zip(value) {
                // Exact but for what lies below one unit, which is cut off.
                // Going past the end is how a negative number is added.
                sum.add((f64::from(v) * SUM_SCALE) as i128 as u128);
            }
        }
        fits
    }

    /// Adds the squares of a splat that [`Splats::add`] took, to sums that hold squares alone. Returns whether there was
    /// room: if not, the variance of this pixel is worthless.
    #[must_use]
    pub fn add_square(&self, pixel: usize, value: [f32; 3]) -> bool {
        let mut room = true;
        for (sum, v) in self.sums[pixel].iter().zip(value) {
            let v = f64::from(v);
            room &= !sum.add((v * v * SQUARE_SCALE) as u128);
        }
        room
    }

    fn save(&self, to: &mut dyn Write) -> io::Result<()> {
        write_words(to, self.sums.iter().flatten().flat_map(Wide::words))
    }

    fn restore(pixels: usize, from: &mut Saved<'_>) -> Result<Splats, Misfit> {
        let mut splats = Splats::new(pixels);
        for sum in splats.sums.iter_mut().flatten() {
            *sum = Wide::of([from.word()?, from.word()?]);
        }
        Ok(splats)
    }

    /// The sum of a pixel.
    pub fn sum(&self, pixel: usize) -> [f64; 3] {
        [0, 1, 2].map(|c| self.sums[pixel][c].get() as i128 as f64 / SUM_SCALE)
    }

    /// The sum of squares of a pixel.
    pub fn sum_of_squares(&self, pixel: usize) -> [f64; 3] {
        [0, 1, 2].map(|c| self.sums[pixel][c].get() as f64 / SQUARE_SCALE)
    }
}

/// Splats and their squares: what joins the sums of a [`Film`](super::Film).
#[derive(Debug)]
pub struct SplatSums {
    sum: Splats,
    sum2: Splats,
}

impl SplatSums {
    /// Sums of nothing for so many pixels, 96 bytes each.
    pub fn new(pixels: usize) -> SplatSums {
        SplatSums { sum: Splats::new(pixels), sum2: Splats::new(pixels) }
    }

    /// Adds a splat to a pixel, from any thread. Returns whether it can be counted, and is.
    #[must_use]
    pub fn add(&self, pixel: usize, value: [f32; 3]) -> bool {
        self.sum.add(pixel, value) && self.sum2.add_square(pixel, value)
    }

    /// Writes the sums, if there are any.
    ///
    /// # Errors
    /// As `to`.
    pub fn save(splats: Option<&SplatSums>, to: &mut dyn Write) -> io::Result<()> {
        write_words(to, [splats.map_or(0, |s| s.sum.sums.len() as u64)])?;
        let Some(SplatSums { sum, sum2 }) = splats else { return Ok(()) };
        sum.save(to)?;
        sum2.save(to)
    }

    /// The sums that were written, if there were any, of so many pixels.
    ///
    /// # Errors
    /// When they are of another number of pixels.
    pub fn restore(pixels: usize, from: &mut Saved<'_>) -> Result<Option<SplatSums>, Misfit> {
        match from.word()? {
            0 => Ok(None),
            saved if saved == pixels as u64 => {
                Ok(Some(SplatSums { sum: Splats::restore(pixels, from)?, sum2: Splats::restore(pixels, from)? }))
            }
            _ => Err(Misfit),
        }
    }

    /// The sums of a pixel and its sums of squares, of samples and splats together, given those of the `samples`
    /// samples: see [`Film`](super::Film).
    pub fn join(&self, pixel: usize, own: [f64; 3], own2: [f64; 3], samples: u64) -> ([f64; 3], [f64; 3]) {
        let n = samples.max(1) as f64;
        let (landed, squares) = (self.sum.sum(pixel), self.sum2.sum_of_squares(pixel));
        let sum = [0, 1, 2].map(|c| own[c] + landed[c]);
        let sum2 = [0, 1, 2].map(|c| own2[c] + squares[c] * (n - 1.0) / n + (sum[c] * sum[c] - own[c] * own[c]) / n);
        (sum, sum2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn carries_and_signs_survive_any_order() {
        let values = [1.5f32, -3.25e9, 7e-9, MAX_SPLAT, -MAX_SPLAT, 300.0, -299.0, 1e-12, 3.25e9];
        let forwards = Splats::new(2);
        let backwards = Splats::new(2);
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
    fn squares_of_the_greatest_splats_have_room() {
        let splats = Splats::new(1);
        let n = (1 << 20) - 1;
        for _ in 0..n {
            assert!(splats.add_square(0, [MAX_SPLAT, 3.0, -0.5]));
        }
        let square = f64::from(MAX_SPLAT) * f64::from(MAX_SPLAT);
        let n = f64::from(n);
        assert_eq!(splats.sum_of_squares(0), [n * square, n * 9.0, n * 0.25]);
        assert!(!splats.add_square(0, [MAX_SPLAT, 0.0, 0.0]), "one more goes past the end and says so");
    }

    #[test]
    fn what_does_not_fit_is_refused_whole() {
        let splats = Splats::new(1);
        for bad in [f32::NAN, f32::INFINITY, -f32::INFINITY, 2.0 * MAX_SPLAT] {
            assert!(!splats.add(0, [1.0, bad, 1.0]));
        }
        assert_eq!(splats.sum(0), [0.0; 3]);
    }

    #[test]
    fn threads_that_meet_lose_nothing() {
        let splats = Splats::new(1);
        std::thread::scope(|scope| {
            for t in 0..4u32 {
                let splats = &splats;
                scope.spawn(move || {
                    for i in 0..20_000u32 {
                        // Large enough to carry into the high word again and again, of both signs.
                        let v = 200.0 + (i % 7 + t) as f32;
                        assert!(splats.add(0, [v, -v, if i % 2 == 0 { v } else { -v }]));
                    }
                });
            }
        });
        let one_by_one = Splats::new(1);
        for t in 0..4u32 {
            for i in 0..20_000u32 {
                let v = 200.0 + (i % 7 + t) as f32;
                assert!(one_by_one.add(0, [v, -v, if i % 2 == 0 { v } else { -v }]));
            }
        }
        assert_eq!(splats.sum(0), one_by_one.sum(0));
        assert!(splats.sum(0)[0] > 1.6e7);
    }
}
