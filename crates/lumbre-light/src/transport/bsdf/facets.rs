//! Microfacets of either distribution, for the models `conductor`, `plastic` and `dielectric`.

use super::beckmann::Beckmann;
use super::ggx::Ggx;
use crate::math::real::{Real, Vector};
use crate::scene::compile::Distribution;

/// Microfacets of a surface, scalar or vectorised; all lanes have the same distribution.
#[derive(Clone, Copy, Debug)]
pub struct Facets<R: Real = f32> {
    /// Distribution of the normals.
    pub distribution: Distribution,
    /// Roughness along the tangent and the bitangent.
    pub alpha: [R; 2],
    /// Whether the surface is smooth instead: its reflection is a Dirac lobe.
    pub smooth: R::Mask,
}

impl<R: Real> Facets<R> {
    /// Returns the density of normals per solid angle and area.
    #[inline(always)]
    pub fn d(&self, h: R::Vec3) -> R {
        let alpha = self.alpha;
        match self.distribution {
            Distribution::Ggx => Ggx { alpha }.d(h),
            Distribution::Beckmann => Beckmann { alpha }.d(h),
        }
    }

    /// Returns Smith's masking over the cosine.
    #[inline(always)]
    pub fn masking_over_cos(&self, w: R::Vec3) -> R {
        let alpha = self.alpha;
        match self.distribution {
            Distribution::Ggx => Ggx { alpha }.masking_over_cos(w),
            Distribution::Beckmann => Beckmann { alpha }.masking_over_cos(w),
        }
    }

    /// Samples a normal that is visible from `wo`.
    #[inline(always)]
    pub fn sample(&self, wo: R::Vec3, u: [R; 2]) -> R::Vec3 {
        let alpha = self.alpha;
        match self.distribution {
            Distribution::Ggx => Ggx { alpha }.sample(wo, u),
            Distribution::Beckmann => Beckmann { alpha }.sample(wo, u),
        }
    }
}

/// Returns the mirror image of `o` about `h`.
#[inline(always)]
pub fn mirrored<V: Vector>(o: V, h: V) -> V {
    h * (V::Scalar::splat(2.0) * o.dot(h)) - o
}
