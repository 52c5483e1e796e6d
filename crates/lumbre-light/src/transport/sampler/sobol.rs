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

use crate::math::real::{Mask, Real, Word};
use crate::math::rng::{pcg4d, unit};

/// Number of single numbers in a group, before its pair.
const SINGLES: u32 = 2;

/// Position in the numbers of one sample, stored in one word: twice the number of groups opened is
/// in the upper 29 bits, then two bits for the number of single numbers taken from the last group,
/// then one bit that is set while its pair is available.
#[derive(Clone, Copy)]
struct Position<W> {
    /// Number of groups opened.
    groups: W,
    /// Number of single numbers taken from the last group; [`SINGLES`] also if its pair was taken.
    singles: W,
    /// 1 if the pair of the last group is still available, else 0.
    pair: W,
}

impl<W: Word> Position<W> {
    #[inline(always)]
    fn from_word(word: W) -> Position<W> {
        // The word of a new sample is 0: the last group has nothing left.
        Position {
            groups: word.shr::<3>(),
            singles: W::splat(SINGLES).sub(word.shr::<1>().and(W::splat(3))),
            pair: word.and(W::splat(1)),
        }
    }

    #[inline(always)]
    fn word(self) -> W {
        let left = W::splat(SINGLES).sub(self.singles);
        self.groups.shl::<3>().or(left.shl::<1>()).or(self.pair)
    }

    /// Starts the next group in the lanes of `mask`.
    #[inline(always)]
    fn open(self, mask: <W::Real as Real>::Mask) -> Position<W> {
        Position {
            groups: W::select(mask, self.groups.add(W::splat(1)), self.groups),
            singles: W::select(mask, W::splat(0), self.singles),
            pair: W::select(mask, W::splat(1), self.pair),
        }
    }
}

/// Numbers of the last group that was opened.
struct Group<W> {
    /// Random words of the group: for its order, both dimensions of its pair, and its first single
    /// number.
    words: [W; 4],
    /// Index of this sample's point in the group's sequence.
    point: W,
}

impl<W: Word> Group<W> {
    /// Returns group number `groups - 1` of the sample whose index has these digits, reversed.
    #[inline(always)]
    fn new(key: [W; 4], reversed: W, groups: W) -> Group<W> {
        let [a, b, c, d] = key;
        let words = pcg4d([a, b, c, d.add(groups.sub(W::splat(1)))]);
        // The scrambled index; aligned blocks of indices map to such blocks.
        let point = permute(reversed, words[0]).reverse_bits();
        Group { words, point }
    }

    /// Returns the first single number, or the second in the lanes of `second`.
    #[inline(always)]
    fn single(&self, second: <W::Real as Real>::Mask) -> W::Real {
        let first = scramble(multiply(&TABLE_2, self.point), self.words[3]);
        if !second.any() {
            return unit(first);
        }
        // A second single number is rare enough to hash again.
        let other = scramble(multiply(&TABLE_3, self.point), pcg4d(self.words)[0]);
        unit(W::select(second, other, first))
    }

    #[inline(always)]
    fn pair(&self) -> [W::Real; 2] {
        let [_, x, y, _] = self.words;
        [
            unit(scramble(self.point.reverse_bits(), x)),
            unit(scramble(dimension_1(self.point), y)),
        ]
    }
}

/// Returns the key of a pixel's sequence. `high` is the upper word of the index of the sample.
#[inline(always)]
pub fn key<W: Word>(seed: u64, [x, y]: [W; 2], high: W) -> [W; 4] {
    pcg4d([
        x.or(y.shl::<16>()),
        super::seed_and_upper_halves(seed, [x, y]),
        high,
        W::splat((seed >> 32) as u32),
    ])
}

/// Returns the next number at a position, which it advances.
#[inline(always)]
pub fn next_one<W: Word>(key: [W; 4], reversed: W, position: &mut W) -> W::Real {
    let mut at = Position::from_word(*position);
    at = at.open(at.singles.eq(W::splat(SINGLES)));
    let number = Group::new(key, reversed, at.groups).single(at.singles.eq(W::splat(1)));
    at.singles = at.singles.add(W::splat(1));
    *position = at.word();
    number
}

/// Returns the next two numbers at a position, which it advances.
#[inline(always)]
pub fn next_two<W: Word>(key: [W; 4], reversed: W, position: &mut W) -> [W::Real; 2] {
    let mut at = Position::from_word(*position);
    at = at.open(at.pair.eq(W::splat(0)));
    (at.singles, at.pair) = (W::splat(SINGLES), W::splat(0));
    *position = at.word();
    Group::new(key, reversed, at.groups).pair()
}

/// Returns the next number and the next two, which are of the same group.
#[inline(always)]
pub fn next_three<W: Word>(key: [W; 4], reversed: W, position: &mut W) -> [W::Real; 3] {
    let mut at = Position::from_word(*position);
    at = at.open(at.singles.eq(W::splat(SINGLES)));
    let second = at.singles.eq(W::splat(1));
    (at.singles, at.pair) = (W::splat(SINGLES), W::splat(0));
    *position = at.word();
    let group = Group::new(key, reversed, at.groups);
    let [x, y] = group.pair();
    [group.single(second), x, y]
}

/// Applies Owen scrambling to a number whose most significant digit is the first after the binary
/// point.
#[inline(always)]
fn scramble<W: Word>(x: W, word: W) -> W {
    permute(x.reverse_bits(), word).reverse_bits()
}

/// Permutes words such that every bit depends on itself and the less significant ones only,
/// selected at random by `word`, after [Laine & Karras 2011]. Multiplying by an even number and
/// xoring lets a bit affect only those above it; the product with an odd number taken from the word
/// randomises each of these dependencies. The constants are the best of 600 random triples:
/// flipping a bit flips every bit above it with a probability that half a million random words
/// cannot distinguish from one half.
#[inline(always)]
fn permute<W: Word>(x: W, word: W) -> W {
    let x = x.add(word);
    let x = x.xor(x.mul(W::splat(0xa666_a200)));
    let x = x.mul(word.swap_halves().or(W::splat(1)));
    let x = x.xor(x.mul(W::splat(0xf160_de5c)));
    x.xor(x.mul(W::splat(0xa418_e192)))
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
#[inline(always)]
fn multiply<W: Word>(table: &Table, index: W) -> W {
    index.map_lanes(|index| {
        let [a, b, c, d] = index.to_le_bytes().map(usize::from);
        table[0][a] ^ table[1][b] ^ table[2][c] ^ table[3][d]
    })
}

/// Returns the second dimension, x + 1, in five steps: its matrix is Pascal's triangle modulo two,
/// a fivefold tensor product of a two by two matrix.
#[inline(always)]
fn dimension_1<W: Word>(index: W) -> W {
    let mut x = index.reverse_bits();
    x = x.xor(x.and(W::splat(0x5555_5555)).shl::<1>());
    x = x.xor(x.and(W::splat(0x3333_3333)).shl::<2>());
    x = x.xor(x.and(W::splat(0x0f0f_0f0f)).shl::<4>());
    x = x.xor(x.and(W::splat(0x00ff_00ff)).shl::<8>());
    x.xor(x.shl::<16>())
}

#[cfg(test)]
#[path = "sobol_tests.rs"]
pub mod tests;
