//! Hierarchies that outlive a run, so that the runs of a night on one scene build each of them
//! once. A caller that wants this holds a [`SceneKeeper`]; without one, every run builds its own.
//!
//! Building is outside the render clock, and traversal only reads a hierarchy, so that neither
//! pictures nor render times depend on whether it was built for this run.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::prepared_scene::PreparedScene;
use super::renderer::CpuRenderer;
use crate::hierarchy::{AccelSpec, LaneMode};
use crate::{Job, RenderError};
use lumbre_light::scene::CompiledScene;

/// Scenes with a keeper, and their prepared forms.
static KEPT: Mutex<Vec<KeptScene>> = Mutex::new(Vec::new());

/// A scene with a keeper.
struct KeptScene {
    scene: Arc<CompiledScene>,
    /// Prepared scenes by the settings of the hierarchy and the number of threads.
    prepared: Vec<(AccelSpec, usize, Arc<PreparedScene>)>,
}

fn kept() -> MutexGuard<'static, Vec<KeptScene>> {
    KEPT.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Keeps the hierarchies that the CPU backend builds for one compiled scene, until it is dropped.
pub struct SceneKeeper {
    scene: Arc<CompiledScene>,
}

impl SceneKeeper {
    /// Keeps what is built for a scene from now on. A scene has at most one keeper.
    pub fn new(scene: Arc<CompiledScene>) -> SceneKeeper {
        kept().push(KeptScene {
            scene: Arc::clone(&scene),
            prepared: Vec::new(),
        });
        SceneKeeper { scene }
    }
}

impl Drop for SceneKeeper {
    fn drop(&mut self) {
        kept().retain(|known| !known.is(&self.scene));
    }
}

impl KeptScene {
    fn is(&self, scene: &Arc<CompiledScene>) -> bool {
        Arc::ptr_eq(&self.scene, scene)
    }
}

/// Returns the bytes of the geometry and textures of a scene, and of the hierarchies that are kept
/// for it.
pub fn scene_bytes(scene: &Arc<CompiledScene>) -> u64 {
    let kept = kept();
    let of_scene = kept.iter().filter(|known| known.is(scene));
    let hierarchies = of_scene
        .flat_map(|known| &known.prepared)
        .map(|(_, _, prepared)| prepared.accel.bytes());
    let arrays = scene.memory();
    arrays.geometry + arrays.textures + hierarchies.sum::<usize>() as u64
}

/// Opens a run, with the kept hierarchy of the scene if it has a keeper.
///
/// # Errors
/// Returns an error in the cases of [`CpuRenderer::new`].
pub(super) fn open(scene: Arc<CompiledScene>, job: Job) -> Result<CpuRenderer, RenderError> {
    let settings = AccelSpec {
        // Lanes are a property of the run, not of the hierarchy.
        lanes: LaneMode::Auto,
        ..job.accel
    };
    let same = |(accel, threads, _): &&(AccelSpec, usize, Arc<PreparedScene>)| {
        *accel == settings && *threads == job.threads
    };
    let find = |known: &KeptScene| {
        let found = known.prepared.iter().find(same);
        found.map(|(_, _, prepared)| Arc::clone(prepared))
    };
    // The lock is released before a hierarchy is built.
    let kept_scene = kept().iter().find(|known| known.is(&scene)).map(find);
    let Some(found) = kept_scene else {
        return CpuRenderer::new(scene, job);
    };
    let prepared = match found {
        Some(prepared) => prepared,
        None => {
            let built = PreparedScene::new(Arc::clone(&scene), &settings, job.threads)?;
            let built = Arc::new(built);
            if let Some(known) = kept().iter_mut().find(|known| known.is(&scene)) {
                let entry = (settings, job.threads, Arc::clone(&built));
                known.prepared.push(entry);
            }
            built
        }
    };
    CpuRenderer::open(&prepared, &scene.camera, job)
}
