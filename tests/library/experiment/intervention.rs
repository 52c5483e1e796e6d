//! Controls of a running night: stop, skip, restart, pause.

use std::cell::Cell;
use std::sync::Arc;
use std::time::Duration;

use lumbre_night::experiment::outcome::Level;
use lumbre_night::experiment::run::{Seams, run_with};
use lumbre_night::experiment::{
    CellRef, Event, NightControls, NightSummary, Outcome, PauseAt, Sink, SinkError,
};

use crate::experiment::fixtures::{Lab, Night, Recorder, all_done, depths, label, outcomes};

/// Length of the pause in a test; all runs of the test together take a hundredth of it.
const PAUSE: Duration = Duration::from_secs(2);

/// A listener that calls `act` at every event with the label `at`.
struct ActAt<'a> {
    at: &'static str,
    act: &'a dyn Fn(),
}

impl Sink for ActAt<'_> {
    fn receive(&mut self, event: &Event) -> Result<(), SinkError> {
        if label(event) == self.at {
            (self.act)();
        }
        Ok(())
    }
}

fn disturbed(
    lab: &Lab,
    night: &Night<'_>,
    at: &'static str,
    act: fn(&NightControls),
) -> (NightSummary, Recorder) {
    let act = || act(&night.control);
    let (mut listener, mut recorder) = (ActAt { at, act: &act }, Recorder::default());
    let summary = night
        .render(
            lab,
            &Arc::new(lab.plan()),
            &mut [&mut listener, &mut recorder],
        )
        .unwrap();
    (summary, recorder)
}

fn stop(control: &NightControls) {
    control.request_stop();
}

#[test]
fn a_stop_ends_the_night_after_the_wave() {
    let (summary, recorder) = disturbed(&depths([1, 2, 3]), &Night::default(), "wave c1 3", stop);
    assert!(summary.interrupted);
    assert_eq!(summary.night.ended(), 2, "the third cell was never reached");
    assert_eq!(*outcomes(&summary)[1], Outcome::Interrupted);
    assert_eq!(recorder.film(CellRef::Cell(1)).unwrap().samples, 3);
    assert_eq!(
        recorder.labels[recorder.labels.len() - 2..],
        ["interrupted c1", "night finished"]
    );
}

#[test]
fn a_stop_in_the_wave_that_finishes_a_cell_leaves_it_finished() {
    let (summary, _) = disturbed(&depths([1, 2, 3]), &Night::default(), "wave c1 16", stop);
    assert!(matches!(outcomes(&summary)[1], Outcome::Done(_)));
    assert!(summary.interrupted, "the third cell was never reached");
    let (summary, _) = disturbed(&depths([1, 2, 3]), &Night::default(), "wave c2 16", stop);
    assert!(all_done(&summary));
    assert!(!summary.interrupted, "all cells were done");
}

#[test]
fn a_stop_before_the_first_wave_leaves_no_film() {
    let (summary, recorder) = disturbed(&depths([1, 2, 3]), &Night::default(), "start c0", stop);
    assert_eq!(*outcomes(&summary)[0], Outcome::Interrupted);
    assert!(recorder.film(CellRef::Cell(0)).is_none());
    let (summary, recorder) =
        disturbed(&depths([1, 2, 3]), &Night::default(), "night started", stop);
    assert!(summary.interrupted && summary.night.ended() == 0);
    assert_eq!(recorder.labels, ["night started", "night finished"]);
}

#[test]
fn a_stop_during_a_reference_ends_the_night_before_its_cells() {
    let (summary, recorder) = disturbed(
        &depths([1, 2, 3]).measured(),
        &Night::default(),
        "wave r0 15",
        stop,
    );
    assert!(summary.interrupted);
    assert_eq!(summary.night.ended(), 1);
    assert_eq!(recorder.labels.last().unwrap(), "night finished");
}

