//! Snapshots of whole screens.

use insta::assert_snapshot;
use lumbre_metrics::floor::Floor;
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use std::sync::Arc;

use super::night::{self, NightBuilder, in_the_middle};
use crate::tui::model::night::NightModel;
use crate::tui::model::worker_list::WorkerLine;
use crate::tui::modes::{ChartX, Focus, PictureMode};
use crate::tui::panes;
use crate::tui::terminal::terminal_caps::{Colors, TerminalCaps};
use crate::tui::view::{Notice, PendingRequests, Prompt, View};
use lumbre_light::film::layer::{Layer, LayerFilm, LayerImage, PathSubset};
use lumbre_night::experiment::night::reference::BiasCheckSummary;
use lumbre_night::experiment::night::run::RunState;
use lumbre_night::experiment::outcome::Level;
use lumbre_night::experiment::shards::Shard;
use lumbre_night::experiment::{CellRef, EndCause, Event, Outcome};
use lumbre_render::OpenStats;

pub const RICH: TerminalCaps = TerminalCaps {
    colors: Colors::True,
    ascii: false,
};
const PLAIN: TerminalCaps = TerminalCaps {
    colors: Colors::None,
    ascii: true,
};
const SIZES: [(u16, u16); 3] = [(80, 24), (120, 40), (200, 60)];

/// Draws the screen as text.
pub fn screen(size: (u16, u16), model: &NightModel, view: &View) -> String {
    let mut terminal = Terminal::new(TestBackend::new(size.0, size.1)).unwrap();
    terminal
        .draw(|frame| panes::draw(frame, model, view))
        .unwrap();
    terminal.backend().to_string()
}

/// Returns a view at `now_s` seconds.
pub fn view(caps: TerminalCaps, now_s: f64) -> View {
    View {
        now_s,
        ..View::new(caps)
    }
}

#[test]
fn nothing_yet() {
    for size in SIZES {
        assert_snapshot!(
            format!("nothing-{}", size.0),
            screen(size, &NightModel::default(), &view(RICH, 0.1))
        );
    }
}

#[test]
fn a_night_in_the_middle() {
    let (model, now_s) = in_the_middle().model();
    for size in SIZES {
        assert_snapshot!(
            format!("middle-{}", size.0),
            screen(size, &model, &view(RICH, now_s + 0.4))
        );
    }
}

#[test]
fn a_lens_given_by_its_f_number_is_shown_with_its_view_and_diameter() {
    let mut plan = night::plan_over(&[3], &[0.5]);
    for cell in &mut plan.cells {
        let scene = Arc::make_mut(&mut cell.scene);
        scene.camera.optics = scene
            .camera
            .optics
            .with_f_number(Some(16.0))
            .with_focal_length(Some(0.05))
            .with_sensor_height(Some(0.024));
    }
    let mut night = NightBuilder::new(Arc::new(plan));
    let (model, now_s) = night.render(CellRef::Cell(0), 2).model();
    assert_snapshot!("lens-120", screen((120, 40), &model, &view(RICH, now_s)));
}

#[test]
fn a_night_in_ascii_without_colours() {
    let (model, now_s) = in_the_middle().model();
    for size in SIZES {
        assert_snapshot!(
            format!("ascii-{}", size.0),
            screen(size, &model, &view(PLAIN, now_s + 0.4))
        );
    }
}

#[test]
fn a_reference_renders() {
    let mut night = NightBuilder::new(night::plan());
    let (model, now_s) = night.render(CellRef::Reference(0), 6).model();
    assert_snapshot!("reference-80", screen((80, 24), &model, &view(RICH, now_s)));
}

