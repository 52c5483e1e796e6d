//! Nights that run as planned: what they render, in which order, and the events they send.

use std::cell::RefCell;
use std::sync::Arc;

use lumbre_light::film::Image;
use lumbre_light::value::Value;
use lumbre_night::experiment::event::FinishedRun;
use lumbre_night::experiment::outcome::Level;
use lumbre_night::experiment::spec::{ReferenceRequest, Snapshots};
use lumbre_night::experiment::stop::Comparison;
use lumbre_night::experiment::{CellRef, EndCause, Event, Outcome, StopRule, WaveRow, run};
use lumbre_render::Renderer;
use lumbre_render::mock::{MockRenderer, SECONDS_PER_PATH};

use crate::experiment::fixtures::{
    Lab, Memory, Night, Recorder, Wrapped, all_done, config, depths, finished_in, ints, outcomes,
    rendered, whole_at,
};

const CELL: CellRef = CellRef::Cell(0);

#[test]
fn references_come_before_the_cells_that_need_them() {
    let mut lab = depths([3, 5]).measured();
    lab.spec.repeats = 2;
    lab.stop = Box::new(|_| Ok(StopRule::Samples(3)));
    let reference_stop = StopRule::Samples(2);
    lab.reference = Box::new(move |p| {
        let mut config = config();
        config.max_depth = Some(whole_at(p, "depth"));
        Ok(Some(rendered(config, reference_stop.clone())))
    });
    let (summary, recorder) = Night::default().record(&lab);
    let cell = |i: usize| {
        [
            format!("start c{i}"),
            format!("wave c{i} 1"),
            format!("wave c{i} 3"),
            format!("done c{i}"),
        ]
    };
    let reference = |i: usize| {
        let labels = ["start", "wave", "wave", "halves", "floors", "done"]
            .map(|what| format!("{what} r{i}"));
        let mut waves = 0..;
        labels.map(|what| {
            if what.starts_with("wave") {
                format!("{what} {}", waves.next().unwrap_or(0) + 1)
            } else {
                what
            }
        })
    };
    let mut expected = vec!["night started".to_owned()];
    for i in 0..2 {
        expected.extend(reference(i));
        expected.extend((2 * i..2 * i + 2).flat_map(cell));
    }
    expected.push("night finished".to_owned());
    // The scene has no light, which the compiler may report.
    let labels: Vec<String> = recorder
        .labels
        .into_iter()
        .filter(|w| !w.starts_with("message"))
        .collect();
    assert_eq!(labels, expected);
    let cells: Vec<CellRef> = summary.night.all().collect();
    let references = [0, 1].map(CellRef::Reference);
    assert_eq!(
        cells,
        references
            .into_iter()
            .chain([0, 1, 2, 3].map(CellRef::Cell))
            .collect::<Vec<_>>()
    );
    assert!(all_done(&summary));
    assert!(!summary.interrupted);
}

#[test]
fn a_night_with_an_empty_plan_renders_nothing() {
    let mut lab = Lab::new();
    lab.spec.skips = vec!["all".into()];
    lab.skip = Box::new(|_, _| Ok(true));
    let (summary, recorder) = Night::default().record(&lab);
    assert_eq!(recorder.labels, ["night started", "night finished"]);
    assert!(summary.night.ended() == 0 && !summary.interrupted);
}

#[test]
fn waves_double_and_sample_limits_are_exact() {
    let totals = |stop: StopRule, snapshots: Snapshots, every_s: f64| {
        let mut lab = Lab::new();
        lab.spec.measure.snapshots = snapshots;
        lab.spec.measure.every_s = every_s;
        lab.stop = Box::new(move |_| Ok(stop.clone()));
        Night::default().record(&lab).1.totals(CELL)
    };
    assert_eq!(
        totals(StopRule::Samples(20), Snapshots::Last, 1e6),
        [1, 3, 7, 15, 20]
    );
    assert_eq!(
        totals(StopRule::Samples(20), Snapshots::Pow2, 1e6),
        [1, 2, 4, 8, 16, 20]
    );
    assert_eq!(
        totals(StopRule::Waves(4), Snapshots::Last, 1e6),
        [1, 3, 7, 15]
    );
    // 32 pixels on the fake clock: four and a half samples fit between two measurements.
    let every_s = 4.5 * 32.0 * SECONDS_PER_PATH;
    assert_eq!(
        totals(StopRule::Samples(20), Snapshots::Last, every_s),
        [1, 3, 7, 11, 15, 19, 20]
    );
    let time = StopRule::Time(9.75 * 32.0 * SECONDS_PER_PATH);
    assert_eq!(totals(time, Snapshots::Last, 1e6), [1, 3, 7, 10]);
}