#[test]
fn a_skip_interrupts_one_cell_with_a_warning() {
    let (summary, recorder) = disturbed(
        &depths([1, 2, 3]),
        &Night::default(),
        "wave c1 3",
        |control| control.skip.set(true),
    );
    let done: Vec<bool> = outcomes(&summary)
        .iter()
        .map(|outcome| matches!(outcome, Outcome::Done(_)))
        .collect();
    assert_eq!(done, [true, false, true]);
    assert_eq!(*outcomes(&summary)[1], Outcome::Interrupted);
    assert!(!summary.interrupted, "the night must continue");
    let messages = recorder.messages(Level::Warn);
    assert!(
        messages.contains(&"skipped on request after 3 samples per pixel".to_owned()),
        "{messages:?}"
    );
}

#[test]
fn a_skip_after_the_end_of_a_cell_does_not_affect_the_next_cell() {
    let (summary, _) = disturbed(
        &depths([1, 2, 3]),
        &Night::default(),
        "done c0",
        |control| control.skip.set(true),
    );
    assert!(all_done(&summary));
}

#[test]
fn cells_of_a_skipped_reference_fail() {
    let (summary, _) = disturbed(
        &depths([1, 2, 3]).measured(),
        &Night::default(),
        "wave r0 15",
        |control| control.skip.set(true),
    );
    assert_eq!(*outcomes(&summary)[0], Outcome::Interrupted);
    assert_eq!(
        *outcomes(&summary)[3],
        Outcome::Failed("its reference is not available: it was interrupted".into())
    );
    assert!(matches!(outcomes(&summary)[4], Outcome::Done(_)));
}

#[test]
fn a_pause_changes_neither_events_nor_render_times() {
    let undisturbed = Night::default().record(&depths([1, 2, 3])).1;
    let waits = Cell::new(0);
    let control = NightControls::default();
    let wait = || {
        waits.set(waits.get() + 1);
        if waits.get() == 5 {
            control.paused.toggle();
        }
    };
    let act = || {
        control.paused.toggle();
    };
    let (mut listener, mut recorder) = (
        ActAt {
            at: "wave c1 3",
            act: &act,
        },
        Recorder::default(),
    );
    let (lab, night) = (depths([1, 2, 3]), Night::default());
    let seams = Seams {
        open: night.open,
        wait: &wait,
    };
    let sinks: &mut [&mut dyn Sink] = &mut [&mut listener, &mut recorder];
    run_with(
        &seams,
        &Arc::new(lab.plan()),
        &lab,
        &night.history,
        sinks,
        &control,
        1,
    )
    .unwrap();
    assert_eq!(waits.get(), 5);
    assert_eq!(recorder.labels, undisturbed.labels);
    let times = |recorder: &Recorder| {
        recorder
            .rows(CellRef::Cell(1))
            .iter()
            .map(|r| r.render_s)
            .collect::<Vec<_>>()
    };
    assert_eq!(
        times(&recorder),
        times(&undisturbed),
        "render time must exclude the pause"
    );
}

#[test]
fn a_paused_night_obeys_a_stop() {
    let pause_and_stop = |control: &NightControls| {
        control.paused.toggle();
        control.request_stop();
    };
    let (summary, _) = disturbed(
        &depths([1, 2, 3]),
        &Night::default(),
        "wave c0 1",
        pause_and_stop,
    );
    assert!(summary.interrupted);
    assert_eq!(*outcomes(&summary)[0], Outcome::Interrupted);
}

