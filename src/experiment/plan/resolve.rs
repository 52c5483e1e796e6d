//! From what a script asks for at one point to something that can be rendered: scenes are read once, every name is
//! found, and nothing is left open.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::axes::{describe, help};
use super::{PlanError, RunId, identity};
use crate::experiment::spec::{CellConfig, Point};
use crate::film::layer::Layout;
use crate::film::time;
use crate::render::cpu::together;
use crate::render::hierarchy::InLanes;
use crate::render::{self, BackendRow, external};
use crate::scene::{Note, SceneDesc, SceneError, desc, edit};
use crate::transport::integrator::external::{EXTERNALS, is_external};
use crate::transport::integrator::{INTEGRATORS, IntegratorRow, integrator};
use crate::transport::sampler::{SAMPLER_NAMES, SamplerRow, sampler};
use crate::value::Value;

/// The most pixels a picture may have: their sums take 12 GiB.
const MAX_PIXELS: u64 = 1 << 28;

/// What reading a scene file gives: the scene and what of the file could not be honoured.
pub type LoadedScene = Result<(SceneDesc, Vec<Note>), SceneError>;

/// Reads a scene file with the options that were chosen for it.
pub type LoadScene<'a> = dyn FnMut(&Path, &BTreeMap<String, Value>) -> LoadedScene + 'a;

/// Something that can be rendered.
#[derive(Clone)]
pub(super) struct Renderable {
    pub(super) config: Arc<CellConfig>,
    pub(super) scene: Arc<SceneDesc>,
    /// The part of the identity that says what the picture is.
    pub(super) picture: BTreeMap<String, Value>,
    pub(super) resolution: [u32; 2],
    /// Why its paths have to go one by one, where the script leaves that open.
    pub(super) alone: Option<String>,
}

impl Renderable {
    /// Lets its paths go one by one.
    pub(super) fn go_alone(&mut self) {
        let config = Arc::make_mut(&mut self.config);
        config.accel = config.accel.alone();
        identity::put_accel(&mut self.picture, &config.accel);
    }
}

/// A scene with changes made, and its content hash.
type Edited = (Arc<SceneDesc>, [u8; 32]);

/// What was found so far, so that ten thousand cells cost one reading of each file and one probe of each backend.
pub(super) struct Resolver<'a> {
    load: &'a mut LoadScene<'a>,
    /// Whether others render it, so that backends are not asked whether they can.
    elsewhere: bool,
    files: BTreeMap<(PathBuf, [u8; 32]), Arc<SceneDesc>>,
    edited: BTreeMap<(PathBuf, [u8; 32], [u8; 32]), Edited>,
    backends: BTreeMap<String, &'static str>,
    /// Versions of other programs by what they are asked with, or why they are not here.
    peers: BTreeMap<[u8; 32], Result<String, String>>,
    /// What of each backend is not as it was built, by its name.
    edits: BTreeMap<&'static str, Option<String>>,
    reference_files: BTreeMap<PathBuf, (RunId, Value)>,
    /// What the scene files say that could not be honoured.
    pub(super) notes: BTreeSet<Note>,
}

