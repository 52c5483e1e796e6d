//! Light by its time: how keys go through it, and how it looks.

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use insta::assert_snapshot;
use ratatui::layout::Rect;
use std::sync::Arc;

use super::night::in_the_middle;
use super::screens::{RICH, screen};
use crate::experiment::{CellRef, Event};
use crate::film::time::{TimeAxis, TimeCube};
use crate::tui::model::Model;
use crate::tui::reel::Reel;
use crate::tui::view::{Focus, Picture, View};

/// A front that goes from left to right through 20 of 24 bins, a column in each.
fn front() -> Arc<TimeCube> {
    let axis = TimeAxis { start: 4.0, bin: 0.25, bins: 24 };
    let light = |x: usize, slot: usize| if slot == x + 3 { [2.0, 1.5, 1.0] } else { [0.0; 3] };
    let sum: Vec<[f64; 3]> =
        (0..20 * 12).flat_map(|i| (0..axis.slots()).map(move |slot| light(i % 20, slot))).collect();
    let square = vec![[0.0; 3]; sum.len()];
    Arc::new(TimeCube { axis, width: 20, height: 12, samples: 1, sum, square })
}

fn lit(cell: CellRef) -> Reel {
    Reel::heard(&Event::Times { cell, times: front() }).unwrap()
}

fn night() -> (Model, f64) {
    let (mut model, now_s) = in_the_middle().model();
    model.wound(lit(CellRef::Cell(2)));
    (model, now_s)
}

fn press(view: &mut View, model: &Model, code: KeyCode) {
    let area = Rect::new(0, 0, 80, 24);
    assert_eq!(view.key(KeyEvent::new(code, KeyModifiers::NONE), model, area), None);
}

fn type_line(view: &mut View, model: &Model, line: &str) {
    line.chars().for_each(|c| press(view, model, KeyCode::Char(c)));
    press(view, model, KeyCode::Enter);
}

#[test]
fn keys_go_through_time_and_play_it() {
    let (model, now_s) = night();
    let reel = model.reel.clone().unwrap();
    let mut view = View { now_s, ..View::new(RICH) };
    let shown = |view: &View| (view.shown(), view.frame(&reel));
    press(&mut view, &model, KeyCode::Right);
    assert_eq!(shown(&view), (Picture::Time, 1));
    press(&mut view, &model, KeyCode::Char('>'));
    assert_eq!(shown(&view), (Picture::Time, 11));
    press(&mut view, &model, KeyCode::Char('>'));
    assert_eq!(shown(&view), (Picture::Time, 19), "no further than the last");
    press(&mut view, &model, KeyCode::Left);
    assert_eq!(shown(&view), (Picture::Time, 18));
    type_line(&mut view, &model, ":time 5.3");
    assert_eq!(shown(&view), (Picture::Time, 3), "4.5 is where light begins");

    // It plays from the frame that shows, goes round, and stops where it is.
    press(&mut view, &model, KeyCode::Char('t'));
    let before = view.tick(&model, now_s);
    view.now_s = now_s + 0.35;
    assert_eq!(shown(&view), (Picture::Time, 6));
    assert_ne!(view.tick(&model, view.now_s), before, "and is drawn again");
    view.now_s = now_s + 1.85;
    assert_eq!(shown(&view), (Picture::Time, 1));
    press(&mut view, &model, KeyCode::Char('t'));
    view.now_s = now_s + 60.0;
    assert_eq!(shown(&view), (Picture::Time, 1));
    type_line(&mut view, &model, ":play");
    press(&mut view, &model, KeyCode::Char('v'));
    assert_eq!((view.shown(), view.playing), (Picture::Live, None), "another picture ends it");
    press(&mut view, &model, KeyCode::Char('t'));
    press(&mut view, &model, KeyCode::Esc);
    assert_eq!(view.playing, None);

    // Where no run has it, there is nothing to play, and a note says so.
    let nothing = Model { reel: None, ..model.clone() };
    press(&mut view, &nothing, KeyCode::Char('t'));
    press(&mut view, &nothing, KeyCode::Right);
    assert_eq!((view.shown(), view.playing), (Picture::Time, None));
    assert!(screen((120, 40), &nothing, &view).contains("film = { time"));
}

#[test]
fn more_light_does_not_move_the_moment_that_is_looked_at() {
    let (mut model, _) = night();
    let mut view = View::new(RICH);
    type_line(&mut view, &model, ":time 6.1");
    let old = model.reel.clone().unwrap();
    let mut cube = (*front()).clone();
    // Light before what was the first frame.
    cube.sum[1] = [0.5; 3];
    model.wound(Reel::of(CellRef::Cell(2), &cube).unwrap());
    let new = model.reel.clone().unwrap();
    assert_eq!(new.count(), old.count() + 2);
    assert_eq!(new.span(view.frame(&new)), old.span(view.frame(&old)));
}

#[test]
fn of_cells_that_take_turns_the_one_at_hand_is_shown() {
    let (mut model, _) = night();
    let cell = |model: &Model| model.reel.as_ref().unwrap().cell;
    model.wound(lit(CellRef::Cell(3)));
    assert_eq!(cell(&model), CellRef::Cell(2));
    let (mut before, _) = in_the_middle().model();
    before.wound(lit(CellRef::Cell(3)));
    assert_eq!(cell(&before), CellRef::Cell(3), "before it has light of its own, any other is better than none");
    before.wound(lit(CellRef::Cell(2)));
    assert_eq!(cell(&before), CellRef::Cell(2));
}

#[test]
fn a_frame_stands_over_its_place_in_time() {
    let (model, now_s) = night();
    let mut view = View { picture: Picture::Time, moment: 6.6, now_s, ..View::new(RICH) };
    assert_snapshot!("time-80", screen((80, 24), &model, &view));
    view.focus = Focus::Picture;
    view.exposure = 1.0;
    view.playing = Some((now_s, 15));
    assert_snapshot!("time-large-200", screen((200, 60), &model, &view));
}