#[test]
fn a_restart_renders_the_cell_from_its_first_sample() {
    let (whole, undisturbed) = Night::default().record(&depths([1, 2, 3]));
    let (lab, night) = (depths([1, 2, 3]), Night::default());
    let requested = Cell::new(false);
    let act = || {
        if !requested.replace(true) {
            night.control.restart.set(true);
        }
    };
    let (mut listener, mut recorder) = (
        ActAt {
            at: "wave c1 3",
            act: &act,
        },
        Recorder::default(),
    );
    let summary = night
        .render(
            &lab,
            &Arc::new(lab.plan()),
            &mut [&mut listener, &mut recorder],
        )
        .unwrap();
    assert!(all_done(&summary));
    let starts = recorder.labels.iter().filter(|w| *w == "start c1").count();
    assert_eq!(starts, 2, "{:?}", recorder.labels);
    let samples = |summary: &NightSummary| {
        summary.night.runs[1]
            .rows
            .iter()
            .map(|r| r.samples)
            .collect::<Vec<_>>()
    };
    assert_eq!(
        samples(&summary),
        samples(&whole),
        "no measurement of the first attempt may remain"
    );
    assert_eq!(
        recorder.film(CellRef::Cell(1)),
        undisturbed.film(CellRef::Cell(1))
    );
    let messages = recorder.messages(Level::Warn);
    assert!(
        messages.contains(&"restarted on request after 3 samples per pixel".to_owned()),
        "{messages:?}"
    );
}

#[test]
fn a_restart_after_the_end_of_a_cell_does_not_affect_the_next_cell() {
    let (_, recorder) = disturbed(
        &depths([1, 2, 3]),
        &Night::default(),
        "done c0",
        |control| control.restart.set(true),
    );
    assert_eq!(
        recorder.labels.iter().filter(|w| *w == "start c1").count(),
        1
    );
}

#[test]
fn a_night_can_end_after_the_current_cell() {
    let after_cell = |control: &NightControls| {
        control.after_cell.toggle();
    };
    let (summary, recorder) = disturbed(
        &depths([1, 2, 3]),
        &Night::default(),
        "wave c1 3",
        after_cell,
    );
    assert!(summary.interrupted);
    assert_eq!(summary.night.ended(), 2);
    assert!(
        matches!(outcomes(&summary)[1], Outcome::Done(_)),
        "the current cell must be finished"
    );
    assert_eq!(recorder.labels.last().unwrap(), "night finished");
    let (summary, _) = disturbed(
        &depths([1, 2, 3]),
        &Night::default(),
        "wave c2 3",
        after_cell,
    );
    assert!(!summary.interrupted, "there was no further cell");
    let twice = |control: &NightControls| {
        control.after_cell.toggle();
        control.after_cell.toggle();
    };
    let (summary, _) = disturbed(&depths([1, 2, 3]), &Night::default(), "wave c1 3", twice);
    assert_eq!(
        summary.night.ended(),
        3,
        "the second call must cancel the first"
    );
}

#[test]
fn a_pause_limit_pauses_the_night_once_at_the_first_measurement_after_it() {
    let undisturbed = Night::default().record(&depths([1, 2, 3])).1;
    let (lab, night) = (depths([1, 2, 3]), Night::default());
    let control = NightControls::default();
    control.set_pause_at(Some(PauseAt::Samples(2)));
    let waits = Cell::new(0);
    let wait = || {
        waits.set(waits.get() + 1);
        assert!(control.paused.get() && control.pause_at().is_none());
        std::thread::sleep(PAUSE);
        control.paused.set(false);
    };
    let mut recorder = Recorder::default();
    let seams = Seams {
        open: night.open,
        wait: &wait,
    };
    let sinks: &mut [&mut dyn Sink] = &mut [&mut recorder];
    let summary = run_with(
        &seams,
        &Arc::new(lab.plan()),
        &lab,
        &night.history,
        sinks,
        &control,
        1,
    )
    .unwrap();
    for run in &summary.night.runs {
        let wall_s = run.rows.last().unwrap().wall_s;
        assert!(wall_s < PAUSE.as_secs_f64(), "{wall_s} s with the pause");
    }
    assert_eq!(
        waits.get(),
        1,
        "the night must pause once, although three cells pass the limit"
    );
    assert_eq!(
        recorder.film(CellRef::Cell(0)),
        undisturbed.film(CellRef::Cell(0))
    );
    let messages = recorder.messages(Level::Info);
    assert!(
        messages
            .iter()
            .any(|t| t.starts_with("paused as requested after 3 samples")),
        "{messages:?}"
    );
    assert!(PauseAt::RenderS(1.5).reached(1, 1.5) && !PauseAt::RenderS(1.5).reached(99, 1.4));
}
