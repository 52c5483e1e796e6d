//! The store on real folders, with a decoder that knows one toy format.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use glam::Vec3;
use serde_json::json;

use super::*;
use crate::experiment::event::History;
use crate::experiment::plan::{Cell, Reference, ReferenceSource};
use crate::experiment::spec::{CellConfig, Measure, Snapshots};
use crate::experiment::standing::{Claim, Settled};
use crate::experiment::{CellRef, Plan, RunId, StopRule, WaveRow};
use crate::film::Image;
use crate::metrics::tonemap::Tonemap;
use crate::scene::SceneDesc;
use crate::scene::desc::CameraDesc;
use crate::transport::camera::{FilterKind, FilterSpec};
use crate::value::Value;

fn decode(bytes: &[u8]) -> Result<Image, String> {
    match bytes {
        [b'I', grey] => Ok(Image::from_fn(1, 1, |_, _| [f32::from(*grey); 3])),
        _ => Err("not a toy picture".into()),
    }
}

fn config() -> Arc<CellConfig> {
    Arc::new(CellConfig {
        scene_options: Default::default(),
        scene: "scenes/box.scn".into(),
        scene_file: "scenes/box.scn".into(),
        integrator: "bpt".into(),
        params: Default::default(),
        max_depth: Some(5),
        resolution: Some([8, 8]),
        rr_start: None,
        filter: FilterSpec { kind: FilterKind::Box, radius: 0.5 },
        films: Vec::new(),
        accel: Default::default(),
        timing: None,
        sampler: "independent".to_owned(),
        set: Default::default(),
        backend: "mock".into(),
        fallback: None,
    })
}

fn scene() -> Arc<SceneDesc> {
    let camera = CameraDesc { position: Vec3::Z, target: Vec3::ZERO, fov_deg: 40.0, ..CameraDesc::default() };
    Arc::new(SceneDesc {
        views: Vec::new(),
        resolution: [8, 8],
        max_depth: 5,
        camera,
        materials: vec![],
        entities: vec![],
        lights: vec![],
        environment: None,
    })
}

/// A plan whose cells have the given ids, none with a reference, and one rendered reference.
fn plan(name: &str, hash: &str, ids: &[&str]) -> Plan {
    let cell = |(i, id): (usize, &&str)| Cell {
        id: RunId((*id).to_owned()),
        point: vec![("depth".into(), Value::Int(i as i64))],
        repeat: 0,
        control: None,
        seed: i as u64,
        config: config(),
        scene: scene(),
        stop: StopRule::Samples(4),
        reference: None,
        path: format!("depth={i}/rep=0"),
        identity: Value::Str((*id).to_owned()),
    };
    let source = ReferenceSource::Render {
        config: config(),
        scene: scene(),
        seeds: [98, 99],
        stem: RunId("ee".into()),
        stop: StopRule::Samples(64),
        part: None,
    };
    Plan {
        name: name.into(),
        hash: hash.into(),
        seed: 1,
        axes: vec!["depth".into()],
        cells: ids.iter().enumerate().map(cell).collect(),
        references: vec![Reference { id: RunId("ee00".into()), source, identity: Value::Nil, agree: None }],
        skipped: vec![],
        notes: vec![],
        warnings: vec![],
        measure: Measure {
            every_s: 1.0,
            metrics: vec![],
            snapshots: Snapshots::Last,
            captures: false,
            display: Tonemap::Srgb { exposure: 0.0 },
        },
        night: Default::default(),
        figures: vec![],
        tables: vec![],
        script_text: "-- a script\n".into(),
        files: Default::default(),
    }
}

fn row(wave: u64, invalid: u64) -> WaveRow {
    WaveRow {
        wave,
        samples: 1 << wave,
        render_s: 0.25,
        wall_s: 0.5,
        paths: 64,
        rays: 200,
        invalid,
        ..WaveRow::default()
    }
}

fn finish_run(store: &Store, plan: &Plan, i: usize) {
    let mut run = store.start(plan, CellRef::Cell(i), None).unwrap();
    run.open_metrics(&[], &[]).unwrap();
    run.append_row(&row(1, 0)).unwrap();
    run.append_row(&WaveRow { first_invalid: Some([1, 2, 3]), ..row(2, 1) }).unwrap();
    run.write("final.exr", b"I\x07").unwrap();
    let done = json!({"run": plan.cells[i].id.0, "samples": 4, "render_s": 0.25, "reason": "samples",
                      "first_invalid": [1, 2, 3]});
    run.finish(&done).unwrap();
}

