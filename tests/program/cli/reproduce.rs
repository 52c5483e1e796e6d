//! Tests of `lumbre reproduce`: the three verdicts, and the cases without a verdict.

use lumbre_night::store::StoredFile;
use lumbre_night::store::schema::run::{DoneFile, FileSum};

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
x:figure("error", { x = "samples", y = "rmse", by = "technique" })
x:table("last", { value = "rmse", rows = "technique" })
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
    // Several files, one of them twice.
    let other = place.finished()[1].0.clone();
    let other = other.trim_end_matches("done.json").to_owned() + "final.exr";
    let both = place.succeed(&["reproduce", &run, &other, &run]).stdout;
    assert_eq!(both.matches("  identical\n").count(), 2, "{both}");
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
        "verdict.md",
        "requested/error.csv",
        "../figures/error.csv",
        "../tables/last.csv",
        "../tables/last.md",
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
    let reference = place.first_ending("out/refs", "ref.exr");
    assert!(
        place
            .succeed(&["reproduce", &reference])
            .stdout
            .ends_with("  identical\n")
    );
}

/// Replaces the picture of a run by that of another night, with the manifest that a renderer would
/// have written.
fn replace_picture(place: &Workplace, run: &str, script: &str, out: &str) {
    place.write("other.lua", script);
    place.succeed(&["run", "other.lua", "--out", out, "-q"]);
    let name = run.split_once("/runs/").unwrap().1;
    let (path, _) = name.rsplit_once('/').unwrap();
    let files = place.files(out);
    let other = files
        .iter()
        .find(|f| f.contains(path) && f.ends_with("/final.exr"));
    let bytes = std::fs::read(place.path(other.unwrap())).unwrap();
    let folder = place.path(run);
    let done = DoneFile::find(&folder).unwrap().unwrap();
    let mut files = done.files().clone();
    let sum = FileSum {
        bytes: bytes.len() as u64,
        blake3: blake3::hash(&bytes).to_hex().to_string(),
    };
    files.insert("final.exr".to_owned(), sum);
    std::fs::write(folder.join("final.exr"), bytes).unwrap();
    std::fs::write(folder.join("done.json"), done.sealed(files).text()).unwrap();
}

#[test]
fn noise_is_distinguished_from_a_changed_scene() {
    let (place, run) = night();
    // Another seed gives another picture with the same expected values.
    let script = NIGHT.replace("seed = 5", "seed = 6");
    replace_picture(&place, &run, &script, "seed");
    let output = place.succeed(&["reproduce", &run]);
    assert!(
        output.stdout.contains("equal within noise, p = "),
        "{}",
        output.stdout
    );
    // A brighter ball gives another picture.
    let script = NIGHT.replace("{ 0.25, 0.5, 0.75 }", "{ 0.95, 0.5, 0.75 }");
    replace_picture(&place, &run, &script, "bright");
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
fn a_configuration_that_is_not_that_of_the_id_gives_no_verdict() {
    let (place, run) = night();
    let config = place.read(&format!("{run}/config.json"));
    let facts = place.json(&format!("{run}/config.json"));
    let text = |field: &str| facts[field].to_string();
    let depth = facts["render"]["max_depth"].to_string();
    let field = |name: &str, value: &str| format!("\"{name}\": {value}");
    let other_id = format!("\"{}\"", "0".repeat(32));
    for (from, to, said) in [
        (
            field("max_depth", &depth),
            field("max_depth", "5"),
            "max_depth is",
        ),
        (
            field("seed", &text("seed")),
            field("seed", "12345"),
            "seed is",
        ),
        (
            field("integrator", "\"bpt\""),
            field("integrator", "\"nee\""),
            "integrator is",
        ),
        (field("radius", "1.0"), field("radius", "2.0"), "filter is"),
        (
            field("plan", &text("plan")),
            field("plan", &other_id),
            "its plan is not",
        ),
        (
            field("run", &text("run")),
            field("run", &other_id),
            "its run is not",
        ),
        (
            field("reference", &text("reference")),
            field("reference", &other_id),
            "reference is",
        ),
    ] {
        let changed = config.replacen(&from, &to, 1);
        assert_ne!(changed, config, "{from}");
        place.write(&format!("{run}/config.json"), &changed);
        for command in [["reproduce", &run], ["show", &run]] {
            let ended = place.run(&command);
            let text = ended.stdout + &ended.stderr;
            assert!(
                ended.status == 3 && text.contains(said),
                "{from}: {} {text}",
                ended.status
            );
        }
    }
    // The identity is the last object of the file.
    let at = config.find("\"identity\"").unwrap();
    let changed = config[..at].to_owned() + &config[at..].replace("\"bpt\"", "\"nee\"");
    assert_ne!(changed, config);
    place.write(&format!("{run}/config.json"), &changed);
    assert!(
        place
            .run(&["reproduce", &run])
            .stdout
            .contains("does not have the id")
    );
    // The plan determines these files, so `run` repairs them.
    place.succeed(&["run", "again.lua", "-q"]);
    assert_eq!(place.read(&format!("{run}/config.json")), config);
    place.succeed(&["reproduce", &run]);
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
