//! Compiled scenes that a night keeps, with the hierarchies that the CPU builds for them: cells of
//! one scene compile it once and build each hierarchy once, whatever their cameras.

use std::sync::Arc;

use crate::experiment::plan::Plan;
use crate::experiment::spec::{FigureKind, RunColumn, TableValue};
use lumbre_light::scene::compile::Sharing;
use lumbre_light::scene::desc::content_hash;
use lumbre_light::scene::{CompiledScene, Note, SceneDesc, SceneError};
use lumbre_render::View;
use lumbre_render::cpu::kept_scenes::{SceneKeeper, scene_bytes};

/// Fraction of the free memory that kept scenes may take, as its reciprocal.
pub(super) const SHARE: u64 = 8;

/// Bytes that kept scenes may take where the system states no limit.
pub(super) const WITHOUT_LIMIT: u64 = 1 << 30;

/// Greatest number of scenes that are kept. In a sweep of thousands of scenes, looking through more
/// would take longer than compiling a small one.
const MAX_SCENES: usize = 64;

/// Scenes of a night, the one used last at the end.
pub(super) struct SceneCache {
    scenes: Vec<CachedScene>,
    /// Whether hierarchies are kept with their scenes.
    hierarchies: bool,
}

struct CachedScene {
    /// Hash of the description without its camera.
    hash: [u8; 32],
    sharing: Sharing,
    compiled: Arc<CompiledScene>,
    _keeper: Option<SceneKeeper>,
}

/// The scene of a run.
#[derive(Clone)]
pub(super) struct RunScene {
    /// A compiled scene that differs from the run's at most in its camera.
    pub(super) compiled: Arc<CompiledScene>,
    /// The run's camera, if the compiled scene has another one.
    pub(super) view: Option<View>,
}

impl RunScene {
    /// Returns a compiled scene through the camera of a description, with notes about the camera.
    pub(super) fn new(
        compiled: Arc<CompiledScene>,
        desc: &SceneDesc,
    ) -> Result<(RunScene, Vec<Note>), SceneError> {
        let (hash, mut notes) = (content_hash(desc), Vec::new());
        let view = if hash == compiled.content_hash {
            None
        } else {
            Some(View {
                camera: compiled.placed_camera(&desc.camera, &mut notes)?,
                content_hash: hash,
            })
        };
        Ok((RunScene { compiled, view }, notes))
    }
}

impl SceneCache {
    /// Creates an empty cache for a plan. Where build times are among the results, every run builds
    /// its hierarchy, so that repeats measure it several times.
    pub(super) fn new(plan: &Plan) -> SceneCache {
        let swept = plan.figures.iter().flat_map(|figure| match &figure.kind {
            FigureKind::Sweep { y, .. } => y.as_slice(),
            FigureKind::Convergence { .. } => &[],
        });
        let mut shown = plan.tables.iter().map(|table| &table.value).chain(swept);
        SceneCache {
            scenes: Vec::new(),
            hierarchies: !shown.any(|value| *value == TableValue::Run(RunColumn::AccelBuildS)),
        }
    }

    /// Returns a compiled scene, if it is cached.
    pub(super) fn get(&mut self, hash: [u8; 32], sharing: Sharing) -> Option<Arc<CompiledScene>> {
        let is_same = |cached: &CachedScene| (cached.hash, cached.sharing) == (hash, sharing);
        let index = self.scenes.iter().position(is_same)?;
        let cached = self.scenes.remove(index);
        let compiled = Arc::clone(&cached.compiled);
        self.scenes.push(cached);
        Some(compiled)
    }

    /// Adds a scene, and drops the one that was used least recently if there are too many.
    pub(super) fn add(&mut self, hash: [u8; 32], sharing: Sharing, compiled: Arc<CompiledScene>) {
        let keeper = self
            .hierarchies
            .then(|| SceneKeeper::new(Arc::clone(&compiled)));
        if self.scenes.len() >= MAX_SCENES {
            self.scenes.remove(0);
        }
        self.scenes.push(CachedScene {
            hash,
            sharing,
            compiled,
            _keeper: keeper,
        });
    }

