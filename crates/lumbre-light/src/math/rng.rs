//! Counter-based random numbers: a pure function of seed, pixel, sample and dimension.
//!
//! Invariant: the numbers of a sample do not depend on the thread, the tile, the wave, or
//! interruptions of a night, since no state passes from one sample to the next.

use super::real::{Real, Word};

/// Hashes four words to four words: pcg4d of [Jarzynski & Olano 2020, "Hash Functions for GPU
/// Rendering"].
#[inline(always)]
pub fn pcg4d<W: Word>([x, y, z, w]: [W; 4]) -> [W; 4] {
    let [x, y, z, w] = cross_mix([lcg(x), lcg(y), lcg(z), lcg(w)]);
    cross_mix([xorshift(x), xorshift(y), xorshift(z), xorshift(w)])
}

/// Applies one step of a linear congruential generator.
#[inline(always)]
fn lcg<W: Word>(a: W) -> W {
    a.mul(W::splat(1_664_525)).add(W::splat(1_013_904_223))
}

/// Xors a word with its upper half.
#[inline(always)]
fn xorshift<W: Word>(a: W) -> W {
    a.xor(a.shr::<16>())
}

/// Mixes the four words with one another.
#[inline(always)]
fn cross_mix<W: Word>([x, y, z, w]: [W; 4]) -> [W; 4] {
    let x = x.add(y.mul(w));
    let y = y.add(z.mul(x));
    let z = z.add(x.mul(y));
    [x, y, z, w.add(y.mul(z))]
}

/// Returns a number in `[0, 1)` from the 24 upper bits of a word.
#[inline(always)]
pub fn unit<W: Word>(word: W) -> W::Real {
    word.shr::<8>().to_float() * W::Real::splat(1.0 / 16_777_216.0)
}

/// Returns a standard normal number from two uniform ones (Box-Muller transform).
#[inline]
pub fn normal(u: [f32; 2]) -> f32 {
    (-2.0 * (1.0 - u[0]).ln()).sqrt() * (std::f32::consts::TAU * u[1]).cos()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::stats;

    #[test]
    fn words_are_uniform_in_every_component_for_consecutive_counters() {
        // 4 components x 2 counter positions, each by chi-square over 64 bins; significance split
        // over 8 tests.
        for position in 0..2 {
            let mut bins = [[0u64; 64]; 4];
            let n = 1 << 16;
            for i in 0..n {
                let mut v = [17, 29, 31, 7];
                v[position + 2] = i;
                for (c, w) in pcg4d(v).into_iter().enumerate() {
                    bins[c][(w >> 26) as usize] += 1;
                }
            }
            for b in bins {
                let expected = vec![f64::from(n) / 64.0; 64];
                let observed: Vec<f64> = b.iter().map(|x| *x as f64).collect();
                let p = stats::chi_square_p(&observed, &expected, 0);
                assert!(p > 0.001 / 8.0, "p = {p}");
            }
        }
    }

    #[test]
    fn hash_values_are_those_of_the_reference() {
        // The values are from an implementation in Python. Other values would change every picture,
        // and need new integrator revisions.
        assert_eq!(pcg4d([1, 2, 3, 4]), GOLDEN);
    }

    const GOLDEN: [u32; 4] = [908_250_390, 4_044_648_920, 3_775_961_919, 45_698_095];

    #[test]
    fn unit_stays_below_one() {
        assert_eq!(unit(0), 0.0);
        assert!(unit(u32::MAX) < 1.0);
    }
}