fn only_run(folder: &Path) -> PathBuf {
    let runs = layout::runs_below(&folder.join("runs"));
    assert_eq!(runs.len(), 1);
    runs[0].clone()
}

#[test]
fn a_finished_run_is_found_with_its_rows_and_an_unfinished_one_is_not() {
    let dir = tempfile::tempdir().unwrap();
    let plan = plan("night", "3f9a00", &["aa11", "bb22"]);
    let store = Store::open(dir.path(), &plan, decode).unwrap();
    assert_eq!(store.folder(), dir.path().join("night-3f9a"));
    assert_eq!(fs::read_to_string(store.folder().join("experiment.lua")).unwrap(), "-- a script\n");
    finish_run(&store, &plan, 0);
    let mut half = store.start(&plan, CellRef::Cell(1), None).unwrap();
    half.open_metrics(&[], &[]).unwrap();
    half.append_row(&row(1, 0)).unwrap();
    half.write("final.exr", b"I\x01").unwrap();
    drop(half);

    let found = store.done(&plan, CellRef::Cell(0)).unwrap();
    assert_eq!(found.rows, [row(1, 0), WaveRow { first_invalid: Some([1, 2, 3]), ..row(2, 1) }]);
    assert_eq!(store.done(&plan, CellRef::Cell(1)), None);

    let run = only_run_of(&store, "aa11");
    for damage in ["done.json", "final.exr", "metrics.csv"] {
        let kept = fs::read(run.join(damage)).unwrap();
        fs::remove_file(run.join(damage)).unwrap();
        assert_eq!(store.done(&plan, CellRef::Cell(0)), None, "without {damage}");
        fs::write(run.join(damage), kept).unwrap();
        assert!(store.done(&plan, CellRef::Cell(0)).is_some());
    }
    fs::write(run.join("done.json"), "{\"run\": \"aa1").unwrap();
    assert_eq!(store.done(&plan, CellRef::Cell(0)), None);
}

#[test]
fn films_belong_to_a_run_and_go_with_it() {
    let dir = tempfile::tempdir().unwrap();
    let plan = plan("night", "3f9a00", &["aa11"]);
    let store = Store::open(dir.path(), &plan, decode).unwrap();
    let start = || {
        let mut run = store.start(&plan, CellRef::Cell(0), None).unwrap();
        run.open_metrics(&[], &[]).unwrap();
        run.write("final.exr", b"I\x01").unwrap();
        run
    };
    let run = start();
    run.write("films/depth-9.exr", b"of a run that was cut off").unwrap();
    drop(run);
    let run = start();
    run.write("films/depth-1.exr", b"I\x01").unwrap();
    let folder = run.folder().to_owned();
    run.finish(&serde_json::json!({ "run": "aa11", "films": ["depth-1"] })).unwrap();

    let shown = read_run(dir.path(), &folder.to_string_lossy()).unwrap();
    let films: Vec<&str> = shown.files.iter().map(|(name, _)| name.as_str()).filter(|n| n.contains('/')).collect();
    assert_eq!(films, ["films/depth-1.exr"], "what the first try left is gone");
    assert!(!shown.files.iter().any(|(name, _)| name == "films"), "a folder is no file");

    assert!(store.done(&plan, CellRef::Cell(0)).is_some());
    fs::remove_file(folder.join("films/depth-1.exr")).unwrap();
    assert_eq!(store.done(&plan, CellRef::Cell(0)), None, "a film is missing");
}

fn only_run_of(store: &Store, id: &str) -> PathBuf {
    let runs = layout::runs_below(&store.folder().join("runs"));
    runs.into_iter().find(|r| r.ends_with(id)).unwrap()
}

#[test]
fn starting_again_removes_stale_results_and_keeps_what_people_put_there() {
    let dir = tempfile::tempdir().unwrap();
    let plan = plan("night", "3f9a00", &["aa11"]);
    let store = Store::open(dir.path(), &plan, decode).unwrap();
    finish_run(&store, &plan, 0);
    let folder = only_run(store.folder());
    fs::write(folder.join("snap-2.exr"), b"old").unwrap();
    fs::write(folder.join("my notes.txt"), b"keep").unwrap();
    let run = store.start(&plan, CellRef::Cell(0), None).unwrap();
    assert_eq!(run.folder(), folder);
    let mut names: Vec<_> = fs::read_dir(&folder).unwrap().map(|e| e.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["config.json", "my notes.txt"]);
}

