//! The A/A check: a comparison of a technique with itself.
//!
//! A script that requests it (`x:control`) has some cells rendered a second time with other seeds,
//! in the same order and under the same rules as two techniques would be. Every difference between
//! the two is spurious. If it is larger than chance explains, comparisons of this night are not
//! fair: the machine slowed down, a clock includes time that it should not, or seeds are not
//! independent. Otherwise its size shows how large a difference between two techniques must be to
//! be meaningful.

use super::plan::{Cell, Plan};
use super::{Night, WaveRow};
use lumbre_light::math::t_test::{two_sided_p, two_sided_t};

/// Significance level of the check as a whole, divided among its findings by Bonferroni's method.
const SIGNIFICANCE: f64 = 0.01;

/// Result of one comparison of a technique with itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Integrator and its parameters.
    pub technique: String,
    /// Metric column, or `samples/s`.
    pub measure: String,
    /// Geometric mean over the pairs of the second run's value divided by the first's. Metrics
    /// enter by their [distance](lumbre_metrics::MetricSpec::distance) from the best value.
    pub ratio: f64,
    /// 95 % confidence interval of `ratio`, by Student's t on logarithms; `None` for a single pair.
    pub interval: Option<[f64; 2]>,
    /// Two-sided p-value of `ratio` being 1; `None` for a single pair.
    pub p: Option<f64>,
    /// Factor that the ratio of two single runs exceeds by chance in 1 of 20 pairs; `None` for a
    /// single pair.
    pub single: Option<f64>,
    /// Number of pairs of runs.
    pub pairs: usize,
    /// Whether the difference is significant, corrected for the number of findings.
    pub alarm: bool,
}

impl Finding {
    /// Describes the finding in one sentence.
    pub fn describe(&self) -> String {
        let percent = |factor: f64| format!("{:+.2} %", 100.0 * (factor - 1.0));
        let Finding {
            technique,
            measure,
            ratio,
            pairs,
            ..
        } = self;
        let difference = format!("{technique} against itself: {measure} {}", percent(*ratio));
        let (Some([low, high]), Some(p), Some(single)) = (self.interval, self.p, self.single)
        else {
            return format!("{difference} in one pair of runs, too few to judge by: add repeats");
        };
        let verdict = if self.alarm {
            "; MORE THAN CHANCE ALLOWS: comparisons of this night are not fair"
        } else {
            ""
        };
        format!(
            "{difference} (95 %: {} to {}, p = {p:.2}, {pairs} pairs); two single runs differ by \
             up to {:.1} % by chance{verdict}",
            percent(low),
            percent(high),
            100.0 * (single - 1.0)
        )
    }
}

/// Returns the findings of a night's A/A check, by technique in the order of the plan. Empty if the
/// plan has no check, or no pair of runs is finished.
pub fn check(plan: &Plan, night: &Night) -> Vec<Finding> {
    let last = |index: usize| -> Option<&WaveRow> {
        let run = night.runs.get(index).filter(|run| run.is_done());
        run?.rows.last()
    };
    let mut techniques: Vec<(String, Vec<[&WaveRow; 2]>)> = Vec::new();
    for (index, cell) in plan.cells.iter().enumerate() {
        let Some(repeat) = cell.double_of else {
            continue;
        };
        // A double comes after its original in the plan.
        let first = (0..index).rev().find(|i| {
            let other = &plan.cells[*i];
            other.double_of.is_none() && other.repeat == repeat && other.point == cell.point
        });
        let Some(pair) = first.and_then(|first| Some([last(first)?, last(index)?])) else {
            continue;
        };
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
        for (index, metric) in plan.measure.metrics.iter().enumerate() {
            let distance = |row: &WaveRow| metric.distance(*row.metrics.get(index)?);
            findings.extend(finding(technique, &metric.column, pairs, &distance));
        }
    }
    let tests = findings.iter().filter(|f| f.p.is_some()).count().max(1) as f64;
    findings
        .iter_mut()
        .for_each(|f| f.alarm = f.p.is_some_and(|p| p < SIGNIFICANCE / tests));
    findings
}

/// Name of a technique: its integrator and parameters.
fn technique(cell: &Cell) -> String {
    let params: Vec<String> = cell
        .config
        .params
        .iter()
        .map(|(key, value)| format!("{key}={value}"))
        .collect();
    [vec![cell.config.integrator.clone()], params]
        .concat()
        .join(" ")
}

/// Compares the pairs by one quantity. Returns `None` if it is positive in no pair.
fn finding(
    technique: &str,
    measure: &str,
    pairs: &[[&WaveRow; 2]],
    value: &dyn Fn(&WaveRow) -> Option<f64>,
) -> Option<Finding> {
    let positive = |row: &WaveRow| value(row).filter(|x| *x > 0.0 && x.is_finite());
    let logs = pairs
        .iter()
        .filter_map(|[a, b]| Some((positive(b)? / positive(a)?).ln()));
    let logs: Vec<f64> = logs.collect();
    let n = logs.len() as f64;
    let mean = logs.iter().sum::<f64>() / n;
    let spread = (logs.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
    let several = logs.len() > 1;
    let t = several.then(|| two_sided_t(0.05, n - 1.0));
    // Without any variation between pairs (a clock or seed is shared), any difference is
    // significant.
    let p = || {
        if spread > 0.0 {
            two_sided_p(mean / (spread / n.sqrt()), n - 1.0)
        } else {
            f64::from(u8::from(mean == 0.0))
        }
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
