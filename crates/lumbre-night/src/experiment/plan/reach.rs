//! Thresholds of stop rules that the noise of a reference makes unreachable.

use std::collections::BTreeMap;

use super::Plan;
use crate::experiment::stop::{Comparison, StopRule};
use lumbre_metrics::Better;
use lumbre_metrics::floor::Floor;

/// Returns a warning for every threshold, in the stop rules of the cells measured against a
/// reference, that even the true picture would not reach. `measured` are the indices of these cells,
/// `floors` the noise floors of the reference in the order of the plan's columns.
pub fn unreachable_thresholds(
    plan: &Plan,
    measured: &[usize],
    floors: &[Option<Floor>],
) -> Vec<String> {
    let mut found: BTreeMap<String, (usize, f64)> = BTreeMap::new();
    for cell in measured {
        plan.cells[*cell].stop.visit(&mut |rule| {
            let StopRule::When {
                column, op, value, ..
            } = rule
            else {
                return;
            };
            let Some(metric) = plan
                .measure
                .metrics
                .iter()
                .position(|m| m.column == *column)
            else {
                return;
            };
            let Some(Floor { value: floor, .. }) = floors.get(metric).copied().flatten() else {
                return;
            };
            let beyond = match (plan.measure.metrics[metric].row.better, op) {
                (Better::Lower, Comparison::Less | Comparison::LessEqual) => *value < floor,
                (Better::Higher, Comparison::Greater | Comparison::GreaterEqual) => *value > floor,
                _ => false,
            };
            if beyond {
                let comparison = format!("{column} {} {value}", op.symbol());
                found.entry(comparison).or_insert((0, floor)).0 += 1;
            }
        });
    }
    let sentence = |(comparison, (cells, floor)): (&String, &(usize, f64))| {
        let cells = if *cells == 1 {
            "1 cell stops".to_owned()
        } else {
            format!("{cells} cells stop")
        };
        format!(
            "{cells} at `{comparison}`, but even the true picture would measure {} against this \
             reference: give the reference more samples",
            significant(*floor)
        )
    };
    found.iter().map(sentence).collect()
}

/// Formats a number with three significant digits, or five decimals if it is just below 1.
fn significant(x: f64) -> String {
    if x > 0.9 && x < 1.0 {
        format!("{x:.5}")
    } else if x > 0.0 && x.is_finite() {
        crate::text::significant(x, 3, i32::MIN..=i32::MAX)
    } else {
        format!("{x:.3}")
    }
}
