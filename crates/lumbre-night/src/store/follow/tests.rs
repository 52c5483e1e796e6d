//! Tests of following nights by their files.

use std::collections::BTreeMap;
use std::fs;
use std::sync::Arc;

use proptest::prelude::*;
use serde_json::json;

use super::Follower;
use crate::experiment::event::History;
use crate::experiment::night::run::RunState;
use crate::experiment::run_progress::{Claim, ReportedOutcome};
use crate::experiment::shards::Shard;
use crate::experiment::{CellRef, EndCause, Event, Night, Outcome, Plan, StopRule, WaveRow};
use crate::store::schema::journal::{
    JournalEvent, JournalLine, NightStart, OutcomeKind, RunEnd, RunStart, ShardEnd, ShardRecord,
    ShardStart, WaveRecord,
};
use crate::store::schema::one_line;
use crate::store::schema::run::{BiasCheckFile, DoneFile, RunResults};
use crate::store::tests::{decode, finish_run, only_run_of, opened, plan, results, row};
use crate::store::{FILMS, LEASE, PlanSnapshot, RunWriter, Store, StoredFile, WorkerInfo};
use lumbre_light::film::time::TimeAxis;
use lumbre_render::{Device, OpenStats};

/// Polls once, and describes the events.
fn poll(follower: &mut Follower) -> Vec<String> {
    let description = |event: Event| match event {
        Event::NightStarted { .. } => "night started".to_owned(),
        Event::Forecast(left) => format!("{} known", left.known),
        Event::BiasCheck {
            reference, check, ..
        } => format!("reference {reference} agrees: {}", check.agrees),
        Event::NightFinished => "night ended".to_owned(),
        Event::CellStarted {
            cell,
            settings,
            open,
            ..
        } => {
            let technique = settings.map(|settings| settings.integrator.clone());
            let technique = technique.unwrap_or_else(|| "unknown".to_owned());
            format!("{cell:?} starts {technique} on {}", open.device_line())
        }
        Event::Wave { cell, row, .. } => format!("{cell:?} has {}", row.samples),
        Event::CellFinished {
            cell,
            outcome,
            rows,
            ..
        } => {
            let end = match &outcome {
                Outcome::Done(cause) if cause.is_limit => format!("Limit({:?})", cause.clause),
                Outcome::Done(cause) => format!("Done({:?})", cause.clause),
                other => format!("{other:?}"),
            };
            format!(
                "{cell:?} {end} after {:?}",
                rows.last().map(|row| row.samples)
            )
        }
        Event::Picture { cell, image } => format!("{cell:?} shows {}", image.at(0, 0)[0]),
        Event::Message { text, .. } => text,
        Event::Layer { layer, .. } => layer.film.name(),
        Event::RunActive { cell } => format!("{cell:?} is active"),
        Event::ShardActive { shard } => {
            format!("shard of reference {} is active", shard.reference)
        }
        Event::ShardFinished { shard, .. } => {
            format!("shard {} of {} ended", shard.number, shard.count)
        }
        other => format!("{other:?}"),
    };
    let Some(changes) = follower.poll() else {
        return Vec::new();
    };
    let events = changes.events.into_iter();
    let times = changes.times.iter();
    let times = times.map(|times| format!("{:?} has {} bins", times.cell, times.axis.bins));
    let workers = changes.workers.iter();
    let workers = workers.map(|workers| {
        let active = workers.iter().filter(|worker| worker.is_active());
        format!("{} workers", active.count())
    });
    events
        .map(|timed| description(timed.event))
        .chain(times)
        .chain(workers)
        .collect()
}

/// Polls once, without measurements and images.
fn poll_cells(follower: &mut Follower) -> Vec<String> {
    let mut events = poll(follower);
    events.retain(|event| !event.contains(" has ") && !event.contains(" shows "));
    events
}

/// Polls once, without the workers, which are reported at intervals, and sorted.
fn poll_runs(follower: &mut Follower) -> Vec<String> {
    let mut events = poll(follower);
    events.retain(|event| !event.ends_with(" workers"));
    events.sort();
    events
}

fn night_start() -> JournalEvent {
    JournalEvent::NightStarted(NightStart::default())
}

