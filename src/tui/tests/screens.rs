//! Snapshots of whole screens.

use insta::assert_snapshot;
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use std::sync::Arc;

use super::night::{self, Teller, in_the_middle};
use crate::experiment::event::Level;
use crate::experiment::parts::Part;
use crate::experiment::{CellRef, Event, Outcome};
use crate::render::OpenStats;
use crate::tui::entry::State;
use crate::tui::look::{Colors, Look};
use crate::tui::model::Model;
use crate::tui::panes;
use crate::tui::thumbs::Thumb;
use crate::tui::view::{ChartX, Focus, Notice, Picture, Prompt, View, Wishes};
use crate::tui::workers::WorkerLine;

pub const RICH: Look = Look { colors: Colors::True, ascii: false };
const PLAIN: Look = Look { colors: Colors::None, ascii: true };
const SIZES: [(u16, u16); 3] = [(80, 24), (120, 40), (200, 60)];

/// The screen as text.
pub fn screen(size: (u16, u16), model: &Model, view: &View) -> String {
    let mut terminal = Terminal::new(TestBackend::new(size.0, size.1)).unwrap();
    terminal.draw(|frame| panes::draw(frame, model, view)).unwrap();
    terminal.backend().to_string()
}

fn view(look: Look, now_s: f64) -> View {
    View { now_s, ..View::new(look) }
}

#[test]
fn nothing_yet() {
    for size in SIZES {
        assert_snapshot!(format!("nothing-{}", size.0), screen(size, &Model::default(), &view(RICH, 0.1)));
    }
}

#[test]
fn a_night_in_the_middle() {
    let (model, now_s) = in_the_middle().model();
    for size in SIZES {
        assert_snapshot!(format!("middle-{}", size.0), screen(size, &model, &view(RICH, now_s + 0.4)));
    }
}

#[test]
fn a_night_in_ascii_without_colours() {
    let (model, now_s) = in_the_middle().model();
    for size in SIZES {
        assert_snapshot!(format!("ascii-{}", size.0), screen(size, &model, &view(PLAIN, now_s + 0.4)));
    }
}

#[test]
fn a_reference_renders() {
    let mut night = Teller::new(night::plan());
    let (model, now_s) = night.render(CellRef::Reference(0), 6).model();
    assert_snapshot!("reference-80", screen((80, 24), &model, &view(RICH, now_s)));
}

#[test]
fn paused_and_stopping() {
    let (model, now_s) = in_the_middle().model();
    let paused = View { wishes: Wishes { paused: true, ..Wishes::default() }, ..view(RICH, now_s + 61.0) };
    assert_snapshot!("paused-80", screen((80, 24), &model, &paused));
    let stopping = View { wishes: Wishes { stopping: true, ..Wishes::default() }, ..view(RICH, now_s) };
    assert_snapshot!("stopping-80", screen((80, 24), &model, &stopping));
}

fn finished() -> Teller {
    let mut night = in_the_middle();
    let done = || Outcome::Done("1024 spp".to_owned());
    night.finish(CellRef::Cell(2), Some(10), done()).render(CellRef::Cell(3), 10);
    night.finish(CellRef::Cell(3), Some(10), done()).say(Level::Info, None, "report written").end();
    night
}

#[test]
fn a_finished_night() {
    let (model, now_s) = finished().model();
    for size in SIZES {
        assert_snapshot!(format!("finished-{}", size.0), screen(size, &model, &view(RICH, now_s + 9.0)));
    }
}

#[test]
fn a_failed_cell() {
    let mut night = in_the_middle();
    let reason = "backend `cpu` failed: the scene needs 40 GB of memory";
    let failed = Outcome::Failed(reason.to_owned());
    night.finish(CellRef::Cell(2), Some(7), failed).say(Level::Error, Some(CellRef::Cell(2)), reason);
    let (model, now_s) = night.model();
    for size in SIZES {
        assert_snapshot!(format!("failed-{}", size.0), screen(size, &model, &view(RICH, now_s)));
    }
}

