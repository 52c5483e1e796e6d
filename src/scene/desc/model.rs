//! The words among the parameters of a material.

/// What a material's opaque, metallic and refractive parts are made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Model {
    /// The adapted Disney BSDF.
    Disney,
    /// Ideal surfaces: Lambert, mirror and smooth dielectric, mixed by `metallic` and `opacity`; of the other
    /// parameters only base colour and `ior` have an effect.
    Lambert,
    /// A metal of the complex index `eta` and `k`; base colour and `specular` are factors on what it reflects.
    Conductor,
    /// A diffuse body of the base colour under a dielectric surface of index `ior`.
    Plastic,
    /// Glass of index `ior`, or a thin pane of it; what passes is tinted by the square root of the base colour.
    Dielectric,
}

impl Model {
    /// Every model, in the order of [`Model::WORDS`].
    pub const ALL: [Model; 5] = [Model::Disney, Model::Lambert, Model::Conductor, Model::Plastic, Model::Dielectric];

    /// The words for the models in scripts and scene files.
    pub const WORDS: &'static [&'static str] = &["disney", "lambert", "conductor", "plastic", "dielectric"];

    /// Its word.
    pub fn word(self) -> &'static str {
        Model::WORDS[self as usize]
    }
}

/// How the normals of the microfacets of the models `conductor`, `plastic` and `dielectric` are distributed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Distribution {
    /// The distribution of Trowbridge and Reitz, with long tails.
    Ggx,
    /// Slopes with the distribution of Gauss.
    Beckmann,
}

impl Distribution {
    /// Every distribution, in the order of [`Distribution::WORDS`].
    pub const ALL: [Distribution; 2] = [Distribution::Ggx, Distribution::Beckmann];

    /// The words for the distributions in scripts and scene files.
    pub const WORDS: &'static [&'static str] = &["ggx", "beckmann"];

    /// Its word.
    pub fn word(self) -> &'static str {
        Distribution::WORDS[self as usize]
    }
}

/// What a mask texture does to a hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MaskMode {
    /// A hit below the threshold is no hit.
    Threshold,
    /// A hit counts with the mask's value as probability, decided by a hash of ray and hit.
    Blend,
}

impl MaskMode {
    /// Every mode, in the order of [`MaskMode::WORDS`].
    pub const ALL: [MaskMode; 2] = [MaskMode::Threshold, MaskMode::Blend];

    /// The words for the modes in scripts and scene files.
    pub const WORDS: &'static [&'static str] = &["threshold", "blend"];

    /// Its word.
    pub fn word(self) -> &'static str {
        MaskMode::WORDS[self as usize]
    }
}
