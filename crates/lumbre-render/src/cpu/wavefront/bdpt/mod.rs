//! Vectorised `bdpt`: traces all camera subpaths of a tile, then all light subpaths, then evaluates
//! all connections.
//!
//! [`random_walk`] advances the subpaths of a tile by one step at a time and stores a
//! [`VertexRecord`] at each vertex. [`ray_generation`] samples the first vertices of light
//! subpaths.
//!
//! Invariant: results are bit-identical to the scalar `bdpt`. The number of random numbers that a
//! connection draws does not depend on its result, and the order of a sample's contributions is
//! that of the scalar path. Both are therefore known when connections are [listed](connect), and
//! connections can be evaluated in any order, here by class of surface.

mod camera_rays;
mod connect;
pub(super) mod material_classes;
mod random_walk;
mod ray_generation;
mod shadow_rays;
mod time_of_flight;
mod vertices;

use glam::Vec3;

use crate::Job;
use crate::cpu::films::contributions::{SampleId, TimedContributions};
use crate::cpu::films::row_film::RowFilm;
use camera_rays::CameraRecord;
use connect::ConnectionLists;
use lumbre_light::math::simd::F32x8;
use lumbre_light::scene::compile::NONE;
use lumbre_light::transport::integrator::Context;
use lumbre_light::transport::integrator::bdpt::connect::{
    Connection, connect_s0_at_hit, connect_s0_escaped,
};
use lumbre_light::transport::integrator::bdpt::subpath::{Edge, Escape, Origin};
use lumbre_light::transport::integrator::bdpt::weights::EdgePartials;
use lumbre_light::transport::mis::Heuristic;
use lumbre_light::transport::path_time::{OpticalLength, PathTime};
use lumbre_light::transport::ray::{Hit, Ray};
use lumbre_light::transport::sampler::{Sampler, Sequence};
use material_classes::MaterialTable;
use ray_generation::LightStarts;
use time_of_flight::EmissionDelays;

/// Number of samples in a tile of `bdpt`.
pub(super) const TILE_SAMPLES: usize = 128;

/// Data that all kernels of a tile read; `TIMED` if the film has a time axis.
#[derive(Clone, Copy)]
struct TileContext<'a, const TIMED: bool> {
    table: &'a MaterialTable,
    context: &'a Context<'a>,
    /// Heuristic of the MIS weights.
    h: Heuristic,
    emission_delays: &'a EmissionDelays,
}

/// State of a subpath between two of its vertices, in four rows of eight numbers.
///
/// Row 0: ray, and the first two components of the throughput. Row 1: the third; position and
/// normal of the previous vertex; first component of the throughput for Russian roulette. Row 2:
/// hit of the ray, and key of the sampler. Row 3: the other two components for Russian roulette;
/// number of random numbers drawn; optical length and refractive index of the medium (with a time
/// axis); weighted emission at the hit.
///
/// On the first edge of a light subpath, row 3 holds the index of the light instead of the length.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(32))]
struct SubpathState {
    rows: [F32x8; 4],
    /// Density of the ray's direction, `d_vcm` and `d_vc`.
    weights: [f64; 3],
}

/// Vertex of a subpath, in three rows of eight numbers and its MIS terms.
///
/// Row 0: position, geometric normal, area factor of the reverse direction, and material index. Row
/// 1: shading normal, direction to the previous vertex, and the first two components of the
/// throughput. Row 2: the third; optical length of the path, emission delay, and refractive index
/// of the medium of the last edge (with a time axis).
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(32))]
struct VertexRecord {
    rows: [F32x8; 3],
    /// MIS partials `d_vcm` and `d_vc`.
    partials: [f64; 2],
    /// Material class of the surface; `None` if the path ends here and the vertex is not connected.
    class: Option<u8>,
    /// Weighted emission of the surface towards the path.
    emission: Vec3,
    /// Index of the next vertex of the path, or [`NONE`].
    next: u32,
}

/// TileSubpaths of a tile from the camera or from lights.
#[derive(Default)]
struct TileSubpaths {
    /// State of every path.
    states: Vec<SubpathState>,
    /// Vertices of all paths, in the order in which they were found.
    vertices: Vec<VertexRecord>,
    /// First and last vertex of every path, or [`NONE`].
    ends: Vec<[u32; 2]>,
    /// Paths that have not ended.
    active: Vec<u32>,
}

/// Buffers of a tile, which tiles reuse.
#[derive(Default)]
pub(super) struct TileBuffers {
    records: Vec<CameraRecord>,
    camera: TileSubpaths,
    light: TileSubpaths,
    starts: LightStarts,
    emission_delays: EmissionDelays,
    /// Weighted contribution of the environment to every camera subpath, and its optical length.
    escaped: Vec<(Vec3, f64)>,
    lists: ConnectionLists,
    sums: SampleSums,
}

/// Sums of the samples' contributions to their own pixels.
#[derive(Default)]
struct SampleSums {
    /// Radiance of each sample.
    values: Vec<Vec3>,
    /// Individual contributions that `values` is the sum of; used only with a time axis.
    timed: TimedContributions,
}

