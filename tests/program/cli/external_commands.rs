//! Commands of scripts as techniques: their failures, identity, permission and interruption.
#![cfg(unix)]

use std::path::Path;
use std::process::{Command, Stdio};

use super::workplace::{ProgramOutput, Workplace};
use crate::cluster::night::wait_until;

/// A renderer whose behaviour is its first argument. It writes noise around 0.5.
const FAKE: &str = r#"
import json, os, random, struct, sys, time
mode, width, height, spp, seed, out = sys.argv[1], *map(int, sys.argv[2:6]), sys.argv[6]
open("started", "a").write(f"{mode} {os.getpid()}\n")
seconds = 1e-5 * spp
if mode == "hold":
    while os.path.exists("hold") and spp > 2: time.sleep(0.01)
elif mode == "hang":
    os.spawnlp(os.P_NOWAIT, "sleep", "sleep", "600")
    time.sleep(600)
elif mode == "garbage":
    print("\x1b[2Jnonsense\x07"); sys.exit(0)
elif mode == "signal":
    print("about to crash", file=sys.stderr); sys.stderr.flush()
    os.kill(os.getpid(), 11)
elif mode == "fails":
    print("first\n\x1b]0;title\x07 no light \u202e in the scene", file=sys.stderr); sys.exit(7)
elif mode == "size": width += 1
elif mode == "liar": seconds = 3600.0
elif mode == "negative": seconds = -1.0
if mode != "none":
    rng = random.Random(seed)
    values = [0.5 + rng.gauss(0, 0.1) / spp ** 0.5 for _ in range(3 * width * height)]
    if mode == "nan": values[5] = float("nan")
    with open(out, "wb") as file:
        file.write(b"PF\n%d %d\n-1\n" % (width, height) + struct.pack(f"<{len(values)}f", *values))
print(json.dumps({"seconds": seconds}))
"#;

/// Returns a script with the fake renderer, whose technique is `fake`; `options` are added to it.
fn script(options: &str, rest: &str) -> String {
    format!(
        r#"
local x = experiment("peers", {{ seed = 3 }})
local fake = external {{
  name = "fake", params = {{ mode = "good" }}, picture = "pfm", time = "json", {options}
  command = "python3 {{folder}}/fake.py {{mode}} {{width}} {{height}} {{spp}} {{seed}} {{out}}", scene = "raw:scene.txt",
}}
{rest}
return x
"#
    )
}

/// One cell for each mode, and one of a technique of this program.
const MODES: &str = r#"
x:axis("mode", { "good", "garbage", "signal", "fails", "none", "size", "nan", "liar", "negative", "own" })
x:render(function(p)
  if p.mode == "own" then return { scene = "ball.scn", integrator = "bpt", resolution = { 24, 16 }, backend = "mock" } end
  return { scene = "ball.scn", integrator = fake, mode = p.mode, resolution = { 24, 16 } }
end)
x:stop(stop.samples(4))
"#;

/// A night of one fake renderer whose mode is an axis.
const ONE: &str = r#"
x:axis("mode", { "good" })
x:axis("samples", { 64 })
x:render(function(p) return { scene = "ball.scn", integrator = fake, mode = p.mode, resolution = { 24, 16 } } end)
x:measure { every = "1s" }
x:stop(function(p) return stop.samples(p.samples) end)
"#;

pub fn place(script: &str) -> Workplace {
    let place = Workplace::new();
    place.write("fake.py", FAKE);
    place.write("scene.txt", "a scene of its own");
    place.write("peers.lua", script);
    std::fs::create_dir(place.path("tmp")).unwrap();
    place
}

/// Runs the program with temporary files in the folder `tmp` and a configuration of its own.
pub fn run(place: &Workplace, args: &[&str]) -> ProgramOutput {
    ProgramOutput::run(&mut command(place, args))
}

fn command(place: &Workplace, args: &[&str]) -> Command {
    let mut command = place.command(args);
    command
        .env("TMPDIR", place.path("tmp"))
        .env("XDG_CONFIG_HOME", place.path("config"))
        .stdin(Stdio::null());
    command
}

pub fn succeed(place: &Workplace, args: &[&str]) -> ProgramOutput {
    run(place, args).expect(0, args)
}

