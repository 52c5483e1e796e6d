//! Random walks: advances one subpath per lane by one step. All subpaths of a vector hit surfaces
//! of one class.

use glam::Vec3;

use super::time_of_flight;
use super::{SubpathState, TileContext, TileSubpaths, VertexRecord};
use crate::cpu::wavefront::bdpt::vertices::Vertices;
use lumbre_light::math::real::{Mask, Vector, Word};
use lumbre_light::math::simd::{Lanes, SimdKernel, active_lanes, dispatch, map_array, padded};
use lumbre_light::scene::compile::NONE;
use lumbre_light::transport::MAX_SURVIVAL;
use lumbre_light::transport::bsdf::TransportMode;
use lumbre_light::transport::integrator::bdpt::weights::{
    EdgePartials, LightEnd, MisEndpoint, MisPartials,
};
use lumbre_light::transport::path_time::OpticalLength;
use lumbre_light::transport::ray::{RayHits, offset_by_axis};
use lumbre_light::transport::sampler::independent;
use lumbre_light::transport::surface::Surface;
use lumbre_light::transport::vertex::{area_factors, towards};

/// Traces the active subpaths until they end or have `max_edges` edges. `LIGHT` if they start on
/// lights. Contributions of the environment to camera subpaths are stored in `escaped`.
pub(super) fn trace_subpaths<const LIGHT: bool, const TIMED: bool>(
    tile: &TileContext<TIMED>,
    paths: &mut TileSubpaths,
    max_edges: u32,
    escaped: &mut [(Vec3, f64)],
) {
    let mut active = std::mem::take(&mut paths.active);
    let (mut rays, mut hits) = (Vec::new(), Vec::new());
    let mut by_class: Vec<Vec<u32>> = vec![Vec::new(); tile.table.classes()];
    for edge in 1..=max_edges {
        // The last edge of a camera subpath can only hit a light: its end is not connected.
        let last = !LIGHT && edge == max_edges;
        rays.clear();
        rays.extend(
            active
                .iter()
                .map(|path| (paths.states[*path as usize].ray(), f32::INFINITY)),
        );
        hits.clear();
        tile.context.trace.closest_each(&rays, &mut hits);
        for (path, hit) in active.drain(..).zip(&hits) {
            let Some(hit) = hit else {
                if !LIGHT {
                    escaped[path as usize] = tile.escaped(paths, path as usize, edge);
                }
                continue;
            };
            let state = &mut paths.states[path as usize];
            let at_hit = if LIGHT {
                None
            } else {
                tile.emission_at(state, hit, edge)
            };
            let emission = at_hit.map_or(Vec3::ZERO, |(emission, _)| emission);
            match tile.table.class(hit.primitive).filter(|_| !last) {
                Some(class) => {
                    state.set_hit(hit, emission);
                    by_class[class].push(path);
                }
                None if emission != Vec3::ZERO => {
                    let mut vertex = VertexRecord {
                        emission,
                        ..VertexRecord::default()
                    };
                    if let (true, Some((_, at))) = (TIMED, at_hit) {
                        let mut path_time = tile.path_time(state, path as usize, edge);
                        path_time.add_segment(at);
                        let OpticalLength {
                            path,
                            delays,
                            index,
                            ..
                        } = path_time.optical();
                        vertex.set_optical([path, delays, index]);
                    }
                    paths.push(path as usize, vertex);
                }
                None => {}
            }
        }
        for (class, list) in by_class.iter_mut().enumerate() {
            let step = WalkStep {
                tile,
                class,
                edge,
                may_continue: edge < max_edges,
            };
            dispatch(
                tile.table.width,
                WalkKernel::<LIGHT, TIMED> { step, list, paths },
            );
            list.clear();
        }
        std::mem::swap(&mut active, &mut paths.active);
    }
    paths.active = active;
}

/// Parameters of one step of paths that hit surfaces of one class.
struct WalkStep<'a, const TIMED: bool> {
    tile: &'a TileContext<'a, TIMED>,
    class: usize,
    /// Number of the edge that led to the surface.
    edge: u32,
    /// Whether the maximum depth allows another edge.
    may_continue: bool,
}

/// Kernel that runs a step of all listed paths.
struct WalkKernel<'a, const LIGHT: bool, const TIMED: bool> {
    step: WalkStep<'a, TIMED>,
    list: &'a [u32],
    paths: &'a mut TileSubpaths,
}

