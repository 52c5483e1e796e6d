//! Sources of sample numbers, keyed by seed, pixel, sample and dimension.
//!
//! A sampler is the numbers of one sample of one pixel. An integrator takes them in whatever order it needs them;
//! numbers that one event needs together are best taken one after the other, single ones first and the pair last, as in
//! "which lobe, then which direction": [`Sobol`] then spreads all three together over the samples of the pixel.

mod independent;
mod sobol;

pub use independent::Independent;
pub use sobol::Sobol;

use crate::math::rng::pcg4d;

/// The numbers of one sample of one pixel. Nothing but key and order decides a number, so that any range of samples has
/// the same numbers in any grouping into waves and on any thread.
#[derive(Clone, Debug)]
pub enum Sampler {
    /// Independent uniform numbers.
    Independent(Independent),
    /// Numbers that are spread evenly over the samples of a pixel.
    Sobol(Sobol),
}

impl Sampler {
    /// Independent numbers, those of [`INDEPENDENT`].
    #[inline]
    pub fn new(seed: u64, pixel: [u32; 2], sample: u64) -> Sampler {
        Sampler::Independent(Independent::new(seed, pixel, sample))
    }

    /// Numbers of the Owen-scrambled sequence, those of [`SOBOL`].
    #[inline]
    pub fn sobol(seed: u64, pixel: [u32; 2], sample: u64) -> Sampler {
        Sampler::Sobol(Sobol::new(seed, pixel, sample))
    }

    /// The next number, in `[0, 1)`.
    #[inline]
    pub fn next_1d(&mut self) -> f32 {
        match self {
            Sampler::Independent(s) => s.next_1d(),
            Sampler::Sobol(s) => s.next_1d(),
        }
    }

    /// The next two numbers, each in `[0, 1)`, for a decision in two dimensions.
    #[inline]
    pub fn next_2d(&mut self) -> [f32; 2] {
        match self {
            Sampler::Independent(s) => [s.next_1d(), s.next_1d()],
            Sampler::Sobol(s) => s.next_2d(),
        }
    }

    /// Numbers beside these, independent of them and of each other: what takes them changes none of the sampler's own. They
    /// are those of the same sample wherever the sampler stands.
    #[inline]
    pub fn aside(&self) -> Independent {
        let key = match self {
            Sampler::Independent(s) => s.key(),
            Sampler::Sobol(s) => s.key_of_sample(),
        };
        Independent::keyed(pcg4d([key[0] ^ ASIDE, key[1], key[2], key[3]]))
    }
}

/// Tells the numbers [beside](Sampler::aside) a sampler's own from them.
const ASIDE: u32 = 0x7f4a_7c15;

/// Starts the numbers of one sample of one pixel.
pub type StartFn = fn(seed: u64, pixel: [u32; 2], sample: u64) -> Sampler;

/// One row of [`SAMPLERS`].
#[derive(Debug)]
pub struct SamplerRow {
    /// The name in scripts and columns.
    pub name: &'static str,
    /// Raised whenever its numbers change; part of every run's identity.
    pub revision: u32,
    /// What it does, in a sentence, with its source.
    pub doc: &'static str,
    /// Starts a sample.
    pub start: StartFn,
}

/// The row of independent numbers.
pub const INDEPENDENT: &SamplerRow = &SAMPLERS[0];

/// The row of the Owen-scrambled sequence.
pub const SOBOL: &SamplerRow = &SAMPLERS[1];

/// Every sampler there is; the first is what a script gets that asks for none.
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
        doc: "The Owen-scrambled Sobol sequence, padded by shuffling [Burley 2020]: mostly less error from the same \
              number of samples. Standard errors of pixels take samples for independent, so they are mostly too large.",
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

/// The row with this name.
pub fn sampler(name: &str) -> Option<&'static SamplerRow> {
    SAMPLERS.iter().find(|row| row.name == name)
}