#[test]
fn paused_and_stopping() {
    let (model, now_s) = in_the_middle().model();
    let paused = View {
        requests: PendingRequests {
            paused: true,
            ..PendingRequests::default()
        },
        ..view(RICH, now_s + 61.0)
    };
    assert_snapshot!("paused-80", screen((80, 24), &model, &paused));
    let stopping = View {
        requests: PendingRequests {
            stopping: true,
            ..PendingRequests::default()
        },
        ..view(RICH, now_s)
    };
    assert_snapshot!("stopping-80", screen((80, 24), &model, &stopping));
}

fn finished() -> NightBuilder {
    let mut night = in_the_middle();
    let done = || Outcome::Done(EndCause::other("1024 spp"));
    night
        .finish(CellRef::Cell(2), Some(10), done())
        .render(CellRef::Cell(3), 10);
    night
        .finish(CellRef::Cell(3), Some(10), done())
        .message(Level::Info, None, "report written")
        .end();
    night
}

#[test]
fn a_finished_night() {
    let (model, now_s) = finished().model();
    for size in SIZES {
        assert_snapshot!(
            format!("finished-{}", size.0),
            screen(size, &model, &view(RICH, now_s + 9.0))
        );
    }
}

#[test]
fn a_failed_cell() {
    let mut night = in_the_middle();
    let reason = "backend `cpu` failed: the scene needs 40 GB of memory";
    let failed = Outcome::Failed(reason.to_owned());
    night.finish(CellRef::Cell(2), Some(7), failed).message(
        Level::Error,
        Some(CellRef::Cell(2)),
        reason,
    );
    let (model, now_s) = night.model();
    for size in SIZES {
        assert_snapshot!(
            format!("failed-{}", size.0),
            screen(size, &model, &view(RICH, now_s))
        );
    }
}

#[test]
fn invalid_samples_are_shown_with_their_position() {
    let mut night = in_the_middle();
    let mut model = night
        .message(Level::Warn, None, "a sample was not a number")
        .model()
        .0;
    let mut row = night::row(8);
    (row.invalid, row.first_invalid) = (3, Some([17, 40, 129]));
    let image = night::picture(256);
    let wave = Event::Wave {
        cell: CellRef::Cell(2),
        row,
        measure_s: 0.0,
        image: Some(image),
        noise: None,
        pow2: true,
    };
    model.receive(&wave, 70.0);
    assert_snapshot!("invalid-120", screen((120, 40), &model, &view(RICH, 70.0)));
}

#[test]
fn help_overlays_all_panes() {
    let (model, now_s) = in_the_middle().model();
    let help = |caps| View {
        help: true,
        ..view(caps, now_s)
    };
    assert_snapshot!("help-80", screen((80, 24), &model, &help(RICH)));
    assert_snapshot!("help-ascii-40", screen((40, 12), &model, &help(PLAIN)));
}

#[test]
fn one_pane_is_enlarged() {
    let (model, now_s) = in_the_middle().model();
    for (name, focus) in [
        ("picture", Focus::Picture),
        ("chart", Focus::Chart),
        ("log", Focus::Log),
    ] {
        let view = View {
            focus,
            metric: 1,
            chart_x: ChartX::Samples,
            exposure: 1.5,
            ..view(RICH, now_s)
        };
        assert_snapshot!(format!("large-{name}-80"), screen((80, 24), &model, &view));
    }
    let view = View {
        focus: Focus::Chart,
        ..view(RICH, now_s)
    };
    assert_snapshot!("large-chart-200", screen((200, 60), &model, &view));
}

#[test]
fn small_terminals_show_what_they_can() {
    let (model, now_s) = in_the_middle().model();
    for size in [
        (79, 20),
        (60, 20),
        (40, 12),
        (39, 12),
        (80, 11),
        (20, 3),
        (1, 1),
    ] {
        let name = format!("small-{}x{}", size.0, size.1);
        assert_snapshot!(name, screen(size, &model, &view(RICH, now_s)));
    }
}

