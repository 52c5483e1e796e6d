//! Every script in `scripts/` and `scripts/theses/` can be planned, and its header states how to run
//! it.

use std::path::{Path, PathBuf};

use lumbre_light::value::Value;
use lumbre_lua::scene;
use lumbre_night::experiment::plan::{LoadScene, Overrides, Plan, PlanError, expand};
use lumbre_scene_io::load::MissingTextures;

/// Scripts whose subject is the bias of denoised pictures, of which plans warn.
const DENOISED: [&str; 2] = ["denoiser_parameters.lua", "s0_section_6_3.lua"];

/// Returns the scripts of a folder of the repository, in the order of their names.
pub(super) fn scripts(folder: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let entries = std::fs::read_dir(folder).unwrap();
    let mut scripts: Vec<_> = entries.map(|e| e.unwrap().path()).collect();
    scripts.retain(|p| p.extension().is_some_and(|e| e == "lua"));
    scripts.sort();
    scripts
}

/// Plans a script with some axes set.
pub(super) fn planned(
    file: &Path,
    axes: &[(String, Vec<Value>)],
    load: &mut LoadScene<'_>,
) -> Result<Plan, PlanError> {
    let script = lumbre_lua::load(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let overrides = Overrides {
        axes: axes.to_vec(),
        ..Overrides::default()
    };
    expand(&script.spec, &script, &overrides, load)
}

/// Checks the header of a script and its plan with some axes set.
fn check(file: &Path, folder: &str, axes: &[(String, Vec<Value>)]) {
    let name = file.file_name().unwrap().to_string_lossy().into_owned();
    let text = std::fs::read_to_string(file).unwrap();
    assert!(
        text.starts_with("-- ") && text.contains(&format!("lumbre run {folder}/{name}")),
        "{name}"
    );
    let plan = planned(file, axes, &mut |path, options| {
        scene::read(path, options, MissingTextures::Fail)
    })
    .unwrap_or_else(|e| panic!("{name}: {e}"));
    // Cells that need a program which is not installed are left out.
    let planned = !plan.cells.is_empty() || !plan.absent().is_empty();
    assert!(planned && plan.notes.is_empty(), "{name}: {:?}", plan.notes);
    // The estimator of S0 converges to a picture of its own, which is its reference.
    let is_expected = |warning: &String| {
        DENOISED.contains(&name.as_str()) && warning.contains("are denoised")
            || warning.contains("is rendered by `nee_sum`, which is biased")
    };
    let mut warnings = plan.warnings.clone();
    warnings.retain(|warning| !is_expected(warning));
    assert!(warnings.is_empty(), "{name}: {warnings:?}");
}

#[test]
fn every_shipped_script_is_planned_without_a_warning() {
    let scripts = scripts("scripts");
    assert!(scripts.len() >= 3);
    for file in scripts {
        check(&file, "scripts", &[]);
    }
}

#[test]
fn both_forms_of_every_script_of_the_theses_are_planned_without_a_warning() {
    let scripts = scripts("scripts/theses");
    assert!(scripts.len() > 30, "{}", scripts.len());
    for file in scripts {
        for quick in [false, true] {
            let axis = ("quick".to_owned(), vec![Value::Bool(quick)]);
            check(&file, "scripts/theses", &[axis]);
        }
    }
}
