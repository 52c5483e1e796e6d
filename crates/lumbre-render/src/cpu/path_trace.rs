//! Records the events of single samples on the CPU: every ray query with its result, and every
//! contribution. It uses the scalar path, so the samples are those that a run adds to its film. Paths
//! that belong to no pixel, such as photons, are traced first and not recorded.

use std::cell::RefCell;
use std::sync::Arc;

use super::bvh::accel::Accel;
use super::prepared::PreparedJob;
use super::prepared_scene::PreparedScene;
use crate::path_trace::{PathEvent, SampleAt};
use crate::{Job, RenderError};
use lumbre_light::scene::CompiledScene;
use lumbre_light::transport::integrator::iteration::Shared;
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
    // One sample uses one thread; only integrators with shared data use more.
    let shared = PreparedScene::new(Arc::clone(scene), &job.settings.accel, job.threads)?;
    Ok(shared.paths(job, samples))
}

impl PreparedScene {
    /// Records the events of single samples of a job, as [`BackendRow::paths`](crate::BackendRow::paths)
    /// does.
    pub fn paths(&self, job: &Job, samples: &[SampleAt]) -> Vec<Vec<PathEvent>> {
        let prepared = PreparedJob::new(self, job.clone());
        record(&prepared, samples)
    }
}

/// Returns the events of each given sample of a prepared job.
fn record(prepared: &PreparedJob, samples: &[SampleAt]) -> Vec<Vec<PathEvent>> {
    let mut iteration: Option<(u64, Box<Shared>)> = None;
    let mut record_sample = |at: &SampleAt| {
        let begun = iteration.as_ref().map(|(index, _)| *index);
        if begun != Some(at.sample) {
            let shared = prepared.begin(at.sample, &|| false);
            iteration = shared.map(|(shared, _)| (at.sample, shared));
        }
        let events = RefCell::default();
        let trace = RecordingTrace {
            accel: &prepared.accel,
            events: &events,
        };
        let shared = iteration.as_ref().map(|(_, shared)| &**shared);
        let context = prepared.context(&trace, shared);
        let mut sampler = prepared.sampler(shared, at.pixel, at.sample);
        let mut sink = |c| events.borrow_mut().push(PathEvent::Light(c));
        (prepared.job.integrator.sample)(&context, at.pixel, &mut sampler, &mut sink);
        events.take()
    };
    samples.iter().map(&mut record_sample).collect()
}
