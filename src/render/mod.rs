//! Backends: what runs an integrator over a compiled scene, a wave of samples at a time.
//!
//! This room knows no integrator by name: a [`Job`] carries a row of
//! [`INTEGRATORS`](crate::transport::integrator::INTEGRATORS). Nothing above it knows a graphics interface.

pub mod choice;
pub mod cpu;
pub mod entrance;
pub mod external;
pub mod halves;
pub mod hierarchy;
pub mod mock;
pub mod paths;
#[cfg(feature = "vulkan")]
pub mod vulkan;
pub mod worker;

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::sync::Arc;

use self::hierarchy::AccelSpec;
use self::paths::{SampleAt, Step};
use crate::film::Film;
use crate::film::layer::{Layer, LayerFilm};
use crate::film::time::TimeCube;
use crate::scene::CompiledScene;
use crate::scene::desc::Model;
use crate::transport::camera::FilterSpec;
use crate::transport::flight::Timing;
use crate::transport::integrator::IntegratorRow;
use crate::transport::sampler::{INDEPENDENT, SamplerRow};
use crate::value::Value;

/// Everything besides the scene that decides a picture.
#[derive(Clone, Debug)]
pub struct Job {
    /// The technique.
    pub integrator: &'static IntegratorRow,
    /// Parameters of the technique, checked against its row's schema.
    pub params: BTreeMap<String, Value>,
    /// Width and height in pixels.
    pub resolution: [u32; 2],
    /// Greatest number of path edges: 1 = emission only, 2 = direct light.
    pub max_depth: u32,
    /// First path edge after which Russian roulette may end a path; `None` is never.
    pub rr_start: Option<u32>,
    /// Pixel filter.
    pub filter: FilterSpec,
    /// The layers to fill besides the picture; none cost nothing.
    pub layers: Vec<Layer>,
    /// The time axis of the film; without one nothing is counted, and nothing is paid.
    pub timing: Option<Timing>,
    /// Where the numbers of samples come from.
    pub sampler: &'static SamplerRow,
    /// How the hierarchy is built through which rays are traced, where the backend builds one itself. Never changes the
    /// picture.
    pub accel: AccelSpec,
    /// Seed of every random number of the run.
    pub seed: u64,
    /// Index of its first sample of every pixel; the film counts from there. Samples are known by their index, so films of
    /// ranges that follow one another are films of one run.
    pub first_sample: u64,
    /// Worker threads; 0 is one for each core. Never changes the picture.
    pub threads: usize,
}

impl Job {
    /// A job without anything special: default parameters, no roulette, the pixel as filter, independent numbers, one thread
    /// for each core.
    pub fn plain(integrator: &'static IntegratorRow, resolution: [u32; 2], max_depth: u32, seed: u64) -> Job {
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

/// What one wave did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WaveStats {
    /// Samples added to every pixel.
    pub samples: u64,
    /// Seconds that rendering took, monotonic; the only time that counts: the time inside `advance`, or on a device, by its own
    /// clock, from the beginning of its work on this wave to the end of its samples. What copying the sums takes is not in it.
    pub render_s: f64,
    /// Seconds that a device besides the processor worked, by its own clock; 0 without one.
    pub device_s: f64,
    /// Seconds by its clock from the end of its work for this run before this wave to the beginning of this wave's: it waited for
    /// the host, copied what the wave before had left, or worked for others. 0 without such a device, and for its first wave.
    pub idle_s: f64,
    /// Camera paths traced.
    pub paths: u64,
    /// Rays traced.
    pub rays: u64,
    /// Samples and splats whose value was NaN or infinite, and splats that do not fit into their sums; they count as
    /// black and are never silently dropped.
    pub invalid: u64,
    /// Column, row and sample index of the first such sample, or of the first that traced such a splat.
    pub first_invalid: Option<[u64; 3]>,
}

impl WaveStats {
    /// Counts what was done after this.
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

/// What a renderer did before its first wave.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OpenStats {
    /// Seconds spent copying scene and job to a device; 0 without one.
    pub upload_s: f64,
    /// Seconds spent compiling shaders and making pipelines; 0 without any.
    pub pipeline_s: f64,
    /// Seconds spent building acceleration structures.
    pub accel_build_s: f64,
    /// Their number of nodes.
    pub accel_nodes: u64,
    /// Bytes of nodes and primitives as traversal reads them; 0 if that is not known.
    pub accel_bytes: u64,
    /// What a ray costs that meets the scene's box, by the surface area heuristic: the nodes that it visits plus the
    /// primitives that it is tested with; 0 if that is not known.
    pub accel_cost: f64,
    /// A line for people: device, builder, threads.
    pub device: String,
}

/// Why a backend cannot render.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RenderError {
    /// The backend lacks something the job needs.
    #[error("backend `{backend}` cannot do this: {reason}")]
    Unsupported {
        /// The backend.
        backend: &'static str,
        /// What is missing.
        reason: String,
    },
    /// The device or the process that rendered is gone, and with it all that was not saved. Another try, from the newest
    /// checkpoint, may succeed.
    #[error("backend `{backend}` is lost: {reason}")]
    Lost {
        /// The backend.
        backend: &'static str,
        /// What happened.
        reason: String,
    },
    /// Something went wrong while rendering; the cell is lost, the night is not.
    #[error("backend `{backend}` failed: {reason}")]
    Failed {
        /// The backend.
        backend: &'static str,
        /// What happened.
        reason: String,
    },
}

