//! Vectorised shading: one step of one path per lane, for `nee` and `bpt`. All paths of a vector
//! hit surfaces of one class.

use glam::Vec3;

use super::light_sampling::{LightSample, LightTable};
use super::material_classes::{ClassTraits, MaterialTable};
use super::time_of_flight;
use super::vertices::{Vertices, surface_points};
use super::{PathTile, PendingLight, SPECULAR};
use lumbre_light::math::real::{Double, Mask, Vector, Word};
use lumbre_light::math::simd::{
    F32x8, Lanes, SimdKernel, active_lanes, dispatch, map_array, padded,
};
use lumbre_light::transport::MAX_SURVIVAL;
use lumbre_light::transport::bsdf::{BsdfValue, TransportMode};
use lumbre_light::transport::integrator::Context;
use lumbre_light::transport::path_time::OpticalLength;
use lumbre_light::transport::ray::{Ray, offset_by_axis};
use lumbre_light::transport::sampler::independent;
use lumbre_light::transport::surface::SurfacePoint;
use lumbre_light::transport::vertex::towards;

/// Returns the shadow rays between two points, each given by position and normal. In the lanes of
/// `infinite` they go from the first point towards `wi`. Each row holds origin, direction and
/// distance, and is read by [`shadow_ray`].
#[inline(always)]
pub(super) fn shadow_rays<R: Lanes<N>, const N: usize>(
    [from, n]: [R::Vec3; 2],
    [at, n_at]: [R::Vec3; 2],
    wi: R::Vec3,
    infinite: R::Mask,
) -> [F32x8; N] {
    let edge = at - from;
    let origin = offset_by_axis(from, towards(n, R::Vec3::select(infinite, wi, edge)));
    let target = offset_by_axis(at, towards(n_at, -edge));
    let edge = target - origin;
    let distance = edge.length();
    let dir = R::Vec3::select(infinite, wi, edge / distance);
    let distance = R::select(infinite, R::splat(f32::INFINITY), distance);
    R::transpose_store([
        origin.x(),
        origin.y(),
        origin.z(),
        dir.x(),
        dir.y(),
        dir.z(),
        distance,
        R::splat(0.0),
    ])
}

/// Returns the ray and its maximum distance from a row of [`shadow_rays`].
#[inline]
pub(super) fn shadow_ray(row: &F32x8) -> (Ray, f32) {
    let [x, y, z, dx, dy, dz, distance, _] = row.0;
    (
        Ray {
            origin: Vec3::new(x, y, z),
            dir: Vec3::new(dx, dy, dz),
        },
        distance,
    )
}

/// Runs one step of paths that hit surfaces of one class. Appends the paths that continue to
/// `tile.next`.
pub(super) fn shade_class<const TIMED: bool>(
    table: &MaterialTable,
    traits: ClassTraits,
    context: &Context,
    depth: u32,
    paths: &[u32],
    tile: &mut PathTile,
) {
    dispatch(
        table.width,
        ShadeKernel::<TIMED> {
            table,
            traits,
            context,
            depth,
            paths,
            tile,
        },
    );
}

/// Kernel of [`shade_class`].
struct ShadeKernel<'a, const TIMED: bool> {
    table: &'a MaterialTable,
    traits: ClassTraits,
    context: &'a Context<'a>,
    depth: u32,
    paths: &'a [u32],
    tile: &'a mut PathTile,
}

impl<const TIMED: bool> SimdKernel for ShadeKernel<'_, TIMED> {
    type Output = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        for group in self.paths.chunks(N) {
            shade_lanes::<R, N, TIMED>(
                self.table,
                self.traits,
                self.context,
                self.depth,
                group,
                self.tile,
            );
        }
    }
}

