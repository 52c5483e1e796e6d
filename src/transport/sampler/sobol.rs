//! The Owen-scrambled Sobol sequence, padded to any number of dimensions.
//!
//! The first four dimensions of the sequence of [Sobol 1967] come from the primitive polynomials and initial numbers of
//! [Joe & Kuo 2008]. Their quality falls with the dimension, so no further ones are used: the numbers of a path come in
//! groups of at most four, and every group is a copy of the sequence of its own, whose points are visited in an order
//! of its own and scrambled on their own [Burley 2020]. Both the order and the scrambling are random permutations of
//! Owen's kind [Owen 1995], which decide every binary digit by the digits before it; they are made by a hash of the
//! reversed digits [Laine & Karras 2011], which is cheap because carries run towards the less significant ones.
//!
//! What follows, for the samples of one pixel whose index starts at a multiple of `n`, a power of two, and counts `n`:
//! - a pair has exactly one point in every rectangle of area `1 / n` whose sides are powers of two in the right places:
//!   it is a (0,2)-sequence;
//! - a single number has exactly one point in every interval of length `1 / n`;
//! - single and following pair together have exactly two in every such box of volume `2 / n`: a (1,3)-sequence.
//!
//! The price is paid where an integrand is nothing but interaction of groups: consecutive samples lie in opposite halves in
//! every group, so products of two groups see them as one sample, and have up to twice the variance of independent
//! numbers (products of signs twice, of straight lines 1.6 times, of small spots about once). What depends on one group alone, or on a sum over groups, is what gains.
//!
//! Between groups, pixels and seeds numbers are independent, and a single sample is uniform over the whole space, so
//! the mean of a picture does not change. One sequence has 2^32 samples; the next 2^32 of a pixel are another,
//! scrambled anew. Numbers keep 24 binary digits.

use crate::math::rng::{pcg4d, unit};

/// Single numbers in a group, before its pair.
const SINGLES: usize = 2;

/// The numbers of one sample of one pixel.
#[derive(Clone, Debug)]
pub struct Sobol {
    /// The key of the pixel's sequence.
    key: [u32; 4],
    /// The sample's index in it, digits reversed.
    reversed: u32,
    /// Number of the next group.
    group: u32,
    /// Random words of this group: of its order, of both dimensions of its pair, of its first single number.
    words: [u32; 4],
    /// Which point of the sequence this sample is in this group.
    point: u32,
    /// Single numbers taken from the group; [`SINGLES`] also when its pair is taken.
    singles: usize,
    /// Whether the pair of the group is still there.
    pair: bool,
}

impl Sobol {
    /// The numbers of one sample of one pixel.
    #[inline]
    pub fn new(seed: u64, pixel: [u32; 2], sample: u64) -> Sobol {
        let key = pcg4d([
            pixel[0] | (pixel[1] << 16),
            (seed as u32) ^ (pixel[0] >> 16).rotate_left(8) ^ (pixel[1] >> 16),
            (sample >> 32) as u32,
            (seed >> 32) as u32,
        ]);
        let reversed = (sample as u32).reverse_bits();
        Sobol { key, reversed, group: 0, words: [0; 4], point: 0, singles: SINGLES, pair: false }
    }

    /// Random words of the pixel's sequence and of the place in it.
    #[inline]
    pub(super) fn key_of_sample(&self) -> [u32; 4] {
        let [a, b, c, d] = self.key;
        pcg4d([a, b, c ^ self.reversed, d])
    }

    /// The next number, in `[0, 1)`.
    #[inline]
    pub fn next_1d(&mut self) -> f32 {
        if self.singles == SINGLES {
            self.open();
        }
        self.singles += 1;
        let (table, word) = if self.singles == 1 {
            (&TABLE_2, self.words[3])
        } else {
            // Rare enough to hash once more for it.
            (&TABLE_3, pcg4d(self.words)[0])
        };
        unit(scramble(multiply(table, self.point), word))
    }

    /// The next two numbers, each in `[0, 1)`.
    #[inline]
    pub fn next_2d(&mut self) -> [f32; 2] {
        if !self.pair {
            self.open();
        }
        (self.singles, self.pair) = (SINGLES, false);
        let [_, x, y, _] = self.words;
        [unit(scramble(self.point.reverse_bits(), x)), unit(scramble(dimension_1(self.point), y))]
    }

