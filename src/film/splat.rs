//! Sums to which any thread may add in any order, and whose bits do not depend on it.
//!
//! Light paths end on pixels other than the one whose sample traced them, so threads meet on the same pixel and their
//! order is chance. Sums of floats would show that chance in their last bits; here every value becomes a whole number
//! of fixed size first, and whole numbers add up the same in any order.
//!
//! Pixels lie in stripes with a lock each. A thread gathers its splats in a [`SplatBuffer`] and hands them over by
//! stripe, so that a lock is taken once for many splats, and a stripe is in the cache while they are added.

use std::io::{self, Write};
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::prefetch::prefetch;
use super::state::{Misfit, Saved, write_words};

/// The greatest absolute value of one splat: 2^32. Greater ones are refused, like infinite ones.
pub const MAX_SPLAT: f32 = 4_294_967_296.0;

/// One unit of a sum is 2^-64: steps of 5.4e-20, and room for 2^31 splats of the greatest value on one pixel.
const SUM_BITS: i32 = 64;

/// One unit of a sum of squares is 2^-44, with room for 2^20 squares of the greatest splat. Squares below 5.7e-14, of
/// splats below 2.4e-7, count as nothing in the sum of squares; the sum itself keeps them.
const SQUARE_BITS: i32 = 44;

/// Pixels of a stripe: 24 KiB of sums.
const STRIPE: usize = 256;

/// Splats that a [`SplatBuffer`] holds for each stripe before it asks to be emptied: where they are few, a lock and what it
/// takes to find a stripe's memory are paid for almost every one of them.
const BUFFERED: usize = 48;

/// Fewest and most splats that it holds, whatever stripes there are: 1 MiB, and 8 MiB for films with a time axis.
const HELD: [usize; 2] = [1 << 16, 1 << 19];

/// So many splats before it is needed, a pixel's sums are fetched: about as long as memory takes.
const AHEAD: usize = 8;

/// Mantissa and exponent of a finite number's absolute value: `m 2^e`.
#[inline]
fn parts(v: f32) -> (u64, i32) {
    let bits = v.to_bits();
    let exponent = (bits >> 23 & 0xff) as i32;
    let fraction = u64::from(bits & 0x7f_ffff);
    if exponent == 0 { (fraction, -149) } else { (fraction | 1 << 23, exponent - 150) }
}

/// `m 2^e` without what is below one.
#[inline]
fn whole(m: u64, e: i32) -> u128 {
    if e >= 0 {
        u128::from(m) << e
    } else if e > -64 {
        u128::from(m >> -e)
    } else {
        0
    }
}

/// A pixel's sums.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Wide {
    /// Sums in units of `2^-SUM_BITS`.
    sum: [i128; 3],
    /// Sums of squares in units of `2^-SQUARE_BITS`.
    square: [u128; 3],
}

impl Wide {
    /// Adds a splat, exactly but for what lies below one unit, which is cut off. Returns whether there was room for its
    /// squares.
    #[inline]
    fn add(&mut self, value: [f32; 3]) -> bool {
        let mut room = true;
        for ((v, sum), square) in value.into_iter().zip(&mut self.sum).zip(&mut self.square) {
            let (m, e) = parts(v);
            let step = whole(m, e + SUM_BITS) as i128;
            *sum = sum.wrapping_add(if v < 0.0 { -step } else { step });
            let over;
            (*square, over) = square.overflowing_add(whole(m * m, 2 * e + SQUARE_BITS));
            room &= !over;
        }
        room
    }

    /// The sums in units, then those of squares, each as two words, the low one first.
    fn words(&self) -> impl Iterator<Item = u64> {
        let sums = self.sum.map(|s| s as u128).into_iter().chain(self.square);
        sums.flat_map(|n| [n as u64, (n >> 64) as u64])
    }

    fn of_words(from: &mut Saved<'_>) -> Result<Wide, Misfit> {
        let mut next = || Ok(u128::from(from.word()?) | u128::from(from.word()?) << 64);
        let mut three = || Ok([next()?, next()?, next()?]);
        Ok(Wide { sum: three()?.map(|n| n as i128), square: three()? })
    }