fn started(run: &str) -> JournalEvent {
    JournalEvent::CellStarted(RunStart {
        run: run.to_owned(),
        devices: vec![Device::from_line("mock")],
        ..RunStart::default()
    })
}

fn finished(run: &str, reason: &str, samples: u64) -> JournalEvent {
    JournalEvent::CellFinished(RunEnd {
        run: run.to_owned(),
        outcome: OutcomeKind::Done,
        reason: reason.to_owned(),
        limit: reason == "samples",
        last: Some(WaveRecord {
            samples,
            ..WaveRecord::default()
        }),
        ..RunEnd::default()
    })
}

/// Appends a journal line about the start of a cell.
fn start_line(store: &Store, plan: &Plan, i: usize) {
    store.journal(started(&plan.cells[i].id.0)).unwrap();
}

/// Appends a journal line about the end of a cell.
fn end_line(store: &Store, plan: &Plan, i: usize) {
    store.journal(finished(&plan.cells[i].id.0, "", 4)).unwrap();
}

#[test]
fn a_night_is_followed_while_it_renders() {
    let (dir, plan, store) = opened(&["aa11", "bb22"]);
    store.journal(night_start()).unwrap();
    finish_run(&store, &plan, 0);
    start_line(&store, &plan, 0);
    store.journal(finished("aa11", "samples", 4)).unwrap();
    let mut run = store.start(&plan, CellRef::Cell(1), None).unwrap();
    run.open_metrics(&[], &[]).unwrap();
    start_line(&store, &plan, 1);
    let mut follower = Follower::open(store.folder(), decode).unwrap();
    assert_eq!(
        follower.night().stop(CellRef::Cell(0)).unwrap().rule,
        StopRule::Samples(4)
    );
    let first = poll(&mut follower);
    let starts = "Cell(1) starts bpt on mock";
    assert_eq!(
        first,
        [
            "night started",
            "Cell(0) Limit(\"samples\") after Some(4)",
            starts
        ],
        "only the end of the first run is reported"
    );
    assert!(poll(&mut follower).is_empty());
    run.append_row(&row(1, 0)).unwrap();
    run.append_row(&row(2, 0)).unwrap();
    run.write("snap-4.exr", b"I\x05").unwrap();
    assert_eq!(
        poll(&mut follower),
        ["Cell(1) has 2", "Cell(1) has 4", "Cell(1) shows 5"]
    );
    run.append_row(&row(3, 0)).unwrap();
    run.write("final.exr", b"I\x07").unwrap();
    run.finish(&results("bb22", 8)).unwrap();
    store.journal(finished("bb22", "samples", 8)).unwrap();
    store.journal(JournalEvent::NightFinished {}).unwrap();
    let last = [
        "Cell(1) has 8",
        "Cell(1) shows 7",
        "Cell(1) Limit(\"samples\") after Some(8)",
        "night ended",
    ];
    assert_eq!(poll(&mut follower), last);
    for agrees in [false, true] {
        let found = BiasCheckFile {
            reference: "ee00".to_owned(),
            second: "ff00".to_owned(),
            agrees,
            ..BiasCheckFile::default()
        };
        store.journal(JournalEvent::BiasCheck(found)).unwrap();
    }
    assert_eq!(
        poll(&mut follower),
        ["reference 0 agrees: false", "reference 0 agrees: true"]
    );
    // A further follower, after the last file of a run was deleted.
    fs::remove_file(only_run_of(&store, "aa11").join("done.json")).unwrap();
    let late = poll(&mut Follower::open(store.folder(), decode).unwrap());
    assert!(
        !late.iter().any(|event| event.starts_with("Cell(0) Done")),
        "{late:?}"
    );
    assert!(
        Follower::open(dir.path(), decode)
            .unwrap_err()
            .to_string()
            .contains("lumbre ls")
    );
}

