//! The script in the README can be planned.

use lumbre_lua::scene;
use lumbre_night::experiment::plan::{Overrides, expand};
use lumbre_scene_io::load::MissingTextures;

#[test]
fn the_script_in_the_readme_can_be_planned() {
    let readme =
        std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/README.md")).unwrap();
    let text = readme
        .split("```lua\n")
        .nth(1)
        .and_then(|rest| rest.split("```").next())
        .unwrap();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("readme.lua");
    std::fs::write(&file, text).unwrap();
    let script = lumbre_lua::load(&file).unwrap();
    let plan = expand(
        &script.spec,
        &script,
        &Overrides::default(),
        &mut |path, options| scene::read(path, options, MissingTextures::Fail),
    )
    .unwrap();
    // Three techniques, three repeats.
    assert_eq!(plan.cells.len(), 3 * 3);
    assert!(plan.skipped.is_empty());
}