/// Returns the reason of the failed cell whose readable path ends so.
fn reason(place: &Workplace, path: &str) -> String {
    let failed = place
        .files("out")
        .into_iter()
        .find(|file| file.ends_with("failed.json") && config(place, file) == path);
    let failed = failed.unwrap_or_else(|| panic!("{path} has not failed"));
    place.json(&failed)["reason"].as_str().unwrap().to_owned()
}

/// Returns the readable path of the run whose folder has this file.
fn config(place: &Workplace, file: &str) -> String {
    let folder = Path::new(file).parent().unwrap().join("config.json");
    let config = place.json(folder.to_str().unwrap());
    config["path"].as_str().unwrap_or_default().to_owned()
}

pub fn no_temporary_files(place: &Workplace) {
    let left = place.files("tmp");
    assert!(left.is_empty(), "temporary files are left: {left:?}");
}

/// Waits until a process does not exist. One that was not waited for counts as existing.
fn wait_for_end(process: &str) {
    let process = Path::new("/proc").join(process);
    wait_until("the end of a process", || !process.exists());
}

/// Waits until the fake renderer was started this often, and returns its processes.
fn wait_for_starts(place: &Workplace, count: usize) -> Vec<String> {
    let started = || std::fs::read_to_string(place.path("started")).unwrap_or_default();
    wait_until("the start of the renderer", || {
        started().lines().count() >= count
    });
    let process = |line: &str| line.split(' ').nth(1).unwrap().to_owned();
    started().lines().map(process).collect()
}

#[test]
fn every_way_to_fail_is_a_failed_cell_with_its_output_and_the_night_goes_on() {
    if crate::common::lacks_python() {
        return;
    }
    let place = place(&script("", MODES));
    let ended = run(
        &place,
        &["run", "peers.lua", "--allow-commands", "--no-smoke"],
    );
    assert_eq!(ended.status, 3, "{}\n{}", ended.stdout, ended.stderr);
    assert_eq!(
        place.finished().len(),
        2,
        "the good cell and the built-in technique"
    );
    for (mode, expected) in [
        ("garbage", "no line with a JSON object"),
        ("garbage", "its last output: \\u{1b}[2Jnonsense\\u{7}"),
        ("signal", "signal: 11 (SIGSEGV)"),
        ("signal", "its last output: about to crash"),
        (
            "fails",
            "it failed (exit status: 7); its last output: first; \\u{1b}]0;title\\u{7} no light",
        ),
        ("none", "it wrote no picture to {out}"),
        ("size", "its picture has 25x16 pixels instead of 24x16"),
        ("nan", "1 values that are NaN or infinite"),
        (
            "liar",
            "it reported a render time of 3600.000 s, but it ran for",
        ),
        ("negative", "it reported a render time of -1 s"),
    ] {
        let found = reason(&place, &format!("mode={mode}/rep=0"));
        assert!(found.contains(expected), "{mode}: {found}");
    }
    let journal = place.read(&place.first_ending("out", "journal.jsonl"));
    assert!(
        journal.contains("25x16 pixels instead of"),
        "the journal has no reason"
    );
    let mut texts = vec![ended.stdout, ended.stderr, journal];
    let is_text = |file: &String| file.ends_with(".json") || file.ends_with(".txt");
    texts.extend(
        place
            .files("out")
            .iter()
            .filter(|file| is_text(file))
            .map(|file| place.read(file)),
    );
    for text in texts {
        let raw = text
            .chars()
            .find(|c| ['\u{1b}', '\u{7}', '\u{202e}'].contains(c));
        assert_eq!(raw, None, "{text}");
    }
    no_temporary_files(&place);
    // The smoke pass reports the same before the night begins.
    let only = [
        "run",
        "peers.lua",
        "--allow-commands",
        "mode=fails,good",
        "--out",
        "other",
    ];
    let ended = run(&place, &only);
    assert_eq!(ended.status, 3, "{}", ended.stderr);
    assert!(
        ended.stderr.contains("1 runs would fail"),
        "{}",
        ended.stderr
    );
}

