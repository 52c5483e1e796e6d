//! Techniques in shared libraries: the example in C++ beside the built-in technique, and libraries
//! that are refused.

use std::path::Path;
use std::process::{Command, Stdio};

use lumbre_light::film::Image;
use lumbre_report::exr;

use super::workplace::{ProgramOutput, Workplace};
use crate::cluster::night::{home, wait_until};

/// Header and example.
const HEADER: &str = include_str!("../../../docs/external/technique.h");
const EXAMPLE: &str = include_str!("../../../docs/external/nee.cpp");

/// Night of the example, whose reference the built-in technique renders and the example checks.
const NIGHT: &str = concat!(
    r#"
local x = experiment("plugin", { seed = 5 })
local scene = ""#,
    env!("CARGO_MANIFEST_DIR"),
    r#"/scenes/cornell.lua"
x:axis("exponent", { 1, 2 })
x:render(function(p)
  return { scene = scene, scene_options = { inside = "spheres" }, integrator = "nee_cpp", exponent = p.exponent,
    max_depth = 5, resolution = { 48, 48 }, rr = { start = 3 } }
end)
x:reference { from = function() return { integrator = "nee" } end, stop = stop.samples(256),
  agree = { with = "nee_cpp", samples = 256 } }
x:measure { mse = metric.mse() }
x:stop(function(p) return stop.samples(8) end)
return x
"#
);

