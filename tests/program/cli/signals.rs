//! Nights that are stopped by signals.

use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use super::workplace::{SLOW, Workplace};

const CELLS: usize = 24;
/// Longest wait in these tests before they fail; every expected wait is far shorter.
const MAX_WAIT: Duration = Duration::from_secs(120);

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
        assert!(since.elapsed() < MAX_WAIT, "no cell was done");
        assert!(child.try_wait().unwrap().is_none(), "the night ended early");
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn send(child: &Child, signal: &str) {
    let status = crate::common::kill()
        .args([signal, &child.id().to_string()])
        .status()
        .unwrap();
    assert!(status.success());
}

/// Stops a night in its middle by a signal, returns its exit code, then runs again and checks that
/// only the unfinished runs are rendered.
fn stop_and_resume(signal: &str) -> Option<i32> {
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
        place.ending("out", ".tmp").is_empty(),
        "a temporary file remains"
    );
    status.code()
}

#[test]
fn after_sigkill_only_unfinished_cells_are_rendered() {
    assert_eq!(stop_and_resume("-KILL"), None);
}

#[test]
fn sigterm_ends_the_wave_and_exits_with_status_75() {
    assert_eq!(stop_and_resume("-TERM"), Some(75));
}

#[test]
fn sigusr1_ends_the_wave_and_exits_with_status_75() {
    assert_eq!(stop_and_resume("-USR1"), Some(75));
}

/// Starts a slow night, waits for its first cell, sends signals with pauses, and returns its exit
/// code and its last signal.
fn end_by(signals: &[(&str, u64)]) -> (Option<i32>, Option<i32>) {
    use std::os::unix::process::ExitStatusExt;
    let place = Workplace::new();
    let script = SLOW.replace("repeats = 24", "repeats = 999");
    let mut child = start(&place, &script);
    wait_for_first(&place, &mut child);
    for (signal, pause_ms) in signals {
        send(&child, signal);
        std::thread::sleep(Duration::from_millis(*pause_ms));
    }
    let status = child.wait().unwrap();
    (status.code(), status.signal())
}

#[test]
fn a_second_sighup_leaves_at_once() {
    let twice = [("-HUP", 1500), ("-HUP", 0)];
    assert_eq!(end_by(&twice), (Some(129), None));
}

#[test]
fn sigquit_and_sigabrt_do_what_they_do_by_default() {
    assert_eq!(end_by(&[("-QUIT", 0)]), (None, Some(3)));
    assert_eq!(end_by(&[("-ABRT", 0)]), (None, Some(6)));
}

#[test]
fn a_stopped_night_keeps_its_exit_code_when_figures_cannot_be_written() {
    for (signal, code) in [("-TERM", 75), ("-INT", 130)] {
        let place = Workplace::new();
        let figure = "x:figure(\"rays\", { x = \"samples\", y = { \"rmse\" } })\nreturn x";
        let measure = "x:reference { stop = stop.samples(64) }\n\
                       x:measure { every = \"1s\", rmse = metric.rmse() }\n";
        let script = SLOW.replace("return x", &format!("{measure}{figure}"));
        let mut child = start(&place, &script);
        wait_for_first(&place, &mut child);
        // A file in place of the folder, as on a disk without space for one.
        let night = std::fs::canonicalize(place.path("out/latest")).unwrap();
        std::fs::write(night.join("figures"), "").unwrap();
        send(&child, signal);
        assert_eq!(child.wait().unwrap().code(), Some(code));
        assert!(place.ending("out", ".svg").is_empty());
    }
}

/// A process that is stopped for seconds renders nothing, and is not charged for them.
#[test]
#[cfg(target_os = "linux")]
fn time_during_which_the_process_was_stopped_is_not_render_time() {
    const STOPPED_S: f64 = 3.0;
    let place = Workplace::new();
    let script = "local x = experiment('stopped', { seed = 1 })\n\
        x:render(function(p)\n\
        return { scene = 'ball.scn', integrator = 'bpt', resolution = { 48, 32 }, backend = 'cpu' } end)\n\
        x:stop(stop.time('1.5s'))\nreturn x\n";
    let mut child = start(&place, script);
    let since = Instant::now();
    let is_measured = |file: &String| {
        let text = std::fs::read_to_string(place.path(file)).unwrap_or_default();
        file.ends_with("metrics.csv") && text.lines().count() > 1
    };
    while !place.files("out").iter().any(is_measured) {
        assert!(since.elapsed() < MAX_WAIT, "nothing was measured");
        std::thread::sleep(Duration::from_millis(5));
    }
    send(&child, "-STOP");
    std::thread::sleep(Duration::from_secs_f64(STOPPED_S));
    send(&child, "-CONT");
    assert_eq!(child.wait().unwrap().code(), Some(0));
    let (done, _) = place.finished().remove(0);
    let text = std::fs::read_to_string(place.path(&done)).unwrap();
    let done: serde_json::Value = serde_json::from_str(&text).unwrap();
    let [render_s, lost_s] = ["render_s", "lost_s"].map(|name| done[name].as_f64().unwrap());
    assert!((1.5..2.5).contains(&render_s), "{render_s} s were charged");
    assert!(lost_s > 0.9 * STOPPED_S, "{lost_s} s were noticed");
}

