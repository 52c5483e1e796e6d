//! The A/A check: what a comparison says of a technique and itself.
//!
//! A script that asks for it (`x:control`) has some cells rendered a second time with other seeds, in the same order and
//! under the same rules as two techniques would be. Every difference between the two is false. If it is larger than chance
//! allows, the comparison is not fair: a machine that grew slower, a clock that counts what it should not, seeds that are
//! not independent. If it is not, its size says how large a difference between two techniques has to be.

use std::collections::BTreeMap;

use super::plan::{Cell, Plan};
use super::run::CellResult;
use super::{CellRef, Outcome, WaveRow};
use crate::math::student::{two_sided_p, two_sided_t};

/// An A/A check gives an alarm if all its comparisons together would do so by chance with this probability.
const SIGNIFICANCE: f64 = 0.01;

/// What one comparison of a technique with itself found.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// The technique: its integrator with its parameters.
    pub technique: String,
    /// A metric's column, or `samples/s`.
    pub measure: String,
    /// The second runs' values over the first ones': the geometric mean over the pairs. Metrics count by their
    /// [distance](crate::metrics::MetricSpec::distance) from the best value.
    pub ratio: f64,
    /// The 95 % confidence interval of that mean, by Student's t on logarithms; `None` for a single pair.
    pub interval: Option<[f64; 2]>,
    /// The probability of a mean as far from 1 by chance; `None` for a single pair.
    pub p: Option<f64>,
    /// The factor by which two single runs differ by chance in 1 of 20 pairs; `None` for a single pair.
    pub single: Option<f64>,
    /// Pairs of runs.
    pub pairs: usize,
    /// Whether the difference is more than chance allows, all findings of the check taken together.
    pub alarm: bool,
}

impl Finding {
    /// The finding in a sentence.
    pub fn describe(&self) -> String {
        let percent = |factor: f64| format!("{:+.2} %", 100.0 * (factor - 1.0));
        let Finding { technique, measure, ratio, pairs, .. } = self;
        let what = format!("{technique} against itself: {measure} {}", percent(*ratio));
        let (Some([low, high]), Some(p), Some(single)) = (self.interval, self.p, self.single) else {
            return format!("{what} in one pair of runs, which says nothing of chance: add repeats");
        };
        let verdict = if self.alarm { "; MORE THAN CHANCE ALLOWS: the comparison is not fair" } else { "" };
        format!(
            "{what} (95 %: {} to {}, p = {p:.2}, {pairs} pairs); two single runs differ by up to {:.1} % by chance{verdict}",
            percent(low),
            percent(high),
            100.0 * (single - 1.0)
        )
    }
}

/// The findings of a night's A/A check, by technique in the order of the plan; empty without one, and where no pair of
/// runs is finished.
pub fn check(plan: &Plan, results: &[CellResult]) -> Vec<Finding> {
    let last: BTreeMap<usize, &WaveRow> = results
        .iter()
        .filter(|result| matches!(result.outcome, Outcome::Done(_) | Outcome::Cached(_)))
        .filter_map(|result| match result.cell {
            CellRef::Cell(i) => Some((i, result.rows.last()?)),
            CellRef::Reference(_) => None,
        })
        .collect();
    let mut techniques: Vec<(String, Vec<[&WaveRow; 2]>)> = Vec::new();
    for (index, cell) in plan.cells.iter().enumerate() {
        let Some(repeat) = cell.control else { continue };
        // Doubles follow their originals.
        let first = (0..index).rev().find(|i| {
            let other = &plan.cells[*i];
            other.control.is_none() && other.repeat == repeat && other.point == cell.point
        });
        let Some(pair) = first.and_then(|first| Some([*last.get(&first)?, *last.get(&index)?])) else { continue };
        let name = technique(cell);
        match techniques.iter_mut().find(|(known, _)| *known == name) {
            Some((_, pairs)) => pairs.push(pair),
            None => techniques.push((name, vec![pair])),
        }
    }
    let mut findings: Vec<Finding> = Vec::new();
    for (technique, pairs) in &techniques {
        let speed = |row: &WaveRow| Some(row.samples as f64 / row.render_s);
        findings.extend(finding(technique, "samples/s", pairs, &speed));
        for (place, metric) in plan.measure.metrics.iter().enumerate() {
            let distance = |row: &WaveRow| metric.distance(*row.metrics.get(place)?);
            findings.extend(finding(technique, &metric.column, pairs, &distance));
        }
    }
    let tests = findings.iter().filter(|f| f.p.is_some()).count().max(1) as f64;
    findings.iter_mut().for_each(|f| f.alarm = f.p.is_some_and(|p| p < SIGNIFICANCE / tests));
    findings
}

/// A technique as its integrator and parameters name it.
fn technique(cell: &Cell) -> String {
    let params: Vec<String> = cell.config.params.iter().map(|(key, value)| format!("{key}={value}")).collect();
    [vec![cell.config.integrator.clone()], params].concat().join(" ")
}

fn finding(
    technique: &str,
    measure: &str,
    pairs: &[[&WaveRow; 2]],
    value: &dyn Fn(&WaveRow) -> Option<f64>,
) -> Option<Finding> {
    let positive = |row: &WaveRow| value(row).filter(|x| *x > 0.0 && x.is_finite());
    let logs = pairs.iter().filter_map(|[a, b]| Some((positive(b)? / positive(a)?).ln()));
    let logs: Vec<f64> = logs.collect();
    let n = logs.len() as f64;
    let mean = logs.iter().sum::<f64>() / n;
    let spread = (logs.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
    let several = logs.len() > 1;
    let t = several.then(|| two_sided_t(0.05, n - 1.0));
    // Pairs that do not vary are a clock or a seed that is shared: a difference is then no chance at all.
    let p = || {
        if spread > 0.0 { two_sided_p(mean / (spread / n.sqrt()), n - 1.0) } else { f64::from(u8::from(mean == 0.0)) }
    };
    (!logs.is_empty()).then(|| Finding {
        technique: technique.to_owned(),
        measure: measure.to_owned(),
        ratio: mean.exp(),
        interval: t.map(|t| [-1.0, 1.0].map(|sign| (mean + sign * t * spread / n.sqrt()).exp())),
        p: several.then(p),
        single: t.map(|t| (t * spread).exp()),
        pairs: logs.len(),
        alarm: false,
    })
}