#[test]
fn waves_that_end_at_powers_of_two_are_marked() {
    let mut lab = Lab::new();
    lab.spec.measure.snapshots = Snapshots::Pow2;
    lab.stop = Box::new(|_| Ok(StopRule::Samples(5)));
    let (_, recorder) = Night::default().record(&lab);
    let flags: Vec<(u64, bool)> = recorder
        .events
        .iter()
        .filter_map(|e| {
            if let Event::Wave { row, pow2, .. } = e {
                Some((row.samples, *pow2))
            } else {
                None
            }
        })
        .collect();
    assert_eq!(flags, [(1, true), (2, true), (4, true), (5, false)]);
}

#[test]
fn measurements_accumulate_samples_and_render_time() {
    let lab = Lab::new().measured();
    let (summary, recorder) = Night::default().record(&lab);
    let rows = recorder.rows(CELL);
    assert_eq!(rows.len(), 5);
    for (i, row) in rows.iter().enumerate() {
        assert_eq!(row.wave, i as u64 + 1);
        assert_eq!(row.paths, row.samples * 32);
        assert_eq!(row.rays, row.paths * 5);
        assert!((row.render_s - row.paths as f64 * SECONDS_PER_PATH).abs() < 1e-12);
        assert_eq!(row.metrics.len(), 1);
        assert!(row.wall_s >= i.checked_sub(1).map_or(0.0, |before| rows[before].wall_s));
    }
    assert_eq!(summary.night.runs[0].rows.iter().collect::<Vec<_>>(), rows);
    assert!(
        recorder
            .rows(CellRef::Reference(0))
            .iter()
            .all(|row| row.metrics.is_empty())
    );
    // The mock halves its error with four times the samples; the reference has little noise.
    let error = |i: usize| rows[i].metrics[0];
    let rate = (error(0) / error(4)).ln() / 16f64.ln();
    assert!((rate - 0.5).abs() < 0.03, "{rate}");
    let Some(Event::CellStarted { reference, .. }) = recorder
        .events
        .iter()
        .find(|e| matches!(e, Event::CellStarted { cell: CELL, .. }))
    else {
        panic!("the cell never started")
    };
    assert_eq!(reference.as_ref().unwrap().width, 8);
}

#[test]
fn the_end_of_a_cell_has_its_film_and_the_reason() {
    let (summary, recorder) = Night::default().record(&Lab::new());
    assert_eq!(recorder.film(CELL).unwrap().samples, 16);
    assert_eq!(
        *outcomes(&summary)[0],
        Outcome::Done(EndCause::limit("16 samples per pixel"))
    );
}

#[test]
fn a_metric_rule_must_hold_for_consecutive_measurements() {
    let stop_at = |hold: u32| {
        let mut lab = Lab::new().measured();
        lab.spec.measure.every_s = 0.0;
        lab.stop = Box::new(move |_| {
            let value = 0.02;
            let when = StopRule::When {
                column: "rmse".into(),
                op: Comparison::Less,
                value,
                hold,
            };
            Ok(StopRule::Any(vec![when, StopRule::Samples(200)]))
        });
        let (summary, recorder) = Night::default().record(&lab);
        (
            *recorder.totals(CELL).last().unwrap(),
            outcomes(&summary)[1].clone(),
        )
    };
    let (first, reason) = stop_at(1);
    assert!((2..100).contains(&first), "{first}");
    assert_eq!(reason, Outcome::Done(EndCause::other("rmse < 0.02")));
    let (later, reason) = stop_at(4);
    assert_eq!(
        later,
        first + 3,
        "waves have one sample, and the mock's error only falls"
    );
    assert_eq!(
        reason,
        Outcome::Done(EndCause::other("rmse < 0.02 held for 4 measurements"))
    );
}

#[test]
fn predicates_receive_the_rows_and_columns() {
    let mut lab = Lab::new().measured();
    lab.stop = Box::new(|_| {
        Ok(StopRule::Any(vec![
            StopRule::Predicate(7),
            StopRule::Samples(1000),
        ]))
    });
    lab.predicate = Box::new(|id, columns, rows| {
        assert_eq!((id, columns), (7, &["rmse".to_owned()][..]));
        assert!(rows.iter().all(|row| row.metrics.len() == 1));
        Ok(rows.len() == 3)
    });
    let (summary, recorder) = Night::default().record(&lab);
    assert_eq!(recorder.totals(CELL), [1, 3, 7]);
    assert_eq!(
        *outcomes(&summary)[1],
        Outcome::Done(EndCause::other("a function of the script"))
    );
}

