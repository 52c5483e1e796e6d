//! Tests of settings on the command line of `run` and `plan`.

use serde_json::{Value, json};

use super::workplace::Workplace;

const SCRIPT: &str = concat!(
    r#"
local x = experiment("filters", { seed = 5 })
x:axis("arm", { "nee", "bdpt" })
x:render(function(p)
  return { scene = ""#,
    env!("CARGO_MANIFEST_DIR"),
    r#"/scenes/cornell.lua", integrator = p.arm, resolution = { 16, 16 }, max_depth = 6 }
end)
x:reference { from = function(p) return { integrator = "bdpt", max_depth = 6 } end, stop = stop.samples(8) }
x:measure { every = "1s", mape = metric.mape() }
x:stop(stop.samples(4))
return x
"#
);

/// Returns the plan with some settings.
fn plan(place: &Workplace, settings: &[&str]) -> Value {
    let command: Vec<&str> = ["plan", "filters.lua", "--json"]
        .iter()
        .chain(settings)
        .copied()
        .collect();
    serde_json::from_str(&place.succeed(&command).stdout).unwrap()
}

#[test]
fn any_setting_is_given_on_the_command_line() {
    let place = Workplace::new();
    place.write("filters.lua", SCRIPT);
    let made = plan(&place, &["max_depth=3", "resolution=8x4", "aa.filter=tent"]);
    for cell in made["cells"].as_array().unwrap() {
        assert_eq!(
            (&cell["max_depth"], &cell["resolution"]),
            (&json!(3), &json!([8, 4])),
            "{cell}"
        );
    }
    // The reference shows the same, although the script sets its depth.
    let references = made["references"].as_array().unwrap();
    assert_eq!(references.len(), 1);
    let source = &references[0]["source"];
    assert_eq!(source["max_depth"], 3);
    assert_eq!(source["aa"]["filter"], "tent");

    // A technique and its parameters are not those of the reference, of which there is still one.
    let made = plan(&place, &["mis=none"]);
    assert_eq!(made["references"].as_array().unwrap().len(), 1);
    assert_eq!(made["references"][0]["source"]["params"], json!({}));
    let made = plan(&place, &["technique=bpt"]);
    let technique = |cell: &Value| cell["integrator"] == "bpt";
    assert!(made["cells"].as_array().unwrap().iter().all(technique));
    assert_eq!(made["references"][0]["source"]["integrator"], "bdpt");

    // Several values are an axis, and an axis of the script is replaced as before.
    let made = plan(&place, &["arm=nee", "max_depth=2,3,4"]);
    let depths: Vec<&Value> = made["cells"]
        .as_array()
        .unwrap()
        .iter()
        .map(|cell| &cell["max_depth"])
        .collect();
    assert_eq!(depths, [2, 3, 4]);
}

#[test]
fn a_night_says_which_settings_it_was_given() {
    let place = Workplace::new();
    place.write("filters.lua", SCRIPT);
    place.succeed(&["run", "filters.lua", "max_depth=3", "-q"]);
    let table = place.read("out/latest/summary.csv");
    let header = table.lines().next().unwrap();
    assert!(header.contains("max_depth"), "{header}");
    place.succeed(&["report", "latest"]);
    for file in ["methods.md", "index.html"] {
        let text = place.read(&format!("out/latest/report/{file}"));
        assert!(
            text.contains("run with max_depth = 3 on the command line"),
            "{file}: {text}"
        );
    }
}

#[test]
fn a_quick_night_has_fewer_pixels_and_samples() {
    let place = Workplace::new();
    place.write("filters.lua", SCRIPT);
    let stops = |made: &Value| made["stops"][0]["rule"].clone();
    let [whole, quick] = [&[][..], &["--quick"]].map(|options| plan(&place, options));
    assert_eq!(
        (&whole["cells"][0]["resolution"], stops(&whole)),
        (&json!([16, 16]), json!({ "samples": 4 }))
    );
    assert_eq!(
        (&quick["cells"][0]["resolution"], stops(&quick)),
        (&json!([6, 6]), json!({ "samples": 1 }))
    );
    assert_eq!(
        quick["references"][0]["stop"]["rule"],
        json!({ "samples": 1 })
    );
    assert_eq!(whole["cells"].as_array().unwrap().len(), 2);
    assert_eq!(quick["cells"].as_array().unwrap().len(), 2);
}