    /// Begins the next group.
    #[inline]
    fn open(&mut self) {
        let [a, b, c, d] = self.key;
        self.words = pcg4d([a, b, c, d.wrapping_add(self.group)]);
        self.group = self.group.wrapping_add(1);
        // The scrambled index; it takes aligned blocks of indices to such blocks.
        self.point = permute(self.reversed, self.words[0]).reverse_bits();
        (self.singles, self.pair) = (0, true);
    }
}

/// Owen's scrambling of a number whose most significant digit is the first behind the point.
#[inline]
fn scramble(x: u32, word: u32) -> u32 {
    permute(x.reverse_bits(), word).reverse_bits()
}

/// A permutation in which every bit depends on itself and the less significant ones only, as random as `word` is; the idea
/// is that of [Laine & Karras 2011]. Products with even numbers, added without carry, let a bit reach only those above
/// it; the product with an odd number taken from the word makes each of these ways random. The constants are the best of 600
/// random triples: flipping a bit flips every bit above it with a probability that half a million random words do not
/// tell from one half.
#[inline]
fn permute(mut x: u32, word: u32) -> u32 {
    x = x.wrapping_add(word);
    x ^= x.wrapping_mul(0xa666_a200);
    x = x.wrapping_mul(word.rotate_left(16) | 1);
    x ^= x.wrapping_mul(0xf160_de5c);
    x ^ x.wrapping_mul(0xa418_e192)
}

/// The generator matrix of a dimension, one word for each digit of the index from the least significant on, most
/// significant bit first behind the point: from the primitive polynomial of this degree, whose inner coefficients are
/// the bits of `a`, and the first `m` [Joe & Kuo 2008, section 2].
const fn directions(degree: usize, a: u32, m: &[u32]) -> [u32; 32] {
    let mut v = [0; 32];
    let mut i = 0;
    while i < 32 {
        if i < degree {
            v[i] = m[i] << (31 - i);
        } else {
            v[i] = v[i - degree] ^ (v[i - degree] >> degree);
            let mut k = 1;
            while k < degree {
                v[i] ^= ((a >> (degree - 1 - k)) & 1) * v[i - k];
                k += 1;
            }
        }
        i += 1;
    }
    v
}

/// Generator of the third dimension, x^2 + x + 1.
const DIMENSION_2: [u32; 32] = directions(2, 1, &[1, 3]);
/// Generator of the fourth dimension, x^3 + x + 1.
const DIMENSION_3: [u32; 32] = directions(3, 1, &[1, 3, 1]);

/// Products of a generator matrix with every value of each byte of an index.
type Table = [[u32; 256]; 4];

static TABLE_2: Table = table(&DIMENSION_2);
static TABLE_3: Table = table(&DIMENSION_3);

const fn table(matrix: &[u32; 32]) -> Table {
    let mut table = [[0; 256]; 4];
    let mut byte = 0;
    while byte < 4 {
        let mut value = 1;
        while value < 256 {
            // What is known for the value without its lowest bit, and that bit's column.
            let low = (value as u32).trailing_zeros() as usize;
            table[byte][value] = table[byte][value & (value - 1)] ^ matrix[8 * byte + low];
            value += 1;
        }
        byte += 1;
    }
    table
}

/// The product of a generator matrix and an index, in arithmetic modulo two.
#[inline]
fn multiply(table: &Table, index: u32) -> u32 {
    let [a, b, c, d] = index.to_le_bytes().map(usize::from);
    table[0][a] ^ table[1][b] ^ table[2][c] ^ table[3][d]
}

/// The second dimension, x + 1, in five steps: its matrix is Pascal's triangle modulo two, which is a fivefold tensor
/// product of one of two by two.
#[inline]
fn dimension_1(index: u32) -> u32 {
    let mut x = index.reverse_bits();
    x ^= (x & 0x5555_5555) << 1;
    x ^= (x & 0x3333_3333) << 2;
    x ^= (x & 0x0f0f_0f0f) << 4;
    x ^= (x & 0x00ff_00ff) << 8;
    x ^ (x << 16)
}

#[cfg(test)]
#[path = "sobol_tests.rs"]
mod tests;
