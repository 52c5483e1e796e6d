//! The program of a technique of one's own: the technique goes through nights, files and verbs as the
//! built-in ones do.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "test helpers may panic and print"
)]

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Output, Stdio};
use std::time::{Duration, Instant};

use lumbre::OwnTechnique;
use lumbre_light::transport::integrator::IntegratorRow;
use lumbre_light::value::schema::{Field, Table, Ty};
use own_technique::{ROW, Steps};

/// A small night: two techniques, paths in vectors and one by one, in a folder with its scene.
const NIGHT: &str = r#"
local x = experiment("night", { seed = 3 })
x:axis("connect", { 0.25, 1 })
x:axis("lanes", { "never", "auto" })
x:render(function(p)
  return { scene = "scene.lua", integrator = "own_technique", connect = p.connect, max_depth = 4,
    resolution = { 24, 24 }, backend = "cpu", accel = { lanes = p.lanes } }
end)
x:reference { from = function() return { integrator = "nee" } end, stop = stop.samples(256),
  agree = { with = "own_technique", samples = 256 } }
x:measure { rmse = metric.rmse() }
x:stop(function(p) return stop.samples(64) end)
return x
"#;

/// Returns a folder with the scene of the template and a night.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let template = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../templates/technique");
    std::fs::copy(template.join("scene.lua"), folder.path().join("scene.lua")).unwrap();
    std::fs::copy(template.join("script.lua"), folder.path().join("own.lua")).unwrap();
    std::fs::write(folder.path().join("night.lua"), NIGHT).unwrap();
    folder
}

/// Runs the program in a folder.
fn run(folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_own_technique"))
        .current_dir(folder)
        .env("NO_COLOR", "1")
        .args(args)
        .output()
        .unwrap()
}

/// Runs the program, which must succeed, and returns what it prints.
fn text(folder: &Path, args: &[&str]) -> String {
    let output = run(folder, args);
    let all = [output.stdout, output.stderr].concat();
    let all = String::from_utf8_lossy(&all).into_owned();
    assert!(output.status.success(), "{args:?}: {all}");
    all
}

/// Returns all files of this name below a folder.
fn files(folder: &Path, name: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let path = entry.path();
        if entry.file_type().unwrap().is_dir() {
            found.extend(files(&path, name));
        } else if path.file_name().is_some_and(|file| file == name) {
            found.push(path);
        }
    }
    found.sort();
    found
}

#[test]
fn a_night_with_an_own_technique_is_planned_rendered_explained_and_reproduced() {
    let folder = folder();
    let folder = folder.path();
    let plan = text(folder, &["plan", "night.lua"]);
    assert!(plan.contains("own_technique"), "{plan}");
    text(folder, &["run", "night.lua", "--no-tui"]);
    let again = text(folder, &["run", "night.lua", "--no-tui"]);
    assert!(again.contains("nothing to do"), "{again}");

    let pictures = files(&folder.join("out"), "final.exr");
    let of_cells: Vec<&PathBuf> = pictures
        .iter()
        .filter(|path| path.with_file_name("metrics.csv").exists())
        .collect();
    assert!(of_cells.len() >= 4, "{pictures:?}");
    let reproduced = text(folder, &["reproduce", &of_cells[0].to_string_lossy()]);
    assert!(reproduced.contains("identical"), "{reproduced}");
    let run_folder = of_cells[0].with_file_name("");
    let run = run_folder.to_string_lossy();
    let explained = text(folder, &["show", &run, "--why"]);
    assert!(
        explained.contains("would not be rendered again"),
        "{explained}"
    );
    let listed = text(folder, &["show", "latest"]);
    assert!(listed.contains("connect"), "{listed}");
}

/// Returns the only picture of a night in a folder of results.
fn only_picture(out: &Path) -> PathBuf {
    let pictures = files(out, "final.exr");
    assert_eq!(pictures.len(), 1, "{pictures:?}");
    pictures[0].clone()
}

