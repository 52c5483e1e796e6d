//! Nights that are killed repeatedly at random instants, and their final results.

use super::workplace::Workplace;

/// Runs `lumbre verify --kill` and returns how many kills found a checkpoint to resume from.
fn kill(args: &[&str]) -> u64 {
    let place = Workplace::new();
    let output = place.run(&[&["verify", "--json"], args].concat());
    assert_eq!(output.status, 0, "{}{}", output.stdout, output.stderr);
    let report: serde_json::Value = serde_json::from_str(&output.stdout).unwrap();
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
fn a_night_killed_at_random_instants_leaves_the_same_bytes() {
    assert!(
        kill(&["--kill", "25"]) >= 5,
        "at least 5 of 25 kills must leave a checkpoint"
    );
}

#[test]
fn interleaved_techniques_killed_at_random_instants_leave_the_same_bytes() {
    assert!(kill(&["--kill", "25", "--order", "interleave", "--seed", "3"]) >= 5);
}

#[test]
fn four_processes_killed_at_random_instants_leave_the_same_bytes() {
    kill(&["--kill", "16", "--processes", "4", "--seed", "2"]);
}
