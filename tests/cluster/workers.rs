//! Several workers on one folder, with skewed clocks, with and without locks.

use std::path::PathBuf;
use std::process::{Child, Stdio};

use super::night::{differing, evidence, finished, finished_once, home, script, until};
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

fn night_of(locks: bool) {
    if faketime().is_none() {
        println!("SKIPPED: libfaketime is not installed, so all clocks agree");
    }
    let place = Workplace::new();
    place.write("crew.lua", &script(150));
    place.run(&["submit", "hq", "crew.lua", "-q"]);
    let home = home(&place, "out");
    // Hours and days apart: leases depend on the folder's clock only.
    let mut workers: Vec<Child> = ["+0", "-3h", "+2d"]
        .iter()
        .map(|skew| start(&place, &home, skew, locks))
        .collect();
    until("the first runs", || finished(&place, &home).len() >= 2);
    if locks {
        // One worker dies in its middle; the next one takes over its runs at once.
        workers[1].kill().unwrap();
        workers[1].wait().unwrap();
        workers[1] = start(&place, &home, "-40d", locks);
    }
    for mut worker in workers {
        assert!(worker.wait().unwrap().success());
    }
    finished_once(&place, &home, usize::from(locks));
    place.succeed(&["run", "crew.lua", "--out", "alone", "-q"]);
    assert_eq!(
        differing(&evidence(&place, "out"), &evidence(&place, "alone")),
        Vec::<String>::new()
    );
    let left = place.files(&home);
    let odd = left
        .iter()
        .find(|f| f.ends_with("/claim") || f.contains("ckpt.") || f.contains(".tmp"));
    assert_eq!(odd, None);
}

#[test]
fn workers_whose_clocks_disagree_share_a_night_and_its_dead() {
    night_of(true);
}

#[test]
fn workers_without_locks_share_a_night() {
    night_of(false);
}

#[test]
fn a_worker_that_is_asked_to_leave_says_so_and_is_followed_by_another() {
    let place = Workplace::new();
    place.write("crew.lua", &script(1500));
    place.run(&["submit", "hq", "crew.lua", "-q"]);
    let home = home(&place, "out");
    let mut first = start(&place, &home, "+0", true);
    // At its first cell the worker has the whole night ahead, however late the signal arrives.
    until("the first cell", || {
        let journals = place
            .files(&home)
            .into_iter()
            .filter(|file| file.ends_with(".jsonl"));
        journals
            .into_iter()
            .any(|file| place.read(&file).contains("\"cell_started\""))
    });
    let kill = std::process::Command::new("kill")
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
