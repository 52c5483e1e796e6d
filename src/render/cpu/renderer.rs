//! The loop over pixels and samples.

use std::cell::Cell;
use std::io::{self, Write};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Instant;

use glam::Vec3;
use rayon::prelude::*;

use super::accel::Accel;
use super::bins;
use super::lanes::Isa;
use super::layers::{LayerSums, Sums, Tally};
use super::row::{RowStats, RowSums, Splats};
use super::streams::{Few, Streams};
use super::times::{Gathering, TimeRow, TimeSums};
use crate::film::Film;
use crate::film::layer::LayerFilm;
use crate::film::splat::{SplatBuffer, SplatSums};
use crate::film::state::Saved;
use crate::film::time::TimeCube;
use crate::render::hierarchy::{AccelSpec, Builder};
use crate::render::{Job, OpenStats, RenderError, Renderer, WaveStats};
use crate::scene::CompiledScene;
use crate::transport::camera::Camera;
use crate::transport::integrator::{Context, Settings};
use crate::transport::light::{Lights, Select};
use crate::transport::ray::{Hit, Ray, Trace};

/// A run on the CPU.
///
/// Every pixel's samples are added to its sums in the order of their index by one thread, so the film has the same bits
/// for any number of threads and for any grouping of samples into waves. Splats, light for pixels other than the
/// sample's own, are summed apart in whole numbers, whose order does not matter, and join the film after each wave.
pub struct CpuRenderer {
    scene: Arc<CompiledScene>,
    accel: Accel,
    camera: Camera,
    lights: Lights,
    job: Job,
    pool: rayon::ThreadPool,
    /// What samples brought to their own pixels; without sums where there is a time axis, whose slots have them.
    own: Film,
    /// What they brought elsewhere; there from the first splat on.
    splats: OnceLock<SplatSums>,
    /// Both together, where there are splats.
    joint: Option<Film>,
    /// The layers, where the job asks for any.
    layers: Option<LayerSums>,
    /// What shades paths in lanes, where the job can be done so.
    streams: Option<Streams>,
    /// The sums by time, where the job asks for them.
    times: Option<TimeSums>,
    /// The film that is the sum of those, made when it is asked for: that takes a look at every bin.
    timed: OnceLock<Film>,
    /// See [`CpuRenderer::shared_writes`].
    shared_writes: u64,
    open_stats: OpenStats,
}

impl CpuRenderer {
    /// Builds everything that is not per sample.
    ///
    /// # Errors
    /// When the threads cannot be started, the scene's hierarchy cannot be used, or layers or bins are too large.
    pub fn new(scene: Arc<CompiledScene>, job: Job) -> Result<CpuRenderer, RenderError> {
        CpuRenderer::with_isa(scene, job, Isa::detect())
    }

