//! Resolves the request of a script at one point to something that can be rendered: reads scenes
//! once, looks up all names, and fills in every default.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::axes::{describe, help};
use super::technique_names::integrator_help;
use super::{Overrides, PlanError, PlannedCommand, RunId, identity};
use crate::experiment::spec::Point;
use lumbre_light::film::layer::LayerLayout;
use lumbre_light::film::time;
use lumbre_light::scene::{Note, SceneDesc, SceneError, desc};
use lumbre_light::transport::integrator::external::{is_declared, is_external};
use lumbre_light::transport::integrator::settings::has_uniform_directions;
use lumbre_light::transport::integrator::{IntegratorRow, canonical_name, integrator, own};
use lumbre_light::transport::light::LightSelection;
use lumbre_light::transport::sampler::{SAMPLER_NAMES, SamplerRow, sampler};
use lumbre_light::value::Value;
use lumbre_render::BackendRow;
use lumbre_render::Settings;
use lumbre_render::denoise::{Denoise, oidn};
use lumbre_render::external::technique::FOUND_VERSION;
use lumbre_render::external::{self, Technique};
use lumbre_render::shaders::Shaders;
use lumbre_scene_io::edit;

/// Greatest number of pixels of a picture; its film takes 12 GiB.
const MAX_PIXELS: u64 = 1 << 28;

/// Result of reading a scene file: the scene, and notes on contents that are not supported.
pub type LoadedScene = Result<(SceneDesc, Vec<Note>), SceneError>;

/// Reads a scene file with values for its options.
pub type LoadScene<'a> = dyn FnMut(&Path, &BTreeMap<String, Value>) -> LoadedScene + 'a;

/// Resolved render settings and scene.
#[derive(Clone)]
pub(super) struct Renderable {
    pub(super) config: Arc<Settings>,
    pub(super) scene: Arc<SceneDesc>,
    /// Part of the identity that determines the picture.
    pub(super) picture: BTreeMap<String, Value>,
    pub(super) resolution: [u32; 2],
}

impl Renderable {
    /// Switches the run to the scalar path.
    pub(super) fn use_scalar_path(&mut self) {
        let config = Arc::make_mut(&mut self.config);
        config.accel = config.accel.scalar();
        // The scalar path may have no entry.
        self.picture.remove("accel");
        self.picture.extend(config.identity());
    }
}

/// A scene with changes applied, and its content hash.
type Edited = (Arc<SceneDesc>, [u8; 32]);

/// Resolves render settings. Caches scenes, probes and versions, so that ten thousand cells need
/// one reading of each file and one probe of each backend.
pub(super) struct Resolver<'a> {
    load: &'a mut LoadScene<'a>,
    overrides: &'a Overrides,
    /// Scenes by file and hash of their options.
    files: BTreeMap<(PathBuf, [u8; 32]), Arc<SceneDesc>>,
    /// Scenes with changes applied, by file, hash of options and hash of changes.
    edited: BTreeMap<(PathBuf, [u8; 32], [u8; 32]), Edited>,
    /// Backends by their name as written: to find that of `auto`, devices are asked.
    backends: BTreeMap<String, &'static BackendRow>,
    /// Names of the backends that this machine can use.
    usable: BTreeSet<&'static str>,
    /// Versions of external programs by the command that prints them, or why they cannot be used.
    external_versions: BTreeMap<Vec<String>, Result<Option<String>, String>>,
    /// Version of Open Image Denoise, or why it cannot be used.
    oidn_version: Option<Result<String, String>>,
    /// Resolved choices of shaders, by the name of the backend and the choice.
    shaders: BTreeMap<(&'static str, Shaders), Shaders>,
    /// Ids and identities of reference files.
    reference_files: BTreeMap<PathBuf, (RunId, Value)>,
    /// Notes on contents of scene files that are not supported.
    pub(super) notes: BTreeSet<Note>,
    /// Commands of the script's external techniques.
    pub(super) commands: BTreeSet<PlannedCommand>,
}

