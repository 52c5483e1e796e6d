//! Surface vertices in all lanes, with BSDFs loaded from the material table.

use super::material_classes::ClassTraits;
use lumbre_light::math::real::{Mask, Real};
use lumbre_light::math::simd::Lanes;
use lumbre_light::transport::bsdf::{
    Bsdf, BsdfSample, BsdfValue, Orientation, Outgoing, PackedBsdf, TransportMode,
};
use lumbre_light::transport::integrator::Context;
use lumbre_light::transport::light::DirectSample;
use lumbre_light::transport::path_time::OpticalLength;
use lumbre_light::transport::surface::SurfacePoint;

/// Surface vertices in all lanes, with their BSDFs.
pub(super) struct Vertices<R: Real> {
    pub point: SurfacePoint<R::Vec3>,
    pub bsdf: Bsdf<R>,
    /// Direction to the previous vertex.
    pub out: Outgoing<R>,
    /// Whether the BSDF can be non-zero for that direction.
    pub visible: R::Mask,
}

impl<R: Real> Vertices<R> {
    /// Creates the vertices on surfaces of one class from their materials. `wo` is the unit
    /// direction to the previous vertex. `visible` is unset outside `active`.
    #[inline(always)]
    pub fn new<const N: usize>(
        point: SurfacePoint<R::Vec3>,
        wo: R::Vec3,
        materials: [&PackedBsdf; N],
        traits: &ClassTraits,
        active: R::Mask,
    ) -> Vertices<R>
    where
        R: Lanes<N>,
    {
        let orientation = Orientation {
            n_geometric: point.n_geometric,
            n_shading: point.n_shading,
            tangent: None,
            terminator: R::Mask::splat(false),
        };
        let bsdf = Bsdf::unpack(&orientation, &traits.bsdf, materials, None);
        let out = bsdf.outgoing(wo);
        Vertices {
            point,
            bsdf,
            out,
            visible: active & out.same_side,
        }
    }

    /// Evaluates the BSDF in the lanes of `wanted`: see [`Bsdf::values`].
    #[inline(always)]
    pub fn evaluate<const REVERSE: bool>(
        &self,
        wi: R::Vec3,
        mode: TransportMode,
        wanted: R::Mask,
    ) -> BsdfValue<R::Vec3> {
        self.bsdf
            .values::<REVERSE>(&self.out, wi, mode, wanted & self.visible)
    }

    /// Samples the BSDF in the lanes of `visible`: see [`Bsdf::samples`].
    #[inline(always)]
    pub fn sample<const REVERSE: bool>(
        &self,
        choice: R,
        v: [R; 2],
        mode: TransportMode,
    ) -> (R::Mask, BsdfSample<R>, R) {
        let (sampled, sample, reverse) = self.bsdf.samples::<REVERSE>(&self.out, choice, v, mode);
        (self.visible & sampled, sample, reverse)
    }

    /// Returns the ratio of indices of refraction between `wo` and `wi`.
    #[inline(always)]
    pub fn index_ratio(&self, wi: R::Vec3) -> R {
        self.bsdf.index_ratio(self.out.wo, wi)
    }

    /// Returns the optical length of paths to sampled lights, as
    /// [`direct_length`](lumbre_light::transport::path_time::direct_length) does.
    #[inline(always)]
    pub fn direct_length<const N: usize>(
        &self,
        context: &Context,
        optical: &OpticalLength<R>,
        light: &DirectSample<R, N>,
    ) -> R::Double
    where
        R: Lanes<N>,
    {
        let mut distance = light.distance;
        let infinite = light.is_infinite();
        if infinite.any() {
            let front_distance = context.lights.front_distance(self.point.position, light.wi);
            distance = R::select(infinite, front_distance, distance);
        }
        optical.after_segment(self.index_ratio(light.wi), distance)
    }
}
