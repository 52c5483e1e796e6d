//! Final values of finished runs, as shown in tables and in figures over an axis: how each is
//! computed, named and described.

use super::format;
use crate::experiment::plan::Plan;
use crate::experiment::spec::TableValue;
use crate::experiment::{CellResult, WaveRow};
use crate::metrics::Better;
use lumbre_render::OpenStats;

/// Value of one run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RunValue {
    /// The value itself.
    Exact(f64),
    /// Lower bound of the value: the run ended after this many seconds without reaching the
    /// threshold.
    LowerBound(f64),
}

/// Returns the value of one finished run, or `None` if the run has no such value.
pub fn run_value(plan: &Plan, value: &TableValue, result: &CellResult) -> Option<RunValue> {
    let last = result.rows.last()?;
    Some(match value {
        TableValue::Metric(name) => {
            RunValue::Exact(*last.metrics.get(format::column(plan, name)?.0)?)
        }
        TableValue::TimeTo { column, threshold } => {
            let (index, metric) = format::column(plan, column)?;
            last.metrics.get(index)?;
            let reached = |row: &&WaveRow| {
                let value = row.metrics.get(index);
                value.is_some_and(|x| reaches(metric.row.better, *x, *threshold))
            };
            let first = result.rows.iter().find(reached);
            first.map_or(RunValue::LowerBound(last.render_s), |row| {
                RunValue::Exact(row.render_s)
            })
        }
        plain => RunValue::Exact(metric_free_value(plain, last, &result.open)?),
    })
}

/// Returns whether a metric value is at least as good as a threshold.
pub fn reaches(better: Better, value: f64, threshold: f64) -> bool {
    match better {
        Better::Lower => value <= threshold,
        Better::Higher => value >= threshold,
        Better::NearZero => value.abs() <= threshold,
    }
}

/// Returns the comparison sign of a threshold, such as `≤`.
pub fn threshold_sign(better: Better) -> &'static str {
    match better {
        Better::Lower => "≤",
        Better::Higher => "≥",
        Better::NearZero => "of either sign ≤",
    }
}

/// Returns a value that needs no metric, for a run with this last measurement. Returns `None` for
/// metric values and for unknown values.
pub fn metric_free_value(value: &TableValue, last: &WaveRow, open: &OpenStats) -> Option<f64> {
    let known = |x: f64| (x > 0.0).then_some(x);
    match value {
        TableValue::Samples => Some(last.samples as f64),
        TableValue::RenderS => Some(last.render_s),
        TableValue::MpathsPerS => Some(last.mpaths_per_s()),
        TableValue::Fps => Some(last.fps()),
        TableValue::MraysPerS => {
            (last.render_s > 0.0).then(|| last.rays as f64 / last.render_s / 1e6)
        }
        TableValue::AccelBuildS => known(open.accel_build_s),
        TableValue::AccelNodes => known(open.accel_nodes as f64),
        TableValue::AccelMib => known(open.accel_bytes as f64 / f64::from(1 << 20)),
        TableValue::AccelCost => known(open.accel_cost),
        TableValue::Metric(_) | TableValue::TimeTo { .. } => None,
    }
}

/// Returns the axis label of a value, with its unit.
pub fn label(plan: &Plan, value: &TableValue) -> String {
    match value {
        TableValue::Metric(column) => {
            let metric = format::column(plan, column).map(|(_, m)| m);
            metric.map_or(column.clone(), |m| {
                format::with_unit(m.row.label, &m.unit())
            })
        }
        TableValue::TimeTo { .. } => "time to threshold (s)".to_owned(),
        plain => label_and_description(plain).0.to_owned(),
    }
}

/// Returns the description of a value, as the beginning of a sentence.
pub fn title(plan: &Plan, value: &TableValue) -> String {
    match value {
        TableValue::Metric(column) => match format::column(plan, column) {
            Some((_, m)) => {
                let unit = m.unit();
                let unit = if unit.is_empty() {
                    String::new()
                } else {
                    format!(" in {unit}")
                };
                format!(
                    "{}{unit} after the last wave",
                    format::metric_description(m)
                )
            }
            None => format!("`{column}` (not measured)"),
        },
        TableValue::TimeTo { column, threshold } => match format::column(plan, column) {
            Some((_, m)) => {
                let sign = threshold_sign(m.row.better);
                format!(
                    "Render time in seconds until the first measurement with {} {sign} {threshold}",
                    format::metric_description(m)
                )
            }
            None => format!("Render time until `{column}` (not measured)"),
        },
        plain => label_and_description(plain).1.to_owned(),
    }
}

/// Returns label and description of a value that needs no metric. Both are empty for metric values.
pub fn label_and_description(value: &TableValue) -> (&'static str, &'static str) {
    match value {
        TableValue::Samples => ("samples per pixel", "Samples per pixel at the end"),
        TableValue::RenderS => ("render time (s)", "Render time at the end in seconds"),
        TableValue::MpathsPerS => ("Mpaths/s", "Million camera paths per second of render time"),
        TableValue::Fps => (
            "FPS (1/s)",
            "Frames per second of render time (a frame is one sample of every pixel)",
        ),
        TableValue::MraysPerS => ("Mrays/s", "Million rays per second of render time"),
        TableValue::AccelBuildS => (
            "build (s)",
            "Build time of the acceleration structure in seconds",
        ),
        TableValue::AccelNodes => ("nodes", "Number of nodes of the acceleration structure"),
        TableValue::AccelMib => (
            "acceleration structure (MiB)",
            "Size of the acceleration structure in MiB, including its primitives",
        ),
        TableValue::AccelCost => (
            "SAH cost",
            "Expected number of nodes and primitives tested by a ray through the scene's \
             bounding box (surface area heuristic)",
        ),
        TableValue::Metric(_) | TableValue::TimeTo { .. } => ("", ""),
    }
}
