//! Backends, which run an integrator over a compiled scene, a wave of samples at a time. [`Job`] is
//! what to render, [`Renderer`] a run in progress, and [`BACKENDS`] the table of all backends.
//!
//! No integrator is named in this module: a [`Job`] carries a row of
//! [`INTEGRATORS`](crate::transport::integrator::INTEGRATORS). Nothing above this module depends on
//! a graphics API.

pub mod backend_choice;
pub mod cpu;
pub mod external;
pub mod hierarchy;
pub mod instance_transform;
pub mod mock;
pub mod path_trace;
pub mod reference_halves;
#[cfg(feature = "vulkan")]
pub mod vulkan;
pub mod worker;

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::sync::Arc;

use self::hierarchy::AccelSpec;
use crate::film::Film;
use crate::film::layer::{Layer, LayerFilm};
use crate::film::time::TimeCube;
use crate::scene::CompiledScene;
use crate::scene::desc::Model;
use crate::transport::camera::FilterSpec;
use crate::transport::integrator::IntegratorRow;
use crate::transport::path_time::Timing;
use crate::transport::sampler::{INDEPENDENT, SamplerRow};
use crate::value::Value;
use path_trace::{PathEvent, SampleAt};

/// Everything besides the scene that determines a picture.
#[derive(Clone, Debug)]
pub struct Job {
    /// Integrator to run.
    pub integrator: &'static IntegratorRow,
    /// Parameters of the integrator, checked against its row's schema.
    pub params: BTreeMap<String, Value>,
    /// Width and height in pixels.
    pub resolution: [u32; 2],
    /// Maximum number of path edges: 1 = emission only, 2 = direct light.
    pub max_depth: u32,
    /// First path edge after which Russian roulette may end a path; `None` disables it.
    pub rr_start: Option<u32>,
    /// Pixel reconstruction filter.
    pub filter: FilterSpec,
    /// Layers to fill besides the picture.
    pub layers: Vec<Layer>,
    /// Time axis of the film, if it has one.
    pub timing: Option<Timing>,
    /// Generator of the samples' random numbers.
    pub sampler: &'static SamplerRow,
    /// Settings of the acceleration structure, for backends that build their own. Never changes the
    /// picture.
    pub accel: AccelSpec,
    /// Seed of all random numbers of the run.
    pub seed: u64,
    /// Index of the first sample of every pixel. Samples are identified by their index, so films of
    /// consecutive ranges are parts of one run.
    pub first_sample: u64,
    /// Number of render threads; 0 means one for each core. Never changes the picture.
    pub threads: usize,
}

impl Job {
    /// Creates a job with defaults: default parameters, no roulette, box filter of one pixel,
    /// independent sampler, one thread for each core.
    pub fn plain(
        integrator: &'static IntegratorRow,
        resolution: [u32; 2],
        max_depth: u32,
        seed: u64,
    ) -> Job {
        Job {
            integrator,
            params: BTreeMap::new(),
            resolution,
            max_depth,
            rr_start: None,
            filter: FilterSpec::PIXEL,
            layers: Vec::new(),
            timing: None,
            sampler: INDEPENDENT,
            accel: AccelSpec::default(),
            seed,
            first_sample: 0,
            threads: 0,
        }
    }
}

/// Statistics of one wave.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WaveStats {
    /// Number of samples added to every pixel.
    pub samples: u64,
    /// Render time in seconds on a monotonic clock; the only time that is compared. It is the time
    /// inside `advance`, or on a device, by the device's clock, from the start of its work on this
    /// wave to the end of its samples. Copying the sums is not included.
    pub render_s: f64,
    /// Time that a device other than the CPU was busy, in seconds by its own clock; 0 without one.
    pub device_s: f64,
    /// Time in seconds by the device's clock from the end of its work for this run before this wave
    /// to the start of its work on this wave: it waited for the host, copied the previous film, or
    /// worked for other runs. 0 without a device and for the first wave.
    pub idle_s: f64,
    /// Number of camera paths traced.
    pub paths: u64,
    /// Number of rays traced.
    pub rays: u64,
    /// Number of samples and splats whose value was NaN or infinite, and of splats that overflow
    /// their sums. They count as black and are always reported.
    pub invalid: u64,
    /// Column, row and sample index of the first invalid sample, or of the sample that traced the
    /// first invalid splat.
    pub first_invalid: Option<[u64; 3]>,
}

impl WaveStats {
    /// Adds the statistics of a later wave.
    pub fn add(&mut self, later: &WaveStats) {
        self.samples += later.samples;
        self.render_s += later.render_s;
        self.device_s += later.device_s;
        self.idle_s += later.idle_s;
        self.paths += later.paths;
        self.rays += later.rays;
        self.invalid += later.invalid;
        self.first_invalid = self.first_invalid.or(later.first_invalid);
    }
}