#[test]
fn workers_are_followed_by_their_own_journals() {
    let dir = tempfile::tempdir().unwrap();
    let plan = plan("night", "3f9a00", &["aa11", "bb22", "cc33"]);
    let home = Store::open(dir.path(), &plan, decode)
        .unwrap()
        .folder()
        .to_owned();
    let worker = WorkerInfo {
        job: "7_0".to_owned(),
        ..WorkerInfo::default()
    };
    let join = || Store::join(&home, &plan, &PlanSnapshot::default(), decode, &worker).unwrap();
    let (a, b) = (join(), join());
    a.journal(night_start()).unwrap();
    b.journal(night_start()).unwrap();
    assert_eq!(
        a.claim(&plan, CellRef::Cell(0).into()).unwrap(),
        Claim::Granted
    );
    assert!(matches!(
        b.claim(&plan, CellRef::Cell(0).into()).unwrap(),
        Claim::HeldBy(_)
    ));
    a.start(&plan, CellRef::Cell(0), None).unwrap();
    start_line(&a, &plan, 0);
    b.start(&plan, CellRef::Cell(1), None).unwrap();
    let mut follower = Follower::open(&home, decode).unwrap();
    assert_eq!(
        poll_cells(&mut follower),
        ["night started", "Cell(0) starts bpt on mock", "2 workers"]
    );
    start_line(&b, &plan, 1);
    assert_eq!(
        poll_cells(&mut follower),
        ["Cell(1) is active"],
        "the run that is shown stays"
    );
    finish_run(&a, &plan, 0);
    end_line(&a, &plan, 0);
    a.release(&plan, CellRef::Cell(0).into());
    assert_eq!(
        poll_cells(&mut follower),
        [
            "Cell(0) Done(\"\") after Some(4)",
            "Cell(1) starts bpt on mock"
        ],
        "then another worker's run is shown"
    );
    // Other workers read the completion markers of finished and failed runs.
    assert!(matches!(
        b.reported_outcome(&plan, CellRef::Cell(0)),
        Some(ReportedOutcome::Done(_))
    ));
    assert_eq!(b.reported_outcome(&plan, CellRef::Cell(2)), None);
    b.record_failure(&plan, CellRef::Cell(2), "no lens")
        .unwrap();
    b.release(&plan, CellRef::Cell(2).into());
    assert_eq!(
        join().reported_outcome(&plan, CellRef::Cell(2)),
        Some(ReportedOutcome::Failed("no lens".to_owned()))
    );
    let status = a.plan_status(&plan);
    assert_eq!(
        (status.done.len(), status.failed.len(), status.open),
        (1, 1, 2),
        "a cell and the reference are open"
    );
    // A worker without a heartbeat is lost, and the run that it rendered is open again.
    let shard = ShardStart {
        run: plan.references[0].id.0.clone(),
        shard: ShardRecord {
            number: 1,
            count: 2,
            ..ShardRecord::default()
        },
        ..ShardStart::default()
    };
    b.journal(JournalEvent::ShardStarted(shard)).unwrap();
    let old = std::time::SystemTime::now() - 2 * LEASE;
    for file in fs::read_dir(home.join("workers"))
        .unwrap()
        .flatten()
        .map(|e| e.path())
    {
        let text = fs::read_to_string(&file).unwrap();
        if text.contains("heartbeat") || file.extension().is_some_and(|e| e == "json") {
            fs::File::options()
                .write(true)
                .open(&file)
                .unwrap()
                .set_modified(old)
                .unwrap();
        }
    }
    let mut late = Follower::open(&home, decode).unwrap();
    let late = poll_cells(&mut late);
    let end = ["Cell(1) Interrupted after None", "0 workers"];
    assert!(
        late.ends_with(&end.map(str::to_owned)),
        "the shard is lost, but its reference has not ended: {late:?}"
    );
    a.journal(JournalEvent::NightClosed {}).unwrap();
    assert!(poll_cells(&mut follower).contains(&"night ended".to_owned()));
}