    /// The same for a set of instructions, one of [`Isa::available`].
    ///
    /// # Errors
    /// As of [`CpuRenderer::new`].
    pub fn with_isa(scene: Arc<CompiledScene>, job: Job, isa: Isa) -> Result<CpuRenderer, RenderError> {
        let failed = |reason: String| RenderError::Failed { backend: "cpu", reason };
        let layers = LayerSums::of(&job).map_err(|reason| RenderError::Unsupported { backend: "cpu", reason })?;
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(job.threads)
            .thread_name(|i| format!("render-{i}"))
            .build()
            .map_err(|e| failed(format!("cannot start render threads: {e}")))?;
        let times = pool.install(|| TimeSums::of(&job));
        let times = times.map_err(|reason| RenderError::Unsupported { backend: "cpu", reason })?;
        let accel =
            pool.install(|| Accel::build_as(Arc::clone(&scene), &job.accel, isa)).map_err(|e| failed(e.to_string()))?;
        // Not the one that came where the builder knows no copies: primitives are numbered as the hierarchy's scene has them.
        let scene = Arc::clone(&accel.scene);
        let streams = Streams::of(&scene, &job, &accel);
        let open_stats = OpenStats {
            accel_build_s: accel.build_s,
            accel_nodes: accel.node_count() as u64,
            accel_bytes: accel.bytes() as u64,
            accel_cost: accel.cost(),
            device: words(&accel, &job.accel, pool.current_num_threads(), streams.is_some()),
            ..OpenStats::default()
        };
        Ok(CpuRenderer {
            camera: Camera::new(&scene.camera, job.resolution, job.filter),
            lights: Lights::with_select(&scene, Select::of(&job.params)),
            own: Film::new(job.resolution[0], job.resolution[1]),
            splats: OnceLock::new(),
            joint: None,
            layers,
            streams,
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
    /// Whether paths are shaded several at a time in the lanes of vectors. Pictures have the same bits either way.
    pub fn in_lanes(&self) -> bool {
        self.streams.is_some()
    }

    /// How often its threads have written, in all waves, to what others write to as well: took a row from the others, a buffer
    /// from those that lie idle and put it back, or locked pixels to add splats. All else that a thread writes is its own.
    pub fn shared_writes(&self) -> u64 {
        self.shared_writes
    }

    /// Joins splats and own samples into one film.
    fn join(&mut self) {
        let Some(splats) = self.splats.get().filter(|_| self.own.samples > 0) else { return };
        let own = &self.own;
        let film = self.joint.get_or_insert_with(|| Film::new(own.width, own.height));
        film.samples = own.samples;
        let joined = film.sum.par_iter_mut().zip(&mut film.sum2).enumerate();
        self.pool.install(|| {
            joined.for_each(|(i, (sum, sum2))| (*sum, *sum2) = splats.join(i, own.sum[i], own.sum2[i], own.samples));
        });
    }
}

/// A line for people: what traces rays, and how.
fn words(accel: &Accel, spec: &AccelSpec, threads: usize, lanes: bool) -> String {
    let plain = AccelSpec::default();
    let tree = match spec.builder {
        Builder::None => "no hierarchy".to_owned(),
        Builder::Cwbvh => format!("{} of obvhs", spec.describe()),
        _ if AccelSpec { instances: plain.instances, lanes: plain.lanes, ..*spec } == plain => {
            "eight-wide BVH".to_owned()
        }
        _ => format!("eight-wide BVH by {}", spec.describe()),
    };
    let lanes = if lanes { ", paths in lanes" } else { "" };
    format!("cpu, {threads} threads, {tree}, {}{lanes}", accel.isa().name())
}

/// The sums of a row beside those of the picture.
struct Apart<'a> {
    layers: Option<&'a mut [Sums]>,
    times: Option<TimeRow<'a>>,
}

/// The hierarchy with a counter of its rays, one for each row, so that counting shares nothing between threads.
struct Counted<'a> {
    accel: &'a Accel,
    /// What traces many rays at once, if anything does.
    few: Option<&'a Few>,
    rays: Cell<u64>,
}

impl Trace for Counted<'_> {
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
        match self.few {
            Some(few) => few.closest(rays, hits),
            None => hits.extend(rays.iter().map(|(ray, t_max)| self.accel.closest(ray, *t_max))),
        }
    }

    fn occluded_each(&self, rays: &[(Ray, f32)], hidden: &mut Vec<bool>) {
        self.rays.set(self.rays.get() + rays.len() as u64);
        match self.few {
            Some(few) => few.occluded(rays, hidden),
            None => hidden.extend(rays.iter().map(|(ray, t_max)| self.accel.occluded(ray, *t_max))),
        }
    }
}

/// One sample of a pixel, whose path goes by itself.
fn one(
    context: &Context,
    job: &Job,
    pixel: [u32; 2],
    sample: u64,
    row: &mut RowSums,
    tally: &mut Option<Tally>,
    traced: &Cell<u64>,
) {
    let x = pixel[0];
    let (mut value, mut invalid) = (Vec3::ZERO, 0);
    let rays = traced.get();
    let mut sampler = (job.sampler.start)(job.seed, pixel, sample);
    (job.integrator.sample)(context, pixel, &mut sampler, &mut |c| {
        if c.t != 1 && c.pixel == pixel {
            value += c.value;
            invalid += tally.as_mut().map_or(0, |tally| tally.own(&c));
            row.part(x, c.value, c.length);
            return;
        }
        match row.splat(c.pixel, c.value, c.length) {
            None => invalid += 1,
            Some(place) => {
                if let (Some(tally), Some(at)) = (tally.as_mut(), place) {
                    invalid += tally.splat(at, &c);
                }
            }
        }
    });
    let finite = row.add(x, value);
    invalid += u64::from(!finite) + u64::from(!row.close(x, finite));
    if let Some(tally) = tally {
        let again = || (job.sampler.start)(job.seed, pixel, sample);
        invalid += tally.close(context, pixel, finite, traced.get() - rays, again);
    }
    row.refused(x, sample, invalid);
}

