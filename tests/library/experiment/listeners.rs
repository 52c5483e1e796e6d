//! Nights in which something fails: a renderer, a scene, a listener, a function of the script.

use std::sync::Arc;

use lumbre_light::film::Film;
use lumbre_light::transport::time_settings::Timing;
use lumbre_light::value::Value;
use lumbre_night::experiment::hook_error::HookError;
use lumbre_night::experiment::outcome::Level;
use lumbre_night::experiment::run::{Open, RunError};
use lumbre_night::experiment::{CellRef, EndCause, Event, Outcome, Sink, SinkError, StopRule};
use lumbre_render::Settings;
use lumbre_render::mock::MockRenderer;
use lumbre_render::{RenderError, Renderer, WaveStats};

use crate::experiment::fixtures::{
    Lab, Night, Recorder, Wrapped, config, depths, label, outcomes, whole_at,
};

const CELL: CellRef = CellRef::Cell(0);

/// Returns a mock renderer whose wave statistics pass through `act`, which may change them or panic.
fn faulty(mock: MockRenderer, act: fn(&WaveStats, &Film) -> WaveStats) -> Box<dyn Renderer> {
    Box::new(Wrapped::new(mock, move |mock, request| {
        let stats = mock.render(request)?;
        Ok(act(&stats, mock.film()))
    }))
}

fn failed(outcome: &Outcome) -> &str {
    match outcome {
        Outcome::Failed(reason) => reason,
        other => panic!("expected a failure, found {other:?}"),
    }
}

#[test]
fn a_failing_renderer_fails_its_cell_and_keeps_the_last_good_film() {
    let open: Open<'_> = &|_, scene, job| {
        let limit = if job.max_depth == 2 { 3 } else { 1000 };
        Ok(Box::new(MockRenderer::new(scene, job).failing_after(limit)))
    };
    let (summary, recorder) = Night {
        open,
        ..Night::default()
    }
    .record(&depths([1, 2, 3]));
    assert_eq!(
        failed(outcomes(&summary)[1]),
        "backend `mock` failed: asked to fail after 3 samples"
    );
    assert_eq!(recorder.film(CellRef::Cell(1)).unwrap().samples, 3);
    assert_eq!(summary.night.runs[1].rows.len(), 2);
    assert!(
        [0, 2]
            .iter()
            .all(|i| matches!(outcomes(&summary)[*i], Outcome::Done(_)))
    );
    assert_eq!(recorder.labels.last().unwrap(), "night finished");
    assert!(!summary.interrupted);
}

#[test]
fn a_renderer_that_cannot_be_opened_fails_its_cell() {
    let open: Open<'_> = &|_, scene, job| match job.max_depth {
        1 => Err(RenderError::unsupported("mock", "no such depth")),
        2 => panic!("out of {}", "memory"),
        _ => Ok(Box::new(MockRenderer::new(scene, job))),
    };
    let (summary, recorder) = Night {
        open,
        ..Night::default()
    }
    .record(&depths([1, 2, 3]));
    assert_eq!(
        failed(outcomes(&summary)[0]),
        "backend `mock` cannot do this: no such depth"
    );
    assert_eq!(
        failed(outcomes(&summary)[1]),
        "panic while opening the backend: out of memory"
    );
    assert!(matches!(outcomes(&summary)[2], Outcome::Done(_)));
    assert!(recorder.film(CELL).is_none());
    assert!(!recorder.labels.contains(&"start c0".to_owned()));
}

#[test]
fn a_panicking_renderer_fails_its_cell_and_its_film_is_discarded() {
    let open: Open<'_> = &|_, scene, job| {
        let act: fn(&WaveStats, &Film) -> WaveStats = match job.max_depth {
            2 => |stats, film| {
                if film.samples > 1 {
                    panic!("index out of bounds")
                } else {
                    stats.clone()
                }
            },
            _ => |stats, _| stats.clone(),
        };
        Ok(faulty(MockRenderer::new(scene, job), act))
    };
    let (summary, recorder) = Night {
        open,
        ..Night::default()
    }
    .record(&depths([1, 2, 3]));
    assert_eq!(
        failed(outcomes(&summary)[1]),
        "panic while rendering: index out of bounds"
    );
    assert_eq!(summary.night.runs[1].rows.len(), 1);
    assert!(recorder.film(CellRef::Cell(1)).is_none());
    assert!(matches!(outcomes(&summary)[2], Outcome::Done(_)));
}

