//! Fixed-point sums of splats, whose bits do not depend on the order of addition.
//!
//! Threads add splats to the same pixel in a random order, and sums of floats would depend on that
//! order in their last bits. [`PixelSums`] converts every value to an integer of a fixed unit
//! first, and integer addition is associative.

use super::state::{CheckpointMismatch, StateReader};

/// Greatest absolute value of one splat: 2^32. Greater values are refused, as infinite ones are.
pub const MAX_SPLAT: f32 = 4_294_967_296.0;

/// Binary digits after the point of a sum. Its unit 2^-64 gives steps of 5.4e-20 and room for 2^31
/// splats of the greatest value on one pixel.
const SUM_BITS: i32 = 64;

/// Binary digits after the point of a sum of squares. Its unit 2^-44 leaves room for 2^20 squares
/// of the greatest splat. Squares below 5.7e-14, of splats below 2.4e-7, add nothing to the sum of
/// squares; the sum itself includes them.
const SQUARE_BITS: i32 = 44;

/// Returns mantissa `m` and exponent `e` of a finite number's absolute value `m 2^e`.
#[inline]
fn decompose(v: f32) -> (u64, i32) {
    let bits = v.to_bits();
    let exponent = (bits >> 23 & 0xff) as i32;
    let fraction = u64::from(bits & 0x7f_ffff);
    if exponent == 0 {
        (fraction, -149)
    } else {
        (fraction | 1 << 23, exponent - 150)
    }
}

/// Returns the integer part of `m 2^e`.
#[inline]
fn integer_part(m: u64, e: i32) -> u128 {
    if e >= 0 {
        u128::from(m) << e
    } else if e > -64 {
        u128::from(m >> -e)
    } else {
        0
    }
}

/// Splat sums of one pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct PixelSums {
    /// Sums in units of `2^-SUM_BITS`.
    pub(super) sum: [i128; 3],
    /// Sums of squares in units of `2^-SQUARE_BITS`.
    pub(super) square: [u128; 3],
}

impl PixelSums {
    /// Adds a splat, exactly except for what lies below one unit, which is cut off. Returns whether
    /// its squares fitted into their sum.
    #[inline]
    pub(super) fn add(&mut self, value: [f32; 3]) -> bool {
        let mut room = true;
        for ((v, sum), square) in value.into_iter().zip(&mut self.sum).zip(&mut self.square) {
            let (m, e) = decompose(v);
            let step = integer_part(m, e + SUM_BITS) as i128;
            *sum = sum.wrapping_add(if v < 0.0 { -step } else { step });
            let over;
            (*square, over) = square.overflowing_add(integer_part(m * m, 2 * e + SQUARE_BITS));
            room &= !over;
        }
        room
    }

    /// Iterates over the sums and then the sums of squares, in units, each as two words, the low
    /// one first.
    /// Parses the words that [`PixelSums::words`] wrote.
    pub(super) fn read(from: &mut StateReader<'_>) -> Result<PixelSums, CheckpointMismatch> {
        let mut next = || Ok(u128::from(from.read_u64()?) | u128::from(from.read_u64()?) << 64);
        let mut three = || Ok([next()?, next()?, next()?]);
        Ok(PixelSums {
            sum: three()?.map(|n| n as i128),
            square: three()?,
        })
    }

    pub(super) fn words(&self) -> impl Iterator<Item = u64> {
        let sums = self.sum.map(|s| s as u128).into_iter().chain(self.square);
        sums.flat_map(|n| [n as u64, (n >> 64) as u64])
    }

    /// Returns the sums as numbers.
    pub(super) fn sums(&self) -> [f64; 3] {
        self.sum.map(sum_to_f64)
    }

    /// Returns the sums of squares as numbers.
    pub(super) fn squares(&self) -> [f64; 3] {
        self.square.map(squares_to_f64)
    }
}

fn sum_to_f64(units: i128) -> f64 {
    units as f64 / (1u128 << SUM_BITS) as f64
}

fn squares_to_f64(units: u128) -> f64 {
    units as f64 / (1u64 << SQUARE_BITS) as f64
}

/// Combines splat sums with the sums of a pixel's own `samples` samples and returns sum and sum of
/// squares as defined by [`Film`](super::Film).
pub fn combine_sums(
    (landed, squares): ([f64; 3], [f64; 3]),
    (own, own2): ([f64; 3], [f64; 3]),
    samples: u64,
) -> ([f64; 3], [f64; 3]) {
    let n = samples.max(1) as f64;
    let sum = [0, 1, 2].map(|c| own[c] + landed[c]);
    let sum2 = [0, 1, 2]
        .map(|c| own2[c] + squares[c] * (n - 1.0) / n + (sum[c] * sum[c] - own[c] * own[c]) / n);
    (sum, sum2)
}

