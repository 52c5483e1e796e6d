//! Enumerated material parameters and their names in scripts and scene files.

use serde::{Deserialize, Serialize};

use super::TextureFilter;

crate::named! {
    /// Scattering model of a material.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
    pub enum Model {
        /// The adapted Disney BSDF.
        Disney = "disney",
        /// Ideal surfaces: Lambert, mirror and smooth dielectric, mixed by `metallic` and
        /// `opacity`. The only other parameters with an effect are base colour and `ior`.
        Lambert = "lambert",
        /// A metal with the complex index `eta` + i `k`. Base colour and `specular` scale its
        /// reflection.
        Conductor = "conductor",
        /// A diffuse base of the base colour under a dielectric interface of index `ior`.
        Plastic = "plastic",
        /// Glass of index `ior`, or a thin pane of it. Transmission is tinted by the square root of
        /// the base colour.
        Dielectric = "dielectric",
        /// A thin diffuse sheet, such as paper, cloth or a leaf: it reflects by the base colour,
        /// and transmits by `transmittance`.
        Translucent = "translucent",
        /// An opaque, rough diffuse surface of the base colour, such as plaster or clay. The only
        /// other parameter with an effect is `roughness`.
        OrenNayar = "oren_nayar",
    }
}

impl Model {
    /// Returns whether the model has specular microfacets, so that anisotropy has an effect.
    pub fn has_microfacets(self) -> bool {
        !matches!(self, Model::Lambert | Model::Translucent | Model::OrenNayar)
    }

    /// Returns whether roughness has an effect.
    pub fn has_roughness(self) -> bool {
        self.has_microfacets() || self == Model::OrenNayar
    }

    /// Returns whether textures of `metallic` and `opacity` are looked up.
    pub fn has_mixture(self) -> bool {
        !matches!(self, Model::Translucent | Model::OrenNayar)
    }
}

crate::named! {
    /// Distribution of microfacet normals for the models `conductor`, `plastic` and `dielectric`.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
    pub enum Distribution {
        /// Trowbridge-Reitz (GGX) distribution, with long tails.
        Ggx = "ggx",
        /// Beckmann distribution: Gaussian slopes.
        Beckmann = "beckmann",
    }
}

crate::named! {
    /// Meaning of the texels of a roughness texture, between which it is interpolated.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
    pub enum RoughnessTexels {
        /// The parameter `roughness`.
        #[default]
        Roughness = "roughness",
        /// Its square, the width of the distribution of normals.
        Alpha = "alpha",
    }
}

crate::named! {
    /// Renderer whose formulas a material follows where renderers differ.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
    pub enum Formulas {
        /// Those of this program.
        #[default]
        Lumbre = "lumbre",
        /// Mitsuba 3: see the material parameter `formulas`.
        Mitsuba = "mitsuba",
    }
}

crate::named! {
    /// Effect of a mask texture on a hit.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
    pub enum MaskMode {
        /// Discards hits where the mask is below the threshold.
        Threshold = "threshold",
        /// Accepts a hit with the mask's value as probability, decided by a hash of ray and hit.
        Blend = "blend",
    }
}

crate::named! {
    /// Filter of a material's textures, or the choice of each texture's own.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
    pub enum FilterChoice {
        /// Every texture has the filter that its file or script gives.
        #[default]
        Given = "given",
        /// All textures are [bilinear](TextureFilter::Bilinear).
        Bilinear = "bilinear",
        /// All textures take the [nearest](TextureFilter::Nearest) texel.
        Nearest = "nearest",
    }
}

impl FilterChoice {
    /// Returns the filter of a texture whose own filter is `given`.
    pub fn apply(self, given: TextureFilter) -> TextureFilter {
        match self {
            FilterChoice::Given => given,
            FilterChoice::Bilinear => TextureFilter::Bilinear,
            FilterChoice::Nearest => TextureFilter::Nearest,
        }
    }
}

crate::named! {
    /// Normals with which a surface is shaded.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
    pub enum ShadingNormals {
        /// Normals of the vertices, interpolated, with normal and bump maps.
        #[default]
        Smooth = "smooth",
        /// The geometric normal of each triangle.
        Flat = "flat",
    }
}
