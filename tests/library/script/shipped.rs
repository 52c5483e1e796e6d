//! Every script in `scripts/` can be planned, and its header states how to run it.

use lumbre_lua::scene;
use lumbre_night::experiment::plan::{Overrides, expand};
use lumbre_scene_io::load::MissingTextures;

#[test]
fn every_shipped_script_is_planned_without_a_warning() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/scripts");
    let mut scripts: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().path())
        .collect();
    scripts.retain(|p| p.extension().is_some_and(|e| e == "lua"));
    assert!(scripts.len() >= 3);
    for file in scripts {
        let name = file.file_name().unwrap().to_string_lossy().into_owned();
        let text = std::fs::read_to_string(&file).unwrap();
        assert!(
            text.starts_with("-- ") && text.contains(&format!("lumbre run scripts/{name}")),
            "{name}"
        );
        let script = lumbre_lua::load(&file).unwrap_or_else(|e| panic!("{name}: {e}"));
        let plan = expand(
            &script.spec,
            &script,
            &Overrides::default(),
            &mut |path, options| scene::read(path, options, MissingTextures::Fail),
        )
        .unwrap_or_else(|e| panic!("{name}: {e}"));
        // Cells that need a program which is not installed are left out.
        let planned = !plan.cells.is_empty() || !plan.absent().is_empty();
        assert!(planned && plan.notes.is_empty(), "{name}: {:?}", plan.notes);
        // The bias of denoised pictures is what the study of the denoiser measures.
        let is_expected = |warning: &String| {
            name == "denoiser_parameters.lua" && warning.contains("are denoised")
        };
        let mut warnings = plan.warnings.clone();
        warnings.retain(|warning| !is_expected(warning));
        assert!(warnings.is_empty(), "{name}: {warnings:?}");
    }
}
