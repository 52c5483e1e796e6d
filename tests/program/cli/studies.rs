//! The scripts of studies in small, `lumbre bsdf`, and `lumbre benchmark`.

use std::collections::BTreeMap;
use std::path::Path;

use lumbre_light::film::Image;
use serde_json::Value as Json;

use super::workplace::{ProgramOutput, Workplace};

/// Runs the program from the root of the repository, with results in the workplace.
fn run(place: &Workplace, args: &[&str]) -> ProgramOutput {
    let mut command = place.command(args);
    ProgramOutput::run(command.current_dir(env!("CARGO_MANIFEST_DIR")))
}

/// Runs a script with small pictures, and returns its tables: the numbers of each row by its labels.
fn study(place: &Workplace, name: &str, more: &[&str], table: &str) -> BTreeMap<String, Vec<f64>> {
    let (script, out) = (format!("scripts/{name}.lua"), place.path("out"));
    let out = out.to_str().unwrap();
    let base = ["run", &script, "--out", out, "--backend", "cpu", "-q"];
    let ended = run(place, &[&base, more].concat());
    assert_eq!(ended.status, 0, "{name}: {}", ended.stderr);
    let text = std::fs::read_to_string(Path::new(out).join(format!("latest/tables/{table}.md")));
    let text = text.unwrap();
    let rows = text.lines().filter(|line| line.starts_with('|')).skip(2);
    rows.map(|row| {
        let fields: Vec<&str> = row.trim_matches('|').split('|').map(str::trim).collect();
        let number = |text: &&str| text.split([' ', '*']).find_map(|part| part.parse().ok());
        let numbers = fields[1..].iter().filter_map(number).collect();
        (fields[0].to_owned(), numbers)
    })
    .collect()
}

#[test]
fn a_filter_and_flat_normals_change_pictures_and_not_their_noise() {
    let place = Workplace::new();
    let rmse = study(&place, "texture_filter", &["size=32", "samples=4"], "rmse");
    let [bilinear, nearest] = ["bilinear", "nearest"].map(|filter| rmse[filter][0]);
    assert!((bilinear / nearest - 1.0).abs() < 0.3, "{rmse:?}");
    let place = Workplace::new();
    let rates = study(&place, "smooth_normals", &["size=32", "samples=4"], "rate");
    assert_eq!(rates.len(), 3, "{rates:?}");
    let pictures: Vec<Image> = place
        .finished()
        .iter()
        .map(|(done, _)| {
            let run = done.trim_end_matches("/done.json");
            std::fs::read(place.path(&format!("{run}/final.exr"))).unwrap()
        })
        .map(|bytes| lumbre_report::exr::decode(&bytes).unwrap().0)
        .collect();
    assert_eq!(pictures.len(), 3);
    assert!(pictures[0] != pictures[1] && pictures[1] != pictures[2] && pictures[0] != pictures[2]);
}

#[test]
fn importance_sampling_has_less_error_in_the_studies() {
    let place = Workplace::new();
    let rmse = study(
        &place,
        "environment_sampling",
        &["size=24", "samples=8"],
        "rmse",
    );
    for column in 0..2 {
        let [uniform, luminance] = ["uniform", "luminance"].map(|name| rmse[name][column]);
        assert!(uniform > 2.0 * luminance, "{rmse:?}");
    }
    let place = Workplace::new();
    let rmse = study(&place, "bsdf_sampling", &["size=24", "samples=32"], "rmse");
    assert!(rmse["0.1"][0] > 2.0 * rmse["0.1"][1], "{rmse:?}");
    let gain = |roughness: &str| rmse[roughness][0] / rmse[roughness][1];
    assert!(gain("0.1") > gain("1"), "{rmse:?}");
}