impl<'a> Resolver<'a> {
    pub(super) fn new(load: &'a mut LoadScene<'a>, overrides: &'a Overrides) -> Resolver<'a> {
        Resolver {
            load,
            overrides,
            files: BTreeMap::new(),
            edited: BTreeMap::new(),
            backends: BTreeMap::new(),
            usable: BTreeSet::new(),
            external_versions: BTreeMap::new(),
            oidn_version: None,
            shaders: BTreeMap::new(),
            reference_files: BTreeMap::new(),
            notes: BTreeSet::new(),
            commands: BTreeSet::new(),
        }
    }

    /// Resolves a configuration.
    ///
    /// # Errors
    /// When a name is unknown, a file cannot be read, a value is out of range, or the backend
    /// cannot render the run.
    pub(super) fn renderable(
        &mut self,
        mut config: Settings,
        point: &Point,
    ) -> Result<Renderable, PlanError> {
        let row = integrator_row(&config.integrator, point)?;
        config.integrator = canonical_name(&config.integrator).to_owned();
        sampler_row(&config.sampler, point)?;
        let peer = if is_external(row) {
            Some(self.peer(row, &mut config, point)?)
        } else {
            None
        };
        if let Some(denoise) = &mut config.denoise {
            self.resolve_denoiser(denoise)?;
        }
        self.resolve_backend(&mut config, peer.is_some(), point)?;
        let (scene, hash) = self.scene(&config, point)?;
        let sides = config.resolution.unwrap_or(scene.resolution);
        let resolution = self.overrides.resolution(sides);
        let max_depth = config.max_depth.unwrap_or(scene.max_depth);
        check_size_and_depth(resolution, max_depth, point)?;
        check_backend(&mut config, row, &scene, point)?;
        let [width, height] = resolution;
        let pixels = u64::from(width) * u64::from(height);
        check_films(&config, row, pixels, max_depth).map_err(|reason| PlanError::Films {
            point: describe(point),
            reason,
        })?;
        config.resolution = Some(resolution);
        config.max_depth = Some(max_depth);
        let mut picture = identity::picture(&config, &hash);
        picture.extend(peer.map(|peer| ("peer".to_owned(), peer)));
        Ok(Renderable {
            config: Arc::new(config),
            scene,
            picture,
            resolution,
        })
    }

    /// Replaces the backend as written by the one that renders the run, resolves the shaders, and sets
    /// the fallback, which a run with a folder of shaders does not have.
    fn resolve_backend(
        &mut self,
        config: &mut Settings,
        external: bool,
        point: &Point,
    ) -> Result<(), PlanError> {
        if external {
            external::BACKEND.clone_into(&mut config.backend);
            config.shaders = config.shaders.without_device().map_err(|_| {
                let name = &config.integrator;
                shader_error(point, format!("`{name}` is another program: leave it out"))
            })?;
            return Ok(());
        }
        let requested = std::mem::take(&mut config.backend);
        let is_own = config.shaders.folder().is_none();
        let row = self.backend(&requested, point)?;
        config.shaders = self.resolved_shaders(row, &config.shaders, point)?;
        self.probe(row, point)?;
        row.name.clone_into(&mut config.backend);
        if is_own && requested == "auto" && config.backend != lumbre_render::cpu::ROW.name {
            config.fallback = Some(lumbre_render::cpu::ROW.name);
        }
        Ok(())
    }

    /// Resolves a choice of shaders for a backend. Each folder is read once.
    fn resolved_shaders(
        &mut self,
        row: &BackendRow,
        choice: &Shaders,
        point: &Point,
    ) -> Result<Shaders, PlanError> {
        let key = (row.name, choice.clone());
        if let Some(known) = self.shaders.get(&key) {
            return Ok(known.clone());
        }
        let resolved = (row.shaders)(choice)
            .map_err(|reason| shader_error(point, format!("backend `{}`: {reason}", row.name)))?;
        self.shaders.insert(key, resolved.clone());
        Ok(resolved)
    }

    /// Sets the version of the library of a denoiser.
    fn resolve_denoiser(&mut self, denoise: &mut Denoise) -> Result<(), PlanError> {
        if let Denoise::Oidn { version } = denoise {
            let found = self.oidn_version.get_or_insert_with(oidn::version);
            *version = found.clone().map_err(|reason| PlanError::Absent {
                technique: "the denoiser `oidn`".to_owned(),
                reason,
            })?;
        }
        Ok(())
    }

    /// Returns what identifies the external program of a technique: its version and the content of
    /// the script's files that its commands name. Sets the version in the parameters.
    fn peer(
        &mut self,
        row: &'static IntegratorRow,
        config: &mut Settings,
        point: &Point,
    ) -> Result<Value, PlanError> {
        let refused = |reason: String| PlanError::Refused {
            point: describe(point),
            backend: config.integrator.clone(),
            reason,
        };
        let technique =
            external::technique_of(row, &config.integrator, &config.params).map_err(refused)?;
        let reason = external::refusal(
            &technique,
            config.filter,
            &config.sampler,
            &config.rendered_layers(),
            config.timing.is_some(),
            config.rr_start,
        );
        if let Some(reason) = reason {
            return Err(refused(reason));
        }
        let may_run = !is_declared(row) || self.overrides.commands;
        let (command, version) = technique.command_lines();
        let found = match &version {
            Some(words) if may_run => self.version(words, &technique, config)?,
            _ => None,
        };
        if !is_declared(row) {
            return Ok(found.map_or(Value::Nil, Value::Str));
        }
        self.commands.insert(PlannedCommand {
            technique: config.integrator.clone(),
            command,
            version,
        });
        let mut peer = BTreeMap::new();
        if let Some(found) = found {
            config
                .params
                .insert(FOUND_VERSION.to_owned(), Value::Str(found.clone()));
            peer.insert("version".to_owned(), Value::Str(found));
        }
        let mut files = BTreeMap::new();
        for (word, path) in technique.files() {
            let hash = identity::file_hash(&path).map_err(|e| PlanError::Refused {
                point: describe(point),
                backend: config.integrator.clone(),
                reason: format!("{}: {e}", path.display()),
            })?;
            files.insert(word, Value::Str(hash.to_hex().to_string()));
        }
        peer.insert("files".to_owned(), Value::Map(files));
        Ok(Value::Map(peer))
    }

    /// Returns the version that a command prints. Each command runs once.
    fn version(
        &mut self,
        words: &[String],
        technique: &Technique,
        config: &Settings,
    ) -> Result<Option<String>, PlanError> {
        let known = self.external_versions.entry(words.to_vec());
        let version = known.or_insert_with(|| external::probe(technique));
        version.clone().map_err(|reason| PlanError::Absent {
            technique: config.integrator.clone(),
            reason,
        })
    }

    /// Returns the id and identity of a reference file.
    pub(super) fn reference_file(
        &mut self,
        file: &Path,
        point: &Point,
    ) -> Result<(RunId, Value), PlanError> {
        if let Some(known) = self.reference_files.get(file) {
            return Ok(known.clone());
        }
        let content = identity::file_hash(file).map_err(|e| PlanError::ReferenceFile {
            point: describe(point),
            file: file.to_owned(),
            reason: e.to_string(),
        })?;
        let identity = identity::reference_file(&content);
        let known = (identity::run_id(&identity), identity);
        self.reference_files.insert(file.to_owned(), known.clone());
        Ok(known)
    }

    /// Returns the scene of a configuration with its changes applied, and its content hash.
    fn scene(&mut self, config: &Settings, point: &Point) -> Result<Edited, PlanError> {
        let options = hash_of(&config.scene_options);
        let key = (config.scene_file.clone(), options, hash_of(&config.set));
        if let Some(known) = self.edited.get(&key) {
            return Ok(known.clone());
        }
        let mut scene = self.file(config, options, point)?;
        if !config.set.is_empty() {
            let changed = Arc::make_mut(&mut scene);
            edit::apply(changed, &config.set).map_err(|e| PlanError::Set {
                point: describe(point),
                error: Box::new(e),
            })?;
        }
        desc::delay::check(&scene).map_err(|e| PlanError::Set {
            point: describe(point),
            error: Box::new(e),
        })?;
        let hash = desc::content_hash(&scene);
        self.edited.insert(key, (Arc::clone(&scene), hash));
        Ok((scene, hash))
    }

    /// Returns the scene of a file without changes.
    fn file(
        &mut self,
        config: &Settings,
        options: [u8; 32],
        point: &Point,
    ) -> Result<Arc<SceneDesc>, PlanError> {
        let key = (config.scene_file.clone(), options);
        if let Some(known) = self.files.get(&key) {
            return Ok(Arc::clone(known));
        }
        let (scene, notes) =
            (self.load)(&config.scene_file, &config.scene_options).map_err(|e| {
                PlanError::Scene {
                    point: describe(point),
                    error: Box::new(e),
                }
            })?;
        self.notes.extend(notes);
        let scene = Arc::new(scene);
        self.files.insert(key, Arc::clone(&scene));
        Ok(scene)
    }

    /// Looks up a backend by name or `auto`, once for each name.
    fn backend(&mut self, name: &str, point: &Point) -> Result<&'static BackendRow, PlanError> {
        if let Some(known) = self.backends.get(name) {
            return Ok(known);
        }
        let row = crate::backends::backend(name).ok_or_else(|| PlanError::UnknownBackend {
            point: describe(point),
            name: name.to_owned(),
            help: help(
                name,
                crate::backends::BACKENDS
                    .iter()
                    .map(|row| row.name)
                    .chain(["auto"]),
            ),
        })?;
        self.backends.insert(name.to_owned(), row);
        Ok(row)
    }