#[test]
fn a_killed_run_resumes_with_the_same_bits() {
    let folder = folder();
    let folder = folder.path();
    let script = NIGHT
        .replace("{ 0.25, 1 }", "{ 0.25 }")
        .replace("{ \"never\", \"auto\" }", "{ \"auto\" }")
        .replace("stop.samples(64)", "stop.samples(8192)")
        .replace("{ rmse = metric.rmse() }", "{ every = \"0.05s\" }");
    let (before, rest) = script.split_once("x:reference").unwrap();
    let (_, rest) = rest.split_once("x:measure").unwrap();
    let long = format!("{before}x:checkpoint(\"0.05s\")\nx:measure{rest}");
    std::fs::write(folder.join("long.lua"), long).unwrap();
    let args = ["run", "long.lua", "--no-tui", "--no-smoke"];
    let mut night = Command::new(env!("CARGO_BIN_EXE_own_technique"))
        .current_dir(folder)
        .args(args)
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let start = Instant::now();
    while files(folder, "ckpt.a").is_empty() && files(folder, "ckpt.b").is_empty() {
        assert!(start.elapsed() < Duration::from_secs(180), "no checkpoint");
        std::thread::sleep(Duration::from_millis(5));
    }
    night.kill().unwrap();
    night.wait().unwrap();
    let resumed = text(folder, &args);
    assert!(resumed.contains("resumes from its checkpoint"), "{resumed}");
    text(folder, &[&args[..], &["--out", "whole"]].concat());
    let [picture, whole] = ["out", "whole"].map(|out| {
        let file = only_picture(&folder.join(out));
        file.to_string_lossy().into_owned()
    });
    let errors = text(folder, &["metric", &picture, &whole, "--metric", "mse"]);
    assert_eq!(errors.split_whitespace().nth(1), Some("0"), "{errors}");
}

#[test]
fn techniques_take_turns_and_several_workers_render_them() {
    let folder = folder();
    let folder = folder.path();
    let script = NIGHT
        .replace(
            "{ seed = 3 }",
            "{ seed = 3, repeats = 2, order = \"interleave\" }",
        )
        .replace(
            "x:axis(\"lanes\", { \"never\", \"auto\" })",
            "x:axis(\"technique\", { \"own_technique\", \"nee\" })",
        )
        .replace(
            "integrator = \"own_technique\", connect = p.connect",
            "integrator = p.technique, connect = p.technique ~= \"nee\" and p.connect or nil",
        )
        .replace("accel = { lanes = p.lanes }", "rr = { start = 4 }");
    std::fs::write(folder.join("turns.lua"), script).unwrap();
    let alone = text(folder, &["run", "turns.lua", "--no-tui", "--out", "alone"]);
    assert!(alone.contains("interleaving 3 techniques"), "{alone}");
    assert!(alone.contains("agrees with `own_technique`"), "{alone}");
    // Without the queue's program the plan is saved, and workers are started by hand.
    run(folder, &["submit", "hq", "turns.lua", "-q"]);
    let start = || {
        Command::new(env!("CARGO_BIN_EXE_own_technique"))
            .current_dir(folder)
            .args(["work", "out/latest", "-q", "--no-tui", "--threads", "1"])
            .args(["--affinity", "none"])
            .spawn()
            .unwrap()
    };
    for mut worker in [start(), start()] {
        assert!(worker.wait().unwrap().success());
    }
    // By the id of the run, which is the name of its folder.
    let pictures = |out: &str| -> BTreeMap<OsString, PathBuf> {
        let pictures = files(&folder.join(out), "final.exr").into_iter();
        let by_id =
            pictures.map(|file| (file.parent().unwrap().file_name().unwrap().to_owned(), file));
        by_id.collect()
    };
    let (by_workers, by_one) = (pictures("out"), pictures("alone"));
    assert_eq!((by_workers.len(), by_one.len()), (6, 6));
    for (id, file) in &by_workers {
        let [a, b] = [file, &by_one[id]].map(|file| file.to_string_lossy().into_owned());
        let errors = text(folder, &["metric", &a, &b, "--metric", "mse"]);
        assert_eq!(errors.split_whitespace().nth(1), Some("0"), "{errors}");
    }
}

#[test]
fn vectors_and_single_samples_have_the_same_bits() {
    let folder = folder();
    let folder = folder.path();
    let args = ["run", "night.lua", "--no-tui", "--only", "connect=0.25"];
    let printed = text(folder, &args);
    let picture = |lanes: &str| {
        let of_cell = |path: &PathBuf| path.to_string_lossy().contains(&format!("lanes={lanes}"));
        let pictures = files(&folder.join("out"), "final.exr");
        let found: Vec<&PathBuf> = pictures.iter().filter(|path| of_cell(path)).collect();
        assert_eq!(found.len(), 1, "{pictures:?}");
        found[0].to_string_lossy().into_owned()
    };
    let errors = text(
        folder,
        &[
            "metric",
            &picture("never"),
            &picture("auto"),
            "--metric",
            "mse",
        ],
    );
    assert_eq!(errors.split_whitespace().nth(1), Some("0"), "{errors}");
    // Vectors are used where the built-in techniques use them.
    let vectorised = |run: &str| {
        let mut lines = printed.lines();
        let started = lines.find(|line| line.contains(run) && line.contains("started"));
        started
            .unwrap_or_else(|| panic!("{run}: {printed}"))
            .contains("vectorised")
    };
    assert_eq!(vectorised("lanes=auto"), vectorised("[ref 1/2] nee"));
    assert!(!vectorised("lanes=never"));
}

