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

/// Writes the quick form of a script of the theses with one repeat and with smaller numbers, each of
/// which occurs once in it, and returns its path.
fn smaller(place: &Workplace, name: &str, numbers: &[(&str, &str)]) -> String {
    let file = format!("scripts/theses/{name}.lua");
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(&file);
    let mut text = std::fs::read_to_string(path).unwrap();
    let form = [
        ("repeats = 5", "repeats = 1"),
        ("\"quick\", { false }", "\"quick\", { true }"),
    ];
    for (from, to) in form.iter().chain(numbers) {
        assert_eq!(text.matches(from).count(), 1, "{file}: `{from}`");
        text = text.replace(from, to);
    }
    place.write("study.lua", &text);
    place.path("study.lua").to_str().unwrap().to_owned()
}

/// Runs a script, and returns a table of it: the numbers of each row by its labels.
fn study(
    place: &Workplace,
    script: &str,
    more: &[&str],
    table: &str,
) -> BTreeMap<String, Vec<f64>> {
    let out = place.path("out");
    let out = out.to_str().unwrap();
    let base = ["run", script, "--out", out, "--backend", "cpu", "-q"];
    let ended = run(place, &[&base, more].concat());
    assert_eq!(ended.status, 0, "{script}: {}", ended.stderr);
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

/// Returns the final pictures of all runs.
fn pictures(place: &Workplace) -> Vec<Image> {
    let runs = place.finished().into_iter().map(|(done, _)| done);
    let file = |done: String| place.path(&done.replace("done.json", "final.exr"));
    let bytes = runs.map(|done| std::fs::read(file(done)).unwrap());
    bytes
        .map(|bytes| lumbre_report::exr::decode(&bytes).unwrap().0)
        .collect()
}

/// Returns whether no two pictures are the same.
fn are_distinct(pictures: &[Image]) -> bool {
    (1..pictures.len()).all(|i| !pictures[..i].contains(&pictures[i]))
}

/// Script with one row for each part of a renderer that is switched off.
const PARTS: &str = "scripts/recipes/switch_parts.lua";

#[test]
fn a_filter_and_flat_normals_change_pictures_and_not_their_noise() {
    let place = Workplace::new();
    let rmse = study(&place, PARTS, &["size=32", "samples=4"], "rmse");
    let [bilinear, nearest] = ["nothing", "texture filter"].map(|part| rmse[part][0]);
    assert!((bilinear / nearest - 1.0).abs() < 0.3, "{rmse:?}");
    let parts = pictures(&place);
    assert!(parts.len() == 5 && are_distinct(&parts));
    let place = Workplace::new();
    let numbers = [("{ 96, 96 }", "{ 32, 32 }"), ("64 or 512", "4 or 512")];
    let script = smaller(&place, "s1_figure_3_13", &numbers);
    let rates = study(&place, &script, &["light=sky"], "rate");
    assert_eq!(rates.len(), 3, "{rates:?}");
    let normals = pictures(&place);
    assert!(normals.len() == 3 && are_distinct(&normals));
}

#[test]
fn importance_sampling_has_less_error_in_the_studies() {
    // Without weights, and with them.
    let place = Workplace::new();
    let numbers = [
        ("{ 64, 64 }", "{ 24, 24 }"),
        ("64 or 256", "8 or 256"),
        ("2048 or 8192", "128 or 8192"),
    ];
    let script = smaller(&place, "s1_figure_4_1", &numbers);
    let rmse = study(&place, &script, &[], "rmse");
    assert!(rmse["uniform"][0] > 2.0 * rmse["luminance"][0], "{rmse:?}");
    let place = Workplace::new();
    let rmse = study(&place, PARTS, &["size=32", "samples=4"], "rmse");
    assert!(
        rmse["environment sampling"][0] > 2.0 * rmse["nothing"][0],
        "{rmse:?}"
    );
    let place = Workplace::new();
    let numbers = [
        ("{ 48, 48 }", "{ 24, 24 }"),
        ("128 or 1024", "32 or 1024"),
        ("2048 or 8192", "128 or 8192"),
    ];
    let script = smaller(&place, "s1_figure_4_3", &numbers);
    let rmse = study(&place, &script, &[], "rmse");
    assert!(rmse["0.1"][0] > 2.0 * rmse["0.1"][1], "{rmse:?}");
    let gain = |roughness: &str| rmse[roughness][0] / rmse[roughness][1];
    assert!(gain("0.1") > gain("1"), "{rmse:?}");
}

#[test]
fn devices_refuse_what_they_lack_when_planned() {
    let place = Workplace::new();
    let plan = |name: &str| {
        let script = format!("scripts/theses/{name}.lua");
        let ended = run(&place, &["plan", &script, "--backend", "vulkan-compute"]);
        let text = ended
            .stderr
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(" ");
        (ended.status, text)
    };
    let (status, error) = plan("s1_figure_4_3");
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
    for name in ["s1_figure_3_8", "s1_figure_3_13", "s1_figure_4_1"] {
        let (status, error) = plan(name);
        assert_eq!(status, 0, "{name}: {error}");
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

/// Options that shrink the suite of the benchmark to a thousandth.
const SMALL_SUITE: [&str; 8] = [
    "bench",
    "--suite",
    "--size",
    "16x12",
    "--time",
    "1.2s",
    "--backend",
    "cpu",
];

/// Runs a small suite as the benchmark of a machine, with the result in `NAME.json`.
fn small_suite(place: &Workplace, name: &str) -> ProgramOutput {
    let file = format!("{name}.json");
    let args = ["--name", name, "-o", &file];
    place.run(&[&SMALL_SUITE[..], &args].concat())
}

#[test]
fn a_benchmark_is_one_file_and_files_of_machines_are_compared() {
    let place = Workplace::new();
    let read = |file: &str| serde_json::from_str::<Json>(&place.read(file)).unwrap();
    let ended = small_suite(&place, "first");
    assert_eq!(ended.status, 0, "{}", ended.stderr);
    let a = read("first.json");
    assert_eq!(a["finished"], true);
    let references = a["references"].as_array().unwrap();
    assert_eq!(references.len(), 11, "eleven scenes");
    for reference in references {
        let floor = reference["floors"]["relative_rmse"].as_f64().unwrap();
        assert!(floor > 0.0, "{reference}");
    }
    let cells = a["cells"].as_array().unwrap();
    assert_eq!(cells.len(), 11 * 3, "eleven scenes by three techniques");
    for cell in cells {
        assert_eq!(cell["frames_per_s"].as_array().unwrap().len(), 5);
        assert!(cell["mpaths_per_s"][0].as_f64().unwrap() > 0.0);
        assert!(cell["picture"]["mean"][0].as_f64().unwrap() >= 0.0);
        let errors = cell["errors"].as_array().unwrap();
        assert_eq!(errors.len(), 4, "two metrics at two times");
        for error in errors {
            assert_eq!(error["values"].as_array().unwrap().len(), 5, "{error}");
        }
        for time in cell["times"].as_array().unwrap() {
            assert!(time["seconds"][4].as_f64().unwrap() > 0.0, "{time}");
            assert_eq!(time["bounds"].as_array().unwrap().len(), 5);
        }
    }
    assert!(
        a["machine"]["cpu"]
            .as_str()
            .is_some_and(|cpu| !cpu.is_empty())
    );
    let ended = small_suite(&place, "first");
    assert!(
        ended.status == 2 && ended.stderr.contains("first.json is finished"),
        "{}",
        ended.stderr
    );

    // An interrupted suite of another machine is resumed.
    let mut begun = a.clone();
    begun["name"] = Json::from("second");
    begun["finished"] = Json::from(false);
    begun["cells"].as_array_mut().unwrap().truncate(31);
    place.write("second.json", &begun.to_string());
    let ended = small_suite(&place, "second");
    let lines = [
        "second.json has 31 measurements already",
        "2 of 2: cpu gallery-lamps bdpt",
    ];
    assert!(
        ended.status == 0 && lines.iter().all(|line| ended.stderr.contains(line)),
        "{}",
        ended.stderr
    );
    let resumed = read("second.json");
    assert_eq!(resumed["references"], a["references"]);
    let all = resumed["cells"].as_array().unwrap();
    assert_eq!(cells[..31], all[..31], "they are not measured again");
    // References of another build and settings of other options are no part of the same result.
    begun["name"] = Json::from("third");
    begun["references"][10]["picture"]["checksum"] = Json::from("0");
    place.write("third.json", &begun.to_string());
    let ended = small_suite(&place, "third");
    assert!(
        ended.status == 2 && ended.stderr.contains("reference of gallery-lamps differs"),
        "{}",
        ended.stderr
    );
    begun["settings"]["max_depth"] = Json::from(9);
    place.write("third.json", &begun.to_string());
    let ended = small_suite(&place, "third");
    assert!(
        ended.status == 2 && ended.stderr.contains("another program"),
        "{}",
        ended.stderr
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
    for same in [
        "33 of 33 pictures have the bits of first, cpu",
        "11 of 11 references have the bits of first",
    ] {
        assert!(page.contains(same), "{page}");
    }
    for name in [
        "fps",
        "relative",
        "rmse-at-0.002s",
        "ssim-at-0.002s",
        "time-to-rmse",
        "time-to-ssim",
    ] {
        for extension in ["md", "csv", "tex"] {
            let text = place.read(&format!("tables/benchmark-{name}.{extension}"));
            assert!(
                text.contains("gallery") && text.contains("bdpt"),
                "{name}.{extension}: {text}"
            );
        }
    }
    for version in [1, 99] {
        place.write("other.json", &format!("{{ \"benchmark\": {version} }}"));
        let ended = place.run(&["bench", "--compare", "first.json", "other.json"]);
        assert!(
            ended.status == 2 && ended.stderr.contains(&format!("version {version}")),
            "{}",
            ended.stderr
        );
    }
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
