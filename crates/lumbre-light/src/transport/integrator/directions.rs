//! Distributions of the directions in which paths continue from surfaces.

use std::f32::consts::PI;

use super::Context;
use crate::math::real::{Mask, Real, Vector};
use crate::math::simd::Lanes;
use crate::math::warp;
use crate::transport::bsdf::{Bsdf, BsdfSample, Outgoing, TransportMode};

/// Surfaces at which paths arrive: BSDF, direction to the previous vertex, and unit shading normal.
pub(super) type SurfaceVertex<'a, R> = (&'a Bsdf<R>, &'a Outgoing<R>, <R as Real>::Vec3);

/// Distribution of the directions in which paths continue from vertices.
pub(super) trait Directions<R: Lanes<N>, const N: usize>: Copy {
    /// Returns the distribution at vertices, of whose BSDFs those in the lanes of `smooth` have a
    /// density.
    fn at(
        context: &Context,
        position: R::Vec3,
        vertex: SurfaceVertex<'_, R>,
        smooth: R::Mask,
    ) -> Self;

    /// Returns the density per solid angle of the unit directions `wi`, which the BSDFs sample with
    /// the density `bsdf_pdf_w`, in the given lanes.
    fn pdf_w(&self, context: &Context, wi: R::Vec3, bsdf_pdf_w: R, lanes: R::Mask) -> R;

    /// Samples directions by three numbers in `[0, 1)`, in the given lanes. The mask is set where
    /// there is a sample.
    fn sample(
        &self,
        context: &Context,
        vertex: SurfaceVertex<'_, R>,
        numbers: [R; 3],
        lanes: R::Mask,
    ) -> (R::Mask, BsdfSample<R>);
}

/// Directions that the BSDF samples, or uniform ones, as the parameter
/// [`DIRECTIONS`](super::settings::DIRECTIONS) states.
#[derive(Clone, Copy)]
pub(super) struct SurfaceDirections<R: Real> {
    uniform: Option<UniformDirections<R>>,
}

impl<R: Lanes<N>, const N: usize> Directions<R, N> for SurfaceDirections<R> {
    #[inline(always)]
    fn at(
        context: &Context,
        _: R::Vec3,
        (bsdf, ..): SurfaceVertex<'_, R>,
        smooth: R::Mask,
    ) -> SurfaceDirections<R> {
        SurfaceDirections {
            uniform: if context.settings.uniform_directions {
                Some(UniformDirections::at(bsdf, smooth))
            } else {
                None
            },
        }
    }

    #[inline(always)]
    fn pdf_w(&self, _: &Context, _: R::Vec3, bsdf_pdf_w: R, _: R::Mask) -> R {
        match &self.uniform {
            None => bsdf_pdf_w,
            Some(uniform) => uniform.pdf_w,
        }
    }

    #[inline(always)]
    fn sample(
        &self,
        _: &Context,
        vertex: SurfaceVertex<'_, R>,
        numbers: [R; 3],
        lanes: R::Mask,
    ) -> (R::Mask, BsdfSample<R>) {
        if let Some(uniform) = &self.uniform {
            return uniform.sample(vertex, numbers, lanes);
        }
        let ((bsdf, out, _), [choice, u, v]) = (vertex, numbers);
        let (sampled, s, _) = bsdf.samples::<false>(out, choice, [u, v], TransportMode::Radiance);
        (sampled, s)
    }
}

/// Directions with the same density everywhere on the side of the previous vertex, or on both sides
/// where light is transmitted. Where a BSDF also has Dirac lobes, which no such direction meets, it
/// is sampled itself with probability one half, and its other lobes are discarded.
#[derive(Clone, Copy)]
struct UniformDirections<R: Real> {
    /// Lanes whose BSDF has a density; the BSDF is sampled in the others.
    smooth: R::Mask,
    /// Lanes whose BSDF transmits light.
    both_sides: R::Mask,
    /// Probability of a uniform direction in the smooth lanes.
    fraction: R,
    /// Density of such a direction per solid angle, with that probability.
    pdf_w: R,
}

impl<R: Real> UniformDirections<R> {
    #[inline(always)]
    fn at(bsdf: &Bsdf<R>, smooth: R::Mask) -> UniformDirections<R> {
        let both_sides = bsdf.transmits();
        let fraction = R::select(bsdf.has_dirac_lobe(), R::splat(0.5), R::splat(1.0));
        let density = R::select(
            both_sides,
            R::splat(1.0 / (4.0 * PI)),
            R::splat(1.0 / (2.0 * PI)),
        );
        UniformDirections {
            smooth,
            both_sides,
            fraction,
            pdf_w: fraction * density,
        }
    }

    #[inline(always)]
    fn sample(
        &self,
        (bsdf, out, n): SurfaceVertex<'_, R>,
        [choice, u, v]: [R; 3],
        lanes: R::Mask,
    ) -> (R::Mask, BsdfSample<R>) {
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        let mode = TransportMode::Radiance;
        let uniform = lanes & self.smooth & choice.lt(self.fraction);
        let dir = warp::uniform_sphere([u, v]);
        let behind = (dir.dot(n) * out.wo.dot(n)).lt(zero);
        let wi = R::Vec3::select(behind & !self.both_sides, -dir, dir);
        let value = bsdf.values::<false>(out, wi, mode, uniform);
        let weight = value.f * (wi.dot(n).abs() / self.pdf_w);
        let arrives = uniform & !weight.same(R::Vec3::splat(zero));
        let mut sample = BsdfSample {
            wi,
            weight,
            pdf_w: self.pdf_w,
            delta: R::Mask::default(),
            eta: bsdf.index_ratio(out.wo, wi),
        };
        let rest = lanes & !uniform;
        if !rest.any() {
            return (arrives, sample);
        }
        // The fraction is one half in the smooth lanes that are left.
        let double = choice * R::splat(2.0) - one;
        let stretched = R::select(self.smooth, double.max(zero), choice);
        let (some, s, _) = bsdf.samples::<false>(out, stretched, [u, v], mode);
        let factor = R::select(self.smooth, R::splat(2.0), one);
        sample.wi = R::Vec3::select(uniform, sample.wi, s.wi);
        sample.weight = R::Vec3::select(uniform, sample.weight, s.weight * factor);
        sample.pdf_w = R::select(uniform, sample.pdf_w, s.pdf_w);
        sample.eta = R::select(uniform, sample.eta, s.eta);
        sample.delta = s.delta & !uniform;
        (arrives | rest & some & (s.delta | !self.smooth), sample)
    }
}