    /// Checks once that this machine can use a backend, if it is to render the plan.
    fn probe(&mut self, row: &'static BackendRow, point: &Point) -> Result<(), PlanError> {
        if !self.overrides.elsewhere && !self.usable.contains(row.name) {
            (row.probe)().map_err(|reason| PlanError::UnusableBackend {
                point: describe(point),
                name: row.name.to_owned(),
                reason,
            })?;
            self.usable.insert(row.name);
        }
        Ok(())
    }
}

/// Returns the error about a folder of shaders that cannot be used.
fn shader_error(point: &Point, reason: String) -> PlanError {
    PlanError::Shaders {
        point: describe(point),
        reason,
    }
}

fn integrator_row(name: &str, point: &Point) -> Result<&'static IntegratorRow, PlanError> {
    integrator(name).ok_or_else(|| PlanError::UnknownIntegrator {
        point: describe(point),
        name: name.to_owned(),
        help: integrator_help(name, []),
    })
}

fn sampler_row(name: &str, point: &Point) -> Result<&'static SamplerRow, PlanError> {
    sampler(name).ok_or_else(|| PlanError::UnknownSampler {
        point: describe(point),
        name: name.to_owned(),
        help: help(name, SAMPLER_NAMES),
    })
}

/// Checks the resolution and the greatest number of path edges.
fn check_size_and_depth(
    [width, height]: [u32; 2],
    max_depth: u32,
    point: &Point,
) -> Result<(), PlanError> {
    if !(1..=MAX_PIXELS).contains(&(u64::from(width) * u64::from(height))) {
        return Err(PlanError::Resolution {
            point: describe(point),
            width,
            height,
            limit: MAX_PIXELS,
        });
    }
    if max_depth == 0 {
        return Err(PlanError::NoDepth {
            point: describe(point),
        });
    }
    Ok(())
}

