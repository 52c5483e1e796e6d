//! Rendering of light transport in waves of samples: [`Job`] is what to render, [`Renderer`] a run
//! in progress, and [`BackendRow`] the description of a backend. The crate contains the CPU backend
//! ([`cpu`]), a backend for tests ([`mock`]), other renderers as techniques ([`external`]) and
//! rendering in a child process ([`worker`]). [`device`] describes what renders; [`denoise`] filters
//! the pictures of any of them; [`shaders`] is the choice of the shaders of devices;
//! [`own_technique`] makes integrators of other crates known, [`plugin`] those of C libraries.
//!
//! No integrator is named in this crate: a [`Job`] carries a row of
//! [`INTEGRATORS`](lumbre_light::transport::integrator::INTEGRATORS).

/// The front page of `lumbre-light`, whose example is a test of this crate.
#[cfg(doctest)]
#[doc = include_str!("../../lumbre-light/src/front_page.md")]
mod front_page_of_lumbre_light {}

pub mod backend_choice;
pub mod cpu;
pub mod denoise;
pub mod device;
pub mod external;
pub mod hierarchy;
pub mod instance_transform;
pub mod lobe;
pub mod mock;
pub mod own_technique;
pub mod path_trace;
pub mod plugin;
pub mod reference_halves;
pub mod settings;
pub mod shaders;
pub mod trial;
pub mod worker;

use std::io::{self, Write};
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use self::device::devices_line;
pub use self::device::{Device, DeviceKind, Peer};
pub use self::settings::Settings;
use self::shaders::Shaders;
use lumbre_light::film::layer::{Layer, LayerFilm, LayerImage};
use lumbre_light::film::time::TimeCube;
use lumbre_light::film::{Film, SharedImage};
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::SceneMemory;
use lumbre_light::scene::desc::{CameraDesc, Model};
use lumbre_light::transport::integrator::IntegratorRow;
use lumbre_light::transport::sampler::{INDEPENDENT, SamplerRow};
use path_trace::{PathEvent, SampleAt};

/// Everything besides the scene that determines a picture.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Job {
    /// Settings, fully resolved.
    #[serde(with = "worker::codec::json_text")]
    pub settings: Settings,
    /// Integrator of the settings.
    #[serde(with = "worker::codec::integrator_name")]
    pub integrator: &'static IntegratorRow,
    /// Generator of the samples' random numbers, of the settings.
    #[serde(with = "worker::codec::sampler_name")]
    pub sampler: &'static SamplerRow,
    /// Width and height in pixels.
    pub resolution: [u32; 2],
    /// Maximum number of path edges: 1 = emission only, 2 = direct light.
    pub max_depth: u32,
    /// Seed of all random numbers of the run.
    pub seed: u64,
    /// Index of the first sample of every pixel. Samples are identified by their index, so films of
    /// consecutive ranges are parts of one run.
    pub first_sample: u64,
    /// Number of render threads; 0 means one for each core. Never changes the picture.
    pub threads: usize,
    /// View that replaces the scene's own; `None` renders the scene's camera.
    pub view: Option<View>,
}

/// A view of a compiled scene through another camera, so that runs that differ in their camera
/// share the scene and its hierarchy.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct View {
    /// The camera, compiled by [`compile_camera`](lumbre_light::scene::compile::compile_camera).
    pub camera: CameraDesc,
    /// Content hash of the scene with this camera.
    pub content_hash: [u8; 32],
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
            settings: Settings {
                max_depth: Some(max_depth),
                resolution: Some(resolution),
                ..Settings::new(integrator.name)
            },
            integrator,
            sampler: INDEPENDENT,
            resolution,
            max_depth,
            seed,
            first_sample: 0,
            threads: 0,
            view: None,
        }
    }

    /// Returns the job with this number of threads; 0 means one for each core.
    #[must_use]
    pub fn on_threads(self, threads: usize) -> Job {
        Job { threads, ..self }
    }

    /// Returns the job with changed settings.
    #[must_use]
    pub fn with(mut self, change: impl FnOnce(&mut Settings)) -> Job {
        change(&mut self.settings);
        self
    }

    /// Returns the camera that renders a scene.
    pub fn camera<'a>(&'a self, scene: &'a CompiledScene) -> &'a CameraDesc {
        self.view
            .as_ref()
            .map_or(&scene.camera, |view| &view.camera)
    }
}