#[test]
fn a_finished_reference_stays_so_when_lines_about_its_shards_come_in_the_same_second() {
    let dir = tempfile::tempdir().unwrap();
    let plan = plan("night", "3f9a00", &["aa11"]);
    let home = Store::open(dir.path(), &plan, decode)
        .unwrap()
        .folder()
        .to_owned();
    let id = plan.references[0].id.0.as_str();
    let folder = crate::store::layout::reference_folder(dir.path(), &plan.references[0].id);
    fs::create_dir_all(home.join("workers")).unwrap();
    // Journals of two workers, the second of which joined the reference begun by the first.
    let write = |worker: &str, events: &[JournalEvent]| {
        let line = |event: &JournalEvent| {
            one_line(&JournalLine {
                date: "2026-04-27T21:30:00Z".to_owned(),
                event: event.clone(),
            })
        };
        let text: String = events.iter().map(line).collect();
        fs::write(
            home.join("workers").join(worker).with_extension("jsonl"),
            text,
        )
        .unwrap();
    };
    let shard = ShardRecord {
        number: 1,
        count: 1,
        ..ShardRecord::default()
    };
    let start = JournalEvent::ShardStarted(ShardStart {
        run: id.to_owned(),
        shard: shard.clone(),
        ..ShardStart::default()
    });
    let finish = JournalEvent::ShardFinished(ShardEnd {
        run: id.to_owned(),
        shard,
        outcome: OutcomeKind::Done,
        ..ShardEnd::default()
    });
    write("a", &[finished(id, "", 4)]);
    write("b", &[start, finish]);
    let mentions_shards = |events: &[String]| {
        events
            .iter()
            .any(|event| event.contains("shard") || event.ends_with(" is active"))
    };
    let rendered_again = poll_runs(&mut Follower::open(&home, decode).unwrap());
    assert!(
        mentions_shards(&rendered_again),
        "its files are missing: {rendered_again:?}"
    );
    fs::create_dir_all(&folder).unwrap();
    let done = DoneFile::Rendered(Box::new(RunResults {
        run: id.to_owned(),
        ..RunResults::default()
    }));
    let done = done.sealed(Default::default());
    fs::write(folder.join("ref.json"), done.text()).unwrap();
    let events = poll_runs(&mut Follower::open(&home, decode).unwrap());
    assert!(
        events.contains(&"Reference(0) Done(\"\") after Some(4)".to_owned()),
        "{events:?}"
    );
    assert!(!mentions_shards(&events), "{events:?}");
}

#[test]
fn interleaved_runs_of_one_worker_are_shown_together() {
    let dir = tempfile::tempdir().unwrap();
    let plan = plan("night", "3f9a00", &["aa11", "bb22", "cc33", "dd44"]);
    let home = Store::open(dir.path(), &plan, decode)
        .unwrap()
        .folder()
        .to_owned();
    let join = || {
        Store::join(
            &home,
            &plan,
            &PlanSnapshot::default(),
            decode,
            &WorkerInfo::default(),
        )
        .unwrap()
    };
    let (a, b) = (join(), join());
    let begin = |store: &Store, i: usize| {
        let mut run = store.start(&plan, CellRef::Cell(i), None).unwrap();
        run.open_metrics(&[], &[]).unwrap();
        start_line(store, &plan, i);
        run
    };
    a.journal(JournalEvent::WorkerStarted(NightStart::default()))
        .unwrap();
    let mut first = begin(&a, 0);
    let mut follower = Follower::open(&home, decode).unwrap();
    poll_runs(&mut follower);
    let (mut second, mut other) = (begin(&a, 1), begin(&b, 2));
    let both = poll_runs(&mut follower);
    assert_eq!(
        both,
        ["Cell(1) starts bpt on mock", "Cell(2) is active"],
        "an interleaved run, and the run of another worker"
    );
    for (run, samples) in [(&mut first, 1), (&mut second, 2), (&mut other, 3)] {
        run.append_row(&row(samples, 0)).unwrap();
    }
    assert_eq!(
        poll_runs(&mut follower),
        ["Cell(0) has 2", "Cell(1) has 4"],
        "only the shown worker's runs are measured"
    );
    // One of them ends; its worker is still shown.
    let mut end = |run: RunWriter, i: usize| {
        run.finish(&results(&plan.cells[i].id.0, 4)).unwrap();
        end_line(&a, &plan, i);
        poll_runs(&mut follower)
    };
    assert_eq!(end(first, 0), ["Cell(0) Done(\"\") after Some(4)"]);
    let _fourth = begin(&b, 3);
    let next = end(second, 1);
    let both = ["Cell(2) starts bpt on mock", "Cell(3) starts bpt on mock"];
    assert!(
        both.iter().all(|start| next.contains(&(*start).to_owned())),
        "then all runs of the next worker: {next:?}"
    );
    assert!(next.contains(&"Cell(2) has 8".to_owned()), "{next:?}");
}

