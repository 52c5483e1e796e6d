//! Samples the first vertices and edges of light subpaths, and connects the first vertices to the
//! lens (`s = 1`, `t = 1`).
//!
//! Connections of the environment to the lens are evaluated by the scalar code, all others in
//! vectors. Both give the bits of the scalar `bdpt`.

use glam::Vec3;

use super::connect::load::{load_words, sampler_keys};
use super::connect::{ShadowQueue, Splat, Target};
use super::{TileContext, TileSubpaths};
use crate::cpu::wavefront::bdpt::shadow_rays::shadow_rays;
use lumbre_light::math::real::{Double, Mask, Vector, Word};
use lumbre_light::math::simd::{
    F32x8, Lanes, SimdKernel, active_lanes, dispatch, map_array, padded,
};
use lumbre_light::scene::compile::Uv;
use lumbre_light::transport::integrator::bdpt::connect::connect_s1_t1;
use lumbre_light::transport::integrator::bdpt::weights::{LightEnd, others_s1_t1};
use lumbre_light::transport::light::{LightId, LightPoint};
use lumbre_light::transport::ray::offset_by_axis;
use lumbre_light::transport::sampler::independent;
use lumbre_light::transport::vertex::towards;

/// Number of random numbers drawn for the start of a light subpath.
const DRAWS_PER_START: u32 = 5;

/// Sampled first vertex of a light subpath, in two rows. Row 0: position, normal, index of the light,
/// and 1 if a light was sampled. Row 1: texture coordinates, and direction of the first edge.
#[derive(Clone, Copy, Debug, Default)]
struct LightStart([F32x8; 2]);

impl LightStart {
    /// Returns the index of the light, or `None` if no light was sampled.
    fn light(&self) -> Option<u32> {
        let [.., index, some] = self.0[0].0;
        (some > 0.0).then(|| index.to_bits())
    }
}

/// Pending connection of a first vertex to the lens (`s = 1`, `t = 1`).
#[derive(Clone, Copy)]
struct StartConnection {
    path: u32,
    /// Number of random numbers drawn before.
    taken: u32,
}

/// First vertices of the light subpaths of a tile.
#[derive(Default)]
pub(super) struct LightStarts {
    /// First vertex of every path.
    by_path: Vec<LightStart>,
    /// Listed connections to the lens.
    connections: Vec<StartConnection>,
}

impl LightStarts {
    /// Samples the first vertex and edge of all light subpaths. Their samplers continue those of
    /// the camera subpaths, which must have ended. Paths with a non-zero throughput become active
    /// if the maximum depth allows an edge.
    pub fn sample<const TIMED: bool>(
        &mut self,
        tile: &TileContext<TIMED>,
        camera: &TileSubpaths,
        light: &mut TileSubpaths,
    ) {
        self.connections.clear();
        self.by_path.clear();
        self.by_path
            .resize(camera.states.len(), LightStart::default());
        light.states.clear();
        light.states.extend_from_slice(&camera.states);
        if tile.context.max_depth == 0 {
            return;
        }
        dispatch(
            tile.table.width,
            SampleStarts {
                starts: self,
                tile,
                light,
            },
        );
        if tile.context.max_depth == 1 {
            light.active.clear();
        }
    }

