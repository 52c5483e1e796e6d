//! The key `shaders` of the render table: an axis over folders of shaders, their part in the identity
//! of runs, and where they are refused.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use lumbre_report::exr;

use super::harness;

const SCENE: &str = include_str!("../common/ball.scn");

/// Three choices of shaders with one reference.
const AXIS: &str = r#"
local x = experiment("axis", { seed = 7 })
x:axis("shaders", { "built-in", "mine", "copy" })
x:render(function(p)
  return { scene = "ball.scn", integrator = "bpt", resolution = { 8, 8 }, backend = "vulkan-compute",
    shaders = p.shaders }
end)
x:reference { stop = stop.samples(64) }
x:measure { rmse = metric.rmse() }
x:stop(stop.samples(2))
return x
"#;

/// One run, which names its shaders or leaves that to the environment.
const ONE: &str = r#"
local x = experiment("one", { seed = 7 })
x:axis("shaders", { "mine" })
x:render(function(p)
  return { scene = "ball.scn", integrator = "bpt", resolution = { 8, 8 }, backend = "vulkan-compute",
    shaders = p.shaders ~= "environment" and p.shaders or nil }
end)
x:stop(stop.samples(2))
return x
"#;

/// Variable that names one of the folders.
const MINE: (&str, &str) = ("LUMBRE_SHADERS", "mine");

/// An integrator that finds the same light in every sample, which a file of its own states.
const CONSTANT: &str = "#include \"film/film.glsl\"\n#include \"own/light.glsl\"\n\
    void bpt_sample(uvec2 pixel, inout Sampler n) { \
    sink(Contribution(pixel, LIGHT, LIGHT, 0u, 2u, Length(0.0))); }\n";

fn write(file: PathBuf, text: &str) {
    std::fs::create_dir_all(file.parent().unwrap()).unwrap();
    std::fs::write(file, text).unwrap();
}

/// Returns a folder with the scripts, the scene, and two folders of shaders.
fn folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path();
    write(path.join("ball.scn"), SCENE);
    write(path.join("axis.lua"), AXIS);
    write(path.join("one.lua"), ONE);
    write(path.join("mine/transport/integrator/bpt.glsl"), CONSTANT);
    write(
        path.join("mine/own/light.glsl"),
        "#define LIGHT vec3(2.5)\n",
    );
    let same = "shaders/scene.glsl";
    let same = Path::new(env!("CARGO_MANIFEST_DIR")).join(same);
    let same = std::fs::read_to_string(same).unwrap();
    write(path.join("copy/scene.glsl"), &same);
    dir
}

fn run(folder: &Path, args: &[&str]) -> Output {
    run_with(folder, args, None)
}

/// Runs the program, with a value of a variable.
fn run_with(folder: &Path, args: &[&str], variable: Option<(&str, &str)>) -> Output {
    Command::new(env!("CARGO_BIN_EXE_lumbre"))
        .current_dir(folder)
        .env("NO_COLOR", "1")
        .env_remove("LUMBRE_SHADERS")
        .envs(variable)
        .args(args)
        .output()
        .unwrap()
}

fn succeeded(output: Output) -> String {
    let all = [output.stdout, output.stderr].concat();
    let all = String::from_utf8_lossy(&all).into_owned();
    assert!(output.status.success(), "{all}");
    all
}

/// Checks that a plan is refused for these reasons.
fn refused(folder: &Path, args: &[&str], reasons: &[&str]) {
    refused_output(run(folder, args), reasons);
}

fn refused_output(output: Output, reasons: &[&str]) {
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{error}");
    for reason in reasons {
        assert!(error.contains(reason), "{reason} in {error}");
    }
}

/// Returns the picture of a run, by a part of its path.
fn picture(folder: &Path, part: &str) -> PathBuf {
    let is_wanted =
        |path: &PathBuf| path.ends_with("final.exr") && path.to_string_lossy().contains(part);
    let mut files = crate::common::files_below(&folder.join("out")).into_iter();
    let found = files.find(is_wanted);
    found.unwrap_or_else(|| panic!("no picture of {part}"))
}

#[test]
fn folders_are_refused_without_compiler_and_without_device() {
    let dir = folder();
    let path = dir.path();
    let without_programs = ("PATH", path.to_str().unwrap());
    refused_output(
        run_with(path, &["plan", "one.lua"], Some(without_programs)),
        &[
            "`shaders` cannot be used",
            "`glslangValidator`",
            "apt-get install glslang-tools",
            "one.lua:6",
        ],
    );
    refused(
        path,
        &["plan", "one.lua", "--backend", "cpu"],
        &["backend `cpu`", "no shaders", "leave out `shaders`"],
    );
    refused(
        path,
        &["plan", "one.lua", "shaders=nowhere"],
        &["there is no folder `nowhere`", "one.lua:6"],
    );
    // The variable concerns runs on devices only.
    let cpu = ["plan", "one.lua", "shaders=environment", "--backend", "cpu"];
    succeeded(run_with(path, &cpu, Some(MINE)));
}

#[test]
fn an_axis_of_folders_has_one_reference_and_runs_that_their_content_identifies() {
    let _ = or_return!(harness::device().filter(|_| harness::has_compiler()));
    let dir = folder();
    let path = dir.path();
    let plan = succeeded(run(path, &["plan", "axis.lua"]));
    for part in [
        "3 cells (0 cached), 1 reference (0 cached)",
        "shaders of mine (",
        "): 1 run\n",
        "axis `shaders` has no effect in 2 of 3 cells",
    ] {
        assert!(plan.contains(part), "{part} in {plan}");
    }
    succeeded(run(path, &["run", "axis.lua", "--no-tui"]));
    let own = picture(path, "shaders=mine");
    let (image, _) = exr::decode(&std::fs::read(&own).unwrap()).unwrap();
    assert!(image.data.iter().all(|pixel| *pixel == [2.5; 3]));
    let own = own.to_string_lossy();
    let shown = succeeded(run(path, &["show", "shaders=mine"]));
    assert!(
        shown.contains("mine") && shown.contains("shaders"),
        "{shown}"
    );

    // Neither the path of the folder nor the way in which it is named is part of an id.
    succeeded(run(path, &["run", "one.lua", "--no-tui"]));
    let cached = |args: &[&str], variable: Option<(&str, &str)>| {
        let plan = succeeded(run_with(path, args, variable));
        plan.contains("1 cell (1 cached)")
    };
    let by_variable = ["plan", "one.lua", "shaders=environment"];
    assert!(cached(&by_variable, Some(MINE)) && !cached(&by_variable, None));
    let reproduced = succeeded(run(path, &["reproduce", &own]));
    assert!(reproduced.contains("identical"), "{reproduced}");
    std::fs::rename(path.join("mine"), path.join("yours")).unwrap();
    assert!(cached(&["plan", "one.lua", "shaders=yours"], None));

    // The content is, also that of files that the program does not have.
    write(path.join("yours/notes.txt"), "no shader");
    assert!(cached(&["plan", "one.lua", "shaders=yours"], None));
    std::fs::rename(path.join("yours"), path.join("mine")).unwrap();
    write(
        path.join("mine/own/light.glsl"),
        "#define LIGHT vec3(1.5)\n",
    );
    assert!(!cached(&["plan", "one.lua"], None));
    let output = run(path, &["reproduce", &own]);
    let error = [output.stdout, output.stderr].concat();
    let error = String::from_utf8_lossy(&error).into_owned();
    assert!(!output.status.success(), "{error}");
    assert!(error.contains("have changed since"), "{error}");
    harness::assert_no_validation_messages();
}
