//! Nights that are interrupted, share their cells with other processes, or end early.

use std::cell::Cell;
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use lumbre_night::experiment::night::run::RunState;
use lumbre_night::experiment::outcome::Level;
use lumbre_night::experiment::run::{Options, Seams, run_with};
use lumbre_night::experiment::spec::Order;
use lumbre_night::experiment::{
    CellRef, Event, NightControls, NightSummary, Outcome, Sink, SinkError,
};
use lumbre_render::mock::MockRenderer;
use lumbre_render::{RenderError, Renderer};

use crate::experiment::fixtures::{
    Lab, Memory, Recorder, all_done, at, depths, ints, label, outcomes, whole_at,
};

/// A listener that requests a stop at the first wave after `waves` waves.
struct StopAfterWaves<'a> {
    control: &'a NightControls,
    waves: Cell<u32>,
}

impl Sink for StopAfterWaves<'_> {
    fn receive(&mut self, event: &Event) -> Result<(), SinkError> {
        if let Event::Wave { .. } = event {
            let left = self.waves.get();
            if left == 0 {
                self.control.request_stop();
            }
            self.waves.set(left.saturating_sub(1));
        }
        Ok(())
    }
}

fn run_night(
    lab: &Lab,
    history: &Memory,
    options: Options,
    stop_after: u32,
) -> (NightSummary, Recorder) {
    let control = NightControls::default();
    let mut listener = StopAfterWaves {
        control: &control,
        waves: Cell::new(stop_after),
    };
    let mut recorder = Recorder::default();
    let open =
        |_: &str, scene, job: lumbre_render::Job| -> Result<Box<dyn Renderer>, RenderError> {
            if job.max_depth == 2 && job.settings.rr_start == Some(7) {
                return Err(RenderError::failed("mock", "the lens fell off"));
            }
            Ok(Box::new(MockRenderer::new(scene, job)))
        };
    let seams = Seams {
        open: &open,
        wait: &|| {},
    };
    let plan = Arc::new(lab.plan());
    let sinks: &mut [&mut dyn Sink] = &mut [&mut listener, &mut recorder];
    let summary = run_with(&seams, &plan, lab, history, sinks, &control, options).unwrap();
    (summary, recorder)
}

#[test]
fn a_cell_interrupted_after_any_wave_resumes_to_the_same_film_and_rows() {
    let whole = run_night(
        &Lab::new(),
        &Memory::with_checkpoints(),
        Options::from(1),
        u32::MAX,
    )
    .1;
    for cut in 0..3 {
        let store = Memory::with_checkpoints();
        let (summary, _) = run_night(&Lab::new(), &store, Options::from(1), cut);
        assert_eq!(
            *outcomes(&summary)[0],
            Outcome::Interrupted,
            "after {cut} waves"
        );
        let (again, recorder) = run_night(&Lab::new(), &store, Options::from(1), u32::MAX);
        assert!(matches!(outcomes(&again)[0], Outcome::Done(_)));
        assert_eq!(
            recorder.film(CellRef::Cell(0)),
            whole.film(CellRef::Cell(0))
        );
        let without_wall_time = |rows: &[lumbre_night::experiment::WaveRow]| -> Vec<_> {
            rows.iter()
                .map(|r| (r.wave, r.samples, r.render_s.to_bits(), r.paths, r.rays))
                .collect()
        };
        let expected: Vec<_> = whole.rows(CellRef::Cell(0)).into_iter().cloned().collect();
        assert_eq!(
            without_wall_time(&again.night.runs[0].rows),
            without_wall_time(&expected),
            "render time must continue from the checkpoint"
        );
        assert!(recorder.messages(Level::Info)[0].starts_with("resumes from its checkpoint after"));
        assert!(
            recorder.rows(CellRef::Cell(0)).len() < expected.len(),
            "waves before the checkpoint must not be measured again"
        );
    }
}

#[test]
fn a_checkpoint_that_does_not_match_is_reported_and_ignored() {
    let store = Memory::with_checkpoints();
    run_night(&Lab::new(), &store, Options::from(1), 1);
    store
        .checkpoints
        .borrow_mut()
        .values_mut()
        .flatten()
        .for_each(|checkpoint| checkpoint.state.truncate(40));
    let (summary, recorder) = run_night(&Lab::new(), &store, Options::from(1), u32::MAX);
    assert!(matches!(outcomes(&summary)[0], Outcome::Done(_)));
    assert!(
        recorder
            .messages(Level::Warn)
            .iter()
            .any(|text| text.contains("does not match"))
    );
    assert_eq!(recorder.totals(CellRef::Cell(0)), [1, 3, 7, 15, 16]);
}

