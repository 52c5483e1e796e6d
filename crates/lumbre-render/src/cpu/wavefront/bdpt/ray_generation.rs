//! Samples the first vertices and edges of light subpaths, and connects the first vertices to the
//! lens (`s = 1`, `t = 1`).
//!
//! Triangles with uniform emission are treated in vectors, all other lights with the scalar code.
//! Both give the bits of the scalar `bdpt`.

use glam::Vec3;

use super::connect::load::{load_words, sampler_keys};
use super::connect::{ShadowQueue, Splat, Target};
use super::{SubpathState, TileContext, TileSubpaths};
use crate::cpu::wavefront::light_sampling::{SelectedLight, triangle_mis_terms};
use crate::cpu::wavefront::shade::shadow_rays;
use lumbre_light::math::real::{Double, Mask, Vector, Word};
use lumbre_light::math::simd::{
    F32x8, Lanes, SimdKernel, active_lanes, dispatch, map_array, padded,
};
use lumbre_light::math::{Frame, warp};
use lumbre_light::transport::integrator::bdpt::connect::connect_s1_t1;
use lumbre_light::transport::integrator::bdpt::weights::others_s1_t1;
use lumbre_light::transport::light::{EmissionSample, area};
use lumbre_light::transport::ray::{Ray, offset_by_axis};
use lumbre_light::transport::sampler::{Sampler, independent};
use lumbre_light::transport::vertex::{self, towards};

/// Number of random numbers drawn for the start of a light subpath.
const DRAWS_PER_START: u32 = 5;

