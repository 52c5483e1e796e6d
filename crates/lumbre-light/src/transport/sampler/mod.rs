//! Samplers: sources of random numbers, keyed by seed, pixel, sample and dimension.
//!
//! A sampler holds the numbers of one sample of one pixel. An integrator takes them in the order in
//! which it needs them. Numbers that one event needs together are best taken one after the other,
//! single ones first and the pair last, such as "lobe, then direction": Sobol's sequence then stratifies
//! all three together over the samples of the pixel, or of the pixel and its neighbours.

pub mod independent;
mod sobol;
mod zsobol;

use crate::math::real::{Real, Word};
use crate::math::rng::pcg4d;

/// The numbers of one sample of one pixel, or of one in each lane. A number depends only on the key
/// and on how many were taken before, so any range of samples has the same numbers in any grouping
/// into waves and on any thread.
#[derive(Clone, Copy, Debug)]
pub struct Sampler<R: Real = f32> {
    sequence: Sequence,
    key: [R::Word; 4],
    index: R::Word,
    taken: R::Word,
}

/// Sequence of the numbers of a [`Sampler`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sequence {
    /// Independent uniform numbers.
    Independent,
    /// Numbers stratified over the samples of a pixel.
    Sobol,
    /// Numbers stratified over the samples of neighbouring pixels, as many of each as a block has: a
    /// power of two up to [`LARGEST_BLOCK`](zsobol::LARGEST_BLOCK).
    Zsobol {
        /// Number of samples of a pixel in a block.
        block: u32,
    },
}

impl Sampler {
    /// Starts independent numbers, those of [`INDEPENDENT`].
    #[inline]
    pub fn new(seed: u64, pixel: [u32; 2], sample: u64) -> Sampler {
        INDEPENDENT.start(seed, pixel, sample)
    }

    /// Starts numbers of the Owen-scrambled Sobol sequence, those of [`SOBOL`].
    #[inline]
    pub fn sobol(seed: u64, pixel: [u32; 2], sample: u64) -> Sampler {
        SOBOL.start(seed, pixel, sample)
    }
}

impl<R: Real> Sampler<R> {
    /// Starts the numbers of one sample of one pixel in each lane. `sample` is given by its lower
    /// and its upper word.
    #[inline(always)]
    pub fn start(
        sequence: Sequence,
        seed: u64,
        pixel: [R::Word; 2],
        sample: [R::Word; 2],
    ) -> Sampler<R> {
        let [low, high] = sample;
        let (key, index) = match sequence {
            Sequence::Independent => (
                pcg4d(independent::key_input(seed, pixel, sample)),
                R::Word::splat(0),
            ),
            Sequence::Sobol => (sobol::key(seed, pixel, high), low.reverse_bits()),
            Sequence::Zsobol { block } => zsobol::start(seed, block, pixel, sample),
        };
        Sampler::resume(sequence, key, index, R::Word::splat(0))
    }

    /// Resumes numbers from the words that [`Sampler::key`], [`Sampler::index`] and
    /// [`Sampler::taken`] returned.
    #[inline(always)]
    pub fn resume(
        sequence: Sequence,
        key: [R::Word; 4],
        index: R::Word,
        taken: R::Word,
    ) -> Sampler<R> {
        Sampler {
            sequence,
            key,
            index,
            taken,
        }
    }

    /// Returns the key: that of the sample, or of the pixel's sequence.
    #[inline(always)]
    pub fn key(&self) -> [R::Word; 4] {
        self.key
    }

    /// Returns the index of the sample in its sequence, digits reversed; zero for independent
    /// numbers.
    #[inline(always)]
    pub fn index(&self) -> R::Word {
        self.index
    }

    /// Returns the position in the numbers of the sample: for independent ones, how many were
    /// taken.
    #[inline(always)]
    pub fn taken(&self) -> R::Word {
        self.taken
    }

    /// Returns the next number, in `[0, 1)`.
    #[inline(always)]
    pub fn next_1d(&mut self) -> R {
        match self.sequence {
            Sequence::Independent => {
                let number = independent::next_one(self.key, self.taken);
                self.taken = self.taken.add(R::Word::splat(1));
                number
            }
            Sequence::Sobol | Sequence::Zsobol { .. } => {
                sobol::next_one(self.key, self.index, &mut self.taken)
            }
        }
    }

    /// Returns the next two numbers, each in `[0, 1)`, for a decision in two dimensions.
    #[inline(always)]
    pub fn next_2d(&mut self) -> [R; 2] {
        match self.sequence {
            Sequence::Independent => {
                let numbers = independent::next_two(self.key, self.taken);
                self.taken = self.taken.add(R::Word::splat(2));
                numbers
            }
            Sequence::Sobol | Sequence::Zsobol { .. } => {
                sobol::next_two(self.key, self.index, &mut self.taken)
            }
        }
    }

    /// Returns the next number and the next two after it: cheaper than one call for each.
    #[inline(always)]
    pub fn next_three(&mut self) -> [R; 3] {
        match self.sequence {
            Sequence::Independent => {
                let numbers = independent::next_three(self.key, self.taken);
                self.taken = self.taken.add(R::Word::splat(3));
                numbers
            }
            Sequence::Sobol | Sequence::Zsobol { .. } => {
                sobol::next_three(self.key, self.index, &mut self.taken)
            }
        }
    }

    /// Takes back the numbers that were taken since `before`, except in the lanes of `mask`.
    #[inline(always)]
    pub fn keep(&mut self, mask: R::Mask, before: &Sampler<R>) {
        self.taken = R::Word::select(mask, self.taken, before.taken);
    }

