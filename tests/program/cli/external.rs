//! External renderers inside an experiment.

use super::workplace::Workplace;

/// A technique of this project and one of Mitsuba, compared with a reference by this project.
const NIGHT: &str = r#"
local x = experiment("peers", { seed = 3 })
x:axis("python", { "python3" })
x:axis("technique", { "nee", "external:mitsuba" })
x:render(function(p)
  local mitsuba = p.technique == "external:mitsuba"
  return { scene = "ball.scn", integrator = p.technique, python = mitsuba and p.python or nil, resolution = { 24, 16 } }
end)
x:reference { from = function() return { integrator = "nee" } end, stop = stop.samples(256) }
x:measure { every = "1s", rmse = metric.rmse(), keep = { exr = "pow2" } }
x:stop(stop.samples(64))
x:table("errors", { value = "rmse", rows = "technique" })
return x
"#;

/// Returns the interpreter that has Mitsuba, if this machine has one: `LUMBRE_MITSUBA_PYTHON`, or
/// `python3`.
pub fn interpreter() -> Option<String> {
    let named = std::env::var("LUMBRE_MITSUBA_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let imported = std::process::Command::new(&named)
        .args(["-c", "import mitsuba"])
        .output();
    imported
        .is_ok_and(|output| output.status.success())
        .then_some(named)
}

#[test]
fn cells_of_an_absent_renderer_are_left_out_with_the_reason() {
    let place = Workplace::new();
    place.write("peers.lua", NIGHT);
    let planned = place.succeed(&["plan", "peers.lua", "python=/nowhere/python"]);
    let reason = "external:mitsuba is not installed: `/nowhere/python` cannot be started";
    assert!(
        planned.stdout.contains(reason) && planned.stdout.contains("1 cell"),
        "{}",
        planned.stdout
    );
    place.succeed(&["run", "peers.lua", "python=/nowhere/python", "-q"]);
    let table = place.read("out/latest/tables/errors.md").replace('\n', " ");
    assert!(
        table.contains(&format!("1 point is left out: {reason}")),
        "{table}"
    );
    place.succeed(&["report", "out/latest", "-q"]);
    let page = place.read("out/latest/report/index.html");
    assert!(
        page.contains("1 point of the sweep is left out: external:mitsuba is not installed"),
        "the report does not state the omitted point"
    );
    // Without the program that renders the reference, no run can be measured.
    place.write(
        "all.lua",
        &NIGHT.replace(
            "function() return { integrator = \"nee\" }",
            "function(p) return { integrator = \"external:mitsuba\", python = p.python }",
        ),
    );
    let output = place.run(&["run", "all.lua", "python=/nowhere/python"]);
    assert!(
        output.stderr.contains("nothing to do") && output.stderr.contains("is not installed"),
        "{}",
        output.stderr
    );
}

#[test]
fn quick_cases_agree_with_mitsuba_and_make_a_page() {
    let Some(python) = interpreter() else {
        crate::common::skipped("no interpreter with the package mitsuba");
        return;
    };
    let place = Workplace::new();
    let output = place.succeed(&[
        "verify",
        "--mitsuba",
        "--quick",
        "--python",
        &python,
        "--json",
        "--page",
        "page.md",
        "-q",
    ]);
    let report: serde_json::Value = serde_json::from_str(&output.stdout).unwrap();
    assert_eq!(
        (&report["failed"], &report["skipped"]),
        (&0.into(), &0.into()),
        "{report:#}"
    );
    let checks = report["checks"].as_array().unwrap();
    assert!(checks.len() >= 20, "{}", checks.len());
    let is_noted = |check: &&serde_json::Value| check["figures"]["result"] == "noted";
    assert!(checks.iter().filter(is_noted).count() <= 3);
    let page = place.read("page.md");
    assert!(
        page.contains("| `diffuse reflectance=0.7,0.4,0.2` |"),
        "{page}"
    );
}

#[test]
fn random_scenes_load_and_agree_with_mitsuba() {
    if crate::common::lacks_python() {
        return;
    }
    let place = Workplace::new();
    let script = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/docs/external/random_scenes.py"
    );
    let written = std::process::Command::new("python3")
        .args([script, "scenes", "12", "1"])
        .current_dir(place.path(""))
        .status();
    assert!(written.is_ok_and(|status| status.success()));
    let files: Vec<String> = (0..12).map(|i| format!("scenes/1-{i:02}.xml")).collect();
    for file in &files {
        let output = place.succeed(&["check", file]);
        let notes = output.stdout.lines().chain(output.stderr.lines());
        let other = |line: &&str| line.starts_with("note") && !line.contains("a mesh of triangles");
        assert_eq!(notes.clone().find(other), None, "{file}");
    }
    let Some(python) = interpreter() else {
        crate::common::skipped("no interpreter with the package mitsuba");
        return;
    };
    let mut words = vec!["verify", "--mitsuba", "--python", &python, "-q"];
    words.extend(files.iter().map(String::as_str));
    let output = place.succeed(&words);
    assert!(
        output.stdout.contains("12 passed, 0 failed, 0 skipped"),
        "{}",
        output.stdout
    );
}

