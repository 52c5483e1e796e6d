//! Distributions of the directions in which camera subpaths continue.

use super::state::Vertex;
use crate::math::simd::Lanes;
use crate::transport::bsdf::{BsdfSample, TransportMode};
use crate::transport::integrator::Context;

/// A distribution of the directions in which camera subpaths continue from vertices. Light subpaths
/// continue as the BSDF samples them, whatever the distribution.
///
/// MIS weights depend on the density of every direction in which a camera subpath could have
/// continued, at vertices of light subpaths too.
pub trait SubpathDirections: Copy + Send + Sync + 'static {
    /// Finds what the densities at the vertices of subpaths of a mode need, in the given lanes.
    fn prepare<R: Lanes<N>, const N: usize>(
        self,
        context: &Context,
        vertex: &mut Vertex<R>,
        mode: TransportMode,
        lanes: R::Mask,
    );

    /// Samples the next edges of subpaths of a mode from their vertices, by three numbers in
    /// `[0, 1)`, in the given lanes. The mask is set where there is a sample. Also returns the
    /// density per solid angle with which the other side's subpaths continue from the sampled
    /// direction to the previous vertices, undefined after a Dirac event.
    fn sample<R: Lanes<N>, const N: usize>(
        self,
        context: &Context,
        vertex: &Vertex<R>,
        numbers: [R; 3],
        mode: TransportMode,
        lanes: R::Mask,
    ) -> (R::Mask, BsdfSample<R>, R);

    /// Returns the density per solid angle with which camera subpaths continue from their vertices
    /// in the unit directions `wi`, which the BSDF samples with the density `bsdf_pdf_w`, in the
    /// given lanes.
    fn pdf_w<R: Lanes<N>, const N: usize>(
        self,
        context: &Context,
        vertex: &Vertex<R>,
        wi: R::Vec3,
        bsdf_pdf_w: R,
        lanes: R::Mask,
    ) -> R;

    /// Returns the density per solid angle with which camera subpaths that arrive at vertices of
    /// light subpaths continue to the previous vertices, a direction that the BSDF samples with the
    /// density `bsdf_pdf_w`.
    fn back_pdf_w<R: Lanes<N>, const N: usize>(
        self,
        context: &Context,
        vertex: &Vertex<R>,
        bsdf_pdf_w: R,
    ) -> R;
}

/// The directions that the BSDF samples.
#[derive(Clone, Copy, Debug)]
pub struct BsdfDirections;

impl SubpathDirections for BsdfDirections {
    #[inline(always)]
    fn prepare<R: Lanes<N>, const N: usize>(
        self,
        _: &Context,
        _: &mut Vertex<R>,
        _: TransportMode,
        _: R::Mask,
    ) {
    }

    #[inline(always)]
    fn sample<R: Lanes<N>, const N: usize>(
        self,
        _: &Context,
        vertex: &Vertex<R>,
        [choice, u, v]: [R; 3],
        mode: TransportMode,
        _: R::Mask,
    ) -> (R::Mask, BsdfSample<R>, R) {
        vertex
            .bsdf
            .samples::<true>(&vertex.out, choice, [u, v], mode)
    }

    #[inline(always)]
    fn pdf_w<R: Lanes<N>, const N: usize>(
        self,
        _: &Context,
        _: &Vertex<R>,
        _: R::Vec3,
        bsdf_pdf_w: R,
        _: R::Mask,
    ) -> R {
        bsdf_pdf_w
    }

    #[inline(always)]
    fn back_pdf_w<R: Lanes<N>, const N: usize>(
        self,
        _: &Context,
        _: &Vertex<R>,
        bsdf_pdf_w: R,
    ) -> R {
        bsdf_pdf_w
    }
}
