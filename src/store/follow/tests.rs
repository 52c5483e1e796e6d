//! Nights as they are seen from outside, by their files alone.

use std::fs;

use serde_json::json;

use super::{Follower, Seen};
use crate::experiment::event::History;
use crate::experiment::standing::{Claim, Settled};
use crate::experiment::{CellRef, Plan, StopRule};
use crate::film::time::TimeAxis;
use crate::store::frozen::Frozen;
use crate::store::tests::{decode, finish_run, only_run_of, plan, row};
use crate::store::{FILMS, LEASE, Me, RunWriter, Store};

/// What a look tells, in words.
fn seen(follower: &mut Follower) -> Vec<String> {
    let words = |seen: Seen| match seen {
        Seen::Began => "began".to_owned(),
        Seen::Foretold(left) => format!("{} known", left.known),
        Seen::Compared { reference, agrees } => format!("reference {reference} agrees: {agrees}"),
        Seen::Over => "over".to_owned(),
        Seen::Started { cell, config, open, .. } => {
            let technique = config.map_or_else(|| "nothing known".to_owned(), |config| config.integrator);
            format!("{cell:?} starts {technique} on {}", open.device)
        }
        Seen::Measured { cell, row } => format!("{cell:?} has {}", row.samples),
        Seen::Ended { cell, outcome, last } => {
            format!("{cell:?} {outcome:?} after {:?}", last.map(|row| row.samples))
        }
        Seen::Pictured { cell, image } => format!("{cell:?} shows {}", image.at(0, 0)[0]),
        Seen::Said { text, .. } => text,
        Seen::Strategy { .. } => "a film".to_owned(),
        Seen::Timed { cell, axis, .. } => format!("{cell:?} has {} bins", axis.bins),
        Seen::Underway { cell } => format!("{cell:?} too"),
        Seen::Part { reference, there, of } => format!("part {there:?} of {of} of reference {reference}"),
        Seen::Crew(workers) => format!("{} workers", workers.iter().filter(|w| w.is_here()).count()),
    };
    follower.look().into_iter().map(|sight| words(sight.seen)).collect()
}

/// The same without measurements and pictures.
fn seen_of_cells(follower: &mut Follower) -> Vec<String> {
    let mut words = seen(follower);
    words.retain(|word| !word.contains(" has ") && !word.contains(" shows "));
    words
}

/// The same without the crew, which is told of when it is time, and in an order of its own.
fn seen_of_runs(follower: &mut Follower) -> Vec<String> {
    let mut words = seen(follower);
    words.retain(|word| !word.ends_with(" workers"));
    words.sort();
    words
}

/// A line of a journal about a cell.
fn tell(store: &Store, plan: &Plan, event: &str, i: usize) {
    let run = plan.cells[i].id.0.as_str();
    let fields = json!({ "run": run, "path": "p", "device": "mock", "outcome": "done", "samples": 4 });
    store.journal(event, &fields).unwrap();
}