#[test]
fn a_long_plan_scrolls_and_follows() {
    let plan = night::plan_over(&(1..=40).collect::<Vec<_>>(), &[0.5, 1.0, 1.5]);
    let mut night = NightBuilder::new(Arc::new(plan));
    for i in 0..60 {
        night.finish(
            CellRef::Cell(i),
            Some(10),
            Outcome::Done(EndCause::other("1024 spp")),
        );
    }
    let (model, now_s) = night.render(CellRef::Cell(60), 3).model();
    assert_snapshot!(
        "long-follow-80",
        screen((80, 24), &model, &view(RICH, now_s))
    );
    let top = View {
        plan_top: Some(0),
        ..view(RICH, now_s)
    };
    assert_snapshot!("long-top-80", screen((80, 24), &model, &top));
}

#[test]
fn every_picture_mode_is_drawn() {
    let (mut model, now_s) = in_the_middle().model();
    let draw = |model: &NightModel, picture| {
        let view = View {
            picture,
            focus: Focus::Picture,
            ..view(RICH, now_s)
        };
        screen((80, 24), model, &view)
    };
    assert!(
        draw(&model, PictureMode::Difference).contains("0 to 0."),
        "the scale is drawn below the map"
    );
    assert!(
        draw(&model, PictureMode::Flip).contains("FLIP"),
        "{}",
        draw(&model, PictureMode::Flip)
    );
    assert!(draw(&model, PictureMode::Reference).contains("Reference"));
    assert!(draw(&model, PictureMode::Strategies).contains("No strategy films yet"));
    for (s, t) in [(0, 2), (1, 1), (0, 3), (1, 2), (2, 1)] {
        for weighted in [true, false] {
            let film = LayerFilm {
                layer: Layer::Strategies,
                subset: PathSubset::Strategy { s, t, weighted },
                splats: true,
            };
            let image = (*night::picture(64)).clone();
            let layer = Arc::new(LayerImage { film, image });
            let cell = CellRef::Cell(0);
            model.receive(&Event::Layer { cell, layer }, now_s);
        }
    }
    assert_snapshot!("strategies-80", draw(&model, PictureMode::Strategies));
}

#[test]
fn prompt_and_notice_are_drawn_on_the_last_line() {
    let (model, now_s) = in_the_middle().model();
    let last = |view: &View| {
        screen((80, 24), &model, view)
            .lines()
            .last()
            .unwrap()
            .to_owned()
    };
    let typed = View {
        prompt: Some(Prompt::Command("pau".to_owned())),
        ..view(RICH, now_s)
    };
    assert_snapshot!("prompt-80", last(&typed));
    let notice = Notice {
        text: "there is no command `quit`".to_owned(),
        until_s: now_s + 1.0,
    };
    let answered = View {
        notice: Some(notice),
        ..view(RICH, now_s)
    };
    assert!(last(&answered).contains("there is no command `quit`"));
    assert!(
        !last(&View {
            now_s: now_s + 2.0,
            ..answered
        })
        .contains("quit"),
        "the notice expires"
    );
}

#[test]
fn watching_reports_missing_updates() {
    let (model, now_s) = in_the_middle().model();
    let watched = View {
        watching: true,
        ..view(RICH, now_s + 90.0)
    };
    let first = screen((120, 40), &model, &watched)
        .lines()
        .next()
        .unwrap()
        .to_owned();
    assert!(
        first.contains("watching") && first.contains("no update for 1m30s"),
        "{first}"
    );
}

#[test]
fn the_noise_floor_is_marked_in_the_chart() {
    let (mut model, now_s) = in_the_middle().model();
    let chart = |model: &NightModel, metric| {
        let view = View {
            focus: Focus::Chart,
            metric,
            ..view(RICH, now_s)
        };
        screen((100, 30), model, &view)
    };
    assert!(!chart(&model, 0).contains("reference noise floor"));
    let floors = Event::NoiseFloors {
        reference: 0,
        floors: Arc::new(vec![
            Some(Floor::exact(0.012)),
            None,
            Some(Floor::exact(1e9)),
        ]),
    };
    model.receive(&floors, now_s);
    assert!(chart(&model, 0).contains("reference noise floor"));
    assert!(
        !chart(&model, 1).contains("reference noise floor"),
        "this metric has no floor"
    );
    assert!(
        !chart(&model, 2).contains("reference noise floor"),
        "it lies far outside the chart"
    );
}

