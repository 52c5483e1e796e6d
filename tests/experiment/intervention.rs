//! The user at night: stop, skip, pause.

use std::cell::Cell;
use std::sync::Arc;

use lumbre::experiment::event::Level;
use lumbre::experiment::run::{Seams, run_with};
use lumbre::experiment::{
    CellRef, Event, NightControls, NightSummary, Outcome, PauseAt, Sink, SinkError,
};

use crate::fixtures::{Lab, Night, Recorder, depths, words};

/// A user who acts when certain words appear.
struct User<'a> {
    at: &'static str,
    act: &'a dyn Fn(),
}

impl Sink for User<'_> {
    fn receive(&mut self, event: &Event) -> Result<(), SinkError> {
        if words(event) == self.at {
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
    let (mut user, mut heard) = (User { at, act: &act }, Recorder::default());
    let summary = night
        .carry_out(lab, &Arc::new(lab.plan()), &mut [&mut user, &mut heard])
        .unwrap();
    (summary, heard)
}

fn stop(control: &NightControls) {
    control.request_stop();
}

#[test]
fn a_stop_ends_the_night_after_the_wave() {
    let (summary, heard) = disturbed(&depths([1, 2, 3]), &Night::default(), "wave c1 3", stop);
    assert!(summary.interrupted);
    assert_eq!(summary.results.len(), 2, "the third cell was never reached");
    assert_eq!(summary.results[1].outcome, Outcome::Interrupted);
    assert_eq!(heard.film(CellRef::Cell(1)).unwrap().samples, 3);
    assert_eq!(
        heard.words[heard.words.len() - 2..],
        ["interrupted c1", "morning"]
    );
}

#[test]
fn a_stop_in_the_wave_that_finishes_a_cell_leaves_it_finished() {
    let (summary, _) = disturbed(&depths([1, 2, 3]), &Night::default(), "wave c1 16", stop);
    assert!(matches!(summary.results[1].outcome, Outcome::Done(_)));
    assert!(summary.interrupted, "the third cell was never reached");
    let (summary, _) = disturbed(&depths([1, 2, 3]), &Night::default(), "wave c2 16", stop);
    assert!(
        summary
            .results
            .iter()
            .all(|r| matches!(r.outcome, Outcome::Done(_)))
    );
    assert!(!summary.interrupted, "all was done");
}

#[test]
fn a_stop_before_the_first_wave_leaves_no_film() {
    let (summary, heard) = disturbed(&depths([1, 2, 3]), &Night::default(), "start c0", stop);
    assert_eq!(summary.results[0].outcome, Outcome::Interrupted);
    assert!(heard.film(CellRef::Cell(0)).is_none());
    let (summary, heard) = disturbed(&depths([1, 2, 3]), &Night::default(), "night", stop);
    assert!(summary.interrupted && summary.results.is_empty());
    assert_eq!(heard.words, ["night", "morning"]);
}

#[test]
fn a_stop_during_a_reference_ends_the_night_before_its_cells() {
    let (summary, heard) = disturbed(
        &depths([1, 2, 3]).measured(),
        &Night::default(),
        "wave r0 15",
        stop,
    );
    assert!(summary.interrupted);
    assert_eq!(summary.results.len(), 1);
    assert_eq!(heard.words.last().unwrap(), "morning");
}

#[test]
fn a_skip_gives_up_one_cell_and_says_so() {
    let (summary, heard) = disturbed(
        &depths([1, 2, 3]),
        &Night::default(),
        "wave c1 3",
        NightControls::request_skip,
    );
    let kinds: Vec<bool> = summary
        .results
        .iter()
        .map(|r| matches!(r.outcome, Outcome::Done(_)))
        .collect();
    assert_eq!(kinds, [true, false, true]);
    assert_eq!(summary.results[1].outcome, Outcome::Interrupted);
    assert!(!summary.interrupted, "the night itself went on");
    let told = heard.messages(Level::Warn);
    assert!(
        told.contains(&"skipped on request after 3 samples per pixel".to_owned()),
        "{told:?}"
    );
}

#[test]
fn a_skip_that_comes_too_late_does_not_hit_the_next_cell() {
    let (summary, _) = disturbed(
        &depths([1, 2, 3]),
        &Night::default(),
        "done c0",
        NightControls::request_skip,
    );
    assert!(
        summary
            .results
            .iter()
            .all(|r| matches!(r.outcome, Outcome::Done(_)))
    );
}

#[test]
fn cells_of_a_reference_that_was_given_up_fail() {
    let (summary, _) = disturbed(
        &depths([1, 2, 3]).measured(),
        &Night::default(),
        "wave r0 15",
        NightControls::request_skip,
    );
    assert_eq!(summary.results[0].outcome, Outcome::Interrupted);
    assert_eq!(
        summary.results[3].outcome,
        Outcome::Failed("its reference is not available: it was interrupted".into())
    );
    assert!(matches!(summary.results[4].outcome, Outcome::Done(_)));
}

#[test]
fn a_pause_waits_without_rendering_and_changes_nothing() {
    let undisturbed = Night::default().record(&depths([1, 2, 3])).1;
    let waits = Cell::new(0);
    let control = NightControls::default();
    let wait = || {
        waits.set(waits.get() + 1);
        if waits.get() == 5 {
            control.toggle_pause();
        }
    };
    let act = || {
        control.toggle_pause();
    };
    let (mut user, mut heard) = (
        User {
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
    let sinks: &mut [&mut dyn Sink] = &mut [&mut user, &mut heard];
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
    assert_eq!(heard.words, undisturbed.words);
    let times = |heard: &Recorder| {
        heard
            .rows(CellRef::Cell(1))
            .iter()
            .map(|r| r.render_s)
            .collect::<Vec<_>>()
    };
    assert_eq!(
        times(&heard),
        times(&undisturbed),
        "the pause is not on the clock"
    );
}

#[test]
fn a_paused_night_still_hears_stop_and_skip() {
    let pause_and_stop = |control: &NightControls| {
        control.toggle_pause();
        control.request_stop();
    };
    let (summary, _) = disturbed(
        &depths([1, 2, 3]),
        &Night::default(),
        "wave c0 1",
        pause_and_stop,
    );
    assert!(summary.interrupted);
    assert_eq!(summary.results[0].outcome, Outcome::Interrupted);
}

#[test]
fn a_restart_renders_the_cell_from_its_first_sample() {
    let (whole, undisturbed) = Night::default().record(&depths([1, 2, 3]));
    let (lab, night) = (depths([1, 2, 3]), Night::default());
    let asked = Cell::new(false);
    let act = || {
        if !asked.replace(true) {
            night.control.request_restart();
        }
    };
    let (mut user, mut heard) = (
        User {
            at: "wave c1 3",
            act: &act,
        },
        Recorder::default(),
    );
    let summary = night
        .carry_out(&lab, &Arc::new(lab.plan()), &mut [&mut user, &mut heard])
        .unwrap();
    assert!(
        summary
            .results
            .iter()
            .all(|r| matches!(r.outcome, Outcome::Done(_)))
    );
    let starts = heard.words.iter().filter(|w| *w == "start c1").count();
    assert_eq!(starts, 2, "{:?}", heard.words);
    let samples = |night: &NightSummary| {
        night.results[1]
            .rows
            .iter()
            .map(|r| r.samples)
            .collect::<Vec<_>>()
    };
    assert_eq!(
        samples(&summary),
        samples(&whole),
        "nothing of the first try is left"
    );
    assert_eq!(
        heard.film(CellRef::Cell(1)),
        undisturbed.film(CellRef::Cell(1))
    );
    let told = heard.messages(Level::Warn);
    assert!(
        told.contains(&"restarted on request after 3 samples per pixel".to_owned()),
        "{told:?}"
    );
}

#[test]
fn a_restart_that_comes_too_late_does_not_hit_the_next_cell() {
    let (_, heard) = disturbed(
        &depths([1, 2, 3]),
        &Night::default(),
        "done c0",
        NightControls::request_restart,
    );
    assert_eq!(heard.words.iter().filter(|w| *w == "start c1").count(), 1);
}

#[test]
fn a_night_can_end_after_the_cell_at_hand() {
    let after_cell = |control: &NightControls| {
        control.toggle_stop_after_cell();
    };
    let (summary, heard) = disturbed(
        &depths([1, 2, 3]),
        &Night::default(),
        "wave c1 3",
        after_cell,
    );
    assert!(summary.interrupted);
    assert_eq!(summary.results.len(), 2);
    assert!(
        matches!(summary.results[1].outcome, Outcome::Done(_)),
        "the cell at hand is finished"
    );
    assert_eq!(heard.words.last().unwrap(), "morning");
    let (summary, _) = disturbed(
        &depths([1, 2, 3]),
        &Night::default(),
        "wave c2 3",
        after_cell,
    );
    assert!(!summary.interrupted, "there was no further cell");
    let twice = |control: &NightControls| {
        control.toggle_stop_after_cell();
        control.toggle_stop_after_cell();
    };
    let (summary, _) = disturbed(&depths([1, 2, 3]), &Night::default(), "wave c1 3", twice);
    assert_eq!(summary.results.len(), 3, "taken back");
}

#[test]
fn a_limit_pauses_the_night_once_at_the_first_measurement_behind_it() {
    let undisturbed = Night::default().record(&depths([1, 2, 3])).1;
    let (lab, night) = (depths([1, 2, 3]), Night::default());
    let control = NightControls::default();
    control.set_pause_at(Some(PauseAt::Samples(2)));
    let waits = Cell::new(0);
    let wait = || {
        waits.set(waits.get() + 1);
        assert!(control.paused() && control.pause_at().is_none());
        control.set_paused(false);
    };
    let mut heard = Recorder::default();
    let seams = Seams {
        open: night.open,
        wait: &wait,
    };
    let sinks: &mut [&mut dyn Sink] = &mut [&mut heard];
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
    assert_eq!(waits.get(), 1, "once, though three cells pass the limit");
    assert_eq!(
        heard.film(CellRef::Cell(0)),
        undisturbed.film(CellRef::Cell(0))
    );
    let told = heard.messages(Level::Info);
    assert!(
        told.iter()
            .any(|t| t.starts_with("paused as requested after 3 samples")),
        "{told:?}"
    );
    assert!(PauseAt::RenderS(1.5).reached(1, 1.5) && !PauseAt::RenderS(1.5).reached(99, 1.4));
}
