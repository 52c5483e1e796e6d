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
    let found = match kept().iter().find(|known| known.is(&scene)) {
        None => return CpuRenderer::new(scene, job),
        Some(known) => {
            let same = |(accel, threads, _): &&(AccelSpec, usize, Arc<PreparedScene>)| {
                *accel == settings && *threads == job.threads
            };
            known
                .prepared
                .iter()
                .find(same)
                .map(|(_, _, p)| Arc::clone(p))
        }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Renderer;
    use crate::hierarchy::Builder;
    use lumbre_light::scene::compile;
    use lumbre_light::scene::load::load;
    use lumbre_light::transport::integrator::integrator;

    fn job(builder: Builder, lanes: LaneMode) -> Job {
        let mut job = Job::plain(integrator("nee").unwrap(), [8, 8], 3, 7);
        job.threads = 1;
        (job.accel.builder, job.accel.lanes) = (builder, lanes);
        job
    }

    fn opened(scene: &Arc<CompiledScene>, builder: Builder, lanes: LaneMode) -> Vec<u32> {
        let mut renderer = open(Arc::clone(scene), job(builder, lanes)).unwrap();
        renderer.advance(2).unwrap();
        let image = renderer.film().mean();
        image.data.iter().flatten().map(|v| v.to_bits()).collect()
    }

    /// Number of hierarchies that are kept for a scene.
    fn count(scene: &Arc<CompiledScene>) -> usize {
        let kept = kept();
        let of_scene = kept.iter().filter(|known| known.is(scene));
        of_scene.map(|known| known.prepared.len()).sum()
    }

    #[test]
    fn runs_share_a_hierarchy_with_their_settings_until_the_keeper_goes() {
        let file = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../scenes/cornell/cornell.scn"
        );
        let (desc, _) = load(file.as_ref()).unwrap();
        let scene = Arc::new(compile(&desc).unwrap().0);
        let empty = scene_bytes(&scene);
        let alone = opened(&scene, Builder::Ploc, LaneMode::Auto);
        assert_eq!(count(&scene), 0, "nothing is kept without a keeper");
        let keeper = SceneKeeper::new(Arc::clone(&scene));
        for lanes in [LaneMode::Auto, LaneMode::Always, LaneMode::Never] {
            assert_eq!(opened(&scene, Builder::Ploc, lanes), alone);
        }
        assert_eq!(count(&scene), 1, "lanes share a hierarchy");
        assert!(scene_bytes(&scene) > empty, "its hierarchy is counted");
        let _ = opened(&scene, Builder::Sah, LaneMode::Auto);
        assert_eq!(count(&scene), 2, "another builder builds another one");
        drop(keeper);
        assert_eq!(count(&scene), 0);
    }
}