    /// Resumes independent numbers of a key after `taken` of them.
    #[inline(always)]
    pub fn independent(key: [R::Word; 4], taken: R::Word) -> Sampler<R> {
        Sampler::resume(Sequence::Independent, key, R::Word::splat(0), taken)
    }

    /// Returns an auxiliary stream, independent of this sampler's numbers and of each other; taking
    /// from it changes none of the sampler's own numbers. It depends only on the sample, not on how
    /// many numbers were taken.
    #[inline(always)]
    pub fn auxiliary(&self) -> Sampler<R> {
        self.auxiliary_after(R::Word::splat(0))
    }

    /// Returns the [auxiliary stream](Sampler::auxiliary) after `taken` of its numbers.
    #[inline(always)]
    pub fn auxiliary_after(&self, taken: R::Word) -> Sampler<R> {
        let [a, b, c, d] = match self.sequence {
            Sequence::Independent => self.key,
            Sequence::Sobol | Sequence::Zsobol { .. } => {
                let [a, b, c, d] = self.key;
                pcg4d([a, b, c.xor(self.index), d])
            }
        };
        let key = pcg4d([a.xor(R::Word::splat(AUXILIARY_KEY)), b, c, d]);
        Sampler::independent(key, taken)
    }
}

/// Distinguishes the key of the [auxiliary stream](Sampler::auxiliary) from the sampler's own.
const AUXILIARY_KEY: u32 = 0x7f4a_7c15;

/// Returns the word of a key that holds the lower half of the seed and the upper halves of the
/// pixel's coordinates.
#[inline(always)]
fn seed_and_upper_halves<W: Word>(seed: u64, [x, y]: [W; 2]) -> W {
    let upper = x.shr::<16>().shl::<8>();
    W::splat(seed as u32).xor(upper).xor(y.shr::<16>())
}

/// One sampler of [`SAMPLERS`].
#[derive(Debug)]
pub struct SamplerRow {
    /// Name in scripts and columns.
    pub name: &'static str,
    /// Revision, raised whenever the numbers change; part of every run's identity.
    pub revision: u32,
    /// Description in one sentence, with its source.
    pub doc: &'static str,
    /// Sequence of its numbers.
    pub sequence: Sequence,
}

impl SamplerRow {
    /// Starts the numbers of one sample of one pixel.
    #[inline]
    pub fn start(&self, seed: u64, pixel: [u32; 2], sample: u64) -> Sampler {
        let words = [sample as u32, (sample >> 32) as u32];
        Sampler::start(self.sequence, seed, pixel, words)
    }
}

/// The sampler of independent numbers.
pub const INDEPENDENT: &SamplerRow = &SAMPLERS[0];

/// The sampler of the Owen-scrambled Sobol sequence.
pub const SOBOL: &SamplerRow = &SAMPLERS[1];

/// All samplers; the first is the default of scripts.
pub const SAMPLERS: &[SamplerRow] = &[
    SamplerRow {
        name: "independent",
        revision: 1,
        doc: "Independent uniform numbers, a hash of their key [Jarzynski & Olano 2020].",
        sequence: Sequence::Independent,
    },
    SamplerRow {
        name: "sobol",
        revision: 1,
        doc: "The Owen-scrambled Sobol sequence, padded by shuffling [Burley 2020]: mostly less \
              error from the same number of samples. Standard errors of pixels take samples for \
              independent, so they are mostly too large.",
        sequence: Sequence::Sobol,
    },
    zsobol_row("zsobol1", 1),
    zsobol_row("zsobol4", 4),
    zsobol_row("zsobol16", 16),
    zsobol_row("zsobol64", 64),
];

/// Returns the sampler of one Owen-scrambled Sobol sequence over all pixels, in blocks.
const fn zsobol_row(name: &'static str, block: u32) -> SamplerRow {
    assert!(block.is_power_of_two() && block <= zsobol::LARGEST_BLOCK);
    SamplerRow {
        name,
        revision: 1,
        doc: "One Owen-scrambled Sobol sequence over all pixels in Morton order [Ahmed & Wonka 2020], \
              for pictures of as many samples as its name ends with: errors of neighbouring pixels \
              cancel, so an eye or a filter sees less of them. Standard errors are mostly too large.",
        sequence: Sequence::Zsobol { block },
    }
}

/// Names of the samplers, in the order of [`SAMPLERS`].
pub const SAMPLER_NAMES: [&str; SAMPLERS.len()] = {
    let mut names = [""; SAMPLERS.len()];
    let mut i = 0;
    while i < names.len() {
        names[i] = SAMPLERS[i].name;
        i += 1;
    }
    names
};

/// Returns the sampler with this name.
pub fn sampler(name: &str) -> Option<&'static SamplerRow> {
    SAMPLERS.iter().find(|row| row.name == name)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn auxiliary_numbers_differ_between_samples_pixels_and_seeds() {
        for row in SAMPLERS {
            let mut seen = BTreeSet::new();
            for seed in 0..4 {
                for pixel in [[0, 0], [1, 0], [0, 1]] {
                    for sample in 0..16 {
                        let mut numbers = row.start(seed, pixel, sample).auxiliary();
                        let first: f32 = numbers.next_1d();
                        seen.insert(first.to_bits());
                    }
                }
            }
            // Two of 192 numbers of 24 bits are equal with a probability of 0.1 %.
            assert_eq!(seen.len(), 4 * 3 * 16, "{}", row.name);
        }
    }

    #[test]
    fn auxiliary_numbers_do_not_depend_on_the_numbers_taken() {
        for row in SAMPLERS {
            let mut sampler = row.start(7, [3, 5], 2);
            let before: f32 = sampler.auxiliary().next_1d();
            sampler.next_three();
            let after: f32 = sampler.auxiliary().next_1d();
            assert_eq!(before, after, "{}", row.name);
        }
    }
}
