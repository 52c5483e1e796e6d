//! The committed SPIR-V belongs to the shaders. Needs neither a device nor the compiler of shaders.

use std::path::Path;

use lumbre_vulkan::pipelines::modules::{manifest, recipes};
use lumbre_vulkan::pipelines::recipe::Recipe;
use lumbre_vulkan::pipelines::test_kernel;

use super::source::root;

/// Returns a message if a folder's manifest is not that of these recipes and the folder's modules.
fn stale(folder: &Path, recipes: &[Recipe]) -> Option<String> {
    let read = |recipe: &Recipe| {
        let bytes = std::fs::read(folder.join(&recipe.file)).unwrap_or_default();
        (recipe.file.clone(), bytes)
    };
    let modules: Vec<(String, Vec<u8>)> = recipes.iter().map(read).collect();
    let committed = std::fs::read_to_string(folder.join("manifest.txt")).unwrap_or_default();
    let made = manifest(recipes, &modules);
    let differing = made.lines().find(|line| !committed.contains(line))?;
    Some(format!(
        "the SPIR-V in {} does not belong to the shaders, make it by `cargo shaders`: \
         {differing}",
        folder.display()
    ))
}

/// Returns the folder of the program's modules.
fn program() -> std::path::PathBuf {
    root().join("crates/lumbre-vulkan/spirv")
}

#[test]
fn the_committed_modules_belong_to_the_shaders() {
    assert_eq!(stale(&program(), &recipes()), None);
    let tests = root().join("tests/device/parity");
    let kernels = test_kernel::recipes(&tests).unwrap();
    assert!(kernels.len() > 10);
    assert_eq!(stale(&tests.join("spirv"), &kernels), None);
}

#[test]
fn a_changed_recipe_and_a_missing_module_are_found() {
    let mut recipes = recipes();
    recipes[0].generated[0].1.push_str("// changed");
    assert!(stale(&program(), &recipes).unwrap().contains("sources"));
    let empty = tempfile::tempdir().unwrap();
    assert!(stale(empty.path(), &recipes).is_some());
}