/// Runs one step of the paths in `group`: light sampling, BSDF sampling and Russian roulette.
#[inline(always)]
fn shade_lanes<R: Lanes<N>, const N: usize, const TIMED: bool>(
    table: &MaterialTable,
    traits: ClassTraits,
    context: &Context,
    depth: u32,
    group: &[u32],
    tile: &mut PathTile,
) {
    let lanes = map_array(padded(group), |path| path as usize);
    let zero = R::splat(0.0);
    let records = map_array(lanes, |i| &tile.records[i]);
    let ray_row = R::transpose_load(map_array(records, |r| &r.rows[0]));
    let state_row = R::transpose_load(map_array(records, |r| &r.rows[1]));
    let hit_row = R::transpose_load(map_array(records, |r| &r.rows[2]));
    let (origin, dir) = (
        R::Vec3::new(ray_row[0], ray_row[1], ray_row[2]),
        R::Vec3::new(ray_row[3], ray_row[4], ray_row[5]),
    );
    let throughput = R::Vec3::new(ray_row[6], ray_row[7], state_row[0]);
    let key = [
        hit_row[4].bits(),
        hit_row[5].bits(),
        hit_row[6].bits(),
        hit_row[7].bits(),
    ];
    let mut taken = state_row[6].bits();
    let primitives = map_array(records, |r| r.rows[2].0[3].to_bits());
    let active = R::Mask::first(group.len());

    let point = surface_points::<R, N>(
        context.scene,
        traits.sphere,
        primitives,
        [origin, dir],
        [hit_row[0], hit_row[1], hit_row[2]],
    );
    let mut optical = OpticalLength {
        path: state_row[7],
        delays: zero,
        delay: zero,
        index: zero,
    };
    if TIMED {
        optical.delays = tile.emission_delays.for_lanes(lanes);
        optical.index = R::load(&map_array(lanes, |i| tile.medium_index[i]));
        if time_of_flight::edge_counts(context, depth) {
            let from = if depth == 1 {
                origin
            } else {
                R::Vec3::new(state_row[1], state_row[2], state_row[3])
            };
            optical.add_segment(from, point.position);
        }
    }
    let materials = map_array(primitives, |p| {
        &table.bsdfs[table.material_of[p as usize] as usize]
    });
    let vertices = Vertices::<R>::new(point, -dir, materials, &traits, active);

    if traits.connected {
        let numbers = independent::next_three(key, taken);
        taken = taken.add(R::Word::splat(3));
        sample_light::<R, N, TIMED>(
            context,
            &table.lights,
            &vertices,
            (throughput, &optical),
            numbers,
            lanes,
            tile,
        );
    }

    let [choice, u, v] = independent::next_three(key, taken);
    taken = taken.add(R::Word::splat(3));
    let (mut continues, s, _) = vertices.sample::<false>(choice, [u, v], TransportMode::Radiance);
    let wi = s.wi;
    let mut throughput = throughput * s.weight;
    let eta_scale = state_row[5] * (s.eta * s.eta);
    if context.rr_start.is_some_and(|start| depth >= start) {
        let max_component = throughput.x().max(throughput.y()).max(throughput.z());
        let survival = (max_component * eta_scale).min(R::splat(MAX_SURVIVAL));
        let [u, ..] = independent::next_three(key, taken);
        taken = taken.add(R::Word::splat(1));
        continues = continues & u.lt(survival);
        throughput = throughput / survival;
    }
    continues = continues & !throughput.same(R::Vec3::broadcast(Vec3::ZERO));
    let last_pdf_w = R::select(s.delta, R::splat(SPECULAR), s.pdf_w);
    let from = vertices.point.position;
    let start = offset_by_axis(from, towards(vertices.point.n_geometric, wi));
    let ray_row = [
        start.x(),
        start.y(),
        start.z(),
        wi.x(),
        wi.y(),
        wi.z(),
        throughput.x(),
        throughput.y(),
    ];
    let state_row = [
        throughput.z(),
        from.x(),
        from.y(),
        from.z(),
        last_pdf_w,
        eta_scale,
        taken.bits_to_float(),
        optical.path,
    ];
    let (rays, states) = (R::transpose_store(ray_row), R::transpose_store(state_row));
    if TIMED {
        optical.scatter(s.eta);
        let index = optical.index.store();
        active_lanes(continues.bits()).for_each(|i| tile.medium_index[lanes[i]] = index[i]);
    }
    for i in active_lanes(continues.bits()) {
        tile.records[lanes[i]].rows[0] = rays[i];
        tile.records[lanes[i]].rows[1] = states[i];
        tile.next.push(lanes[i] as u32);
    }
}

/// Connects each vertex to a sampled light, as `nee` does, and appends the contributions to
/// `tile.pending_lights`, whose shadow rays are traced later.
#[inline(always)]
fn sample_light<R: Lanes<N>, const N: usize, const TIMED: bool>(
    context: &Context,
    lights: &LightTable,
    vertices: &Vertices<R>,
    (throughput, optical): (R::Vec3, &OpticalLength<R>),
    numbers: [R; 3],
    lanes: [usize; N],
    tile: &mut PathTile,
) {
    let zero = R::splat(0.0);
    let SurfacePoint {
        position: from,
        n_geometric,
        n_shading,
    } = vertices.point;
    let sample = lights.sample(context, from, numbers, vertices.visible);
    let LightSample {
        wi,
        radiance,
        density,
        ..
    } = sample;
    let arrives = vertices.visible & density.gt(zero);
    if !arrives.any() {
        return;
    }
    let BsdfValue { f, pdf_w, .. } =
        vertices.evaluate::<false>(wi, TransportMode::Radiance, arrives);
    let radiance = f * wi.dot(n_shading).abs() * radiance / density;
    let lit = arrives & !radiance.same(R::Vec3::broadcast(Vec3::ZERO));
    let weight = match context.settings.mis {
        Some(h) => R::select(sample.delta, R::splat(1.0), h.weight(density, pdf_w)),
        None => R::splat(1.0),
    };
    let value = throughput * radiance * weight;
    let rays = shadow_rays::<R, N>(
        [from, n_geometric],
        [sample.at, sample.normal],
        wi,
        sample.infinite,
    );
    let values = R::transpose_store([
        value.x(),
        value.y(),
        value.z(),
        zero,
        zero,
        zero,
        zero,
        zero,
    ]);
    if TIMED && let Some(timing) = context.timing {
        let positions = R::store_doubles(timing.axis.bin_positions(
            vertices.direct_length(context, optical, &sample),
            R::Double::splat,
        ));
        tile.bin_positions
            .extend(active_lanes(lit.bits()).map(|i| positions[i]));
    }
    for i in active_lanes(lit.bits()) {
        let (ray, distance) = shadow_ray(&rays[i]);
        let [r, g, b, ..] = values[i].0;
        tile.pending_lights.push(PendingLight {
            ray,
            distance,
            value: Vec3::new(r, g, b),
            path: lanes[i] as u32,
        });
    }
}