#[test]
fn device_backends_refuse_the_technique_when_the_plan_is_made() {
    let folder = folder();
    let output = run(
        folder.path(),
        &["plan", "night.lua", "--backend", "vulkan-compute"],
    );
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{error}");
    if std::env::var_os("REQUIRE_DEVICE").is_none() && !error.contains("no shader") {
        // Past the test harness, which keeps what tests that pass print.
        let line = format!("SKIPPED: this machine has no Vulkan device: {error}\n");
        std::io::stderr().write_all(line.as_bytes()).unwrap();
        return;
    }
    assert!(
        error.contains("no shader for the integrator `own_technique`"),
        "{error}"
    );
}

#[test]
fn a_new_project_names_the_sources_and_its_technique() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let sources = sources.to_string_lossy();
    text(
        folder,
        &["new", "technique", "some_links", "--lumbre", &sources],
    );
    // Resolves the dependencies from the copied lock file, and compiles nothing.
    let output = Command::new(env!("CARGO"))
        .current_dir(folder.join("some_links"))
        .args(["tree", "--offline", "--depth", "1", "--prefix", "none"])
        .output()
        .unwrap();
    let tree = String::from_utf8_lossy(&output.stdout).into_owned();
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{error}");
    assert!(
        tree.contains("some_links v0.1.0") && tree.contains("lumbre-light v"),
        "{tree}"
    );

    for (args, reason) in [
        (
            ["new", "technique", "some_links"],
            "cannot create the folder",
        ),
        (["new", "technique", "fn"], "cannot be the name"),
        (
            ["new", "technique", "nee"],
            "there is a technique `nee` already",
        ),
    ] {
        let output = run(folder, &args);
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{error}");
        assert!(error.contains(reason), "{error}");
    }
}

/// Checks what only a project of its own has: the manifest and the lock file. The same sources are
/// built and tested as a member of this workspace. `.ci/run` runs it; checks of the dependencies are
/// kept below `target`, for the next time.
#[test]
#[ignore = "checks all crates for another workspace, which takes minutes at first"]
fn a_new_project_compiles_outside_of_this_workspace() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    text(folder, &["new", "technique", "some_links"]);
    let output = Command::new(env!("CARGO"))
        .current_dir(folder.join("some_links"))
        .env("CARGO_TARGET_DIR", env!("CARGO_TARGET_TMPDIR"))
        .args(["check", "--offline", "--all-targets"])
        .output()
        .unwrap();
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{error}");
}

#[test]
fn the_technique_is_listed_and_its_parameters_are_checked() {
    let folder = folder();
    let folder = folder.path();
    let annotations = text(folder, &["schema", "--lua"]);
    assert!(
        annotations.contains("---@class OwnTechniqueParams"),
        "{annotations}"
    );
    let tables = text(folder, &["schema", "--json"]);
    assert!(tables.contains("\"path tracing with some connections\""));
    let script = NIGHT.replace("{ 0.25, 1 }", "{ 2 }");
    std::fs::write(folder.join("wrong.lua"), script).unwrap();
    let output = run(folder, &["plan", "wrong.lua"]);
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{error}");
    assert!(error.contains("connect"), "{error}");
    let script = NIGHT.replace("\"own_technique\"", "\"own_techniqe\"");
    std::fs::write(folder.join("wrong.lua"), script).unwrap();
    let output = run(folder, &["plan", "wrong.lua"]);
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(error.contains("did you mean `own_technique`"), "{error}");
}

#[test]
fn the_experiment_of_the_template_runs() {
    let folder = folder();
    let folder = folder.path();
    let small = ["run", "own.lua", "time=0.1s", "size=16", "--no-tui"];
    let done = text(folder, &small);
    assert!(done.contains("own_technique"), "{done}");
}

#[test]
fn techniques_that_cannot_be_registered_are_refused() {
    const RR: Field = Field::optional("rr", Ty::Bool, "false", "a key of every render table");
    const NAMED: OwnTechnique =
        OwnTechnique::camera_paths::<Steps>(IntegratorRow { name: "nee", ..ROW });
    const INVALID: OwnTechnique = OwnTechnique::camera_paths::<Steps>(IntegratorRow {
        name: "Mine",
        ..ROW
    });
    const KEY: OwnTechnique = OwnTechnique::single_samples(IntegratorRow {
        params: Table {
            fields: &[RR],
            ..ROW.params
        },
        ..ROW
    });
    for technique in [NAMED, INVALID, KEY] {
        let code = lumbre::main_with(&[technique]);
        assert_eq!(format!("{code:?}"), format!("{:?}", ExitCode::from(2)));
    }
}
