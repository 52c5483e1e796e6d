//! Enumerated material parameters and their names in scripts and scene files.

use serde::{Deserialize, Serialize};

use super::TextureFilter;

/// Scattering model of a material.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Model {
    /// The adapted Disney BSDF.
    Disney,
    /// Ideal surfaces: Lambert, mirror and smooth dielectric, mixed by `metallic` and `opacity`.
    /// The only other parameters with an effect are base colour and `ior`.
    Lambert,
    /// A metal with the complex index `eta` + i `k`. Base colour and `specular` scale its
    /// reflection.
    Conductor,
    /// A diffuse base of the base colour under a dielectric interface of index `ior`.
    Plastic,
    /// Glass of index `ior`, or a thin pane of it. Transmission is tinted by the square root of the
    /// base colour.
    Dielectric,
    /// A thin diffuse sheet, such as paper, cloth or a leaf: it reflects by the base colour, and
    /// transmits by `transmittance`.
    Translucent,
}

impl Model {
    /// Every model, in the order of [`Model::NAMES`].
    pub const ALL: [Model; 6] = [
        Model::Disney,
        Model::Lambert,
        Model::Conductor,
        Model::Plastic,
        Model::Dielectric,
        Model::Translucent,
    ];

    /// Names of the models in scripts and scene files.
    pub const NAMES: &'static [&'static str] = &[
        "disney",
        "lambert",
        "conductor",
        "plastic",
        "dielectric",
        "translucent",
    ];

    /// Returns whether roughness and anisotropy have an effect.
    pub fn has_microfacets(self) -> bool {
        !matches!(self, Model::Lambert | Model::Translucent)
    }

    /// Returns the name of the model.
    pub fn name(self) -> &'static str {
        Model::NAMES[self as usize]
    }
}

/// Distribution of microfacet normals for the models `conductor`, `plastic` and `dielectric`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Distribution {
    /// Trowbridge-Reitz (GGX) distribution, with long tails.
    Ggx,
    /// Beckmann distribution: Gaussian slopes.
    Beckmann,
}

impl Distribution {
    /// Every distribution, in the order of [`Distribution::NAMES`].
    pub const ALL: [Distribution; 2] = [Distribution::Ggx, Distribution::Beckmann];

    /// Names of the distributions in scripts and scene files.
    pub const NAMES: &'static [&'static str] = &["ggx", "beckmann"];

    /// Returns the name of the distribution.
    pub fn name(self) -> &'static str {
        Distribution::NAMES[self as usize]
    }
}

/// Effect of a mask texture on a hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum MaskMode {
    /// Discards hits where the mask is below the threshold.
    Threshold,
    /// Accepts a hit with the mask's value as probability, decided by a hash of ray and hit.
    Blend,
}

impl MaskMode {
    /// Every mode, in the order of [`MaskMode::NAMES`].
    pub const ALL: [MaskMode; 2] = [MaskMode::Threshold, MaskMode::Blend];

    /// Names of the modes in scripts and scene files.
    pub const NAMES: &'static [&'static str] = &["threshold", "blend"];

    /// Returns the name of the mode.
    pub fn name(self) -> &'static str {
        MaskMode::NAMES[self as usize]
    }
}

/// Filter of a material's textures, or the choice of each texture's own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum FilterChoice {
    /// Every texture has the filter that its file or script gives.
    #[default]
    Given,
    /// All textures are [bilinear](TextureFilter::Bilinear).
    Bilinear,
    /// All textures take the [nearest](TextureFilter::Nearest) texel.
    Nearest,
}

impl FilterChoice {
    /// Every choice, in the order of [`FilterChoice::NAMES`].
    pub const ALL: [FilterChoice; 3] = [
        FilterChoice::Given,
        FilterChoice::Bilinear,
        FilterChoice::Nearest,
    ];

    /// Names of the choices in scripts and scene files.
    pub const NAMES: &'static [&'static str] = &["given", "bilinear", "nearest"];

    /// Returns the name of the choice.
    pub fn name(self) -> &'static str {
        FilterChoice::NAMES[self as usize]
    }

    /// Returns the filter of a texture whose own filter is `given`.
    pub fn apply(self, given: TextureFilter) -> TextureFilter {
        match self {
            FilterChoice::Given => given,
            FilterChoice::Bilinear => TextureFilter::Bilinear,
            FilterChoice::Nearest => TextureFilter::Nearest,
        }
    }
}

/// Normals with which a surface is shaded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum ShadingNormals {
    /// Normals of the vertices, interpolated, with normal and bump maps.
    #[default]
    Smooth,
    /// The geometric normal of each triangle.
    Flat,
}

impl ShadingNormals {
    /// Both kinds, in the order of [`ShadingNormals::NAMES`].
    pub const ALL: [ShadingNormals; 2] = [ShadingNormals::Smooth, ShadingNormals::Flat];

    /// Names of the kinds in scripts and scene files.
    pub const NAMES: &'static [&'static str] = &["smooth", "flat"];

    /// Returns the name of the kind.
    pub fn name(self) -> &'static str {
        ShadingNormals::NAMES[self as usize]
    }
}