/// Statistics of opening a renderer, before its first wave.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OpenStats {
    /// Time spent on copying scene and job to a device, in seconds; 0 without one.
    pub upload_s: f64,
    /// Time spent on compiling shaders and creating pipelines, in seconds; 0 without any.
    pub pipeline_s: f64,
    /// Time spent on building acceleration structures, in seconds.
    pub accel_build_s: f64,
    /// Number of nodes of the acceleration structures.
    pub accel_nodes: u64,
    /// Size of nodes and primitives as traversal reads them, in bytes; 0 if unknown.
    pub accel_bytes: u64,
    /// Expected cost of a ray that meets the scene's box, by the surface area heuristic: visited
    /// nodes plus tested primitives; 0 if unknown.
    pub accel_cost: f64,
    /// Line for users: device, builder, threads.
    pub device: String,
}

/// Reason why a backend cannot render.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RenderError {
    /// The backend lacks a feature that the job needs.
    #[error("backend `{backend}` cannot do this: {reason}")]
    Unsupported {
        /// Name of the backend.
        backend: &'static str,
        /// Description of what is missing.
        reason: String,
    },
    /// The device or the rendering process is gone, and with it everything that was not saved. A
    /// retry from the newest checkpoint may succeed.
    #[error("backend `{backend}` is lost: {reason}")]
    Lost {
        /// Name of the backend.
        backend: &'static str,
        /// Description of what happened.
        reason: String,
    },
    /// Rendering failed. The cell is lost, the night continues.
    #[error("backend `{backend}` failed: {reason}")]
    Failed {
        /// Name of the backend.
        backend: &'static str,
        /// Description of what happened.
        reason: String,
    },
}

/// Run of a job in progress on a backend.
pub trait Renderer: Send {
    /// Adds `samples` samples to every pixel.
    ///
    /// # Errors
    /// Returns an error if the backend fails; the film must not be used any more then.
    fn advance(&mut self, samples: u64) -> Result<WaveStats, RenderError>;

    /// Does the same as [`Renderer::advance`]. `more` is the number of samples that the device may
    /// start speculatively while the host reads the film. It never affects results. Pass 0 if
    /// another run uses the device next, since the speculative work would be charged to its time.
    ///
    /// # Errors
    /// Returns an error in the cases of [`Renderer::advance`].
    fn advance_with_lookahead(
        &mut self,
        samples: u64,
        _more: u64,
    ) -> Result<WaveStats, RenderError> {
        self.advance(samples)
    }

    /// Returns the film with all samples so far.
    fn film(&self) -> &Film;

    /// Returns the two independent halves of the film, if it consists of two and both have samples;
    /// see [`reference_halves`].
    fn halves(&self) -> Option<[Arc<Film>; 2]> {
        None
    }

    /// Returns the films of the layers that the job requests, in the order of
    /// [`LAYERS`](crate::film::layer::LAYERS).
    fn layers(&self) -> &[LayerFilm] {
        &[]
    }

    /// Returns the current sums of film `index` of [`Renderer::layers`].
    ///
    /// # Errors
    /// Returns an error if there is no such film or the backend fails.
    fn layer(&self, index: usize) -> Result<Film, RenderError> {
        Err(RenderError::Failed {
            backend: "this",
            reason: format!("layer film {index} does not exist"),
        })
    }

    /// Returns the time-resolved film, if the job has a time axis.
    fn times(&self) -> Option<TimeCube> {
        None
    }

    /// Writes the state from which another renderer of the same job resumes with identical bits.
    /// Returns `false` and writes nothing if the backend does not support checkpoints; an
    /// interrupted run starts again then.
    ///
    /// # Errors
    /// Returns any error of the writer.
    fn save(&self, _to: &mut dyn Write) -> io::Result<bool> {
        Ok(false)
    }

    /// Restores the state that a renderer of the same job on the same backend wrote by
    /// [`Renderer::save`]. Must be called before the first wave.
    ///
    /// # Errors
    /// Returns an error if the state does not match; this renderer must not be used any more then.
    fn restore(&mut self, _state: &[u8]) -> Result<(), RenderError> {
        Err(RenderError::Unsupported {
            backend: "this",
            reason: "it cannot resume from a checkpoint".to_owned(),
        })
    }

    /// Returns the statistics of opening the renderer.
    fn open_stats(&self) -> &OpenStats;
}

/// Function that starts a run of a job on a scene.
pub type OpenFn = fn(Arc<CompiledScene>, Job) -> Result<Box<dyn Renderer>, RenderError>;

