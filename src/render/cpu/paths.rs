//! Single samples step by step.

use std::cell::RefCell;
use std::sync::Arc;

use super::accel::{Accel, Unusable};
use super::lanes::Isa;
use crate::render::paths::{SampleAt, Step};
use crate::render::{Job, RenderError};
use crate::scene::CompiledScene;
use crate::transport::camera::Camera;
use crate::transport::integrator::{Context, Settings};
use crate::transport::light::{Lights, Select};
use crate::transport::ray::{Hit, Ray, Trace};

/// The hierarchy, and every question that it was asked.
struct Noted<'a> {
    accel: &'a Accel,
    steps: &'a RefCell<Vec<Step>>,
}

impl Trace for Noted<'_> {
    fn closest(&self, ray: &Ray, t_max: f32) -> Option<Hit> {
        let hit = self.accel.closest(ray, t_max);
        self.steps.borrow_mut().push(Step::Closest { ray: *ray, t_max, hit });
        hit
    }

    fn occluded(&self, ray: &Ray, t_max: f32) -> bool {
        let blocked = self.accel.occluded(ray, t_max);
        self.steps.borrow_mut().push(Step::Shadow { ray: *ray, t_max, blocked });
        blocked
    }
}

/// The steps of each of some samples.
///
/// # Errors
/// When the scene's hierarchy cannot be used.
pub(super) fn paths(
    scene: &Arc<CompiledScene>,
    job: &Job,
    samples: &[SampleAt],
) -> Result<Vec<Vec<Step>>, RenderError> {
    let failed = |e: Unusable| RenderError::Failed { backend: "cpu", reason: e.to_string() };
    let accel = Accel::build_as(Arc::clone(scene), &job.accel, Isa::detect()).map_err(failed)?;
    let scene = &accel.scene;
    let camera = Camera::new(&scene.camera, job.resolution, job.filter);
    let lights = Lights::with_select(scene, Select::of(&job.params));
    let settings = Settings::new(&job.params);
    let one = |at: &SampleAt| {
        let steps = RefCell::default();
        let context = Context {
            scene,
            camera: &camera,
            lights: &lights,
            trace: &Noted { accel: &accel, steps: &steps },
            max_depth: job.max_depth,
            rr_start: job.rr_start,
            settings: &settings,
            timing: job.timing.as_ref(),
        };
        let mut sampler = (job.sampler.start)(job.seed, at.pixel, at.sample);
        let mut sink = |c| steps.borrow_mut().push(Step::Light(c));
        (job.integrator.sample)(&context, at.pixel, &mut sampler, &mut sink);
        steps.take()
    };
    Ok(samples.iter().map(one).collect())
}
