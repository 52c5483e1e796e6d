//! Ids that runs of earlier versions have: a change of one makes finished runs unreachable.

use std::collections::BTreeMap;
use std::path::Path;

use lumbre_light::value::Value;
use lumbre_night::experiment::Plan;
use lumbre_night::experiment::plan::{Overrides, expand};
use lumbre_scene_io::load::MissingTextures;

/// Cases with the first digits of their ids. An id changes with what determines a picture: state
/// that and why in CHANGELOG.md, and replace it here.
const IDS: [(&str, &str); 10] = [
    ("plain", "77dc2be2"),
    ("sobol", "a9d4b739"),
    ("strategies", "89596c40"),
    ("merging", "342ed7c7"),
    ("guiding", "e031497f"),
    ("layers", "8ed7640b"),
    ("time", "bdbfebbb"),
    ("filter", "18fdebd1"),
    ("scene", "8d0bed37"),
    ("denoised", "9e8494da"),
];

/// Plans a script with a cell for each of some cases.
fn plan(cases: &[&str]) -> Plan {
    let text = concat!(
        r#"
local x = experiment("golden", { seed = 7, repeats = 2 })
x:axis("case", { CASES })
local tables = {
  plain = { integrator = "bpt" },
  sobol = { integrator = "nee", sampler = "sobol" },
  strategies = { integrator = "bdpt", mis = "balance", strategies = { 1, 2 } },
  merging = { integrator = "vcm", join = "merge", radius = 0.1 },
  guiding = { integrator = "guided", training = 8 },
  layers = { integrator = "nee", films = { "albedo", "depth" } },
  time = { integrator = "bpt", film = { time = { bin = 0.5, bins = 16 } } },
  filter = { integrator = "nee", aa = { filter = "gauss", radius = 2 }, rr = { start = 3 } },
  scene = { integrator = "nee", set = { ["camera.fov"] = 30 } },
  denoised = { integrator = "nee", denoise = "atrous" },
}
x:render(function(p)
  local t = tables[p.case]
  t.scene, t.max_depth, t.resolution = ""#,
        env!("CARGO_MANIFEST_DIR"),
        r#"/scenes/cornell/cornell.scn", 4, { 32, 24 }
  return t
end)
x:reference { stop = stop.samples(64) }
x:measure { rmse = metric.rmse() }
x:stop(stop.samples(16))
return x
"#
    );
    let cases: Vec<String> = cases.iter().map(|case| format!("{case:?}")).collect();
    let text = text.replace("CASES", &cases.join(", "));
    let script =
        lumbre_lua::load_text(Path::new("golden.lua"), text, lumbre_lua::Limits::default())
            .unwrap_or_else(|e| panic!("{e}"));
    let mut load = |path: &Path, options: &BTreeMap<String, Value>| {
        lumbre_lua::scene::read(path, options, MissingTextures::Fail)
    };
    let overrides = Overrides {
        backend: Some("cpu".to_owned()),
        ..Overrides::default()
    };
    expand(&script.spec, &script, &overrides, &mut load).unwrap_or_else(|e| panic!("{e}"))
}

/// Returns the first digits of the id of the first repeat of each case.
fn ids(plan: &Plan) -> Vec<String> {
    let first = plan.cells.iter().filter(|cell| cell.repeat == 0);
    first
        .map(|cell| cell.id.to_string()[..8].to_owned())
        .collect()
}

#[test]
fn runs_keep_the_ids_of_earlier_versions() {
    let found = ids(&plan(&IDS.map(|(case, _)| case)));
    let expected: Vec<&str> = IDS.iter().map(|(_, id)| *id).collect();
    assert_eq!(found, expected);
}

#[test]
fn a_night_without_one_of_its_cells_keeps_the_ids_of_all_others() {
    let cases = IDS.map(|(case, _)| case);
    let all = ids(&plan(&cases));
    for (left_out, case) in cases.iter().enumerate() {
        let mut fewer = cases.to_vec();
        fewer.remove(left_out);
        let mut expected = all.clone();
        expected.remove(left_out);
        assert_eq!(ids(&plan(&fewer)), expected, "without {case}");
    }
}