impl<const LIGHT: bool, const TIMED: bool> SimdKernel for WalkKernel<'_, LIGHT, TIMED> {
    type Output = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        for group in self.list.chunks(N) {
            let lanes = map_array(padded(group), |path| path as usize);
            self.step
                .advance::<R, N, LIGHT>(lanes, R::Mask::first(group.len()), self.paths);
        }
    }
}

impl<const TIMED: bool> WalkStep<'_, TIMED> {
    /// Runs the step of one path per lane: stores the vertex, samples the BSDF, and sets up the
    /// next edge.
    #[inline(always)]
    fn advance<R: Lanes<N>, const N: usize, const LIGHT: bool>(
        &self,
        lanes: [usize; N],
        active: R::Mask,
        paths: &mut TileSubpaths,
    ) {
        let WalkStep { tile, edge, .. } = *self;
        let (table, context, h) = (tile.table, tile.context, tile.h);
        let traits = table.traits(self.class);
        let mode = if LIGHT {
            TransportMode::Importance
        } else {
            TransportMode::Radiance
        };
        let zero = R::splat(0.0);
        let states: [&SubpathState; N] = map_array(lanes, |i| &paths.states[i]);
        let ray_row = R::transpose_load(map_array(states, |s| &s.rows[0]));
        let origin_row = R::transpose_load(map_array(states, |s| &s.rows[1]));
        let hit_row = R::transpose_load(map_array(states, |s| &s.rows[2]));
        let state_row = R::transpose_load(map_array(states, |s| &s.rows[3]));
        let mut weights = [[0.0; N]; 3];
        let mut primitives = [0; N];
        let mut materials = [0; N];
        for (i, state) in states.into_iter().enumerate() {
            [weights[0][i], weights[1][i], weights[2][i]] = state.weights;
            primitives[i] = state.rows[2].0[3].to_bits();
            materials[i] = table.material_of[primitives[i] as usize];
        }
        let (origin, dir) = (
            R::Vec3::new(ray_row[0], ray_row[1], ray_row[2]),
            R::Vec3::new(ray_row[3], ray_row[4], ray_row[5]),
        );
        let throughput = R::Vec3::new(ray_row[6], ray_row[7], origin_row[0]);
        let before = [
            R::Vec3::new(origin_row[1], origin_row[2], origin_row[3]),
            R::Vec3::new(origin_row[4], origin_row[5], origin_row[6]),
        ];

        let hits = RayHits {
            origin,
            dir,
            t: hit_row[0],
            uv: [hit_row[1], hit_row[2]],
            primitives,
            instances: [NONE; N],
        };
        let surface = Surface::at_hits(context.scene, &traits.surface, &hits, materials);
        let point = surface.point();
        let mut optical = if LIGHT && edge == 1 {
            OpticalLength {
                path: zero,
                delays: zero,
                delay: zero,
                index: R::splat(1.0),
            }
        } else {
            OpticalLength {
                path: state_row[3],
                delays: zero,
                delay: zero,
                index: state_row[4],
            }
        };
        if TIMED {
            if !LIGHT {
                optical.delays = tile.emission_delays.for_lanes(lanes);
            }
            if LIGHT || time_of_flight::edge_counts(context, edge) {
                optical.add_segment(before[0], point.position);
            }
        }
        let here = [point.position, point.n_geometric];
        let wo = -dir;
        let (valid, partials, back) = if LIGHT && edge == 1 {
            let indices = R::store_words(state_row[3].bits());
            let lights = context.lights.with_indices::<R, N>(indices, active);
            let end = LightEnd::new(&lights, before, dir, here);
            let (valid, partials) = MisPartials::new(h, end.edge_partials(h), end.next);
            (valid, partials, end.back)
        } else {
            let [forward, back] = area_factors(before, here);
            let [pdf_w, d_vcm, d_vc] = weights.each_ref();
            let partials = EdgePartials {
                d_vcm: R::load_doubles(d_vcm),
                d_vc: R::load_doubles(d_vc),
            };
            let (valid, partials) =
                MisPartials::new(h, partials, R::load_doubles(pdf_w) * forward.double());
            (valid, partials, back)
        };
        let bsdfs = map_array(materials, |m| &table.bsdfs[m as usize]);
        let vertices = Vertices::<R>::new(point, wo, bsdfs, &traits, active & valid);
        let [p, n, ns, t] = [
            point.position,
            point.n_geometric,
            point.n_shading,
            throughput,
        ];
        let first = R::transpose_store([p.x(), p.y(), p.z(), n.x(), n.y(), n.z(), back, zero]);
        let second =
            R::transpose_store([ns.x(), ns.y(), ns.z(), wo.x(), wo.y(), wo.z(), t.x(), t.y()]);
        let (last, d_vcm, d_vc) = (
            t.z().store(),
            R::store_doubles(partials.d_vcm),
            R::store_doubles(partials.d_vc),
        );
        let created = (active & valid).bits();
        let [length, delays, index] = [
            optical.path.store(),
            optical.delays.store(),
            optical.index.store(),
        ];
        for i in active_lanes(created) {
            let mut rows = [first[i], second[i], Default::default()];
            rows[0].0[7] = f32::from_bits(materials[i]);
            rows[2].0[0] = last[i];
            let emission = Vec3::from_slice(&paths.states[lanes[i]].rows[3].0[5..]);
            let class = Some(self.class as u8);
            let mut vertex = VertexRecord {
                rows,
                partials: [d_vcm[i], d_vc[i]],
                class,
                emission,
                next: 0,
            };
            if TIMED {
                vertex.set_optical([length[i], delays[i], index[i]]);
            }
            paths.push(lanes[i], vertex);
        }
        if !self.may_continue || created == 0 {
            return;
        }

        let key = [
            hit_row[4].bits(),
            hit_row[5].bits(),
            hit_row[6].bits(),
            hit_row[7].bits(),
        ];
        let mut taken = state_row[2].bits();
        let [choice, u, v] = independent::next_three(key, taken);
        taken = taken.add(R::Word::splat(3));
        let (mut continues, s, reverse) = vertices.sample::<true>(choice, [u, v], mode);
        let (wi, weight, eta) = (s.wi, s.weight, s.eta);
        let rr_weight = if LIGHT { weight } else { weight * (eta * eta) };
        let mut rr_throughput = R::Vec3::new(origin_row[7], state_row[0], state_row[1]) * rr_weight;
        let mut throughput = throughput * weight;
        if context.rr_start.is_some_and(|start| edge >= start) {
            let max_component = rr_throughput
                .x()
                .max(rr_throughput.y())
                .max(rr_throughput.z());
            let survival = max_component.min(R::splat(MAX_SURVIVAL));
            let [u, ..] = independent::next_three(key, taken);
            taken = R::Word::select(continues, taken.add(R::Word::splat(1)), taken);
            continues = continues & u.lt(survival);
            rr_throughput = rr_throughput / survival;
            throughput = throughput / survival;
        }
        continues = continues & !throughput.same(R::Vec3::broadcast(Vec3::ZERO));
        let endpoint = MisEndpoint { partials, back };
        let (pdf_w, partials) =
            endpoint.next_edge(h, mode, [wo, wi, n], [s.pdf_w, reverse], (s.delta, eta));
        let start = offset_by_axis(p, towards(n, wi));
        let [o, d, t] = [start, wi, throughput];
        let ray_row = R::transpose_store([o.x(), o.y(), o.z(), d.x(), d.y(), d.z(), t.x(), t.y()]);
        let origin_row = R::transpose_store([
            t.z(),
            p.x(),
            p.y(),
            p.z(),
            n.x(),
            n.y(),
            n.z(),
            rr_throughput.x(),
        ]);
        let (y, z) = (rr_throughput.y().store(), rr_throughput.z().store());
        let taken = taken.bits_to_float().store();
        let (pdf_w, d_vcm, d_vc) = (
            R::store_doubles(pdf_w),
            R::store_doubles(partials.d_vcm),
            R::store_doubles(partials.d_vc),
        );
        if TIMED {
            optical.scatter(eta);
            let index = optical.index.store();
            for i in active_lanes(continues.bits()) {
                paths.states[lanes[i]].rows[3].0[3..5].copy_from_slice(&[length[i], index[i]]);
            }
        }
        for i in active_lanes(created) {
            paths.states[lanes[i]].rows[3].0[2] = taken[i];
        }
        for i in active_lanes(continues.bits()) {
            let state = &mut paths.states[lanes[i]];
            (state.rows[0], state.rows[1]) = (ray_row[i], origin_row[i]);
            state.rows[3].0[..2].copy_from_slice(&[y[i], z[i]]);
            state.weights = [pdf_w[i], d_vcm[i], d_vc[i]];
            paths.active.push(lanes[i] as u32);
        }
    }
}
