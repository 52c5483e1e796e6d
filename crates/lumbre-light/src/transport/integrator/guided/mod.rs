//! Practical path guiding [Müller et al. 2017]: [`nee`] whose paths continue in
//! directions from which light was found before.
//!
//! The first samples fill an [SD-tree](sd_tree): at every point of the scene a density of directions
//! ([`training`]). A vertex samples its next edge by the BSDF or by the tree, and the density is that
//! of the mixture,
//!
//! `p(wi) = a p_bsdf(wi) + (1 - a) p_tree(wi)`,
//!
//! also in the weights of light sampling. Dirac lobes are sampled by the BSDF alone, and so are
//! surfaces that have no other lobes and regions that no training path brought light to.
//!
//! - The tree's density is proportional to what paths contribute to the picture on average by going
//!   on in a direction. With `target = "variance"` it is the root of their mean square, which has
//!   the least variance of the picture, given light sampling [Rath et al. 2020]. Light that the
//!   vertex finds by its own shadow ray is not part of it.
//! - The tree learns from a number of samples that doubles, then from as many as are left of
//!   `training`, and stays the same afterwards. All samples are part of the picture, with equal
//!   weights. Each is unbiased, since the tree that guides it does not depend on it.
//! - [`bidirectional`] guides the camera subpaths of `bdpt` by the same tree.

pub mod bidirectional;
pub mod direction_tree;
pub mod sd_tree;
pub mod settings;
#[cfg(test)]
mod tests;
pub mod training;

use self::sd_tree::SdTree;
use self::training::Guide;
use super::camera_path::{self, Arrival, CameraPaths, Path, PathSink};
use super::directions::{Directions, SurfaceVertex};
use super::iteration::Sharing;
use super::nee;
use super::{Context, IntegratorRow, settings as common};
use crate::math::real::{Mask, Vector};
use crate::math::simd::{Lanes, active_lanes, map_vectors, store_vectors};
use crate::scene::compile::NONE;
use crate::transport::bsdf::{BsdfSample, TransportMode};
use crate::transport::light::SELECT_FIELD;
use crate::transport::mis;
use crate::value::schema::Table;

/// The table entry of this integrator.
pub const ROW: IntegratorRow = IntegratorRow {
    name: "guided",
    long_name: "guided path tracing with next event estimation",
    revision: 3,
    doc: "Paths are those of nee, but continue in directions where earlier samples found light, by a \
          tree over space and directions [Müller et al. 2017; Rath et al. 2020].",
    params: Table {
        name: "GuidedParams",
        doc: "Parameters of `guided`.",
        fields: &[
            settings::TRAINING,
            settings::TARGET,
            settings::BSDF_FRACTION,
            settings::SPLIT,
            settings::TREE_MEMORY,
            mis::FIELD,
            SELECT_FIELD,
            common::LIGHTS,
        ],
    },
    splats: false,
    bias: None,
    sharing: Some(Sharing {
        prepare: training::prepare,
        begin: training::begin,
        constant_from: Some(training::samples_that_train),
        recorded: Some(Guide::recorded),
        ..TRAINED
    }),
    sample: camera_path::sample::<Guided>,
};

/// The functions that train the tree before the first sample.
const TRAINED: Sharing = Sharing {
    prepare: training::prepare_apart,
    begin: training::begin_trained,
    vertex_bytes: training::VERTEX_BYTES,
    batch: Some(training::BATCH),
    fixed_bytes: |settings| settings.guiding.tree_bytes(),
    constant_from: Some(|_| 0),
    recorded: None,
};

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
struct MixedDirections<R, const N: usize> {
    /// Leaves of the tree, or [`NONE`] in lanes that it does not guide.
    leaves: [u32; N],
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
    fn in_leaves(context: &Context, leaves: [u32; N]) -> MixedDirections<R, N> {
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
    fn tree_pdf_w(&self, context: &Context, wi: R::Vec3, lanes: R::Mask) -> R {
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
    fn mixed(&self, bsdf_pdf_w: R, tree_pdf_w: R) -> R {
        self.fraction * bsdf_pdf_w + (R::splat(1.0) - self.fraction) * tree_pdf_w
    }

    /// Samples directions: see [`Directions::sample`]. With `REVERSE`, also returns the density with
    /// which the BSDF samples the way back.
    #[inline(always)]
    fn sample_reversible<const REVERSE: bool>(
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
