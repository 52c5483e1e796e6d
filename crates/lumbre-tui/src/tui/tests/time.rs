//! Tests of the time pane: keys and drawing.

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use insta::assert_snapshot;
use ratatui::layout::Rect;
use std::sync::Arc;

use super::night::in_the_middle;
use super::screens::{RICH, screen};
use crate::tui::model::night::NightModel;
use crate::tui::model::time_preview::TimePreview;
use crate::tui::modes::{Focus, PictureMode};
use crate::tui::view::View;
use lumbre_light::film::time::{TimeAxis, TimeCube};
use lumbre_night::experiment::{CellRef, Event};

/// A light front that moves from left to right through 20 of 24 bins, one column per bin.
fn front() -> Arc<TimeCube> {
    let axis = TimeAxis {
        start: 4.0,
        bin: 0.25,
        bins: 24,
    };
    let light = |x: usize, slot: usize| {
        if slot == x + 3 {
            [2.0, 1.5, 1.0]
        } else {
            [0.0; 3]
        }
    };
    let sum: Vec<[f64; 3]> = (0..20 * 12)
        .flat_map(|i| (0..axis.slots()).map(move |slot| light(i % 20, slot)))
        .collect();
    let square = vec![[0.0; 3]; sum.len()];
    Arc::new(TimeCube {
        axis,
        width: 20,
        height: 12,
        samples: 1,
        sum,
        square,
    })
}

fn lit(cell: CellRef) -> TimePreview {
    TimePreview::from_event(&Event::Times {
        cell,
        times: front(),
    })
    .unwrap()
}

fn night() -> (NightModel, f64) {
    let (mut model, now_s) = in_the_middle().model();
    model.set_time_preview(lit(CellRef::Cell(2)));
    (model, now_s)
}

fn press(view: &mut View, model: &NightModel, code: KeyCode) {
    let area = Rect::new(0, 0, 80, 24);
    assert_eq!(
        view.key(KeyEvent::new(code, KeyModifiers::NONE), model, area),
        None
    );
}

fn type_line(view: &mut View, model: &NightModel, line: &str) {
    line.chars()
        .for_each(|c| press(view, model, KeyCode::Char(c)));
    press(view, model, KeyCode::Enter);
}

#[test]
fn keys_step_through_time_and_play_it() {
    let (model, now_s) = night();
    let time_preview = model.time_preview.clone().unwrap();
    let mut view = View {
        now_s,
        ..View::new(RICH)
    };
    let shown = |view: &View| (view.visible_mode(), view.frame(&time_preview));
    press(&mut view, &model, KeyCode::Right);
    assert_eq!(shown(&view), (PictureMode::Time, 1));
    press(&mut view, &model, KeyCode::Char('>'));
    assert_eq!(shown(&view), (PictureMode::Time, 11));
    press(&mut view, &model, KeyCode::Char('>'));
    assert_eq!(
        shown(&view),
        (PictureMode::Time, 19),
        "stops at the last frame"
    );
    press(&mut view, &model, KeyCode::Left);
    assert_eq!(shown(&view), (PictureMode::Time, 18));
    type_line(&mut view, &model, ":time 5.3");
    assert_eq!(shown(&view), (PictureMode::Time, 3), "light begins at 4.5");

    // The animation starts at the visible frame, wraps around, and stops in place.
    press(&mut view, &model, KeyCode::Char('t'));
    let before = view.tick(&model, now_s);
    view.now_s = now_s + 0.35;
    assert_eq!(shown(&view), (PictureMode::Time, 6));
    assert_ne!(
        view.tick(&model, view.now_s),
        before,
        "the screen is drawn again"
    );
    view.now_s = now_s + 1.85;
    assert_eq!(shown(&view), (PictureMode::Time, 1));
    press(&mut view, &model, KeyCode::Char('t'));
    view.now_s = now_s + 60.0;
    assert_eq!(shown(&view), (PictureMode::Time, 1));
    type_line(&mut view, &model, ":play");
    press(&mut view, &model, KeyCode::Char('v'));
    assert_eq!(
        (view.visible_mode(), view.playing),
        (PictureMode::Live, None),
        "another mode stops the animation"
    );
    press(&mut view, &model, KeyCode::Char('t'));
    press(&mut view, &model, KeyCode::Esc);
    assert_eq!(view.playing, None);

    // Without a time-resolved film, a note explains what is needed.
    let nothing = NightModel {
        time_preview: None,
        ..model.clone()
    };
    press(&mut view, &nothing, KeyCode::Char('t'));
    press(&mut view, &nothing, KeyCode::Right);
    assert_eq!(
        (view.visible_mode(), view.playing),
        (PictureMode::Time, None)
    );
    assert!(screen((120, 40), &nothing, &view).contains("film = { time"));
}

#[test]
fn new_data_does_not_move_the_selected_frame() {
    let (mut model, _) = night();
    let mut view = View::new(RICH);
    type_line(&mut view, &model, ":time 6.1");
    let old = model.time_preview.clone().unwrap();
    let mut cube = (*front()).clone();
    // Light in a bin before the previous first frame.
    cube.sum[1] = [0.5; 3];
    model.set_time_preview(TimePreview::from_cube(CellRef::Cell(2), &cube).unwrap());
    let new = model.time_preview.clone().unwrap();
    assert_eq!(new.frame_count(), old.frame_count() + 2);
    assert_eq!(
        new.length_range(view.frame(&new)),
        old.length_range(view.frame(&old))
    );
}

#[test]
fn among_interleaved_cells_the_current_one_is_shown() {
    let (mut model, _) = night();
    let cell = |model: &NightModel| model.time_preview.as_ref().unwrap().cell;
    model.set_time_preview(lit(CellRef::Cell(3)));
    assert_eq!(cell(&model), CellRef::Cell(2));
    let (mut before, _) = in_the_middle().model();
    before.set_time_preview(lit(CellRef::Cell(3)));
    assert_eq!(
        cell(&before),
        CellRef::Cell(3),
        "without a film of the current cell, any other is shown"
    );
    before.set_time_preview(lit(CellRef::Cell(2)));
    assert_eq!(cell(&before), CellRef::Cell(2));
}

#[test]
fn measurements_of_an_interleaved_cell_leave_the_current_one_alone() {
    let mut night = in_the_middle();
    let (alone, _) = night.model();
    night.render(CellRef::Cell(3), 4);
    let (model, now_s) = night.model();
    let later = [now_s, now_s + 50.0];
    let waits = |seconds: [f64; 2]| assert!(seconds[0] > 0.0 && seconds[0] == seconds[1]);
    waits(later.map(|s| model.cell_wall_s(s)));
    waits(later.map(|s| model.cell_eta(s).map_or(0.0, |eta| eta.seconds)));
    let [before, current] = [alone, model.clone()].map(|model| model.current.unwrap());
    assert_eq!(current.cell, CellRef::Cell(2));
    assert_eq!(current.curve.last(), before.curve.last());
    let rival = &model.interleaved[&CellRef::Cell(3)];
    assert_eq!(rival.curve.last().map(|row| row.samples), Some(16));
}

#[test]
fn the_time_pane_is_drawn() {
    let (model, now_s) = night();
    let mut view = View {
        picture: PictureMode::Time,
        optical_length: 6.6,
        now_s,
        ..View::new(RICH)
    };
    assert_snapshot!("time-80", screen((80, 24), &model, &view));
    view.focus = Focus::Picture;
    view.exposure = 1.0;
    view.playing = Some((now_s, 15));
    assert_snapshot!("time-large-200", screen((200, 60), &model, &view));
}
