//! Names of compared techniques in the chart, and of references in the plan.

use std::sync::Arc;

use super::night::{NightBuilder, plan_over};
use super::screens::{RICH, screen, view};
use crate::tui::modes::Focus;
use crate::tui::view::View;
use lumbre_light::value::Value;
use lumbre_night::experiment::plan::Plan;
use lumbre_night::experiment::{CellRef, EndCause, Night, Outcome};

/// A plan of two depths and two techniques.
fn techniques() -> Plan {
    let mut plan = plan_over(&[3, 5], &[0.5, 1.0]);
    plan.axes[1] = "technique".to_owned();
    for (index, cell) in plan.cells.iter_mut().enumerate() {
        let name = ["bpt", "nee"][index % 2];
        cell.point[1] = ("technique".to_owned(), Value::from(name));
    }
    plan
}

/// Returns the right half of a screen, which holds the chart.
fn chart(plan: Plan, past: usize, current: usize) -> String {
    let done = |cell| {
        (
            CellRef::Cell(cell),
            Some(9),
            Outcome::Done(EndCause::other("time")),
        )
    };
    let (cell, last, outcome) = done(past);
    let mut night = NightBuilder::new(Arc::new(plan));
    night.render(cell, 9).finish(cell, last, outcome);
    let (model, now_s) = night.render(CellRef::Cell(current), 8).model();
    let view = View {
        focus: Focus::Chart,
        ..view(RICH, now_s)
    };
    let text = screen((120, 40), &model, &view);
    let right_half = text
        .lines()
        .map(|line| line.chars().skip(60).collect::<String>());
    right_half.skip(12).collect::<Vec<_>>().join("\n")
}

#[test]
fn curves_of_techniques_of_one_picture_are_named_and_others_are_not() {
    let compared = chart(techniques(), 2, 3);
    assert!(
        compared.contains("bpt") && compared.contains("nee"),
        "{compared}"
    );
    let other_depth = chart(techniques(), 0, 3);
    assert!(!other_depth.contains("bpt"), "{other_depth}");
}

#[test]
fn references_are_named_by_what_distinguishes_them() {
    let mut plan = techniques();
    let first = plan.references[0].clone();
    plan.references = vec![first; 4];
    for (index, cell) in plan.cells.iter_mut().enumerate() {
        cell.reference = Some(index);
    }
    let night = Night::planned(&plan);
    assert_eq!(
        night.reference_name(1),
        "bpt of cornell.scn, depth=3 technique=nee"
    );
    // Cells of one depth share a reference: the technique does not distinguish references.
    plan.references.truncate(2);
    for (index, cell) in plan.cells.iter_mut().enumerate() {
        cell.reference = Some(index / 2);
    }
    let night = Night::planned(&plan);
    assert_eq!(night.reference_name(1), "bpt of cornell.scn, depth=5");
}

#[test]
fn finished_references_share_a_row() {
    let mut plan = techniques();
    let first = plan.references[0].clone();
    plan.references = vec![first; 4];
    let mut night = NightBuilder::new(Arc::new(plan));
    for index in 0..3 {
        let outcome = Outcome::Done(EndCause::other("time"));
        night.finish(CellRef::Reference(index), Some(8), outcome);
    }
    let (model, now_s) = night.model();
    let text = screen((120, 40), &model, &view(RICH, now_s));
    assert_eq!(text.matches("reference bpt   ").count(), 4, "{text}");
    let outcome = Outcome::Done(EndCause::other("time"));
    let (model, now_s) = night
        .finish(CellRef::Reference(3), Some(8), outcome)
        .model();
    let text = screen((120, 40), &model, &view(RICH, now_s));
    assert!(
        text.contains("references  4/4") && !text.contains("reference bpt   "),
        "{text}"
    );
}
