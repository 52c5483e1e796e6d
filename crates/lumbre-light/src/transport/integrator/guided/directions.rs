//! Directions of guided paths: mixtures of those of the BSDF and of the tree.

use std::sync::Arc;

use super::sd_tree::SdTree;
use crate::math::real::{Mask, Vector};
use crate::math::simd::{Lanes, active_lanes, map_vectors, store_vectors};
use crate::scene::compile::NONE;
use crate::transport::bsdf::{BsdfSample, TransportMode};
use crate::transport::integrator::camera_path::{Arrival, CameraPaths, Path, PathSink};
use crate::transport::integrator::directions::{Directions, SurfaceVertex};
use crate::transport::integrator::iteration::Shared;
use crate::transport::integrator::iteration::recorded::RecordedSamples;
use crate::transport::integrator::{Context, nee};

/// Name of the integrator whose paths these are.
pub const NAME: &str = "guided";

/// Data that the samples of an iteration share.
pub struct Guide {
    /// The tree that guides them.
    pub tree: Arc<SdTree>,
    /// The samples themselves, if they are a pass of the training.
    pub(super) recorded: Option<RecordedSamples>,
}

impl Guide {
    /// Returns the samples, if they are a pass of the training.
    pub fn recorded(shared: &Shared) -> Option<&RecordedSamples> {
        shared.downcast_ref::<Guide>()?.recorded.as_ref()
    }
}

/// Guided path tracing.
pub struct Guided;

impl CameraPaths for Guided {
    #[inline(always)]
    fn scatter<R: Lanes<N>, const N: usize>(
        context: &Context,
        edge: u32,
        arrival: &Arrival<R, N>,
        path: &mut Path<R>,
        lanes: R::Mask,
        sink: &mut impl PathSink<R>,
    ) -> R::Mask {
        type D<R, const N: usize> = MixedDirections<R, N>;
        nee::scatter::<R, N, D<R, N>, true>(context, edge, arrival, path, lanes, sink)
    }

    #[inline(always)]
    fn escape<R: Lanes<N>, const N: usize>(
        context: &Context,
        edge: u32,
        path: &Path<R>,
        lanes: R::Mask,
        sink: &mut impl PathSink<R>,
    ) {
        nee::escape::<R, N, true>(context, edge, path, lanes, sink);
    }
}

/// Mixture of the directions of the BSDF and of the tree, in each lane.
#[derive(Clone, Copy)]
pub(super) struct MixedDirections<R, const N: usize> {
    /// Leaves of the tree, or [`NONE`] in lanes that it does not guide.
    pub(super) leaves: [u32; N],
    /// Probability of sampling the BSDF: one in lanes that the tree does not guide.
    fraction: R,
}

/// Returns the tree of the samples.
fn tree<'a>(context: &Context<'a>) -> &'a SdTree {
    &context.shared::<Guide>().tree
}

impl<R: Lanes<N>, const N: usize> Directions<R, N> for MixedDirections<R, N> {
    #[inline(always)]
    fn at(
        context: &Context,
        position: R::Vec3,
        _: SurfaceVertex<'_, R>,
        smooth: R::Mask,
    ) -> MixedDirections<R, N> {
        let tree = tree(context);
        let positions = store_vectors::<R, N>(position);
        let mut leaves = [NONE; N];
        for i in active_lanes(smooth.bits()) {
            let leaf = tree.leaf_at(positions[i]);
            if tree.directions(leaf).is_some() {
                leaves[i] = leaf;
            }
        }
        MixedDirections::in_leaves(context, leaves)
    }

    #[inline(always)]
    fn pdf_w(&self, context: &Context, wi: R::Vec3, bsdf_pdf_w: R, lanes: R::Mask) -> R {
        self.mixed(bsdf_pdf_w, self.tree_pdf_w(context, wi, lanes))
    }

    #[inline(always)]
    fn sample(
        &self,
        context: &Context,
        vertex: SurfaceVertex<'_, R>,
        numbers: [R; 3],
        lanes: R::Mask,
    ) -> (R::Mask, BsdfSample<R>) {
        let (some, s, _) = self.sample_reversible::<false>(context, vertex, numbers, lanes);
        (some, s)
    }
}

