//! Connections of camera vertices to sampled lights (`s = 1`, `t >= 2`).

use glam::Vec3;

use super::load::{load_vertices, load_words, optical_lengths, sampler_keys};
use super::{LightConnection, ShadowQueue, Target};
use crate::cpu::wavefront::bdpt::shadow_rays::shadow_rays;
use crate::cpu::wavefront::bdpt::{TileContext, TileSubpaths};
use lumbre_light::math::real::{Double, Mask, Vector};
use lumbre_light::math::simd::{Lanes, active_lanes, map_array, padded};
use lumbre_light::transport::bsdf::TransportMode;
use lumbre_light::transport::integrator::bdpt::weights::{LightEnd, others_s1};
use lumbre_light::transport::sampler::independent;
use lumbre_light::transport::surface::SurfacePoint;

/// Evaluates connections of camera vertices on surfaces of one class and appends the contributions
/// to `queue`.
#[inline(always)]
pub(super) fn connect_s1<R: Lanes<N>, const N: usize, const TIMED: bool>(
    tile: &TileContext<TIMED>,
    class: usize,
    group: &[LightConnection],
    camera: &TileSubpaths,
    queue: &mut ShadowQueue,
) {
    let connections: [LightConnection; N] = padded(group);
    let active = R::Mask::first(group.len());
    let [choice, u, v] = independent::next_three(
        sampler_keys::<R, N>(camera, map_array(connections, |c| c.path)),
        load_words::<R, N>(map_array(connections, |c| c.taken)),
    );
    let records = map_array(connections, |c| &camera.vertices[c.z as usize]);
    let z = load_vertices::<R, N, TIMED>(tile, class, records, active);
    let SurfacePoint {
        position,
        n_geometric,
        n_shading,
    } = z.vertices.point;
    let context = tile.context;
    let lights = context.lights.select::<R, N>(choice, z.vertices.visible);
    let sample = lights.sample_direct(context.scene, position, [u, v]);
    let arrives = z.vertices.visible & sample.arrives();
    if !arrives.any() {
        return;
    }
    let at_z = z
        .vertices
        .evaluate::<true>(sample.wi, TransportMode::Radiance, arrives);
    let unweighted =
        z.throughput * at_z.f * sample.wi.dot(n_shading).abs() * sample.radiance / sample.pdf_w;
    let lit = arrives & !unweighted.same(R::Vec3::broadcast(Vec3::ZERO));
    if !lit.any() {
        return;
    }
    let from = [position, n_geometric];
    let at = [sample.point.position, sample.point.normal];
    let end = LightEnd::new(&lights, at, -sample.wi, from);
    let others = others_s1(tile.h, &z.endpoint, &end, &at_z);
    // At the silhouette of a sphere light, rounding may place the point on the far side, where no
    // strategy has a density.
    let usable = end.direct.gt(R::Double::splat(0.0));
    let values = tile.mis_weighted::<R, N>(unweighted, others, usable);
    let rays = shadow_rays::<R, N>(from, at, sample.wi, sample.is_infinite());
    if TIMED {
        let lengths = R::store_doubles(z.vertices.direct_length(
            context,
            &optical_lengths::<R, N>(records),
            &sample,
        ));
        queue
            .lengths
            .extend(active_lanes(lit.bits()).map(|i| lengths[i]));
    }
    for i in active_lanes(lit.bits()) {
        queue.push(&rays[i], &values[i], Target::Own(connections[i].index));
    }
}
