//! Several workers on one folder, with skewed clocks, and with or without locks.

use std::path::PathBuf;
use std::process::{Child, Stdio};

use super::night::{differing, finished, finished_once, home, results, script, wait_until};
use super::workplace::Workplace;

/// Returns the library that shifts the clock of a process.
fn faketime() -> Option<PathBuf> {
    let known = [
        "/usr/lib/x86_64-linux-gnu/faketime/libfaketimeMT.so.1",
        "/usr/lib/aarch64-linux-gnu/faketime/libfaketimeMT.so.1",
    ];
    known.iter().map(PathBuf::from).find(|file| file.is_file())
}

fn start(place: &Workplace, home: &str, skew: &str, locks: bool) -> Child {
    let mut command = place.command(&[
        "work",
        home,
        "-q",
        "--no-tui",
        "--threads",
        "1",
        "--affinity",
        "none",
    ]);
    if let Some(library) = faketime() {
        command
            .env("LD_PRELOAD", library)
            .env("FAKETIME", skew)
            .env("FAKETIME_DONT_FAKE_MONOTONIC", "1");
    }
    if !locks {
        command.env("LUMBRE_LOCKS", "none");
    }
    command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::inherit())
        .spawn()
        .unwrap()
}

fn check_shared_night(locks: bool) {
    if faketime().is_none() {
        crate::common::skipped("libfaketime is not installed, so all clocks agree");
    }
    let place = Workplace::new();
    place.write("grid.lua", &script(150));
    place.run(&["submit", "hq", "grid.lua", "-q"]);
    let home = home(&place, "out");
    // The clocks differ by hours and days: leases use only the clock of the shared folder.
    let mut workers: Vec<Child> = ["+0", "-3h", "+2d"]
        .iter()
        .map(|skew| start(&place, &home, skew, locks))
        .collect();
    wait_until("the first runs", || finished(&place, &home).len() >= 2);
    if locks {
        // One worker is killed while it renders; the next one takes over its runs at once.
        workers[1].kill().unwrap();
        workers[1].wait().unwrap();
        workers[1] = start(&place, &home, "-40d", locks);
    }
    for mut worker in workers {
        assert!(worker.wait().unwrap().success());
    }
    finished_once(&place, &home, usize::from(locks));
    place.succeed(&["run", "grid.lua", "--out", "alone", "-q"]);
    assert_eq!(
        differing(&results(&place, "out"), &results(&place, "alone")),
        Vec::<String>::new()
    );
    let remaining = place.files(&home);
    let unexpected = remaining
        .iter()
        .find(|f| f.ends_with("/claim") || f.contains("ckpt.") || f.contains(".tmp"));
    assert_eq!(unexpected, None);
}

#[test]
fn workers_with_skewed_clocks_share_a_night_and_take_over_killed_runs() {
    check_shared_night(true);
}

#[test]
fn workers_without_locks_share_a_night() {
    check_shared_night(false);
}

#[test]
fn a_worker_stopped_by_sigusr1_exits_with_status_75_and_another_continues() {
    let place = Workplace::new();
    place.write("grid.lua", &script(1500));
    place.run(&["submit", "hq", "grid.lua", "-q"]);
    let home = home(&place, "out");
    let mut first = start(&place, &home, "+0", true);
    // At its first cell the worker has the whole night ahead, however late the signal arrives.
    wait_until("the first cell", || {
        let journals = place.ending(&home, ".jsonl").into_iter();
        journals
            .into_iter()
            .any(|file| place.read(&file).contains("\"cell_started\""))
    });
    let kill = crate::common::kill()
        .args(["-s", "USR1", &first.id().to_string()])
        .status()
        .unwrap();
    assert!(kill.success());
    assert_eq!(first.wait().unwrap().code(), Some(75));
    let status = place.succeed(&["status", &home]);
    assert!(
        status.stdout.contains("0 active, 0 lost, 1 exited"),
        "{}",
        status.stdout
    );
    place.succeed(&["work", &home, "-q"]);
    finished_once(&place, &home, 0);
}
