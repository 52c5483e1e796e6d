//! The CPU renderer: the loop over rows, pixels and samples.
//!
//! Invariant: the film has the same bits for any number of threads, any instruction set, and any
//! grouping of samples into waves. One thread adds the samples of a pixel to its sums, in the order
//! of their index. Splats, contributions to pixels other than the sample's own, are summed
//! separately in fixed point, where the order of additions does not matter, and are combined with
//! the other sums after each wave. Integrators with data that samples share are rendered one sample
//! index after the other.

use std::io::{self, Write};
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use glam::Vec3;
use rayon::prelude::*;

use super::bvh::accel::Accel;
use super::bvh::simd::Isa;
use super::clock::WaveTime;
use super::films::bin_pool;
use super::films::layers::{LayerFilms, LayerRowFilm, LayerSpec, Moments};
use super::films::row_film::{RowFilm, RowStats, SplatTarget};
use super::films::time_film::{SlotRow, TimeFilm, TimeRowFilm};
use super::prepared::{CountingTrace, PreparedJob};
use super::prepared_scene::{PreparedScene, RenderThreads};
use super::wavefront::Wavefront;
use crate::device::Features;
use crate::hierarchy::{AccelSpec, Builder};
use crate::{Abandoned, Advance, Device, Job, OpenStats, RenderError, Renderer, Until, WaveStats};
use lumbre_light::film::Film;
use lumbre_light::film::layer::{LayerFilm, LayerSource};
use lumbre_light::film::splat::{SplatBuffer, SplatSums};
use lumbre_light::film::state::StateReader;
use lumbre_light::film::time::TimeCube;
use lumbre_light::scene::CompiledScene;
use lumbre_light::transport::contribution::Contribution;
use lumbre_light::transport::integrator::Context;
use lumbre_light::transport::integrator::iteration::Shared;
use lumbre_light::transport::integrator::iteration::recorded::RecordedSamples;

impl PreparedScene {
    /// Starts a run of a job. The settings of the hierarchy and the number of threads are those of
    /// the prepared scene.
    ///
    /// # Errors
    /// Returns an error if layers or bins exceed their limits.
    pub fn open(&self, job: Job) -> Result<CpuRenderer, RenderError> {
        CpuRenderer::open(self, job)
    }
}

/// Renderer of one job on the CPU.
pub struct CpuRenderer {
    prepared: PreparedJob,
    threads: Arc<RenderThreads>,
    /// Sums of the samples' contributions to their own pixels. With a time axis `sum` is unused,
    /// since the sums are in the slots of `times`.
    own: Film,
    /// Sums of splats, allocated for the first splat.
    splats: OnceLock<SplatSums>,
    /// Film of `own` and `splats` combined, if there are splats and no time axis.
    combined: Option<Film>,
    /// Films of the layers, if the job requests any.
    layers: Option<LayerFilms>,
    /// Film with a time axis, if the job requests one.
    times: Option<TimeFilm>,
    /// Main film computed from the slots of `times`; computed on demand, since it reads every slot.
    film_of_slots: OnceLock<Film>,
    /// Result of [`CpuRenderer::shared_writes`].
    shared_writes: u64,
    open_stats: OpenStats,
}

impl CpuRenderer {
    /// Starts the threads, builds the hierarchy, and allocates the films. Uses the widest
    /// instruction set of this processor.
    ///
    /// # Errors
    /// Returns an error if threads cannot be started, the scene's hierarchy cannot be used, or
    /// layers or bins exceed their limits.
    pub fn new(scene: Arc<CompiledScene>, job: Job) -> Result<CpuRenderer, RenderError> {
        CpuRenderer::with_isa(scene, job, Isa::detect())
    }

    /// Creates the renderer for a given instruction set, which must be one of [`Isa::available`].
    ///
    /// # Errors
    /// Returns an error in the cases of [`CpuRenderer::new`].
    pub fn with_isa(
        scene: Arc<CompiledScene>,
        job: Job,
        isa: Isa,
    ) -> Result<CpuRenderer, RenderError> {
        let shared = PreparedScene::with_isa(scene, &job.settings.accel, job.threads, isa)?;
        CpuRenderer::open(&shared, job)
    }

