//! The CPU renderer: the loop over pixels and samples.

use std::cell::Cell;
use std::io::{self, Write};
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Instant;

use glam::Vec3;
use rayon::prelude::*;

use super::bvh::accel::Accel;
use super::bvh::simd::Isa;
use super::films::bin_pool;
use super::films::layers::{LayerFilms, LayerRowFilm, LayerSpec, Moments};
use super::films::row_film::{RowFilm, RowStats, SplatTarget};
use super::films::time_film::{SlotRow, TimeFilm, TimeRowFilm};
use super::wavefront::{SmallScene, Wavefront};
use crate::film::Film;
use crate::film::layer::LayerFilm;
use crate::film::splat::{SplatBuffer, SplatSums};
use crate::film::state::StateReader;
use crate::film::time::TimeCube;
use crate::render::hierarchy::{AccelSpec, Builder};
use crate::render::{Job, OpenStats, RenderError, Renderer, WaveStats};
use crate::scene::CompiledScene;
use crate::transport::camera::Camera;
use crate::transport::integrator::{Context, Settings};
use crate::transport::light::{LightSelection, Lights};
use crate::transport::ray::{Hit, Ray, Trace};

/// Run of a job on the CPU.
///
/// One thread adds the samples of a pixel to its sums in the order of their index, so the film has
/// the same bits for any number of threads and any grouping of samples into waves. Splats,
/// contributions to pixels other than the sample's own, are summed separately in fixed point, whose
/// order does not matter, and are combined with the film after each wave.
pub struct CpuRenderer {
    scene: Arc<CompiledScene>,
    accel: Accel,
    camera: Camera,
    lights: Lights,
    job: Job,
    pool: rayon::ThreadPool,
    /// Sums of the samples' contributions to their own pixels; without `sum` if there is a time
    /// axis, whose slots have them.
    own: Film,
    /// Sums of splats, allocated for the first splat.
    splats: OnceLock<SplatSums>,
    /// Own sums and splats combined, if there are splats.
    joint: Option<Film>,
    /// Films of layers, if the job requests any.
    layers: Option<LayerFilms>,
    /// Vectorised path tracer, if the job can use it.
    wavefront: Option<Wavefront>,
    /// Film with a time axis, if the job requests one.
    times: Option<TimeFilm>,
    /// Main film computed from the time bins; computed on demand, since it reads every bin.
    timed: OnceLock<Film>,
    /// Counter of [`CpuRenderer::shared_writes`].
    shared_writes: u64,
    open_stats: OpenStats,
}

impl CpuRenderer {
    /// Builds everything that is not per sample, with the widest instruction set of this processor.
    ///
    /// # Errors
    /// Returns an error if threads cannot be started, the scene's hierarchy cannot be used, or
    /// layers or bins exceed their limits.
    pub fn new(scene: Arc<CompiledScene>, job: Job) -> Result<CpuRenderer, RenderError> {
        CpuRenderer::with_isa(scene, job, Isa::detect())
    }

    /// Does the same as [`CpuRenderer::new`] for an instruction set, one of [`Isa::available`].
    ///
    /// # Errors
    /// Returns an error in the cases of [`CpuRenderer::new`].
    pub fn with_isa(
        scene: Arc<CompiledScene>,
        job: Job,
        isa: Isa,
    ) -> Result<CpuRenderer, RenderError> {
        let backend = "cpu";
        let failed = |reason: String| RenderError::Failed { backend, reason };
        let unsupported = |reason: String| RenderError::Unsupported { backend, reason };
        let layers = LayerFilms::for_job(&job).map_err(unsupported)?;
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(job.threads)
            .thread_name(|i| format!("render-{i}"))
            .build()
            .map_err(|e| failed(format!("cannot start render threads: {e}")))?;
        let times = pool
            .install(|| TimeFilm::for_job(&job))
            .map_err(unsupported)?;
        let accel = pool
            .install(|| Accel::build_as(Arc::clone(&scene), &job.accel, isa))
            .map_err(|e| failed(e.to_string()))?;
        // If the builder does not support instances, the hierarchy has flattened the scene, and
        // primitives are numbered as in its copy.
        let scene = Arc::clone(&accel.scene);
        let wavefront = Wavefront::new(&scene, &job, &accel);
        let open_stats = OpenStats {
            accel_build_s: accel.build_s,
            accel_nodes: accel.node_count() as u64,
            accel_bytes: accel.bytes() as u64,
            accel_cost: accel.cost(),
            device: device_line(
                &accel,
                &job.accel,
                pool.current_num_threads(),
                wavefront.is_some(),
            ),
            ..OpenStats::default()
        };
        Ok(CpuRenderer {
            camera: Camera::new(&scene.camera, job.resolution, job.filter),
            lights: Lights::with_select(&scene, LightSelection::from_params(&job.params)),
            own: Film::new(job.resolution[0], job.resolution[1]),
            splats: OnceLock::new(),
            joint: None,
            layers,
            wavefront,
            times,
            timed: OnceLock::new(),
            shared_writes: 0,
            accel,
            scene,
            job,
            pool,
            open_stats,
        })
    }
}