#[test]
fn the_comparison_with_mitsuba_is_skipped_where_it_is_absent() {
    let output =
        Workplace::new().succeed(&["verify", "--mitsuba", "--python", "/nowhere/python", "-q"]);
    assert!(
        output.stdout.contains("0 passed, 0 failed, 1 skipped")
            && output
                .stdout
                .contains("`/nowhere/python` cannot be started"),
        "{}",
        output.stdout
    );
}

#[test]
fn mitsuba_renders_the_same_picture_and_reports_its_own_render_time() {
    let Some(python) = interpreter() else {
        crate::common::skipped(
            "no interpreter with the package mitsuba; name one with LUMBRE_MITSUBA_PYTHON",
        );
        return;
    };
    let place = Workplace::new();
    place.write("peers.lua", NIGHT);
    place.succeed(&["run", "peers.lua", &format!("python={python}"), "-q"]);
    let finished: Vec<serde_json::Value> = place
        .finished()
        .iter()
        .map(|(done, _)| place.json(done))
        .collect();
    let mitsuba = finished
        .iter()
        .find(|done| {
            done["devices"][0]["peer"]["program"]
                .as_str()
                .unwrap_or_default()
                .contains("Mitsuba")
        })
        .unwrap();
    let own = finished
        .iter()
        .find(|done| done["run"] != mitsuba["run"])
        .unwrap();
    assert!(
        mitsuba["samples"] == 64 && mitsuba["render_s"].as_f64().unwrap() > 0.0,
        "{mitsuba}"
    );
    // Mitsuba's scalar variant follows one path at a time, which a comparison by time must say.
    assert_eq!(mitsuba["devices"][0]["features"]["lanes"], 1, "{mitsuba}");
    let rmse = |done: &serde_json::Value| done["metrics"]["rmse"].as_f64().unwrap();
    // Both are unbiased for a diffuse ball under an area light, and `nee` samples the light as
    // Mitsuba does.
    let ratio = rmse(mitsuba) / rmse(own);
    assert!(
        (0.5..2.0).contains(&ratio),
        "{} and {}",
        rmse(mitsuba),
        rmse(own)
    );
    place.succeed(&["report", "out/latest", "-q"]);
    assert!(
        place
            .read("out/latest/report/tables/fps-absolute.md")
            .contains("external:mitsuba")
    );
    assert!(
        place
            .read("out/latest/report/methods.md")
            .contains("external:mitsuba was rendered by Mitsuba 3.")
    );
}

/// Modules in place of Dr.Jit and Mitsuba: each picture compiles a kernel for ten seconds, and finds
/// another compiled.
const STAND_INS: [(&str, &str); 2] = [
    (
        "drjit.py",
        "class JitFlag: KernelHistory = 0
kernels = []
def set_flag(flag, value): pass
def set_thread_count(count): pass
def thread_count(): return 2
def eval(image): pass
def sync_thread(): pass
def kernel_history():
    found = kernels.copy()
    kernels.clear()
    return found
",
    ),
    (
        "mitsuba.py",
        "import drjit
__version__ = '3'
class LogLevel: Warn = 0
class Struct:
    class Type: Float32 = 0
class Bitmap:
    class PixelFormat: RGB = 0
    def __init__(self, image): pass
    def convert(self, *to): return self
    def write(self, file): pass
def set_variant(name): pass
def set_log_level(level): pass
def load_file(file, **values): pass
def load_dict(values): pass
def render(scene, **values):
    drjit.kernels.append({'cache_hit': False, 'codegen_time': 1e3, 'backend_time': 9e3})
    drjit.kernels.append({'cache_hit': True, 'execution_time': 7e3})
",
    ),
];

#[test]
fn the_render_time_of_mitsuba_is_without_compiling_kernels() {
    if crate::common::lacks_python() {
        return;
    }
    let place = Workplace::new();
    for (name, text) in STAND_INS {
        place.write(name, text);
    }
    let bridge = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/crates/lumbre-render/src/external/lumbre_mitsuba.py"
    );
    let seconds = |variant: &str| -> f64 {
        let requests = place.path("requests.txt");
        std::fs::write(&requests, "4 1 picture.exr\n").unwrap();
        let replies = std::process::Command::new("python3")
            .args([bridge, variant, "path", "scene.xml", "8", "8", "5", "2"])
            .env("PYTHONPATH", place.path("."))
            .stdin(std::fs::File::open(requests).unwrap())
            .output()
            .unwrap();
        let replies = String::from_utf8(replies.stdout).unwrap();
        replies.lines().nth(1).unwrap().parse().unwrap()
    };
    assert!((-10.0..0.0).contains(&seconds("llvm_ad_rgb")));
    assert!((0.0..10.0).contains(&seconds("scalar_rgb")));
}