impl SubpathState {
    fn ray(&self) -> Ray {
        ray_from_row(&self.rows[0])
    }

    fn throughput(&self) -> Vec3 {
        let [.., x, y] = self.rows[0].0;
        Vec3::new(x, y, self.rows[1].0[0])
    }

    fn edge(&self) -> Edge {
        let [_, x, y, z, a, b, c, _] = self.rows[1].0;
        let [pdf_w, d_vcm, d_vc] = self.weights;
        let origin = Origin::Surface(Vec3::new(a, b, c));
        Edge {
            origin,
            from: Vec3::new(x, y, z),
            dir: self.ray().dir,
            pdf_w,
            partials: EdgePartials { d_vcm, d_vc },
        }
    }

    /// Returns the number of random numbers drawn so far.
    fn taken(&self) -> u32 {
        self.rows[3].0[2].to_bits()
    }

    fn sampler(&self, taken: u32) -> Sampler {
        sampler_from_row(&self.rows[2], taken)
    }

    /// Stores the hit of the ray and the weighted emission there.
    fn set_hit(&mut self, hit: &Hit, emission: Vec3) {
        store_hit(&mut self.rows[2], hit);
        self.rows[3].0[5..].copy_from_slice(&emission.to_array());
    }
}

impl TileSubpaths {
    fn reset(&mut self, paths: usize) {
        self.vertices.clear();
        self.ends.clear();
        self.ends.resize(paths, [NONE; 2]);
        self.active.clear();
    }

    /// Appends a vertex to a path.
    fn push(&mut self, path: usize, vertex: VertexRecord) {
        let index = self.vertices.len() as u32;
        let [first, last] = &mut self.ends[path];
        match *last {
            NONE => *first = index,
            last => self.vertices[last as usize].next = index,
        }
        *last = index;
        self.vertices.push(VertexRecord {
            next: NONE,
            ..vertex
        });
    }

    /// Returns the indices of the vertices of a path, in order.
    fn path(&self, path: usize) -> impl Iterator<Item = u32> {
        let some = |index: u32| (index != NONE).then_some(index);
        std::iter::successors(some(self.ends[path][0]), move |i| {
            some(self.vertices[*i as usize].next)
        })
    }
}

impl VertexRecord {
    /// Returns the material index of the surface.
    #[inline]
    fn material(&self) -> usize {
        self.rows[0].0[7].to_bits() as usize
    }

    /// Returns the optical length of the path up to this vertex; valid only with a time axis.
    fn optical(&self) -> OpticalLength {
        let [_, path, delays, index, ..] = self.rows[2].0;
        OpticalLength {
            path,
            delays,
            delay: 0.0,
            index,
        }
    }

    /// Sets the three numbers of [`VertexRecord::optical`].
    #[inline]
    fn set_optical(&mut self, [path, delays, index]: [f32; 3]) {
        self.rows[2].0[1..4].copy_from_slice(&[path, delays, index]);
    }
}

impl<const TIMED: bool> TileContext<'_, TIMED> {
    /// Returns the weighted contribution of a connection; zero if there is none.
    fn weighted(&self, connection: Option<Connection>) -> Vec3 {
        connection.map_or(Vec3::ZERO, |c| {
            c.unweighted * c.weight(self.context.settings) as f32
        })
    }

    /// Returns the path time of camera subpath `path` before edge number `edge` is added.
    fn path_time(&self, state: &SubpathState, path: usize, edge: u32) -> PathTime<'_, true> {
        let [_, _, _, length, index, ..] = state.rows[3].0;
        let optical = OpticalLength {
            path: length,
            delays: self.emission_delays.for_path(path),
            delay: 0.0,
            index,
        };
        PathTime::resume(
            self.context,
            optical,
            state.edge().from,
            !time_of_flight::edge_counts(self.context, edge),
        )
    }

    /// Returns the weighted contribution of the environment to camera subpath `path`, whose edge
    /// number `edge` hit nothing, and its optical length.
    fn escaped(&self, camera: &TileSubpaths, path: usize, edge: u32) -> (Vec3, f64) {
        let context = self.context;
        if context.scene.environment.is_none() || !context.settings.includes(0, edge + 1) {
            return (Vec3::ZERO, 0.0);
        }
        let state = &camera.states[path];
        let escape_length = || {
            self.path_time(state, path, edge)
                .escape_length(context, state.ray().dir)
        };
        let length = if TIMED { escape_length() } else { 0.0 };
        let escape = Escape {
            edge: state.edge(),
            throughput: state.throughput(),
            length,
        };
        (
            self.weighted(connect_s0_escaped(context, self.h, &escape, edge + 1)),
            length,
        )
    }

    /// Returns the weighted emission of the surface that edge number `edge` of a camera subpath
    /// hits, and the position of the hit. Returns `None` if the surface does not emit or the
    /// strategy is excluded.
    fn emission_at(&self, state: &SubpathState, hit: &Hit, edge: u32) -> Option<(Vec3, Vec3)> {
        let TileContext { context, h, .. } = *self;
        if context.scene.emitter_of(hit.primitive, NONE) == NONE
            || !context.settings.includes(0, edge + 1)
        {
            return None;
        }
        let found = connect_s0_at_hit(
            context,
            h,
            &state.edge(),
            &state.ray(),
            hit,
            state.throughput(),
            edge + 1,
        )?;
        Some((self.weighted(Some(found)), found.point?.position))
    }

    /// Returns the state of a sample's camera subpath before its first edge.
    fn camera_state(&self, record: &CameraRecord) -> SubpathState {
        let [ray_row, _, keys] = record.rows;
        let [x, y, z, u, v, w, ..] = ray_row.0;
        let edge = Edge::from_lens(self.context, Vec3::new(x, y, z), Vec3::new(u, v, w));
        let origin_row = F32x8([1.0, x, y, z, 0.0, 0.0, 0.0, 1.0]);
        let counters = F32x8([
            1.0,
            1.0,
            record.rows[1].0[6],
            0.0,
            self.context.medium(),
            0.0,
            0.0,
            0.0,
        ]);
        SubpathState {
            rows: [ray_row, origin_row, keys, counters],
            weights: [edge.pdf_w, edge.partials.d_vcm, edge.partials.d_vc],
        }
    }
}