#[test]
fn runs_of_a_sibling_folder_count_and_those_of_another_experiment_do_not() {
    let dir = tempfile::tempdir().unwrap();
    let first = plan("night", "3f9a00", &["aa11"]);
    let store = Store::open(dir.path(), &first, decode).unwrap();
    finish_run(&store, &first, 0);
    drop(store);
    let second = plan("night", "77770", &["cc33", "aa11"]);
    let store = Store::open(dir.path(), &second, decode).unwrap();
    assert_eq!(store.done(&second, CellRef::Cell(0)), None);
    let found = store.done(&second, CellRef::Cell(1)).unwrap();
    assert!(found.folder.starts_with(dir.path().join("night-3f9a")));
    let other = plan("day", "3f9a00", &["aa11"]);
    assert_eq!(Archive::new(dir.path(), decode).done(&other, CellRef::Cell(0)), None);
    assert!(Archive::new(dir.path(), decode).done(&first, CellRef::Cell(0)).is_some());
    let listed = list(dir.path());
    let states: Vec<_> = listed.iter().flat_map(|e| &e.runs).map(|r| (r.run.as_str(), r.state.word())).collect();
    assert_eq!(states, [("aa11", "done"), ("cc33", "pending"), ("aa11", "elsewhere")]);
}

#[test]
fn a_twin_in_the_same_plan_finds_the_run_that_was_just_finished() {
    let dir = tempfile::tempdir().unwrap();
    let plan = plan("night", "3f9a00", &["aa11", "aa11"]);
    let store = Store::open(dir.path(), &plan, decode).unwrap();
    assert_eq!(store.done(&plan, CellRef::Cell(1)), None);
    finish_run(&store, &plan, 0);
    assert!(store.done(&plan, CellRef::Cell(1)).unwrap().folder.ends_with("depth=0/rep=0/aa11"));
}

#[test]
fn another_plan_with_the_same_digits_gets_more_of_them() {
    let dir = tempfile::tempdir().unwrap();
    let first = plan("night", "3f9a00", &[]);
    let second = plan("night", "3f9a11", &[]);
    Store::open(dir.path(), &first, decode).unwrap();
    assert_eq!(Store::open(dir.path(), &second, decode).unwrap().folder(), dir.path().join("night-3f9a1"));
    assert_eq!(Store::open(dir.path(), &first, decode).unwrap().folder(), dir.path().join("night-3f9a"));
    assert_eq!(Store::open(dir.path(), &second, decode).unwrap().folder(), dir.path().join("night-3f9a1"));
}

/// Asks for a claim whose owner has just let go of it. Other tests start programs meanwhile, and a program that is being
/// started holds whatever its parent had open for a moment, a lock as well.
pub fn at_last(mut ask: impl FnMut() -> Claim) -> Claim {
    let since = std::time::Instant::now();
    loop {
        let claim = ask();
        if claim == Claim::Ours || since.elapsed() > std::time::Duration::from_secs(20) {
            return claim;
        }
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
}

#[test]
fn a_second_process_works_on_what_the_first_does_not() {
    let dir = tempfile::tempdir().unwrap();
    let plan = plan("night", "3f9a00", &["aa11", "bb22"]);
    let (first, second) =
        (Store::open(dir.path(), &plan, decode).unwrap(), Store::open(dir.path(), &plan, decode).unwrap());
    assert_eq!(first.folder(), second.folder());
    assert_eq!(first.claim(&plan, CellRef::Cell(0).into()).unwrap(), Claim::Ours);
    assert!(matches!(second.claim(&plan, CellRef::Cell(0).into()).unwrap(), Claim::Theirs(_)));
    assert_eq!(second.claim(&plan, CellRef::Cell(1).into()).unwrap(), Claim::Ours);
    drop(first);
    assert_eq!(at_last(|| second.claim(&plan, CellRef::Cell(0).into()).unwrap()), Claim::Ours);
}

#[test]
fn references_are_shared_and_decoded() {
    let dir = tempfile::tempdir().unwrap();
    let mut plan = plan("night", "3f9a00", &[]);
    let store = Store::open(dir.path(), &plan, decode).unwrap();
    assert!(store.image(&plan, 0).unwrap().is_none());
    let run = store.start(&plan, CellRef::Reference(0), None).unwrap();
    assert_eq!(run.folder(), dir.path().join("refs/ee/ee00"));
    run.write("ref.exr", b"I\x05").unwrap();
    run.write_rows(&[WaveRow { metrics: vec![0.5], ..row(1, 0) }]).unwrap();
    assert!(store.done(&plan, CellRef::Reference(0)).is_none());
    run.finish(&json!({"run": "ee00"})).unwrap();
    assert_eq!(store.done(&plan, CellRef::Reference(0)).unwrap().rows, [row(1, 0)]);
    assert_eq!(store.image(&plan, 0).unwrap().unwrap().at(0, 0), [5.0; 3]);
    // A reference that a script names is read from its own place; what cannot be read is an error that names it.
    let file = dir.path().join("truth.exr");
    plan.references[0].source = ReferenceSource::File { file: file.clone(), source: String::new() };
    assert!(store.image(&plan, 0).unwrap_err().0.contains("truth.exr"));
    fs::write(&file, b"I\x09").unwrap();
    assert_eq!(store.image(&plan, 0).unwrap().unwrap().at(0, 0), [9.0; 3]);
    fs::write(&file, b"junk").unwrap();
    assert!(store.image(&plan, 0).unwrap_err().0.contains("not a toy picture"));
}

#[test]
fn an_unwritable_place_is_found_at_once() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("out"), b"a file").unwrap();
    let plan = plan("night", "3f9a00", &[]);
    let error = Store::open(&dir.path().join("out"), &plan, decode).unwrap_err();
    assert!(matches!(error, StoreError::Unwritable { .. }), "{error}");
}

