//! Vectorised path tracer for `nee`, `bpt` and `bdpt`. It advances many paths by one step at a
//! time, sorts them by material between steps, and shades one path per lane of a SIMD vector: 16
//! with AVX-512, 8 with AVX2. [`Wavefront`] is the entry point.
//!
//! A step of `nee` and `bpt` treats all paths of a tile, which is 256 consecutive samples:
//!
//! - [`ray_generation`] creates the camera rays of the first step.
//! - Rays are traced one by one, or vectorised by [`small_scene`] in scenes of few primitives.
//! - Hits on surfaces with a [vectorised material](material_classes) are gathered by class and
//!   shaded in full vectors ([`shade`], [`vertices`]). All others run the scalar step of [`nee`] or
//!   [`bpt`].
//! - Shadow rays to [sampled lights](light_sampling) are traced after all hits are shaded.
//!
//! [`bdpt`](self::bdpt) has tiles and steps of its own.
//!
//! Invariant: results are bit-identical to the scalar path, which tests check. The equations are
//! those of [`lumbre_light::transport`], written once for any number of lanes, and the contributions of a
//! sample are added in the order of its path. The run id therefore does not depend on
//! vectorisation.
//!
//! With a time axis each path also tracks its [time of flight](time_of_flight), and its
//! contributions are stored individually until the tile is done. The constant parameter `TIMED`
//! compiles this case separately.
//!
//! [`nee`]: lumbre_light::transport::integrator::nee
//! [`bpt`]: lumbre_light::transport::integrator::bpt

mod bdpt;
mod light_sampling;
mod material_classes;
mod ray_generation;
mod shade;
mod small_scene;
mod time_of_flight;
mod vertices;

use std::mem::{swap, take};
use std::ops::Range;

use glam::Vec3;

use super::bvh::accel::Accel;
use super::bvh::simd::Isa;
use super::films::contributions::{SampleId, TimedContributions};
use super::films::row_film::RowFilm;
use super::vectorizable::{VectorIntegrator, scalar_reason};
use crate::Job;
use crate::hierarchy::LaneMode;
use lumbre_light::math::simd::{F32x8, Width};
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::NONE;
use lumbre_light::transport::contribution::Contribution;
use lumbre_light::transport::integrator::nee::{self, LastScatter, PathState, PathWalk, StepFn};
use lumbre_light::transport::integrator::{Context, bpt};
use lumbre_light::transport::path_time::{OpticalLength, PathTime};
use lumbre_light::transport::ray::{Hit, Ray};
use lumbre_light::transport::sampler::{Sampler, Sequence};
use material_classes::MaterialTable;
pub use small_scene::SmallScene;
use time_of_flight::EmissionDelays;

/// Number of samples in a tile of `nee` and `bpt`. Their records fill half of a 48 KiB L1 data
/// cache.
const TILE_SAMPLES: usize = 256;

/// Value stored as the density of the last scattering event if that was a Dirac event.
const SPECULAR: f32 = -1.0;

/// Returns the scalar step of an integrator, or `None` for `bdpt`, which has none.
fn scalar_step<const TIMED: bool>(integrator: VectorIntegrator) -> Option<StepFn<TIMED>> {
    match integrator {
        VectorIntegrator::Nee => Some(nee::step),
        VectorIntegrator::Bpt => Some(bpt::step),
        VectorIntegrator::Bdpt => None,
    }
}

/// Vectorised path tracer for one job and scene.
pub struct Wavefront {
    integrator: VectorIntegrator,
    table: MaterialTable,
    small_scene: Option<SmallScene>,
}

/// State of a path between two steps, in three rows of eight numbers.
///
/// Row 0: origin and direction of the ray, and the first two components of the throughput. Row 1:
/// the third; position of the last vertex; density of the last scattering event, or [`SPECULAR`];
/// `eta_scale` of [`PathState`]; number of random numbers drawn; optical length so far (with a time
/// axis). Row 2: hit of the ray, and key of the sampler.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(32))]
struct PathRecord {
    rows: [F32x8; 3],
}

/// Contribution of a sampled light whose shadow ray has not been traced.
#[derive(Clone, Copy, Debug)]
struct PendingLight {
    ray: Ray,
    distance: f32,
    value: Vec3,
    path: u32,
}