/// Statistics of one wave.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WaveStats {
    /// Number of samples added to every pixel.
    pub samples: u64,
    /// Render time in seconds on a monotonic clock; the only time that is compared. It is the time
    /// inside `advance`, or on a device, by the device's clock, from the start of its work on this
    /// wave to the end of its samples. Copying the sums is not included.
    pub render_s: f64,
    /// Time in seconds of the wave that is not part of `render_s`, because other work on the
    /// machine took the processor from the renderer, or the process was stopped; 0 where that is
    /// not watched.
    pub lost_s: f64,
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
    /// Returns the number of samples per pixel that take about `seconds` at the rate so far: at
    /// least 1, and 1 if the rate is not known.
    pub fn samples_in(&self, seconds: f64) -> u64 {
        let rate = self.samples as f64 / self.render_s;
        if rate.is_finite() {
            ((seconds * rate) as u64).max(1)
        } else {
            1
        }
    }

    /// Adds the statistics of a later wave.
    pub fn add(&mut self, later: &WaveStats) {
        self.samples += later.samples;
        self.render_s += later.render_s;
        self.lost_s += later.lost_s;
        self.device_s += later.device_s;
        self.idle_s += later.idle_s;
        self.paths += later.paths;
        self.rays += later.rays;
        self.invalid += later.invalid;
        self.first_invalid = self.first_invalid.or(later.first_invalid);
    }
}

/// Statistics of opening a renderer, before its first wave.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OpenStats {
    /// Time spent on copying scene and job to a device, in seconds; 0 without one.
    pub upload_s: f64,
    /// Time spent on compiling shaders and creating pipelines, in seconds; 0 without any.
    pub pipeline_s: f64,
    /// Time spent on building acceleration structures, in seconds; for one that was kept from an
    /// earlier run, the time that it took then.
    pub accel_build_s: f64,
    /// Number of nodes of the acceleration structures.
    pub accel_nodes: u64,
    /// Size of nodes and primitives as traversal reads them, in bytes; 0 if unknown.
    pub accel_bytes: u64,
    /// Expected cost of a ray that meets the scene's box, by the surface area heuristic: visited
    /// nodes plus tested primitives; 0 if unknown.
    pub accel_cost: f64,
    /// Memory of the scene's geometry and textures; zero if unknown.
    pub scene: SceneMemory,
    /// Devices that render, each once: one, unless shards were rendered on several.
    pub devices: Vec<Device>,
    /// Whether the time that other work took from the renderer is known: see [`WaveStats::lost_s`].
    pub watches_processor: bool,
}

impl OpenStats {
    /// Returns the line about the devices for people; empty if they are unknown.
    pub fn device_line(&self) -> String {
        devices_line(&self.devices)
    }
}

/// Reason why a backend cannot render.
#[derive(Clone, Debug, PartialEq, thiserror::Error, Serialize, Deserialize)]
pub enum RenderError {
    /// The backend lacks a feature that the job needs.
    #[error("backend `{backend}` cannot do this: {reason}")]
    Unsupported {
        /// Name of the backend.
        #[serde(skip, default = "worker::codec::backend_of_worker")]
        backend: &'static str,
        /// Description of what is missing.
        reason: String,
    },
    /// The device or the rendering process is gone, and with it everything that was not saved. A
    /// retry from the newest checkpoint may succeed.
    #[error("backend `{backend}` is lost: {reason}")]
    Lost {
        /// Name of the backend.
        #[serde(skip, default = "worker::codec::backend_of_worker")]
        backend: &'static str,
        /// Description of what happened.
        reason: String,
    },
    /// Rendering failed. The cell is lost, the night continues.
    #[error("backend `{backend}` failed: {reason}")]
    Failed {
        /// Name of the backend.
        #[serde(skip, default = "worker::codec::backend_of_worker")]
        backend: &'static str,
        /// Description of what happened.
        reason: String,
    },
    /// The caller did not want to wait any longer, as [`Until`] allows. The film is as
    /// it was before.
    #[error("backend `{backend}` was cancelled")]
    Cancelled {
        /// Name of the backend.
        #[serde(skip, default = "worker::codec::backend_of_worker")]
        backend: &'static str,
    },
}