    fn sums(&self) -> [f64; 3] {
        self.sum.map(sum_of)
    }

    fn squares(&self) -> [f64; 3] {
        self.square.map(squares_of)
    }
}

fn sum_of(units: i128) -> f64 {
    units as f64 / (1u128 << SUM_BITS) as f64
}

fn squares_of(units: u128) -> f64 {
    units as f64 / (1u64 << SQUARE_BITS) as f64
}

/// The sums and sums of squares of a pixel from those of its splats and those of its own `samples` samples: see
/// [`Film`](super::Film).
pub fn join(
    (landed, squares): ([f64; 3], [f64; 3]),
    (own, own2): ([f64; 3], [f64; 3]),
    samples: u64,
) -> ([f64; 3], [f64; 3]) {
    let n = samples.max(1) as f64;
    let sum = [0, 1, 2].map(|c| own[c] + landed[c]);
    let sum2 = [0, 1, 2].map(|c| own2[c] + squares[c] * (n - 1.0) / n + (sum[c] * sum[c] - own[c] * own[c]) / n);
    (sum, sum2)
}

/// The number that a 128-bit sum of splats stands for, low word first.
pub fn sum_of_words(words: [u32; 4]) -> f64 {
    sum_of(wide(words) as i128)
}

/// The number that a 128-bit sum of squares of splats stands for, low word first.
pub fn squares_of_words(words: [u32; 4]) -> f64 {
    squares_of(wide(words))
}

fn wide(words: [u32; 4]) -> u128 {
    words.into_iter().rev().fold(0, |sum, word| sum << 32 | u128::from(word))
}

/// Whether a splat can be added: all of it finite, and none beyond [`MAX_SPLAT`].
#[inline]
fn fits(value: [f32; 3]) -> bool {
    value.iter().all(|v| v.abs() <= MAX_SPLAT)
}

/// Splats and their squares, `[y][x][rgb]`: what joins the sums of a [`Film`](super::Film). A stripe on which nothing has
/// landed takes no memory.
#[derive(Debug)]
pub struct SplatSums {
    stripes: Vec<Mutex<Vec<Wide>>>,
    pixels: usize,
}

impl SplatSums {
    /// Sums of nothing for so many pixels, 96 bytes each.
    pub fn new(pixels: usize) -> SplatSums {
        SplatSums { stripes: (0..pixels.div_ceil(STRIPE)).map(|_| Mutex::default()).collect(), pixels }
    }

    /// How many stripes there are.
    pub fn stripes(&self) -> usize {
        self.stripes.len()
    }

    /// Has the memory of a stripe ready, so that nobody waits for it when something lands there first.
    pub fn reserve(&self, stripe: usize) {
        let mut stripe = self.stripe(stripe);
        if stripe.capacity() < STRIPE {
            // Memory that was only asked for comes when it is written to.
            let landed = stripe.len();
            stripe.resize(STRIPE, Wide { sum: [1; 3], square: [1; 3] });
            stripe.truncate(landed);
        }
    }

    /// Sums of nothing again, in the same memory.
    pub fn clear(&mut self) {
        for stripe in &mut self.stripes {
            stripe.get_mut().unwrap_or_else(PoisonError::into_inner).clear();
        }
    }