/// State of all paths of a tile, with buffers that tiles reuse.
#[derive(Default)]
struct PathTile {
    records: Vec<PathRecord>,
    /// Emission delays of the paths; used only with a time axis.
    emission_delays: EmissionDelays,
    /// Refractive index of the medium each path is in; used only with a time axis.
    medium_index: Vec<f32>,
    /// Radiance of each path so far.
    values: Vec<Vec3>,
    pending_lights: Vec<PendingLight>,
    /// Positions of the pending contributions on the time axis; used only with a time axis.
    bin_positions: Vec<f64>,
    /// Individual contributions that `values` is the sum of; used only with a time axis.
    timed: TimedContributions,
    /// Paths of the current step.
    active: Vec<u32>,
    /// Paths that continue after the current step.
    next: Vec<u32>,
    /// Paths that hit a surface, by material class; empty between steps.
    by_class: Vec<Vec<u32>>,
    /// Rays that are traced next, with their maximum distances.
    rays: Vec<(Ray, f32)>,
    hits: Vec<Option<Hit>>,
    occluded: Vec<bool>,
}

impl PathRecord {
    fn set_state(&mut self, state: &PathState, taken: u32) {
        let PathState {
            ray: Ray { origin: o, dir: d },
            throughput: t,
            eta_scale,
            last,
        } = *state;
        let (from, pdf_w) = last.map_or((Vec3::ZERO, SPECULAR), |last| (last.from, last.pdf_w));
        self.rows[0].0 = [o.x, o.y, o.z, d.x, d.y, d.z, t.x, t.y];
        self.rows[1].0 = [
            t.z,
            from.x,
            from.y,
            from.z,
            pdf_w,
            eta_scale,
            f32::from_bits(taken),
            0.0,
        ];
    }

    fn ray(&self) -> Ray {
        ray_from_row(&self.rows[0])
    }

    fn state(&self) -> PathState {
        let [.., tx, ty] = self.rows[0].0;
        let [tz, x, y, z, pdf_w, eta_scale, ..] = self.rows[1].0;
        let last = (pdf_w != SPECULAR).then_some(LastScatter {
            from: Vec3::new(x, y, z),
            pdf_w,
        });
        PathState {
            ray: self.ray(),
            throughput: Vec3::new(tx, ty, tz),
            eta_scale,
            last,
        }
    }

    fn sampler(&self) -> Sampler {
        sampler_from_row(&self.rows[2], self.rows[1].0[6].to_bits())
    }

    fn set_hit(&mut self, hit: &Hit) {
        store_hit(&mut self.rows[2], hit);
    }
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

impl Wavefront {
    /// Creates the path tracer for a job. Returns `None` if it cannot be used:
    ///
    /// - `lanes` is `never`, or it is `auto` and any material cannot be shaded in lanes;
    /// - no material can, or with `bdpt` any at which paths continue cannot;
    /// - the job's settings [rule it out](scalar_reason);
    /// - the scene has delays or shadow terminators;
    /// - the processor lacks AVX2, or the hierarchy was built for the portable instruction set.
    pub fn new(scene: &CompiledScene, job: &Job, accel: &Accel) -> Option<Wavefront> {
        let integrator = VectorIntegrator::from_row(job.integrator)?;
        let requested = match job.accel.lanes {
            LaneMode::Never => false,
            LaneMode::Auto => material_classes::all_vectorized(scene),
            LaneMode::Always => true,
        };
        let eligible = scalar_reason(
            job.integrator,
            &job.params,
            job.sampler,
            !job.layers.is_empty(),
        )
        .is_none()
            && scene.delays.is_empty()
            && !scene.materials.iter().any(|m| m.shadow_terminator);
        if !requested || !eligible {
            return None;
        }
        let width = match accel.isa() {
            Isa::Portable => None,
            Isa::Avx2 => Width::eight(),
            Isa::Avx512 => Width::sixteen(),
        }?;
        let bidirectional = integrator == VectorIntegrator::Bdpt;
        let table = MaterialTable::new(
            scene,
            width,
            integrator != VectorIntegrator::Bpt,
            bidirectional,
        )
        .filter(|table| !bidirectional || table.covers(scene));
        table.map(|table| Wavefront {
            integrator,
            table,
            small_scene: SmallScene::new_if_small(accel, width),
        })
    }