    /// Samples the first vertex and edge of one light subpath per lane.
    #[inline(always)]
    fn sample_lanes<R: Lanes<N>, const N: usize, const TIMED: bool>(
        &mut self,
        tile: &TileContext<TIMED>,
        paths: [u32; N],
        active: R::Mask,
        light: &mut TileSubpaths,
    ) {
        let zero = R::splat(0.0);
        let (key, taken) = (
            sampler_keys::<R, N>(light, paths),
            load_words::<R, N>(map_array(paths, |p| light.states[p as usize].taken())),
        );
        let [choice, u0, u1] = independent::next_three(key, taken);
        let [v0, v1, _] = independent::next_three(key, taken.add(R::Word::splat(3)));
        let lights = tile.context.lights.select::<R, N>(choice, active);
        let start = lights.sample_emission(tile.context.scene, [u0, u1], [v0, v1]);
        let throughput = start.radiance * start.cos / (start.pdf_a * start.pdf_w);
        let usable = active & start.starts();
        let continues = (usable & !throughput.same(R::Vec3::broadcast(Vec3::ZERO))).bits();
        let [p, n, d, t] = [
            start.point.position,
            start.point.normal,
            start.dir,
            throughput,
        ];
        let o = offset_by_axis(p, towards(n, d));
        let ray_row = R::transpose_store([o.x(), o.y(), o.z(), d.x(), d.y(), d.z(), t.x(), t.y()]);
        let one = R::splat(1.0);
        let origin_row = R::transpose_store([t.z(), p.x(), p.y(), p.z(), n.x(), n.y(), n.z(), one]);
        let index = R::load_words(&lights.indices).bits_to_float();
        let point = R::transpose_store([p.x(), p.y(), p.z(), n.x(), n.y(), n.z(), index, one]);
        let [a, b, e, f] = start.point.uv.to_array();
        let emission = R::transpose_store([a, b, e, f, d.x(), d.y(), d.z(), zero]);
        for i in active_lanes(active.bits()) {
            let state = &mut light.states[paths[i] as usize];
            let taken = f32::from_bits(state.taken() + DRAWS_PER_START);
            state.rows[3].0[2] = taken;
            if usable.bits() & 1 << i != 0 {
                (state.rows[0], state.rows[1]) = (ray_row[i], origin_row[i]);
                let index = f32::from_bits(lights.indices[i]);
                state.rows[3].0[..4].copy_from_slice(&[1.0, 1.0, taken, index]);
                self.by_path[paths[i] as usize] = LightStart([point[i], emission[i]]);
                if continues & 1 << i != 0 {
                    light.active.push(paths[i]);
                }
            }
        }
    }

    /// Lists the connection of a path's first vertex to the lens, if it has one. `taken` random
    /// numbers were drawn before; returns how many are drawn after it.
    pub fn list(&mut self, path: usize, taken: u32) -> u32 {
        if self.by_path[path].light().is_none() {
            return taken;
        }
        self.connections.push(StartConnection {
            path: path as u32,
            taken,
        });
        taken + 4
    }

    /// Connects all listed vertices to the lens. Contributions of surfaces are appended to `queue`;
    /// those of the environment are evaluated with the scalar code and splatted. No camera path
    /// finds other lights, which are not connected.
    pub fn connect_to_lens<const TIMED: bool>(
        &self,
        tile: &TileContext<TIMED>,
        light: &TileSubpaths,
        queue: &mut ShadowQueue,
        splat: &mut Splat,
    ) {
        let mut surfaces = Vec::with_capacity(self.connections.len());
        for connection in &self.connections {
            let StartConnection { path, taken } = *connection;
            let start = &self.by_path[path as usize];
            match start.light().map(|index| tile.context.lights.id(index)) {
                Some(LightId::Emitter(_)) => surfaces.push(*connection),
                Some(LightId::Environment) => {
                    let [x, y, z, a, b, c, ..] = start.0[0].0;
                    let point = LightPoint {
                        lights: [LightId::Environment],
                        position: Vec3::new(x, y, z),
                        normal: Vec3::new(a, b, c),
                        uv: Uv::zero(),
                    };
                    let [_, _, _, _, x, y, z, _] = start.0[1].0;
                    let mut sampler = light.states[path as usize].sampler(taken);
                    let delay = tile.emission_delays.for_path(path as usize);
                    let dir = Vec3::new(x, y, z);
                    if let Some((connection, at)) =
                        connect_s1_t1(tile.context, tile.h, &point, dir, delay, &mut sampler)
                    {
                        let value = tile.weighted(Some(connection));
                        splat(path, at.pixel, value, connection.length);
                    }
                }
                _ => {}
            }
        }
        dispatch(
            tile.table.width,
            ConnectStarts {
                starts: self,
                tile,
                connections: &surfaces,
                light,
                queue,
            },
        );
    }