    /// Drops the scenes that were used least recently until the others take at most this many
    /// bytes.
    pub(super) fn shrink_to(&mut self, bytes: u64) {
        let mut left = bytes;
        let mut newest_first = self.scenes.iter().rev();
        let fitting =
            newest_first.position(
                |cached| match left.checked_sub(scene_bytes(&cached.compiled)) {
                    Some(rest) => {
                        left = rest;
                        false
                    }
                    None => true,
                },
            );
        if let Some(kept) = fitting {
            self.scenes.drain(..self.scenes.len() - kept);
        }
    }

    /// Drops all scenes; runs that use one keep it until they end.
    pub(super) fn clear(&mut self) {
        self.scenes.clear();
    }

    /// Bytes of all scenes.
    pub(super) fn bytes(&self) -> u64 {
        let bytes = self
            .scenes
            .iter()
            .map(|cached| scene_bytes(&cached.compiled));
        bytes.sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumbre_light::scene::compile::compile;
    use lumbre_light::scene::desc::hash_without_camera;
    use lumbre_scene_io::load::load;

    fn scene(file: &str) -> SceneDesc {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
        load(&path.join(file)).unwrap().0
    }

    fn cache() -> SceneCache {
        SceneCache {
            scenes: Vec::new(),
            hierarchies: true,
        }
    }

    #[test]
    fn the_scene_used_least_recently_goes_first() {
        let mut cache = cache();
        let [first, second] = ["cornell/cornell.scn", "edges/edges.scn"].map(|file| {
            let desc = scene(file);
            let hash = hash_without_camera(&desc);
            cache.add(hash, Sharing::Auto, Arc::new(compile(&desc).unwrap().0));
            hash
        });
        let all = cache.bytes();
        cache.shrink_to(all);
        let used = cache.get(first, Sharing::Auto).unwrap();
        assert!(cache.get(first, Sharing::Never).is_none());
        cache.shrink_to(all - 1);
        assert!(cache.get(second, Sharing::Auto).is_none());
        assert!(Arc::ptr_eq(
            &cache.get(first, Sharing::Auto).unwrap(),
            &used
        ));
        cache.shrink_to(0);
        assert!(cache.get(first, Sharing::Auto).is_none());
    }

    #[test]
    fn a_scene_has_the_camera_of_its_description() {
        let desc = scene("cornell/cornell.scn");
        let compiled = Arc::new(compile(&desc).unwrap().0);
        let seen = |desc: &SceneDesc| RunScene::new(Arc::clone(&compiled), desc);
        assert!(seen(&desc).unwrap().0.view.is_none());
        let mut moved = desc.clone();
        moved.camera.up = moved.camera.target - moved.camera.position;
        let (scene, notes) = seen(&moved).unwrap();
        let (alone, all_notes) = compile(&moved).unwrap();
        let view = scene.view.unwrap();
        assert_eq!(view.camera, alone.camera);
        assert_eq!(view.content_hash, alone.content_hash);
        assert!(
            notes.len() == 1 && all_notes.contains(&notes[0]),
            "{notes:?}"
        );
        moved.camera.target = moved.camera.position;
        assert_eq!(
            seen(&moved).err().unwrap().to_string(),
            compile(&moved).unwrap_err().to_string()
        );
    }

    #[test]
    fn a_limited_number_of_scenes_is_kept() {
        let mut cache = cache();
        let compiled = compile(&scene("cornell/cornell.scn")).unwrap().0;
        for i in 0..=MAX_SCENES {
            cache.add([i as u8; 32], Sharing::Auto, Arc::new(compiled.clone()));
        }
        assert!(cache.get([0; 32], Sharing::Auto).is_none());
        assert!(cache.get([1; 32], Sharing::Auto).is_some());
    }
}