#[test]
fn a_night_is_followed_by_its_files_while_it_goes_on() {
    let dir = tempfile::tempdir().unwrap();
    let plan = plan("night", "3f9a00", &["aa11", "bb22"]);
    let store = Store::open(dir.path(), &plan, decode).unwrap();
    let started = |i: usize| {
        let run = plan.cells[i].id.0.as_str();
        store.journal("cell_started", &json!({ "run": run, "device": "mock" })).unwrap();
    };
    store.journal("night_started", &json!({})).unwrap();
    finish_run(&store, &plan, 0);
    started(0);
    let done = json!({ "run": "aa11", "outcome": "done", "reason": "samples", "samples": 4, "render_s": 0.25 });
    store.journal("cell_finished", &done).unwrap();
    let mut run = store.start(&plan, CellRef::Cell(1), None).unwrap();
    run.open_metrics(&[], &[]).unwrap();
    started(1);
    let mut follower = Follower::open(store.folder(), decode).unwrap();
    assert_eq!(follower.outline().until(CellRef::Cell(0)).unwrap().rule, StopRule::Samples(4));
    let first = seen(&mut follower);
    let starts = "Cell(1) starts bpt on mock";
    assert_eq!(first, ["began", "Cell(0) Done(\"samples\") after Some(4)", starts], "of the first run only its end");
    assert!(seen(&mut follower).is_empty());
    run.append_row(&row(1, 0)).unwrap();
    run.append_row(&row(2, 0)).unwrap();
    run.write("snap-4.exr", b"I\x05").unwrap();
    assert_eq!(seen(&mut follower), ["Cell(1) has 2", "Cell(1) has 4", "Cell(1) shows 5"]);
    run.append_row(&row(3, 0)).unwrap();
    run.write("final.exr", b"I\x07").unwrap();
    run.finish(&json!({ "run": "bb22", "samples": 8 })).unwrap();
    let done = json!({ "run": "bb22", "outcome": "done", "reason": "samples", "samples": 8 });
    store.journal("cell_finished", &done).unwrap();
    store.journal("night_finished", &json!({})).unwrap();
    let last = ["Cell(1) has 8", "Cell(1) shows 7", "Cell(1) Done(\"samples\") after Some(8)", "over"];
    assert_eq!(seen(&mut follower), last);
    for agrees in [false, true] {
        let found = json!({ "reference": "ee00", "second": "ff00", "agrees": agrees });
        store.journal("agreement", &found).unwrap();
    }
    assert_eq!(seen(&mut follower), ["reference 0 agrees: false", "reference 0 agrees: true"]);
    // Another night that finds nothing to do, and a run that somebody deleted.
    fs::remove_file(only_run_of(&store, "aa11").join("done.json")).unwrap();
    let late = seen(&mut Follower::open(store.folder(), decode).unwrap());
    assert!(!late.iter().any(|word| word.starts_with("Cell(0) Done")), "{late:?}");
    assert!(Follower::open(dir.path(), decode).unwrap_err().to_string().contains("lumbre ls"));
}

#[test]
fn workers_are_followed_by_their_own_journals() {
    let dir = tempfile::tempdir().unwrap();
    let plan = plan("night", "3f9a00", &["aa11", "bb22", "cc33"]);
    let home = Store::open(dir.path(), &plan, decode).unwrap().folder().to_owned();
    let me = Me { job: "7_0".to_owned(), ..Me::default() };
    let join = || Store::join(&home, &plan, &Frozen::default(), decode, &me).unwrap();
    let (a, b) = (join(), join());
    a.journal("night_started", &json!({})).unwrap();
    b.journal("night_started", &json!({})).unwrap();
    assert_eq!(a.claim(&plan, CellRef::Cell(0).into()).unwrap(), Claim::Ours);
    assert!(matches!(b.claim(&plan, CellRef::Cell(0).into()).unwrap(), Claim::Theirs(_)));
    a.start(&plan, CellRef::Cell(0), None).unwrap();
    tell(&a, &plan, "cell_started", 0);
    b.start(&plan, CellRef::Cell(1), None).unwrap();
    let mut follower = Follower::open(&home, decode).unwrap();
    assert_eq!(seen_of_cells(&mut follower), ["began", "Cell(0) starts bpt on mock", "2 workers"]);
    tell(&b, &plan, "cell_started", 1);
    assert_eq!(seen_of_cells(&mut follower), ["Cell(1) too"], "the one that is shown stays");
    finish_run(&a, &plan, 0);
    tell(&a, &plan, "cell_finished", 0);
    a.release(&plan, CellRef::Cell(0).into());
    assert_eq!(
        seen_of_cells(&mut follower),
        ["Cell(0) Done(\"\") after Some(4)", "Cell(1) starts bpt on mock"],
        "and then another one is"
    );
    // What one settled the others need not look at.
    assert!(matches!(b.settled(&plan, CellRef::Cell(0)), Some(Settled::Done(_))));
    assert_eq!(b.settled(&plan, CellRef::Cell(2)), None);
    b.fail(&plan, CellRef::Cell(2), "no lens").unwrap();
    b.release(&plan, CellRef::Cell(2).into());
    assert_eq!(join().settled(&plan, CellRef::Cell(2)), Some(Settled::Failed("no lens".to_owned())));
    let stock = a.take_stock(&plan);
    assert_eq!((stock.done.len(), stock.failed.len(), stock.open), (1, 1, 2), "a cell and the reference are open");
    // A worker that falls silent is lost, and what it rendered open again.
    let part = json!({ "run": plan.references[0].id.0, "part": 1, "of": 2, "words": "part 1 of 2", "device": "mock" });
    b.journal("part_started", &part).unwrap();
    let old = std::time::SystemTime::now() - 2 * LEASE;
    for file in fs::read_dir(home.join("workers")).unwrap().flatten().map(|e| e.path()) {
        let text = fs::read_to_string(&file).unwrap();
        if text.contains("heartbeat") || file.extension().is_some_and(|e| e == "json") {
            fs::File::options().write(true).open(&file).unwrap().set_modified(old).unwrap();
        }
    }
    let mut late = Follower::open(&home, decode).unwrap();
    let late = seen_of_cells(&mut late);
    let end = ["Cell(1) Interrupted after None", "0 workers"];
    assert!(late.ends_with(&end.map(str::to_owned)), "the part is of a reference, which has not ended: {late:?}");
    a.journal("night_closed", &json!({})).unwrap();
    assert!(seen_of_cells(&mut follower).contains(&"over".to_owned()));
}

