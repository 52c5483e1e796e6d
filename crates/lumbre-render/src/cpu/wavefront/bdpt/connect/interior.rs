//! Connections of light vertices to camera vertices (`s >= 2`, `t >= 2`), in two passes: the first
//! evaluates the BSDFs of camera vertices, by their class; the second does the rest, by the class
//! of the light vertices.

use glam::Vec3;

use super::load::{load_records, load_vertices, optical_lengths};
use super::{EvaluatedPair, ShadowQueue, Target, VertexPair};
use crate::cpu::wavefront::bdpt::shadow_rays::shadow_rays;
use crate::cpu::wavefront::bdpt::{TileContext, TileSubpaths};
use lumbre_light::math::real::{Mask, Vector};
use lumbre_light::math::simd::{F32x8, Lanes, active_lanes, map_array, padded};
use lumbre_light::transport::bsdf::{BsdfValue, TransportMode, index_ratio};
use lumbre_light::transport::integrator::bdpt::weights::others_interior;

/// Evaluates the BSDFs of camera vertices towards light vertices, and appends the pairs with a
/// non-zero value to `evaluated`, by the class of the light vertex.
#[inline(always)]
pub(super) fn evaluate_camera_ends<R: Lanes<N>, const N: usize, const TIMED: bool>(
    tile: &TileContext<TIMED>,
    class: usize,
    group: &[VertexPair],
    [light, camera]: [&TileSubpaths; 2],
    evaluated: &mut [Vec<EvaluatedPair>],
) {
    let pairs: [VertexPair; N] = padded(group);
    let z = load_vertices::<R, N, TIMED>(
        tile,
        class,
        map_array(pairs, |p| &camera.vertices[p.z as usize]),
        R::Mask::first(group.len()),
    );
    let [x, y, c, ..] =
        R::transpose_load(map_array(pairs, |p| &light.vertices[p.y as usize].rows[0]));
    let edge = R::Vec3::new(x, y, c) - z.vertices.point.position;
    let wi = edge / edge.length_squared().sqrt();
    let BsdfValue {
        f,
        pdf_w,
        reverse_pdf_w,
    } = z
        .vertices
        .evaluate::<true>(wi, TransportMode::Radiance, wi.is_finite());
    let nonzero = !f.same(R::Vec3::broadcast(Vec3::ZERO)) & wi.is_finite();
    let zero = R::splat(0.0);
    let at_z = R::transpose_store([f.x(), f.y(), f.z(), pdf_w, reverse_pdf_w, zero, zero, zero]);
    for i in active_lanes(nonzero.bits()) {
        let [r, g, b, w, back, ..] = at_z[i].0;
        if let Some(class) = light.vertices[pairs[i].y as usize].class {
            evaluated[usize::from(class)].push(EvaluatedPair {
                pair: pairs[i],
                at_z: [r, g, b, w, back],
            });
        }
    }
}

/// Evaluates the rest of the connections and appends the contributions to `queue`.
#[inline(always)]
pub(super) fn connect_interior<R: Lanes<N>, const N: usize, const TIMED: bool>(
    tile: &TileContext<TIMED>,
    class: usize,
    group: &[EvaluatedPair],
    [light, camera]: [&TileSubpaths; 2],
    queue: &mut ShadowQueue,
) {
    let evaluated: [EvaluatedPair; N] = padded(group);
    let active = R::Mask::first(group.len());
    let (y_records, z_records) = (
        map_array(evaluated, |e| &light.vertices[e.pair.y as usize]),
        map_array(evaluated, |e| &camera.vertices[e.pair.z as usize]),
    );
    let y = load_vertices::<R, N, TIMED>(tile, class, y_records, active);
    let (z, z_wo, z_throughput, z_endpoint) = load_records::<R, N>(z_records);
    let z_rows = map_array(evaluated, |e| {
        let [r, g, b, w, back] = e.at_z;
        F32x8([r, g, b, w, back, 0.0, 0.0, 0.0])
    });
    let [r, g, b, pdf_w, reverse_pdf_w, ..] = R::transpose_load(z_rows.each_ref());
    let at_z = BsdfValue {
        f: R::Vec3::new(r, g, b),
        pdf_w,
        reverse_pdf_w,
    };
    let at = y.vertices.point;
    let edge = at.position - z.position;
    let distance2 = edge.length_squared();
    let wi = edge / distance2.sqrt();
    let at_y = y
        .vertices
        .evaluate::<true>(-wi, TransportMode::Importance, active);
    let [cos_y, cos_z] = [wi.dot(at.n_shading).abs(), wi.dot(z.n_shading).abs()];
    let unweighted = y.throughput * at_y.f * cos_y * at_z.f * cos_z * z_throughput / distance2;
    let lit = active & !unweighted.same(R::Vec3::broadcast(Vec3::ZERO));
    if !lit.any() {
        return;
    }
    let area_factors = [
        wi.dot(at.n_geometric).abs() / distance2,
        wi.dot(z.n_geometric).abs() / distance2,
    ];
    let others = others_interior(
        tile.h,
        [&y.endpoint, &z_endpoint],
        [&at_y, &at_z],
        area_factors,
    );
    let values = tile.mis_weighted::<R, N>(unweighted, others, lit);
    let rays = shadow_rays::<R, N>(
        [z.position, z.n_geometric],
        [at.position, at.n_geometric],
        wi,
        R::Mask::splat(false),
    );
    if TIMED {
        let ior = map_array(z_records, |record| {
            tile.table.bsdfs[record.material()].index_inside
        });
        let ratio = index_ratio([z_wo.dot(z.n_shading), wi.dot(z.n_shading)], R::load(&ior));
        let z_optical = optical_lengths::<R, N>(z_records);
        let camera_side = z_optical.after_segment(ratio, distance2.sqrt());
        let light_side = optical_lengths::<R, N>(y_records)
            .from_light(y.vertices.index_ratio(-wi), z_optical.index * ratio);
        let lengths = R::store_doubles(camera_side + light_side);
        queue
            .lengths
            .extend(active_lanes(lit.bits()).map(|i| lengths[i]));
    }
    for i in active_lanes(lit.bits()) {
        queue.push(&rays[i], &values[i], Target::Own(evaluated[i].pair.index));
    }
}