impl RenderError {
    /// Returns an error for a feature that the backend lacks.
    pub fn unsupported(backend: &'static str, reason: impl ToString) -> RenderError {
        let reason = reason.to_string();
        RenderError::Unsupported { backend, reason }
    }

    /// Returns an error for a device or process that is gone.
    pub fn lost(backend: &'static str, reason: impl ToString) -> RenderError {
        let reason = reason.to_string();
        RenderError::Lost { backend, reason }
    }

    /// Returns an error for a cell whose rendering failed.
    pub fn failed(backend: &'static str, reason: impl ToString) -> RenderError {
        let reason = reason.to_string();
        RenderError::Failed { backend, reason }
    }
}

/// Picture of a run in progress, made of all samples so far.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Pixels in linear radiance.
    pub image: SharedImage,
    /// Seconds by which making the picture changes the render time of the run so far, of which it is
    /// part. Negative if an earlier picture took longer; never below the time rendered since then.
    pub extra_s: f64,
    /// Whether it differs from the mean of the film.
    pub denoised: bool,
}

/// Function that tells whether a run is no longer wanted; called from many threads. Once it has
/// returned true, it does so for ever.
pub type Abandoned<'a> = &'a (dyn Fn() -> bool + Sync);

/// Request of samples: the argument of [`Renderer::render`].
#[derive(Clone, Copy)]
pub struct Advance<'a> {
    /// Samples to add to every pixel.
    pub samples: u64,
    /// Samples that the device may start speculatively while the host reads the film. They never
    /// affect results. 0 if another run uses the device next, since the speculative work would be
    /// charged to its time.
    pub more: u64,
    /// When to give up.
    pub until: Until<'a>,
}

/// When a call of [`Renderer::render`] gives up, with [`RenderError::Cancelled`].
#[derive(Clone, Copy)]
pub enum Until<'a> {
    /// It does not.
    Done,
    /// As soon as the function returns true, but only while it waits for another program. The film is
    /// then as before.
    Cancelled(&'a dyn Fn() -> bool),
    /// As soon as the function returns true, or later. The renderer must be dropped then, since only
    /// some pixels have the samples.
    Abandoned(Abandoned<'a>),
}

impl Until<'_> {
    /// Whether to give up.
    pub fn is_now(&self) -> bool {
        match self {
            Until::Done => false,
            Until::Cancelled(now) => now(),
            Until::Abandoned(now) => now(),
        }
    }
}

impl Advance<'_> {
    /// Returns a request of samples, without anything else.
    pub fn by(samples: u64) -> Advance<'static> {
        Advance {
            samples,
            more: 0,
            until: Until::Done,
        }
    }
}