    /// Returns the tracer of rays in small scenes, if this scene is small.
    pub fn small_scene(&self) -> Option<&SmallScene> {
        self.small_scene.as_ref()
    }

    /// Renders the given samples of all pixels of row `y` and adds them to `film`, in the order of
    /// the scalar path. Within a tile, all splats are added before the contributions to the
    /// samples' own pixels.
    pub fn render_row(
        &self,
        context: &Context,
        job: &Job,
        y: u32,
        samples: Range<u64>,
        film: &mut RowFilm,
    ) {
        match context.timing {
            None => self.render_row_with::<false>(context, job, y, samples, film),
            Some(_) => self.render_row_with::<true>(context, job, y, samples, film),
        }
    }

    /// Does the work of [`Wavefront::render_row`]; `TIMED` if the film has a time axis.
    fn render_row_with<const TIMED: bool>(
        &self,
        context: &Context,
        job: &Job,
        y: u32,
        samples: Range<u64>,
        film: &mut RowFilm,
    ) {
        let (mut tile, mut buffers) = (PathTile::default(), bdpt::TileBuffers::default());
        let step = scalar_step::<TIMED>(self.integrator);
        let size = if step.is_some() {
            TILE_SAMPLES
        } else {
            bdpt::TILE_SAMPLES
        };
        let mut ids: Vec<SampleId> = Vec::with_capacity(size);
        let mut render = |ids: &mut Vec<SampleId>| {
            match step {
                Some(step) => {
                    self.render_tile::<TIMED>(step, context, job, y, ids, &mut tile, film)
                }
                None => bdpt::render_tile::<TIMED>(
                    &self.table,
                    context,
                    job,
                    y,
                    ids,
                    &mut buffers,
                    film,
                ),
            }
            ids.clear();
        };
        for x in 0..job.resolution[0] {
            for sample in samples.clone() {
                ids.push((x, sample));
                if ids.len() == size {
                    render(&mut ids);
                }
            }
        }
        render(&mut ids);
    }

    /// Renders the given samples of row `y` with `nee` or `bpt` and adds them to `film`.
    #[expect(clippy::too_many_arguments, reason = "a tile needs all of them")]
    fn render_tile<const TIMED: bool>(
        &self,
        step: StepFn<TIMED>,
        context: &Context,
        job: &Job,
        y: u32,
        ids: &[SampleId],
        tile: &mut PathTile,
        film: &mut RowFilm,
    ) {
        tile.records.clear();
        ray_generation::generate(
            self.table.width,
            job,
            context.camera,
            y,
            ids,
            &mut tile.records,
        );
        tile.values.clear();
        tile.values.resize(tile.records.len(), Vec3::ZERO);
        if TIMED {
            tile.emission_delays.sample(context, &tile.records);
            tile.medium_index.clear();
            tile.medium_index
                .resize(tile.records.len(), context.medium());
            tile.timed.clear();
        }
        self.trace_paths::<TIMED>(step, context, ids, y, tile);
        add_to_film(context, ids, &tile.values, &mut tile.timed, film);
    }