#[test]
fn checkpoints_that_cannot_be_written_cause_only_a_warning() {
    let mut lab = Lab::new();
    lab.spec.night.checkpoint_s = Some(1e-9);
    let store = Memory::with_checkpoints();
    store.full.set(true);
    let (summary, recorder) = run_night(&lab, &store, Options::from(1), u32::MAX);
    assert!(matches!(outcomes(&summary)[0], Outcome::Done(_)));
    let warnings = recorder.messages(Level::Warn);
    assert_eq!(
        warnings
            .iter()
            .filter(|text| text.contains("no space"))
            .count(),
        1,
        "{warnings:?}"
    );
}

#[test]
fn cells_of_other_processes_are_postponed_and_awaited() {
    let store = Memory::with_checkpoints();
    store.held.set(3);
    let (summary, recorder) = run_night(&depths([1, 2, 3]), &store, Options::from(1), u32::MAX);
    let outcomes: Vec<&Outcome> = outcomes(&summary);
    assert_eq!(*outcomes[0], Outcome::Cached("theirs".into()));
    assert!(matches!(
        outcomes[1..],
        [Outcome::Done(_), Outcome::Done(_)]
    ));
    let place = |word: &str| recorder.labels.iter().position(|w| w == word).unwrap();
    assert!(
        place("done c2") < place("cached c0"),
        "{:?}",
        recorder.labels
    );
    assert!(
        recorder
            .messages(Level::Info)
            .iter()
            .any(|text| text.contains("process 7"))
    );
}

#[test]
fn a_forecast_counts_a_run_of_several_cells_once_and_not_after_it_is_finished() {
    let lab = Lab::new().axis("label", ["a", "b", "c"]);
    assert!(lab.plan().cells.iter().all(|cell| cell.first == 0));
    let runs = |done: &[usize]| {
        let options = Options {
            done: done.iter().copied().map(CellRef::Cell).collect(),
            ..Options::from(1)
        };
        let (_, recorder) = run_night(&lab, &Memory::with_checkpoints(), options, u32::MAX);
        let forecast = recorder.events.iter().find_map(|event| match event {
            Event::Forecast(forecast) => Some(forecast.known + forecast.unknown),
            _ => None,
        });
        forecast.unwrap()
    };
    assert_eq!(runs(&[]), 1);
    assert_eq!(runs(&[0]), 0);
}

fn broken_at_depth_2() -> Lab {
    let mut lab = depths([1, 2, 3]);
    lab.configure(|p, config| {
        config.max_depth = Some(whole_at(p, "depth"));
        config.rr_start = Some(7);
    });
    lab
}

#[test]
fn the_smoke_pass_finds_a_broken_cell_before_anything_is_rendered() {
    let options = Options {
        smoke: true,
        ..Options::from(1)
    };
    let (summary, recorder) = run_night(
        &broken_at_depth_2(),
        &Memory::with_checkpoints(),
        options,
        u32::MAX,
    );
    let labels: Vec<&str> = recorder
        .labels
        .iter()
        .map(String::as_str)
        .filter(|w| *w != "message c0")
        .take(3)
        .collect();
    assert_eq!(labels, ["night started", "message ", "failed c1"]);
    assert!(
        matches!(outcomes(&summary)[1], Outcome::Failed(why) if why.contains("in the smoke pass") && why.contains("lens"))
    );
    assert!(
        matches!(outcomes(&summary)[0], Outcome::Done(_))
            && matches!(outcomes(&summary)[2], Outcome::Done(_))
    );
    assert_eq!(
        recorder
            .labels
            .iter()
            .filter(|w| w.starts_with("start "))
            .count(),
        2
    );
}

#[test]
fn a_night_ends_at_its_limit_of_failures() {
    let options = Options {
        max_fails: Some(1),
        ..Options::from(1)
    };
    let (summary, recorder) = run_night(
        &broken_at_depth_2(),
        &Memory::with_checkpoints(),
        options,
        u32::MAX,
    );
    assert_eq!(summary.night.ended(), 2, "the third cell was never reached");
    assert!(
        recorder
            .messages(Level::Warn)
            .iter()
            .any(|text| text.contains("1 runs have failed"))
    );
    assert!(!summary.interrupted);
}

#[test]
fn a_deadline_ends_the_night_and_orders_its_cells_from_coarse_to_fine() {
    let past = Options {
        deadline: Some(SystemTime::now() - Duration::from_secs(1)),
        ..Options::from(1)
    };
    let (summary, recorder) = run_night(
        &depths([1, 2, 3]),
        &Memory::with_checkpoints(),
        past,
        u32::MAX,
    );
    assert!(summary.night.ended() == 0 && !summary.interrupted);
    assert!(recorder.messages(Level::Warn)[0].contains("deadline"));
    let far = Options {
        deadline: Some(SystemTime::now() + Duration::from_secs(9999)),
        ..Options::from(1)
    };
    let (_, recorder) = run_night(
        &depths([1, 2, 3]),
        &Memory::with_checkpoints(),
        far,
        u32::MAX,
    );
    let starts: Vec<&String> = recorder
        .labels
        .iter()
        .filter(|w| w.starts_with("start "))
        .collect();
    assert_eq!(
        starts,
        ["start c0", "start c2", "start c1"],
        "the ends of an axis come before its middle"
    );
    assert_eq!(label(recorder.events.last().unwrap()), "night finished");
}