impl<'a> Resolver<'a> {
    pub(super) fn new(load: &'a mut LoadScene<'a>, elsewhere: bool) -> Resolver<'a> {
        Resolver {
            load,
            elsewhere,
            files: BTreeMap::new(),
            edited: BTreeMap::new(),
            backends: BTreeMap::new(),
            peers: BTreeMap::new(),
            edits: BTreeMap::new(),
            reference_files: BTreeMap::new(),
            notes: BTreeSet::new(),
        }
    }

    /// Finds everything that a configuration names.
    pub(super) fn renderable(&mut self, mut config: CellConfig, point: &Point) -> Result<Renderable, PlanError> {
        let row = integrator_row(&config.integrator, point)?;
        let sampler = sampler_row(&config.sampler, point)?;
        let peer = if is_external(row) { Some(self.peer(row, &config, point)?) } else { None };
        let asked = std::mem::take(&mut config.backend);
        config.backend = match peer {
            Some(_) => external::BACKEND.to_owned(),
            None => self.backend(&asked, point)?.to_owned(),
        };
        if peer.is_none() && asked == "auto" && config.backend != render::cpu::ROW.name {
            config.fallback = Some(render::cpu::ROW.name);
        }
        let (scene, hash) = self.scene(&config, point)?;
        let resolution = config.resolution.unwrap_or(scene.resolution);
        let [width, height] = resolution;
        if !(1..=MAX_PIXELS).contains(&(u64::from(width) * u64::from(height))) {
            return Err(PlanError::Resolution { point: describe(point), width, height, limit: MAX_PIXELS });
        }
        let max_depth = config.max_depth.unwrap_or(scene.max_depth);
        if max_depth == 0 {
            return Err(PlanError::NoDepth { point: describe(point) });
        }
        let refused = |config: &CellConfig| {
            render::backend(&config.backend).and_then(|backend| refusal(backend, row, max_depth, &scene, config))
        };
        // What the script has left to the program goes to the backend that can do it.
        if let Some(able) = config.fallback.filter(|_| refused(&config).is_some()) {
            (config.backend, config.fallback) = (able.to_owned(), None);
        }
        if config.backend != render::cpu::ROW.name {
            config.accel = config.accel.alone();
        }
        if let Some(reason) = refused(&config) {
            return Err(PlanError::Refused { point: describe(point), backend: config.backend.clone(), reason });
        }
        let pixels = u64::from(width) * u64::from(height);
        Self::films(&config, pixels, max_depth)
            .and_then(|()| match &config.timing {
                Some(timing) => time::bytes(&timing.axis, pixels, row.splats).map(drop),
                None => Ok(()),
            })
            .map_err(|reason| PlanError::Films { point: describe(point), reason })?;
        config.resolution = Some(resolution);
        config.max_depth = Some(max_depth);
        let mut picture = identity::picture(&config, row, sampler, &hash);
        picture.extend(peer.map(|version| ("peer".to_owned(), Value::Str(version))));
        if let Some(Some(edited)) = self.edits.get(config.backend.as_str()) {
            picture.insert("shaders".to_owned(), edited.as_str().into());
        }
        let alone = alone(&config, row, sampler);
        Ok(Renderable { config: Arc::new(config), scene, picture, resolution, alone })
    }

    /// Why paths have to go one by one where the script leaves that open, as far as it is known before the scene is read.
    pub(super) fn alone(&mut self, config: &CellConfig, point: &Point) -> Option<String> {
        let (row, sampler) = (integrator(&config.integrator)?, sampler(&config.sampler)?);
        let on_cpu = !is_external(row) && self.backend(&config.backend, point).ok()? == render::cpu::ROW.name;
        alone(config, row, sampler).filter(|_| on_cpu)
    }

    /// The version of the program that carries a technique out.
    fn peer(&mut self, row: &'static IntegratorRow, config: &CellConfig, point: &Point) -> Result<String, PlanError> {
        let films = !config.films.is_empty() || config.timing.is_some();
        if let Some(reason) = external::refusal(config.filter, &config.sampler, films, config.rr_start) {
            let (backend, reason) = (row.name.to_owned(), reason.to_owned());
            return Err(PlanError::Refused { point: describe(point), backend, reason });
        }
        let known = self.peers.entry(hash_of(&config.params)).or_insert_with(|| external::probe(&config.params));
        known.clone().map_err(|reason| PlanError::Absent { technique: row.name, reason })
    }

    /// Whether the backend fills layers and there is room for them.
    fn films(config: &CellConfig, pixels: u64, max_depth: u32) -> Result<(), String> {
        if config.films.is_empty() {
            return Ok(());
        }
        if !render::backend(&config.backend).is_some_and(|row| row.layers) {
            return Err(format!("backend `{}` cannot fill layers", config.backend));
        }
        Layout::new(&config.films, max_depth, pixels).map(drop)
    }

    /// The id and identity of a file that serves as a reference.
    pub(super) fn reference_file(&mut self, file: &Path, point: &Point) -> Result<(RunId, Value), PlanError> {
        if let Some(known) = self.reference_files.get(file) {
            return Ok(known.clone());
        }
        let content = identity::of_file(file).map_err(|e| PlanError::ReferenceFile {
            point: describe(point),
            file: file.to_owned(),
            reason: e.to_string(),
        })?;
        let identity = identity::reference_file(&content);
        let known = (identity::run_id(&identity), identity);
        self.reference_files.insert(file.to_owned(), known.clone());
        Ok(known)
    }

    fn scene(&mut self, config: &CellConfig, point: &Point) -> Result<Edited, PlanError> {
        let options = hash_of(&config.scene_options);
        let key = (config.scene_file.clone(), options, hash_of(&config.set));
        if let Some(known) = self.edited.get(&key) {
            return Ok(known.clone());
        }
        let mut scene = self.file(config, options, point)?;
        if !config.set.is_empty() {
            let changed = Arc::make_mut(&mut scene);
            edit::apply(changed, &config.set)
                .map_err(|e| PlanError::Set { point: describe(point), error: Box::new(e) })?;
        }
        desc::delay::check(&scene).map_err(|e| PlanError::Set { point: describe(point), error: Box::new(e) })?;
        let hash = desc::content_hash(&scene);
        self.edited.insert(key, (Arc::clone(&scene), hash));
        Ok((scene, hash))
    }

    fn file(&mut self, config: &CellConfig, options: [u8; 32], point: &Point) -> Result<Arc<SceneDesc>, PlanError> {
        let key = (config.scene_file.clone(), options);
        if let Some(known) = self.files.get(&key) {
            return Ok(Arc::clone(known));
        }
        let (scene, notes) = (self.load)(&config.scene_file, &config.scene_options)
            .map_err(|e| PlanError::Scene { point: describe(point), error: Box::new(e) })?;
        self.notes.extend(notes);
        let scene = Arc::new(scene);
        self.files.insert(key, Arc::clone(&scene));
        Ok(scene)
    }

    fn backend(&mut self, name: &str, point: &Point) -> Result<&'static str, PlanError> {
        if let Some(known) = self.backends.get(name) {
            return Ok(known);
        }
        let row = render::backend(name).ok_or_else(|| PlanError::UnknownBackend {
            point: describe(point),
            name: name.to_owned(),
            help: help(name, render::BACKENDS.iter().map(|row| row.name).chain(["auto"])),
        })?;
        let unusable =
            |reason| PlanError::UnusableBackend { point: describe(point), name: row.name.to_owned(), reason };
        if !self.elsewhere {
            (row.probe)().map_err(unusable)?;
        }
        self.edits.insert(row.name, (row.edited)().map_err(unusable)?);
        self.backends.insert(name.to_owned(), row.name);
        Ok(row.name)
    }
}

