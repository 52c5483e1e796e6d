//! Vectorised path tracer for `nee`, `bpt` and `bdpt`: advances many paths one step at a time,
//! sorted by material between steps, and shades as many at once as a SIMD vector has lanes: 16 with
//! AVX-512, 8 with AVX2. [`Wavefront`] is the entry point.
//!
//! A tile is 256 consecutive samples, whose paths begin in [`ray_generation`]. In each step the
//! rays are traced one by one. Hits on surfaces with a [vectorised material](material_classes) are
//! gathered by class into full vectors and shaded together ([`shade`]); all others run the scalar
//! step of [`nee`] or [`bpt`]. Contributions of [sampled lights](light_sampling) wait for their
//! shadow ray until all hits are shaded. [`bdpt`](self::bdpt) has a tile of its own, and
//! [`small_scene`] traces rays in scenes of few primitives.
//!
//! Results are bit-identical to the scalar path, which tests compare: the equations are those of
//! [`crate::transport`], written once for any number of lanes, and the contributions of a sample
//! are added in the order of its path. The identity of a run therefore does not depend on it.
//!
//! With a time axis each path also tracks its [time of flight](time_of_flight), and its
//! contributions are stored separately until the tile is done. The constant `TIMED` compiles that
//! code separately.
//!
//! [`nee`]: crate::transport::integrator::nee
//! [`bpt`]: crate::transport::integrator::bpt

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
use crate::math::simd::{F32x8, Width};
use crate::render::Job;
use crate::render::hierarchy::LaneMode;
use crate::scene::CompiledScene;
use crate::scene::compile::NONE;
use crate::transport::contribution::Contribution;
use crate::transport::integrator::nee::{self, LastScatter, PathState, PathWalk, StepFn};
use crate::transport::integrator::{Context, bpt};
use crate::transport::path_time::{OpticalLength, PathTime};
use crate::transport::ray::{Hit, Ray};
use crate::transport::sampler::{Independent, Sampler};
use material_classes::MaterialTable;
pub use small_scene::SmallScene;
use time_of_flight::EmissionDelays;

/// Number of samples in a tile. Their records fill half of a typical 48 KiB L1 data cache.
const TILE_SAMPLES: usize = 256;

/// Value stored as density if the last scattering was specular.
const SPECULAR: f32 = -1.0;

/// Returns the scalar step of an integrator, or `None` for `bdpt`, which has two subpaths per
/// sample.
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
    small: Option<SmallScene>,
}

/// State of a path between two steps, in three rows of eight numbers: rows 0 and 1 hold
/// [`PathState`], the number of random numbers drawn and the optical length so far; row 2 holds the
/// hit of its ray and the key of its sampler.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(32))]
struct PathRecord {
    rows: [F32x8; 3],
}

/// Contribution of a sampled light whose shadow ray is not traced yet.
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
    values: Vec<Vec3>,
    pending: Vec<PendingLight>,
    /// Positions in the time axis of the pending contributions; used only with a time axis.
    bin_positions: Vec<f64>,
    /// Individual contributions that `values` is the sum of; used only with a time axis.
    timed: TimedContributions,
    /// Paths of the current step.
    active: Vec<u32>,
    /// Paths that continue after the current step.
    next: Vec<u32>,
    /// Paths that hit a surface of each material class; empty between steps.
    by_class: Vec<Vec<u32>>,
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

    fn sampler(&self) -> Independent {
        sampler_from_row(&self.rows[2], self.rows[1].0[6].to_bits())
    }

    fn set_hit(&mut self, hit: &Hit) {
        store_hit(&mut self.rows[2], hit);
    }
}

/// Returns the ray stored in the first six numbers of a row.
#[inline]
fn ray_from_row(row: &F32x8) -> Ray {
    let [x, y, z, u, v, w, ..] = row.0;
    Ray {
        origin: Vec3::new(x, y, z),
        dir: Vec3::new(u, v, w),
    }
}

/// Returns the sampler whose key is stored in the last four numbers of a row, after `taken` draws.
#[inline]
fn sampler_from_row(row: &F32x8, taken: u32) -> Independent {
    let [.., a, b, c, d] = row.0;
    Independent::resume([a, b, c, d].map(f32::to_bits), taken)
}

