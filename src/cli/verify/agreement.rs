//! All unbiased techniques must render the same picture of every built-in scene. Integrators with default
//! parameters are compared in pairs, and every variant with its default. Pictures are compared by
//! blocks, or as a whole if the variance is unbounded.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;
use std::sync::Arc;

use super::picture::{Attempt, NoisyPicture, Setting, confirmed, judge, render};
use super::technique::{self, Technique};
use super::{Check, SeedFamily, VerifyRequest};
use crate::cli::night::load;
use crate::cli::scene::builtin::{BuiltIn, scene_name};
use lumbre_light::scene::{CompiledScene, compile};
use lumbre_scene_io::load::MissingTextures;

/// One scene, its techniques, and a cache of pictures that several checks share.
struct SceneRenders {
    scene: Arc<CompiledScene>,
    techniques: Vec<Technique>,
    settings: Vec<Setting>,
    pictures: RefCell<BTreeMap<(usize, Attempt), Rc<NoisyPicture>>>,
}

impl SceneRenders {
    fn picture(&self, index: usize, attempt: Attempt) -> Result<Rc<NoisyPicture>, String> {
        let known = self.pictures.borrow().get(&(index, attempt)).cloned();
        match known {
            Some(picture) => Ok(picture),
            None => {
                let setting = attempt.setting(self.settings[index]);
                let picture = Rc::new(render(&self.scene, &self.techniques[index], setting)?);
                self.pictures
                    .borrow_mut()
                    .insert((index, attempt), Rc::clone(&picture));
                Ok(picture)
            }
        }
    }
}

/// Returns the pairs to compare, as indices of techniques.
fn pairs(techniques: &[Technique]) -> Vec<(usize, usize)> {
    let plain: Vec<usize> = (0..techniques.len())
        .filter(|i| techniques[*i].params.is_empty())
        .collect();
    let mut pairs = Vec::new();
    for (n, first) in plain.iter().enumerate() {
        pairs.extend(plain[..n].iter().map(|second| (*first, *second)));
    }
    for (i, technique) in techniques
        .iter()
        .enumerate()
        .filter(|(_, t)| !t.params.is_empty())
    {
        let default = plain
            .iter()
            .find(|p| techniques[**p].row.name == technique.row.name);
        pairs.extend(default.map(|d| (i, *d)));
    }
    pairs
}

/// Lists the checks among techniques.
///
/// # Errors
/// If a built-in scene cannot be loaded.
pub fn plan(request: &VerifyRequest) -> Result<Vec<Check>, String> {
    // Few samples of a block can miss a caustic, and their variance with it.
    let (side, block, samples) = if request.quick {
        (16, 8, 256)
    } else {
        (96, 12, 256)
    };
    let built_in = BuiltIn::unpack()?;
    let mut checks = Vec::new();
    let mut seeds = 0;
    for file in built_in.scenes() {
        let (desc, _) =
            load::load_scene(&file, MissingTextures::Fail).map_err(|e| e.to_string())?;
        let (scene, _) = compile(&desc).map_err(|e| e.to_string())?;
        let longest = scene.resolution[0].max(scene.resolution[1]).max(1);
        let resolution = scene.resolution.map(|n| (n * side / longest).max(1));
        let techniques: Vec<Technique> = technique::plain()
            .into_iter()
            .flat_map(with_variants)
            .collect();
        let settings = techniques.iter().map(|_| {
            seeds += 1;
            Setting {
                resolution,
                max_depth: scene.max_depth,
                samples,
                seed: request.seed(SeedFamily::Agreement, seeds),
                threads: request.threads,
                ..Setting::PLAIN
            }
        });
        let settings = settings.collect();
        let renders = Rc::new(SceneRenders {
            scene: Arc::new(scene),
            techniques,
            settings,
            pictures: RefCell::default(),
        });
        checks.extend(scene_checks(
            &scene_name(&file),
            &renders,
            resolution,
            block,
        ));
    }
    Ok(checks)
}

/// Lists the checks of one scene. Techniques of unbounded variance are compared as a whole.
fn scene_checks(
    name: &str,
    renders: &Rc<SceneRenders>,
    resolution: [u32; 2],
    block: u32,
) -> Vec<Check> {
    let check = |(first, second): (usize, usize)| {
        let techniques = [first, second].map(|i| &renders.techniques[i]);
        let compared = format!("{} with {}", techniques[0], techniques[1]);
        let block = if techniques.iter().any(|t| t.has_unbounded_variance()) {
            resolution[0].max(resolution[1])
        } else {
            block
        };
        let renders = Rc::clone(renders);
        Check::new(name, compared, move |tests| {
            confirmed(|attempt| {
                let picture = |index| renders.picture(index, attempt);
                let pictures = [picture(first)?, picture(second)?];
                Ok(judge(&pictures[0], &pictures[1], block, tests).outcome())
            })
        })
    };
    pairs(&renders.techniques).into_iter().map(check).collect()
}

/// Returns a technique followed by its variants.
fn with_variants(technique: Technique) -> Vec<Technique> {
    let mut all = technique.variants();
    all.insert(0, technique);
    all
}