#[test]
fn devices_refuse_what_they_lack_when_planned() {
    let place = Workplace::new();
    let plan = |script: &str, words: &[&str]| {
        let script = format!("scripts/{script}.lua");
        let base = ["plan", &script, "--backend", "vulkan-compute"];
        let ended = run(&place, &[&base, words].concat());
        let text = ended
            .stderr
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(" ");
        (ended.status, text)
    };
    let (status, error) = plan("bsdf_sampling", &[]);
    if error.contains("cannot be used on this machine")
        && std::env::var_os("REQUIRE_DEVICE").is_none()
    {
        crate::common::skipped("no graphics device");
        return;
    }
    assert!(
        status == 2 && error.contains("paths in uniform directions"),
        "{error}"
    );
    for script in ["texture_filter", "smooth_normals", "environment_sampling"] {
        let (status, error) = plan(script, &[]);
        assert_eq!(status, 0, "{script}: {error}");
    }
}

#[test]
fn a_lobe_is_drawn_and_its_samples_follow_its_density() {
    let place = Workplace::new();
    let draw = |more: &[&str]| {
        let to = place.path("lobe");
        let base = [
            "bsdf",
            "scenes/material_ball.lua",
            "ball",
            "--to",
            to.to_str().unwrap(),
        ];
        run(&place, &[&base, more].concat())
    };
    let ended = draw(&[
        "--json",
        "--at",
        "60,30",
        "--set",
        "materials.ball.metallic=1",
    ]);
    assert_eq!(ended.status, 0, "{}", ended.stderr);
    let json: Json = serde_json::from_str(&ended.stdout).unwrap();
    assert!(
        json["sphere"]["p"].as_f64().unwrap() > 1e-3,
        "{}",
        json["sphere"]["p"]
    );
    assert!((json["sphere"]["mass"].as_f64().unwrap() - 1.0).abs() < 0.1);
    assert_eq!(json["delays"].as_array().unwrap().len(), 0);
    let svg = std::fs::read_to_string(place.path("lobe.svg")).unwrap();
    assert!(svg.starts_with("<svg") && svg.contains("chi-square test"));
    assert!(image::open(place.path("lobe.png")).unwrap().width() > 1000);
    let set = |path: &str| format!("materials.ball.{path}");
    let delay = [set("delay=exponential"), set("delay_rate=2")];
    let ended = draw(&["--set", &delay[0], "--set", &delay[1]]);
    assert_eq!(ended.status, 0, "{}", ended.stderr);
    assert!(
        ended.stdout.contains("delay, exponential: mean 0.5"),
        "{}",
        ended.stdout
    );
    let ended = run(&place, &["bsdf", "scenes/material_ball.lua", "bal"]);
    assert!(
        ended.status == 2 && ended.stderr.contains("ball"),
        "{}",
        ended.stderr
    );
    let ended = draw(&["--at", "200"]);
    assert!(
        ended.status == 2 && ended.stderr.contains("0 to 180"),
        "{}",
        ended.stderr
    );
}

