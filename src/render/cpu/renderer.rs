//! The loop over pixels and samples.

use std::cell::Cell;
use std::sync::Arc;
use std::time::Instant;

use glam::Vec3;
use rayon::prelude::*;

use super::accel::Accel;
use crate::film::Film;
use crate::render::{Job, OpenStats, RenderError, Renderer, WaveStats};
use crate::scene::CompiledScene;
use crate::transport::camera::Camera;
use crate::transport::integrator::Context;
use crate::transport::light::{Lights, Select};
use crate::transport::ray::{Hit, Ray, Trace};
use crate::transport::sampler::Sampler;

/// A run on the CPU.
///
/// Every pixel's samples are added to its sums in the order of their index by one thread, so the film has the same bits
/// for any number of threads and for any grouping of samples into waves.
pub struct CpuRenderer {
    scene: Arc<CompiledScene>,
    accel: Accel,
    camera: Camera,
    lights: Lights,
    job: Job,
    pool: rayon::ThreadPool,
    film: Film,
    open_stats: OpenStats,
}

impl CpuRenderer {
    /// Builds everything that is not per sample.
    ///
    /// # Errors
    /// When the threads cannot be started or the scene's hierarchy cannot be used.
    pub fn new(scene: Arc<CompiledScene>, job: Job) -> Result<CpuRenderer, RenderError> {
        let failed = |reason: String| RenderError::Failed { backend: "cpu", reason };
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(job.threads)
            .thread_name(|i| format!("render-{i}"))
            .build()
            .map_err(|e| failed(format!("cannot start render threads: {e}")))?;
        let accel = pool.install(|| Accel::build(Arc::clone(&scene))).map_err(|e| failed(e.to_string()))?;
        let open_stats = OpenStats {
            accel_build_s: accel.build_s,
            accel_nodes: accel.node_count() as u64,
            device: format!("cpu, {} threads, four-wide BVH", pool.current_num_threads()),
        };
        Ok(CpuRenderer {
            camera: Camera::new(&scene.camera, job.resolution, job.filter),
            lights: Lights::with_select(&scene, Select::of(&job.params)),
            film: Film::new(job.resolution[0], job.resolution[1]),
            accel,
            scene,
            job,
            pool,
            open_stats,
        })
    }
}

/// What the rows of a wave report, merged without order.
#[derive(Clone, Copy, Default)]
struct RowStats {
    rays: u64,
    invalid: u64,
    /// Sample, row, column: the order in which "first" is meant.
    first_invalid: Option<[u64; 3]>,
}

impl RowStats {
    fn merge(self, other: RowStats) -> RowStats {
        RowStats {
            rays: self.rays + other.rays,
            invalid: self.invalid + other.invalid,
            first_invalid: [self.first_invalid, other.first_invalid].into_iter().flatten().min(),
        }
    }
}

/// The hierarchy with a counter of its rays, one for each row, so that counting shares nothing between threads.
struct Counted<'a> {
    accel: &'a Accel,
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
}

impl Renderer for CpuRenderer {
    fn advance(&mut self, samples: u64) -> Result<WaveStats, RenderError> {
        let start = Instant::now();
        let first = self.film.samples;
        let width = self.film.width as usize;
        let CpuRenderer { scene, accel, camera, lights, job, film, pool, .. } = self;
        let render_row = |y: usize, sum: &mut [[f64; 3]], sum2: &mut [[f64; 3]]| {
            let trace = Counted { accel, rays: Cell::new(0) };
            let context = Context {
                scene,
                camera,
                lights,
                trace: &trace,
                max_depth: job.max_depth,
                rr_start: job.rr_start,
                params: &job.params,
            };
            let mut stats = RowStats::default();
            for x in 0..width {
                let pixel = [x as u32, y as u32];
                for sample in first..first + samples {
                    let mut value = Vec3::ZERO;
                    let mut sampler = Sampler::new(job.seed, pixel, sample);
                    (job.integrator.sample)(&context, pixel, &mut sampler, &mut |c| value += c.value);
                    if !value.is_finite() {
                        let here = RowStats { rays: 0, invalid: 1, first_invalid: Some([sample, y as u64, x as u64]) };
                        stats = stats.merge(here);
                        continue;
                    }
                    for c in 0..3 {
                        let v = f64::from(value[c]);
                        sum[x][c] += v;
                        sum2[x][c] += v * v;
                    }
                }
            }
            RowStats { rays: trace.rays.get(), ..stats }
        };
        let stats = pool.install(|| {
            let rows = film.sum.par_chunks_mut(width).zip(film.sum2.par_chunks_mut(width)).enumerate();
            rows.map(|(y, (sum, sum2))| render_row(y, sum, sum2)).reduce(RowStats::default, RowStats::merge)
        });
        film.samples += samples;
        Ok(WaveStats {
            samples,
            render_s: start.elapsed().as_secs_f64(),
            paths: samples * film.sum.len() as u64,
            rays: stats.rays,
            invalid: stats.invalid,
            first_invalid: stats.first_invalid.map(|[sample, y, x]| [x, y, sample]),
        })
    }

    fn film(&self) -> &Film {
        &self.film
    }

    fn open_stats(&self) -> &OpenStats {
        &self.open_stats
    }
}