#[test]
fn a_renderer_that_adds_no_samples_fails_its_cell() {
    let open: Open<'_> = &|_, scene, job| {
        let act = |_: &WaveStats, _: &Film| WaveStats::default();
        Ok(faulty(MockRenderer::new(scene, job), act))
    };
    let (summary, _) = Night {
        open,
        ..Night::default()
    }
    .record(&Lab::new());
    assert_eq!(
        failed(outcomes(&summary)[0]),
        "the renderer returned none of 1 requested samples"
    );
}

#[test]
fn invalid_samples_are_counted_and_reported_once_with_their_position() {
    let act = |stats: &WaveStats, film: &Film| {
        let late = film.samples >= 3;
        WaveStats {
            invalid: 2 * u64::from(late),
            first_invalid: late.then_some([5, 2, film.samples]),
            ..stats.clone()
        }
    };
    let open: Open<'_> = &|_, scene, job| Ok(faulty(MockRenderer::new(scene, job), act));
    let (_, recorder) = Night {
        open,
        ..Night::default()
    }
    .record(&Lab::new());
    let warnings = recorder.messages(Level::Warn);
    let reported: Vec<&String> = warnings.iter().filter(|w| w.contains("invalid")).collect();
    assert_eq!(
        reported,
        [
            "2 invalid samples (NaN or infinite) in wave 2, the first at column 5, row 2, sample 3; they count as black"
        ]
    );
    let rows = recorder.rows(CELL);
    assert_eq!(
        rows.iter().map(|row| row.invalid).collect::<Vec<_>>(),
        [0, 2, 4, 6, 8]
    );
    assert!(
        rows[1..]
            .iter()
            .all(|row| row.first_invalid == Some([5, 2, 3]))
    );

    let mut lab = Lab::new();
    lab.stop = Box::new(|_| {
        Ok(StopRule::Any(vec![
            StopRule::Nan(3),
            StopRule::Samples(1000),
        ]))
    });
    let (summary, _) = Night {
        open,
        ..Night::default()
    }
    .record(&lab);
    assert_eq!(
        *outcomes(&summary)[0],
        Outcome::Done(EndCause::other("3 invalid samples"))
    );
}

#[test]
fn a_failed_reference_fails_its_cells_with_its_reason() {
    let lab = depths([1, 2, 3]).measured();
    let reference_seeds = lumbre_night::experiment::plan::identity::reference_seeds();
    let open: Open<'_> = &move |_, scene, job| {
        let limit = if reference_seeds.contains(&job.seed) && job.max_depth == 2 {
            100
        } else {
            1 << 20
        };
        Ok(Box::new(MockRenderer::new(scene, job).failing_after(limit)))
    };
    let (summary, recorder) = Night {
        open,
        ..Night::default()
    }
    .record(&lab);
    let reason = "backend `mock` failed: asked to fail after 100 samples";
    assert_eq!(failed(outcomes(&summary)[1]), reason);
    assert_eq!(
        failed(outcomes(&summary)[4]),
        format!("its reference is not available: {reason}")
    );
    assert!(
        recorder.labels.contains(&"failed c1".to_owned())
            && !recorder.labels.contains(&"start c1".to_owned())
    );
    assert!(
        [0, 2, 3, 5]
            .iter()
            .all(|i| matches!(outcomes(&summary)[*i], Outcome::Done(_)))
    );
}

#[test]
fn a_failing_predicate_fails_its_cell() {
    let mut lab = depths([1, 2, 3]);
    lab.stop = Box::new(|p| {
        let predicate = StopRule::Predicate(whole_at(p, "depth") as usize);
        Ok(StopRule::Any(vec![predicate, StopRule::Samples(4)]))
    });
    lab.predicate = Box::new(|id, _, _| {
        if id == 2 {
            Err(HookError("line 12: nil".into()))
        } else {
            Ok(false)
        }
    });
    let (summary, recorder) = Night::default().record(&lab);
    assert_eq!(failed(outcomes(&summary)[1]), "line 12: nil");
    assert_eq!(recorder.film(CellRef::Cell(1)).unwrap().samples, 1);
    assert!(matches!(outcomes(&summary)[2], Outcome::Done(_)));
}

/// A listener that fails at every event with the label `at`.
struct FailingListener {
    at: &'static str,
    received: Vec<String>,
}

impl FailingListener {
    fn at(at: &'static str) -> FailingListener {
        FailingListener {
            at,
            received: Vec::new(),
        }
    }
}