    /// Evaluates connections of first vertices to the lens (`s = 1`, `t = 1`).
    #[inline(always)]
    fn connect_lanes<R: Lanes<N>, const N: usize, const TIMED: bool>(
        &self,
        tile: &TileContext<TIMED>,
        connections: [StartConnection; N],
        active: R::Mask,
        light: &TileSubpaths,
        queue: &mut ShadowQueue,
    ) {
        let zero = R::splat(0.0);
        let starts = map_array(connections, |c| &self.by_path[c.path as usize].0);
        let [x, y, z, a, b, c, index, _] = R::transpose_load(map_array(starts, |rows| &rows[0]));
        let [u0, u1, u2, u3, ..] = R::transpose_load(map_array(starts, |rows| &rows[1]));
        let (at, normal) = (R::Vec3::new(x, y, z), R::Vec3::new(a, b, c));
        let indices = R::store_words(index.bits());
        let lights = tile.context.lights.with_indices::<R, N>(indices, active);
        let point = LightPoint {
            lights: lights.ids(),
            position: at,
            normal,
            uv: Uv::from_array([u0, u1, u2, u3]),
        };
        let numbers = tile.lens_numbers::<R, N>(
            light,
            map_array(connections, |c| c.path),
            map_array(connections, |c| c.taken),
        );
        let projection = tile.project_to_film(at, numbers, active);
        if !projection.inside.any() {
            return;
        }
        let (lens, dir) = (projection.at.lens, projection.at.dir);
        let zero_vector = R::Vec3::broadcast(Vec3::ZERO);
        let cos = normal.dot(-dir);
        let end = LightEnd::new(&lights, [at, normal], -dir, [lens, zero_vector]);
        let per_area = (projection.importance.double() / end.start).single();
        let radiance = lights.emitted(tile.context.scene, &point, -dir);
        let unweighted = radiance * cos * per_area;
        let lit = projection.inside & cos.gt(zero) & !unweighted.same(zero_vector);
        let values = tile.mis_weighted::<R, N>(
            unweighted,
            others_s1_t1(tile.h, &end, projection.at.pdf_w),
            lit,
        );
        let rays = shadow_rays::<R, N>(
            [at, normal],
            [lens, zero_vector],
            dir,
            R::Mask::splat(false),
        );
        if TIMED {
            let lengths = R::store_doubles(tile.lens_path_lengths::<R, N>(
                map_array(connections, |c| c.path),
                projection.at.distance,
            ));
            queue
                .lengths
                .extend(active_lanes(lit.bits()).map(|i| lengths[i]));
        }
        for i in active_lanes(lit.bits()) {
            queue.push(
                &rays[i],
                &values[i],
                Target::Splat(connections[i].path, projection.pixels[i]),
            );
        }
    }
}

/// Kernel of [`LightStarts::sample`].
struct SampleStarts<'a, const TIMED: bool> {
    starts: &'a mut LightStarts,
    tile: &'a TileContext<'a, TIMED>,
    light: &'a mut TileSubpaths,
}

impl<const TIMED: bool> SimdKernel for SampleStarts<'_, TIMED> {
    type Output = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        let paths: Vec<u32> = (0..self.starts.by_path.len() as u32).collect();
        for group in paths.chunks(N) {
            let active = R::Mask::first(group.len());
            self.starts
                .sample_lanes::<R, N, TIMED>(self.tile, padded(group), active, self.light);
        }
    }
}

/// Kernel of [`LightStarts::connect_to_lens`].
struct ConnectStarts<'a, const TIMED: bool> {
    starts: &'a LightStarts,
    tile: &'a TileContext<'a, TIMED>,
    connections: &'a [StartConnection],
    light: &'a TileSubpaths,
    queue: &'a mut ShadowQueue,
}

impl<const TIMED: bool> SimdKernel for ConnectStarts<'_, TIMED> {
    type Output = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        for group in self.connections.chunks(N) {
            let active = R::Mask::first(group.len());
            self.starts.connect_lanes::<R, N, TIMED>(
                self.tile,
                padded(group),
                active,
                self.light,
                self.queue,
            );
        }
    }
}
