//! The shader modules of the program: which there are, and what each is made of.
//!
//! A module is SPIR-V for one stage of a pipeline. Numbers and switches of a job are specialisation
//! constants ([`crate::layout::Specialization`]). Another module exists only where types or required
//! capabilities differ: extended modules use double precision and buffer addresses, and splats are
//! summed in floats or in integers.

use std::fmt::Write;

use lumbre_light::transport::integrator::INTEGRATORS;

use super::committed;
use super::glsl::Compiler;
use super::recipe::Recipe;
use super::sources::{ShaderError, Sources, TEXTS, words};
use super::tracing_mode::TracingMode;
use crate::films::device_film::SplatMode;

/// Properties of a pipeline in which its modules differ.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Variant {
    /// Whether the modules are extended, for a time axis, instances of meshes, or texels in blocks.
    pub extended: bool,
    /// Summation of splats.
    pub splats: SplatMode,
}

/// Stage without an integrator of a ray-tracing pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HitStage {
    /// Shader of rays that hit nothing.
    Miss,
    /// Closest-hit shader of triangles.
    Triangle,
    /// Closest-hit shader of spheres.
    Sphere,
    /// Any-hit shader, which applies masks.
    Mask,
    /// Intersection shader of spheres.
    Intersection,
}

impl HitStage {
    /// All these stages.
    pub const ALL: [HitStage; 5] = [
        HitStage::Miss,
        HitStage::Triangle,
        HitStage::Sphere,
        HitStage::Mask,
        HitStage::Intersection,
    ];

    /// Returns the recipe of the stage's module, extended only if it reads triangles or texels.
    pub fn recipe(self, extended: bool) -> Recipe {
        let (stem, extension, differs) = match self {
            HitStage::Miss => ("miss", "rmiss", false),
            HitStage::Triangle => ("triangle", "rchit", true),
            HitStage::Sphere => ("sphere", "rchit", false),
            HitStage::Mask => ("mask", "rahit", true),
            HitStage::Intersection => ("sphere", "rint", true),
        };
        let (mut file, mut defines) = (stem.to_owned(), Vec::new());
        if extended && differs {
            file.push_str(".extended");
            defines.push("EXTENDED");
        }
        Recipe {
            file: format!("{file}.{extension}.spv"),
            entry: format!("entry/{stem}.{extension}"),
            text: None,
            defines,
            generated: Vec::new(),
        }
    }
}

/// Returns the path of a mode's entry below `entry`, and the extension of its modules.
fn entry(mode: TracingMode) -> (&'static str, &'static str) {
    match mode {
        TracingMode::Compute => ("compute.comp", "comp"),
        TracingMode::Query => ("query.comp", "query.comp"),
        TracingMode::Pipeline => ("generation.rgen", "rgen"),
    }
}

/// Path of the text that an integrator brings to an entry.
const GENERATED: &str = "generated/integrator.glsl";

/// Returns the recipe of the module that runs an integrator.
pub fn integrator(mode: TracingMode, name: &str, variant: Variant) -> Recipe {
    let (stem, extension) = entry(mode);
    let (splats, mut suffix) = match variant.splats {
        SplatMode::None => ("SPLAT_NONE", String::new()),
        SplatMode::Float => ("SPLAT_FLOAT", ".floats".to_owned()),
        SplatMode::Fixed => ("SPLAT_FIXED", ".integers".to_owned()),
    };
    let mut defines = vec![splats];
    if variant.extended {
        defines.push("EXTENDED");
        suffix.push_str(".extended");
    }
    let text = format!(
        "#include \"transport/integrator/{name}\"\n#define INTEGRATOR_SAMPLE {name}_sample\n"
    );
    Recipe {
        file: format!("{name}{suffix}.{extension}.spv"),
        entry: format!("entry/{stem}"),
        text: None,
        defines,
        generated: vec![(GENERATED.to_owned(), text)],
    }
}

/// Returns the recipe of the module that traces the light subpaths which the samples of an integrator
/// share.
pub fn light_paths(mode: TracingMode, name: &str, extended: bool) -> Recipe {
    let (stem, extension) = entry(mode);
    let (mut defines, mut suffix) = (vec!["SPLAT_NONE", "LIGHT_PATHS"], "");
    if extended {
        defines.push("EXTENDED");
        suffix = ".extended";
    }
    let text = format!("#include \"transport/integrator/{name}/cache.glsl\"\n");
    Recipe {
        file: format!("{name}_light_paths{suffix}.{extension}.spv"),
        entry: format!("entry/{stem}"),
        text: None,
        defines,
        generated: vec![(GENERATED.to_owned(), text)],
    }
}

/// Returns the recipe of the module that adds samples that were rendered in parallel.
pub fn sum() -> Recipe {
    without_variants("sum")
}

