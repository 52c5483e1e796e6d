//! Sobol's sequence over samples and pixels together [Ahmed & Wonka 2020].
//!
//! [`sobol`](super::sobol) gives every pixel a sequence of its own. Here all pixels share one: the
//! samples of a block take consecutive points of it, first those of one pixel, then those of the
//! next in Morton order. Every group of numbers permutes the indices of its points as Owen does,
//! which here orders both halves of every aligned square of pixels at random. So in each such
//! square the points of a block are as even as those of one pixel, the errors of neighbouring
//! pixels have different signs more often than not, and their sum is small: the error is blue
//! noise, which the eye and filters remove best.
//!
//! A block has a power of two of samples of every pixel, and each block its own scrambling. After
//! one block the numbers of a pixel are as even as those of `sobol`; before its end, pixels are as
//! independent as there, and later blocks are independent of earlier ones. So blocks should have as
//! many samples as the picture. Pictures are divided into tiles of [`TILE`] x [`TILE`] pixels, each
//! with sequences of its own.
//!
//! The numbers of one pixel are uniform and, by group, independent, so the mean of a picture does
//! not change. Those of different pixels are dependent on purpose: standard errors that take pixels
//! for independent are too large for sums over neighbouring ones.

use crate::math::real::Word;
use crate::math::rng::pcg4d;

/// Binary digits of a coordinate within its tile.
const TILE_BITS: u32 = 11;

/// Pixels along each side of a tile.
const TILE: u32 = 1 << TILE_BITS;

/// Greatest number of samples of a pixel in a block: a word holds an index of a tile's block.
pub const LARGEST_BLOCK: u32 = 1 << (32 - 2 * TILE_BITS);

/// Returns the key and the index, digits reversed, of one sample of one pixel in its sequence, for
/// the functions of [`sobol`](super::sobol). `sample` is given by its lower and its upper word;
/// `block` is a power of two up to [`LARGEST_BLOCK`].
#[inline(always)]
pub fn start<W: Word>(seed: u64, block: u32, [x, y]: [W; 2], [low, high]: [W; 2]) -> ([W; 4], W) {
    let within = low.and(W::splat(block - 1));
    let key = pcg4d([
        x.shr::<TILE_BITS>().or(y.shr::<TILE_BITS>().shl::<16>()),
        W::splat(seed as u32),
        low.sub(within),
        W::splat((seed >> 32) as u32).xor(high.swap_halves()),
    ]);
    let index = morton([x, y]).mul(W::splat(block)).add(within);
    (key, index.reverse_bits())
}

/// Returns the index of a pixel in the Morton order of its tile.
#[inline(always)]
fn morton<W: Word>([x, y]: [W; 2]) -> W {
    spread(x).or(spread(y).shl::<1>())
}

/// Returns the lower digits of a coordinate with a zero after each.
#[inline(always)]
fn spread<W: Word>(x: W) -> W {
    let x = x.and(W::splat(TILE - 1));
    let x = x.or(x.shl::<8>()).and(W::splat(0x00ff_00ff));
    let x = x.or(x.shl::<4>()).and(W::splat(0x0f0f_0f0f));
    let x = x.or(x.shl::<2>()).and(W::splat(0x3333_3333));
    x.or(x.shl::<1>()).and(W::splat(0x5555_5555))
}

#[cfg(test)]
#[path = "zsobol_tests.rs"]
mod tests;
