//! The BSDF of a single surface: [`Bsdf`] with one lane.

use glam::Vec3;

use super::local::LocalBsdf;
use super::material::{BsdfClass, MaterialConstants};
use super::{Bsdf, BsdfSample, BsdfValue, Orientation, Outgoing, TransportMode};
use crate::scene::compile::Texture;
use crate::transport::surface::Surface;

impl Bsdf {
    /// Builds the BSDF of a surface.
    #[inline]
    pub fn new(surface: &Surface, textures: &[Texture]) -> Bsdf {
        let at = Orientation {
            n_geometric: surface.n_geometric,
            n_shading: surface.n_shading,
            tangent: (surface.tangent != Vec3::ZERO).then_some(surface.tangent),
            terminator: surface.terminator.is_some(),
        };
        let m = surface.materials[0];
        Bsdf::with_parameters(
            &at,
            &BsdfClass::of(m),
            &MaterialConstants::new(m),
            &surface.shading_parameters(textures),
        )
    }

    /// Returns the value `f` without cosine, of the lobes that have a density: Dirac lobes evaluate
    /// to zero. For [`TransportMode::Importance`] see [`Bsdf::values`].
    #[inline]
    pub fn eval(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> Vec3 {
        let Some((o, i)) = self.local_pair(wo, wi, mode) else {
            return Vec3::ZERO;
        };
        let f = self.model.value(o, i, mode).0;
        match mode {
            TransportMode::Radiance => f,
            TransportMode::Importance => f * self.adjoint([wo, wi], [o.z, i.z]),
        }
    }

    /// Returns the density per solid angle with which [`Bsdf::sample`] returns `wi`, without Dirac
    /// lobes.
    #[inline]
    pub fn pdf_w(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.local_pair(wo, wi, TransportMode::Radiance)
            .map_or(0.0, |(o, i)| {
                self.model.value(o, i, TransportMode::Radiance).1
            })
    }

    /// Returns value and both densities at once, which is much cheaper than one by one.
    #[inline]
    pub fn evaluate(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> BsdfValue {
        self.values::<true>(&self.outgoing(wo), wi, mode, true)
    }

    /// Samples a direction; `None` if nothing is reflected. See [`Bsdf::samples`].
    #[inline]
    pub fn sample(&self, wo: Vec3, u: f32, v: [f32; 2], mode: TransportMode) -> Option<BsdfSample> {
        self.sample_from(&self.outgoing(wo), u, v, mode)
    }

    /// Samples a direction for a precomputed `out`.
    #[inline]
    pub fn sample_from(
        &self,
        out: &Outgoing,
        u: f32,
        v: [f32; 2],
        mode: TransportMode,
    ) -> Option<BsdfSample> {
        if !out.same_side {
            return None;
        }
        let (some, sample, _) = self.samples::<false>(out, u, v, mode);
        some.then_some(sample)
    }

    /// Returns both directions in the local frame if the geometric surface allows light between
    /// them: see [`Bsdf::values`].
    #[inline]
    fn local_pair(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> Option<(Vec3, Vec3)> {
        let (o, i) = (self.frame.to_local(wo), self.frame.to_local(wi));
        let above = self.terminator && mode == TransportMode::Radiance && o.z * i.z > 0.0;
        (self.same_side(wo, o.z) && (self.same_side(wi, i.z) || above)).then_some((o, i))
    }
}
