//! What finished runs have in the end: how each value of tables and of figures over an axis is read, named and described.

use super::labels;
use crate::experiment::plan::Plan;
use crate::experiment::spec::TableValue;
use crate::experiment::{CellResult, WaveRow};
use crate::metrics::{Better, MetricSpec};
use crate::render::OpenStats;

/// One run's contribution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sample {
    /// Its value.
    Value(f64),
    /// It did not reach a threshold in so many seconds.
    NeverIn(f64),
}

/// What one finished run contributes, if it has the value at all.
pub fn sample(plan: &Plan, value: &TableValue, result: &CellResult) -> Option<Sample> {
    let last = result.rows.last()?;
    Some(match value {
        TableValue::Metric(name) => Sample::Value(*last.metrics.get(labels::column(plan, name)?.0)?),
        TableValue::TimeTo { column, threshold } => {
            let (index, metric) = labels::column(plan, column)?;
            last.metrics.get(index)?;
            let reached = |row: &&WaveRow| match (row.metrics.get(index), metric.row.better) {
                (Some(x), Better::Lower) => x <= threshold,
                (Some(x), Better::Higher) => x >= threshold,
                (Some(x), Better::NearZero) => x.abs() <= *threshold,
                (None, _) => false,
            };
            let first = result.rows.iter().find(reached);
            first.map_or(Sample::NeverIn(last.render_s), |row| Sample::Value(row.render_s))
        }
        plain => Sample::Value(self::plain(plain, last, &result.open)?),
    })
}

/// A value that needs no metric, of a run with this last measurement; `None` for one that does, or is not known.
pub fn plain(value: &TableValue, last: &WaveRow, open: &OpenStats) -> Option<f64> {
    let known = |x: f64| (x > 0.0).then_some(x);
    match value {
        TableValue::Samples => Some(last.samples as f64),
        TableValue::RenderS => Some(last.render_s),
        TableValue::MpathsPerS => Some(last.mpaths_per_s()),
        TableValue::Fps => Some(last.fps()),
        TableValue::MraysPerS => (last.render_s > 0.0).then(|| last.rays as f64 / last.render_s / 1e6),
        TableValue::AccelBuildS => known(open.accel_build_s),
        TableValue::AccelNodes => known(open.accel_nodes as f64),
        TableValue::AccelMib => known(open.accel_bytes as f64 / f64::from(1 << 20)),
        TableValue::AccelCost => known(open.accel_cost),
        TableValue::Metric(_) | TableValue::TimeTo { .. } => None,
    }
}

/// What stands beside a value's numbers, with its unit.
pub fn label(plan: &Plan, value: &TableValue) -> String {
    match value {
        TableValue::Metric(column) => {
            let metric = labels::column(plan, column).map(|(_, m)| m);
            metric.map_or(column.clone(), |m| labels::with_unit(m.row.label, &m.unit()))
        }
        TableValue::TimeTo { .. } => "time to reach it (s)".to_owned(),
        plain => words(plain).0.to_owned(),
    }
}

/// What a value is, as the beginning of a sentence.
pub fn title(plan: &Plan, value: &TableValue) -> String {
    let described = |metric: &MetricSpec| {
        let options = metric.describe_options();
        let options = if options.is_empty() { String::new() } else { format!(" with {options}") };
        labels::metric_title(metric) + &options
    };
    match value {
        TableValue::Metric(column) => match labels::column(plan, column) {
            Some((_, m)) => {
                let unit = m.unit();
                let unit = if unit.is_empty() { String::new() } else { format!(" in {unit}") };
                format!("{}{unit} after the last wave", described(m))
            }
            None => format!("`{column}`, which is not measured"),
        },
        TableValue::TimeTo { column, threshold } => match labels::column(plan, column) {
            Some((_, m)) => {
                let sign = match m.row.better {
                    Better::Lower => "≤",
                    Better::Higher => "≥",
                    Better::NearZero => "of either sign ≤",
                };
                format!("Render time in seconds until a measurement first had {} {sign} {threshold}", described(m))
            }
            None => format!("Render time until `{column}`, which is not measured"),
        },
        plain => words(plain).1.to_owned(),
    }
}

/// Label and description of a value that needs no metric; empty for one that does.
pub fn words(value: &TableValue) -> (&'static str, &'static str) {
    match value {
        TableValue::Samples => ("samples per pixel", "Samples per pixel at the end"),
        TableValue::RenderS => ("render time (s)", "Render time at the end in seconds"),
        TableValue::MpathsPerS => ("Mpaths/s", "Million camera paths per second of render time"),
        TableValue::Fps => ("FPS (1/s)", "Frames per second of render time (a frame is one sample of every pixel)"),
        TableValue::MraysPerS => ("Mrays/s", "Million rays per second of render time"),
        TableValue::AccelBuildS => ("build (s)", "Seconds spent building the hierarchy"),
        TableValue::AccelNodes => ("nodes", "Nodes of the hierarchy"),
        TableValue::AccelMib => ("hierarchy (MiB)", "Mebibytes of the hierarchy with its primitives"),
        TableValue::AccelCost => {
            ("SAH cost", "Nodes and primitives that a ray through the scene's box meets, by the surface area heuristic")
        }
        TableValue::Metric(_) | TableValue::TimeTo { .. } => ("", ""),
    }
}
