//! What the keys do.

use crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use ratatui::layout::Rect;
use std::sync::Arc;

use super::night::{self, Teller, in_the_middle};
use super::screens::RICH;
use crate::experiment::{CellRef, Outcome, PauseAt};
use crate::tui::model::Model;
use crate::tui::view::{ChartX, Command, Focus, Picture, View};

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

/// Types a line, its first letter being the key that begins it.
fn type_line(view: &mut View, model: &Model, line: &str) -> Option<Command> {
    for c in line.chars() {
        assert_eq!(press(view, model, KeyCode::Char(c)), None, "a letter is no command while a line is typed");
    }
    press(view, model, KeyCode::Enter)
}

#[test]
fn the_command_bar_reaches_the_night_and_the_screen() {
    let (model, _) = in_the_middle().model();
    let mut view = View::new(RICH);
    let limit = Command::PauseAt(Some(PauseAt::Samples(64)));
    assert_eq!(type_line(&mut view, &model, ":pause 64spp"), Some(limit));
    assert_eq!(type_line(&mut view, &model, ":restart"), Some(Command::Restart));
    assert_eq!(type_line(&mut view, &model, ":show flip"), None);
    assert_eq!(view.picture, Picture::Flip);
    assert_eq!(type_line(&mut view, &model, ":metric psnr"), None);
    assert_eq!(view.metric, 2);
    assert_eq!(type_line(&mut view, &model, ":quit"), None);
    assert!(view.notice.as_ref().is_some_and(|n| n.text.contains("there is no command `quit`")), "{:?}", view.notice);
    press(&mut view, &model, KeyCode::Char(':'));
    press(&mut view, &model, KeyCode::Esc);
    assert_eq!(view.prompt, None);
    let ctrl_c = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
    press(&mut view, &model, KeyCode::Char(':'));
    assert_eq!(view.key(ctrl_c, &model, AREA), Some(Command::Stop), "the way out is always open");
}

#[test]
fn a_letter_right_after_escape_is_both() {
    let (model, _) = in_the_middle().model();
    let mut view = View { help: true, ..View::new(RICH) };
    let alt_p = KeyEvent::new(KeyCode::Char('p'), KeyModifiers::ALT);
    assert_eq!(view.key(alt_p, &model, AREA), Some(Command::Pause(None)));
    assert!(!view.help);
}

#[test]
fn a_filter_leaves_the_cells_with_its_words() {
    let plan = night::plan_over(&(1..=20).collect::<Vec<_>>(), &[0.5, 1.0, 1.5]);
    let mut night = Teller::new(Arc::new(plan));
    night.finish(CellRef::Cell(4), Some(3), Outcome::Failed("no memory".to_owned()));
    let (model, _) = night.model();
    let mut view = View::new(RICH);
    let shown = |view: &View| crate::tui::panes::plan::rows(&model, view);
    assert_eq!(shown(&view), 21, "a reference and twenty closed groups");
    type_line(&mut view, &model, "/AA=1.5 depth=7");
    assert_eq!(shown(&view), 2, "the group and its cell");
    type_line(&mut view, &model, ":filter failed");
    assert_eq!((shown(&view), view.row_of(CellRef::Cell(4), &model)), (2, 1));
    type_line(&mut view, &model, ":filter zebra");
    assert_eq!(shown(&view), 0);
    press(&mut view, &model, KeyCode::Esc);
    press(&mut view, &model, KeyCode::Char('g'));
    assert_eq!(shown(&view), 81, "an open tree");
    press(&mut view, &model, KeyCode::Char('g'));
    assert_eq!(shown(&view), 61, "a list");
    type_line(&mut view, &model, ":cell 60");
    assert!(view.plan_top.is_some_and(|top| top > 40), "{:?}", view.plan_top);
}

#[test]
fn who_only_watches_cannot_touch_the_night() {
    let (model, _) = in_the_middle().model();
    let mut view = View { watching: true, ..View::new(RICH) };
    for key in ['p', 's', 'R', 'Q'] {
        assert_eq!(press(&mut view, &model, KeyCode::Char(key)), None, "{key}");
        assert!(view.notice.take().is_some_and(|n| n.text.contains("watched")), "{key}");
    }
    assert_eq!(type_line(&mut view, &model, ":pause 64spp"), None);
    assert_eq!(press(&mut view, &model, KeyCode::Char('q')), Some(Command::Stop), "leaving is one's own affair");
}

#[test]
fn pictures_flicker_with_the_clock() {
    let (model, _) = in_the_middle().model();
    let mut view = View::new(RICH);
    press(&mut view, &model, KeyCode::Char('v'));
    assert_eq!(view.shown(), Picture::Reference);
    press(&mut view, &model, KeyCode::Char('f'));
    let seen: Vec<Picture> = (0..4)
        .map(|i| {
            view.now_s = 60.0 + 0.6 * f64::from(i) + 0.1;
            view.shown()
        })
        .collect();
    assert_eq!(seen, [Picture::Live, Picture::Reference, Picture::Live, Picture::Reference]);
    assert_ne!(view.tick(&model, 60.1), view.tick(&model, 60.7), "and are drawn again");
    press(&mut view, &model, KeyCode::Char('V'));
    assert_eq!((view.picture, view.flicker), (Picture::Live, false));
}