/// Renders the given samples of row `y` and adds them to `film`: all splats, then the contributions
/// to their own pixels.
pub(super) fn render_tile<const TIMED: bool>(
    table: &MaterialTable,
    context: &Context,
    job: &Job,
    y: u32,
    ids: &[SampleId],
    buffers: &mut TileBuffers,
    film: &mut RowFilm,
) {
    let TileBuffers {
        records,
        camera,
        light,
        starts,
        emission_delays,
        escaped,
        lists,
        sums,
    } = buffers;
    records.clear();
    camera_rays::generate(table.width, job, context.camera, y, ids, records);
    emission_delays.sample(context, records);
    let tile = TileContext::<TIMED> {
        table,
        context,
        h: context.settings.heuristic(),
        emission_delays,
    };
    camera.reset(records.len());
    camera.states.clear();
    camera
        .states
        .extend(records.iter().map(|record| tile.camera_state(record)));
    camera.active.extend(0..records.len() as u32);
    escaped.clear();
    escaped.resize(records.len(), (Vec3::ZERO, 0.0));
    random_walk::trace_subpaths::<false, TIMED>(&tile, camera, context.max_depth, escaped);
    light.reset(records.len());
    starts.sample(&tile, camera, light);
    random_walk::trace_subpaths::<true, TIMED>(
        &tile,
        light,
        context.max_depth.saturating_sub(1),
        escaped,
    );
    lists.reset(table.classes());
    sums.values.clear();
    sums.values.resize(records.len(), Vec3::ZERO);
    sums.timed.clear();
    let mut splat = |path: u32, pixel: [u32; 2], value: Vec3, length: f64| {
        film.splat_from_sample(ids[path as usize], pixel, value, length);
    };
    for (path, escaped) in escaped.iter().enumerate() {
        let mut taken = lists.list_camera_path(&tile, path, [&*light, &*camera], *escaped);
        if context.settings.includes(1, 1) {
            taken = starts.list(path, taken);
        }
        lists.list_lens_connections(&tile, path, light, taken);
        if lists.are_full() {
            lists.evaluate(&tile, [light, camera], sums, &mut splat);
        }
    }
    starts.connect_to_lens(&tile, light, &mut lists.queue, &mut splat);
    lists.evaluate(&tile, [light, camera], sums, &mut splat);
    add_to_film(context, ids, &sums.values, &mut sums.timed, film);
}

/// Returns the ray that is stored in the first six numbers of a row.
#[inline]
fn ray_from_row(row: &F32x8) -> Ray {
    let [x, y, z, u, v, w, ..] = row.0;
    Ray {
        origin: Vec3::new(x, y, z),
        dir: Vec3::new(u, v, w),
    }
}

/// Returns the sampler whose key is stored in the last four numbers of a row, after `taken` numbers
/// were drawn.
#[inline]
fn sampler_from_row(row: &F32x8, taken: u32) -> Sampler {
    let [.., a, b, c, d] = row.0;
    Sampler::resume(
        Sequence::Independent,
        [a, b, c, d].map(f32::to_bits),
        0,
        taken,
    )
}

/// Stores a hit in the first four numbers of a row.
#[inline]
fn store_hit(row: &mut F32x8, hit: &Hit) {
    row.0[..4].copy_from_slice(&[hit.t, hit.uv[0], hit.uv[1], f32::from_bits(hit.primitive)]);
}

/// Adds samples to their own pixels: their radiance `values` and, with a time axis, the individual
/// contributions `timed`.
fn add_to_film(
    context: &Context,
    ids: &[SampleId],
    values: &[Vec3],
    timed: &mut TimedContributions,
    film: &mut RowFilm,
) {
    let timed = context.timing.map(|_| {
        timed.sort(ids.len());
        timed
    });
    film.add_batch(ids, values, timed);
}
