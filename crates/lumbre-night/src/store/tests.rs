//! Tests of the store on real folders, with a decoder of a trivial image format.

mod processes;

use std::fs;
use std::path::Path;
use std::sync::Arc;

use glam::Vec3;

use super::read::night::read_night;
use super::schema::run::{DoneFile, RunResults};
use super::*;
use crate::experiment::event::History;
use crate::experiment::night::run::RunState;
use crate::experiment::plan::{Cell, CellIdentity, Reference, ReferenceSource};
use crate::experiment::run_progress::Claim;
use crate::experiment::spec::{MeasureSpec, Snapshots};
use crate::experiment::{CellRef, Outcome, Plan, RunId, StopRule, WaveRow};
use lumbre_light::film::Image;
use lumbre_light::scene::SceneDesc;
use lumbre_light::scene::desc::{CameraDesc, Optics};
use lumbre_light::value::Value;
use lumbre_metrics::tonemap::Tonemap;
use lumbre_render::Settings;

pub(super) fn decode(bytes: &[u8]) -> Result<Image, String> {
    match bytes {
        [b'I', grey] => Ok(Image::from_fn(1, 1, |_, _| [f32::from(*grey); 3])),
        _ => Err("not a toy picture".into()),
    }
}

fn config() -> Arc<Settings> {
    Arc::new(Settings {
        scene: "scenes/box.scn".into(),
        scene_file: "scenes/box.scn".into(),
        max_depth: Some(5),
        resolution: Some([8, 8]),
        backend: "mock".into(),
        ..Settings::new("bpt")
    })
}

fn scene() -> Arc<SceneDesc> {
    let camera = CameraDesc {
        position: Vec3::Z,
        target: Vec3::ZERO,
        optics: Optics::pinhole(40.0),
        ..CameraDesc::default()
    };
    Arc::new(SceneDesc {
        resolution: [8, 8],
        max_depth: 5,
        camera,
        ..SceneDesc::default()
    })
}

/// A plan of cells with the given ids, without references, and one rendered reference.
pub(super) fn plan(name: &str, hash: &str, ids: &[&str]) -> Plan {
    let cell = |(i, id): (usize, &&str)| Cell {
        id: RunId((*id).to_owned()),
        first: ids.iter().position(|other| other == id).unwrap(),
        point: vec![("depth".into(), Value::Int(i as i64))],
        repeat: 0,
        double_of: None,
        seed: i as u64,
        config: config(),
        scene: scene(),
        stop: StopRule::Samples(4),
        reference: None,
        path: format!("depth={i}/rep=0"),
        identity: CellIdentity::default(),
    };
    let source = ReferenceSource::Render {
        config: config(),
        scene: scene(),
        seeds: [98, 99],
        stem: RunId("ee".into()),
        stop: StopRule::Samples(64),
        shard_samples: None,
    };
    Plan {
        commands: Vec::new(),
        commands_allowed: false,
        name: name.into(),
        hash: hash.into(),
        seed: 1,
        settings: Vec::new(),
        axes: vec!["depth".into()],
        cells: ids.iter().enumerate().map(cell).collect(),
        references: vec![Reference {
            id: RunId("ee00".into()),
            source,
            identity: Value::Nil,
            bias_check: None,
        }],
        skipped: vec![],
        notes: vec![],
        warnings: vec![],
        measure: MeasureSpec {
            every_s: 1.0,
            metrics: vec![],
            snapshots: Snapshots::Last,
            captures: false,
            film_files: false,
            display: Tonemap::Srgb { exposure: 0.0 },
        },
        night: Default::default(),
        figures: vec![],
        tables: vec![],
        report: Default::default(),
        script_text: "-- a script\n".into(),
        files: Default::default(),
    }
}

