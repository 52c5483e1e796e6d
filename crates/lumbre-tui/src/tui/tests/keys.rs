//! Tests of key bindings.

use crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use ratatui::layout::Rect;
use std::sync::Arc;

use super::night::{self, NightBuilder, in_the_middle};
use super::screens::RICH;
use crate::tui::model::night::NightModel;
use crate::tui::modes::{ChartX, Focus, NightRequest, PictureMode};
use crate::tui::view::View;
use lumbre_night::experiment::{CellRef, Outcome, PauseAt};

const AREA: Rect = Rect {
    x: 0,
    y: 0,
    width: 80,
    height: 24,
};

fn press(view: &mut View, model: &NightModel, code: KeyCode) -> Option<NightRequest> {
    view.key(KeyEvent::new(code, KeyModifiers::NONE), model, AREA)
}

#[test]
fn keys_return_requests_to_the_night() {
    let (model, _) = in_the_middle().model();
    let mut view = View::new(RICH);
    for (code, command) in [
        (KeyCode::Char('q'), NightRequest::Stop),
        (KeyCode::Char('p'), NightRequest::Pause(None)),
        (KeyCode::Char(' '), NightRequest::Pause(None)),
        (KeyCode::Char('s'), NightRequest::Skip),
    ] {
        assert_eq!(press(&mut view, &model, code), Some(command), "{code:?}");
    }
    assert_eq!(view.skipping, Some(CellRef::Cell(2)));
    let ctrl = |c| KeyEvent::new(KeyCode::Char(c), KeyModifiers::CONTROL);
    assert_eq!(view.key(ctrl('c'), &model, AREA), Some(NightRequest::Stop));
    assert_eq!(
        view.key(ctrl('s'), &model, AREA),
        None,
        "a control key is not its letter"
    );
    let release = KeyEvent {
        kind: KeyEventKind::Release,
        ..KeyEvent::new(KeyCode::Char('q'), KeyModifiers::NONE)
    };
    assert_eq!(
        view.key(release, &model, AREA),
        None,
        "releasing a key does nothing"
    );
}

#[test]
fn nothing_is_skipped_if_no_cell_renders() {
    let mut view = View::new(RICH);
    assert_eq!(
        press(&mut view, &NightModel::default(), KeyCode::Char('s')),
        None
    );
    let mut night = in_the_middle();
    let (model, _) = night
        .finish(CellRef::Cell(2), Some(7), Outcome::Interrupted)
        .model();
    assert_eq!(press(&mut view, &model, KeyCode::Char('s')), None);
    assert_eq!(view.skipping, None);
}

#[test]
fn requests_that_lose_rendered_work_are_made_when_repeated() {
    let mut night = NightBuilder::new(night::plan());
    let (model, _) = night.render(CellRef::Reference(0), 8).model();
    let mut view = View::new(RICH);
    assert_eq!(press(&mut view, &model, KeyCode::Char('s')), None);
    let question = view.notice.clone().unwrap().text;
    for part in ["s gives up", "after 16.0 s", "cells need it", "repeat it"] {
        assert!(question.contains(part), "{part}: {question}");
    }
    assert_eq!(
        press(&mut view, &model, KeyCode::Char('R')),
        None,
        "another request asks for itself"
    );
    assert_eq!(press(&mut view, &model, KeyCode::Char('s')), None);
    assert_eq!(
        press(&mut view, &model, KeyCode::Char('s')),
        Some(NightRequest::Skip)
    );
    assert_eq!(press(&mut view, &model, KeyCode::Char('R')), None);
    view.now_s += 60.0;
    assert_eq!(
        press(&mut view, &model, KeyCode::Char('R')),
        None,
        "the question has gone"
    );
    assert_eq!(
        press(&mut view, &model, KeyCode::Char('R')),
        Some(NightRequest::Restart)
    );
}

