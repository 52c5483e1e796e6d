//! Compiled scenes that a night keeps, with the hierarchies that the CPU builds for them: cells of
//! one scene compile it once and build each hierarchy once.

use std::sync::Arc;

use super::active_run::RunRequest;
use super::open::catch_panic;
use super::state::NightRunner;
use crate::experiment::memory;
use crate::experiment::outcome::Level;
use crate::experiment::plan::Plan;
use crate::experiment::spec::{FigureKind, RunColumn, TableValue};
use lumbre_light::scene::compile::{Sharing, compile_sharing};
use lumbre_light::scene::{CompiledScene, SceneDesc};
use lumbre_render::cpu::kept_bytes;
use lumbre_render::cpu::kept_scenes::{SceneKeeper, scene_bytes};

/// Fraction of the free memory that kept scenes may take, as its reciprocal.
const SHARE: u64 = 8;

/// Bytes that kept scenes may take where the system states no limit.
const WITHOUT_LIMIT: u64 = 1 << 30;

/// Scenes of a night, the one used last at the end.
pub(super) struct SceneCache {
    scenes: Vec<CachedScene>,
    /// Whether hierarchies are kept with their scenes.
    hierarchies: bool,
}

struct CachedScene {
    desc: Arc<SceneDesc>,
    sharing: Sharing,
    compiled: Arc<CompiledScene>,
    _keeper: Option<SceneKeeper>,
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
    fn get(&mut self, desc: &Arc<SceneDesc>, sharing: Sharing) -> Option<Arc<CompiledScene>> {
        let is_same =
            |cached: &CachedScene| Arc::ptr_eq(&cached.desc, desc) && cached.sharing == sharing;
        let index = self.scenes.iter().position(is_same)?;
        let cached = self.scenes.remove(index);
        let compiled = Arc::clone(&cached.compiled);
        self.scenes.push(cached);
        Some(compiled)
    }

    /// Adds a scene.
    fn add(&mut self, desc: &Arc<SceneDesc>, sharing: Sharing, compiled: Arc<CompiledScene>) {
        let keeper = self
            .hierarchies
            .then(|| SceneKeeper::new(Arc::clone(&compiled)));
        self.scenes.push(CachedScene {
            desc: Arc::clone(desc),
            sharing,
            compiled,
            _keeper: keeper,
        });
    }

    /// Drops the scenes that were used least recently until the others take at most this many
    /// bytes.
    fn shrink_to(&mut self, bytes: u64) {
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
    fn bytes(&self) -> u64 {
        let bytes = self
            .scenes
            .iter()
            .map(|cached| scene_bytes(&cached.compiled));
        bytes.sum()
    }
}

impl NightRunner<'_, '_> {
    /// Returns the compiled scene of a run, from the cache if it is there.
    pub(super) fn compiled(
        &mut self,
        request: &RunRequest<'_>,
    ) -> Result<Arc<CompiledScene>, String> {
        let sharing = request.config.accel.instances;
        if let Some(compiled) = self.scenes.get(request.scene, sharing) {
            return Ok(compiled);
        }
        // Dropped first, so that two large scenes need not fit into memory.
        let kept = kept_bytes() + self.scenes.bytes();
        let free = memory::free(self.options.memory, kept);
        self.scenes
            .shrink_to(free.map_or(WITHOUT_LIMIT, |limit| limit.bytes / SHARE));
        let (compiled, notes) = catch_panic("compiling the scene", || {
            compile_sharing(request.scene, sharing)
        })?
        .map_err(|e| e.to_string())?;
        let compiled = Arc::new(compiled);
        self.scenes
            .add(request.scene, sharing, Arc::clone(&compiled));
        for note in notes {
            if self.reported_notes.insert(note.clone()) {
                self.emit_message(Level::Warn, request.cell, note.to_string())?;
            }
        }
        Ok(compiled)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumbre_light::scene::compile::compile;
    use lumbre_light::scene::load::load;

    fn scene(file: &str) -> Arc<SceneDesc> {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
        Arc::new(load(&path).unwrap().0)
    }

    #[test]
    fn the_scene_used_least_recently_goes_first() {
        let mut cache = SceneCache {
            scenes: Vec::new(),
            hierarchies: true,
        };
        let [first, second] =
            ["cornell/cornell.scn", "edges/edges.scn"].map(|file| scene(&format!("scenes/{file}")));
        for desc in [&first, &second] {
            let compiled = Arc::new(compile(desc).unwrap().0);
            cache.add(desc, Sharing::Auto, compiled);
        }
        let all = cache.bytes();
        cache.shrink_to(all);
        let used = cache.get(&first, Sharing::Auto).unwrap();
        assert!(cache.get(&first, Sharing::Never).is_none());
        cache.shrink_to(all - 1);
        assert!(cache.get(&second, Sharing::Auto).is_none());
        assert!(Arc::ptr_eq(
            &cache.get(&first, Sharing::Auto).unwrap(),
            &used
        ));
        cache.shrink_to(0);
        assert!(cache.get(&first, Sharing::Auto).is_none());
    }
}