#[test]
fn what_is_done_stays_so_when_another_worker_tells_of_its_parts_in_the_same_second() {
    let dir = tempfile::tempdir().unwrap();
    let plan = plan("night", "3f9a00", &["aa11"]);
    let home = Store::open(dir.path(), &plan, decode).unwrap().folder().to_owned();
    let id = plan.references[0].id.0.as_str();
    let folder = crate::store::layout::reference_folder(dir.path(), &plan.references[0].id);
    fs::create_dir_all(home.join("workers")).unwrap();
    // The journals of two workers, the second of which joined what the first had begun.
    let write = |worker: &str, lines: &[&str]| {
        let line = |rest: &&str| format!("{{\"date\":\"2026-04-27T21:30:00Z\",\"run\":\"{id}\",{rest}}}\n");
        let text: String = lines.iter().map(line).collect();
        fs::write(home.join("workers").join(worker).with_extension("jsonl"), text).unwrap();
    };
    let start = r#""event":"part_started","part":1,"of":1,"words":"part 1 of 1""#;
    let finish = r#""event":"part_finished","part":1,"of":1,"words":"part 1 of 1","outcome":"done""#;
    let done = r#""event":"cell_finished","outcome":"done","samples":4"#;
    write("a", &[done]);
    write("b", &[start, finish]);
    let tells_of_parts = |words: &[String]| words.iter().any(|word| word.contains("part") || word.ends_with(" too"));
    let rendered_again = seen_of_runs(&mut Follower::open(&home, decode).unwrap());
    assert!(tells_of_parts(&rendered_again), "its files are not there: {rendered_again:?}");
    fs::create_dir_all(&folder).unwrap();
    fs::write(folder.join("ref.json"), "{}").unwrap();
    let words = seen_of_runs(&mut Follower::open(&home, decode).unwrap());
    assert!(words.contains(&"Reference(0) Done(\"\") after Some(4)".to_owned()), "{words:?}");
    assert!(!tells_of_parts(&words), "{words:?}");
}