#[test]
fn the_time_resolved_film_is_reported_once_after_the_run() {
    let dir = tempfile::tempdir().unwrap();
    let mut plan = plan("night", "3f9a00", &["aa11"]);
    let film = lumbre_light::value::Value::from_json(
        &json!({ "time": { "start": 2, "bin": 0.5, "bins": 8 } }),
    );
    let cell = Arc::make_mut(&mut plan.cells[0].config);
    cell.timing =
        lumbre_light::transport::time_settings::Timing::from_film(film.as_map().unwrap(), "film")
            .unwrap();
    let store = Store::open(dir.path(), &plan, decode).unwrap();
    store.journal(night_start()).unwrap();
    let mut run = store.start(&plan, CellRef::Cell(0), None).unwrap();
    run.open_metrics(&[], &[]).unwrap();
    start_line(&store, &plan, 0);
    let mut follower = Follower::open(store.folder(), decode).unwrap();
    assert_eq!(
        poll(&mut follower),
        ["night started", "Cell(0) starts bpt on mock"]
    );
    let file = only_run_of(&store, "aa11")
        .join(FILMS)
        .join("time-cube.npy");
    fs::create_dir_all(file.parent().unwrap()).unwrap();
    fs::write(&file, b"").unwrap();
    assert!(
        poll(&mut follower).is_empty(),
        "not before the run has ended"
    );
    end_line(&store, &plan, 0);
    let changes = follower.poll().unwrap();
    let times = changes
        .times
        .iter()
        .map(|times| (times.file.clone(), times.axis));
    assert_eq!(
        times.collect::<Vec<_>>(),
        [(
            file,
            TimeAxis {
                start: 2.0,
                bin: 0.5,
                bins: 8
            }
        )]
    );
    assert!(poll(&mut follower).is_empty(), "and only once");
}

/// Something that happens in a night.
#[derive(Clone, Debug)]
enum Step {
    /// A cell starts, unless it renders or is done.
    Start(usize),
    /// A cell that renders is measured.
    Wave(usize),
    /// A cell that renders ends.
    End(usize, OutcomeKind),
    /// A shard of the reference starts, unless one renders.
    StartShard(usize),
    /// The shard that renders ends, finished or not.
    EndShard(bool),
    /// The process is killed, and a new one begins the night again.
    Crash,
}

fn any_step() -> impl Strategy<Value = Step> {
    let kind = prop_oneof![
        Just(OutcomeKind::Done),
        Just(OutcomeKind::Failed),
        Just(OutcomeKind::Interrupted)
    ];
    prop_oneof![
        3 => (0usize..3).prop_map(Step::Start),
        3 => (0usize..3).prop_map(Step::Wave),
        3 => (0usize..3, kind).prop_map(|(cell, kind)| Step::End(cell, kind)),
        1 => (1usize..3).prop_map(Step::StartShard),
        1 => any::<bool>().prop_map(Step::EndShard),
        1 => Just(Step::Crash),
    ]
}

/// A night that renders: its state, and its files.
struct LiveNight<'a> {
    plan: &'a Plan,
    store: &'a Store,
    night: Night,
    /// Writers of the cells that render.
    writers: BTreeMap<usize, RunWriter>,
    /// Number of the shard that renders.
    shard: Option<usize>,
    waves: u64,
}

