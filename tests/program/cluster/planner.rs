//! `lumbre run` as one of several workers: every comparison group stays on the device of the
//! process that starts it.

use std::collections::BTreeSet;
use std::process::{Child, Command, Stdio};

use super::night::{
    OTHER_DEVICE, RUNS, differing, finished_once, home, results, script, wait_until,
};
use super::workplace::Workplace;

/// Returns the program as a command on a simulated machine with another host name; `None` if this
/// machine cannot simulate that.
fn on_another_host(place: &Workplace, args: &[&str]) -> Option<Command> {
    let supported = Command::new("unshare")
        .args(["--uts", "hostname", "elsewhere"])
        .output();
    supported.ok().filter(|ended| ended.status.success())?;
    let mut command = Command::new("unshare");
    command.args([
        "--uts",
        "sh",
        "-c",
        "hostname elsewhere && exec \"$0\" \"$@\"",
        env!("CARGO_BIN_EXE_lumbre"),
    ]);
    command
        .args(args)
        .current_dir(place.path(""))
        .env("NO_COLOR", "1");
    Some(command)
}

fn spawn_quietly(mut command: Command) -> Child {
    command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

/// Returns the depths of the cells that a journal records as finished.
fn depths(place: &Workplace, journal: &str) -> BTreeSet<String> {
    let lines: Vec<serde_json::Value> = place
        .read(journal)
        .lines()
        .filter_map(|line| serde_json::from_str(line).ok())
        .collect();
    let done = lines
        .iter()
        .filter(|line| line["event"] == "cell_finished" && line["outcome"] == "done");
    let paths = done.filter_map(|line| {
        line["path"]
            .as_str()?
            .split('/')
            .find(|part| part.starts_with("depth="))
    });
    paths.map(str::to_owned).collect()
}

#[test]
fn a_planner_that_renders_shares_comparison_groups_with_workers() {
    let place = Workplace::new();
    place.write("grid.lua", &script(1000));
    let Some(_) = on_another_host(&place, &[]) else {
        return crate::common::skipped("this machine cannot give a process another host name");
    };
    let mut planner = spawn_quietly(place.command(&["run", "grid.lua", "--no-smoke"]));
    let journals = || place.ending("out", ".jsonl").into_iter();
    wait_until("the planner's first cell", || {
        place.path("out/latest").exists()
            && std::fs::read_dir(place.path("out/latest/affinity")).is_ok()
    });
    let home = home(&place, "out");
    assert!(
        !place.path(&format!("{home}/workers")).exists(),
        "a night of one process has no workers"
    );
    let mut worker = spawn_quietly(on_another_host(&place, &["work", &home, "--no-tui"]).unwrap());
    wait_until("the worker's first cell", || {
        let others = journals().filter(|file| file.contains("/workers/elsewhere-"));
        others
            .into_iter()
            .any(|file| place.read(&file).contains("cell_started"))
    });
    let status = place.succeed(&["status", &home]).stdout;
    assert!(
        status.contains("workers: 2 active, 0 lost, 0 exited") && status.contains("elsewhere"),
        "{status}"
    );
    assert!(planner.wait().unwrap().success());
    assert!(worker.wait().unwrap().success());

    finished_once(&place, &home, 0);
    let others = journals()
        .find(|file| file.contains("/workers/elsewhere-"))
        .unwrap();
    let (planner_depths, worker_depths) = (
        depths(&place, &format!("{home}/journal.jsonl")),
        depths(&place, &others),
    );
    assert_eq!(
        (planner_depths.len(), worker_depths.len()),
        (1, 1),
        "each must render one comparison group: {planner_depths:?} {worker_depths:?}"
    );
    assert!(
        planner_depths.is_disjoint(&worker_depths),
        "{planner_depths:?} {worker_depths:?}"
    );
    assert!(
        !place.path(&format!("{home}/planners")).exists(),
        "the planner must have removed its entry"
    );
    let status = place.succeed(&["status", &home]).stdout;
    assert!(
        status.contains("workers: 0 active, 0 lost, 1 exited"),
        "{status}"
    );
    place.succeed(&["run", "grid.lua", "--out", "alone", "-q"]);
    assert_eq!(
        differing(&results(&place, "out"), &results(&place, "alone")),
        Vec::<String>::new()
    );
}

#[test]
fn a_comparison_group_of_another_device_model_is_skipped_and_reported() {
    let place = Workplace::new();
    place.write("grid.lua", &script(0));
    place.succeed(&["run", "grid.lua", "-q"]);
    let home = home(&place, "out");
    // Simulates another machine that started one of the two comparison groups and finished no cell
    // of it.
    let affinity_file = place.files(&format!("{home}/affinity")).remove(0);
    place.write(&affinity_file, OTHER_DEVICE);
    let done = place.ending(&format!("{home}/runs"), "/done.json");
    done.iter()
        .for_each(|file| std::fs::remove_file(place.path(file)).unwrap());
    let error = place.fail(4, &["run", "grid.lua", "--no-smoke"]);
    for part in [
        "6 cells left to workers with other devices",
        "another model of device: a better device",
        "--affinity none",
    ] {
        assert!(error.contains(part), "{part} in {error}");
    }
    let count_done = |place: &Workplace| place.ending(&home, "/done.json").len();
    assert_eq!(count_done(&place), 6);
    place.succeed(&["run", "grid.lua", "-q", "--affinity", "none"]);
    assert_eq!(count_done(&place) + 2, RUNS);
}
