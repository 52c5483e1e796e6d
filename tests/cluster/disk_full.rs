//! A shared folder without space, used by several workers.
#![cfg(target_os = "linux")]

use std::io::{BufRead, BufReader, Lines};
use std::process::{ChildStderr, Stdio};

use super::night::{differing, evidence, finished_once, home, script};
use super::workplace::{Disk, Workplace};

#[test]
fn workers_wait_for_space_and_lose_nothing() {
    let place = Workplace::new();
    let Some(disk) = Disk::mount(place.path("out"), 16) else {
        return;
    };
    place.write("crew.lua", &script(0));
    place.run(&["submit", "hq", "crew.lua", "-q"]);
    let home = home(&place, "out");
    // So little that workers can register, but pictures do not fit.
    disk.fill(64 * 1024);
    let begin = || {
        let mut command = place.command(&[
            "work",
            &home,
            "--no-tui",
            "--threads",
            "1",
            "--affinity",
            "none",
        ]);
        let mut worker = command
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let said = BufReader::new(worker.stderr.take().unwrap()).lines();
        (worker, said)
    };
    let (mut workers, mut said): (Vec<_>, Vec<_>) = [begin(), begin()].into_iter().unzip();
    let finds_it_full = |lines: &mut Lines<BufReader<ChildStderr>>| {
        lines
            .map_while(Result::ok)
            .any(|line| line.contains("the disk is full"))
    };
    let mut full: Vec<bool> = said.iter_mut().map(finds_it_full).collect();
    // A worker that starts without any space cannot even register.
    disk.fill(0);
    let (late, mut lines) = begin();
    full.push(finds_it_full(&mut lines));
    workers.push(late);
    said.push(lines);
    let waiting = workers
        .iter_mut()
        .all(|worker| worker.try_wait().unwrap().is_none());
    disk.clear();
    let rest: Vec<String> = said
        .into_iter()
        .flat_map(|lines| lines.map_while(Result::ok))
        .collect();
    let ended: Vec<_> = workers
        .iter_mut()
        .map(|worker| worker.wait().unwrap().code())
        .collect();
    assert_eq!(
        (full, waiting, ended),
        (vec![true; 3], true, vec![Some(0); 3]),
        "{rest:?}"
    );
    finished_once(&place, &home, 0);
    place.succeed(&["run", "crew.lua", "--out", "alone", "-q"]);
    assert_eq!(
        differing(&evidence(&place, "out"), &evidence(&place, "alone")),
        Vec::<String>::new()
    );
}
