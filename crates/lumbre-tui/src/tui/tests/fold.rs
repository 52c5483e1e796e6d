//! Properties of the model for any events: counts are consistent, memory is bounded, no panics.

use std::path::PathBuf;
use std::sync::Arc;

use proptest::prelude::*;

use super::night::{self, NightBuilder, in_the_middle};
use super::screens::{RICH, screen};
use crate::tui::model::curve::CAPACITY;
use crate::tui::model::night::{MESSAGES, NightModel};
use crate::tui::view::View;
use lumbre_night::experiment::night::state_counts::StateCounts;
use lumbre_night::experiment::outcome::Level;
use lumbre_night::experiment::shards::Shard;
use lumbre_night::experiment::{CellRef, EndCause, Event, Night, Outcome};
use lumbre_render::OpenStats;

/// References to cells of the plan, and to some that it does not have.
fn any_cell() -> impl Strategy<Value = CellRef> {
    prop_oneof![
        (0usize..6).prop_map(CellRef::Cell),
        (0usize..2).prop_map(CellRef::Reference)
    ]
}

fn night_started() -> Event {
    let night = Arc::new(Night::planned(&night::plan()));
    Event::NightStarted { night }
}

fn any_outcome() -> impl Strategy<Value = Outcome> {
    prop_oneof![
        Just(Outcome::Done(EndCause::other("64 spp"))),
        Just(Outcome::Cached(PathBuf::from("out"))),
        Just(Outcome::Failed("why\nnot".to_owned())),
        Just(Outcome::Interrupted),
    ]
}