#[test]
fn a_failed_bias_check_is_shown_in_the_title() {
    let (mut model, now_s) = in_the_middle().model();
    let first = |model: &NightModel| {
        screen((80, 24), model, &view(RICH, now_s))
            .lines()
            .next()
            .unwrap()
            .to_owned()
    };
    assert!(!first(&model).contains("bias check"));
    let checked = |agrees| Event::BiasCheck {
        reference: 0,
        check: BiasCheckSummary {
            technique: "nee".to_owned(),
            agrees,
            finding: String::new(),
        },
        compared: None,
    };
    model.receive(&checked(false), now_s);
    assert!(
        first(&model).contains("1 bias check failed"),
        "{}",
        first(&model)
    );
    let night = Arc::new(model.night.again());
    model.receive(&Event::NightStarted { night }, now_s);
    assert!(
        first(&model).contains("1 bias check failed"),
        "it remains in the next night"
    );
    model.receive(&checked(true), now_s);
    assert!(!first(&model).contains("bias check"));
}

#[test]
fn a_night_of_many_workers() {
    let (mut model, now_s) = in_the_middle().model();
    let worker = |i: usize| WorkerLine {
        node: format!("n{:02} 1207_{i}", i % 12),
        device: "NVIDIA L40S".to_owned(),
        activity: if i == 3 {
            "waits".to_owned()
        } else {
            format!("depth={}/radius=0.5/rep=0", 2 + i)
        },
        age_s: 3.0 * i as f64 + if i == 5 { 400.0 } else { 0.0 },
        lost: i == 5,
    };
    model.set_workers((0..4).chain([5]).map(worker).collect());
    assert_snapshot!("workers-120", screen((120, 40), &model, &view(RICH, now_s)));
    model.set_workers((0..40).map(worker).collect());
    assert_snapshot!("workers-200", screen((200, 60), &model, &view(RICH, now_s)));
}

#[test]
fn a_sharded_reference_shows_its_finished_shards() {
    let (mut model, _) = NightBuilder::new(night::plan()).model();
    let reference = CellRef::Reference(0);
    let shard = |number| Shard {
        reference: 0,
        first: 0,
        end: 8,
        number,
        count: 3,
    };
    let started = |number| Event::ShardStarted {
        shard: shard(number),
        open: OpenStats::default(),
        resumed: None,
    };
    let ended = |number, outcome| Event::ShardFinished {
        shard: shard(number),
        outcome,
        last: None,
        sums: None,
    };
    let shown = |model: &NightModel| screen((200, 60), model, &view(RICH, 5.0));
    model.receive(&started(1), 1.0);
    assert_eq!(model.shard_progress(reference), Some((0, 3)));
    assert!(
        shown(&model).contains("no measurement yet"),
        "{}",
        shown(&model)
    );
    model.receive(&ended(1, Outcome::Done(EndCause::other("8 spp"))), 2.0);
    model.receive(&started(3), 2.0);
    model.receive(&ended(3, Outcome::Interrupted), 3.0);
    assert_eq!(
        (
            model.shard_progress(reference),
            model.night.state(reference)
        ),
        (Some((1, 3)), Some(&RunState::Pending))
    );
    assert!(shown(&model).contains("1/3 shards"), "{}", shown(&model));
    // A complete reference no longer shows its shards.
    let outcome = Outcome::Done(EndCause::other("24 spp"));
    model.receive(&Event::ended(reference, outcome, Vec::new()), 4.0);
    assert_eq!(model.shard_progress(reference), None);
    assert!(!shown(&model).contains("shards"));
}
