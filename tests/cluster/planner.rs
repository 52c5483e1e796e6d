//! `lumbre run` as one of several workers: comparison groups stay on one device, whichever worker
//! starts them.

use std::collections::BTreeSet;
use std::process::{Child, Command, Stdio};

use super::night::{RUNS, differing, evidence, finished_once, home, script, until};
use super::workplace::Workplace;

/// Returns the program on a machine that appears to have another name; `None` if this machine
/// cannot simulate that.
fn elsewhere(place: &Workplace, args: &[&str]) -> Option<Command> {
    let lends = Command::new("unshare")
        .args(["--uts", "hostname", "elsewhere"])
        .output();
    lends.ok().filter(|ended| ended.status.success())?;
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

fn quietly(mut command: Command) -> Child {
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
fn who_plans_and_renders_shares_comparisons_with_workers_as_workers_do() {
    let place = Workplace::new();
    place.write("crew.lua", &script(1000));
    let Some(_) = elsewhere(&place, &[]) else {
        return println!("SKIPPED: no process can have a host name of its own here");
    };
    let mut planner = quietly(place.command(&["run", "crew.lua", "--no-smoke"]));
    let journals = || {
        place
            .files("out")
            .into_iter()
            .filter(|file| file.ends_with(".jsonl"))
    };
    until("the planner's first cell", || {
        place.path("out/latest").exists()
            && std::fs::read_dir(place.path("out/latest/bonds")).is_ok()
    });
    let home = home(&place, "out");
    assert!(
        !place.path(&format!("{home}/workers")).exists(),
        "a night of one process has no workers"
    );
    let mut worker = quietly(elsewhere(&place, &["work", &home, "--no-tui"]).unwrap());
    until("the other's first cell", || {
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
    let (ours, theirs) = (
        depths(&place, &format!("{home}/journal.jsonl")),
        depths(&place, &others),
    );
    assert_eq!(
        (ours.len(), theirs.len()),
        (1, 1),
        "one comparison each: {ours:?} {theirs:?}"
    );
    assert!(ours.is_disjoint(&theirs), "{ours:?} {theirs:?}");
    assert!(
        !place.path(&format!("{home}/planners")).exists(),
        "it has left"
    );
    let status = place.succeed(&["status", &home]).stdout;
    assert!(
        status.contains("workers: 0 active, 0 lost, 1 exited"),
        "{status}"
    );
    place.succeed(&["run", "crew.lua", "--out", "alone", "-q"]);
    assert_eq!(
        differing(&evidence(&place, "out"), &evidence(&place, "alone")),
        Vec::<String>::new()
    );
}

#[test]
fn a_comparison_of_another_model_is_left_alone_and_said() {
    let place = Workplace::new();
    place.write("crew.lua", &script(0));
    place.succeed(&["run", "crew.lua", "-q"]);
    let home = home(&place, "out");
    // As if another machine had started one of the two comparison groups without finishing any of
    // it.
    let bond = place.files(&format!("{home}/bonds")).remove(0);
    place.write(
        &bond,
        r#"{"device":"far, device 0","model":"a better device"}"#,
    );
    let all = place.files(&format!("{home}/runs"));
    let done: Vec<&String> = all
        .iter()
        .filter(|file| file.ends_with("/done.json"))
        .collect();
    done.iter()
        .for_each(|file| std::fs::remove_file(place.path(file)).unwrap());
    let said = place.fail(4, &["run", "crew.lua", "--no-smoke"]);
    for part in [
        "6 cells left to workers with other devices",
        "another model of device: a better device",
        "--affinity none",
    ] {
        assert!(said.contains(part), "{part} in {said}");
    }
    let there = |place: &Workplace| {
        place
            .files(&home)
            .iter()
            .filter(|file| file.ends_with("/done.json"))
            .count()
    };
    assert_eq!(there(&place), 6);
    place.succeed(&["run", "crew.lua", "-q", "--affinity", "none"]);
    assert_eq!(there(&place) + 2, RUNS);
}