#[test]
fn rows_of_another_width_than_the_header_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let plan = plan("night", "3f9a00", &["aa11"]);
    let store = Store::open(dir.path(), &plan, decode).unwrap();
    let mut run = store.start(&plan, CellRef::Cell(0), None).unwrap();
    assert!(run.append_row(&row(1, 0)).is_err());
    run.open_metrics(&["rmse"], &[]).unwrap();
    assert!(run.append_row(&row(1, 0)).unwrap_err().to_string().contains("0 metrics"));
}

#[test]
fn runs_are_found_by_folder_and_by_the_first_digits() {
    let dir = tempfile::tempdir().unwrap();
    let plan = plan("night", "3f9a00", &["aa11", "aa22"]);
    let store = Store::open(dir.path(), &plan, decode).unwrap();
    finish_run(&store, &plan, 0);
    finish_run(&store, &plan, 1);
    let record = read_run(dir.path(), "AA1").unwrap();
    assert_eq!(record.config["run"], "aa11");
    assert_eq!(record.config["render"]["aa"]["filter"], "box");
    assert_eq!(record.rows.len(), 2);
    assert_eq!(record.rows[1].first_invalid, Some([1, 2, 3]));
    assert!(record.files.iter().any(|(name, size)| name == "final.exr" && *size == 2));
    assert_eq!(read_run(dir.path(), record.folder.to_str().unwrap()).unwrap(), record);
    assert!(matches!(read_run(dir.path(), "aa"), Err(StoreError::Ambiguous { .. })));
    assert!(matches!(read_run(dir.path(), "ff"), Err(StoreError::NoSuchRun { .. })));
    let folder = store.folder().to_str().unwrap();
    assert!(read_run(dir.path(), folder).unwrap_err().to_string().contains("lumbre ls"));
}

#[test]
fn states_tell_failed_unfinished_and_pending_apart() {
    let dir = tempfile::tempdir().unwrap();
    let plan = plan("night", "3f9a00", &["aa11", "bb22", "cc33"]);
    let store = Store::open(dir.path(), &plan, decode).unwrap();
    drop(store.start(&plan, CellRef::Cell(0), None).unwrap());
    drop(store.start(&plan, CellRef::Cell(1), None).unwrap());
    store.fail(&plan, CellRef::Cell(0), "disk full").unwrap();
    let listed = list(dir.path());
    let states: Vec<_> = listed[0].runs.iter().map(|r| r.state.clone()).collect();
    assert_eq!(states, [RunState::Failed("disk full".into()), RunState::Unfinished, RunState::Pending]);
    assert_eq!(listed[0].references[0].state, RunState::Pending);
    assert!(list(&dir.path().join("nowhere")).is_empty());
}