#[test]
fn a_benchmark_is_one_file_and_files_of_machines_are_compared() {
    let place = Workplace::new();
    let measure = |name: &str| {
        let file = format!("{name}.json");
        place.succeed(&[
            "bench",
            "--suite",
            "--name",
            name,
            "-o",
            &file,
            "--size",
            "16x9",
            "--time",
            "0.1s",
            "--backend",
            "cpu",
        ]);
        let text = std::fs::read_to_string(place.path(&file)).unwrap();
        serde_json::from_str::<Json>(&text).unwrap()
    };
    let [a, b] = ["first", "second"].map(measure);
    let cells = a["cells"].as_array().unwrap();
    assert_eq!(cells.len(), 6 * 8, "six scenes by all techniques");
    for (cell, twin) in cells.iter().zip(b["cells"].as_array().unwrap()) {
        assert_eq!(cell["checksum"], twin["checksum"], "{cell}");
        assert_eq!(cell["frames_per_s"].as_array().unwrap().len(), 5);
        assert!(cell["mpaths_per_s"][0].as_f64().unwrap() > 0.0);
        assert!(cell["picture_mean"][0].as_f64().unwrap() >= 0.0);
    }
    assert!(
        a["machine"]["cpu"]
            .as_str()
            .is_some_and(|cpu| !cpu.is_empty())
    );
    let args = [
        "bench",
        "--compare",
        "first.json",
        "second.json",
        "--to",
        "tables",
    ];
    let page = place.succeed(&args).stdout;
    assert!(
        page.contains("48 of 48 pictures have the bits of first, cpu"),
        "{page}"
    );
    for name in ["benchmark-fps", "benchmark-relative"] {
        for extension in ["md", "csv", "tex"] {
            let text = std::fs::read_to_string(place.path(&format!("tables/{name}.{extension}")));
            let text = text.unwrap();
            assert!(
                text.contains("lamp") && text.contains("bdpt"),
                "{name}.{extension}: {text}"
            );
        }
    }
    place.write("other.json", "{ \"benchmark\": 99 }");
    let ended = place.run(&["bench", "--compare", "first.json", "other.json"]);
    assert!(
        ended.status == 2 && ended.stderr.contains("version 99"),
        "{}",
        ended.stderr
    );
}

#[test]
fn the_tree_of_a_guided_run_is_drawn() {
    let place = Workplace::new();
    let script = r#"
local x = experiment("tree", { seed = 3 })
x:axis("technique", { "guided", "nee" })
x:render(function(p)
  local training = nil
  if p.technique == "guided" then training = 64 end
  return { scene = "scenes/door_ajar.lua", view = "room", integrator = p.technique, max_depth = 5,
    resolution = { 32, 18 }, training = training, backend = "cpu" }
end)
x:stop(function() return stop.samples(1) end)
return x
"#;
    place.write("tree.lua", script);
    let (file, out, to) = (
        place.path("tree.lua"),
        place.path("out"),
        place.path("tree"),
    );
    let [file, out, to] = [&file, &out, &to].map(|path| path.to_str().unwrap());
    let ended = run(&place, &["run", file, "--out", out, "-q"]);
    assert_eq!(ended.status, 0, "{}", ended.stderr);
    let show = |run_name: &str, more: &[&str]| {
        let base = ["show", run_name, "--out", out, "--to", to, "--tree"];
        run(&place, &[&base, more].concat())
    };
    let ended = show("technique=guided", &["16,9", "--json"]);
    assert_eq!(ended.status, 0, "{}", ended.stderr);
    let json: Json = serde_json::from_str(&ended.stdout).unwrap();
    assert!(json["guiding_regions"].as_u64().unwrap() > 1, "{json}");
    let density = &json["density"];
    let cells = density["rows"].as_f64().unwrap() * density["columns"].as_f64().unwrap();
    let values = density["per_steradian"].as_array().unwrap().iter();
    let sum: f64 = values.map(|value| value.as_f64().unwrap()).sum();
    let mass = sum * 4.0 * std::f64::consts::PI / cells;
    assert!((mass - 1.0).abs() < 0.02, "{mass}");
    let svg = std::fs::read_to_string(place.path("tree.svg")).unwrap();
    assert!(svg.starts_with("<svg") && svg.contains("times a uniform density"));
    assert!(image::open(place.path("tree.png")).unwrap().width() > 700);
    let ended = show("technique=guided", &["0,0"]);
    assert!(
        ended.status == 0 && ended.stdout.contains("trained by"),
        "{} {}",
        ended.stdout,
        ended.stderr
    );
    for (name, pixel, expected) in [
        ("technique=nee", "1,1", "`nee` has no tree"),
        ("technique=guided", "32,1", "32 x 18 pixels"),
    ] {
        let ended = show(name, &[pixel]);
        assert!(
            ended.status == 2 && ended.stderr.contains(expected),
            "{}",
            ended.stderr
        );
    }
}