#[test]
fn coarse_grids_are_complete_for_every_technique() {
    let mut lab = Lab::new()
        .axis("technique", ["bpt", "nee"])
        .axis("depth", ints([1, 2, 3, 4, 5]));
    lab.configure(|p, config| {
        config.max_depth = Some(whole_at(p, "depth"));
        config.integrator = at(p, "technique").as_str().unwrap().to_owned();
    });
    lab.spec.repeats = 2;
    let plan = lab.plan();
    let order = plan.coarse_to_fine();
    let key = |i: &usize| {
        (
            whole_at(&plan.cells[*i].point, "depth"),
            plan.cells[*i].repeat,
        )
    };
    let first: Vec<_> = order[..4].iter().map(key).collect();
    assert_eq!(
        first,
        [(1, 0), (5, 0), (1, 0), (5, 0)],
        "both techniques at both ends"
    );
    let mut all = order.clone();
    all.sort_unstable();
    assert_eq!(all, (0..20).collect::<Vec<_>>());
    // Round 1 has the middle of the axis and the second repeat of the existing cells.
    assert_eq!(
        order[4..12]
            .iter()
            .map(key)
            .filter(|(depth, repeat)| *depth == 3 || *repeat == 1)
            .count(),
        8
    );
}

/// Returns three techniques of one picture, interleaved.
fn interleaved() -> Lab {
    let mut lab = Lab::new().axis("technique", ["bpt", "nee", "bdpt"]);
    lab.spec.night.order = Order::Interleave;
    lab.configure(|p, config| {
        config.integrator = at(p, "technique").as_str().unwrap_or_default().to_owned()
    });
    lab
}

#[test]
fn interleaved_runs_resume_from_their_checkpoints_after_any_wave() {
    let whole = run_night(
        &interleaved(),
        &Memory::with_checkpoints(),
        Options::from(1),
        u32::MAX,
    )
    .1;
    for cut in 0..9 {
        let store = Memory::with_checkpoints();
        let (summary, _) = run_night(&interleaved(), &store, Options::from(1), cut);
        assert!(
            summary.interrupted && outcomes(&summary).contains(&&Outcome::Interrupted),
            "{cut}"
        );
        let interrupted = RunState::Ended(Outcome::Interrupted);
        let runs = summary.night.runs.iter();
        let begun = runs
            .filter(|run| run.state == interrupted && !run.rows.is_empty())
            .count();
        assert!(
            store.checkpoints.borrow().len() >= begun,
            "each interrupted run must have a checkpoint"
        );
        let (again, recorder) = run_night(&interleaved(), &store, Options::from(1), u32::MAX);
        assert!(all_done(&again));
        for place in 0..3 {
            let i = CellRef::Cell(place);
            assert_eq!(recorder.film(i), whole.film(i), "cut after {cut} waves");
            let clock = |result: &[lumbre_night::experiment::WaveRow]| {
                result
                    .last()
                    .map(|row| (row.samples, row.render_s.to_bits()))
            };
            let rows: Vec<_> = whole.rows(i).into_iter().cloned().collect();
            assert_eq!(clock(&again.night.runs[place].rows), clock(&rows));
        }
    }
}

#[test]
fn a_requested_checkpoint_is_written_for_every_interleaved_run() {
    struct RequestCheckpoint<'a>(&'a NightControls, bool);
    impl Sink for RequestCheckpoint<'_> {
        fn receive(&mut self, event: &Event) -> Result<(), SinkError> {
            if matches!(
                event,
                Event::Wave {
                    cell: CellRef::Cell(2),
                    ..
                }
            ) && !std::mem::replace(&mut self.1, true)
            {
                self.0.checkpoint.set(true);
            }
            Ok(())
        }
    }
    let (control, store) = (NightControls::default(), Memory::with_checkpoints());
    let mut listener = RequestCheckpoint(&control, false);
    let open = |_: &str, scene, job| -> Result<Box<dyn Renderer>, RenderError> {
        Ok(Box::new(MockRenderer::new(scene, job)))
    };
    let seams = Seams {
        open: &open,
        wait: &|| {},
    };
    let lab = interleaved();
    let plan = Arc::new(lab.plan());
    run_with(
        &seams,
        &plan,
        &lab,
        &store,
        &mut [&mut listener],
        &control,
        1,
    )
    .unwrap();
    assert_eq!(store.checkpoints.borrow().len(), 3);
}
