//! A shared folder without space, beneath several workers.
#![cfg(target_os = "linux")]

use std::io::{BufRead, BufReader};
use std::process::Stdio;

use super::night::{differing, evidence, finished_once, home, script};
use super::workplace::{Disk, Workplace};

#[test]
fn workers_wait_for_space_and_lose_nothing() {
    let place = Workplace::new();
    let Some(disk) = Disk::mount(place.path("out"), 16) else { return };
    place.write("crew.lua", &script(0));
    place.run(&["submit", "hq", "crew.lua", "-q"]);
    let home = home(&place, "out");
    // So little that workers can join and say that they are there, and that pictures do not fit.
    disk.fill(64 * 1024);
    let mut workers: Vec<_> = (0..2)
        .map(|_| {
            let mut command = place.command(&["work", &home, "--no-tui", "--threads", "1", "--affinity", "none"]);
            command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
        })
        .collect();
    let mut said: Vec<_> = workers.iter_mut().map(|w| BufReader::new(w.stderr.take().unwrap()).lines()).collect();
    let full: Vec<bool> =
        said.iter_mut().map(|lines| lines.map_while(Result::ok).any(|l| l.contains("the disk is full"))).collect();
    let waiting = workers.iter_mut().all(|worker| worker.try_wait().unwrap().is_none());
    disk.clear();
    let rest: Vec<String> = said.into_iter().flat_map(|lines| lines.map_while(Result::ok)).collect();
    let ended: Vec<_> = workers.iter_mut().map(|worker| worker.wait().unwrap().code()).collect();
    assert_eq!((full, waiting, ended), (vec![true; 2], true, vec![Some(0); 2]), "{rest:?}");
    finished_once(&place, &home, 0);
    place.succeed(&["run", "crew.lua", "--out", "alone", "-q"]);
    assert_eq!(differing(&evidence(&place, "out"), &evidence(&place, "alone")), Vec::<String>::new());
}
