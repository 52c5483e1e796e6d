//! Tests of `lumbre reproduce`: the three verdicts, and the cases without a verdict.

use super::workplace::Workplace;

/// A small night on the CPU, whose pictures are reproducible to the bit.
const NIGHT: &str = r#"
local x = experiment("again", { seed = 5 })
x:axis("technique", { "bpt", "nee" })
x:render(function(p)
  return { scene = "ball.scn", integrator = p.technique, resolution = { 16, 12 }, backend = "cpu",
    aa = { filter = "gauss", radius = 1 }, set = { ["materials.grey.base_color"] = { 0.25, 0.5, 0.75 } } }
end)
x:reference { from = function(p) return { integrator = "nee" } end, stop = stop.samples(64) }
x:measure { every = "1s", rmse = metric.rmse(), keep = { exr = "pow2" } }
x:stop(function(p) return stop.samples(16) end)
return x
"#;

fn night() -> (Workplace, String) {
    let place = Workplace::new();
    place.write("again.lua", NIGHT);
    // A light so large that every pixel meets it, so that noise can be distinguished from a change.
    let scene = place
        .read("ball.scn")
        .replace("[0, 3, 0], \"radius\": 0.5", "[0, 6, 3], \"radius\": 3.5");
    place.write("ball.scn", &scene);
    place.succeed(&["run", "again.lua", "-q"]);
    let run = place.finished()[0]
        .0
        .trim_end_matches("/done.json")
        .to_owned();
    (place, run)
}

#[test]
fn pictures_figures_and_tables_are_identical_when_rendered_again() {
    let (place, run) = night();
    for file in [
        format!("{run}/final.exr"),
        format!("{run}/snap-4.exr"),
        format!("{run}/final.png"),
        run.clone(),
    ] {
        let output = place.succeed(&["reproduce", &file]);
        assert!(
            output.stdout.ends_with("  identical\n"),
            "{file}: {}",
            output.stdout
        );
    }
    assert!(
        place
            .succeed(&["reproduce", &format!("{run}/snap-4.exr")])
            .stderr
            .contains("4 samples per pixel")
    );
    place.succeed(&["report", "out/latest", "-q"]);
    let files = [
        "figures/error-samples-rmse.svg",
        "figures/error-samples-rmse.pdf",
        "figures/error-samples-rmse.png",
        "tables/final-rmse.md",
        "tables/final-rmse.tex",
        "tables/final-rmse.csv",
        "data/runs.csv",
        "index.html",
    ];
    for file in files {
        let output = place.succeed(&[
            "reproduce",
            &format!("out/latest/report/{file}"),
            "--json",
            "-q",
        ]);
        let json: serde_json::Value = serde_json::from_str(&output.stdout).unwrap();
        let answers: Vec<&str> = json["runs"]
            .as_array()
            .unwrap()
            .iter()
            .map(|r| r["answer"].as_str().unwrap())
            .collect();
        assert_eq!(answers, ["identical", "identical"], "{file}: {json}");
    }
    // From another folder the scene is found relative to where the night was started.
    let output = place
        .command(&["reproduce", place.path(&run).to_str().unwrap(), "-q"])
        .current_dir("/")
        .output()
        .unwrap();
    assert!(
        String::from_utf8(output.stdout)
            .unwrap()
            .ends_with("  identical\n")
    );
    let reference = place
        .files("out/refs")
        .into_iter()
        .find(|f| f.ends_with("ref.exr"))
        .unwrap();
    assert!(
        place
            .succeed(&["reproduce", &reference])
            .stdout
            .ends_with("  identical\n")
    );
}

#[test]
fn noise_is_distinguished_from_a_changed_scene() {
    let (place, run) = night();
    let config = place.read(&format!("{run}/config.json"));
    let seed = place.json(&format!("{run}/config.json"))["seed"].to_string();
    // Another seed gives another picture with the same expected values.
    place.write(
        &format!("{run}/config.json"),
        &config.replace(&format!("\"seed\": {seed}"), "\"seed\": 12345"),
    );
    let output = place.succeed(&["reproduce", &run]);
    assert!(
        output.stdout.contains("equal within noise, p = "),
        "{}",
        output.stdout
    );
    // A brighter ball gives another picture. The scene's hash is removed, since it would reveal the
    // change earlier.
    let done = place.read(&format!("{run}/done.json"));
    let facts = place.json(&format!("{run}/done.json"));
    let hash = facts["scene_hash"].as_str().unwrap();
    place.write(&format!("{run}/done.json"), &done.replace(hash, ""));
    place.write(
        &format!("{run}/config.json"),
        &config.replace("[\n        0.25,", "[\n        0.95,"),
    );
    let ended = place.run(&["reproduce", &run, "--maps", "maps"]);
    assert!(
        ended.status == 5 && ended.stdout.contains("differs here"),
        "{} {}",
        ended.status,
        ended.stdout
    );
    assert_eq!(place.files("maps").len(), 1);
}

#[test]
fn runs_that_cannot_be_rendered_again_are_reported_with_the_reason() {
    let (place, run) = night();
    let scene = place.read("ball.scn");
    place.write("ball.scn", &scene.replace("\"fov\": 40", "\"fov\": 41"));
    let ended = place.run(&["reproduce", &run]);
    assert!(
        ended.status == 3 && ended.stdout.contains("has changed (its hash is"),
        "{} {}",
        ended.status,
        ended.stdout
    );
    let error = place.fail(2, &["reproduce", "ball.scn"]);
    assert!(error.contains("names no run"), "{error}");
    place.write("stray.svg", &format!("<desc>run {}</desc>", "0".repeat(32)));
    let error = place.fail(2, &["reproduce", "stray.svg"]);
    assert!(error.contains("no run matches"), "{error}");
}
