//! Hierarchies that outlive a run, so that the runs of a night on one scene build each of them
//! once. A caller that wants this holds a [`SceneKeeper`]; without one, every run builds its own.
//! Kept hierarchies with the same number of threads share their threads.
//!
//! Building is outside the render clock, and traversal only reads a hierarchy, so that neither
//! pictures nor render times depend on whether it was built for this run.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::bvh::simd::Isa;
use super::prepared_scene::{PreparedScene, RenderThreads};
use super::renderer::CpuRenderer;
use crate::hierarchy::{AccelSpec, LaneMode};
use crate::{Job, RenderError};
use lumbre_light::scene::CompiledScene;

/// Prepared forms of a scene, with the settings of the hierarchy and the number of threads.
type Prepared = Vec<(AccelSpec, usize, Arc<PreparedScene>)>;

/// Prepared forms of the scenes with a keeper, by the [`address`] of the scene.
static KEPT: Mutex<BTreeMap<usize, Prepared>> = Mutex::new(BTreeMap::new());

fn kept() -> MutexGuard<'static, BTreeMap<usize, Prepared>> {
    KEPT.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns the address of a scene, which no other has as long as its keeper holds it.
fn address(scene: &Arc<CompiledScene>) -> usize {
    Arc::as_ptr(scene) as usize
}

/// Keeps the hierarchies that the CPU backend builds for one compiled scene, until it is dropped.
pub struct SceneKeeper {
    scene: Arc<CompiledScene>,
}

impl SceneKeeper {
    /// Keeps what is built for a scene from now on. A scene has at most one keeper.
    pub fn new(scene: Arc<CompiledScene>) -> SceneKeeper {
        kept().insert(address(&scene), Vec::new());
        SceneKeeper { scene }
    }
}

impl Drop for SceneKeeper {
    fn drop(&mut self) {
        kept().remove(&address(&self.scene));
    }
}

/// Returns the bytes of the geometry and textures of a scene, and of the hierarchies that are kept
/// for it.
pub fn scene_bytes(scene: &Arc<CompiledScene>) -> u64 {
    let kept = kept();
    let of_scene = kept.get(&address(scene)).into_iter().flatten();
    let hierarchies = of_scene.map(|(_, _, prepared)| prepared.accel.bytes());
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
        ..job.settings.accel
    };
    let find = |known: &Prepared| {
        let same = |(accel, threads, _): &&(AccelSpec, usize, _)| {
            *accel == settings && *threads == job.threads
        };
        known.iter().find(same).map(|known| Arc::clone(&known.2))
    };
    // The lock is released before a hierarchy is built.
    let kept_scene = kept().get(&address(&scene)).map(find);
    let Some(found) = kept_scene else {
        return CpuRenderer::new(scene, job);
    };
    let prepared = match found {
        Some(prepared) => prepared,
        None => {
            let threads = match kept_threads(job.threads) {
                Some(threads) => threads,
                None => RenderThreads::start(job.threads)?,
            };
            let of_scene = Arc::clone(&scene);
            let built = PreparedScene::on_threads(threads, of_scene, &settings, Isa::detect())?;
            let built = Arc::new(built);
            if let Some(known) = kept().get_mut(&address(&scene)) {
                known.push((settings, job.threads, Arc::clone(&built)));
            }
            built
        }
    };
    CpuRenderer::open(&prepared, job)
}

/// Returns the threads of any kept hierarchy with this number of them.
fn kept_threads(count: usize) -> Option<Arc<RenderThreads>> {
    let kept = kept();
    let mut all = kept.values().flatten();
    let same = all.find(|(_, threads, _)| *threads == count);
    same.map(|(_, _, prepared)| Arc::clone(&prepared.threads))
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumbre_light::scene::compile::compile;
    use lumbre_light::transport::integrator::INTEGRATORS;
    use lumbre_scene_io::load::load;

    #[test]
    fn kept_hierarchies_share_their_threads() {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
        let (desc, _) = load(&root.join("../../scenes/cornell/cornell.scn")).unwrap();
        let scenes = [0, 1].map(|_| Arc::new(compile(&desc).unwrap().0));
        let keepers = scenes.each_ref().map(|s| SceneKeeper::new(Arc::clone(s)));
        let mut job = Job::plain(&INTEGRATORS[0], [4, 4], 2, 1);
        // No other test has this number of threads.
        job.threads = 5;
        let _runs = scenes
            .each_ref()
            .map(|s| open(Arc::clone(s), job.clone()).unwrap());
        let threads = scenes.each_ref().map(|scene| {
            let kept = kept();
            Arc::clone(&kept[&address(scene)][0].2.threads)
        });
        assert!(Arc::ptr_eq(&threads[0], &threads[1]));
        // Another run on the scene has as many threads as it asks for.
        job.threads = 6;
        let _other = open(Arc::clone(&scenes[0]), job).unwrap();
        let counts: Vec<usize> = kept()[&address(&scenes[0])]
            .iter()
            .map(|(_, threads, _)| *threads)
            .collect();
        assert_eq!(counts, [5, 6]);
        drop(keepers);
        assert!(kept_threads(5).is_none());
    }
}
