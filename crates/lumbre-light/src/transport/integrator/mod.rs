//! Integrators: algorithms that estimate the light reaching a pixel, one file and one table entry
//! each; and the names of techniques of other programs.

pub mod bdpt;
pub mod bpt;
pub mod camera_path;
mod directions;
pub mod external;
pub mod guided;
pub mod iteration;
pub mod lvc;
pub mod nee;
pub mod oracle;
pub mod own;
pub mod settings;
pub mod sppm;
pub mod vcm;

use std::collections::BTreeMap;

use self::bdpt::joins::SubpathTechnique;
use self::camera_path::CameraPaths;
use self::guided::bidirectional;
use self::iteration::{Shared, Sharing};
use super::arrival::SurfaceClasses;
use super::camera::Camera;
use super::contribution::Contribution;
use super::light::Lights;
use super::path_time::Timing;
use super::ray::{Hit, Trace};
use super::sampler::Sampler;
use crate::scene::CompiledScene;
use crate::scene::compile::NONE;
use crate::value::Value;
use crate::value::schema::{Field, Table};

pub use settings::Settings;

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
    /// [`iteration`].
    pub shared: Option<&'a Shared>,
}

impl Context<'_> {
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

    /// Returns the index of the medium around the camera.
    #[inline]
    pub fn medium(&self) -> f32 {
        self.timing.map_or(1.0, |timing| timing.medium)
    }
}

/// A computation for any technique whose steps are generic over the width of vectors.
pub trait TechniqueVisitor {
    /// The result of the computation.
    type Output;

    /// Runs the computation for a technique that follows paths from the camera.
    fn camera_paths<T: CameraPaths>(self) -> Self::Output;

    /// Runs the computation for a technique that joins subpaths from the camera with subpaths from
    /// lights.
    fn subpaths<T: SubpathTechnique>(self) -> Self::Output;
}

/// Declares the integrators of this program: modules with a `ROW`, and their techniques.
macro_rules! integrators {
    (
        camera paths: $($module:ident::$technique:ident),*;
        subpaths: $($joined:ident::$joining:ident),*
    ) => {
        /// All built-in integrators. [`integrators`] has registered ones too.
        pub const INTEGRATORS: &[IntegratorRow] = &[$($module::ROW,)* $($joined::ROW),*];

        /// Calls a visitor with the technique of an integrator; returns `None` if it has no generic
        /// steps.
        pub fn visit_technique<V: TechniqueVisitor>(
            row: &IntegratorRow,
            visitor: V,
        ) -> Option<V::Output> {
            $(if row.name == $module::ROW.name {
                return Some(visitor.camera_paths::<$module::$technique>());
            })*
            $(if row.name == $joined::ROW.name {
                return Some(visitor.subpaths::<$joined::$joining>());
            })*
            None
        }
    };
}

integrators!(
    camera paths: bpt::Bpt, nee::Nee, guided::Guided, sppm::Sppm;
    subpaths: bdpt::Bdpt, bidirectional::GuidedBdpt, vcm::Vcm, lvc::Lvc
);

/// Computes one sample of one pixel and passes every contribution to the sink.
pub type SampleFn = fn(&Context, pixel: [u32; 2], &mut Sampler, sink: &mut dyn FnMut(Contribution));

/// An integrator: one entry of [`INTEGRATORS`], or a [technique of one's own](own).
#[derive(Clone, Copy, Debug)]
pub struct IntegratorRow {
    /// Short name in scripts, columns and paths.
    pub name: &'static str,
    /// Long name shown beside it in tables and plots; ends in `biased` if it is.
    pub long_name: &'static str,
    /// Revision, raised whenever the pictures change; part of every run's identity.
    pub revision: u32,
    /// Description in one sentence, with its source.
    pub doc: &'static str,
    /// Schema of its own parameters in a script's `render` table.
    pub params: Table,
    /// Whether a sample can contribute to other pixels than its own.
    pub splats: bool,
    /// Source of the bias, in a clause, of an integrator for which the expected value of a picture
    /// is not the exact one, although its error may vanish with the number of samples; what it
    /// shows, if that is no radiance. `None` if it is unbiased.
    pub bias: Option<&'static str>,
    /// Functions by which the samples of an iteration share data; `None` if they share none.
    pub sharing: Option<Sharing>,
    /// Computes one sample of one pixel on the CPU.
    pub sample: SampleFn,
}

impl IntegratorRow {
    /// Returns whether pixels have common noise, because the samples of an iteration share data that
    /// differ between iterations.
    pub fn has_common_noise(&self) -> bool {
        self.sharing
            .is_some_and(|sharing| sharing.constant_from.is_none())
    }
}

/// Other names of integrators, with the name in the table: `pt` is what most of the literature calls
/// path tracing, where BPT is bidirectional path tracing.
const ALIASES: &[(&str, &str)] = &[("pt", "bpt")];

/// Returns the name in the table of an integrator that may be given by another name; any other text
/// is returned as it is.
pub fn canonical_name(name: &str) -> &str {
    let alias = ALIASES.iter().find(|(alias, _)| *alias == name);
    alias.map_or(name, |(_, name)| name)
}

/// Integrator of references where none is named and those that are compared are biased: unbiased,
/// and the one that finds light through glass and from metal best.
pub const UNBIASED_REFERENCE: &str = "bdpt";

/// Returns why pictures of the integrator with this name are biased; `None` if they are not, or the
/// name is unknown.
pub fn bias_of(name: &str) -> Option<&'static str> {
    integrator(name).and_then(|row| row.bias)
}

/// Returns all integrators of this program: the built-in ones, then those [registered](own).
pub fn integrators() -> impl Iterator<Item = &'static IntegratorRow> + Clone {
    INTEGRATORS.iter().chain(own::rows())
}

/// Returns the integrator with this name, of this program or of [another one](external).
pub fn integrator(name: &str) -> Option<&'static IntegratorRow> {
    integrators()
        .chain(external::EXTERNALS)
        .find(|row| row.name == canonical_name(name))
        .or_else(|| external::declared(name))
}
