//! The model of a night, where a screen would hide what is wrong.

use lumbre_metrics::floor::Floor;
use std::sync::Arc;

use super::night::{NightBuilder, plan, plan_over};
use lumbre_night::experiment::forecast::Forecast;
use lumbre_night::experiment::{CellRef, EndCause, Event, Outcome};

fn done() -> Outcome {
    Outcome::Done(EndCause::other("256 spp"))
}

#[test]
fn a_forecast_runs_down_while_nothing_else_happens() {
    let mut night = NightBuilder::new(plan());
    night.render(CellRef::Cell(0), 2);
    let (mut model, now_s) = night.model();
    let forecast = Forecast {
        seconds: 600.0,
        known: 4,
        ..Forecast::default()
    };
    model.receive(&Event::Forecast(forecast), now_s);
    let left = |after_s: f64| model.night_eta(now_s + after_s).unwrap().seconds;
    assert_eq!([left(0.0), left(25.0)], [600.0, 575.0]);
    // At least what the current run needs, and nothing by a forecast whose time has passed.
    let run = model.cell_eta(now_s + 550.0).unwrap().seconds;
    assert!(left(550.0) >= run, "{} {run}", left(550.0));
    assert_eq!(model.night_eta(now_s + 700.0), None);
}

#[test]
fn a_night_that_begins_again_has_not_ended() {
    let mut night = NightBuilder::new(plan());
    night
        .render(CellRef::Cell(0), 2)
        .finish(CellRef::Cell(0), Some(2), done());
    let (mut model, now_s) = night.end().model();
    assert!(model.finished_s.is_some());
    let night = Arc::new(model.night.again());
    model.receive(&Event::NightStarted { night }, now_s + 1.0);
    assert_eq!(
        (model.started_s, model.finished_s),
        (Some(now_s + 1.0), None)
    );
}

#[test]
fn a_run_that_is_rendered_again_has_one_past_curve() {
    let mut night = NightBuilder::new(plan());
    for _ in 0..2 {
        night
            .render(CellRef::Cell(0), 3)
            .finish(CellRef::Cell(0), Some(3), done());
    }
    let (model, _) = night.model();
    let cells: Vec<CellRef> = model.past_curves.iter().map(|(cell, _)| *cell).collect();
    assert_eq!(cells, [CellRef::Cell(0)]);
}

#[test]
fn the_noise_floor_is_that_of_the_reference_of_the_run() {
    let mut plan = plan_over(&[3, 5], &[0.5, 1.0]);
    plan.references.push(plan.references[0].clone());
    let mut night = NightBuilder::new(Arc::new(plan));
    night.render(CellRef::Cell(0), 2);
    let (mut model, _) = night.model();
    for (reference, floor) in [(0, 0.25), (1, 0.5)] {
        let floors = Arc::new(vec![Some(Floor::exact(floor)), None, None]);
        model.receive(&Event::NoiseFloors { reference, floors }, 2.0);
    }
    assert_eq!(model.noise_floor(0), Some(0.25));
    assert_eq!(model.noise_floor(1), None);
}