    /// A stripe's sums. A thread that died has left every one of them as good as any.
    fn stripe(&self, index: usize) -> MutexGuard<'_, Vec<Wide>> {
        self.stripes[index].lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A stripe's sums, all of them there.
    fn open(&self, index: usize) -> MutexGuard<'_, Vec<Wide>> {
        let mut stripe = self.stripe(index);
        if stripe.is_empty() {
            stripe.resize(STRIPE.min(self.pixels - index * STRIPE), Wide::default());
        }
        stripe
    }

    /// Fetches the sums for splats on one stripe, where it has any.
    fn fetch(&self, splats: &[(u32, [f32; 3])]) {
        let stripe = self.stripe(splats[0].0 as usize / STRIPE);
        for (pixel, _) in splats {
            stripe.get(*pixel as usize % STRIPE).into_iter().for_each(prefetch);
        }
    }

    /// Adds a splat to a pixel, from any thread. Returns whether it can be counted, and is: not finite, or beyond
    /// [`MAX_SPLAT`], it is not, and without room for its square the variance of this pixel is worthless.
    #[must_use]
    pub fn add(&self, pixel: usize, value: [f32; 3]) -> bool {
        fits(value) && self.open(pixel / STRIPE)[pixel % STRIPE].add(value)
    }

    fn at(&self, pixel: usize) -> Wide {
        self.stripe(pixel / STRIPE).get(pixel % STRIPE).copied().unwrap_or_default()
    }

    /// The sums and sums of squares of all pixels on whose stripe anything has landed, in their order.
    pub fn each(&self, mut visit: impl FnMut(usize, [f64; 3], [f64; 3])) {
        for i in 0..self.stripes.len() {
            for (k, wide) in self.stripe(i).iter().enumerate() {
                visit(i * STRIPE + k, wide.sums(), wide.squares());
            }
        }
    }

    /// The sum of a pixel.
    pub fn sum(&self, pixel: usize) -> [f64; 3] {
        self.at(pixel).sums()
    }

    /// The sum of squares of a pixel.
    pub fn sum_of_squares(&self, pixel: usize) -> [f64; 3] {
        self.at(pixel).squares()
    }

    /// Writes the sums, if there are any; of a stripe without any one word.
    ///
    /// # Errors
    /// As `to`.
    pub fn save(splats: Option<&SplatSums>, to: &mut dyn Write) -> io::Result<()> {
        let Some(splats) = splats else { return write_words(to, [0]) };
        write_words(to, [splats.pixels as u64])?;
        (0..splats.stripes.len()).try_for_each(|i| {
            let stripe = splats.stripe(i);
            write_words(to, [stripe.len() as u64].into_iter().chain(stripe.iter().flat_map(Wide::words)))
        })
    }

    /// The sums that were written, if there were any, of so many pixels.
    ///
    /// # Errors
    /// When they are of another number of pixels.
    pub fn restore(pixels: usize, from: &mut Saved<'_>) -> Result<Option<SplatSums>, Misfit> {
        match from.word()? {
            0 => Ok(None),
            saved if saved == pixels as u64 => {
                let splats = SplatSums::new(pixels);
                for i in 0..splats.stripes.len() {
                    match from.word()? {
                        0 => {}
                        n => {
                            let mut stripe = splats.open(i);
                            if n != stripe.len() as u64 {
                                return Err(Misfit);
                            }
                            for wide in stripe.iter_mut() {
                                *wide = Wide::of_words(from)?;
                            }
                        }
                    }
                }
                Ok(Some(splats))
            }
            _ => Err(Misfit),
        }
    }

    /// The sums of a pixel and its sums of squares, of samples and splats together, given those of the `samples`
    /// samples: see [`Film`](super::Film).
    pub fn join(&self, pixel: usize, own: [f64; 3], own2: [f64; 3], samples: u64) -> ([f64; 3], [f64; 3]) {
        join((self.sum(pixel), self.sum_of_squares(pixel)), (own, own2), samples)
    }
}

/// Splats of one thread on their way to [`SplatSums`].
#[derive(Debug)]
pub struct SplatBuffer {
    /// How many it holds before it asks to be emptied.
    most: usize,
    waiting: Vec<(u32, [f32; 3])>,
    /// The same by stripe, while they are handed over, and where each stripe's begin.
    sorted: Vec<(u32, [f32; 3])>,
    starts: Vec<u32>,
    locks: u64,
}

impl SplatBuffer {
    /// For sums of so many pixels.
    pub fn new(pixels: usize) -> SplatBuffer {
        let most = (pixels.div_ceil(STRIPE) * BUFFERED).clamp(HELD[0], HELD[1]);
        SplatBuffer { most, waiting: Vec::new(), sorted: Vec::new(), starts: Vec::new(), locks: 0 }
    }