impl CpuRenderer {
    /// Returns whether the run uses the vectorised path tracer. Pictures have the same bits either
    /// way.
    pub fn is_vectorised(&self) -> bool {
        self.wavefront.is_some()
    }

    /// Returns how often threads wrote to shared memory in all waves: took a row, took or returned
    /// a splat buffer, or locked a stripe of splat sums. All other memory is written by one thread
    /// only.
    pub fn shared_writes(&self) -> u64 {
        self.shared_writes
    }

    /// Combines splats and own samples into one film.
    fn join(&mut self) {
        let Some(splats) = self.splats.get().filter(|_| self.own.samples > 0) else {
            return;
        };
        let own = &self.own;
        let film = self
            .joint
            .get_or_insert_with(|| Film::new(own.width, own.height));
        film.samples = own.samples;
        let joined = film.sum.par_iter_mut().zip(&mut film.sum2).enumerate();
        self.pool.install(|| {
            joined.for_each(|(i, (sum, sum2))| {
                (*sum, *sum2) = splats.combined(i, own.sum[i], own.sum2[i], own.samples)
            });
        });
    }
}

/// Returns a line for users about hierarchy, threads and instruction set.
fn device_line(accel: &Accel, spec: &AccelSpec, threads: usize, lanes: bool) -> String {
    let plain = AccelSpec::default();
    let tree = match spec.builder {
        Builder::None => "no hierarchy".to_owned(),
        Builder::Cwbvh => format!("{} of obvhs", spec.describe()),
        _ if AccelSpec {
            instances: plain.instances,
            lanes: plain.lanes,
            ..*spec
        } == plain =>
        {
            "eight-wide BVH".to_owned()
        }
        _ => format!("eight-wide BVH by {}", spec.describe()),
    };
    let lanes = if lanes { ", vectorised" } else { "" };
    format!(
        "cpu, {threads} threads, {tree}, {}{lanes}",
        accel.isa().name()
    )
}

/// Sums of a row in films other than the main one.
struct RowBuffers<'a> {
    layers: Option<&'a mut [Moments]>,
    times: Option<SlotRow<'a>>,
}

/// Hierarchy that counts its rays; one for each row, so that counting needs no shared memory.
struct CountingTrace<'a> {
    accel: &'a Accel,
    /// Tracer of many rays at once, if the scene is small.
    small: Option<&'a SmallScene>,
    rays: Cell<u64>,
}

impl Trace for CountingTrace<'_> {
    fn closest(&self, ray: &Ray, t_max: f32) -> Option<Hit> {
        self.rays.set(self.rays.get() + 1);
        self.accel.closest(ray, t_max)
    }

    fn occluded(&self, ray: &Ray, t_max: f32) -> bool {
        self.rays.set(self.rays.get() + 1);
        self.accel.occluded(ray, t_max)
    }

    fn closest_each(&self, rays: &[(Ray, f32)], hits: &mut Vec<Option<Hit>>) {
        self.rays.set(self.rays.get() + rays.len() as u64);
        match self.small {
            Some(small) => small.closest(rays, hits),
            None => hits.extend(
                rays.iter()
                    .map(|(ray, t_max)| self.accel.closest(ray, *t_max)),
            ),
        }
    }

    fn occluded_each(&self, rays: &[(Ray, f32)], hidden: &mut Vec<bool>) {
        self.rays.set(self.rays.get() + rays.len() as u64);
        match self.small {
            Some(small) => small.occluded(rays, hidden),
            None => hidden.extend(
                rays.iter()
                    .map(|(ray, t_max)| self.accel.occluded(ray, *t_max)),
            ),
        }
    }
}

