//! Nights that are stopped by signals.

use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use super::workplace::{SLOW, Workplace};

const CELLS: usize = 24;
/// Longest wait in these tests before they fail; no wait is expected to come near it.
const PATIENCE: Duration = Duration::from_secs(120);

fn start(place: &Workplace, script: &str) -> Child {
    place.write("slow.lua", script);
    let mut command = place.command(&["run", "slow.lua", "-q"]);
    command
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

/// Waits until one cell is done while others are not.
fn wait_for_first(place: &Workplace, child: &mut Child) {
    let since = Instant::now();
    while place.finished().is_empty() {
        assert!(since.elapsed() < PATIENCE, "no cell was done");
        assert!(child.try_wait().unwrap().is_none(), "the night ended early");
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn send(child: &Child, signal: &str) {
    let status = Command::new("kill")
        .args([signal, &child.id().to_string()])
        .status()
        .unwrap();
    assert!(status.success());
}

/// Stops a night in its middle by a signal, returns its exit code, then runs again and checks that
/// only the unfinished runs are rendered.
fn end_and_go_on(signal: &str) -> Option<i32> {
    let place = Workplace::new();
    let mut child = start(&place, SLOW);
    wait_for_first(&place, &mut child);
    send(&child, signal);
    let status = child.wait().unwrap();
    let before = place.finished();
    assert!(
        !before.is_empty() && before.len() < CELLS,
        "{} cells were done",
        before.len()
    );
    let again = place.succeed(&["run", "slow.lua"]);
    assert!(!again.stderr.contains("nothing to do"), "{}", again.stderr);
    let after = place.finished();
    assert_eq!(after.len(), CELLS);
    for done in &before {
        assert!(after.contains(done), "{} was rendered twice", done.0);
    }
    assert!(
        !place.files("out").iter().any(|f| f.ends_with(".tmp")),
        "a temporary file stayed"
    );
    status.code()
}

#[test]
fn after_kill_only_what_was_not_done_is_rendered() {
    assert_eq!(end_and_go_on("-KILL"), None);
}

#[test]
fn sigterm_ends_the_wave_and_asks_to_be_run_again() {
    assert_eq!(end_and_go_on("-TERM"), Some(75));
}

#[test]
fn sigusr1_does_the_same() {
    assert_eq!(end_and_go_on("-USR1"), Some(75));
}

#[test]
fn ctrl_c_ends_the_wave_and_leaves() {
    assert_eq!(end_and_go_on("-INT"), Some(130));
}

#[test]
fn a_closed_terminal_writes_a_checkpoint_and_the_night_goes_on() {
    let place = Workplace::new();
    // Fewer cells with more waves, so that a checkpoint exists for longer.
    let script = SLOW
        .replace("repeats = 24", "repeats = 9")
        .replace("row.wave >= 3", "row.wave >= 8");
    let mut child = start(&place, &script);
    wait_for_first(&place, &mut child);
    let since = Instant::now();
    // Checkpoints appear and disappear with their cells: one of the next signals hits.
    let kept = |place: &Workplace| place.files("out").iter().any(|f| f.ends_with("ckpt.a"));
    while !kept(&place) {
        assert!(since.elapsed() < PATIENCE, "no checkpoint was written");
        assert!(
            child.try_wait().unwrap().is_none(),
            "the night ended before a checkpoint was seen"
        );
        send(&child, "-HUP");
        std::thread::sleep(Duration::from_millis(2));
    }
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert_eq!(place.finished().len(), 9);
    assert!(!kept(&place), "checkpoints go when their run is done");
    assert!(
        place
            .read("out/latest/journal.jsonl")
            .contains("\"outcome\":\"done\"")
    );
}

#[test]
fn a_second_ctrl_c_leaves_at_once() {
    let place = Workplace::new();
    // One wave of this script takes minutes: only the second signal can end it.
    place.write(
        "long.lua",
        r#"
local x = experiment("long", { seed = 1 })
x:render(function(p) return { scene = "ball.scn", integrator = "bpt", resolution = { 24, 16 }, backend = "mock" } end)
x:stop(stop.any { stop.samples(2), stop.predicate(function(row) while true do end end) })
return x
"#,
    );
    let mut command = place.command(&["run", "long.lua", "-q", "--no-smoke"]);
    let mut child = command
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let since = Instant::now();
    while !place
        .files("out")
        .iter()
        .any(|f| f.ends_with("metrics.csv"))
    {
        assert!(since.elapsed() < PATIENCE);
        std::thread::sleep(Duration::from_millis(5));
    }
    send(&child, "-INT");
    // Two signals that arrive before the first is handled count as one.
    while child.try_wait().unwrap().is_none() {
        assert!(since.elapsed() < PATIENCE);
        std::thread::sleep(Duration::from_millis(50));
        send(&child, "-INT");
    }
    assert_eq!(child.wait().unwrap().code(), Some(130));
}