    /// Starts a run on a prepared scene: allocates the films and prepares the technique.
    pub(super) fn open(scene: &PreparedScene, job: Job) -> Result<CpuRenderer, RenderError> {
        let unsupported = |reason: String| RenderError::unsupported("cpu", reason);
        let threads = Arc::clone(&scene.threads);
        let pool = &threads.pool;
        let layers = LayerFilms::for_job(&job).map_err(unsupported)?;
        let times = pool
            .install(|| TimeFilm::for_job(&job))
            .map_err(unsupported)?;
        let prepared = pool.install(|| PreparedJob::new(scene, job));
        let PreparedJob { accel, job, .. } = &prepared;
        let lanes = prepared.wavefront().map_or(1, Wavefront::lanes);
        let open_stats = OpenStats {
            accel_build_s: accel.build_s,
            accel_nodes: accel.node_count() as u64,
            accel_bytes: accel.bytes() as u64,
            accel_cost: accel.cost(),
            scene: accel.scene.memory(),
            devices: vec![device(accel, pool.current_num_threads(), lanes)],
            watches_processor: threads.clock.watches_processor(),
            ..OpenStats::default()
        };
        Ok(CpuRenderer {
            own: Film::new(job.resolution[0], job.resolution[1]),
            splats: OnceLock::new(),
            combined: None,
            layers,
            times,
            film_of_slots: OnceLock::new(),
            shared_writes: 0,
            prepared,
            threads,
            open_stats,
        })
    }
}

impl CpuRenderer {
    /// Returns whether the run uses the vectorised path tracer. Films have the same bits either
    /// way.
    pub fn is_vectorised(&self) -> bool {
        self.prepared.wavefront().is_some()
    }

    /// Returns the number of writes to memory that threads share, over all waves: rows taken, splat
    /// buffers taken or returned, and locks of stripes of splat sums. All other memory is written
    /// by one thread only.
    pub fn shared_writes(&self) -> u64 {
        self.shared_writes
    }

    /// Adds samples with consecutive indices to every pixel; all read the data `shared`. Splats are
    /// not combined with the other sums yet. Rows that begin after `abandoned` returns true are left
    /// out.
    fn render_samples(
        &mut self,
        samples: Range<u64>,
        shared: Option<&Shared>,
        abandoned: Abandoned,
    ) -> RowStats {
        let [width, height] = [self.own.width, self.own.height];
        let count = samples.end - samples.start;
        let (time_rows, timed) = TimeFilm::rows(&mut self.times, height);
        let (layer_rows, layers) = LayerFilms::rows(&mut self.layers, height);
        let wave = WaveContext {
            prepared: &self.prepared,
            shared,
            samples,
            splats: SplatTarget {
                resolution: [width, height],
                plain: &self.splats,
                timed,
            },
            layers,
            recorded: self.prepared.recorded(shared),
            wavefront: self.prepared.wavefront(),
            free_buffers: Mutex::default(),
        };
        let film = &mut self.own;
        let stats = self.threads.pool.install(|| {
            let width = width as usize;
            let rows = film
                .sum
                .par_chunks_mut(width)
                .zip(film.sum2.par_chunks_mut(width))
                .enumerate();
            let extra = layer_rows
                .into_par_iter()
                .zip(time_rows)
                .map(|(layers, times)| ExtraRows { layers, times });
            // Rows are distributed one by one. With longer ranges a thread waits for the last rows
            // of another at the end of a wave: 1.84 to 1.94 of 2 processors were busy, now 1.99.
            rows.zip(extra)
                .with_max_len(1)
                .map(|((y, (sum, sum2)), extra)| {
                    if abandoned() {
                        return RowStats::default();
                    }
                    wave.render_row(y as u32, [sum, sum2], extra)
                })
                .reduce(RowStats::default, RowStats::merge)
        });
        let (overflowed, locks) = wave.flush(&self.threads.pool);
        self.shared_writes += 3 * u64::from(height) + locks;
        film.samples += count;
        RowStats {
            invalid: stats.invalid + overflowed,
            ..stats
        }
    }

    /// Adds samples with consecutive indices to every pixel, those with the same shared data at once:
    /// see [`render_samples`](Self::render_samples).
    fn render_iterations(&mut self, samples: Range<u64>, abandoned: Abandoned) -> RowStats {
        let (mut index, mut stats) = (samples.start, RowStats::default());
        while index < samples.end && !abandoned() {
            let begin = || self.prepared.begin(index, abandoned);
            let begun = self.threads.pool.install(begin);
            let shared = begun.as_ref().map(|(shared, _)| &**shared);
            let left = samples.end - index;
            let end = index + self.prepared.samples_at_once(index, left);
            let own = self.render_samples(index..end, shared, abandoned);
            stats = stats.merge(own).merge(RowStats {
                rays: begun.as_ref().map_or(0, |(_, rays)| *rays),
                ..RowStats::default()
            });
            index = end;
        }
        stats
    }