/// Run of a job in progress on a backend.
pub trait Renderer: Send {
    /// Adds samples to every pixel.
    ///
    /// # Errors
    /// Returns [`RenderError::Cancelled`] if it gave up as the request allows, and another error if
    /// the backend fails; the film must not be used any more then.
    fn render(&mut self, request: &Advance<'_>) -> Result<WaveStats, RenderError>;

    /// Adds `samples` samples to every pixel.
    ///
    /// # Errors
    /// Returns an error if the backend fails; the film must not be used any more then.
    fn advance(&mut self, samples: u64) -> Result<WaveStats, RenderError> {
        self.render(&Advance::by(samples))
    }

    /// Whether each wave should be rendered by one call, since every call has a cost of its own that
    /// is part of the render time or outside of all clocks.
    fn whole_waves(&self) -> bool {
        false
    }

    /// Returns the film with all samples so far.
    fn film(&self) -> &Film;

    /// Returns the picture that is measured and stored: the mean of the film, unless a filter makes
    /// another one from it.
    ///
    /// # Errors
    /// Returns an error if the filter fails.
    fn picture(&mut self) -> Result<Picture, RenderError> {
        Ok(Picture {
            image: Arc::new(self.film().mean()),
            extra_s: 0.0,
            denoised: false,
        })
    }

    /// Returns the two independent halves of the film, if it consists of two and both have samples;
    /// see [`reference_halves`].
    fn halves(&self) -> Option<[Arc<Film>; 2]> {
        None
    }

    /// Returns the films of the layers that the job requests, in the order of
    /// [`LAYERS`](lumbre_light::film::layer::LAYERS).
    fn layers(&self) -> &[LayerFilm] {
        &[]
    }

    /// Returns the current sums of film `index` of [`Renderer::layers`].
    ///
    /// # Errors
    /// Returns an error if there is no such film or the backend fails.
    fn layer(&self, index: usize) -> Result<Film, RenderError> {
        Err(RenderError::failed(
            "this",
            format!("layer film {index} does not exist"),
        ))
    }

    /// Returns the images of all layers. Only one film's sums at a time are copied.
    ///
    /// # Errors
    /// Returns an error if the backend fails.
    fn layer_images(&self) -> Result<Vec<LayerImage>, RenderError> {
        let films = self.layers().iter().enumerate();
        films
            .map(|(i, film)| {
                Ok(LayerImage {
                    film: *film,
                    image: film.image(&self.layer(i)?),
                })
            })
            .collect()
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
        Err(RenderError::unsupported(
            "this",
            "it cannot resume from a checkpoint",
        ))
    }

    /// Returns the statistics of opening the renderer.
    fn open_stats(&self) -> &OpenStats;
}

/// Function that starts a run of a job on a scene.
pub type OpenFn = fn(Arc<CompiledScene>, Job) -> Result<Box<dyn Renderer>, RenderError>;

/// Function that records the events of each of some samples of a job.
pub type PathsFn =
    fn(&Arc<CompiledScene>, &Job, &[SampleAt]) -> Result<Vec<Vec<PathEvent>>, RenderError>;

/// Description of a backend: a row of the table of backends of a program.
pub struct BackendRow {
    /// Name in scripts and on the command line.
    pub name: &'static str,
    /// Description in one sentence.
    pub doc: &'static str,
    /// Checks whether this machine can use the backend. Returns the device, or the reason why not.
    pub probe: fn() -> Result<String, String>,
    /// Layers that it supports. Plans that request others on it are refused.
    pub layers: &'static [Layer],
    /// Whether it supports time-resolved films and composed materials. If not, plans that request a
    /// time axis or use a scene with such materials on it are refused.
    pub times: bool,
    /// Whether the weights of composed materials may have textures. If not, plans that use a scene with
    /// such materials on it are refused.
    pub blends: bool,
    /// Whether a tree can choose lights. If not, plans that request it are refused.
    pub light_trees: bool,
    /// Whether paths may continue in uniform directions. If not, plans that request it are refused.
    pub uniform_directions: bool,
    /// Material models that it supports. Plans that use a scene with others on it are refused.
    pub models: &'static [Model],
    /// Returns why it cannot run an integrator with these shaders, or `None` if it can. Plans that
    /// request it are refused with this reason. Must not touch a device.
    pub refuses: fn(&IntegratorRow, &Shaders) -> Option<String>,
    /// Resolves a choice of shaders: the folder with the hash of its differences, which becomes part
    /// of a run's identity, or [`Shaders::BuiltIn`] if nothing differs from the shaders of the
    /// program. The error is the reason why a folder cannot be used. Must not touch a device.
    pub shaders: fn(&Shaders) -> Result<Shaders, String>,
    /// Whether it builds its acceleration structure according to `accel`. If not, plans that
    /// request anything but the default are refused.
    pub accel: bool,
    /// Starts a run of a job.
    pub open: OpenFn,
    /// Records the events of single samples of a job, in this process; layers are left out.
    pub paths: PathsFn,
}
