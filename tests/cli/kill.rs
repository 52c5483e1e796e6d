//! Nights that are killed at random instants, repeatedly, and their results in the end.

use super::workplace::Workplace;

/// Runs `lumbre verify --kill` and returns how many kills found a checkpoint to resume from.
fn kill(args: &[&str]) -> u64 {
    let place = Workplace::new();
    let ended = place.run(&[&["verify", "--json"], args].concat());
    assert_eq!(ended.status, 0, "{}{}", ended.stdout, ended.stderr);
    let report: serde_json::Value = serde_json::from_str(&ended.stdout).unwrap();
    assert_eq!(
        (
            &report["passed"],
            report["problems"].as_array().unwrap().len()
        ),
        (&true.into(), 0)
    );
    assert!(report["files"].as_u64().unwrap() > 60, "{report}");
    report["checkpoints"].as_u64().unwrap()
}

#[test]
fn a_night_killed_at_fifty_random_instants_leaves_the_same_bytes() {
    assert!(
        kill(&["--kill", "50"]) >= 10,
        "most kills hit a run in its middle"
    );
}

#[test]
fn techniques_that_take_turns_leave_the_same_bytes_when_they_are_killed_fifty_times() {
    assert!(kill(&["--kill", "50", "--order", "interleave", "--seed", "3"]) >= 10);
}

#[test]
fn four_processes_that_are_killed_at_random_leave_the_same_bytes() {
    kill(&["--kill", "16", "--processes", "4", "--seed", "2"]);
}
