//! State that the thread which renders shares with the user interface: requests, and pictures as
//! they were published.

use std::collections::BTreeMap;
use std::sync::atomic::AtomicU64;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use crate::explore::settings::{Limits, SceneFacts, SceneFile};
use lumbre_light::film::layer::LayerImage;
use lumbre_light::film::{Image, SharedImage};
use lumbre_light::value::Value;
use lumbre_render::Job;
use lumbre_render::cpu::prepared_scene::PreparedScene;
use lumbre_scene_io::load::MissingTextures;

/// Number of pictures of a session.
pub const SLOTS: usize = 2;

lumbre_light::named! {
    /// One of the pictures of a session.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub enum Slot {
        /// The first picture; the only one without a comparison.
        #[default]
        A = "A",
        /// The second picture.
        B = "B",
    }
}

impl Slot {
    /// Returns the slot of the picture with which this one is compared.
    pub fn other(self) -> Slot {
        match self {
            Slot::A => Slot::B,
            Slot::B => Slot::A,
        }
    }

    /// Returns the index in arrays with an element for each slot.
    pub fn index(self) -> usize {
        self as usize
    }
}

/// A picture to render.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// The scene; its path and options are also in `table`.
    pub scene: SceneFile,
    /// Render table with scene and resolution.
    pub table: BTreeMap<String, Value>,
    /// Seed of the random numbers.
    pub seed: u64,
}

/// Backend and threads of a session.
#[derive(Clone, Debug)]
pub struct SessionOptions {
    /// Name of the backend.
    pub backend: String,
    /// Number of threads; 0 means one for each core.
    pub threads: usize,
    /// Policy for textures that cannot be read.
    pub missing: MissingTextures,
}

/// State of a picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Status {
    /// Nothing was requested.
    #[default]
    Idle,
    /// The scene is being loaded.
    Loading,
    /// Samples are being added.
    Rendering,
    /// The user paused rendering.
    Paused,
    /// A limit is reached.
    Finished,
    /// The picture cannot be rendered, for this reason.
    Failed(String),
}

/// A picture as it was published.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Mean of the film in linear radiance.
    pub image: SharedImage,
    /// Number of samples per pixel; 0 for a picture in reduced resolution that is shown until the
    /// first sample of every pixel is done.
    pub samples: u64,
    /// Time inside the renderer in seconds.
    pub render_s: f64,
    /// Number of camera paths.
    pub paths: u64,
    /// Number of rays.
    pub rays: u64,
    /// Number of samples that were not finite.
    pub invalid: u64,
    /// Root mean square standard error over the mean of the picture, if it can be estimated.
    pub noise: Option<f64>,
    /// Variance of the mean of every pixel, as estimated last, with the samples that it had then.
    pub variance: Option<(SharedImage, u64)>,
    /// Mean of the first samples, with their number; the other samples are independent of them.
    pub part: Option<(SharedImage, u64)>,
    /// Films of the requested layers.
    pub layers: Vec<LayerImage>,
}

impl Frame {
    /// Returns the means of two parts of the samples and the numbers of samples in them; `None` if
    /// the picture was published only once so far. The parts are independent, except with the
    /// sampler `sobol`, which distributes the samples of both together.
    pub fn halves(&self) -> Option<([Image; 2], [u64; 2])> {
        let (part, first) = self.part.as_ref()?;
        let rest = self.samples.checked_sub(*first).filter(|rest| *rest > 0)?;
        let [n, m] = [self.samples, *first].map(|count| count as f64);
        let pixel = |(all, part): (&[f32; 3], &[f32; 3])| {
            let other = |c: usize| (n * f64::from(all[c]) - m * f64::from(part[c])) / rest as f64;
            [0, 1, 2].map(|c| other(c) as f32)
        };
        let second = Image::from_pixels(
            part.width,
            part.height,
            self.image.data.iter().zip(&part.data).map(pixel).collect(),
        );
        Some(([(**part).clone(), second], [*first, rest]))
    }
}

/// State of one picture, as published.
#[derive(Clone, Debug, Default)]
pub struct SlotView {
    /// State of the picture.
    pub status: Status,
    /// Newest picture of the current settings, or of earlier ones until there is a new one.
    pub frame: Option<Arc<Frame>>,
    /// Number of the request that `frame` shows, or that failed.
    pub request: u64,
    /// Time from the request to its first picture in seconds.
    pub first_picture_s: Option<f64>,
    /// Description of the device that renders.
    pub device: String,
    /// Job of the request, with its camera.
    pub job: Option<Arc<Job>>,
    /// The scene of the request, with the hierarchy if the CPU renders it.
    pub scene: Option<Arc<LoadedScene>>,
}

/// A loaded scene.
pub struct LoadedScene {
    /// File and options.
    pub file: SceneFile,
    /// Camera, views and depth.
    pub facts: SceneFacts,
    /// Notes of the loader.
    pub notes: Vec<String>,
    /// Names of the materials, in the order of the compiled scene, in which unnamed ones may follow.
    pub materials: Vec<String>,
    /// The scene with its hierarchy; `None` on other backends.
    pub prepared: Option<Arc<PreparedScene>>,
}

impl LoadedScene {
    /// Returns the name of a material, or its number if it has none.
    pub fn material_name(&self, material: u32) -> String {
        let name = self.materials.get(material as usize);
        name.cloned()
            .unwrap_or_else(|| format!("number {material}"))
    }
}

impl std::fmt::Debug for LoadedScene {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LoadedScene")
            .field("file", &self.file)
            .finish_non_exhaustive()
    }
}

/// Everything that a session published.
#[derive(Clone, Debug, Default)]
pub struct Published {
    /// Number of changes so far.
    pub revision: u64,
    /// The pictures, by slot.
    pub slots: [SlotView; SLOTS],
}

impl Published {
    /// Returns the state of a picture.
    pub fn slot(&self, slot: Slot) -> &SlotView {
        &self.slots[slot.index()]
    }
}

/// Requests, limits and pause, as the user wants them.
#[derive(Default)]
pub(super) struct Wanted {
    pub(super) requests: [Option<(u64, Instant, Arc<Request>)>; SLOTS],
    pub(super) limits: [Limits; SLOTS],
    pub(super) paused: bool,
    pub(super) closed: bool,
}

/// Locks a mutex. A panic while it was locked is ignored: every change of the shared state is
/// complete in itself.
pub(in crate::explore) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// State that the thread shares with the user interface.
#[derive(Default)]
pub(super) struct Shared {
    pub(super) wanted: Mutex<Wanted>,
    pub(super) changed: Condvar,
    /// Number of the newest request of each slot; a wave for an older one is abandoned.
    pub(super) newest: [AtomicU64; SLOTS],
    pub(super) published: Mutex<Published>,
}

impl Shared {
    /// Locks what the user wants.
    pub(super) fn wanted(&self) -> MutexGuard<'_, Wanted> {
        lock(&self.wanted)
    }

    /// Changes the state of one picture and counts the change.
    pub(super) fn publish(&self, slot: usize, change: impl FnOnce(&mut SlotView)) {
        let mut published = lock(&self.published);
        change(&mut published.slots[slot]);
        published.revision += 1;
    }
}
