//! Several workers on a shared folder without free space.
#![cfg(target_os = "linux")]

use std::io::{BufRead, BufReader, Lines};
use std::process::{ChildStderr, Stdio};

use super::night::{differing, finished_once, home, results, script};
use super::workplace::{Disk, Workplace};

#[test]
fn workers_wait_for_space_on_a_full_disk_and_render_the_same_night() {
    let place = Workplace::new();
    let Some(disk) = Disk::mount(place.path("out"), 16) else {
        return;
    };
    place.write("grid.lua", &script(0));
    place.run(&["submit", "hq", "grid.lua", "-q"]);
    let home = home(&place, "out");
    // Enough space for workers to register, but not for pictures.
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
        let output = BufReader::new(worker.stderr.take().unwrap()).lines();
        (worker, output)
    };
    let (mut workers, mut outputs): (Vec<_>, Vec<_>) = [begin(), begin()].into_iter().unzip();
    let reports_full_disk = |lines: &mut Lines<BufReader<ChildStderr>>| {
        lines
            .map_while(Result::ok)
            .any(|line| line.contains("the disk is full"))
    };
    let mut full: Vec<bool> = outputs.iter_mut().map(reports_full_disk).collect();
    // A worker that starts without any space cannot register.
    disk.fill(0);
    let (late, mut lines) = begin();
    full.push(reports_full_disk(&mut lines));
    workers.push(late);
    outputs.push(lines);
    let waiting = workers
        .iter_mut()
        .all(|worker| worker.try_wait().unwrap().is_none());
    disk.clear();
    let rest: Vec<String> = outputs
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
    place.succeed(&["run", "grid.lua", "--out", "alone", "-q"]);
    assert_eq!(
        differing(&results(&place, "out"), &results(&place, "alone")),
        Vec::<String>::new()
    );
}