/// Everything that the threads of a wave share.
struct WaveContext<'a> {
    scene: &'a CompiledScene,
    accel: &'a Accel,
    camera: &'a Camera,
    lights: &'a Lights,
    job: &'a Job,
    settings: Settings,
    /// Indices of the samples that the wave adds to every pixel.
    samples: Range<u64>,
    splats: SplatTarget<'a>,
    layers: Option<&'a LayerSpec>,
    wavefront: Option<&'a Wavefront>,
    /// Splat buffers that no thread is using. Rows pass them on, so that few are needed and they
    /// are mostly full when they are flushed.
    buffers: Mutex<Vec<SplatBuffer>>,
}

impl WaveContext<'_> {
    fn free_buffers(&self) -> MutexGuard<'_, Vec<SplatBuffer>> {
        self.buffers.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Renders all samples of row `y`.
    fn render_row(&self, y: u32, sums: [&mut [[f64; 3]]; 2], extra: RowBuffers) -> RowStats {
        let job = self.job;
        let trace = CountingTrace {
            accel: self.accel,
            small: self.wavefront.and_then(Wavefront::small_scene),
            rays: Cell::new(0),
        };
        let context = Context {
            scene: self.scene,
            camera: self.camera,
            lights: self.lights,
            trace: &trace,
            max_depth: job.max_depth,
            rr_start: job.rr_start,
            settings: &self.settings,
            timing: job.timing.as_ref(),
        };
        let buffer = self
            .free_buffers()
            .pop()
            .unwrap_or_else(|| self.splats.buffer());
        let by_time = extra
            .times
            .zip(self.splats.timed)
            .map(|(row, splats)| TimeRowFilm::new(splats, row));
        let mut row = RowFilm::new(y, sums, by_time, self.splats, buffer);
        if let Some(wavefront) = self.wavefront {
            wavefront.render_row(&context, job, y, self.samples.clone(), &mut row);
        } else {
            let mut layers = extra
                .layers
                .zip(self.layers)
                .map(|(row, spec)| LayerRowFilm::new(spec, row));
            for x in 0..job.resolution[0] {
                for sample in self.samples.clone() {
                    let rays = &trace.rays;
                    render_sample(&context, job, [x, y], sample, &mut row, &mut layers, rays);
                }
            }
        }
        let (stats, buffer) = row.finish(trace.rays.get());
        self.free_buffers().push(buffer);
        stats
    }

    /// Flushes and recycles all splat buffers. Returns the number of splats whose squares
    /// overflowed and the number of locks taken by all flushes.
    fn flush(self, pool: &rayon::ThreadPool) -> (u64, u64) {
        // Flushed in parallel: there is a buffer for each thread.
        let overflowed = pool.install(|| {
            self.free_buffers()
                .par_iter_mut()
                .filter(|buffer| !buffer.is_empty())
                .map(|buffer| buffer.flush(self.splats.sums()))
                .sum()
        });
        let buffers = self.buffers.into_inner();
        let mut buffers = buffers.unwrap_or_else(PoisonError::into_inner);
        let locks = buffers.iter_mut().map(SplatBuffer::take_locks).sum();
        bin_pool::recycle_buffers(buffers);
        (overflowed, locks)
    }
}

/// Renders one sample of a pixel on the scalar path.
fn render_sample(
    context: &Context,
    job: &Job,
    pixel: [u32; 2],
    sample: u64,
    row: &mut RowFilm,
    layers: &mut Option<LayerRowFilm>,
    traced: &Cell<u64>,
) {
    let x = pixel[0];
    let (mut value, mut invalid) = (Vec3::ZERO, 0);
    let rays = traced.get();
    let mut sampler = (job.sampler.start)(job.seed, pixel, sample);
    (job.integrator.sample)(context, pixel, &mut sampler, &mut |c| {
        if c.t != 1 && c.pixel == pixel {
            value += c.value;
            invalid += layers.as_mut().map_or(0, |layers| layers.add(&c));
            row.add_timed(x, c.value, c.length);
            return;
        }
        match row.splat(c.pixel, c.value, c.length) {
            None => invalid += 1,
            Some(index) => {
                if let (Some(layers), Some(index)) = (layers.as_mut(), index) {
                    invalid += layers.splat(index, &c);
                }
            }
        }
    });
    let finite = row.add_sample(x, value);
    invalid += u64::from(!finite) + u64::from(!row.finish_sample(x, finite));
    if let Some(layers) = layers {
        let sampler = || (job.sampler.start)(job.seed, pixel, sample);
        invalid += layers.finish_sample(context, pixel, finite, traced.get() - rays, sampler);
    }
    row.record_invalid(x, sample, invalid);
}