#[test]
fn equal_seeds_give_equal_films_for_any_length_of_waves() {
    let film = |seed: u64, every_s: f64, repeat: usize| {
        let mut lab = Lab::new();
        lab.spec.repeats = 2;
        lab.spec.seed = seed;
        lab.spec.measure.every_s = every_s;
        Night::default()
            .record(&lab)
            .1
            .film(CellRef::Cell(repeat))
            .unwrap()
    };
    assert_eq!(film(1, 1e6, 0), film(1, 1e6, 0));
    assert_eq!(film(1, 1e6, 0), film(1, 0.0, 0));
    assert_ne!(film(1, 1e6, 0), film(1, 1e6, 1));
    assert_ne!(film(1, 1e6, 0), film(2, 1e6, 0));
}

#[test]
fn finished_cells_and_references_are_not_rendered_again() {
    let lab = depths([3, 5]).measured();
    let plan = lab.plan();
    let mut night = Night {
        open: &|_, _, _| panic!("nothing must be rendered"),
        ..Night::default()
    };
    let rows = vec![WaveRow {
        wave: 1,
        samples: 16,
        ..WaveRow::default()
    }];
    for cell in [0, 1]
        .map(CellRef::Cell)
        .into_iter()
        .chain([0, 1].map(CellRef::Reference))
    {
        let run = FinishedRun {
            folder: format!("out/{cell:?}").into(),
            rows: rows.clone(),
            floors: Default::default(),
            open: Default::default(),
        };
        night
            .history
            .done
            .borrow_mut()
            .insert(plan.id(cell).clone(), run);
    }
    for i in 0..2 {
        night
            .history
            .images
            .insert(plan.references[i].id.clone(), Ok(Image::new(8, 4)));
    }
    let (summary, recorder) = night.record(&lab);
    assert_eq!(
        recorder.labels,
        [
            "night started",
            "cached r0",
            "cached c0",
            "cached r1",
            "cached c1",
            "night finished"
        ]
    );
    assert_eq!(
        *outcomes(&summary)[3],
        Outcome::Cached("out/Cell(1)".into())
    );
    assert_eq!(*summary.night.runs[1].rows, rows);
}

#[test]
fn missing_cells_are_measured_against_the_stored_reference() {
    let lab = Lab::new().axis("idle", ints([1, 2])).measured();
    let plan = lab.plan();
    let mut night = Night::default();
    let id = plan.references[0].id.clone();
    night
        .history
        .done
        .borrow_mut()
        .insert(id.clone(), finished_in("refs"));
    night.history.images.insert(id, Ok(Image::new(8, 4)));
    let (_, recorder) = night.record(&lab);
    assert!(!recorder.labels.contains(&"start r0".to_owned()));
    // Against a black reference the error is the picture itself.
    let film = recorder.film(CELL).unwrap();
    let squares: f64 = film
        .mean()
        .data
        .iter()
        .flatten()
        .map(|x| f64::from(*x).powi(2))
        .sum();
    let expected = (squares / (32.0 * 3.0)).sqrt();
    assert!((recorder.rows(CELL).last().unwrap().metrics[0] / expected - 1.0).abs() < 1e-6);
}

#[test]
fn a_reference_that_cannot_be_read_is_rendered_again() {
    let lab = Lab::new().measured();
    let mut night = Night::default();
    let id = lab.plan().references[0].id.clone();
    night
        .history
        .done
        .borrow_mut()
        .insert(id.clone(), finished_in("refs"));
    night
        .history
        .images
        .insert(id, Err("ref.exr is cut off".into()));
    let (summary, recorder) = night.record(&lab);
    assert!(
        recorder.labels.contains(&"done r0".to_owned()),
        "{:?}",
        recorder.labels
    );
    let warnings = recorder.messages(Level::Warn);
    assert!(
        warnings
            .iter()
            .any(|w| w.contains("rendered again: ref.exr is cut off")),
        "{warnings:?}"
    );
    assert!(matches!(outcomes(&summary)[1], Outcome::Done(_)));
}

#[test]
fn the_second_of_two_equal_runs_is_reused_in_the_same_night() {
    struct Writer<'a>(&'a Memory, Vec<String>);
    impl lumbre_night::experiment::Sink for Writer<'_> {
        fn receive(&mut self, event: &Event) -> Result<(), lumbre_night::experiment::SinkError> {
            self.1.push(crate::experiment::fixtures::label(event));
            if let Event::NightStarted { night } = event {
                self.1.push(night.runs[0].id.clone());
            }
            if let Event::CellFinished {
                outcome: Outcome::Done(_),
                rows,
                ..
            } = event
            {
                let id = lumbre_night::experiment::RunId(self.1[1].clone());
                let run = FinishedRun {
                    folder: "here".into(),
                    rows: rows.to_vec(),
                    floors: Default::default(),
                    open: Default::default(),
                };
                self.0.done.borrow_mut().insert(id, run);
            }
            Ok(())
        }
    }
    let history = Memory::default();
    let lab = Lab::new().axis("idle", ints([1, 2]));
    let mut writer = Writer(&history, Vec::new());
    let control = lumbre_night::experiment::NightControls::default();
    let summary = run::run(
        &Arc::new(lab.plan()),
        &lab,
        &history,
        &mut [&mut writer],
        &control,
        1,
    )
    .unwrap();
    assert!(matches!(outcomes(&summary)[0], Outcome::Done(_)));
    assert_eq!(*outcomes(&summary)[1], Outcome::Cached("here".into()));
}

