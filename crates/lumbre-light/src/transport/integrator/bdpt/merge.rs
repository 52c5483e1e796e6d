//! Merging of camera vertices with light vertices near them [Georgiev et al. 2012]: both are taken
//! for one vertex of a path.

use glam::Vec3;

use super::state::{Vertex, VertexState};
use super::store::{VertexId, VertexStore};
use super::weights::{MisPartials, StrategyCounts, others_merging};
use crate::math::real::{Double, Mask, Real, Vector};
use crate::math::simd::Lanes;
use crate::transport::bsdf::TransportMode;
use crate::transport::integrator::Context;
use crate::transport::integrator::iteration::light_paths::LightPaths;
use crate::transport::integrator::iteration::photon_map::{PhotonMap, cosine_ratio, same_surface};
use crate::transport::path_time::OpticalLength;

/// A light vertex in the map, with what decides whether a camera vertex near it is merged with it.
#[derive(Clone, Copy, Debug, Default)]
pub struct MergePoint {
    /// Place of the vertex in memory.
    pub id: VertexId,
    /// Number of edges from the light.
    edges: u32,
    /// Unit normal of its surface.
    normal: Vec3,
}

impl MergePoint {
    /// Creates the entry of a vertex.
    pub fn new(id: VertexId, edges: u32, vertex: &VertexState<f32>) -> MergePoint {
        let normal = vertex.n_geometric;
        MergePoint { id, edges, normal }
    }
}

/// Light vertices that camera vertices are merged with.
#[derive(Clone, Copy)]
pub struct Merging<'a> {
    /// The light subpaths.
    pub paths: &'a LightPaths,
    /// Their vertices by position.
    pub map: &'a PhotonMap<MergePoint>,
    /// Numbers of samples of the strategies that the weights combine.
    pub counts: &'a StrategyCounts,
}

impl Merging<'_> {
    /// Loads light vertices that merge with camera vertices: see
    /// [`VertexStore::merging_states`].
    #[inline(always)]
    pub fn light_vertices<R: Lanes<N>, const N: usize>(
        &self,
        ids: [VertexId; N],
    ) -> (VertexState<R>, MisPartials<R::Double>) {
        let stores = self.paths.stores();
        (
            VertexStore::merging_states::<R, N>(stores, ids),
            VertexStore::partials::<R, N>(stores, ids),
        )
    }

    /// Visits the light vertices that merge with the camera vertex number `t`, in the order of the
    /// map, each with its number of edges from the light.
    #[inline(always)]
    pub fn for_each_near<R: Lanes<N>, const N: usize>(
        &self,
        context: &Context,
        z: &VertexState<f32>,
        t: u32,
        mut visit: impl FnMut(VertexId, u32),
    ) {
        self.map.for_each_near::<R, N>(z.point(), |point| {
            let MergePoint { id, edges, normal } = *point;
            if edges + t - 1 <= context.max_depth && same_surface(normal, z.n_geometric) {
                visit(id, edges);
            }
        });
    }
}

/// Light found by merging two vertices in each lane.
#[derive(Clone, Copy)]
pub struct Merged<R: Real = f32> {
    /// Lanes that find light.
    pub lanes: R::Mask,
    /// Radiance, not yet weighted.
    pub unweighted: R::Vec3,
    /// Weight of multiple importance sampling.
    pub weight: R::Double,
    /// Optical length of the path; 0 without a time axis.
    pub length: R::Double,
    /// Unit direction to the previous vertex of the light subpath.
    pub wi: R::Vec3,
}

impl<R: Real> Merged<R> {
    /// Merges the light vertices `y` with the camera vertices `z`; `None` if no light passes in any
    /// lane.
    #[inline(always)]
    pub fn new<const N: usize>(
        context: &Context,
        merging: &Merging,
        (y, partials): (&VertexState<R>, MisPartials<R::Double>),
        z: &Vertex<R>,
        lanes: R::Mask,
    ) -> Option<Merged<R>>
    where
        R: Lanes<N>,
    {
        let wi = y.wo;
        let mut lanes = lanes & z.out.same_side;
        if let Some(offset) = &z.terminator {
            lanes = lanes & !offset.applies_to(wi);
        }
        if !lanes.any() {
            return None;
        }
        let at_z = z
            .bsdf
            .values::<true>(&z.out, wi, TransportMode::Radiance, lanes);
        let cosines = cosine_ratio(z.state.n_shading, z.state.n_geometric, wi);
        let unweighted =
            z.state.throughput * at_z.f * y.throughput * (cosines * R::splat(merging.map.scale()));
        let lanes = lanes & !unweighted.same(R::Vec3::broadcast(Vec3::ZERO));
        if !lanes.any() {
            return None;
        }
        let ends = [&y.endpoint(partials), &z.endpoint()];
        let h = context.settings.heuristic();
        let one = R::Double::splat(1.0);
        Some(Merged {
            lanes,
            unweighted,
            weight: one / (one + others_merging(h, merging.counts, ends, &at_z)),
            length: optical_length(context, y, z),
            wi,
        })
    }
}

/// Returns the optical lengths of merged paths; 0 without a time axis. The vertices have the delays
/// that the camera subpaths drew.
#[inline(always)]
fn optical_length<R: Real>(context: &Context, y: &VertexState<R>, z: &Vertex<R>) -> R::Double {
    if context.timing.is_none() {
        return R::Double::splat(0.0);
    }
    let zero = R::splat(0.0);
    let near = z.state.optical();
    let ratio = z.bsdf.index_ratio(z.out.wo, y.wo);
    let far = OpticalLength {
        delay: zero,
        ..y.optical()
    };
    near.after_segment(ratio, zero) + far.from_light(R::splat(1.0), near.index * ratio)
}
