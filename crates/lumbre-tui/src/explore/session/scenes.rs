//! The scenes of a session, kept with their hierarchies as long as requests use them.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use super::shared::{LoadedScene, Request, SLOTS, SessionOptions};
use crate::explore::settings::{SceneFacts, SceneFile, is_camera_change};
use lumbre_light::scene::compile::compile_sharing;
use lumbre_light::scene::desc::SceneDesc;
use lumbre_light::scene::{CompiledScene, desc};
use lumbre_light::transport::integrator::external::is_external;
use lumbre_light::value::Value;
use lumbre_night::backends;
use lumbre_render::Settings;
use lumbre_render::cpu;
use lumbre_render::cpu::prepared_scene::PreparedScene;
use lumbre_render::{Job, Renderer, View};
use lumbre_scene_io::edit;

/// Number of scenes that are kept: one for each picture.
const CAPACITY: usize = SLOTS;

/// A scene with all changes but those of the camera.
struct KnownScene {
    file: SceneFile,
    changes: BTreeMap<String, Value>,
    loaded: Arc<LoadedScene>,
    /// The compiled scene, for backends that open a run with it.
    compiled: Arc<CompiledScene>,
}

/// The scenes that were used last.
pub struct Scenes {
    options: SessionOptions,
    known: Vec<KnownScene>,
}

/// Everything that opens a run.
pub struct Opened {
    /// The scene of the run.
    pub scene: Arc<LoadedScene>,
    /// The run in progress.
    pub renderer: Box<dyn Renderer>,
    /// Job of the run, with its camera.
    pub job: Job,
}

impl Scenes {
    /// Creates an empty list.
    pub fn new(options: SessionOptions) -> Scenes {
        Scenes {
            options,
            known: Vec::new(),
        }
    }

    /// Returns whether the scene of a request is loaded.
    pub fn knows(&self, request: &Request) -> bool {
        self.known.iter().any(|known| known.file == request.scene)
    }

    /// Opens a run.
    ///
    /// # Errors
    /// Returns a message if a setting is out of range, the scene cannot be read, or the backend
    /// cannot render it.
    pub fn open(&mut self, request: &Request) -> Result<Opened, String> {
        let config = lumbre_lua::render_settings(&request.table, Path::new("."))
            .map_err(|e| e.to_string())?;
        let (camera_changes, changes): (BTreeMap<_, _>, BTreeMap<_, _>) = config
            .set
            .clone()
            .into_iter()
            .partition(|(path, _)| is_camera_change(path));
        let index = self.find(&request.scene, changes, &config)?;
        let known = &self.known[index];
        let facts = &known.loaded.facts;
        let camera = facts.camera_with(&camera_changes)?;
        let camera = known.compiled.placed_camera(&camera, &mut Vec::new());
        let camera = camera.map_err(|e| e.to_string())?;
        let job = config.job(
            known.compiled.resolution,
            facts.max_depth,
            self.options.threads,
        )?;
        if is_external(job.integrator) {
            return Err(format!(
                "`{}` is a technique of another program; `lumbre render` renders it",
                config.integrator
            ));
        }
        let job = Job {
            seed: request.seed,
            view: Some(View {
                camera,
                content_hash: known.compiled.content_hash,
            }),
            ..job
        };
        let renderer: Box<dyn Renderer> = match &known.loaded.prepared {
            Some(prepared) => {
                let opened = prepared.open(job.clone());
                Box::new(opened.map_err(|e| e.to_string())?)
            }
            None => {
                let scene = Arc::clone(&known.compiled);
                let opened = backends::open(&self.options.backend, scene, job.clone());
                opened.map_err(|e| e.to_string())?
            }
        };
        Ok(Opened {
            scene: Arc::clone(&known.loaded),
            renderer,
            job,
        })
    }

    /// Returns the index of a scene with changes, which is loaded if it is not known.
    fn find(
        &mut self,
        file: &SceneFile,
        changes: BTreeMap<String, Value>,
        config: &Settings,
    ) -> Result<usize, String> {
        let same = |known: &KnownScene| known.file == *file && known.changes == changes;
        if let Some(index) = self.known.iter().position(same) {
            // The scene that was used last is the last one to be dropped.
            let known = self.known.remove(index);
            self.known.push(known);
            return Ok(self.known.len() - 1);
        }
        if self.known.len() >= CAPACITY {
            self.known.remove(0);
        }
        let (mut scene, notes) =
            lumbre_lua::scene::read(&file.path, &file.options, self.options.missing)
                .map_err(|e| e.to_string())?;
        edit::apply(&mut scene, &changes).map_err(|e| e.to_string())?;
        desc::delay::check(&scene).map_err(|e| e.to_string())?;
        let (compiled, more) =
            compile_sharing(&scene, config.accel.instances).map_err(|e| e.to_string())?;
        let compiled = Arc::new(compiled);
        let prepared = if self.options.backend == cpu::ROW.name {
            let threads = self.options.threads;
            let prepared = PreparedScene::new(Arc::clone(&compiled), &config.accel, threads);
            Some(Arc::new(prepared.map_err(|e| e.to_string())?))
        } else {
            None
        };
        self.known.push(KnownScene {
            loaded: Arc::new(LoadedScene {
                file: file.clone(),
                facts: SceneFacts::new(&scene),
                notes: notes.iter().chain(&more).map(ToString::to_string).collect(),
                materials: material_names(&scene),
                prepared,
            }),
            file: file.clone(),
            changes,
            compiled,
        });
        Ok(self.known.len() - 1)
    }
}

/// Returns the names of the materials of a scene.
fn material_names(scene: &SceneDesc) -> Vec<String> {
    scene.materials.iter().map(|m| m.name.clone()).collect()
}