#[test]
fn invalid_samples_are_shown_with_their_place() {
    let mut night = in_the_middle();
    let mut model = night.say(Level::Warn, None, "a sample was not a number").model().0;
    let mut row = night::row(8);
    (row.invalid, row.first_invalid) = (3, Some([17, 40, 129]));
    let image = night::picture(256);
    let wave = Event::Wave { cell: CellRef::Cell(2), row, measure_s: 0.0, image, pow2: true };
    model.hear(&wave, 70.0);
    assert_snapshot!("invalid-120", screen((120, 40), &model, &view(RICH, 70.0)));
}

#[test]
fn help_lies_over_everything() {
    let (model, now_s) = in_the_middle().model();
    let help = |look| View { help: true, ..view(look, now_s) };
    assert_snapshot!("help-80", screen((80, 24), &model, &help(RICH)));
    assert_snapshot!("help-ascii-40", screen((40, 12), &model, &help(PLAIN)));
}

#[test]
fn one_pane_is_large() {
    let (model, now_s) = in_the_middle().model();
    for (name, focus) in [("picture", Focus::Picture), ("chart", Focus::Chart), ("log", Focus::Log)] {
        let view = View { focus, metric: 1, chart_x: ChartX::Samples, exposure: 1.5, ..view(RICH, now_s) };
        assert_snapshot!(format!("large-{name}-80"), screen((80, 24), &model, &view));
    }
    let view = View { focus: Focus::Chart, ..view(RICH, now_s) };
    assert_snapshot!("large-chart-200", screen((200, 60), &model, &view));
}

#[test]
fn small_terminals_show_what_they_can() {
    let (model, now_s) = in_the_middle().model();
    for size in [(79, 20), (60, 20), (40, 12), (39, 12), (80, 11), (20, 3), (1, 1)] {
        let name = format!("small-{}x{}", size.0, size.1);
        assert_snapshot!(name, screen(size, &model, &view(RICH, now_s)));
    }
}

#[test]
fn a_long_plan_scrolls_and_follows() {
    let plan = night::plan_over(&(1..=40).collect::<Vec<_>>(), &[0.5, 1.0, 1.5]);
    let mut night = Teller::new(Arc::new(plan));
    for i in 0..60 {
        night.finish(CellRef::Cell(i), Some(10), Outcome::Done("1024 spp".to_owned()));
    }
    let (model, now_s) = night.render(CellRef::Cell(60), 3).model();
    assert_snapshot!("long-follow-80", screen((80, 24), &model, &view(RICH, now_s)));
    let top = View { plan_top: Some(0), ..view(RICH, now_s) };
    assert_snapshot!("long-top-80", screen((80, 24), &model, &top));
}

#[test]
fn every_kind_of_picture_has_its_place() {
    let (mut model, now_s) = in_the_middle().model();
    let draw = |model: &Model, picture| {
        let view = View { picture, focus: Focus::Picture, ..view(RICH, now_s) };
        screen((80, 24), model, &view)
    };
    assert!(draw(&model, Picture::Difference).contains("0 to 0."), "the scale stands below the map");
    assert!(draw(&model, Picture::Flip).contains("FLIP"), "{}", draw(&model, Picture::Flip));
    assert!(draw(&model, Picture::Reference).contains("Reference"));
    assert!(draw(&model, Picture::Strategies).contains("No cell has kept"));
    for (s, t) in [(0, 2), (1, 1), (0, 3), (1, 2), (2, 1)] {
        for weighted in [true, false] {
            model.strategy(CellRef::Cell(0), Thumb::of(s, t, weighted, &night::picture(64)));
        }
    }
    assert_snapshot!("strategies-80", draw(&model, Picture::Strategies));
}

#[test]
fn the_line_that_is_typed_and_its_answer_stand_at_the_bottom() {
    let (model, now_s) = in_the_middle().model();
    let last = |view: &View| screen((80, 24), &model, view).lines().last().unwrap().to_owned();
    let typed = View { prompt: Some(Prompt::Command("pau".to_owned())), ..view(RICH, now_s) };
    assert_snapshot!("prompt-80", last(&typed));
    let notice = Notice { text: "there is no command `quit`".to_owned(), until_s: now_s + 1.0 };
    let answered = View { notice: Some(notice), ..view(RICH, now_s) };
    assert!(last(&answered).contains("there is no command `quit`"));
    assert!(!last(&View { now_s: now_s + 2.0, ..answered }).contains("quit"), "it goes away");
}