/// Converts a 128-bit sum of splats to a number; words are given low first.
pub fn sum_from_words(words: [u32; 4]) -> f64 {
    sum_to_f64(u128_from_words(words) as i128)
}

/// Converts a 128-bit sum of squares of splats to a number; words are given low first.
pub fn squares_from_words(words: [u32; 4]) -> f64 {
    squares_to_f64(u128_from_words(words))
}

fn u128_from_words(words: [u32; 4]) -> u128 {
    words
        .into_iter()
        .rev()
        .fold(0, |sum, word| sum << 32 | u128::from(word))
}

/// Returns whether a splat can be added: finite, and no component beyond [`MAX_SPLAT`].
#[inline]
pub(super) fn is_addable(value: [f32; 3]) -> bool {
    value.iter().all(|v| v.abs() <= MAX_SPLAT)
}
#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Returns pseudo-random bits.
    pub fn word(i: u32) -> u32 {
        let x = (i ^ i >> 15)
            .wrapping_mul(0x2c1b_3c6d)
            .wrapping_add(0x9e37_79b9);
        (x ^ x >> 12).wrapping_mul(0x297a_2d39)
    }

    #[test]
    fn integers_equal_those_of_a_cast_for_all_kinds_of_floats() {
        let cast = |v: f32, bits: i32| (f64::from(v) * f64::from(bits).exp2()) as i128;
        let mut values = vec![
            0.0,
            -0.0,
            f32::MIN_POSITIVE,
            1e-40,
            1.0,
            MAX_SPLAT,
            2.0f32.powi(-64),
            1.999 * 2.0f32.powi(-64),
        ];
        values.extend(
            (0..4000)
                .map(|i| f32::from_bits(word(i)))
                .filter(|v| v.abs() <= MAX_SPLAT),
        );
        assert!(values.len() > 2000);
        for v in values {
            let mut w = PixelSums::default();
            assert!(w.add([v, -v, 0.0]));
            assert_eq!(w.sum, [cast(v, SUM_BITS), cast(-v, SUM_BITS), 0], "{v:e}");
            let square = f64::from(v) * f64::from(v) * f64::from(SQUARE_BITS).exp2();
            assert_eq!(w.square[0], square as u128, "{v:e}");
        }
    }

    #[test]
    fn squares_of_the_greatest_splats_do_not_overflow() {
        let mut wide = PixelSums::default();
        let n = (1 << 20) - 1;
        for _ in 0..n {
            assert!(wide.add([MAX_SPLAT, 3.0, -0.5]));
        }
        let n = f64::from(n);
        let square = f64::from(MAX_SPLAT) * f64::from(MAX_SPLAT);
        let scale = f64::from(SQUARE_BITS).exp2();
        assert_eq!(
            wide.square.map(|s| s as f64 / scale),
            [n * square, n * 9.0, n * 0.25]
        );
        assert!(
            !wide.add([MAX_SPLAT, 0.0, 0.0]),
            "one more overflows and is reported"
        );
    }

    #[test]
    fn splats_have_the_variance_of_rare_events() {
        // Three splats in eight samples, which have no light of their own.
        let splats = [1.0, 2.0, 4.0];
        let (sum, squares) = (
            splats.iter().sum::<f64>(),
            splats.map(|x| x * x).iter().sum(),
        );
        let n = 8.0;
        let (sum, sum2) = combine_sums(([sum; 3], [squares; 3]), ([0.0; 3], [0.0; 3]), 8);
        let variance_of_mean = (sum2[0] - sum[0] * sum[0] / n) / (n - 1.0) / n;
        let expected = squares / (n * n);
        assert!((variance_of_mean / expected - 1.0).abs() < 1e-12);
        // Independent light of the samples adds its own variance.
        let own: [f64; 8] = [1.0, 3.0, 2.0, 2.0, 5.0, 1.0, 1.0, 1.0];
        let (own_sum, own_sum2) = (own.iter().sum::<f64>(), own.map(|x| x * x).iter().sum());
        let own_variance = (own_sum2 - own_sum * own_sum / n) / (n - 1.0) / n;
        let (sum, sum2) = combine_sums(([7.0; 3], [squares; 3]), ([own_sum; 3], [own_sum2; 3]), 8);
        let both = (sum2[1] - sum[1] * sum[1] / n) / (n - 1.0) / n;
        assert!((both / (expected + own_variance) - 1.0).abs() < 1e-12);
    }
}
