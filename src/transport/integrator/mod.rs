//! Integrators: ways of finding the light that reaches a pixel, one file and one table row each; and the names of those
//! of other programs.

pub mod bdpt;
pub mod bpt;
pub mod external;
pub mod nee;
pub mod oracle;
pub mod settings;

use super::camera::Camera;
use super::contribution::Contribution;
use super::flight::Timing;
use super::light::Lights;
use super::ray::Trace;
use super::sampler::Sampler;
use crate::scene::CompiledScene;
use crate::value::schema::Table;

pub use settings::Settings;

/// Everything that stays the same from sample to sample.
pub struct Context<'a> {
    /// The scene.
    pub scene: &'a CompiledScene,
    /// The camera, ready for the picture's resolution and filter.
    pub camera: &'a Camera,
    /// The lights.
    pub lights: &'a Lights,
    /// Whatever intersects rays.
    pub trace: &'a dyn Trace,
    /// Greatest number of path edges: 1 = emission only, 2 = direct light.
    pub max_depth: u32,
    /// First path edge after which Russian roulette may end a path; `None` is never.
    pub rr_start: Option<u32>,
    /// The integrator's own parameters.
    pub settings: &'a Settings,
    /// What a film with a time axis asks; without one, lengths are not counted.
    pub timing: Option<&'a Timing>,
}

impl Context<'_> {
    /// Whether paths need a [`Flight`](super::flight::Flight): for a time axis, or for materials with parts.
    #[inline]
    pub fn timed(&self) -> bool {
        self.timing.is_some() || !self.scene.delays.is_empty()
    }

    /// The index of the medium around the camera.
    #[inline]
    pub fn medium(&self) -> f32 {
        self.timing.map_or(1.0, |timing| timing.medium)
    }
}

/// Hands every contribution of one sample of one pixel to the sink.
pub type SampleFn = fn(&Context, pixel: [u32; 2], &mut Sampler, sink: &mut dyn FnMut(Contribution));

/// One row of [`INTEGRATORS`].
#[derive(Debug)]
pub struct IntegratorRow {
    /// The short name in scripts, columns and paths.
    pub name: &'static str,
    /// The long name that stands beside it in tables and plots.
    pub long_name: &'static str,
    /// Raised whenever the pictures change; part of every run's identity.
    pub revision: u32,
    /// What it does, in a sentence, with its source.
    pub doc: &'static str,
    /// Its own parameters in a script's `render` table.
    pub params: Table,
    /// Whether a sample can bring light to other pixels than its own.
    pub splats: bool,
    /// One sample of one pixel on the CPU.
    pub sample: SampleFn,
}

/// Every integrator there is.
pub const INTEGRATORS: &[IntegratorRow] = &[bpt::ROW, nee::ROW, bdpt::ROW];

/// The row with this name, of our own or of [another program](external).
pub fn integrator(name: &str) -> Option<&'static IntegratorRow> {
    INTEGRATORS.iter().chain(external::EXTERNALS).find(|row| row.name == name)
}