/// Checks that the backend can render the run. With `auto`, a run that the backend cannot render is
/// moved to the fallback.
fn check_backend(
    config: &mut Settings,
    row: &IntegratorRow,
    scene: &SceneDesc,
    point: &Point,
) -> Result<(), PlanError> {
    let refused = |config: &Settings| {
        crate::backends::backend(&config.backend)
            .and_then(|backend| refusal(backend, row, scene, config))
    };
    if let Some(fallback) = config.fallback.filter(|_| refused(config).is_some()) {
        (config.backend, config.fallback) = (fallback.to_owned(), None);
        config.shaders = Shaders::BuiltIn;
    }
    if config.backend != lumbre_render::cpu::ROW.name {
        config.accel = config.accel.scalar();
    }
    match refused(config) {
        Some(reason) => Err(PlanError::Refused {
            point: describe(point),
            backend: config.backend.clone(),
            reason,
        }),
        None => Ok(()),
    }
}

/// Checks that layers and time bins are not too large.
fn check_films(
    config: &Settings,
    row: &IntegratorRow,
    pixels: u64,
    max_depth: u32,
) -> Result<(), String> {
    LayerLayout::new(&config.rendered_layers(), max_depth, pixels)?;
    if let Some(timing) = &config.timing {
        time::bytes(&timing.axis, pixels, row.splats)?;
    }
    Ok(())
}