pub(super) fn row(wave: u64, invalid: u64) -> WaveRow {
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

pub(super) fn finish_run(store: &Store, plan: &Plan, i: usize) {
    let mut run = store.start(plan, CellRef::Cell(i), None).unwrap();
    run.open_metrics(&[], &[]).unwrap();
    run.append_row(&row(1, 0)).unwrap();
    run.append_row(&WaveRow {
        first_invalid: Some([1, 2, 3]),
        ..row(2, 1)
    })
    .unwrap();
    run.write("final.exr", b"I\x07").unwrap();
    run.finish(&results(&plan.cells[i].id.0, 4)).unwrap();
}

/// Results of a run with this id and number of samples per pixel.
pub(super) fn results(run: &str, samples: u64) -> DoneFile {
    DoneFile::Rendered(Box::new(RunResults {
        run: run.to_owned(),
        samples,
        render_s: 0.25,
        reason: "samples".to_owned(),
        first_invalid: Some([1, 2, 3]),
        ..RunResults::default()
    }))
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
    assert_eq!(
        fs::read_to_string(store.folder().join("experiment.lua")).unwrap(),
        "-- a script\n"
    );
    finish_run(&store, &plan, 0);
    let mut half = store.start(&plan, CellRef::Cell(1), None).unwrap();
    half.open_metrics(&[], &[]).unwrap();
    half.append_row(&row(1, 0)).unwrap();
    half.write("final.exr", b"I\x01").unwrap();
    drop(half);

    let found = store.finished_run(&plan, CellRef::Cell(0)).unwrap();
    assert_eq!(
        found.rows,
        [
            row(1, 0),
            WaveRow {
                first_invalid: Some([1, 2, 3]),
                ..row(2, 1)
            }
        ]
    );
    assert_eq!(store.finished_run(&plan, CellRef::Cell(1)), None);

    let run = only_run_of(&store, "aa11");
    for damage in ["done.json", "final.exr", "metrics.csv"] {
        let kept = fs::read(run.join(damage)).unwrap();
        fs::remove_file(run.join(damage)).unwrap();
        assert_eq!(
            store.finished_run(&plan, CellRef::Cell(0)),
            None,
            "without {damage}"
        );
        fs::write(run.join(damage), kept).unwrap();
        assert!(store.finished_run(&plan, CellRef::Cell(0)).is_some());
    }
    fs::write(run.join("done.json"), "{\"run\": \"aa1").unwrap();
    assert_eq!(store.finished_run(&plan, CellRef::Cell(0)), None);
}

#[test]
fn layer_images_belong_to_their_run() {
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
    run.write("films/depth-9.exr", b"of an interrupted run")
        .unwrap();
    drop(run);
    let run = start();
    run.write("films/depth-1.exr", b"I\x01").unwrap();
    let folder = run.folder().to_owned();
    let done = DoneFile::Rendered(Box::new(RunResults {
        run: "aa11".to_owned(),
        films: vec!["depth-1".to_owned()],
        ..RunResults::default()
    }));
    run.finish(&done).unwrap();

    let shown = read_run(dir.path(), &folder.to_string_lossy()).unwrap();
    let films: Vec<&str> = shown
        .files
        .iter()
        .map(|(name, _)| name.as_str())
        .filter(|n| n.contains('/'))
        .collect();
    assert_eq!(
        films,
        ["films/depth-1.exr"],
        "the film of the first attempt was removed"
    );
    assert!(
        !shown.files.iter().any(|(name, _)| name == "films"),
        "folders are not listed as files"
    );

    assert!(store.finished_run(&plan, CellRef::Cell(0)).is_some());
    fs::remove_file(folder.join("films/depth-1.exr")).unwrap();
    assert_eq!(
        store.finished_run(&plan, CellRef::Cell(0)),
        None,
        "a film is missing"
    );
}

pub(super) fn only_run_of(store: &Store, id: &str) -> PathBuf {
    let runs = layout::runs_below(&store.folder().join("runs"));
    runs.into_iter().find(|r| r.ends_with(id)).unwrap()
}

#[test]
fn a_row_replaces_the_rest_of_a_failed_attempt_to_write_it() {
    let dir = tempfile::tempdir().unwrap();
    let plan = plan("night", "3f9a00", &["aa11"]);
    let store = Store::open(dir.path(), &plan, decode).unwrap();
    let mut run = store.start(&plan, CellRef::Cell(0), None).unwrap();
    run.open_metrics(&[], &[]).unwrap();
    run.append_row(&row(1, 0)).unwrap();
    let file = run.folder().join("metrics.csv");
    let complete = fs::read_to_string(&file).unwrap();
    fs::write(&file, complete.clone() + "2,4,0.2").unwrap();
    run.append_row(&row(2, 0)).unwrap();
    let text = fs::read_to_string(&file).unwrap();
    assert!(text.starts_with(&complete), "{text}");
    let added: Vec<&str> = text[complete.len()..].lines().collect();
    assert!(
        matches!(added[..], [line] if line.starts_with("2,4,0.25,")),
        "{text}"
    );
}

#[test]
fn the_share_of_lost_time_is_that_of_the_time_in_the_renderer() {
    let dir = tempfile::tempdir().unwrap();
    let plan = plan("night", "3f9a00", &["aa11"]);
    let store = Store::open(dir.path(), &plan, decode).unwrap();
    let mut run = store.start(&plan, CellRef::Cell(0), None).unwrap();
    run.open_metrics(&[], &[]).unwrap();
    run.append_row(&row(1, 0)).unwrap();
    let DoneFile::Rendered(mut done) = results("aa11", 2) else {
        panic!("not of a run")
    };
    (done.render_s, done.lost_s) = (0.25, Some(0.75));
    run.finish(&DoneFile::Rendered(done)).unwrap();
    let night = read_night(store.folder(), &Evidence::default()).unwrap();
    assert_eq!(night.runs[0].lost_share, Some(0.75));
}

#[test]
fn a_new_attempt_clears_the_failure_of_the_last_one() {
    let dir = tempfile::tempdir().unwrap();
    let plan = plan("night", "3f9a00", &["aa11"]);
    let store = Store::open(dir.path(), &plan, decode).unwrap();
    let failure = || store.failure(&plan, CellRef::Cell(0)).map(|f| f.reason);
    store
        .record_failure(&plan, CellRef::Cell(0), "the lens fell off")
        .unwrap();
    assert_eq!(failure().as_deref(), Some("the lens fell off"));
    store.start(&plan, CellRef::Cell(0), None).unwrap();
    assert_eq!(failure(), None);
}

#[test]
fn starting_again_removes_old_results_and_keeps_other_files() {
    let dir = tempfile::tempdir().unwrap();
    let plan = plan("night", "3f9a00", &["aa11"]);
    let store = Store::open(dir.path(), &plan, decode).unwrap();
    finish_run(&store, &plan, 0);
    let folder = only_run(store.folder());
    fs::write(folder.join("snap-2.exr"), b"old").unwrap();
    fs::write(folder.join("my notes.txt"), b"keep").unwrap();
    let run = store.start(&plan, CellRef::Cell(0), None).unwrap();
    assert_eq!(run.folder(), folder);
    let mut names: Vec<_> = fs::read_dir(&folder)
        .unwrap()
        .map(|e| e.unwrap().file_name())
        .collect();
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
    assert_eq!(store.finished_run(&second, CellRef::Cell(0)), None);
    let found = store.finished_run(&second, CellRef::Cell(1)).unwrap();
    assert!(found.folder.starts_with(dir.path().join("night-3f9a")));
    let other = plan("day", "3f9a00", &["aa11"]);
    assert_eq!(
        Archive::new(dir.path(), decode).finished_run(&other, CellRef::Cell(0)),
        None
    );
    assert!(
        Archive::new(dir.path(), decode)
            .finished_run(&first, CellRef::Cell(0))
            .is_some()
    );
    let listed = list_experiments(dir.path()).nights;
    let states: Vec<_> = listed
        .iter()
        .flat_map(|e| &e.runs)
        .map(|r| (r.id.as_str(), r.state.name()))
        .collect();
    assert_eq!(
        states,
        [("aa11", "done"), ("cc33", "pending"), ("aa11", "elsewhere")]
    );
}

#[test]
fn a_cell_with_the_same_id_finds_the_run_that_was_just_finished() {
    let dir = tempfile::tempdir().unwrap();
    let plan = plan("night", "3f9a00", &["aa11", "aa11"]);
    let store = Store::open(dir.path(), &plan, decode).unwrap();
    assert_eq!(store.finished_run(&plan, CellRef::Cell(1)), None);
    finish_run(&store, &plan, 0);
    assert!(
        store
            .finished_run(&plan, CellRef::Cell(1))
            .unwrap()
            .folder
            .ends_with("depth=0/rep=0/aa11")
    );
}

#[test]
fn another_plan_with_the_same_digits_gets_more_of_them() {
    let dir = tempfile::tempdir().unwrap();
    let first = plan("night", "3f9a00", &[]);
    let second = plan("night", "3f9a11", &[]);
    Store::open(dir.path(), &first, decode).unwrap();
    assert_eq!(
        Store::open(dir.path(), &second, decode).unwrap().folder(),
        dir.path().join("night-3f9a1")
    );
    assert_eq!(
        Store::open(dir.path(), &first, decode).unwrap().folder(),
        dir.path().join("night-3f9a")
    );
    assert_eq!(
        Store::open(dir.path(), &second, decode).unwrap().folder(),
        dir.path().join("night-3f9a1")
    );
}

/// Repeats a claim whose owner has just released it until it is granted. A child process that
/// another test starts inherits open files for a moment, and their locks with them.
pub fn eventually(mut ask: impl FnMut() -> Claim) -> Claim {
    let since = std::time::Instant::now();
    loop {
        let claim = ask();
        if claim == Claim::Granted || since.elapsed() > std::time::Duration::from_secs(20) {
            return claim;
        }
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
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
    run.write_rows(&[WaveRow {
        metrics: vec![0.5],
        ..row(1, 0)
    }])
    .unwrap();
    assert!(store.finished_run(&plan, CellRef::Reference(0)).is_none());
    run.finish(&results("ee00", 64)).unwrap();
    assert_eq!(
        store
            .finished_run(&plan, CellRef::Reference(0))
            .unwrap()
            .rows,
        [row(1, 0)]
    );
    assert_eq!(store.image(&plan, 0).unwrap().unwrap().at(0, 0), [5.0; 3]);
    // An image file as reference is read from its own path; errors name the file.
    let file = dir.path().join("truth.exr");
    plan.references[0].source = ReferenceSource::File {
        file: file.clone(),
        source: String::new(),
    };
    assert!(store.image(&plan, 0).unwrap_err().0.contains("truth.exr"));
    fs::write(&file, b"I\x09").unwrap();
    assert_eq!(store.image(&plan, 0).unwrap().unwrap().at(0, 0), [9.0; 3]);
    fs::write(&file, b"junk").unwrap();
    assert!(
        store
            .image(&plan, 0)
            .unwrap_err()
            .0
            .contains("not a toy picture")
    );
}

#[test]
fn rows_of_another_width_than_the_header_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let plan = plan("night", "3f9a00", &["aa11"]);
    let store = Store::open(dir.path(), &plan, decode).unwrap();
    let mut run = store.start(&plan, CellRef::Cell(0), None).unwrap();
    assert!(run.append_row(&row(1, 0)).is_err());
    run.open_metrics(&["rmse"], &[]).unwrap();
    assert!(
        run.append_row(&row(1, 0))
            .unwrap_err()
            .to_string()
            .contains("0 metrics")
    );
}

#[test]
fn runs_are_found_by_folder_and_by_the_first_digits() {
    let dir = tempfile::tempdir().unwrap();
    let plan = plan("night", "3f9a00", &["aa11", "aa22"]);
    let store = Store::open(dir.path(), &plan, decode).unwrap();
    finish_run(&store, &plan, 0);
    finish_run(&store, &plan, 1);
    let record = read_run(dir.path(), "AA1").unwrap();
    assert_eq!(record.config.run, "aa11");
    assert_eq!(record.config.settings().unwrap().filter.kind.name(), "box");
    let rows = &record.measurements.rows;
    assert_eq!(rows.len(), 2);
    assert_eq!(rows[1].first_invalid, Some([1, 2, 3]));
    assert!(
        record
            .files
            .iter()
            .any(|(name, size)| name == "final.exr" && *size == 2)
    );
    assert_eq!(
        read_run(dir.path(), record.folder.to_str().unwrap()).unwrap(),
        record
    );
    assert!(matches!(
        read_run(dir.path(), "aa"),
        Err(StoreError::Ambiguous { .. })
    ));
    assert!(matches!(
        read_run(dir.path(), "ff"),
        Err(StoreError::NoSuchRun { .. })
    ));
    let folder = store.folder().to_str().unwrap();
    assert!(
        read_run(dir.path(), folder)
            .unwrap_err()
            .to_string()
            .contains("lumbre ls")
    );
}

#[test]
fn failed_unfinished_and_pending_runs_have_different_states() {
    let dir = tempfile::tempdir().unwrap();
    let plan = plan("night", "3f9a00", &["aa11", "bb22", "cc33"]);
    let store = Store::open(dir.path(), &plan, decode).unwrap();
    drop(store.start(&plan, CellRef::Cell(0), None).unwrap());
    drop(store.start(&plan, CellRef::Cell(1), None).unwrap());
    store
        .record_failure(&plan, CellRef::Cell(0), "disk full")
        .unwrap();
    let listed = list_experiments(dir.path()).nights;
    let states: Vec<_> = listed[0].runs.iter().map(|r| r.state.clone()).collect();
    assert_eq!(
        states,
        [
            RunState::Ended(Outcome::Failed("disk full".into())),
            RunState::Ended(Outcome::Interrupted),
            RunState::Pending
        ]
    );
    assert_eq!(listed[0].references[0].state, RunState::Pending);
    let nowhere = list_experiments(&dir.path().join("nowhere"));
    assert!(nowhere.nights.is_empty() && nowhere.refused.is_empty());
}

#[cfg(unix)]
#[test]
fn latest_points_at_the_newest_night_and_results_are_ordinary_files() {
    use std::os::unix::fs::PermissionsExt;
    let dir = tempfile::tempdir().unwrap();
    for hash in ["1111aa", "2222bb"] {
        let plan = plan("night", hash, &[]);
        let store = Store::open(dir.path(), &plan, decode).unwrap();
        assert_eq!(
            fs::read_link(dir.path().join("latest"))
                .unwrap()
                .as_os_str(),
            store.folder().file_name().unwrap()
        );
        let mode = |name: &str| {
            fs::metadata(store.folder().join(name))
                .unwrap()
                .permissions()
                .mode()
                & 0o777
        };
        assert_eq!(mode("plan.json"), mode("journal.jsonl"));
    }
}

#[test]
fn a_night_of_another_version_is_refused_with_the_program_that_wrote_it() {
    let dir = tempfile::tempdir().unwrap();
    let plan = plan("night", "3f9a00", &["aa11"]);
    let folder = Store::open(dir.path(), &plan, decode)
        .unwrap()
        .folder()
        .to_owned();
    let write = |name: &str, text: &str| fs::write(folder.join(name), text).unwrap();
    write(
        "plan.json",
        r#"{"name":"night","hash":"3f9a00","cells":[]}"#,
    );
    write("env.json", r#"{"program":"lumbre 0.0.9"}"#);
    let errors = [
        NightReader::open(&folder).unwrap_err().to_string(),
        Follower::open(&folder, decode).unwrap_err().to_string(),
        Store::open(dir.path(), &plan, decode)
            .unwrap_err()
            .to_string(),
        list_experiments(dir.path()).refused[0].to_string(),
    ];
    for error in errors {
        assert!(
            error.contains("plan.json was written by lumbre 0.0.9 in another format"),
            "{error}"
        );
    }
}