/// Returns the recipe of the module that lists the vertices of light subpaths.
pub fn light_list() -> Recipe {
    without_variants("light_list")
}

/// Returns the recipe of a compute shader of which there is one module.
fn without_variants(stem: &str) -> Recipe {
    Recipe {
        file: format!("{stem}.comp.spv"),
        entry: format!("entry/{stem}.comp"),
        text: None,
        defines: Vec::new(),
        generated: Vec::new(),
    }
}

/// Returns the recipes of all modules of the program, in the order of their files.
pub fn recipes() -> Vec<Recipe> {
    let mut recipes: Vec<Recipe> = Vec::new();
    let has_shader = |name: &str| Sources::Embedded.has_integrator(name);
    for row in INTEGRATORS.iter().filter(|row| has_shader(row.name)) {
        let all_splats: &[SplatMode] = match row.splats {
            false => &[SplatMode::None],
            true => &[SplatMode::Float, SplatMode::Fixed],
        };
        for mode in TracingMode::ALL {
            for splats in all_splats {
                recipes.extend([false, true].map(|extended| {
                    let splats = *splats;
                    integrator(mode, row.name, Variant { extended, splats })
                }));
            }
            if row.sharing.is_some() {
                let extended = [false, true];
                recipes.extend(extended.map(|extended| light_paths(mode, row.name, extended)));
            }
        }
    }
    for stage in HitStage::ALL {
        recipes.extend([false, true].map(|extended| stage.recipe(extended)));
    }
    recipes.extend([sum(), light_list()]);
    recipes.sort_by(|a, b| a.file.cmp(&b.file));
    recipes.dedup();
    recipes
}

impl Sources {
    /// Returns the words of a module.
    ///
    /// # Errors
    /// Returns an error if the program does not have it or, of a folder, it cannot be compiled.
    pub fn module(&self, recipe: &Recipe) -> Result<Vec<u32>, ShaderError> {
        let replaced = match self {
            Sources::Embedded => None,
            Sources::Folder(_) => return Compiler::find()?.make(self, recipe),
            Sources::Replaced(modules) => modules.iter().find(|(file, _)| *file == recipe.file),
        };
        replaced
            .map(|(_, bytes)| words(bytes))
            .or_else(|| committed::module(&recipe.file).map(|bytes| words(&bytes)))
            .ok_or_else(|| ShaderError::NoModule(recipe.file.clone()))
    }
}

/// Returns the text of `manifest.txt` beside modules: a hash of everything that they are made from,
/// and a hash of each file. Modules whose manifest differs were made from other sources.
pub fn manifest(recipes: &[Recipe], modules: &[(String, Vec<u8>)]) -> String {
    let mut hasher = blake3::Hasher::new();
    let mut add = |text: &str| {
        hasher.update(&(text.len() as u64).to_le_bytes());
        hasher.update(text.as_bytes());
    };
    for (path, text) in TEXTS {
        add(path);
        add(text);
    }
    for recipe in recipes {
        add(&recipe.file);
        add(&recipe.entry);
        add(recipe.text.as_deref().unwrap_or_default());
        recipe.defines.iter().for_each(|name| add(name));
        for (path, text) in &recipe.generated {
            add(path);
            add(text);
        }
    }
    let mut text =
        String::from("Made by `cargo shaders`; do not edit. A test compares the hashes.\n\n");
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{} sources", hasher.finalize().to_hex());
    for (file, bytes) in modules {
        let _ = writeln!(text, "{} {file}", blake3::hash(bytes).to_hex());
    }
    text
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn every_recipe_has_a_module_and_every_module_a_recipe() {
        let made: BTreeSet<String> = recipes().into_iter().map(|recipe| recipe.file).collect();
        let committed: BTreeSet<String> = committed::files().map(str::to_owned).collect();
        assert_eq!(made, committed, "run `cargo shaders`");
    }

    #[test]
    fn files_differ_where_recipes_do() {
        let recipes = recipes();
        let files: BTreeSet<&str> = recipes.iter().map(|recipe| recipe.file.as_str()).collect();
        assert_eq!(files.len(), recipes.len());
        assert!(files.len() < 60, "{} modules", files.len());
    }

    #[test]
    fn a_manifest_changes_with_a_recipe_and_with_a_module() {
        let (mut recipes, modules) = (recipes(), vec![("a.spv".to_owned(), vec![1, 2, 3, 4])]);
        let text = manifest(&recipes, &modules);
        assert_ne!(manifest(&recipes, &[("a.spv".to_owned(), vec![1])]), text);
        recipes[0].defines.push("EXTRA");
        assert_ne!(manifest(&recipes, &modules), text);
    }
}