/// Returns why a backend cannot render a run, or `None` if it can.
fn refusal(
    backend: &BackendRow,
    integrator: &IntegratorRow,
    scene: &SceneDesc,
    config: &Settings,
) -> Option<String> {
    if !backend.accel && !config.accel.scalar().identity().is_empty() {
        return Some(format!(
            "it does not support the hierarchy `{}`: leave out `accel`, or use `cpu` or \
             `vulkan-compute`",
            config.accel.describe()
        ));
    }
    if let Some(reason) = crate::backends::unsupported_layer(backend, &config.rendered_layers()) {
        return Some(reason);
    }
    if own::library(integrator).is_some() && config.timing.is_some() {
        return Some(format!(
            "`{}` is computed by a shared library, which returns no optical lengths: leave out \
             `film.time`",
            integrator.name
        ));
    }
    if !backend.times {
        if config.timing.is_some() {
            return Some(
                "it does not support films with a time axis: leave out `film.time`, or use `cpu`"
                    .to_owned(),
            );
        }
        if let Some(m) = scene.materials.iter().find(|m| !m.parts.is_empty()) {
            return Some(format!(
                "it does not support composed materials such as `{}`",
                m.name
            ));
        }
    }
    if !backend.blends
        && let Some(m) = scene.materials.iter().find(|m| m.is_blend())
    {
        return Some(format!(
            "it does not support a texture as the weights of a composed material, nor parts for each \
             side, as in `{}`: use `cpu`",
            m.name
        ));
    }
    if !backend.light_trees && LightSelection::from_params(&config.params) == LightSelection::Tree {
        return Some(
            "it does not choose lights by a tree: leave out `select = \"tree\"`, or use `cpu`"
                .to_owned(),
        );
    }
    if !backend.uniform_directions && has_uniform_directions(&config.params) {
        return Some(
            "it does not continue paths in uniform directions: leave out `directions = \
             \"uniform\"`, or use `cpu`"
                .to_owned(),
        );
    }
    let unsupported = scene
        .materials
        .iter()
        .find(|m| !backend.models.contains(&m.model));
    let model = |m: &desc::MaterialDesc| {
        format!(
            "it does not support the material model `{}` of `{}`",
            m.model.name(),
            m.name
        )
    };
    (backend.refuses)(integrator, &config.shaders).or_else(|| unsupported.map(model))
}

/// Hash of a table of values, used as a cache key.
fn hash_of(values: &BTreeMap<String, Value>) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    Value::Map(values.clone()).hash_into(&mut hasher);
    *hasher.finalize().as_bytes()
}