#[test]
fn a_night_that_is_watched_says_when_there_is_no_news() {
    let (model, now_s) = in_the_middle().model();
    let watched = View { watching: true, ..view(RICH, now_s + 90.0) };
    let first = screen((120, 40), &model, &watched).lines().next().unwrap().to_owned();
    assert!(first.contains("watching") && first.contains("no news for 1m30s"), "{first}");
}

#[test]
fn the_noise_of_the_reference_is_marked_in_the_chart() {
    let (mut model, now_s) = in_the_middle().model();
    let chart = |model: &Model, metric| {
        let view = View { focus: Focus::Chart, metric, ..view(RICH, now_s) };
        screen((100, 30), model, &view)
    };
    assert!(!chart(&model, 0).contains("noise of the reference"));
    model.floor(0, Arc::new(vec![Some(0.012), None, Some(1e9)]));
    assert!(chart(&model, 0).contains("noise of the reference"));
    assert!(!chart(&model, 1).contains("noise of the reference"), "that metric has none");
    assert!(!chart(&model, 2).contains("noise of the reference"), "it lies far outside the chart");
}

#[test]
fn a_contradicted_reference_is_an_alarm_on_the_first_line() {
    let (mut model, now_s) = in_the_middle().model();
    let first = |model: &Model| screen((80, 24), model, &view(RICH, now_s)).lines().next().unwrap().to_owned();
    assert!(!first(&model).contains("contradicted"));
    model.compared(0, false);
    assert!(first(&model).contains("1 reference contradicted"), "{}", first(&model));
    model.begin_again(now_s);
    assert!(first(&model).contains("1 reference contradicted"), "until it is another one");
    model.compared(0, true);
    assert!(!first(&model).contains("contradicted"));
}

#[test]
fn a_night_of_many_workers() {
    let (mut model, now_s) = in_the_middle().model();
    let worker = |i: usize| WorkerLine {
        node: format!("n{:02} 1207_{i}", i % 12),
        device: "NVIDIA L40S".to_owned(),
        doing: if i == 3 { "waits".to_owned() } else { format!("depth={}/radius=0.5/rep=0", 2 + i) },
        age_s: 3.0 * i as f64 + if i == 5 { 400.0 } else { 0.0 },
        lost: i == 5,
    };
    model.crew((0..4).chain([5]).map(worker).collect());
    assert_snapshot!("workers-120", screen((120, 40), &model, &view(RICH, now_s)));
    model.crew((0..40).map(worker).collect());
    assert_snapshot!("workers-200", screen((200, 60), &model, &view(RICH, now_s)));
}

#[test]
fn a_reference_in_parts_says_how_many_are_there() {
    let mut model = Model::default();
    let reference = CellRef::Reference(0);
    model.hear(&Event::NightStarted { plan: night::plan() }, 0.0);
    let part = |number| Part { reference: 0, first: 0, end: 8, number, of: 3 };
    let started = |number| Event::PartStarted { part: part(number), open: OpenStats::default(), resumed: None };
    let ended = |number, outcome| Event::PartFinished { part: part(number), outcome, last: None, kept: None };
    let shown = |model: &Model| screen((200, 60), model, &view(RICH, 5.0));
    model.hear(&started(1), 1.0);
    assert_eq!(model.parts_of(reference), Some((0, 3)));
    assert!(shown(&model).contains("nothing measured yet"), "{}", shown(&model));
    model.hear(&ended(1, Outcome::Done("8 spp".to_owned())), 2.0);
    model.hear(&started(3), 2.0);
    model.hear(&ended(3, Outcome::Interrupted), 3.0);
    assert_eq!((model.parts_of(reference), &model.references[0].state), (Some((1, 3)), &State::Waiting));
    assert!(shown(&model).contains("1/3 parts"), "{}", shown(&model));
    // Once it is there, nobody asks how.
    let rows = Arc::default();
    let outcome = Outcome::Done("24 spp".to_owned());
    let cell = reference;
    model.hear(&Event::CellFinished { cell, outcome, film: None, layers: Arc::default(), times: None, rows }, 4.0);
    assert_eq!(model.parts_of(reference), None);
    assert!(!shown(&model).contains("parts"));
}