#[test]
fn a_reference_from_a_file_is_read_through_the_history() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("truth.exr");
    std::fs::write(&file, b"truth").unwrap();
    let mut lab = Lab::new().measured();
    let named = file.clone();
    lab.reference = Box::new(move |_| {
        Ok(Some(ReferenceRequest::File {
            file: named.clone(),
            source: String::new(),
        }))
    });
    let id = lab.plan().references[0].id.clone();
    let mut night = Night::default();
    night
        .history
        .images
        .insert(id.clone(), Ok(Image::new(8, 4)));
    let (summary, _) = night.record(&lab);
    assert_eq!(*outcomes(&summary)[0], Outcome::Cached(file));
    assert_eq!(summary.night.runs[0].rows.last().unwrap().metrics.len(), 1);

    for (width, height) in [(4, 8), (8, 5), (9, 4)] {
        let image = Image::new(width, height);
        night.history.images.insert(id.clone(), Ok(image));
        let (summary, _) = night.record(&lab);
        let size = format!("the picture has 8x4 pixels but its reference {width}x{height}");
        assert_eq!(*outcomes(&summary)[1], Outcome::Failed(size));
    }

    night
        .history
        .images
        .insert(id, Err("not an EXR file".into()));
    let (summary, _) = night.record(&lab);
    assert_eq!(
        *outcomes(&summary)[0],
        Outcome::Failed("not an EXR file".into())
    );
    assert_eq!(
        *outcomes(&summary)[1],
        Outcome::Failed("its reference is not available: not an EXR file".into())
    );
}

#[test]
fn a_renderer_receives_the_job_of_its_cell() {
    let mut lab = Lab::new();
    lab.configure(|_, config| {
        config.rr_start = Some(4);
        config.filter.radius = 0.75;
        config.sampler = "sobol".to_owned();
        config.params.insert("x".into(), Value::Int(1));
        config.resolution = None;
        config.max_depth = None;
    });
    let jobs = RefCell::new(Vec::new());
    let open: run::Open<'_> = &|name, scene, job| {
        jobs.borrow_mut().push((name.to_owned(), job.clone()));
        Ok(Box::new(MockRenderer::new(scene, job)))
    };
    let plan = lab.plan();
    Night {
        open,
        ..Night::default()
    }
    .record(&lab);
    let (name, job) = jobs.into_inner().remove(0);
    assert_eq!(name, "mock");
    assert_eq!(
        (job.integrator.name, job.resolution, job.max_depth),
        ("bpt", [32, 16], 7)
    );
    assert_eq!(
        (
            job.settings.rr_start,
            job.settings.filter.radius,
            job.seed,
            job.threads
        ),
        (Some(4), 0.75, plan.cells[0].seed, 1)
    );
    assert_eq!(job.sampler.name, "sobol");
    assert_eq!(job.settings.params["x"], Value::Int(1));
}

#[test]
fn run_opens_the_backend_by_its_name() {
    let lab = Lab::new();
    let mut recorder = Recorder::default();
    let control = lumbre_night::experiment::NightControls::default();
    let history = Memory::default();
    let summary = run::run(
        &Arc::new(lab.plan()),
        &lab,
        &history,
        &mut [&mut recorder],
        &control,
        1,
    )
    .unwrap();
    assert_eq!(
        *outcomes(&summary)[0],
        Outcome::Done(EndCause::limit("16 samples per pixel"))
    );
}

#[test]
fn the_time_of_a_filter_is_render_time() {
    let lab = Lab::new();
    let (_, plain) = Night::default().record(&lab);
    let night = Night {
        open: &|_, scene, job| {
            let mock = MockRenderer::new(scene, job);
            let mut filtered = Wrapped::new(mock, |mock, request| mock.render(request));
            filtered.filter_s = 10.0;
            Ok(Box::new(filtered))
        },
        ..Night::default()
    };
    let (_, filtered) = night.record(&lab);
    let times = |recorder: &Recorder| -> Vec<f64> {
        let rows = recorder.rows(CELL);
        rows.iter().map(|row| row.render_s).collect()
    };
    let [plain, filtered] = [&plain, &filtered].map(times);
    for (wave, (plain, filtered)) in plain.iter().zip(&filtered).enumerate() {
        let added = filtered - plain;
        let expected = 10.0 * (wave as f64 + 1.0);
        assert!((added - expected).abs() < 1e-3, "{added}, not {expected}");
    }
    assert!(!filtered.is_empty());
}
