//! Thresholds that the noise of a reference puts out of reach.

use std::collections::BTreeMap;

use super::Plan;
use crate::experiment::stop::{Comparison, StopRule};
use crate::metrics::Better;

/// One sentence for every comparison in the stop rules of the cells that are measured against reference `place` which
/// no picture can be expected to fulfil: the true one would have `floors`, in the order of the plan's columns.
pub fn unreachable(plan: &Plan, place: usize, floors: &[Option<f64>]) -> Vec<String> {
    let mut found: BTreeMap<String, (usize, f64)> = BTreeMap::new();
    for cell in plan.cells.iter().filter(|cell| cell.reference == Some(place)) {
        cell.stop.visit(&mut |rule| {
            let StopRule::When { column, op, value, .. } = rule else { return };
            let Some(at) = plan.measure.metrics.iter().position(|m| m.column == *column) else { return };
            let Some(floor) = floors.get(at).copied().flatten() else { return };
            let beyond = match (plan.measure.metrics[at].row.better, op) {
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
        let cells = if *cells == 1 { "1 cell waits".to_owned() } else { format!("{cells} cells wait") };
        format!(
            "{cells} for `{comparison}`, but even the true picture has {} against this reference: give the reference \
             more samples",
            significant(*floor)
        )
    };
    found.iter().map(sentence).collect()
}

/// Three significant digits, as few more as it takes to tell it from one.
fn significant(x: f64) -> String {
    let digits = if x > 0.0 && x.is_finite() { (2 - x.log10().floor() as i32).clamp(0, 17) } else { 3 };
    format!("{x:.*}", usize::try_from(digits).unwrap_or(3).max(if x > 0.9 && x < 1.0 { 5 } else { 0 }))
}