#[test]
fn a_program_that_hangs_or_is_missing_fails_and_leaves_no_process() {
    if crate::common::lacks_python() {
        return;
    }
    let missing = ONE.replace(
        "x:axis(\"mode\", { \"good\" })",
        "local gone = external { name = \"gone\", command = \"/nowhere/renderer {scene} {spp} {seed} {out}\" }\n\
         x:axis(\"mode\", { \"hang\", \"gone\" })",
    );
    let missing = missing.replace(
        "integrator = fake, mode = p.mode,",
        "integrator = p.mode == \"gone\" and gone or fake, mode = p.mode ~= \"gone\" and p.mode or nil,",
    );
    let place = place(&script("timeout = 3,", &missing));
    let ended = run(
        &place,
        &["run", "peers.lua", "--allow-commands", "--no-smoke"],
    );
    assert_eq!(ended.status, 3, "{}\n{}", ended.stdout, ended.stderr);
    let hang = reason(&place, "mode=hang/samples=64/rep=0");
    assert!(
        hang.contains("longer than 3 s") && hang.contains("wrote no output"),
        "{hang}"
    );
    let gone = reason(&place, "mode=gone/samples=64/rep=0");
    assert!(
        gone.contains("`/nowhere/renderer` cannot be started"),
        "{gone}"
    );
    for process in wait_for_starts(&place, 1) {
        wait_for_end(&process);
        // Orphans that were ended are waited for by another process.
        let group = || {
            let mut kill = crate::common::kill();
            let signalled = kill.args(["-0", "--", &format!("-{process}")]).output();
            signalled.unwrap().status.success()
        };
        wait_until("the end of its children", || !group());
    }
    no_temporary_files(&place);
}

#[test]
fn commands_run_only_with_permission_and_the_plan_shows_them() {
    if crate::common::lacks_python() {
        return;
    }
    let place = place(&script(
        "version = { \"python3\", \"{folder}/version.py\" },",
        ONE,
    ));
    place.write(
        "version.py",
        "open('asked', 'a').write('x')\nprint('fake 2.0, beta')\nprint('more')",
    );
    let shown = succeed(&place, &["plan", "peers.lua"]).stdout;
    let command = format!(
        "external:fake  python3 {}/fake.py good {{width}} {{height}} {{spp}} {{seed}} {{out}}",
        place.path(".").canonicalize().unwrap().display()
    );
    let shown_plain = shown.replace("/./", "/");
    assert!(shown_plain.contains(&command), "{shown}\n{command}");
    assert!(
        shown.contains("not allowed yet") && shown.contains("version: python3"),
        "{shown}"
    );
    for args in [
        &["run", "peers.lua"][..],
        &["run", "--retry", "peers.lua"],
        &["submit", "hq", "peers.lua"],
    ] {
        let refused = run(&place, args);
        assert_eq!(refused.status, 2, "{}", refused.stderr);
        let text = refused.stderr.replace('\n', " ");
        assert!(
            text.contains("--allow-commands") && text.contains("external:fake"),
            "{text}"
        );
    }
    succeed(&place, &["check", "peers.lua"]);
    let ran = ["asked", "started", "out"].map(|file| place.path(file).exists());
    assert_eq!(ran, [false; 3], "something ran without permission");
    succeed(&place, &["run", "peers.lua", "--allow-commands", "-q"]);
    assert_eq!(place.read("asked"), "x", "the version is asked for once");
    let done = place.json(&place.finished()[0].0);
    let device = &done["devices"][0];
    assert_eq!(device["kind"], "processor", "{done}");
    assert!(device["threads"].as_u64() > Some(0), "{done}");
    assert_eq!(device["peer"]["program"], "fake 2.0; beta", "{done}");
    // The options of a recorded command are no permission: its folder may come from someone else.
    let refused = run(&place, &["run", "--retry"]);
    assert_eq!(refused.status, 2, "{}", refused.stderr);
    let run_folder = place.finished()[0].0.replace("/done.json", "");
    let refused = run(&place, &["reproduce", &run_folder]);
    assert!(refused.status != 0, "{}", refused.stdout);
    let text = refused.stdout.clone() + &refused.stderr;
    assert!(text.contains("add --allow-commands to run it"), "{text}");
    let again = succeed(&place, &["reproduce", &run_folder, "--allow-commands"]);
    assert!(again.stdout.contains("identical"), "{}", again.stdout);
}