impl LiveNight<'_> {
    /// Applies an event, and enters it in the journal.
    fn emit(&mut self, event: &Event) {
        self.night.apply(event);
        if let Some(line) = JournalEvent::from_event(event, self.plan) {
            self.store.journal(line).unwrap();
        }
    }

    /// Begins the night in a new process, which finds finished runs.
    fn begin(&mut self) {
        self.writers.clear();
        self.shard = None;
        let done: Vec<CellRef> = self.night.all().collect();
        let done = done
            .into_iter()
            .filter(|cell| self.night.state(*cell).unwrap().is_done());
        let done: Vec<(CellRef, WaveRow)> = done
            .map(|cell| (cell, self.night.last_row(cell).unwrap().clone()))
            .collect();
        let mut night = Night::planned(self.plan);
        // Shards that were finished stay so, as their files do.
        Arc::make_mut(&mut night.references[0]).shards = self.night.references[0].shards.clone();
        let night = Arc::new(night);
        self.emit(&Event::NightStarted { night });
        for (cell, last) in done {
            let folder = self.store.run_folder(self.plan, cell);
            self.emit(&Event::ended(cell, Outcome::Cached(folder), vec![last]));
        }
    }

    fn take(&mut self, step: &Step) {
        let shard = |number| Shard {
            reference: 0,
            first: 0,
            end: 8,
            number,
            count: 2,
        };
        match *step {
            Step::Start(i) => {
                let cell = CellRef::Cell(i);
                let state = self.night.state(cell).unwrap();
                if *state == RunState::Running || state.is_done() {
                    return;
                }
                let mut writer = self.store.start(self.plan, cell, None).unwrap();
                writer.open_metrics(&[], &[]).unwrap();
                self.writers.insert(i, writer);
                self.emit(&Event::CellStarted {
                    cell,
                    open: OpenStats::default(),
                    reference: None,
                    resumed: None,
                    settings: None,
                });
            }
            Step::Wave(i) => {
                if let Some(writer) = self.writers.get_mut(&i) {
                    self.waves += 1;
                    let row = row(self.waves, 0);
                    writer.append_row(&row).unwrap();
                    self.emit(&Event::Wave {
                        cell: CellRef::Cell(i),
                        row,
                        measure_s: 0.0,
                        image: None,
                        noise: None,
                        pow2: false,
                    });
                }
            }
            Step::End(i, kind) => {
                let Some(writer) = self.writers.remove(&i) else {
                    return;
                };
                let outcome = match kind {
                    OutcomeKind::Done => {
                        let id = &self.plan.cells[i].id.0;
                        writer.finish(&results(id, 4)).unwrap();
                        Outcome::Done(EndCause::limit("4 samples"))
                    }
                    OutcomeKind::Failed => Outcome::Failed("no memory".to_owned()),
                    _ => Outcome::Interrupted,
                };
                let rows = vec![row(2, 0)];
                self.emit(&Event::ended(CellRef::Cell(i), outcome, rows));
            }
            Step::StartShard(number) => {
                if self.shard.is_none() {
                    self.shard = Some(number);
                    self.emit(&Event::ShardStarted {
                        shard: shard(number),
                        open: OpenStats::default(),
                        resumed: None,
                    });
                }
            }
            Step::EndShard(done) => {
                if let Some(number) = self.shard.take() {
                    self.emit(&Event::ShardFinished {
                        shard: shard(number),
                        outcome: match done {
                            true => Outcome::Done(EndCause::limit("8 samples")),
                            false => Outcome::Interrupted,
                        },
                        last: None,
                        sums: None,
                    });
                }
            }
            Step::Crash => self.begin(),
        }
    }
}

/// Returns everything that a reader of the files can know of a night.
fn known(night: &Night) -> Vec<String> {
    let shards = night.references[0].shards.clone();
    let state = |cell| {
        let samples = night.last_row(cell).map(|row| row.samples);
        format!("{cell:?} {:?} {samples:?}", night.state(cell))
    };
    let states = night.all().map(state);
    states.chain([format!("{shards:?}")]).collect()
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 48,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn a_night_that_is_read_from_its_files_is_the_one_that_renders(
        steps in proptest::collection::vec(any_step(), 0..24),
    ) {
        let (_dir, plan, store) = opened(&["aa11", "bb22", "cc33"]);
        let mut live = LiveNight {
            plan: &plan,
            store: &store,
            night: Night::planned(&plan),
            writers: BTreeMap::new(),
            shard: None,
            waves: 0,
        };
        live.begin();
        let mut follower = Follower::open(store.folder(), decode).unwrap();
        for step in &steps {
            live.take(step);
            follower.poll();
            prop_assert_eq!(known(follower.night()), known(&live.night), "after {:?}", step);
        }
        let mut late = Follower::open(store.folder(), decode).unwrap();
        late.poll();
        prop_assert_eq!(known(late.night()), known(&live.night), "read at once");
    }
}