    /// Adds samples to every pixel, or to some if `abandoned` returns true before the end.
    fn wave(&mut self, samples: u64, abandoned: Abandoned) -> WaveStats {
        let start = self.threads.clock.start();
        self.film_of_slots = OnceLock::new();
        let first = self.prepared.job.first_sample + self.own.samples;
        let range = first..first + samples;
        let stats = if self.prepared.shares() {
            self.render_iterations(range, abandoned)
        } else {
            self.render_samples(range, None, abandoned)
        };
        self.combine_splats();
        let WaveTime { render_s, lost_s } = self.threads.clock.stop(&start);
        WaveStats {
            samples,
            render_s,
            lost_s,
            paths: samples * self.own.sum.len() as u64,
            rays: stats.rays,
            invalid: stats.invalid,
            first_invalid: stats.first_invalid.map(|[sample, y, x]| [x, y, sample]),
            ..WaveStats::default()
        }
    }

    /// Combines the splats and the samples' contributions to their own pixels into one film.
    fn combine_splats(&mut self) {
        let Some(splats) = self.splats.get().filter(|_| self.own.samples > 0) else {
            return;
        };
        let own = &self.own;
        let film = self
            .combined
            .get_or_insert_with(|| Film::new(own.width, own.height));
        film.samples = own.samples;
        let pixels = film.sum.par_iter_mut().zip(&mut film.sum2).enumerate();
        self.threads.pool.install(|| {
            pixels.for_each(|(i, (sum, sum2))| {
                (*sum, *sum2) = splats.combined(i, own.sum[i], own.sum2[i], own.samples)
            });
        });
    }
}

/// Returns the threads of the processor that traverse a hierarchy, with `lanes` paths at a time each.
fn device(accel: &Accel, threads: usize, lanes: u32) -> Device {
    let (spec, plain) = (&accel.spec, AccelSpec::default());
    let hierarchy = match spec.builder {
        Builder::None => "no hierarchy".to_owned(),
        Builder::Cwbvh => format!("compressed BVH by {}", spec.describe()),
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
    Device {
        features: Features {
            hierarchy: Some(hierarchy),
            instructions: Some(accel.isa().name().to_owned()),
            lanes: Some(lanes),
            tracing: None,
        },
        ..Device::processor(u32::try_from(threads).unwrap_or(u32::MAX))
    }
}

/// Sums of one row of pixels in the films beside the main one.
struct ExtraRows<'a> {
    layers: Option<&'a mut [Moments]>,
    times: Option<SlotRow<'a>>,
}

/// State that the threads of a wave share.
struct WaveContext<'a> {
    prepared: &'a PreparedJob,
    /// Data that the samples share, if the integrator computes any.
    shared: Option<&'a Shared>,
    /// Indices of the samples that the wave adds to every pixel.
    samples: Range<u64>,
    splats: SplatTarget<'a>,
    layers: Option<&'a LayerSpec>,
    /// The samples themselves, if they were rendered while the iteration began.
    recorded: Option<&'a RecordedSamples>,
    wavefront: Option<&'a Wavefront>,
    /// Splat buffers that no thread is using. A row takes one and returns it partly filled, so that
    /// there is at most one per thread and most are flushed when they are full.
    free_buffers: Mutex<Vec<SplatBuffer>>,
}