impl Sink for FailingListener {
    fn receive(&mut self, event: &Event) -> Result<(), SinkError> {
        let label = label(event);
        if !matches!(event, Event::Forecast(_)) {
            self.received.push(label.clone());
        }
        if label == self.at {
            Err(SinkError("no space left on device".into()))
        } else {
            Ok(())
        }
    }
}

#[test]
fn a_listener_that_cannot_record_fails_the_cell_and_the_others_receive_every_event() {
    for at in ["start c1", "wave c1 3"] {
        let lab = depths([1, 2, 3]);
        let (mut failing, mut after) = (FailingListener::at(at), Recorder::default());
        let night = Night::default();
        let summary = night
            .render(&lab, &Arc::new(lab.plan()), &mut [&mut failing, &mut after])
            .unwrap();
        assert_eq!(
            failed(outcomes(&summary)[1]),
            "no space left on device",
            "{at}"
        );
        assert!(matches!(outcomes(&summary)[2], Outcome::Done(_)), "{at}");
        assert_eq!(failing.received, after.labels, "{at}");
        assert!(after.labels.contains(&"failed c1".to_owned()), "{at}");
    }
}

#[test]
fn a_result_that_cannot_be_recorded_is_a_failure_and_is_reported_once() {
    let lab = depths([1, 2, 3]);
    let (mut failing, mut after) = (FailingListener::at("done c1"), Recorder::default());
    let night = Night::default();
    let summary = night
        .render(&lab, &Arc::new(lab.plan()), &mut [&mut failing, &mut after])
        .unwrap();
    let reason = "the result could not be recorded: no space left on device";
    assert_eq!(failed(outcomes(&summary)[1]), reason);
    assert_eq!(
        after
            .labels
            .iter()
            .filter(|w| w.ends_with(" c1") && !w.starts_with("start"))
            .count(),
        2
    );
    assert_eq!(after.messages(Level::Error), [reason]);
    assert!(matches!(outcomes(&summary)[2], Outcome::Done(_)));
}

#[test]
fn a_listener_that_cannot_prepare_or_close_fails_the_night() {
    let lab = depths([1, 2, 3]);
    let plan = Arc::new(lab.plan());
    let mut failing = FailingListener::at("night started");
    let error = Night::default()
        .render(&lab, &plan, &mut [&mut failing])
        .unwrap_err();
    assert_eq!(error.to_string(), "cannot start: no space left on device");
    assert_eq!(failing.received, ["night started"]);
    let mut failing = FailingListener::at("night finished");
    let error = Night::default()
        .render(&lab, &plan, &mut [&mut failing])
        .unwrap_err();
    let RunError::Finish { reason, summary } = error else {
        panic!("{error}")
    };
    assert_eq!(reason, "no space left on device");
    assert_eq!(summary.night.ended(), 3);
}

#[test]
fn time_previews_are_sent_on_request_when_the_samples_have_doubled() {
    let mut lab = Lab::new();
    lab.render = Box::new(|_| {
        let film =
            Value::from_json(&serde_json::json!({ "time": { "start": 0, "bin": 0.5, "bins": 8 } }));
        let timing = Timing::from_film(film.as_map().unwrap(), "film").unwrap();
        Ok(Settings {
            timing,
            backend: "cpu".into(),
            ..config()
        })
    });
    lab.stop = Box::new(|_| Ok(StopRule::Samples(20)));
    let plan = Arc::new(lab.plan());
    let render = |wants_times: bool| {
        let mut recorder = Recorder {
            wants_times,
            ..Recorder::default()
        };
        let night = Night {
            open: &lumbre_night::backends::open,
            ..Night::default()
        };
        night.render(&lab, &plan, &mut [&mut recorder]).unwrap();
        recorder
    };
    let shown = render(true);
    let times = |recorder: &Recorder| -> Vec<u64> {
        let samples = recorder.events.iter().filter_map(|event| match event {
            Event::Times { times, .. } => Some(times.samples),
            _ => None,
        });
        samples.collect()
    };
    assert_eq!(shown.totals(CellRef::Cell(0)), [1, 3, 7, 15, 20]);
    assert_eq!(times(&shown), [1, 3, 7, 15], "20 is less than twice 15");
    assert_eq!(
        times(&render(false)),
        [0u64; 0],
        "previews must not be computed if no listener requests them"
    );
}
