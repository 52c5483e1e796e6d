//! Samplers: sources of random numbers, keyed by seed, pixel, sample and dimension.
//!
//! A sampler holds the numbers of one sample of one pixel. An integrator takes them in the order in
//! which it needs them. Numbers that one event needs together are best taken one after the other,
//! single ones first and the pair last, such as "lobe, then direction": [`Sobol`] then stratifies
//! all three together over the samples of the pixel.

mod independent;
mod sobol;

pub use independent::Independent;
pub use sobol::Sobol;

use crate::math::rng::pcg4d;

/// The numbers of one sample of one pixel. A number depends only on the key and on how many were
/// taken before, so any range of samples has the same numbers in any grouping into waves and on any
/// thread.
#[derive(Clone, Debug)]
pub enum Sampler {
    /// Independent uniform numbers.
    Independent(Independent),
    /// Numbers stratified over the samples of a pixel.
    Sobol(Sobol),
}

impl Sampler {
    /// Starts independent numbers, those of [`INDEPENDENT`].
    #[inline]
    pub fn new(seed: u64, pixel: [u32; 2], sample: u64) -> Sampler {
        Sampler::Independent(Independent::new(seed, pixel, sample))
    }

    /// Starts numbers of the Owen-scrambled Sobol sequence, those of [`SOBOL`].
    #[inline]
    pub fn sobol(seed: u64, pixel: [u32; 2], sample: u64) -> Sampler {
        Sampler::Sobol(Sobol::new(seed, pixel, sample))
    }

    /// Returns the next number, in `[0, 1)`.
    #[inline]
    pub fn next_1d(&mut self) -> f32 {
        match self {
            Sampler::Independent(s) => s.next_1d(),
            Sampler::Sobol(s) => s.next_1d(),
        }
    }

    /// Returns the next two numbers, each in `[0, 1)`, for a decision in two dimensions.
    #[inline]
    pub fn next_2d(&mut self) -> [f32; 2] {
        match self {
            Sampler::Independent(s) => [s.next_1d(), s.next_1d()],
            Sampler::Sobol(s) => s.next_2d(),
        }
    }

    /// Returns an auxiliary stream, independent of this sampler's numbers and of each other; taking
    /// from it changes none of the sampler's own numbers. It depends only on the sample, not on how
    /// many numbers were taken.
    #[inline]
    pub fn auxiliary(&self) -> Independent {
        let key = match self {
            Sampler::Independent(s) => s.key(),
            Sampler::Sobol(s) => s.key_of_sample(),
        };
        Independent::from_key(pcg4d([key[0] ^ AUXILIARY_KEY, key[1], key[2], key[3]]))
    }
}

/// Distinguishes the key of the [auxiliary stream](Sampler::auxiliary) from the sampler's own.
const AUXILIARY_KEY: u32 = 0x7f4a_7c15;

/// Starts the numbers of one sample of one pixel.
pub type StartFn = fn(seed: u64, pixel: [u32; 2], sample: u64) -> Sampler;

/// One sampler of [`SAMPLERS`].
#[derive(Debug)]
pub struct SamplerRow {
    /// Name in scripts and columns.
    pub name: &'static str,
    /// Revision, raised whenever the numbers change; part of every run's identity.
    pub revision: u32,
    /// Description in one sentence, with its source.
    pub doc: &'static str,
    /// Starts the numbers of a sample.
    pub start: StartFn,
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
        start: Sampler::new,
    },
    SamplerRow {
        name: "sobol",
        revision: 1,
        doc: "The Owen-scrambled Sobol sequence, padded by shuffling [Burley 2020]: mostly less \
              error from the same number of samples. Standard errors of pixels take samples for \
              independent, so they are mostly too large.",
        start: Sampler::sobol,
    },
];

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