    /// Traces all paths of a tile to their end, one step of all paths at a time.
    fn trace_paths<const TIMED: bool>(
        &self,
        step: StepFn<TIMED>,
        context: &Context,
        ids: &[SampleId],
        y: u32,
        tile: &mut PathTile,
    ) {
        let (mut active, mut by_class) = (take(&mut tile.active), take(&mut tile.by_class));
        active.clear();
        active.extend(0..tile.records.len() as u32);
        by_class.resize_with(self.table.classes(), Vec::new);
        for depth in 1..=context.max_depth {
            tile.next.clear();
            tile.rays.clear();
            tile.rays.extend(
                active
                    .iter()
                    .map(|path| (tile.records[*path as usize].ray(), f32::INFINITY)),
            );
            tile.hits.clear();
            context.trace.closest_each(&tile.rays, &mut tile.hits);
            for (i, path) in active.iter().copied().enumerate() {
                let hit = tile.hits[i];
                let record = &mut tile.records[path as usize];
                let shadable = hit.filter(|h| h.instance == NONE && depth < context.max_depth);
                if let Some((class, hit)) =
                    shadable.and_then(|h| Some((self.table.class(h.primitive)?, h)))
                {
                    record.set_hit(&hit);
                    by_class[class].push(path);
                } else if contributes_nothing(context, depth, hit) {
                    continue;
                } else if run_scalar_step(
                    step,
                    context,
                    [ids[path as usize].0, y],
                    depth,
                    hit,
                    path as usize,
                    tile,
                ) {
                    tile.next.push(path);
                }
            }
            for (class, paths) in by_class.iter_mut().enumerate() {
                self.table
                    .shade::<TIMED>(class, context, depth, paths, tile);
                paths.clear();
            }
            tile.rays.clear();
            // Coincident points are mutually visible and need no shadow ray.
            tile.rays.extend(
                tile.pending_lights
                    .iter()
                    .map(|light| (light.ray, light.distance))
                    .filter(|(_, d)| *d > 0.0 || d.is_nan()),
            );
            tile.occluded.clear();
            context.trace.occluded_each(&tile.rays, &mut tile.occluded);
            let mut occluded = tile.occluded.iter();
            for (i, light) in tile.pending_lights.drain(..).enumerate() {
                if light.distance <= 0.0 || occluded.next() == Some(&false) {
                    let PendingLight { path, value, .. } = light;
                    tile.values[path as usize] += value;
                    if TIMED && let Some(timing) = context.timing {
                        tile.timed.push(timing, path, value, tile.bin_positions[i]);
                    }
                }
            }
            tile.bin_positions.clear();
            swap(&mut active, &mut tile.next);
        }
        (tile.active, tile.by_class) = (active, by_class);
    }
}

/// Runs the scalar step of one path. Returns whether the path continues.
fn run_scalar_step<const TIMED: bool>(
    step: StepFn<TIMED>,
    context: &Context,
    pixel: [u32; 2],
    depth: u32,
    hit: Option<Hit>,
    path: usize,
    tile: &mut PathTile,
) -> bool {
    let record = &mut tile.records[path];
    let mut sampler = record.sampler();
    let path_time = if TIMED {
        let [_, x, y, z, .., length] = record.rows[1].0;
        let from = if depth == 1 {
            record.ray().origin
        } else {
            Vec3::new(x, y, z)
        };
        let optical = OpticalLength {
            path: length,
            delays: tile.emission_delays.for_path(path),
            delay: 0.0,
            index: tile.medium_index[path],
        };
        PathTime::resume(
            context,
            optical,
            from,
            !time_of_flight::edge_counts(context, depth),
        )
    } else {
        PathTime::resume(context, OpticalLength::default(), Vec3::ZERO, false)
    };
    let mut walk = PathWalk::resume(record.state(), path_time, &sampler);
    let (value, timed) = (&mut tile.values[path], &mut tile.timed);
    let mut sink = |c: Contribution| {
        *value += c.value;
        if TIMED && let Some(timing) = context.timing {
            timed.push(
                timing,
                path as u32,
                c.value,
                timing.axis.bin_position(c.length),
            );
        }
    };
    let continues = step(
        &mut walk,
        context,
        pixel,
        &mut sampler,
        &mut sink,
        depth,
        hit,
    );
    if continues {
        record.set_state(&walk.state, sampler.taken());
        if TIMED {
            record.rows[1].0[1..4].copy_from_slice(&walk.path_time.from().to_array());
            let optical = walk.path_time.optical();
            (record.rows[1].0[7], tile.medium_index[path]) = (optical.path, optical.index);
        }
    }
    continues
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

/// Returns whether the hit alone determines that the step ends the path without a contribution.
#[inline]
fn contributes_nothing(context: &Context, depth: u32, hit: Option<Hit>) -> bool {
    match hit {
        Some(hit) => {
            depth == context.max_depth
                && context.scene.emitter_of(hit.primitive, hit.instance) == NONE
        }
        None => context.scene.environment.is_none(),
    }
}