#[test]
fn each_technique_of_one_program_has_its_own_version() {
    if crate::common::lacks_python() {
        return;
    }
    let rest = r#"
local other = external {
  name = "other", params = { mode = "good" }, picture = "pfm", time = "json",
  version = { "python3", "{folder}/other.py" },
  command = "python3 {folder}/fake.py {mode} {width} {height} {spp} {seed} {out}", scene = "raw:scene.txt",
}
x:axis("technique", { "fake", "other" })
x:render(function(p)
  local own = p.technique == "fake" and fake or other
  return { scene = "ball.scn", integrator = own, resolution = { 24, 16 } }
end)
x:stop(stop.samples(4))
"#;
    let place = place(&script(
        "version = { \"python3\", \"{folder}/version.py\" },",
        rest,
    ));
    place.write("version.py", "print('fake 2.0')");
    place.write("other.py", "print('other 1.0')");
    succeed(&place, &["run", "peers.lua", "--allow-commands", "-q"]);
    let mut found: Vec<String> = place
        .finished()
        .iter()
        .map(|(file, ..)| place.json(file)["devices"][0]["peer"]["program"].to_string())
        .collect();
    found.sort();
    assert_eq!(found, ["\"fake 2.0\"", "\"other 1.0\""]);
}

#[test]
fn identity_covers_parameters_files_and_version_but_no_places() {
    if crate::common::lacks_python() {
        return;
    }
    let place = place(&script(
        "version = { \"python3\", \"{folder}/version.py\" },",
        ONE,
    ));
    place.write("version.py", "print('fake 2.0')");
    let finished = |args: &[&str]| {
        let all = [&["run", "peers.lua", "--allow-commands", "-q"], args].concat();
        succeed(&place, &all);
        place.finished().len()
    };
    assert_eq!(finished(&["samples=4"]), 1);
    assert_eq!(finished(&["samples=4"]), 1, "nothing has changed");
    place.write(
        "peers.lua",
        &script(
            "version = { \"python3\", \"{folder}/version.py\" }, timeout = 99,",
            ONE,
        ),
    );
    assert_eq!(finished(&["samples=4"]), 1, "a limit changes no picture");
    place.write("scene.txt", "another scene");
    assert_eq!(finished(&["samples=4"]), 2, "the raw scene");
    place.write("fake.py", &format!("{FAKE}\n# edited"));
    assert_eq!(finished(&["samples=4"]), 3, "a file of the command");
    place.write("version.py", "print('fake 2.1')");
    assert_eq!(
        finished(&["samples=4"]),
        4,
        "the version, and the file that prints it"
    );
    assert_eq!(finished(&["samples=4", "mode=hold"]), 5, "a parameter");
    // A program whose version cannot be found is left out with the reason.
    place.write("version.py", "import sys; sys.exit('no licence')");
    let planned = succeed(&place, &["plan", "peers.lua", "--allow-commands"]);
    assert!(
        planned.stdout.contains("external:fake is not installed"),
        "{}",
        planned.stdout
    );
    assert!(planned.stdout.contains("no licence"), "{}", planned.stdout);
}

#[test]
fn an_interrupted_run_resumes_with_the_same_picture() {
    if crate::common::lacks_python() {
        return;
    }
    let [whole, cut] = [(); 2].map(|()| place(&script("", ONE)));
    succeed(
        &whole,
        &[
            "run",
            "peers.lua",
            "mode=hold",
            "--allow-commands",
            "-q",
            "--no-smoke",
        ],
    );
    cut.write("hold", "");
    let mut night = command(
        &cut,
        &[
            "run",
            "peers.lua",
            "mode=hold",
            "--allow-commands",
            "--no-smoke",
        ],
    )
    .stdout(Stdio::null())
    .stderr(Stdio::null())
    .spawn()
    .unwrap();
    // Waves of one and two samples pass, the third is held.
    let held = wait_for_starts(&cut, 3).pop().unwrap();
    let status = crate::common::kill()
        .args(["-INT", &night.id().to_string()])
        .status();
    assert!(status.unwrap().success());
    assert_eq!(night.wait().unwrap().code(), Some(130));
    wait_for_end(&held);
    no_temporary_files(&cut);
    std::fs::remove_file(cut.path("hold")).unwrap();
    let ended = succeed(
        &cut,
        &[
            "run",
            "peers.lua",
            "mode=hold",
            "--allow-commands",
            "--no-smoke",
        ],
    );
    assert!(
        ended
            .stderr
            .contains("resumes from its checkpoint after 3 samples"),
        "{}",
        ended.stderr
    );
    let picture = |place: &Workplace| {
        let file = place.first_ending("out", "final.exr");
        let bytes = std::fs::read(place.path(&file)).unwrap();
        lumbre_report::exr::decode(&bytes).unwrap().0
    };
    assert_eq!(picture(&whole), picture(&cut));
}