impl<R: Lanes<N>, const N: usize> MixedDirections<R, N> {
    /// Returns the mixture in leaves of the tree, or of the BSDF alone where they are [`NONE`].
    #[inline(always)]
    pub(super) fn in_leaves(context: &Context, leaves: [u32; N]) -> MixedDirections<R, N> {
        let mut fraction = [1.0; N];
        for (fraction, leaf) in fraction.iter_mut().zip(&leaves) {
            if *leaf != NONE {
                *fraction = context.settings.guiding.bsdf_fraction;
            }
        }
        MixedDirections {
            leaves,
            fraction: R::load(&fraction),
        }
    }

    /// Returns the density per solid angle with which the tree samples the unit directions `wi`, in
    /// the given lanes that it guides; zero elsewhere.
    #[inline(always)]
    pub(super) fn tree_pdf_w(&self, context: &Context, wi: R::Vec3, lanes: R::Mask) -> R {
        let tree = tree(context);
        let guided = lanes & self.fraction.lt(R::splat(1.0));
        let [pdf_w] = map_vectors::<R, N, 1>(wi, guided, |i, wi| {
            let directions = tree.directions(self.leaves[i]);
            [directions.map_or(0.0, |directions| directions.pdf_w(wi))]
        });
        pdf_w
    }

    /// Returns the density of the mixture from those of the BSDF and of the tree.
    #[inline(always)]
    pub(super) fn mixed(&self, bsdf_pdf_w: R, tree_pdf_w: R) -> R {
        self.fraction * bsdf_pdf_w + (R::splat(1.0) - self.fraction) * tree_pdf_w
    }

    /// Samples directions: see [`Directions::sample`]. With `REVERSE`, also returns the density with
    /// which the BSDF samples the way back.
    #[inline(always)]
    pub(super) fn sample_reversible<const REVERSE: bool>(
        &self,
        context: &Context,
        (bsdf, out, n): SurfaceVertex<'_, R>,
        [choice, u, v]: [R; 3],
        lanes: R::Mask,
    ) -> (R::Mask, BsdfSample<R>, R) {
        let one = R::splat(1.0);
        let mode = TransportMode::Radiance;
        let stretched = (choice / self.fraction).min(R::splat(BELOW_ONE));
        let (some, s, reverse) = bsdf.samples::<REVERSE>(out, stretched, [u, v], mode);
        let guided = lanes & self.fraction.lt(one);
        if !guided.any() {
            return (some, s, reverse);
        }
        let by_tree = guided & !choice.lt(self.fraction);
        let tree = tree(context);
        let [x, y, z] = map_vectors::<R, N, 3>(R::Vec3::new(u, v, u), by_tree, |i, u| {
            let directions = tree.directions(self.leaves[i]);
            let dir = directions.map(|directions| directions.sample([u.x, u.y]));
            dir.unwrap_or_default().to_array()
        });
        let wi = R::Vec3::select(by_tree, R::Vec3::new(x, y, z), s.wi);
        let value = bsdf.values::<REVERSE>(out, wi, mode, by_tree);
        let of_tree = value.f * wi.dot(n).abs();
        let f_cos = R::Vec3::select(by_tree, of_tree, s.weight * s.pdf_w);
        let bsdf_pdf_w = R::select(by_tree, value.pdf_w, s.pdf_w);
        let delta = s.delta & !by_tree;
        let smooth = guided & !delta & (by_tree & out.same_side | !by_tree & some);
        let pdf_w = self.pdf_w(context, wi, bsdf_pdf_w, smooth);
        let some = smooth & pdf_w.gt(R::splat(0.0)) | !smooth & !by_tree & some;
        let sample = BsdfSample {
            wi,
            weight: R::Vec3::select(smooth, f_cos / pdf_w, s.weight / self.fraction),
            pdf_w: R::select(smooth, pdf_w, s.pdf_w),
            delta,
            eta: R::select(by_tree, bsdf.index_ratio(out.wo, wi), s.eta),
        };
        let reverse = R::select(by_tree, value.reverse_pdf_w, reverse);
        (some, sample, reverse)
    }
}

/// Greatest number below one.
const BELOW_ONE: f32 = 1.0 - f32::EPSILON / 2.0;
