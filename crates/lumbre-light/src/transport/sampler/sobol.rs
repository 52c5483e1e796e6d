//! The Owen-scrambled Sobol sequence, padded to any number of dimensions.
//!
//! The first four dimensions of the sequence of [Sobol 1967] come from the primitive polynomials
//! and initial numbers of [Joe & Kuo 2008]. Quality decreases with the dimension, so no further
//! ones are used: the numbers of a path come in groups of at most four, and every group is a
//! separate copy of the sequence, shuffled and scrambled independently [Burley 2020]. Shuffling and
//! scrambling are random permutations of Owen's kind [Owen 1995], which permute every binary digit
//! depending on the digits before it. They are computed by a hash of the reversed digits [Laine &
//! Karras 2011], which is cheap because carries propagate towards the less significant ones.
//!
//! Properties for the samples of one pixel whose index starts at a multiple of `n`, a power of two,
//! and counts `n`:
//! - A pair has exactly one point in every elementary rectangle of area `1 / n`: it is a
//!   (0,2)-sequence.
//! - A single number has exactly one point in every interval of length `1 / n`.
//! - A single number and the following pair have exactly two points in every elementary box of
//!   volume `2 / n`: a (1,3)-sequence.
//!
//! Integrands that consist only of interactions between groups do not gain. Consecutive samples lie
//! in opposite halves in every group, so products of two groups treat them as one sample and have
//! up to twice the variance of independent numbers (2 for products of signs, 1.6 for products of
//! linear functions, about 1 for products of small spots). Integrands that depend on one group, or
//! on a sum over groups, gain.
//!
//! Numbers of different groups, pixels and seeds are independent, and a single sample is uniform
//! over the whole space, so the mean of a picture does not change. One sequence has 2^32 samples;
//! the next 2^32 samples of a pixel use another sequence with its own scrambling. Numbers have 24
//! binary digits.

use crate::math::rng::{pcg4d, unit};

/// Number of single numbers in a group, before its pair.
const SINGLES: usize = 2;

/// The numbers of one sample of one pixel.
#[derive(Clone, Debug)]
pub struct Sobol {
    /// The key of the pixel's sequence.
    key: [u32; 4],
    /// Index of the sample in the sequence, digits reversed.
    reversed: u32,
    /// Index of the next group.
    group: u32,
    /// Random words of this group: for its order, both dimensions of its pair, and its first single
    /// number.
    words: [u32; 4],
    /// Index of this sample's point in the group's sequence.
    point: u32,
    /// Number of single numbers taken from the group; [`SINGLES`] also if its pair was taken.
    singles: usize,
    /// Whether the pair of the group is still available.
    pair: bool,
}

impl Sobol {
    /// Starts the numbers of one sample of one pixel.
    #[inline]
    pub fn new(seed: u64, pixel: [u32; 2], sample: u64) -> Sobol {
        let key = pcg4d([
            pixel[0] | (pixel[1] << 16),
            (seed as u32) ^ (pixel[0] >> 16).rotate_left(8) ^ (pixel[1] >> 16),
            (sample >> 32) as u32,
            (seed >> 32) as u32,
        ]);
        let reversed = (sample as u32).reverse_bits();
        Sobol {
            key,
            reversed,
            group: 0,
            words: [0; 4],
            point: 0,
            singles: SINGLES,
            pair: false,
        }
    }

    /// Returns random words that depend on the pixel's sequence and the sample's index in it.
    #[inline]
    pub(super) fn key_of_sample(&self) -> [u32; 4] {
        let [a, b, c, d] = self.key;
        pcg4d([a, b, c ^ self.reversed, d])
    }

    /// Returns the next number, in `[0, 1)`.
    #[inline]
    pub fn next_1d(&mut self) -> f32 {
        if self.singles == SINGLES {
            self.open();
        }
        self.singles += 1;
        let (table, word) = if self.singles == 1 {
            (&TABLE_2, self.words[3])
        } else {
            // A second single number is rare enough to hash again.
            (&TABLE_3, pcg4d(self.words)[0])
        };
        unit(scramble(multiply(table, self.point), word))
    }

    /// Returns the next two numbers, each in `[0, 1)`.
    #[inline]
    pub fn next_2d(&mut self) -> [f32; 2] {
        if !self.pair {
            self.open();
        }
        (self.singles, self.pair) = (SINGLES, false);
        let [_, x, y, _] = self.words;
        [
            unit(scramble(self.point.reverse_bits(), x)),
            unit(scramble(dimension_1(self.point), y)),
        ]
    }

    /// Starts the next group.
    #[inline]
    fn open(&mut self) {
        let [a, b, c, d] = self.key;
        self.words = pcg4d([a, b, c, d.wrapping_add(self.group)]);
        self.group = self.group.wrapping_add(1);
        // The scrambled index; aligned blocks of indices map to such blocks.
        self.point = permute(self.reversed, self.words[0]).reverse_bits();
        (self.singles, self.pair) = (0, true);
    }
}

/// Applies Owen scrambling to a number whose most significant digit is the first after the binary
/// point.
#[inline]
fn scramble(x: u32, word: u32) -> u32 {
    permute(x.reverse_bits(), word).reverse_bits()
}

/// Permutes words such that every bit depends on itself and the less significant ones only,
/// selected at random by `word`, after [Laine & Karras 2011]. Multiplying by an even number and
/// xoring lets a bit affect only those above it; the product with an odd number taken from the word
/// randomises each of these dependencies. The constants are the best of 600 random triples:
/// flipping a bit flips every bit above it with a probability that half a million random words
/// cannot distinguish from one half.
#[inline]
fn permute(mut x: u32, word: u32) -> u32 {
    x = x.wrapping_add(word);
    x ^= x.wrapping_mul(0xa666_a200);
    x = x.wrapping_mul(word.rotate_left(16) | 1);
    x ^= x.wrapping_mul(0xf160_de5c);
    x ^ x.wrapping_mul(0xa418_e192)
}

/// Computes the generator matrix of a dimension, one word for each digit of the index from the
/// least significant on, with the most significant bit first after the binary point: from the
/// primitive polynomial of this degree, whose inner coefficients are the bits of `a`, and the first
/// `m` [Joe & Kuo 2008, section 2].
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

/// Generator matrix of the third dimension, x^2 + x + 1.
const DIMENSION_2: [u32; 32] = directions(2, 1, &[1, 3]);
/// Generator matrix of the fourth dimension, x^3 + x + 1.
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
            // The product of the value without its lowest bit, and that bit's column.
            let low = (value as u32).trailing_zeros() as usize;
            table[byte][value] = table[byte][value & (value - 1)] ^ matrix[8 * byte + low];
            value += 1;
        }
        byte += 1;
    }
    table
}

/// Returns the product of a generator matrix and an index, in arithmetic modulo two.
#[inline]
fn multiply(table: &Table, index: u32) -> u32 {
    let [a, b, c, d] = index.to_le_bytes().map(usize::from);
    table[0][a] ^ table[1][b] ^ table[2][c] ^ table[3][d]
}

/// Returns the second dimension, x + 1, in five steps: its matrix is Pascal's triangle modulo two,
/// a fivefold tensor product of a two by two matrix.
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