#[test]
fn external_techniques_take_turns_repeat_and_check_references_like_others() {
    if crate::common::lacks_python() {
        return;
    }
    let rest = r#"
x:axis("technique", { fake, "external:second" })
x:render(function(p) return { scene = "ball.scn", integrator = p.technique, resolution = { 24, 16 } } end)
x:reference { from = function() return { integrator = fake } end, stop = stop.samples(64),
  agree = { with = { integrator = "external:second", mode = "other" }, samples = 64 } }
x:measure { every = "1s", rmse = metric.rmse(), keep = { exr = "pow2" } }
x:stop(stop.samples(16))
x:table("errors", { value = "rmse", rows = "technique" })
"#;
    let second = r#"external { name = "second", params = { mode = "good" }, picture = "pfm", timeout = "2min",
  command = { "python3", "{folder}/fake.py", "{mode}", "{width}", "{height}", "{spp}", "{seed}", "{out}" }, scene = "raw:scene.txt" }"#;
    let text = script("", rest)
        .replace(
            "{ seed = 3 }",
            "{ seed = 3, repeats = 2, order = \"interleave\" }",
        )
        .replace("local fake", &format!("{second}\nlocal fake"));
    let place = place(&text);
    succeed(&place, &["run", "peers.lua", "--allow-commands", "-q"]);
    assert_eq!(place.finished().len(), 4);
    let table = place.read("out/latest/tables/errors.md");
    assert!(
        table.contains("external:fake") && table.contains("external:second"),
        "{table}"
    );
    let started = place.read("started");
    assert!(
        started.contains("other "),
        "the second technique of `agree` lost its parameters"
    );
    succeed(&place, &["report", "out/latest", "-q"]);
    let methods = place
        .read("out/latest/report/methods.md")
        .replace('\n', " ");
    assert!(
        methods.contains("external:fake was rendered by fake, which measures its render time"),
        "{methods}"
    );
    assert!(
        methods
            .contains("external:second was rendered by second; its render time is the wall-clock"),
        "{methods}"
    );
    // Another picture is an alarm.
    place.write(
        "fake.py",
        &FAKE.replace("0.5 + rng", "(0.6 if mode == 'other' else 0.5) + rng"),
    );
    let ended = run(&place, &["run", "peers.lua", "--allow-commands", "-q"]);
    assert_eq!(ended.status, 6, "{}\n{}", ended.stdout, ended.stderr);
}

#[test]
fn mistakes_in_a_script_are_reported_with_their_line() {
    for (options, rest, expected) in [
        ("tme = 1,", ONE, "unknown key `tme`"),
        (
            "serve = true,",
            ONE,
            "a server receives {spp} in its requests",
        ),
        (
            "",
            "external { name = \"fake\", command = \"x {scene} {spp} {seed} {out}\" }",
            "declared twice",
        ),
        (
            "",
            "external { name = \"mitsuba\", command = \"x {scene} {spp} {seed} {out}\" }",
            "built-in bridge",
        ),
        (
            "",
            &ONE.replace("integrator = fake", "integrator = \"external:fak\""),
            "declare another renderer by external",
        ),
        (
            "",
            &ONE.replace("mode = p.mode", "modes = p.mode"),
            "did you mean `mode`?",
        ),
        (
            "",
            &ONE.replace("mode = p.mode", "sampler = \"sobol\""),
            "use a sampler of their own",
        ),
        (
            "",
            &ONE.replace("mode = p.mode", "aa = { filter = \"gauss\" }"),
            "declare `filters`",
        ),
        (
            "",
            &ONE.replace("mode = p.mode", "films = \"albedo\""),
            "declares no layer `albedo`",
        ),
    ] {
        let place = place(&script(options, rest));
        let ended = run(&place, &["plan", "peers.lua"]);
        let text = ended
            .stderr
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(" ");
        assert_eq!(ended.status, 2, "{expected}: {text}");
        assert!(text.contains(expected), "{expected}: {text}");
    }
}
