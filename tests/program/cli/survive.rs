//! Failures, retries, limits of a night, a full disk, and the reason why a run would be rendered
//! again.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

use super::workplace::{Disk, Workplace};

/// A script that fails every cell at its first measurement.
const BROKEN: &str = r#"
local x = experiment("broken", { seed = 1, repeats = 5 })
x:render(function(p) return { scene = "ball.scn", integrator = "bpt", resolution = { 24, 16 }, backend = "mock" } end)
x:stop(stop.any { stop.predicate(function(row) error("lens fell off") end), stop.samples(4096) })
return x
"#;

#[test]
fn failures_are_recorded_counted_and_limited() {
    let place = Workplace::new();
    place.write("broken.lua", BROKEN);
    let night = place.run(&["run", "broken.lua", "--max-fails", "2"]);
    assert_eq!(night.status, 3, "{}", night.stderr);
    assert!(
        night.stderr.contains("2 runs have failed"),
        "{}",
        night.stderr
    );
    let records: Vec<String> = place.ending("out", "failed.json");
    assert_eq!(records.len(), 2);
    let record = place.json(&records[0]);
    assert!(
        record["reason"].as_str().unwrap().contains("lens fell off"),
        "{record}"
    );
    let log = record["log"].as_array().unwrap();
    assert!(
        log[0].as_str().unwrap().contains("started on mock"),
        "{record}"
    );
    assert!(
        log.last().unwrap().as_str().unwrap().contains("failed: "),
        "{record}"
    );
    assert!(
        place
            .succeed(&["ls"])
            .stdout
            .contains("2 failed, 3 pending")
    );

    let run = records[0].trim_end_matches("/failed.json");
    let explanation = place.succeed(&["show", run, "--why"]).stdout;
    assert!(
        explanation.contains("its last attempt failed") && explanation.contains("lens fell off"),
        "{explanation}"
    );
    // Only the two failed cells are retried, and only on request.
    let intended = place.succeed(&["run", "--failed", "--dry-run"]).stdout;
    assert!(intended.contains("runs 2 failed runs again"), "{intended}");
    assert_eq!(place.run(&["run", "--failed", "-q"]).status, 3);
    assert_eq!(place.ending("out", "failed.json").len(), 2);
    assert_eq!(place.run(&["run", "--retry", "-q"]).status, 3);
    assert_eq!(place.ending("out", "failed.json").len(), 5);
}

#[cfg(unix)]
#[test]
fn only_failed_cells_are_retried() {
    let place = Workplace::new();
    let script = place
        .read("night.lua")
        .replace("resolution = { 24, 16 }", "resolution = { 160, 120 }");
    place.write("night.lua", &script);
    let limited = format!(
        "trap '' XFSZ; ulimit -f 60; exec '{}' run night.lua -q",
        env!("CARGO_BIN_EXE_lumbre")
    );
    let output = Command::new("sh")
        .args(["-c", &limited])
        .current_dir(place.path("."))
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(3));
    assert!(place.finished().is_empty());
    place.succeed(&["run", "--failed", "-q"]);
    assert_eq!(place.finished().len(), 4);
    assert!(
        place
            .succeed(&["run", "--failed"])
            .stderr
            .contains("no run of out/night-")
    );
}

#[test]
fn a_deadline_ends_the_night_and_the_same_command_continues_it() {
    let place = Workplace::new();
    place.write("slow.lua", super::workplace::SLOW);
    let night = place.run(&["run", "slow.lua", "--until", "0.3s"]);
    assert_eq!(night.status, 4, "{}", night.stderr);
    assert!(night.stderr.contains("deadline"), "{}", night.stderr);
    assert!(place.finished().len() < 24);
    place.succeed(&["run", "slow.lua", "-q"]);
    assert_eq!(place.finished().len(), 24);
    assert!(
        place
            .fail(2, &["run", "slow.lua", "--until", "noon"])
            .contains("08:00")
    );
}

#[test]
fn explain_names_the_field_that_differs_or_the_file_that_is_damaged() {
    let place = Workplace::new();
    place.succeed(&["run", "night.lua", "-q"]);
    let done = place.finished().remove(0).0;
    let run = done.trim_end_matches("/done.json");
    let explanation = place.succeed(&["show", run, "--why"]).stdout;
    assert!(
        explanation.contains("would not be rendered again"),
        "{explanation}"
    );
    let id = &run.rsplit('/').next().unwrap()[..8];
    let json = place.succeed(&["show", id, "--why", "--json"]).stdout;
    assert_eq!(
        serde_json::from_str::<serde_json::Value>(&json).unwrap()["again"],
        false
    );

    let whole = place.read(&format!("{run}/metrics.csv"));
    place.write(&format!("{run}/metrics.csv"), &whole.replacen('1', "2", 1));
    let explanation = place.succeed(&["show", run, "--why"]).stdout;
    assert!(
        explanation.contains("would be rendered again: metrics.csv is damaged"),
        "{explanation}"
    );

    let script = place
        .read("night.lua")
        .replace("stop.samples(16)", "stop.samples(32)");
    place.write("night.lua", &script);
    let explanation = place.succeed(&["show", run, "--why"]).stdout;
    assert!(
        explanation.contains("no longer part of the script's plan")
            && explanation.contains("16 in the run, 32 in the script"),
        "{explanation}"
    );
}

#[cfg(target_os = "linux")]
#[test]
fn a_night_waits_until_a_full_disk_has_space() {
    let place = Workplace::new();
    let Some(disk) = Disk::mount(place.path("out"), 16) else {
        return;
    };
    let script = place
        .read("night.lua")
        .replace("resolution = { 24, 16 }", "resolution = { 160, 120 }");
    place.write(
        "night.lua",
        &script.replace("keep = { exr = \"pow2\" }", "keep = { exr = \"last\" }"),
    );
    disk.fill(297_216);
    let mut command = place.command(&["run", "night.lua", "--no-tui"]);
    let mut child = command
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
    let full = lines
        .by_ref()
        .map_while(Result::ok)
        .find(|line| line.contains("the disk is full"));
    let waiting = child.try_wait().unwrap().is_none();
    disk.clear();
    let rest: Vec<String> = lines.map_while(Result::ok).collect();
    let status = child.wait().unwrap();
    assert!(full.is_some() && waiting, "{rest:?}");
    assert_eq!(
        (status.code(), place.finished().len()),
        (Some(0), 4),
        "{rest:?}"
    );
    assert!(
        rest.iter()
            .any(|line| line.contains("there is space again")),
        "{rest:?}"
    );
}