/// Function that records the events of each of some samples of a job.
pub type PathsFn =
    fn(&Arc<CompiledScene>, &Job, &[SampleAt]) -> Result<Vec<Vec<PathEvent>>, RenderError>;

/// Table row of [`BACKENDS`].
pub struct BackendRow {
    /// Name in scripts and on the command line.
    pub name: &'static str,
    /// Description in one sentence.
    pub doc: &'static str,
    /// Checks whether this machine can use the backend. Returns the device, or the reason why not.
    pub probe: fn() -> Result<String, String>,
    /// Whether it supports layers. If not, plans that request layers on it are refused.
    pub layers: bool,
    /// Whether it supports time-resolved films and composed materials. If not, plans that request a
    /// time axis or use a scene with such materials on it are refused.
    pub times: bool,
    /// Material models that it supports. Plans that use a scene with others on it are refused.
    pub models: &'static [Model],
    /// Returns why it cannot run an integrator with paths of up to this number of edges, or `None`
    /// if it can. Plans that request it are refused with this reason. Must not touch a device.
    pub refuses: fn(&IntegratorRow, u32) -> Option<String>,
    /// Returns a hash of shaders that were modified after the build, which becomes part of a run's
    /// identity, or `None` if there are none. The error describes an invalid modification.
    pub edited: fn() -> Result<Option<String>, String>,
    /// Whether it builds its acceleration structure according to `accel`. If not, plans that
    /// request anything but the default are refused.
    pub accel: bool,
    /// Starts a run of a job.
    pub open: OpenFn,
    /// Records the events of single samples of a job, in this process; layers are left out.
    pub paths: PathsFn,
}

/// Table of all backends.
pub const BACKENDS: &[BackendRow] = &[
    cpu::ROW,
    #[cfg(feature = "vulkan")]
    vulkan::PIPELINE,
    #[cfg(feature = "vulkan")]
    vulkan::QUERY,
    #[cfg(feature = "vulkan")]
    vulkan::COMPUTE,
    mock::ROW,
];

/// Opens a run of the backend with this name.
///
/// # Errors
/// Returns an error if there is no such backend or it cannot render this job.
pub fn open(
    name: &str,
    scene: Arc<CompiledScene>,
    job: Job,
) -> Result<Box<dyn Renderer>, RenderError> {
    match backend(name) {
        Some(row) => (row.open)(scene, job),
        None => Err(RenderError::Unsupported {
            backend: "none",
            reason: format!("there is no backend `{name}`"),
        }),
    }
}

/// Returns the name of the backend that `auto` selects on this machine, and why: `vulkan` on a
/// device with hardware ray tracing, `vulkan-compute` on other devices, and `cpu` if there is no
/// device or only a software implementation.
pub fn auto_backend() -> (&'static str, String) {
    if let Some(name) = backend_choice::auto_backend() {
        return (name, "as recorded in the night's plan".to_owned());
    }
    #[cfg(feature = "vulkan")]
    let found = vulkan::auto_backend();
    #[cfg(not(feature = "vulkan"))]
    let found: Result<(&'static str, String), String> =
        Err("this program was built without Vulkan".to_owned());
    found.unwrap_or_else(|reason| (cpu::ROW.name, reason))
}

/// Returns an index that identifies the device of this machine that a backend renders on among
/// those of its kind, or an empty string for the CPU.
pub fn device_index(backend: &str) -> String {
    #[cfg(feature = "vulkan")]
    if let Some(place) = vulkan::device_index(backend) {
        return place;
    }
    let _ = backend;
    String::new()
}

/// Returns the indices of further devices of this machine that are of the same model as the one a
/// backend renders on; none if a device was selected explicitly.
pub fn same_model_devices(backend: &str) -> Vec<String> {
    #[cfg(feature = "vulkan")]
    return vulkan::same_model_devices(backend);
    #[cfg(not(feature = "vulkan"))]
    {
        let _ = backend;
        Vec::new()
    }
}

/// Resolves names of graphics devices, each an index or a part of a name, to indices.
///
/// # Errors
/// Returns a message if a name matches no device, or two names match the same one.
pub fn resolve_devices(names: &[String]) -> Result<Vec<String>, String> {
    #[cfg(feature = "vulkan")]
    return vulkan::resolve_devices(names);
    #[cfg(not(feature = "vulkan"))]
    Err(format!(
        "device `{}` is not available: this program was built without Vulkan",
        names.join(", ")
    ))
}

/// Returns the table row of a backend; `auto` means that of [`auto_backend`].
pub fn backend(name: &str) -> Option<&'static BackendRow> {
    let name = if name == "auto" {
        auto_backend().0
    } else {
        name
    };
    BACKENDS.iter().find(|b| b.name == name)
}
