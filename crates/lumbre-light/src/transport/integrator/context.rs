//! The context of a sample: everything that stays the same from sample to sample.

use std::any::Any;
use std::collections::BTreeMap;

use super::settings::Settings;
use crate::scene::CompiledScene;
use crate::scene::compile::NONE;
use crate::transport::arrival::SurfaceClasses;
use crate::transport::camera::Camera;
use crate::transport::light::Lights;
use crate::transport::ray::{Hit, Trace};
use crate::transport::time_settings::Timing;
use crate::value::Value;
use crate::value::schema::Field;

/// Data that all samples of an iteration read; integrators recover the type by
/// [`Context::shared`].
pub type Shared = dyn Any + Send + Sync;

/// Everything that stays the same from sample to sample.
pub struct Context<'a> {
    /// The compiled scene.
    pub scene: &'a CompiledScene,
    /// The camera, prepared for the picture's resolution and filter.
    pub camera: &'a Camera,
    /// The lights of the scene.
    pub lights: &'a Lights,
    /// The classes of the scene's surfaces.
    pub classes: &'a SurfaceClasses,
    /// The ray intersector.
    pub trace: &'a dyn Trace,
    /// Maximum number of path edges: 1 = emission only, 2 = direct light.
    pub max_depth: u32,
    /// First path edge after which Russian roulette may end a path; `None` disables it.
    pub rr_start: Option<u32>,
    /// The parameters of the integrators of this program, parsed.
    pub settings: &'a Settings,
    /// All parameters of the run by name, for those that one integrator alone reads; see
    /// [`Context::number`].
    pub params: &'a BTreeMap<String, Value>,
    /// Settings of the film's time axis; without one, optical lengths are not computed.
    pub timing: Option<&'a Timing>,
    /// Data that the samples of this iteration share, for integrators that have any: see
    /// [`iteration`](super::iteration).
    pub shared: Option<&'a Shared>,
}

impl<'a> Context<'a> {
    /// Returns whether paths need auxiliary numbers: for a time axis, or for composed or delayed
    /// materials.
    #[inline]
    pub fn timed(&self) -> bool {
        self.timing.is_some() || !self.scene.delays.is_empty()
    }

    /// Returns whether a path that hits something by edge number `edge` can add nothing more: the
    /// last edge can only find light.
    #[inline]
    pub fn ends_unlit(&self, edge: u32, hit: &Hit) -> bool {
        edge == self.max_depth && self.scene.emitter_of(hit.primitive, hit.instance) == NONE
    }

    /// Returns the numeric parameter of a field: the given value, or else `default`, which should be
    /// what the field states.
    ///
    /// Looks the name up, which costs some ten nanoseconds: call it once for each step or sample.
    #[inline]
    pub fn number(&self, field: &Field, default: f32) -> f32 {
        let given = self.params.get(field.key).and_then(Value::as_f64);
        given.map_or(default, |number| number as f32)
    }

    /// Returns the data that the integrator computed for this iteration.
    ///
    /// # Panics
    /// Panics if the renderer did not begin the iteration, or if the data are of another type.
    pub fn shared<T: 'static>(&self) -> &'a T {
        let data = self.shared.and_then(|shared| shared.downcast_ref());
        data.expect("the data of the iteration were not computed")
    }

    /// Returns the index of the medium around the camera.
    #[inline]
    pub fn medium(&self) -> f32 {
        self.timing.map_or(1.0, |timing| timing.medium)
    }
}