impl WaveContext<'_> {
    fn lock_free_buffers(&self) -> MutexGuard<'_, Vec<SplatBuffer>> {
        self.free_buffers
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }

    /// Renders all samples of row `y`.
    fn render_row(&self, y: u32, sums: [&mut [[f64; 3]]; 2], extra: ExtraRows) -> RowStats {
        let job = &self.prepared.job;
        let small = self.wavefront.and_then(Wavefront::small_scene);
        let trace = CountingTrace::new(&self.prepared.accel, small);
        let context = self.prepared.context(&trace, self.shared);
        let buffer = self
            .lock_free_buffers()
            .pop()
            .unwrap_or_else(|| self.splats.buffer());
        let time_film = extra
            .times
            .zip(self.splats.timed)
            .map(|(row, splats)| TimeRowFilm::new(splats, row));
        let mut row = RowFilm::new(y, sums, time_film, self.splats, buffer);
        let mut layers = extra
            .layers
            .zip(self.layers)
            .map(|(row, spec)| LayerRowFilm::new(spec, row));
        let samples = self.samples.clone();
        if let (Some(wavefront), None) = (self.wavefront, self.recorded) {
            wavefront.render_row(&context, job, y, samples, &mut row, layers.as_mut());
        } else {
            for (x, sample) in
                (0..job.resolution[0]).flat_map(|x| samples.clone().map(move |i| (x, i)))
            {
                let id = ([x, y], sample);
                add_sample(&context, self.prepared, id, &mut row, &mut layers, |sink| {
                    self.find_light(&context, id, &trace, sink)
                });
            }
        }
        let (stats, buffer) = row.finish(trace.rays());
        self.lock_free_buffers().push(buffer);
        stats
    }

    /// Passes all light of a sample to `sink`: light that was recorded, or else what the technique
    /// finds on the scalar path with the rays of `trace`. Returns the number of rays.
    fn find_light(
        &self,
        context: &Context,
        (pixel, sample): ([u32; 2], u64),
        trace: &CountingTrace,
        sink: &mut dyn FnMut(Contribution),
    ) -> u64 {
        if let Some(recorded) = self.recorded {
            let (light, rays) = recorded.sample(pixel);
            light.iter().for_each(|c| sink(*c));
            return u64::from(rays);
        }
        let before = trace.rays();
        let mut sampler = self.prepared.sampler(self.shared, pixel, sample);
        (self.prepared.job.integrator.sample)(context, pixel, &mut sampler, sink);
        trace.rays() - before
    }

    /// Flushes and recycles all splat buffers. Returns the number of splats whose squares
    /// overflowed and the number of locks taken by all flushes.
    fn flush(self, pool: &rayon::ThreadPool) -> (u64, u64) {
        // In parallel, since there is up to one buffer per thread.
        let overflowed = pool.install(|| {
            self.lock_free_buffers()
                .par_iter_mut()
                .filter(|buffer| !buffer.is_empty())
                .map(|buffer| buffer.flush(self.splats.sums()))
                .sum()
        });
        let buffers = self.free_buffers.into_inner();
        let mut buffers = buffers.unwrap_or_else(PoisonError::into_inner);
        let locks = buffers.iter_mut().map(SplatBuffer::take_locks).sum();
        bin_pool::recycle_buffers(buffers);
        (overflowed, locks)
    }
}

/// Adds one sample of a pixel to the films of its row. `find` passes all light of the sample to a
/// function, and returns the number of rays that found it.
fn add_sample(
    context: &Context,
    prepared: &PreparedJob,
    (pixel, sample): ([u32; 2], u64),
    row: &mut RowFilm,
    layers: &mut Option<LayerRowFilm>,
    find: impl FnOnce(&mut dyn FnMut(Contribution)) -> u64,
) {
    let x = pixel[0];
    let (mut value, mut invalid) = (Vec3::ZERO, 0);
    let rays = find(&mut |c| {
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
        let sampler = || prepared.sampler(context.shared, pixel, sample);
        // This ray is none of the technique's, so it does not count.
        let context = prepared.context(&*prepared.accel, context.shared);
        let hit = layers.first_hit(&context, pixel, sampler);
        invalid += layers.finish_sample((x, sample), finite, rays, hit);
    }
    row.record_invalid(x, sample, invalid);
}

impl Renderer for CpuRenderer {
    fn render(&mut self, request: &Advance<'_>) -> Result<WaveStats, RenderError> {
        let Until::Abandoned(abandoned) = request.until else {
            return Ok(self.wave(request.samples, &|| false));
        };
        let stats = self.wave(request.samples, abandoned);
        if abandoned() {
            return Err(RenderError::Cancelled { backend: "cpu" });
        }
        Ok(stats)
    }

    fn film(&self) -> &Film {
        match &self.times {
            Some(times) => self.film_of_slots.get_or_init(|| times.film(&self.own)),
            None => self.combined.as_ref().unwrap_or(&self.own),
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
        let film = self.layers().get(index);
        match (film.map(|film| film.layer.row().source), &self.layers) {
            (Some(LayerSource::Variance), _) => Ok(self.film().clone()),
            (Some(_), Some(layers)) => {
                let size = [self.own.width, self.own.height];
                Ok(layers.film(index, size, self.own.samples))
            }
            _ => {
                let reason = format!("layer film {index} does not exist");
                Err(RenderError::failed("cpu", reason))
            }
        }
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
        self.film_of_slots = OnceLock::new();
        let read = || {
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
        read().map_err(|e| RenderError::failed("cpu", e))?;
        self.combine_splats();
        Ok(())
    }

    fn open_stats(&self) -> &OpenStats {
        &self.open_stats
    }
}
