//! A job prepared for the samples of an integrator: everything that stays the same from sample to
//! sample, and the data that an iteration shares.

use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use super::bvh::accel::Accel;
use super::prepared_scene::PreparedScene;
use super::wavefront::{SmallScene, Wavefront};
use crate::{Abandoned, Job};
use lumbre_light::transport::arrival::SurfaceClasses;
use lumbre_light::transport::camera::Camera;
use lumbre_light::transport::integrator::iteration::light_batch::{LightBatch, LightUnit};
use lumbre_light::transport::integrator::iteration::recorded::{
    CameraBatch, RecordedPaths, RecordedSamples,
};
use lumbre_light::transport::integrator::iteration::{Iteration, Resources, Shared, Workers};
use lumbre_light::transport::integrator::{Context, Settings};
use lumbre_light::transport::light::{LightSampling, Lights};
use lumbre_light::transport::ray::{Hit, Ray, Trace};
use lumbre_light::transport::sampler::Sampler;

/// A job with its scene, hierarchy, camera, lights and parsed parameters.
pub(super) struct PreparedJob {
    pub accel: Arc<Accel>,
    camera: Camera,
    lights: Arc<Lights>,
    classes: Arc<SurfaceClasses>,
    settings: Settings,
    pub job: Job,
    /// Renderer of many paths at a time, if the job can use it.
    wavefront: Option<Wavefront>,
    /// Data that all iterations need, for integrators whose samples share data.
    iterations: Option<Box<Shared>>,
}

impl PreparedJob {
    /// Prepares camera, lights, and what all iterations need.
    pub fn new(scene: &PreparedScene, job: Job) -> PreparedJob {
        let mut prepared = PreparedJob {
            accel: Arc::clone(&scene.accel),
            camera: Camera::new(
                job.camera(scene.scene()),
                job.resolution,
                job.settings.filter,
            ),
            lights: scene.lights(LightSampling::new(job.integrator, &job.settings.params)),
            classes: Arc::clone(&scene.classes),
            settings: Settings::of(job.integrator.name, &job.settings.params),
            wavefront: Wavefront::new(&job, &scene.accel),
            job,
            iterations: None,
        };
        if let Some(sharing) = prepared.job.integrator.sharing {
            let workers = CountingWorkers::new(&prepared, &|| false);
            let iterations = (sharing.prepare)(&prepared.resources(&workers));
            prepared.iterations = Some(iterations);
        }
        prepared
    }

    /// Returns the renderer of many samples at a time, if the job's samples can be rendered so.
    pub fn wavefront(&self) -> Option<&Wavefront> {
        self.wavefront
            .as_ref()
            .filter(|wavefront| wavefront.renders_samples())
    }

    /// Returns the threads with the random numbers of the job.
    fn resources<'a>(&self, workers: &'a CountingWorkers) -> Resources<'a> {
        Resources {
            seed: self.job.seed,
            sampler: self.job.sampler,
            each: !self.job.settings.films.is_empty() || self.job.settings.timing.is_some(),
            workers,
        }
    }

    /// Returns the context of samples that trace their rays with `trace` and read `shared`.
    pub fn context<'a>(&'a self, trace: &'a dyn Trace, shared: Option<&'a Shared>) -> Context<'a> {
        Context {
            scene: &self.accel.scene,
            camera: &self.camera,
            lights: &self.lights,
            classes: &self.classes,
            trace,
            max_depth: self.job.max_depth,
            rr_start: self.job.settings.rr_start,
            settings: &self.settings,
            params: &self.job.settings.params,
            timing: self.job.settings.timing.as_ref(),
            shared,
        }
    }

    /// Computes the data that the samples with an index share, on all threads of the pool that it
    /// runs in. Returns them with the number of rays traced; `None` if samples share no data. Once
    /// `abandoned` returns true, the rest is left out, and no sample may read the data.
    pub fn begin(&self, index: u64, abandoned: Abandoned) -> Option<(Box<Shared>, u64)> {
        let sharing = self.job.integrator.sharing?;
        let workers = CountingWorkers::new(self, abandoned);
        let shared = (sharing.begin)(&Iteration {
            index,
            resources: self.resources(&workers),
            prepared: self.iterations.as_deref()?,
        });
        Some((shared, workers.rays.into_inner()))
    }

    /// Returns the number of samples of every pixel, at most `samples` and at least 1, that share
    /// the data of the sample with an index.
    pub fn samples_at_once(&self, index: u64, samples: u64) -> u64 {
        let sharing = self.job.integrator.sharing;
        let constant_from = sharing.and_then(|sharing| sharing.constant_from);
        if constant_from.is_some_and(|from| index >= from(&self.settings)) {
            samples.max(1)
        } else {
            1
        }
    }

    /// Returns the samples that were rendered while the data `shared` of their iteration were
    /// computed.
    pub fn recorded<'a>(&self, shared: Option<&'a Shared>) -> Option<&'a RecordedSamples> {
        let recorded = self.job.integrator.sharing?.recorded?;
        recorded(shared?)
    }

    /// Returns the random numbers of a sample that reads the data `shared`.
    pub fn sampler(&self, shared: Option<&Shared>, pixel: [u32; 2], sample: u64) -> Sampler {
        let recorded = self.recorded(shared);
        let seed = recorded.map_or(self.job.seed, |recorded| recorded.seed);
        self.job.sampler.start(seed, pixel, sample)
    }

    /// Returns whether the samples of an iteration share data.
    pub fn shares(&self) -> bool {
        self.iterations.is_some()
    }
}