/// A run in progress.
pub trait Renderer: Send {
    /// Adds `samples` samples to every pixel.
    ///
    /// # Errors
    /// When the backend fails; the film must then not be used any more.
    fn advance(&mut self, samples: u64) -> Result<WaveStats, RenderError>;

    /// As [`Renderer::advance`]; and some `more` samples are likely to be asked for next, of which a device may do as many as it
    /// likes while the host looks at the film. Neither that nor what then is asked for changes any bit of what can be seen. The clock
    /// of whoever uses the same device meanwhile would count it, so that only one may, and 0 has to be said where another's turn
    /// follows.
    ///
    /// # Errors
    /// As [`Renderer::advance`].
    fn advance_toward(&mut self, samples: u64, _more: u64) -> Result<WaveStats, RenderError> {
        self.advance(samples)
    }

    /// The sums so far.
    fn film(&self) -> &Film;

    /// The two independent halves of the film, where it is made of such and both have samples: see [`halves`].
    fn halves(&self) -> Option<[Arc<Film>; 2]> {
        None
    }

    /// The films of the layers that the job asked for, in the order of [`LAYERS`](crate::film::layer::LAYERS); empty
    /// if it asked for none.
    fn layers(&self) -> &[LayerFilm] {
        &[]
    }

    /// The sums so far of film `index` of [`Renderer::layers`].
    ///
    /// # Errors
    /// When there is no such film, or the backend fails.
    fn layer(&self, index: usize) -> Result<Film, RenderError> {
        Err(RenderError::Failed { backend: "this", reason: format!("it has no film {index} of layers") })
    }

    /// The light of every pixel by its time, if the job has a time axis.
    fn times(&self) -> Option<TimeCube> {
        None
    }

    /// Writes all that another renderer of the same job needs to go on to the same bits, and says whether it did: a
    /// backend that cannot writes nothing, and what is cut off starts again.
    ///
    /// # Errors
    /// As `to`.
    fn save(&self, _to: &mut dyn Write) -> io::Result<bool> {
        Ok(false)
    }

    /// Takes what a renderer of the same job on the same backend has written by [`Renderer::save`], before the first
    /// wave.
    ///
    /// # Errors
    /// When it does not fit; this renderer is then worthless.
    fn restore(&mut self, _state: &[u8]) -> Result<(), RenderError> {
        Err(RenderError::Unsupported { backend: "this", reason: "it cannot go on from a checkpoint".to_owned() })
    }

    /// What opening cost.
    fn open_stats(&self) -> &OpenStats;
}

/// Starts a run of a job on a scene.
pub type OpenFn = fn(Arc<CompiledScene>, Job) -> Result<Box<dyn Renderer>, RenderError>;

