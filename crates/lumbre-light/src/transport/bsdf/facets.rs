//! Microfacets of either distribution, for the models `conductor`, `plastic` and `dielectric`.

use glam::Vec3;

use super::beckmann::Beckmann;
use super::ggx::Ggx;
use crate::math::real::{Real, Vector};
use crate::scene::compile::Distribution;

/// A distribution of microfacets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Facets {
    /// The GGX (Trowbridge-Reitz) distribution.
    Ggx(Ggx),
    /// The Beckmann distribution: Gaussian slopes.
    Beckmann(Beckmann),
}

impl Facets {
    /// Builds microfacets from the parameters `distribution`, `roughness` and `anisotropic`; alpha
    /// is the same for both distributions.
    #[inline]
    pub fn new(distribution: Distribution, roughness: f32, anisotropic: f32) -> Facets {
        let ggx = Ggx::new(roughness, anisotropic);
        match distribution {
            Distribution::Ggx => Facets::Ggx(ggx),
            Distribution::Beckmann => Facets::Beckmann(Beckmann { alpha: ggx.alpha }),
        }
    }

    /// Returns the density of normals per solid angle and area.
    #[inline]
    pub fn d(&self, h: Vec3) -> f32 {
        match self {
            Facets::Ggx(f) => f.d(h),
            Facets::Beckmann(f) => f.d(h),
        }
    }

    /// Returns Smith's masking over the cosine.
    #[inline]
    pub fn masking_over_cos(&self, w: Vec3) -> f32 {
        match self {
            Facets::Ggx(f) => f.masking_over_cos(w),
            Facets::Beckmann(f) => f.masking_over_cos(w),
        }
    }

    /// Returns the density of [`Facets::sample`] over `wo . h`.
    #[inline]
    pub fn pdf_over_dot(&self, wo: Vec3, h: Vec3) -> f32 {
        self.masking_over_cos(wo) * self.d(h)
    }

    /// Samples a normal that is visible from `wo`.
    #[inline]
    pub fn sample(&self, wo: Vec3, u: [f32; 2]) -> Vec3 {
        match self {
            Facets::Ggx(f) => f.sample(wo, u),
            Facets::Beckmann(f) => f.sample(wo, u),
        }
    }
}

/// Returns the mirror image of `o` about `h`.
#[inline(always)]
pub fn mirrored<V: Vector>(o: V, h: V) -> V {
    h * (V::Scalar::splat(2.0) * o.dot(h)) - o
}