impl Renderer for CpuRenderer {
    fn advance(&mut self, samples: u64) -> Result<WaveStats, RenderError> {
        let start = Instant::now();
        self.timed = OnceLock::new();
        let first = self.job.first_sample + self.own.samples;
        let [width, height] = [self.own.width, self.own.height];
        let pool = &self.pool;
        let (time_rows, timed) = TimeFilm::rows(&mut self.times, height);
        let (layer_rows, layers) = LayerFilms::rows(&mut self.layers, height);
        let wave = WaveContext {
            scene: &self.scene,
            accel: &self.accel,
            camera: &self.camera,
            lights: &self.lights,
            job: &self.job,
            settings: Settings::new(&self.job.params),
            samples: first..first + samples,
            splats: SplatTarget {
                resolution: [width, height],
                plain: &self.splats,
                timed,
            },
            layers,
            wavefront: self.wavefront.as_ref(),
            buffers: Mutex::default(),
        };
        let film = &mut self.own;
        let stats = pool.install(|| {
            let width = width as usize;
            let rows = film
                .sum
                .par_chunks_mut(width)
                .zip(film.sum2.par_chunks_mut(width))
                .enumerate();
            let extra = layer_rows
                .into_par_iter()
                .zip(time_rows)
                .map(|(layers, times)| RowBuffers { layers, times });
            // One row at a time, so that at the end of a wave no thread waits for the last rows of
            // another.
            rows.zip(extra)
                .with_max_len(1)
                .map(|((y, (sum, sum2)), extra)| wave.render_row(y as u32, [sum, sum2], extra))
                .reduce(RowStats::default, RowStats::merge)
        });
        let (overflowed, locks) = wave.flush(pool);
        self.shared_writes += 3 * u64::from(height) + locks;
        film.samples += samples;
        let paths = samples * film.sum.len() as u64;
        self.join();
        Ok(WaveStats {
            samples,
            render_s: start.elapsed().as_secs_f64(),
            paths,
            rays: stats.rays,
            invalid: stats.invalid + overflowed,
            first_invalid: stats.first_invalid.map(|[sample, y, x]| [x, y, sample]),
            ..WaveStats::default()
        })
    }

    fn film(&self) -> &Film {
        match &self.times {
            Some(times) => self.timed.get_or_init(|| times.film(&self.own)),
            None => self.joint.as_ref().unwrap_or(&self.own),
        }
    }

    fn layers(&self) -> &[LayerFilm] {
        self.layers.as_ref().map_or(&[], LayerFilms::films)
    }

    fn times(&self) -> Option<TimeCube> {
        let times = self.times.as_ref()?;
        Some(times.cube([self.own.width, self.own.height], self.own.samples))
    }

    fn layer(&self, index: usize) -> Result<Film, RenderError> {
        let layers = self
            .layers
            .as_ref()
            .filter(|layers| index < layers.films().len());
        let missing = || RenderError::Failed {
            backend: "cpu",
            reason: format!("there is no film {index} of layers"),
        };
        Ok(layers.ok_or_else(missing)?.film(
            index,
            [self.own.width, self.own.height],
            self.own.samples,
        ))
    }

    fn save(&self, to: &mut dyn Write) -> io::Result<bool> {
        self.own.save(to)?;
        SplatSums::save(self.splats.get(), to)?;
        if let Some(layers) = &self.layers {
            layers.save(to)?;
        }
        if let Some(times) = &self.times {
            times.save(to)?;
        }
        Ok(true)
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), RenderError> {
        let mut from = StateReader::new(state);
        self.timed = OnceLock::new();
        let take = || {
            self.own.restore(&mut from)?;
            let splats = SplatSums::restore(self.own.sum.len(), &mut from)?;
            self.splats = splats.map_or_else(OnceLock::new, OnceLock::from);
            if let Some(layers) = &mut self.layers {
                layers.restore(&mut from)?;
            }
            if let Some(times) = &mut self.times {
                times.restore(&mut from)?;
            }
            from.finish()
        };
        take().map_err(|e| RenderError::Failed {
            backend: "cpu",
            reason: e.to_string(),
        })?;
        self.join();
        Ok(())
    }

    fn open_stats(&self) -> &OpenStats {
        &self.open_stats
    }
}