/// The steps of each of some samples of a job.
pub type PathsFn = fn(&Arc<CompiledScene>, &Job, &[SampleAt]) -> Result<Vec<Vec<Step>>, RenderError>;

/// One row of [`BACKENDS`].
pub struct BackendRow {
    /// The name in scripts and on the command line.
    pub name: &'static str,
    /// One sentence for people.
    pub doc: &'static str,
    /// Whether this machine can use it, and on what; the text is the device or the reason why not.
    pub probe: fn() -> Result<String, String>,
    /// Whether it can fill layers. If not, a plan that asks it for some is refused.
    pub layers: bool,
    /// Whether it counts the time of light and knows composed materials. If not, a plan that asks it for a film with a time
    /// axis, or for a scene with such materials, is refused.
    pub times: bool,
    /// The models of materials that it knows. A plan that asks it for a scene with others is refused.
    pub models: &'static [Model],
    /// Why it cannot carry out an integrator with paths of so many edges, if it cannot: a plan that asks for it is refused
    /// with these words. Must not touch a device.
    pub refuses: fn(&IntegratorRow, u32) -> Option<String>,
    /// A hash of what of it is not as it was built, if anything: part of the identity of runs. The error says what is wrong
    /// with it.
    pub edited: fn() -> Result<Option<String>, String>,
    /// Whether it builds its hierarchy as a run's `accel` says. If not, a plan that asks it for anything but the default is
    /// refused.
    pub accel: bool,
    /// Starts a run.
    pub open: OpenFn,
    /// Says what single samples of a job do, in this process; layers are left out.
    pub paths: PathsFn,
}

/// Every backend there is.
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
/// When there is none, or it cannot render this.
pub fn open(name: &str, scene: Arc<CompiledScene>, job: Job) -> Result<Box<dyn Renderer>, RenderError> {
    match backend(name) {
        Some(row) => (row.open)(scene, job),
        None => Err(RenderError::Unsupported { backend: "none", reason: format!("there is no backend `{name}`") }),
    }
}

/// The name of the backend that `auto` means on this machine, and why: `vulkan` on a device that traces rays,
/// `vulkan-compute` on another one, and `cpu` where there is none, or only a program that plays one.
pub fn automatic() -> (&'static str, String) {
    if let Some(name) = choice::auto() {
        return (name, "it meant that when the plan was frozen".to_owned());
    }
    #[cfg(feature = "vulkan")]
    let found = vulkan::automatic();
    #[cfg(not(feature = "vulkan"))]
    let found: Result<(&'static str, String), String> = Err("this program was built without Vulkan".to_owned());
    found.unwrap_or_else(|reason| (cpu::ROW.name, reason))
}

/// Names the one device of this machine that a backend renders on, for programs: its place among those of its kind, or
/// nothing for the processor.
pub fn device_place(backend: &str) -> String {
    #[cfg(feature = "vulkan")]
    if let Some(place) = vulkan::place(backend) {
        return place;
    }
    let _ = backend;
    String::new()
}

/// The places of further devices of this machine that are of the model that a backend renders on; none where one was named.
pub fn devices_alike(backend: &str) -> Vec<String> {
    #[cfg(feature = "vulkan")]
    return vulkan::alike(backend);
    #[cfg(not(feature = "vulkan"))]
    {
        let _ = backend;
        Vec::new()
    }
}

/// The places of the graphics devices of these names, each an index or a part of a name.
///
/// # Errors
/// When there is none of a name, or two names mean one.
pub fn device_places(names: &[String]) -> Result<Vec<String>, String> {
    #[cfg(feature = "vulkan")]
    return vulkan::places(names);
    #[cfg(not(feature = "vulkan"))]
    Err(format!("there is no device `{}`: this program was built without Vulkan", names.join(", ")))
}

/// The row that `name` means; `auto` is that of [`automatic`].
pub fn backend(name: &str) -> Option<&'static BackendRow> {
    let name = if name == "auto" { automatic().0 } else { name };
    BACKENDS.iter().find(|b| b.name == name)
}
