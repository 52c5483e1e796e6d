//! All techniques show the same picture of every built-in scene: integrators with their defaults in pairs, and every
//! variant of one against its default; by blocks, or as a whole where variance has no bound.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;
use std::sync::Arc;

use super::picture::{Picture, Setting, judge, render};
use super::technique::{self, Technique};
use super::{Check, Request};
use crate::cli::builtin::{BuiltIn, short};
use crate::cli::load;
use crate::scene::load::Missing;
use crate::scene::{CompiledScene, compile};

/// Marks the seeds of these checks.
const KIND: u64 = 2;

/// One scene with every technique and the pictures that were rendered so far, of which several checks need the same.
struct Stage {
    scene: Arc<CompiledScene>,
    techniques: Vec<Technique>,
    settings: Vec<Setting>,
    pictures: RefCell<BTreeMap<usize, Rc<Picture>>>,
}

impl Stage {
    fn picture(&self, index: usize) -> Result<Rc<Picture>, String> {
        let known = self.pictures.borrow().get(&index).cloned();
        match known {
            Some(picture) => Ok(picture),
            None => {
                let picture = Rc::new(render(&self.scene, &self.techniques[index], self.settings[index])?);
                self.pictures.borrow_mut().insert(index, Rc::clone(&picture));
                Ok(picture)
            }
        }
    }
}

/// Every pair to be compared, as indices of the techniques.
fn pairs(techniques: &[Technique]) -> Vec<(usize, usize)> {
    let plain: Vec<usize> = (0..techniques.len()).filter(|i| techniques[*i].params.is_empty()).collect();
    let mut pairs = Vec::new();
    for (n, first) in plain.iter().enumerate() {
        pairs.extend(plain[..n].iter().map(|second| (*first, *second)));
    }
    for (i, technique) in techniques.iter().enumerate().filter(|(_, t)| !t.params.is_empty()) {
        let default = plain.iter().find(|p| techniques[**p].row.name == technique.row.name);
        pairs.extend(default.map(|d| (i, *d)));
    }
    pairs
}

/// The checks of this kind.
///
/// # Errors
/// When a built-in scene cannot be loaded.
pub fn plan(request: &Request) -> Result<Vec<Check>, String> {
    let (side, block, samples) = if request.quick { (24, 8, 64) } else { (96, 12, 256) };
    let built_in = BuiltIn::unpack()?;
    let mut checks = Vec::new();
    let mut seeds = 0;
    for file in built_in.scenes() {
        let (desc, _) = load::scene(&file, Missing::Refused).map_err(|e| e.to_string())?;
        let (scene, _) = compile(&desc).map_err(|e| e.to_string())?;
        let longest = scene.resolution[0].max(scene.resolution[1]).max(1);
        let resolution = scene.resolution.map(|n| (n * side / longest).max(1));
        let techniques: Vec<Technique> = technique::plain().into_iter().flat_map(with_variants).collect();
        let settings = techniques.iter().map(|_| {
            seeds += 1;
            let (seed, threads) = (request.seed(KIND, seeds), request.threads);
            Setting { resolution, max_depth: scene.max_depth, rr_start: None, samples, seed, threads }
        });
        let settings = settings.collect();
        let stage = Rc::new(Stage { scene: Arc::new(scene), techniques, settings, pictures: RefCell::default() });
        for (first, second) in pairs(&stage.techniques) {
            let compared = format!("{} with {}", stage.techniques[first], stage.techniques[second]);
            let wild = [first, second].iter().any(|i| stage.techniques[*i].is_wild());
            let block = if wild { resolution[0].max(resolution[1]) } else { block };
            let stage = Rc::clone(&stage);
            checks.push(Check::new(short(&file), compared, move |tests| {
                Ok(judge(&*stage.picture(first)?, &*stage.picture(second)?, block, tests).outcome())
            }));
        }
    }
    Ok(checks)
}

fn with_variants(technique: Technique) -> Vec<Technique> {
    let mut all = technique.variants();
    all.insert(0, technique);
    all
}