#[test]
fn runs_of_one_worker_that_take_turns_are_shown_together() {
    let dir = tempfile::tempdir().unwrap();
    let plan = plan("night", "3f9a00", &["aa11", "bb22", "cc33", "dd44"]);
    let home = Store::open(dir.path(), &plan, decode).unwrap().folder().to_owned();
    let join = || Store::join(&home, &plan, &Frozen::default(), decode, &Me::default()).unwrap();
    let (a, b) = (join(), join());
    let begin = |store: &Store, i: usize| {
        let mut run = store.start(&plan, CellRef::Cell(i), None).unwrap();
        run.open_metrics(&[], &[]).unwrap();
        tell(store, &plan, "cell_started", i);
        run
    };
    a.journal("worker_started", &json!({})).unwrap();
    let mut first = begin(&a, 0);
    let mut follower = Follower::open(&home, decode).unwrap();
    seen_of_runs(&mut follower);
    let (mut second, mut other) = (begin(&a, 1), begin(&b, 2));
    let both = seen_of_runs(&mut follower);
    assert_eq!(both, ["Cell(1) starts bpt on mock", "Cell(2) too"], "a rival, and what another worker renders");
    for (run, samples) in [(&mut first, 1), (&mut second, 2), (&mut other, 3)] {
        run.append_row(&row(samples, 0)).unwrap();
    }
    assert_eq!(
        seen_of_runs(&mut follower),
        ["Cell(0) has 2", "Cell(1) has 4"],
        "both curves grow, the other worker's does not"
    );
    // One of them ends; its worker is still the one that is shown.
    let mut end = |run: RunWriter, i: usize| {
        run.finish(&json!({ "run": plan.cells[i].id.0, "samples": 4 })).unwrap();
        tell(&a, &plan, "cell_finished", i);
        seen_of_runs(&mut follower)
    };
    assert_eq!(end(first, 0), ["Cell(0) Done(\"\") after Some(4)"]);
    let _fourth = begin(&b, 3);
    let next = end(second, 1);
    let both = ["Cell(2) starts bpt on mock", "Cell(3) starts bpt on mock"];
    assert!(
        both.iter().all(|start| next.contains(&(*start).to_owned())),
        "and then all of the next worker's: {next:?}"
    );
    assert!(next.contains(&"Cell(2) has 8".to_owned()), "{next:?}");
}

#[test]
fn light_by_time_is_told_once_a_run_has_left_it() {
    let dir = tempfile::tempdir().unwrap();
    let mut plan = plan("night", "3f9a00", &["aa11"]);
    let film = crate::value::Value::from_json(&json!({ "time": { "start": 2, "bin": 0.5, "bins": 8 } }));
    let cell = std::sync::Arc::make_mut(&mut plan.cells[0].config);
    cell.timing = crate::transport::flight::Timing::from_film(film.as_map().unwrap(), "film").unwrap();
    let store = Store::open(dir.path(), &plan, decode).unwrap();
    store.journal("night_started", &json!({})).unwrap();
    let mut run = store.start(&plan, CellRef::Cell(0), None).unwrap();
    run.open_metrics(&[], &[]).unwrap();
    tell(&store, &plan, "cell_started", 0);
    let mut follower = Follower::open(store.folder(), decode).unwrap();
    assert_eq!(seen(&mut follower), ["began", "Cell(0) starts bpt on mock"]);
    let file = only_run_of(&store, "aa11").join(FILMS).join("time-cube.npy");
    fs::create_dir_all(file.parent().unwrap()).unwrap();
    fs::write(&file, b"").unwrap();
    assert!(seen(&mut follower).is_empty(), "not before the run has ended");
    tell(&store, &plan, "cell_finished", 0);
    let sights = follower.look();
    let times = sights.iter().filter_map(|sight| match &sight.seen {
        Seen::Timed { file, axis, .. } => Some((file.clone(), *axis)),
        _ => None,
    });
    assert_eq!(times.collect::<Vec<_>>(), [(file, TimeAxis { start: 2.0, bin: 0.5, bins: 8 })]);
    assert!(seen(&mut follower).is_empty(), "and only once");
}
