//! Connections of camera vertices to sampled lights.

use glam::Vec3;

use super::load::{load_vertices, load_words, optical_lengths, sampler_keys};
use super::{LightConnection, ShadowQueue, Target};
use crate::math::real::{Double, Mask, Vector};
use crate::math::simd::{Lanes, active_lanes, map_array, padded};
use crate::render::cpu::wavefront::bdpt::{Subpaths, TileContext};
use crate::render::cpu::wavefront::shade::shadow_rays;
use crate::transport::bsdf::TransportMode;
use crate::transport::integrator::bdpt::weights::others_s1;
use crate::transport::sampler::Independent;
use crate::transport::surface::SurfacePoint;

/// Evaluates connections of camera vertices to sampled lights (`s = 1`, `t >= 2`).
#[inline(always)]
pub(super) fn connect_s1<R: Lanes<N>, const N: usize, const TIMED: bool>(
    tile: &TileContext<TIMED>,
    class: usize,
    group: &[LightConnection],
    camera: &Subpaths,
    queue: &mut ShadowQueue,
) {
    let light_connections: [LightConnection; N] = padded(group);
    let active = R::Mask::first(group.len());
    let zero = R::splat(0.0);
    let numbers = Independent::next_three(
        sampler_keys::<R, N>(camera, map_array(light_connections, |e| e.path)),
        load_words::<R, N>(map_array(light_connections, |e| e.taken)),
    );
    let nodes = map_array(light_connections, |e| &camera.nodes[e.z as usize]);
    let z = load_vertices::<R, N, TIMED>(tile, class, nodes, active);
    let SurfacePoint {
        position,
        n_geometric,
        n_shading,
    } = z.vertices.point;
    let d = tile
        .table
        .lights
        .sample::<R, N>(tile.context, position, numbers, z.vertices.visible);
    let arrives = z.vertices.visible & d.density.gt(zero);
    if !arrives.any() {
        return;
    }
    let at_z = z
        .vertices
        .evaluate::<true>(d.wi, TransportMode::Radiance, arrives);
    let unweighted = z.throughput * at_z.f * d.wi.dot(n_shading).abs() * d.radiance / d.density;
    let lit = arrives & !unweighted.same(R::Vec3::broadcast(Vec3::ZERO));
    if !lit.any() {
        return;
    }
    let from = [position, n_geometric];
    let end = d.mis_terms(tile.context, from);
    let others = others_s1(tile.h, &z.endpoint, &end, &at_z);
    // At the silhouette of a sphere, rounding may move the point to the hidden side, where no
    // strategy has a density.
    let usable = end.direct.gt(R::Double::splat(0.0));
    let values = tile.mis_weighted::<R, N>(unweighted, others, usable);
    let rays = shadow_rays::<R, N>(from, [d.at, d.normal], d.wi, d.infinite);
    if TIMED {
        let lengths = R::store_doubles(z.vertices.direct_length(
            tile.context,
            &optical_lengths::<R, N>(nodes),
            &d,
        ));
        queue
            .lengths
            .extend(active_lanes(lit.bits()).map(|i| lengths[i]));
    }
    for i in active_lanes(lit.bits()) {
        queue.push(
            &rays[i],
            &values[i],
            Target::Slot(light_connections[i].slot),
        );
    }
}
