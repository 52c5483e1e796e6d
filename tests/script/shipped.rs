//! The scripts in `scripts/` can all be planned.

use lumbre::experiment::plan::{Overrides, expand};
use lumbre::scene::load::load;

#[test]
fn every_shipped_script_can_be_planned_and_says_how_to_run_it() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut scripts: Vec<_> = std::fs::read_dir(root.join("scripts")).unwrap().map(|e| e.unwrap().path()).collect();
    scripts.retain(|file| file.extension().is_some_and(|e| e == "lua"));
    scripts.sort();
    assert!(scripts.len() >= 3, "{scripts:?}");
    for file in scripts {
        let name = file.file_name().unwrap().to_string_lossy().into_owned();
        let text = std::fs::read_to_string(&file).unwrap();
        assert!(text.starts_with("--") && text.contains(&format!("lumbre run scripts/{name}")), "{name}");
        let script = lumbre::script::load(&file).unwrap_or_else(|e| panic!("{name}: {e}"));
        // Cargo runs tests in the package's folder, from which scripts name their scenes.
        let plan = expand(&script.spec, &script, &Overrides::default(), &mut |path| load(path));
        let plan = plan.unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(!plan.cells.is_empty(), "{name}");
    }
}