#[test]
fn keys_change_the_view_and_escape_resets_it() {
    let (model, _) = in_the_middle().model();
    let mut view = View::new(RICH);
    let order = [
        Focus::Picture,
        Focus::Chart,
        Focus::Log,
        Focus::Plan,
        Focus::Overview,
    ];
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
fn scrolling_stops_at_the_ends_and_escape_resumes_following() {
    let mut night = NightBuilder::new(Arc::new(night::plan_over(
        &(1..=40).collect::<Vec<_>>(),
        &[0.5],
    )));
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
fn the_enlarged_log_scrolls_within_its_lines() {
    let mut night = in_the_middle();
    for i in 0..100 {
        night.message(
            lumbre_night::experiment::outcome::Level::Info,
            None,
            &format!("message {i}"),
        );
    }
    let (model, _) = night.model();
    let mut view = View {
        focus: Focus::Log,
        ..View::new(RICH)
    };
    press(&mut view, &model, KeyCode::Up);
    assert_eq!(view.log_back, 1);
    press(&mut view, &model, KeyCode::Home);
    let most = view.log_back;
    assert!((80..110).contains(&most), "{most}");
    press(&mut view, &model, KeyCode::PageUp);
    assert_eq!(view.log_back, most);
    press(&mut view, &model, KeyCode::End);
    assert_eq!(view.log_back, 0);
    assert_eq!(view.plan_top, None, "the plan does not scroll");
}

/// Types a line; its first letter is the key that opens the prompt.
fn type_line(view: &mut View, model: &NightModel, line: &str) -> Option<NightRequest> {
    for c in line.chars() {
        assert_eq!(
            press(view, model, KeyCode::Char(c)),
            None,
            "letters are not commands while the prompt is open"
        );
    }
    press(view, model, KeyCode::Enter)
}

#[test]
fn the_command_bar_controls_the_night_and_the_screen() {
    let (model, _) = in_the_middle().model();
    let mut view = View::new(RICH);
    let limit = NightRequest::PauseAt(Some(PauseAt::Samples(64)));
    assert_eq!(type_line(&mut view, &model, ":pause 64spp"), Some(limit));
    assert_eq!(
        type_line(&mut view, &model, ":restart"),
        Some(NightRequest::Restart)
    );
    assert_eq!(type_line(&mut view, &model, ":show flip"), None);
    assert_eq!(view.picture, PictureMode::Flip);
    assert_eq!(type_line(&mut view, &model, ":metric psnr"), None);
    assert_eq!(view.metric, 2);
    assert_eq!(type_line(&mut view, &model, ":quit"), None);
    assert!(
        view.notice
            .as_ref()
            .is_some_and(|n| n.text.contains("there is no command `quit`")),
        "{:?}",
        view.notice
    );
    press(&mut view, &model, KeyCode::Char(':'));
    press(&mut view, &model, KeyCode::Esc);
    assert_eq!(view.prompt, None);
    let ctrl_c = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
    press(&mut view, &model, KeyCode::Char(':'));
    assert_eq!(
        view.key(ctrl_c, &model, AREA),
        Some(NightRequest::Stop),
        "Ctrl-C works while the prompt is open"
    );
}

#[test]
fn alt_and_a_letter_are_escape_and_the_letter() {
    let (model, _) = in_the_middle().model();
    let mut view = View {
        help: true,
        ..View::new(RICH)
    };
    let alt_p = KeyEvent::new(KeyCode::Char('p'), KeyModifiers::ALT);
    assert_eq!(
        view.key(alt_p, &model, AREA),
        Some(NightRequest::Pause(None))
    );
    assert!(!view.help);
}

#[test]
fn a_filter_shows_only_matching_cells() {
    let plan = night::plan_over(&(1..=20).collect::<Vec<_>>(), &[0.5, 1.0, 1.5]);
    let mut night = NightBuilder::new(Arc::new(plan));
    night.finish(
        CellRef::Cell(4),
        Some(3),
        Outcome::Failed("no memory".to_owned()),
    );
    let (model, _) = night.model();
    let mut view = View::new(RICH);
    let shown = |view: &View| crate::tui::panes::plan::rows(&model, view);
    assert_eq!(shown(&view), 21, "a reference and twenty closed groups");
    type_line(&mut view, &model, "/AA=1.5 depth=7");
    assert_eq!(shown(&view), 2, "the group and its cell");
    type_line(&mut view, &model, ":filter failed");
    assert_eq!(
        (shown(&view), view.row_of(CellRef::Cell(4), &model)),
        (2, 1)
    );
    type_line(&mut view, &model, ":filter zebra");
    assert_eq!(shown(&view), 0);
    press(&mut view, &model, KeyCode::Esc);
    press(&mut view, &model, KeyCode::Char('g'));
    assert_eq!(shown(&view), 81, "an open tree");
    press(&mut view, &model, KeyCode::Char('g'));
    assert_eq!(shown(&view), 61, "a list");
    type_line(&mut view, &model, ":cell 60");
    assert!(
        view.plan_top.is_some_and(|top| top > 40),
        "{:?}",
        view.plan_top
    );
}

#[test]
fn watching_cannot_control_the_night() {
    let (model, _) = in_the_middle().model();
    let mut view = View {
        watching: true,
        ..View::new(RICH)
    };
    for key in ['p', 's', 'R', 'Q'] {
        assert_eq!(press(&mut view, &model, KeyCode::Char(key)), None, "{key}");
        assert!(
            view.notice
                .take()
                .is_some_and(|n| n.text.contains("watched")),
            "{key}"
        );
    }
    assert_eq!(type_line(&mut view, &model, ":pause 64spp"), None);
    assert_eq!(
        press(&mut view, &model, KeyCode::Char('q')),
        Some(NightRequest::Stop),
        "quitting is always possible"
    );
}

#[test]
fn pictures_flicker_with_the_clock() {
    let (model, _) = in_the_middle().model();
    let mut view = View::new(RICH);
    press(&mut view, &model, KeyCode::Char('v'));
    assert_eq!(view.visible_mode(), PictureMode::Reference);
    press(&mut view, &model, KeyCode::Char('f'));
    let seen: Vec<PictureMode> = (0..4)
        .map(|i| {
            view.now_s = 60.0 + 0.6 * f64::from(i) + 0.1;
            view.visible_mode()
        })
        .collect();
    assert_eq!(
        seen,
        [
            PictureMode::Live,
            PictureMode::Reference,
            PictureMode::Live,
            PictureMode::Reference
        ]
    );
    assert_ne!(
        view.tick(&model, 60.1),
        view.tick(&model, 60.7),
        "the screen is drawn again"
    );
    press(&mut view, &model, KeyCode::Char('V'));
    assert_eq!((view.picture, view.flicker), (PictureMode::Live, false));
}