#[cfg(unix)]
#[test]
fn latest_points_at_the_newest_and_results_are_ordinary_files() {
    use std::os::unix::fs::PermissionsExt;
    let dir = tempfile::tempdir().unwrap();
    for hash in ["1111aa", "2222bb"] {
        let plan = plan("night", hash, &[]);
        let store = Store::open(dir.path(), &plan, decode).unwrap();
        assert_eq!(fs::read_link(dir.path().join("latest")).unwrap().as_os_str(), store.folder().file_name().unwrap());
        let mode = |name: &str| fs::metadata(store.folder().join(name)).unwrap().permissions().mode() & 0o777;
        assert_eq!(mode("plan.json"), mode("journal.jsonl"));
    }
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
    let seen = |follower: &mut Follower| -> Vec<String> {
        let words = |seen: Seen| match seen {
            Seen::Began => "began".to_owned(),
            Seen::Foretold(left) => format!("{} known", left.known),
            Seen::Over => "over".to_owned(),
            Seen::Started { cell, config, open, .. } => {
                format!("{cell:?} starts {} on {}", config.unwrap().integrator, open.device)
            }
            Seen::Measured { cell, row } => format!("{cell:?} has {}", row.samples),
            Seen::Ended { cell, outcome, last } => {
                format!("{cell:?} {outcome:?} after {:?}", last.map(|row| row.samples))
            }
            Seen::Pictured { cell, image } => format!("{cell:?} shows {}", image.at(0, 0)[0]),
            Seen::Said { text, .. } => text,
            Seen::Strategy { .. } => "a film".to_owned(),
            Seen::Underway { cell } => format!("{cell:?} too"),
            Seen::Part { reference, there, of } => format!("part {there:?} of {of} of {reference}"),
            Seen::Crew(workers) => format!("{} workers", workers.len()),
        };
        follower.look().into_iter().map(|sight| words(sight.seen)).collect()
    };
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
    let tell = |store: &Store, event: &str, i: usize| {
        let run = plan.cells[i].id.0.as_str();
        let fields = json!({ "run": run, "path": "p", "device": "mock", "outcome": "done", "samples": 4 });
        store.journal(event, &fields).unwrap();
    };
    a.journal("night_started", &json!({})).unwrap();
    b.journal("night_started", &json!({})).unwrap();
    assert_eq!(a.claim(&plan, CellRef::Cell(0).into()).unwrap(), Claim::Ours);
    assert!(matches!(b.claim(&plan, CellRef::Cell(0).into()).unwrap(), Claim::Theirs(_)));
    a.start(&plan, CellRef::Cell(0), None).unwrap();
    tell(&a, "cell_started", 0);
    b.start(&plan, CellRef::Cell(1), None).unwrap();
    let mut follower = Follower::open(&home, decode).unwrap();
    let seen = |follower: &mut Follower| -> Vec<String> {
        let words = |seen: Seen| match seen {
            Seen::Began => "began".to_owned(),
            Seen::Over => "over".to_owned(),
            Seen::Started { cell, .. } => format!("{cell:?} starts"),
            Seen::Underway { cell } => format!("{cell:?} too"),
            Seen::Ended { cell, outcome, .. } => format!("{cell:?} {outcome:?}"),
            Seen::Crew(workers) => format!("{} workers", workers.iter().filter(|w| w.is_here()).count()),
            _ => "more".to_owned(),
        };
        follower.look().into_iter().map(|sight| words(sight.seen)).filter(|word| word != "more").collect()
    };
    assert_eq!(seen(&mut follower), ["began", "Cell(0) starts", "2 workers"]);
    tell(&b, "cell_started", 1);
    assert_eq!(seen(&mut follower), ["Cell(1) too"], "the one that is shown stays");
    finish_run(&a, &plan, 0);
    tell(&a, "cell_finished", 0);
    a.release(&plan, CellRef::Cell(0).into());
    assert_eq!(seen(&mut follower), ["Cell(0) Done(\"\")", "Cell(1) starts"], "and then another one is");
    // What one settled the others need not look at.
    assert!(matches!(b.settled(&plan, CellRef::Cell(0)), Some(Settled::Done(_))));
    assert_eq!(b.settled(&plan, CellRef::Cell(2)), None);
    b.fail(&plan, CellRef::Cell(2), "no lens").unwrap();
    b.release(&plan, CellRef::Cell(2).into());
    assert_eq!(join().settled(&plan, CellRef::Cell(2)), Some(Settled::Failed("no lens".to_owned())));
    let stock = a.take_stock(&plan);
    assert_eq!((stock.done.len(), stock.failed.len(), stock.open), (1, 1, 2), "a cell and the reference are open");
    // A worker that falls silent is lost, and its run open again.
    let old = std::time::SystemTime::now() - 2 * LEASE;
    for file in fs::read_dir(home.join("workers")).unwrap().flatten().map(|e| e.path()) {
        let text = fs::read_to_string(&file).unwrap();
        if text.contains("heartbeat") || file.extension().is_some_and(|e| e == "json") {
            fs::File::options().write(true).open(&file).unwrap().set_modified(old).unwrap();
        }
    }
    let mut late = Follower::open(&home, decode).unwrap();
    let late = seen(&mut late);
    assert!(late.last().is_some_and(|word| word == "0 workers"), "{late:?}");
    a.journal("night_closed", &json!({})).unwrap();
    assert!(seen(&mut follower).contains(&"over".to_owned()));
}