/// The threads of a pool, with the number of rays that they traced.
struct CountingWorkers<'a> {
    prepared: &'a PreparedJob,
    /// Tells whether their work is no longer wanted.
    abandoned: Abandoned<'a>,
    rays: AtomicU64,
}

impl<'a> CountingWorkers<'a> {
    fn new(prepared: &'a PreparedJob, abandoned: Abandoned<'a>) -> CountingWorkers<'a> {
        CountingWorkers {
            prepared,
            abandoned,
            rays: AtomicU64::new(0),
        }
    }
}

impl Workers for CountingWorkers<'_> {
    fn for_each(&self, count: usize, work: &(dyn Fn(&Context, usize) + Sync)) {
        (0..count)
            .into_par_iter()
            .with_max_len(1)
            .for_each(|index| {
                if (self.abandoned)() {
                    return;
                }
                let small = self
                    .prepared
                    .wavefront
                    .as_ref()
                    .and_then(Wavefront::small_scene);
                let trace = CountingTrace::new(&self.prepared.accel, small);
                work(&self.prepared.context(&trace, None), index);
                self.rays.fetch_add(trace.rays(), Ordering::Relaxed);
            });
    }

    fn trace_light(&self, context: &Context, batch: &LightBatch) -> LightUnit {
        match &self.prepared.wavefront {
            Some(wavefront) => wavefront.trace_light(context, &self.prepared.job, batch),
            None => batch.trace_single(context),
        }
    }

    fn trace_camera(&self, context: &Context, batch: &CameraBatch) -> Option<RecordedPaths> {
        let wavefront = self.prepared.wavefront.as_ref()?;
        wavefront.trace_camera(context, &self.prepared.job, batch)
    }
}

/// Ray intersector that counts its rays. Each row has its own, so that threads share no counter.
pub(super) struct CountingTrace<'a> {
    accel: &'a Accel,
    /// Tracer of many rays at once, if the scene is small.
    small: Option<&'a SmallScene>,
    rays: Cell<u64>,
}

impl<'a> CountingTrace<'a> {
    /// Creates an intersector that has traced no ray.
    pub fn new(accel: &'a Accel, small: Option<&'a SmallScene>) -> CountingTrace<'a> {
        CountingTrace {
            accel,
            small,
            rays: Cell::new(0),
        }
    }

    /// Returns the number of rays traced so far.
    pub fn rays(&self) -> u64 {
        self.rays.get()
    }
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
            None => self.accel.closest_each(rays, hits),
        }
    }

    fn occluded_each(&self, rays: &[(Ray, f32)], occluded: &mut Vec<bool>) {
        self.rays.set(self.rays.get() + rays.len() as u64);
        match self.small {
            Some(small) => small.occluded(rays, occluded),
            None => self.accel.occluded_each(rays, occluded),
        }
    }
}
