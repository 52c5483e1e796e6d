//! Records the events of single samples on the CPU: every ray query with its result, and every
//! contribution. It uses the scalar path, so the samples are those that a run adds to its film.

use std::cell::RefCell;
use std::sync::Arc;

use super::bvh::accel::{Accel, AccelError};
use super::bvh::simd::Isa;
use crate::path_trace::{PathEvent, SampleAt};
use crate::{Job, RenderError};
use lumbre_light::scene::CompiledScene;
use lumbre_light::transport::arrival::SurfaceClasses;
use lumbre_light::transport::camera::Camera;
use lumbre_light::transport::integrator::{Context, Settings};
use lumbre_light::transport::light::{LightSelection, Lights};
use lumbre_light::transport::ray::{Hit, Ray, Trace};

/// Ray intersector that records every query and its result.
struct RecordingTrace<'a> {
    accel: &'a Accel,
    events: &'a RefCell<Vec<PathEvent>>,
}

impl Trace for RecordingTrace<'_> {
    fn closest(&self, ray: &Ray, t_max: f32) -> Option<Hit> {
        let hit = self.accel.closest(ray, t_max);
        self.events.borrow_mut().push(PathEvent::Closest {
            ray: *ray,
            t_max,
            hit,
        });
        hit
    }

    fn occluded(&self, ray: &Ray, t_max: f32) -> bool {
        let blocked = self.accel.occluded(ray, t_max);
        self.events.borrow_mut().push(PathEvent::Shadow {
            ray: *ray,
            t_max,
            blocked,
        });
        blocked
    }
}

/// Returns the events of each given sample, in the order in which they occur.
///
/// # Errors
/// Returns an error if the scene's hierarchy cannot be used.
pub(super) fn paths(
    scene: &Arc<CompiledScene>,
    job: &Job,
    samples: &[SampleAt],
) -> Result<Vec<Vec<PathEvent>>, RenderError> {
    let build_error = |e: AccelError| RenderError::Failed {
        backend: "cpu",
        reason: e.to_string(),
    };
    let accel =
        Accel::build_as(Arc::clone(scene), &job.accel, Isa::detect()).map_err(build_error)?;
    let scene = &accel.scene;
    let camera = Camera::new(&scene.camera, job.resolution, job.filter);
    let lights = Lights::with_select(scene, LightSelection::from_params(&job.params));
    let classes = SurfaceClasses::new(scene);
    let settings = Settings::new(&job.params);
    let record_sample = |at: &SampleAt| {
        let events = RefCell::default();
        let context = Context {
            scene,
            camera: &camera,
            lights: &lights,
            classes: &classes,
            trace: &RecordingTrace {
                accel: &accel,
                events: &events,
            },
            max_depth: job.max_depth,
            rr_start: job.rr_start,
            settings: &settings,
            timing: job.timing.as_ref(),
        };
        let mut sampler = job.sampler.start(job.seed, at.pixel, at.sample);
        let mut sink = |c| events.borrow_mut().push(PathEvent::Light(c));
        (job.integrator.sample)(&context, at.pixel, &mut sampler, &mut sink);
        events.take()
    };
    Ok(samples.iter().map(record_sample).collect())
}