    /// Whether it is as [`new`](Self::new) makes it for sums of so many pixels.
    pub fn serves(&self, pixels: usize) -> bool {
        self.most == SplatBuffer::new(pixels).most
    }

    /// Takes a splat for a pixel, a number below 2^32. Returns whether it can be counted, as [`SplatSums::add`] does.
    #[inline]
    #[must_use]
    pub fn push(&mut self, pixel: usize, value: [f32; 3]) -> bool {
        let fits = fits(value);
        if fits {
            self.waiting.push((pixel as u32, value));
        }
        fits
    }

    /// How many locks it has taken, since this was asked last, to hand over what it held.
    pub fn take_locks(&mut self) -> u64 {
        std::mem::take(&mut self.locks)
    }

    /// Whether nothing waits.
    pub fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    /// Whether it is time to [hand over](Self::flush).
    #[inline]
    pub fn is_full(&self) -> bool {
        self.waiting.len() >= self.most
    }

    /// Hands everything over and returns how many splats found no room for their squares.
    #[must_use]
    pub fn flush(&mut self, sums: &SplatSums) -> u64 {
        // Counted, then put in place: one pass each, however many stripes there are.
        self.starts.clear();
        self.starts.resize(sums.stripes.len() + 1, 0);
        for (pixel, _) in &self.waiting {
            self.starts[*pixel as usize / STRIPE + 1] += 1;
        }
        for i in 1..self.starts.len() {
            self.starts[i] += self.starts[i - 1];
        }
        self.sorted.resize(self.waiting.len(), Default::default());
        for splat in self.waiting.drain(..) {
            let place = &mut self.starts[splat.0 as usize / STRIPE];
            self.sorted[*place as usize] = splat;
            *place += 1;
        }
        let mut without_room = 0;
        let mut groups = self.sorted.chunk_by(|a, b| a.0 as usize / STRIPE == b.0 as usize / STRIPE).peekable();
        while let Some(group) = groups.next() {
            let at = group[0].0 as usize / STRIPE;
            // Where there are many, locks are not at hand either.
            if let Some(soon) = sums.stripes.get(at + 2) {
                prefetch(soon);
            }
            // Where few are for the same stripe, as in films with a time axis, the next stripe's first ones are what comes soon.
            if let Some(next) = groups.peek().filter(|next| next.len() <= 2 * BUFFERED) {
                sums.fetch(&next[..next.len().min(2 * AHEAD)]);
                self.locks += 1;
            }
            let mut stripe = sums.open(at);
            self.locks += 1;
            for (i, (pixel, value)) in group.iter().enumerate() {
                if let Some((later, _)) = group.get(i + AHEAD) {
                    prefetch(&stripe[*later as usize % STRIPE]);
                }
                without_room += u64::from(!stripe[*pixel as usize % STRIPE].add(*value));
            }
        }
        without_room
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Words that look like chance.
    fn word(i: u32) -> u32 {
        let x = (i ^ i >> 15).wrapping_mul(0x2c1b_3c6d).wrapping_add(0x9e37_79b9);
        (x ^ x >> 12).wrapping_mul(0x297a_2d39)
    }

    #[test]
    fn whole_numbers_are_those_of_a_cast_for_every_kind_of_number() {
        let of_cast = |v: f32, bits: i32| (f64::from(v) * f64::from(bits).exp2()) as i128;
        let mut values =
            vec![0.0, -0.0, f32::MIN_POSITIVE, 1e-40, 1.0, MAX_SPLAT, 2.0f32.powi(-64), 1.999 * 2.0f32.powi(-64)];
        values.extend((0..4000).map(|i| f32::from_bits(word(i))).filter(|v| v.abs() <= MAX_SPLAT));
        assert!(values.len() > 2000);
        for v in values {
            let mut w = Wide::default();
            assert!(w.add([v, -v, 0.0]));
            assert_eq!(w.sum, [of_cast(v, SUM_BITS), of_cast(-v, SUM_BITS), 0], "{v:e}");
            let square = f64::from(v) * f64::from(v) * f64::from(SQUARE_BITS).exp2();
            assert_eq!(w.square[0], square as u128, "{v:e}");
        }
    }

    #[test]
    fn carries_and_signs_survive_any_order() {
        let values = [1.5f32, -3.25e9, 7e-9, MAX_SPLAT, -MAX_SPLAT, 300.0, -299.0, 1e-12, 3.25e9];
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
    fn memory_that_is_had_beforehand_changes_no_sum() {
        // The last stripe is shorter than the others.
        let splats = SplatSums::new(STRIPE + 3);
        for pixel in [0, STRIPE - 1, STRIPE, STRIPE + 2] {
            assert!(splats.add(pixel, [pixel as f32 + 1.0; 3]));
        }
        (0..splats.stripes()).for_each(|stripe| splats.reserve(stripe));
        for pixel in [0, STRIPE - 1, STRIPE, STRIPE + 2] {
            assert_eq!(splats.sum(pixel), [pixel as f64 + 1.0; 3]);
        }
        assert_eq!((splats.sum(1), splats.sum(STRIPE + 1)), ([0.0; 3], [0.0; 3]));
    }

    #[test]
    fn squares_of_the_greatest_splats_have_room() {
        let mut wide = Wide::default();
        let n = (1 << 20) - 1;
        for _ in 0..n {
            assert!(wide.add([MAX_SPLAT, 3.0, -0.5]));
        }
        let n = f64::from(n);
        let square = f64::from(MAX_SPLAT) * f64::from(MAX_SPLAT);
        let scale = f64::from(SQUARE_BITS).exp2();
        assert_eq!(wide.square.map(|s| s as f64 / scale), [n * square, n * 9.0, n * 0.25]);
        assert!(!wide.add([MAX_SPLAT, 0.0, 0.0]), "one more goes past the end and says so");
    }

    #[test]
    fn what_does_not_fit_is_refused_whole() {
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
    fn threads_that_meet_lose_nothing_with_a_buffer_or_without() {
        // Three stripes and a bit, so that buffers are sorted and handed over in parts.
        let pixels = 3 * STRIPE + 7;
        let splat = |t: u32, i: u32| {
            let v = 200.0 + (i % 7 + t) as f32;
            (word(t << 16 | i) as usize % pixels, [v, -v, if i.is_multiple_of(2) { v } else { -v }])
        };
        let splats = SplatSums::new(pixels);
        std::thread::scope(|scope| {
            for t in 0..4u32 {
                let splats = &splats;
                scope.spawn(move || {
                    let mut buffer = SplatBuffer { most: 7000, ..SplatBuffer::new(pixels) };
                    for i in 0..20_000u32 {
                        let (pixel, value) = splat(t, i);
                        assert!(if t == 0 { splats.add(pixel, value) } else { buffer.push(pixel, value) });
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
    fn buffers_hold_more_where_there_are_many_stripes_and_no_end_of_them() {
        let most = |stripes: usize| SplatBuffer::new(stripes * STRIPE).most;
        assert_eq!([1, 100, 2000, 1 << 20].map(most), [HELD[0], HELD[0], 2000 * BUFFERED, HELD[1]]);
        assert!(SplatBuffer::new(STRIPE).serves(2 * STRIPE) && !SplatBuffer::new(STRIPE).serves(2000 * STRIPE));
        let mut buffer = SplatBuffer { most: 2, ..SplatBuffer::new(1) };
        let full = [0; 2].map(|_| buffer.push(0, [1.0; 3]) && buffer.is_full());
        assert_eq!(full, [false, true]);
    }

    #[test]
    fn a_buffer_says_how_many_found_no_room() {
        let splats = SplatSums::new(1);
        splats.open(0)[0].square = [u128::MAX; 3];
        let mut buffer = SplatBuffer::new(1);
        assert!(buffer.push(0, [1.0; 3]) && buffer.push(0, [0.0; 3]));
        assert_eq!(buffer.flush(&splats), 1);
        assert!(!splats.add(0, [f32::NAN; 3]));
    }
}