/// Stores a hit in the first four numbers of a row.
#[inline]
fn store_hit(row: &mut F32x8, hit: &Hit) {
    row.0[..4].copy_from_slice(&[hit.t, hit.uv[0], hit.uv[1], f32::from_bits(hit.primitive)]);
}

impl Wavefront {
    /// Creates the path tracer for a job, or returns `None` if it cannot be used: the processor
    /// lacks AVX2, the job's settings [rule it out](scalar_reason), the scene has delays or shadow
    /// terminators, no material has a vectorised BSDF, or, unless `lanes` is `always`, any material
    /// lacks one.
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
            small: SmallScene::new_if_small(accel, width),
        })
    }

    /// Returns the tracer of many rays at once, if the scene is small.
    pub fn small_scene(&self) -> Option<&SmallScene> {
        self.small.as_ref()
    }

    /// Renders samples of all pixels of row `y` and adds them to `row`, in the order of the scalar
    /// loops: first all splats of a tile, then the contributions to the samples' own pixels.
    pub fn render_row(
        &self,
        context: &Context,
        job: &Job,
        y: u32,
        samples: Range<u64>,
        row: &mut RowFilm,
    ) {
        match context.timing {
            None => self.render_row_with::<false>(context, job, y, samples, row),
            Some(_) => self.render_row_with::<true>(context, job, y, samples, row),
        }
    }

    fn render_row_with<const TIMED: bool>(
        &self,
        context: &Context,
        job: &Job,
        y: u32,
        samples: Range<u64>,
        row: &mut RowFilm,
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
                Some(step) => self.render_tile::<TIMED>(step, context, job, y, ids, &mut tile, row),
                None => {
                    bdpt::render_tile::<TIMED>(&self.table, context, job, y, ids, &mut buffers, row)
                }
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

    #[expect(clippy::too_many_arguments, reason = "a tile needs all of them")]
    fn render_tile<const TIMED: bool>(
        &self,
        step: StepFn<TIMED>,
        context: &Context,
        job: &Job,
        y: u32,
        ids: &[SampleId],
        tile: &mut PathTile,
        row: &mut RowFilm,
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
        add_to_film(context, ids, &tile.values, &mut tile.timed, row);
    }

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
                let class = hit.filter(|h| h.instance == NONE && depth < context.max_depth);
                if let Some((class, hit)) =
                    class.and_then(|h| Some((self.table.class(h.primitive)?, h)))
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
            for (class, list) in by_class.iter_mut().enumerate() {
                self.table.shade::<TIMED>(class, context, depth, list, tile);
                list.clear();
            }
            tile.rays.clear();
            // Coincident points are visible to each other.
            tile.rays.extend(
                tile.pending
                    .iter()
                    .map(|w| (w.ray, w.distance))
                    .filter(|(_, d)| *d > 0.0 || d.is_nan()),
            );
            tile.occluded.clear();
            context.trace.occluded_each(&tile.rays, &mut tile.occluded);
            let mut occluded = tile.occluded.iter();
            for (i, light) in tile.pending.drain(..).enumerate() {
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

/// Runs the scalar step of one path; returns whether the path continues.
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
    let mut sampler = Sampler::Independent(record.sampler());
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
    if let Sampler::Independent(numbers) = &sampler
        && continues
    {
        record.set_state(&walk.state, numbers.taken());
        if TIMED {
            record.rows[1].0[1..4].copy_from_slice(&walk.path_time.from().to_array());
            let optical = walk.path_time.optical();
            (record.rows[1].0[7], tile.medium_index[path]) = (optical.path, optical.index);
        }
    }
    continues
}

/// Adds the contributions of samples to their own pixels to the film: the sums and, with a time
/// axis, the individual contributions.
fn add_to_film(
    context: &Context,
    ids: &[SampleId],
    values: &[Vec3],
    timed: &mut TimedContributions,
    row: &mut RowFilm,
) {
    let timed = context.timing.map(|_| {
        timed.sort(ids.len());
        timed
    });
    row.add_batch(ids, values, timed);
}

/// Returns whether a step would end the path without any contribution; known from the hit alone.
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