#[test]
fn too_many_threads_are_refused() {
    let error = Workplace::new().fail(2, &["plan", "night.lua", "--threads", "5000"]);
    assert!(
        error.contains("at most 1024, 0 for all cores, found `5000`"),
        "{error}"
    );
}

#[test]
fn limits_of_the_process_are_named() {
    let place = Workplace::new();
    let night = |limit: &str| {
        let program = env!("CARGO_BIN_EXE_lumbre");
        let command =
            format!("ulimit {limit}; exec {program} run night.lua -q --out=\"out{limit}\"");
        let mut shell = Command::new("bash");
        shell.args(["-c", &command]).current_dir(place.path("."));
        let ended = shell.output().unwrap();
        (
            ended.status.code(),
            String::from_utf8(ended.stderr).unwrap(),
        )
    };
    // Below 64 MiB the system cannot start the program.
    for limit in ["-v 70000", "-v 155000", "-v 400000", "-v 1000000"] {
        let (status, error) = night(limit);
        assert!(
            matches!(status, Some(1 | 2)) && error.contains("`ulimit -v`"),
            "{limit}: {status:?} {error}"
        );
    }
    let (status, error) = night("-s 64");
    assert_eq!(status, Some(0), "{error}");
    for (limit, said) in [("-n 8", "`ulimit -n`"), ("-f 1", "`ulimit -f`")] {
        let (status, error) = night(limit);
        assert!(matches!(status, Some(1..=3)), "{limit}: {status:?} {error}");
        assert!(error.contains(said), "{limit}: {error}");
    }
}

#[test]
fn ctrl_c_ends_the_wave_and_exits_with_status_130() {
    assert_eq!(stop_and_resume("-INT"), Some(130));
}

#[test]
fn sighup_writes_a_checkpoint_and_the_night_continues() {
    let place = Workplace::new();
    // Fewer cells with more waves, so that a checkpoint exists for longer.
    let script = SLOW
        .replace("repeats = 24", "repeats = 9")
        .replace("row.wave >= 3", "row.wave >= 8");
    let mut child = start(&place, &script);
    wait_for_first(&place, &mut child);
    let since = Instant::now();
    // Checkpoints exist only while their cell is rendered, so the signal is sent until one is seen.
    let has_checkpoint = |place: &Workplace| !place.ending("out", "ckpt.a").is_empty();
    while !has_checkpoint(&place) {
        assert!(since.elapsed() < MAX_WAIT, "no checkpoint was written");
        assert!(
            child.try_wait().unwrap().is_none(),
            "the night ended before a checkpoint was seen"
        );
        send(&child, "-HUP");
        std::thread::sleep(Duration::from_millis(2));
    }
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert_eq!(place.finished().len(), 9);
    assert!(
        !has_checkpoint(&place),
        "checkpoints must be removed when their run is done"
    );
    assert!(
        place
            .read("out/latest/journal.jsonl")
            .contains("\"outcome\":\"done\"")
    );
}

#[test]
fn a_second_ctrl_c_exits_at_once() {
    let place = Workplace::new();
    // The predicate of this script never returns: only the second signal can end its wave.
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
    while place.ending("out", "metrics.csv").is_empty() {
        assert!(since.elapsed() < MAX_WAIT);
        std::thread::sleep(Duration::from_millis(5));
    }
    send(&child, "-INT");
    // Two signals that arrive before the first is handled count as one.
    while child.try_wait().unwrap().is_none() {
        assert!(since.elapsed() < MAX_WAIT);
        std::thread::sleep(Duration::from_millis(50));
        send(&child, "-INT");
    }
    assert_eq!(child.wait().unwrap().code(), Some(130));
}