fn integrator_row(name: &str, point: &Point) -> Result<&'static IntegratorRow, PlanError> {
    integrator(name).ok_or_else(|| PlanError::UnknownIntegrator {
        point: describe(point),
        name: name.to_owned(),
        help: help(name, INTEGRATORS.iter().chain(EXTERNALS).map(|row| row.name)),
    })
}

fn sampler_row(name: &str, point: &Point) -> Result<&'static SamplerRow, PlanError> {
    sampler(name).ok_or_else(|| PlanError::UnknownSampler {
        point: describe(point),
        name: name.to_owned(),
        help: help(name, SAMPLER_NAMES),
    })
}

/// Why paths on the CPU have to go one by one where the script leaves that open.
fn alone(config: &CellConfig, row: &IntegratorRow, sampler: &SamplerRow) -> Option<String> {
    if config.accel.lanes != InLanes::Auto {
        return None;
    }
    together::alone(row, &config.params, sampler, !config.films.is_empty(), config.timing.is_some())
}

/// Why a backend cannot render this, if it cannot.
fn refusal(
    backend: &BackendRow,
    integrator: &IntegratorRow,
    max_depth: u32,
    scene: &SceneDesc,
    config: &CellConfig,
) -> Option<String> {
    if !backend.accel && !config.accel.alone().identity().is_empty() {
        return Some(format!(
            "its hierarchy is not built by `{}`: `accel` is for `cpu` and `vulkan-compute`",
            config.accel.describe()
        ));
    }
    if !backend.times {
        if config.timing.is_some() {
            return Some(
                "it does not count the time of light: leave out `film.time`, or render it on `cpu`".to_owned(),
            );
        }
        if let Some(m) = scene.materials.iter().find(|m| !m.parts.is_empty()) {
            return Some(format!("it has no composed materials, as `{}` is", m.name));
        }
    }
    let strange = scene.materials.iter().find(|m| !backend.models.contains(&m.model));
    let model =
        |m: &desc::MaterialDesc| format!("it has no materials of the model `{}`, as `{}` is", m.model.word(), m.name);
    (backend.refuses)(integrator, max_depth).or_else(|| strange.map(model))
}

fn hash_of(values: &BTreeMap<String, Value>) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    Value::Map(values.clone()).hash_into(&mut hasher);
    *hasher.finalize().as_bytes()
}