impl Renderer for CpuRenderer {
    fn advance(&mut self, samples: u64) -> Result<WaveStats, RenderError> {
        let start = Instant::now();
        self.timed = OnceLock::new();
        let first = self.job.first_sample + self.own.samples;
        let [width, height] = [self.own.width, self.own.height];
        let CpuRenderer { scene, accel, camera, lights, job, own: film, splats, layers, times, pool, .. } = self;
        let settings = Settings::new(&job.params);
        // Rows hand their buffers on, so that few are needed and they are mostly full when they are emptied.
        let buffers: Mutex<Vec<SplatBuffer>> = Mutex::default();
        let idle = || buffers.lock().unwrap_or_else(PoisonError::into_inner);
        let (time_rows, landing) = TimeSums::rows(times, height);
        let splats = Splats { resolution: [width, height], plain: splats, landing };
        let (layer_rows, spec) = LayerSums::rows(layers, height);
        let streams = self.streams.as_ref();
        let render_row = |y: u32, sums: [&mut [[f64; 3]]; 2], apart: Apart| {
            let trace = Counted { accel, few: streams.and_then(Streams::few), rays: Cell::new(0) };
            let context = Context {
                scene,
                camera,
                lights,
                trace: &trace,
                max_depth: job.max_depth,
                rr_start: job.rr_start,
                settings: &settings,
                timing: job.timing.as_ref(),
            };
            let buffer = idle().pop().unwrap_or_else(|| splats.buffer());
            let by_time = apart.times.zip(splats.landing).map(|(row, landing)| Gathering::new(landing, row));
            let mut row = RowSums::new(y, sums, by_time, splats, buffer);
            let samples = first..first + samples;
            if let Some(streams) = streams {
                streams.row(&context, job, y, samples, &mut row);
            } else {
                let mut tally = apart.layers.zip(spec).map(|(row, spec)| Tally::new(spec, row));
                for x in 0..width {
                    for sample in samples.clone() {
                        one(&context, job, [x, y], sample, &mut row, &mut tally, &trace.rays);
                    }
                }
            }
            let (stats, buffer) = row.end(trace.rays.get());
            idle().push(buffer);
            stats
        };
        let stats = pool.install(|| {
            let width = width as usize;
            let rows = film.sum.par_chunks_mut(width).zip(film.sum2.par_chunks_mut(width)).enumerate();
            let apart = layer_rows.into_par_iter().zip(time_rows).map(|(layers, times)| Apart { layers, times });
            // One by one, so that at the end of a wave no thread waits for another's last rows.
            rows.zip(apart)
                .with_max_len(1)
                .map(|((y, (sum, sum2)), apart)| render_row(y as u32, [sum, sum2], apart))
                .reduce(RowStats::default, RowStats::merge)
        });
        // By all threads: there are as many buffers as those, and one of them would keep the others waiting.
        let without_room: u64 = pool.install(|| {
            let mut left = idle();
            left.par_iter_mut().filter(|b| !b.is_empty()).map(|buffer| buffer.flush(splats.sums())).sum()
        });
        let mut buffers = buffers.into_inner().unwrap_or_else(PoisonError::into_inner);
        let locks: u64 = buffers.iter_mut().map(SplatBuffer::take_locks).sum();
        bins::leave(buffers);
        self.shared_writes += 3 * u64::from(height) + locks;
        film.samples += samples;
        let paths = samples * film.sum.len() as u64;
        self.join();
        Ok(WaveStats {
            samples,
            render_s: start.elapsed().as_secs_f64(),
            paths,
            rays: stats.rays,
            invalid: stats.invalid + without_room,
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
        self.layers.as_ref().map_or(&[], LayerSums::films)
    }

    fn times(&self) -> Option<TimeCube> {
        let times = self.times.as_ref()?;
        Some(times.cube([self.own.width, self.own.height], self.own.samples))
    }

    fn layer(&self, index: usize) -> Result<Film, RenderError> {
        let layers = self.layers.as_ref().filter(|layers| index < layers.films().len());
        let missing = || RenderError::Failed { backend: "cpu", reason: format!("there is no film {index} of layers") };
        Ok(layers.ok_or_else(missing)?.film(index, [self.own.width, self.own.height], self.own.samples))
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
        let mut from = Saved::new(state);
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
            from.end()
        };
        take().map_err(|e| RenderError::Failed { backend: "cpu", reason: e.to_string() })?;
        self.join();
        Ok(())
    }

    fn open_stats(&self) -> &OpenStats {
        &self.open_stats
    }
}
