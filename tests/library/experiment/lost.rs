//! Devices that are lost in the middle of a run, and backends that fail where the script leaves the
//! choice open.

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};

use lumbre_night::experiment::outcome::Level;
use lumbre_night::experiment::run::Open;
use lumbre_night::experiment::{CellRef, NightSummary, Outcome};
use lumbre_render::mock::MockRenderer;
use lumbre_render::{RenderError, Renderer};

use crate::experiment::fixtures::{Lab, Memory, Night, Recorder, Wrapped, outcomes};

/// Renders a night whose device is lost after each of these numbers of waves, counted from the
/// previous loss.
fn night(lab: &Lab, losses: &[i64]) -> (NightSummary, Recorder) {
    let mut losses = losses.iter().copied();
    let left = Arc::new(AtomicI64::new(losses.next().unwrap_or(i64::MAX)));
    let losses = Rc::new(RefCell::new(losses));
    let opened = Cell::new(0);
    let open = |_: &str, scene, job| -> Result<Box<dyn Renderer>, RenderError> {
        if opened.replace(opened.get() + 1) > 0 && left.load(Ordering::Relaxed) < 0 {
            left.store(
                losses.borrow_mut().next().unwrap_or(i64::MAX),
                Ordering::Relaxed,
            );
        }
        let left = Arc::clone(&left);
        let mock = MockRenderer::new(scene, job);
        Ok(Box::new(Wrapped::new(
            mock,
            move |mock, request| match left.fetch_sub(1, Ordering::Relaxed) {
                0 => Err(RenderError::lost("mock", "the power was cut")),
                _ => mock.render(request),
            },
        )))
    };
    run_night(lab, &open)
}

fn run_night(lab: &Lab, open: Open<'_>) -> (NightSummary, Recorder) {
    Night {
        open,
        wait: &|| {},
        history: Memory::with_checkpoints(),
        ..Night::default()
    }
    .record(lab)
}

const CELL: CellRef = CellRef::Cell(0);

fn warnings(recorder: &Recorder) -> String {
    recorder.messages(Level::Warn).join("\n")
}

#[test]
fn a_run_resumes_from_its_newest_checkpoint_after_every_loss_of_its_device() {
    let (_, whole) = night(&Lab::new(), &[]);
    for has_checkpoints in [false, true] {
        let mut lab = Lab::new();
        lab.spec.night.checkpoint_s = has_checkpoints.then_some(1e-9);
        for losses in [&[0][..], &[1], &[2], &[4], &[1, 1, 1], &[3, 0, 0]] {
            let (summary, recorder) = night(&lab, losses);
            let outcome = outcomes(&summary)[0];
            assert!(
                matches!(outcome, Outcome::Done(_)),
                "{losses:?}: {outcome:?}"
            );
            assert_eq!(recorder.film(CELL), whole.film(CELL), "{losses:?}");
            let totals = |rows: &[lumbre_night::experiment::WaveRow]| {
                rows.iter().map(|r| r.samples).collect::<Vec<_>>()
            };
            assert_eq!(
                totals(&summary.night.runs[0].rows),
                [1, 3, 7, 15, 16],
                "{losses:?}"
            );
            let text = warnings(&recorder);
            assert_eq!(
                text.matches("the power was cut; retrying from the newest checkpoint")
                    .count(),
                losses.len(),
                "{text}"
            );
            let resumed = recorder
                .messages(Level::Info)
                .iter()
                .any(|text| text.starts_with("resumes from"));
            assert_eq!(resumed, has_checkpoints && losses != [0], "{losses:?}");
        }
    }
}

#[test]
fn a_device_that_is_lost_at_every_retry_fails_its_run_and_the_night_continues() {
    let lab = Lab::new().axis("n", crate::experiment::fixtures::ints([1, 2]));
    let (summary, recorder) = night(&lab, &[1, 0, 0, 0]);
    let outcomes: Vec<&Outcome> = outcomes(&summary);
    assert!(
        matches!(outcomes[0], Outcome::Failed(why) if why.contains("the power was cut")),
        "{outcomes:?}"
    );
    assert!(matches!(outcomes[1], Outcome::Done(_)), "{outcomes:?}");
    assert!(warnings(&recorder).contains("(retry 3 of 3)"));
}

#[test]
fn another_backend_takes_over_only_if_the_script_leaves_the_choice_open() {
    let open = |name: &str, scene, job| -> Result<Box<dyn Renderer>, RenderError> {
        match name {
            "spare" => Ok(Box::new(MockRenderer::new(scene, job))),
            _ => Ok(Box::new(MockRenderer::new(scene, job).failing_after(3))),
        }
    };
    let lab = |fallback| {
        let mut lab = Lab::new();
        lab.configure(move |_, config| config.fallback = fallback);
        lab
    };
    let (strict, _) = run_night(&lab(None), &open);
    assert!(
        matches!(outcomes(&strict)[0], Outcome::Failed(why) if why.contains("asked to fail after 3"))
    );
    let (loose, recorder) = run_night(&lab(Some("spare")), &open);
    assert!(matches!(outcomes(&loose)[0], Outcome::Done(_)));
    assert!(
        warnings(&recorder).contains("rendering by `spare` instead, since the backend is `auto`")
    );
    // The checkpoint after 3 samples has the render time of the other backend.
    let mut checkpointed = lab(Some("spare"));
    checkpointed.spec.night.checkpoint_s = Some(1e-9);
    let (restarted, recorder) = run_night(&checkpointed, &open);
    assert!(matches!(outcomes(&restarted)[0], Outcome::Done(_)));
    let resumed = recorder.messages(Level::Info).join("\n");
    assert!(!resumed.contains("resumes from"), "{resumed}");
    // The spare backend has its own number of retries.
    let (unlucky, recorder) = night(&lab(Some("spare")), &[0, 0, 0, 0, 1, 1, 1]);
    assert!(matches!(outcomes(&unlucky)[0], Outcome::Done(_)));
    assert_eq!(warnings(&recorder).matches("(retry 3 of 3)").count(), 2);
    // The run starts from its first sample, since render times of two backends cannot be added.
    assert_eq!(
        loose.night.runs[0]
            .rows
            .iter()
            .map(|r| r.samples)
            .collect::<Vec<_>>(),
        [1, 3, 7, 15, 16]
    );
    let id = |fallback| lab(fallback).plan().id(CELL).clone();
    assert_ne!(
        id(None),
        id(Some("spare")),
        "the id must differ from that of a run by the failed backend"
    );
}
