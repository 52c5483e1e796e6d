//! What the keys do.

use crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use ratatui::layout::Rect;
use std::sync::Arc;

use super::night::{self, Teller, in_the_middle};
use super::screens::RICH;
use crate::experiment::{CellRef, Outcome};
use crate::tui::model::Model;
use crate::tui::view::{ChartX, Command, Focus, View};

const AREA: Rect = Rect { x: 0, y: 0, width: 80, height: 24 };

fn press(view: &mut View, model: &Model, code: KeyCode) -> Option<Command> {
    view.key(KeyEvent::new(code, KeyModifiers::NONE), model, AREA)
}

#[test]
fn keys_that_concern_the_night_are_handed_back() {
    let (model, _) = in_the_middle().model();
    let mut view = View::new(RICH);
    for (code, command) in [
        (KeyCode::Char('q'), Command::Stop),
        (KeyCode::Char('p'), Command::Pause(None)),
        (KeyCode::Char(' '), Command::Pause(None)),
        (KeyCode::Char('s'), Command::Skip),
    ] {
        assert_eq!(press(&mut view, &model, code), Some(command), "{code:?}");
    }
    assert_eq!(view.skipping, Some(CellRef::Cell(2)));
    let ctrl = |c| KeyEvent::new(KeyCode::Char(c), KeyModifiers::CONTROL);
    assert_eq!(view.key(ctrl('c'), &model, AREA), Some(Command::Stop));
    assert_eq!(view.key(ctrl('s'), &model, AREA), None, "a control key is not its letter");
    let release = KeyEvent { kind: KeyEventKind::Release, ..KeyEvent::new(KeyCode::Char('q'), KeyModifiers::NONE) };
    assert_eq!(view.key(release, &model, AREA), None, "a key is pressed once");
}

#[test]
fn nothing_can_be_skipped_where_nothing_renders() {
    let mut view = View::new(RICH);
    assert_eq!(press(&mut view, &Model::default(), KeyCode::Char('s')), None);
    let mut night = in_the_middle();
    let (model, _) = night.finish(CellRef::Cell(2), Some(7), Outcome::Interrupted).model();
    assert_eq!(press(&mut view, &model, KeyCode::Char('s')), None);
    assert_eq!(view.skipping, None);
}

#[test]
fn the_view_changes_and_comes_back() {
    let (model, _) = in_the_middle().model();
    let mut view = View::new(RICH);
    let order = [Focus::Picture, Focus::Chart, Focus::Log, Focus::Plan, Focus::Overview];
    for focus in order {
        press(&mut view, &model, KeyCode::Tab);
        assert_eq!(view.focus, focus);
    }
    press(&mut view, &model, KeyCode::BackTab);
    assert_eq!(view.focus, Focus::Plan);
    press(&mut view, &model, KeyCode::Esc);
    assert_eq!(view.focus, Focus::Overview);

    for key in [KeyCode::Char('?'), KeyCode::F(1)] {
        press(&mut view, &model, key);
        assert!(view.help);
        press(&mut view, &model, KeyCode::Esc);
        assert!(!view.help);
    }

    press(&mut view, &model, KeyCode::Char('2'));
    assert_eq!(view.metric, 1);
    press(&mut view, &model, KeyCode::Char('9'));
    assert_eq!(view.metric, 1, "the plan has three metrics");
    press(&mut view, &model, KeyCode::Char('x'));
    assert_eq!(view.chart_x, ChartX::Samples);

    press(&mut view, &model, KeyCode::Char('E'));
    press(&mut view, &model, KeyCode::Char('E'));
    press(&mut view, &model, KeyCode::Char('e'));
    assert_eq!(view.exposure, 0.5);
    for _ in 0..100 {
        press(&mut view, &model, KeyCode::Char('e'));
    }
    assert_eq!(view.exposure, -12.0);
}

#[test]
fn scrolling_stops_at_the_ends_and_escape_follows_again() {
    let mut night = Teller::new(Arc::new(night::plan_over(&(1..=40).collect::<Vec<_>>(), &[0.5])));
    let (model, _) = night.render(CellRef::Cell(20), 2).model();
    let mut view = View::new(RICH);
    press(&mut view, &model, KeyCode::Home);
    assert_eq!(view.plan_top, Some(0));
    press(&mut view, &model, KeyCode::Up);
    assert_eq!(view.plan_top, Some(0));
    press(&mut view, &model, KeyCode::Char('j'));
    press(&mut view, &model, KeyCode::Down);
    press(&mut view, &model, KeyCode::Char('k'));
    assert_eq!(view.plan_top, Some(1));
    press(&mut view, &model, KeyCode::PageDown);
    assert!(view.plan_top > Some(4));
    press(&mut view, &model, KeyCode::End);
    let last = view.plan_top;
    press(&mut view, &model, KeyCode::PageDown);
    assert_eq!(view.plan_top, last, "no empty rows below the end");
    press(&mut view, &model, KeyCode::Esc);
    assert_eq!(view.plan_top, None);
}

#[test]
fn the_large_log_scrolls_back_and_no_further() {
    let mut night = in_the_middle();
    for i in 0..100 {
        night.say(crate::experiment::event::Level::Info, None, &format!("message {i}"));
    }
    let (model, _) = night.model();
    let mut view = View { focus: Focus::Log, ..View::new(RICH) };
    press(&mut view, &model, KeyCode::Up);
    assert_eq!(view.log_back, 1);
    press(&mut view, &model, KeyCode::Home);
    let most = view.log_back;
    assert!((80..110).contains(&most), "{most}");
    press(&mut view, &model, KeyCode::PageUp);
    assert_eq!(view.log_back, most);
    press(&mut view, &model, KeyCode::End);
    assert_eq!(view.log_back, 0);
    assert_eq!(view.plan_top, None, "the plan stays where it is");
}