/// Sampled first vertex of a light subpath.
#[derive(Clone, Copy, Debug)]
pub(super) enum LightStart {
    /// No light was sampled.
    None,
    /// Point on a triangle with uniform emission. Row 0: position, normal, selection probability
    /// and area. Row 1: radiance.
    Triangle([F32x8; 2]),
    /// Point on any other light, sampled by the scalar code.
    Scalar(EmissionSample),
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
    pub by_path: Vec<LightStart>,
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
        self.by_path.resize(camera.states.len(), LightStart::None);
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
        let SelectedLight {
            rows: [a, b],
            probability,
            scalar_lanes,
            ..
        } = tile.table.lights.select(tile.context, choice, active);
        let corners = [
            R::Vec3::new(a[0], a[1], a[2]),
            R::Vec3::new(a[3], a[4], a[5]),
            R::Vec3::new(a[6], a[7], b[0]),
        ];
        let (at, normal) = area::on_triangle(corners, warp::uniform_triangle([u0, u1]));
        let local: R::Vec3 = warp::cosine_hemisphere([v0, v1]);
        let dir = Frame::from_normal(normal).to_world(local);
        let radiance = R::Vec3::new(b[2], b[3], b[4]);
        let (inverse_area, pdf_w) = (
            R::splat(1.0) / b[1],
            warp::cosine_hemisphere_pdf_w(local.z()),
        );
        let throughput = radiance * local.z() / (inverse_area * probability * pdf_w);
        let usable = active & b[5].gt(zero) & pdf_w.gt(zero) & inverse_area.gt(zero);
        let continues = (usable & !throughput.same(R::Vec3::broadcast(Vec3::ZERO))).bits();
        let [p, n, d, t] = [at, normal, dir, throughput];
        let o = offset_by_axis(p, towards(n, d));
        let ray_row = R::transpose_store([o.x(), o.y(), o.z(), d.x(), d.y(), d.z(), t.x(), t.y()]);
        let origin_row = R::transpose_store([
            t.z(),
            p.x(),
            p.y(),
            p.z(),
            n.x(),
            n.y(),
            n.z(),
            R::splat(1.0),
        ]);
        let point =
            R::transpose_store([p.x(), p.y(), p.z(), n.x(), n.y(), n.z(), probability, b[1]]);
        let emission = R::transpose_store([b[2], b[3], b[4], zero, zero, zero, zero, zero]);
        for i in active_lanes(active.bits()) {
            let state = &mut light.states[paths[i] as usize];
            let sampler = state.sampler(state.taken());
            state.rows[3].0[2] = f32::from_bits(state.taken() + DRAWS_PER_START);
            if usable.bits() & 1 << i != 0 {
                let [.., probability, area] = point[i].0;
                (state.rows[0], state.rows[1]) = (ray_row[i], origin_row[i]);
                state.set_light([probability, area]);
                self.by_path[paths[i] as usize] = LightStart::Triangle([point[i], emission[i]]);
                if continues & 1 << i != 0 {
                    light.active.push(paths[i]);
                }
            } else if scalar_lanes & 1 << i != 0
                && let Some(start) = sample_scalar(tile, state, sampler)
            {
                self.by_path[paths[i] as usize] = LightStart::Scalar(start);
                if state.throughput() != Vec3::ZERO {
                    light.active.push(paths[i]);
                }
            }
        }
    }

    /// Lists the connection of a path's first vertex to the lens, if it has one. `taken` random
    /// numbers were drawn before; returns how many are drawn after it.
    pub fn list(&mut self, path: usize, taken: u32) -> u32 {
        if matches!(self.by_path[path], LightStart::None) {
            return taken;
        }
        self.connections.push(StartConnection {
            path: path as u32,
            taken,
        });
        taken + 4
    }

    /// Connects all listed vertices to the lens. Contributions of triangles with uniform emission
    /// are appended to `queue`; those of all other lights are evaluated with the scalar code and
    /// splatted.
    pub fn connect_to_lens<const TIMED: bool>(
        &self,
        tile: &TileContext<TIMED>,
        light: &TileSubpaths,
        queue: &mut ShadowQueue,
        splat: &mut Splat,
    ) {
        let (triangles, others): (Vec<StartConnection>, Vec<StartConnection>) = self
            .connections
            .iter()
            .partition(|c| matches!(self.by_path[c.path as usize], LightStart::Triangle(_)));
        for StartConnection { path, taken } in others {
            if let LightStart::Scalar(start) = &self.by_path[path as usize] {
                let mut sampler = light.states[path as usize].sampler(taken);
                let delay = tile.emission_delays.for_path(path as usize);
                if let Some((connection, at)) =
                    connect_s1_t1(tile.context, tile.h, start, delay, &mut sampler)
                {
                    splat(
                        path,
                        at.pixel,
                        tile.weighted(Some(connection)),
                        connection.length,
                    );
                }
            }
        }
        dispatch(
            tile.table.width,
            ConnectStarts {
                starts: self,
                tile,
                connections: &triangles,
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
        let starts = map_array(connections, |s| match self.by_path[s.path as usize] {
            LightStart::Triangle(rows) => rows,
            _ => [F32x8::default(); 2],
        });
        let [x, y, z, a, b, c, probability, area] =
            R::transpose_load(starts.each_ref().map(|rows| &rows[0]));
        let [red, green, blue, ..] = R::transpose_load(starts.each_ref().map(|rows| &rows[1]));
        let (at, normal) = (R::Vec3::new(x, y, z), R::Vec3::new(a, b, c));
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
        let end =
            triangle_mis_terms::<R>([at, normal], [lens, zero_vector], -dir, [probability, area]);
        let per_area = (projection.importance.double() / end.start).single();
        let unweighted = R::Vec3::new(red, green, blue) * cos * per_area;
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

impl SubpathState {
    /// Resets the throughput for Russian roulette, and stores selection probability and area of the
    /// light.
    fn set_light(&mut self, [probability, area]: [f32; 2]) {
        let taken = self.rows[3].0[2];
        self.rows[3].0[..5].copy_from_slice(&[1.0, 1.0, taken, probability, area]);
    }
}

/// Samples a start on any light with the scalar code, and stores ray and throughput in `state`.
fn sample_scalar<const TIMED: bool>(
    tile: &TileContext<TIMED>,
    state: &mut SubpathState,
    mut sampler: Sampler,
) -> Option<EmissionSample> {
    let (choice, u, v) = (sampler.next_1d(), sampler.next_2d(), sampler.next_2d());
    let start = tile
        .context
        .lights
        .sample_emission(tile.context.scene, choice, u, v)?;
    let throughput = start.radiance * start.cos / (start.pdf_a * start.pdf_w);
    let (p, n) = (start.point.position, start.point.normal);
    let Ray { origin: o, dir: d } = vertex::spawn_ray(p, n, start.dir);
    state.rows[0] = F32x8([o.x, o.y, o.z, d.x, d.y, d.z, throughput.x, throughput.y]);
    state.rows[1] = F32x8([throughput.z, p.x, p.y, p.z, n.x, n.y, n.z, 1.0]);
    state.set_light([0.0; 2]);
    Some(start)
}