/// Compiles a text as a shared library. Returns `None`, and prints `SKIPPED`, without a compiler.
fn compile(place: &Workplace, name: &str, text: &str) -> Option<String> {
    place.write("technique.h", HEADER);
    place.write(&format!("{name}.cpp"), text);
    let compiled = Command::new("c++")
        .current_dir(place.path("."))
        .args(["-O1", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC"])
        .args([&format!("{name}.cpp"), "-o", &format!("{name}.so")])
        .output();
    let Ok(compiled) = compiled else {
        crate::common::skipped("there is no C++ compiler");
        return None;
    };
    let errors = String::from_utf8_lossy(&compiled.stderr);
    assert!(compiled.status.success(), "{errors}");
    Some(
        place
            .path(&format!("{name}.so"))
            .to_string_lossy()
            .into_owned(),
    )
}

/// Runs the program with libraries.
fn run(place: &Workplace, libraries: &str, args: &[&str]) -> ProgramOutput {
    let mut command = place.command(args);
    ProgramOutput::run(command.env("LUMBRE_PLUGINS", libraries))
}

#[test]
fn the_example_in_cpp_renders_what_nee_renders() {
    let place = Workplace::new();
    place.write("plugin.lua", NIGHT);
    let Some(library) = compile(&place, "nee", EXAMPLE) else {
        return;
    };
    let done = run(&place, &library, &["run", "plugin.lua", "--no-tui"]);
    assert_eq!(done.status, 0, "{}", done.stderr);
    let all = format!("{}{}", done.stdout, done.stderr);
    assert!(all.contains("technique nee_cpp of the library"), "{all}");
    assert!(all.contains("agrees with `nee_cpp`"), "{all}");
    let again = run(&place, &library, &["run", "plugin.lua", "--no-tui"]);
    assert!(again.stderr.contains("nothing to do"), "{}", again.stderr);

    // The content of the library is part of run ids; its name and folder are not.
    let moved = place.path("moved.so");
    std::fs::copy(&library, &moved).unwrap();
    let moved = moved.to_string_lossy();
    let same = run(&place, &moved, &["run", "plugin.lua", "--no-tui"]);
    assert!(same.stderr.contains("nothing to do"), "{}", same.stderr);
    append(Path::new(&*moved), b"changed");
    let plan = run(&place, &moved, &["plan", "plugin.lua"]).stdout;
    assert!(plan.contains("2 cells (0 cached)"), "{plan}");

    // Another weight is another picture.
    let biased = EXAMPLE.replace(
        "light.delta ? 1 : weight(",
        "light.delta ? 1 : 0.8f * weight(",
    );
    assert_ne!(biased, EXAMPLE);
    let library = compile(&place, "biased", &biased).unwrap();
    let wrong = run(&place, &library, &["run", "plugin.lua", "--no-tui"]);
    assert_eq!(wrong.status, 6, "{}", wrong.stderr);
    assert!(
        wrong.stderr.contains("DISAGREES with `nee_cpp`"),
        "{}",
        wrong.stderr
    );
}

/// Appends bytes to a file.
fn append(file: &Path, bytes: &[u8]) {
    let mut content = std::fs::read(file).unwrap();
    content.extend_from_slice(bytes);
    std::fs::write(file, content).unwrap();
}

#[test]
fn pictures_have_the_same_bits_for_any_number_of_threads() {
    let place = Workplace::new();
    let script = NIGHT.replace("{ 1, 2 }", "{ 2 }");
    place.write("plugin.lua", &script);
    let Some(library) = compile(&place, "nee", EXAMPLE) else {
        return;
    };
    let picture = |threads: &str| {
        let args = [
            "run",
            "plugin.lua",
            "--no-tui",
            "--out",
            threads,
            "--threads",
            threads,
        ];
        let done = run(&place, &library, &args);
        assert_eq!(done.status, 0, "{}", done.stderr);
        place.path(&format!("{threads}/latest/summary.csv"))
    };
    let errors = |file: &Path| {
        let text = std::fs::read_to_string(file).unwrap();
        let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
        let column = lines.next().unwrap().iter().position(|name| *name == "mse");
        let row = lines.next().unwrap();
        row[column.unwrap_or_else(|| panic!("{text}"))].to_owned()
    };
    assert_eq!(errors(&picture("1")), errors(&picture("3")));
}

/// One run that is long enough to be killed after its first checkpoint.
fn long_night() -> String {
    let script = NIGHT.replace("{ 1, 2 }", "{ 2 }");
    let (before, rest) = script.split_once("x:reference").unwrap();
    let (_, rest) = rest.split_once("x:measure").unwrap();
    let long = format!("{before}x:checkpoint(\"0.05s\")\nx:measure{rest}");
    long.replace("{ mse = metric.mse() }", "{ every = \"0.05s\" }")
        .replace("stop.samples(8)", "stop.samples(384)")
}

/// Returns the path and the picture of the only run of a night.
fn final_picture(place: &Workplace, out: &str) -> (String, Image) {
    let pictures = place.ending(out, "final.exr");
    assert_eq!(pictures.len(), 1, "{pictures:?}");
    let bytes = std::fs::read(place.path(&pictures[0])).unwrap();
    (pictures[0].clone(), exr::decode(&bytes).unwrap().0)
}

#[test]
fn a_killed_run_resumes_with_the_same_bits_and_is_reproduced() {
    let place = Workplace::new();
    place.write("long.lua", &long_night());
    let Some(library) = compile(&place, "nee", EXAMPLE) else {
        return;
    };
    let args = ["run", "long.lua", "--no-tui", "--no-smoke"];
    let mut night = place
        .command(&args)
        .env("LUMBRE_PLUGINS", &library)
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    wait_until("a checkpoint", || {
        place.files("out").iter().any(|file| file.contains("ckpt."))
    });
    night.kill().unwrap();
    night.wait().unwrap();
    let resumed = run(&place, &library, &args);
    assert_eq!(resumed.status, 0, "{}", resumed.stderr);
    assert!(
        resumed.stderr.contains("resumes from its checkpoint"),
        "{}",
        resumed.stderr
    );
    let whole = run(&place, &library, &[&args[..], &["--out", "whole"]].concat());
    assert_eq!(whole.status, 0, "{}", whole.stderr);
    let (file, picture) = final_picture(&place, "out");
    assert_eq!(picture, final_picture(&place, "whole").1);
    let reproduced = run(&place, &library, &["reproduce", &file]);
    assert!(
        reproduced.stdout.contains("identical"),
        "{}",
        reproduced.stdout
    );
}

#[test]
fn jobs_name_the_library_and_results_are_read_without_it_and_with_another() {
    let place = Workplace::new();
    place.write("plugin.lua", &NIGHT.replace("{ 1, 2 }", "{ 2 }"));
    let Some(library) = compile(&place, "nee", EXAMPLE) else {
        return;
    };
    // Without the queue's program the plan is saved, and workers are started by hand.
    run(&place, &library, &["submit", "hq", "plugin.lua", "-q"]);
    let home = home(&place, "out");
    let job = place.read(&format!("{home}/job/hq.sh"));
    let export = format!("\nexport LUMBRE_PLUGINS='{library}'\n");
    assert!(job.contains(&export), "{job}");
    let without = place.run(&["work", &home, "-q"]);
    assert_eq!(without.status, 2, "{}", without.stderr);
    assert!(
        without.stderr.contains("unknown integrator `nee_cpp`"),
        "{}",
        without.stderr
    );
    let done = run(&place, &library, &["work", &home, "-q"]);
    assert_eq!(done.status, 0, "{}", done.stderr);

    // A library that was built again, or is not there, makes no stored run wrong.
    let file = &place.first_ending(&home, "final.exr");
    let other = place.path("other.so").to_string_lossy().into_owned();
    std::fs::copy(&library, &other).unwrap();
    append(Path::new(&other), b"changed");
    for library in [other.as_str(), ""] {
        let shown = run(&place, library, &["show", "exponent=2"]);
        let all = format!("{}{}", shown.stdout, shown.stderr);
        assert!(shown.status == 0 && !all.contains("left out"), "{all}");
    }
    let reproduced = run(&place, &other, &["reproduce", file]);
    assert!(
        reproduced
            .stderr
            .contains("the library of `nee_cpp` has changed since"),
        "{}",
        reproduced.stderr
    );
    assert!(
        reproduced.stdout.contains("identical"),
        "{}",
        reproduced.stdout
    );
    let without = run(&place, "", &["reproduce", file]);
    assert_eq!(without.status, 3, "{}", without.stdout);
    assert!(
        without.stdout.contains("no integrator `nee_cpp`"),
        "{}",
        without.stdout
    );
}

/// Technique whose samples have the index of their iteration in red, one in green, and in blue the
/// number of iterations that have begun and not ended.
const ITERATIONS: &str = r#"
#include "technique.h"
#include <atomic>
static std::atomic<int> open_iterations{0};
static void *begin(const double *, uint64_t index) {
    open_iterations++;
    return new uint64_t(index);
}
static void end(void *iteration) {
    open_iterations--;
    delete static_cast<uint64_t *>(iteration);
}
static void sample(const lumbre_host *host, lumbre_sample *s, const void *iteration) {
    const float index = static_cast<float>(*static_cast<const uint64_t *>(iteration));
    const float value[3] = {index, 1, static_cast<float>(open_iterations)};
    host->add(s, value, 0, 2);
}
static const lumbre_technique technique = {
    "iterations", "iterations", "Counts iterations.", nullptr, 1, 0, nullptr, begin, end, sample};
extern "C" uint32_t lumbre_technique_abi() { return LUMBRE_TECHNIQUE_ABI; }
extern "C" const lumbre_technique *lumbre_technique_describe() { return &technique; }
"#;

#[test]
fn iterations_of_a_library_begin_and_end_one_after_the_other() {
    let place = Workplace::new();
    let Some(library) = compile(&place, "iterations", ITERATIONS) else {
        return;
    };
    for threads in ["1", "3"] {
        let output = format!("mean-{threads}.exr");
        let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell.lua");
        let args = [
            "render",
            scene,
            "-i",
            "iterations",
            "--spp",
            "8",
            "--size",
            "16x9",
            "--threads",
            threads,
            "-o",
            &output,
        ];
        let done = run(&place, &library, &args);
        assert_eq!(done.status, 0, "{}", done.stderr);
        let file = std::fs::read(place.path(&output)).unwrap();
        let mean = exr::decode(&file).unwrap().0;
        // The mean of the indices 0 to 7.
        assert!(
            mean.data.iter().all(|rgb| *rgb == [3.5, 1.0, 1.0]),
            "{:?}",
            mean.data[0]
        );
    }
}

#[test]
fn libraries_that_cannot_be_used_are_refused_with_the_reason() {
    let place = Workplace::new();
    place.write("plugin.lua", NIGHT);
    place.write("text.so", "this is no library");
    let text = place.path("text.so").to_string_lossy().into_owned();
    let refused = |library: &str, reason: &str| {
        let output = run(&place, library, &["plan", "plugin.lua"]);
        assert_eq!(output.status, 2, "{}", output.stderr);
        assert!(output.stderr.contains(reason), "{}", output.stderr);
    };
    refused(&text, "no shared library that can be loaded");
    refused("/nowhere/nee.so", "No such file");
    refused(&[text.as_str(); 5].join(":"), "at most 4");

    let Some(empty) = compile(
        &place,
        "empty",
        "extern \"C\" int nothing() { return 0; }\n",
    ) else {
        return;
    };
    refused(&empty, "no function `lumbre_technique_abi`");
    let half = "extern \"C\" unsigned lumbre_technique_abi() { return 2; }\n";
    let half = compile(&place, "half", half).unwrap();
    refused(&half, "no function `lumbre_technique_describe`");
    let replaced = |name: &str, from: &str, to: &str| {
        let text = EXAMPLE.replacen(from, to, 1);
        assert_ne!(text, EXAMPLE);
        compile(&place, name, &text).unwrap()
    };
    let other = replaced("other", "return LUMBRE_TECHNIQUE_ABI", "return 7");
    refused(
        &other,
        "implements version 7 of technique.h, and this program version 2",
    );
    let named = replaced("named", "\"nee_cpp\",", "\"nee\",");
    refused(&named, "there are two techniques `nee`");
    let taken = replaced("taken", "\"exponent\"", "\"max_depth\"");
    refused(
        &taken,
        "`max_depth` of `nee_cpp` is a key of every render table",
    );
    let range = replaced("range", "1, 4, 2}", "1, 4, 5}");
    refused(
        &range,
        "the default 5 of the parameter `exponent` is not in its range 1 to 4",
    );

    let timed = NIGHT.replace(
        "rr = {",
        "film = { time = { bin = 0.1, bins = 9 } }, rr = {",
    );
    place.write("plugin.lua", &timed);
    let library = compile(&place, "nee", EXAMPLE).unwrap();
    refused(&library, "returns no optical lengths");
}