fn any_event() -> impl Strategy<Value = Event> {
    let number = prop_oneof![
        Just(f64::NAN),
        Just(f64::INFINITY),
        Just(0.0),
        Just(-1.0),
        1e-9f64..1e3
    ];
    let rows = (0u32..40, proptest::collection::vec(number, 0..5));
    prop_oneof![
        1 => Just(()).prop_map(|()| night_started()),
        4 => any_cell().prop_map(|cell| Event::CellStarted {
            cell, open: OpenStats::default(), reference: None, resumed: None, settings: None,
        }),
        8 => (any_cell(), rows).prop_map(|(cell, (k, metrics))| {
            let mut row = night::row(k);
            row.metrics = metrics;
            Event::Wave { cell, row, measure_s: 0.0, image: Some(night::picture(1)), noise: None, pow2: k % 2 == 0 }
        }),
        4 => (any_cell(), any_outcome(), proptest::option::of(0u32..10)).prop_map(|parts| {
            let (cell, outcome, last) = parts;
            Event::ended(cell, outcome, last.map(night::row).into_iter().collect())
        }),
        2 => (any_cell(), ".{0,30}").prop_map(|(cell, text)| {
            Event::Message { level: Level::Warn, cell: Some(cell), text }
        }),
        2 => (0usize..3, 1usize..4, any_outcome()).prop_map(|(reference, number, outcome)| {
            let shard = Shard { reference, first: 0, end: 2, number, count: 3 };
            match outcome {
                Outcome::Cached(_) => {
                    Event::ShardStarted { shard, open: OpenStats::default(), resumed: None }
                }
                outcome => Event::ShardFinished { shard, outcome, last: None, sums: None },
            }
        }),
        1 => Just(Event::NightFinished),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 96,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn any_order_of_events_can_be_applied_and_drawn(
        events in proptest::collection::vec(any_event(), 0..24),
        size in (1u16..210, 1u16..70),
    ) {
        let mut model = NightModel::default();
        for (i, event) in events.iter().enumerate() {
            model.receive(event, i as f64);
        }
        prop_assert_eq!(model.revision, events.len() as u64);
        if model.planned().is_some() {
            let plan = night::plan();
            prop_assert_eq!(StateCounts::of_runs(&model.night.runs).total(), plan.cells.len());
            let references = StateCounts::of_references(&model.night.references);
            prop_assert_eq!(references.total(), plan.references.len());
        }
        for eta in [model.cell_eta(99.0), model.night_eta(99.0)].into_iter().flatten() {
            prop_assert!(eta.seconds >= 0.0, "{eta:?}");
        }
        let drawn = screen(size, &model, &View { now_s: 99.0, ..View::new(RICH) });
        prop_assert_eq!(drawn.lines().count(), usize::from(size.1));
    }
}

#[test]
fn a_night_in_the_middle_has_the_expected_state() {
    let (model, now_s) = in_the_middle().model();
    let counts = StateCounts::of_runs(&model.night.runs);
    assert_eq!(
        counts,
        StateCounts {
            waiting: 1,
            running: 1,
            done: 1,
            cached: 1,
            ..StateCounts::default()
        }
    );
    assert_eq!(
        StateCounts::of_references(&model.night.references),
        StateCounts {
            done: 1,
            ..StateCounts::default()
        }
    );
    assert_eq!(
        model.night.outcome(CellRef::Cell(0)),
        Some(&Outcome::Done(EndCause::other("rmse < 0.01")))
    );
    let current = model.current.as_ref().unwrap();
    assert_eq!(
        (current.cell, current.running, current.curve.rows().len()),
        (CellRef::Cell(2), true, 8)
    );
    assert_eq!(current.image.as_ref().unwrap(), &night::picture(128));
    // 128 of 1024 samples took 8 s of render time and 8.5 s of wall time; the error reaches 0.01
    // before the sample limit.
    let eta = model.cell_eta(now_s).unwrap();
    let limit = 56.0 * 8.5 / 8.0;
    assert!(
        eta.forecast && eta.seconds < limit && eta.seconds > 0.9 * limit,
        "{eta:?}"
    );
    // The waiting cell is expected to take as long as the finished one.
    let mean = night::row(9).wall_s;
    let night_eta = model.night_eta(now_s).unwrap();
    assert!(
        (night_eta.seconds - eta.seconds - mean).abs() < 1e-9,
        "{night_eta:?}"
    );
    assert!((model.cell_wall_s(now_s + 2.0) - 10.5).abs() < 1e-9);
}

#[test]
fn before_any_cell_is_done_time_limits_give_the_estimate() {
    let mut plan = night::plan_over(&[3], &[0.5, 1.0]);
    for cell in &mut plan.cells {
        cell.stop = lumbre_night::experiment::StopRule::Time(30.0);
    }
    let (model, now_s) = NightBuilder::new(Arc::new(plan)).model();
    let eta = model.night_eta(now_s).unwrap();
    assert_eq!((eta.seconds, eta.at_most), (20.0 + 2.0 * 30.0, false));
    let (model, now_s) = NightBuilder::new(night::plan()).model();
    assert_eq!(
        model.night_eta(now_s),
        None,
        "a sample limit gives no time before the first wave"
    );
}

#[test]
fn memory_stays_flat() {
    let (mut model, _) = in_the_middle().model();
    let image = night::picture(1);
    for i in 0..20_000u64 {
        let mut row = night::row(3);
        row.samples = i + 1000;
        let cell = CellRef::Cell(2);
        model.receive(
            &Event::Wave {
                cell,
                row,
                measure_s: 0.0,
                image: Some(image.clone()),
                noise: None,
                pow2: false,
            },
            i as f64,
        );
        model.receive(
            &Event::Message {
                level: Level::Info,
                cell: None,
                text: format!("message {i}"),
            },
            i as f64,
        );
    }
    assert_eq!(model.messages.len(), MESSAGES);
    assert_eq!(model.messages.back().unwrap().text, "message 19999");
    assert!(model.current.as_ref().unwrap().curve.rows().len() <= CAPACITY);
}

#[test]
fn a_second_night_resets_the_state_except_the_log() {
    let (mut model, _) = in_the_middle().model();
    let messages = model.messages.len();
    model.receive(&night_started(), 100.0);
    assert_eq!(StateCounts::of_runs(&model.night.runs).waiting, 4);
    let is_running = |model: &NightModel| model.current.as_ref().map(|current| current.running);
    assert_eq!(is_running(&model), Some(false), "its picture stays");
    let mut other = night::plan();
    Arc::make_mut(&mut other).hash = "77aa".to_owned();
    let night = Arc::new(Night::planned(&other));
    model.receive(&Event::NightStarted { night }, 200.0);
    assert_eq!(is_running(&model), None, "another plan has other pictures");
    assert_eq!(model.messages.len(), messages);
}
