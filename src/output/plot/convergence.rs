//! Figures of metrics against render time or samples.

use super::axis::{Axis, Scale};
use super::figure::{Line, Panel};
use super::{
    FigureContent, FigureData, MetricPanel, mark_shared, metric_labels, set_axes, subtitle,
};
use crate::experiment::WaveRow;
use crate::experiment::plan::Plan;
use crate::experiment::spec::FigureX;
use crate::output::format;
use crate::output::metric_display::MetricDisplay;
use crate::output::quantity::is_finished;
use crate::output::repeats::{BandKind, MetricCurve, band};
use lumbre_metrics::MetricSpec;

/// Builds the figure of the metric columns `y`, and its data as CSV.
pub(super) fn figure(data: &FigureData, x: FigureX, y: &[String]) -> (FigureContent, String) {
    let groups = repeat_groups(data);
    let columns: Vec<(&String, usize, &MetricSpec)> = y
        .iter()
        .filter_map(|column| {
            let (index, metric) = format::column(data.plan, column)?;
            Some((column, index, metric))
        })
        .collect();
    let panel = |(column, index, metric): &(&String, usize, &MetricSpec)| {
        let [heading, y_label] = metric_labels(column, metric);
        let mut lines: Vec<Line> = groups
            .iter()
            .map(|(series, cells)| line(data, (*series, cells), x, *index, metric))
            .collect();
        mark_shared(&mut lines);
        MetricPanel {
            column: (*column).clone(),
            panel: Panel {
                heading,
                y_label,
                axes: None,
                lines,
                floor: None,
            },
            runs: groups
                .iter()
                .map(|(_, cells)| (cells[0], cells.len()))
                .collect(),
        }
    };
    let mut panels: Vec<MetricPanel> = columns.iter().map(panel).collect();
    let scale =
        |(_, _, metric): &(&String, usize, &MetricSpec)| MetricDisplay::for_metric(metric).scale;
    let scales: Vec<Scale> = columns.iter().map(scale).collect();
    set_axes(&mut panels, &scales, |values| {
        Axis::new(Scale::Log, values.iter().copied())
    });
    let x_label = x.row().label;
    let displays = columns.iter().map(|(_, _, m)| MetricDisplay::for_metric(m));
    let text = csv(data.plan, panels.iter().zip(displays));
    let content = FigureContent {
        notes: subtitle(&groups),
        x_label: x_label.to_owned(),
        panels,
    };
    (content, text)
}

/// Groups the cells that are repeats of one point, each group with its style index.
fn repeat_groups(data: &FigureData) -> Vec<(usize, Vec<usize>)> {
    let mut groups: Vec<(usize, Vec<usize>)> = Vec::new();
    for (cell, style_index) in data.cells {
        let point = &data.plan.cells[*cell].point;
        match groups
            .last_mut()
            .filter(|(_, group)| data.plan.cells[group[0]].point == *point)
        {
            Some((_, group)) => group.push(*cell),
            None => groups.push((*style_index, vec![*cell])),
        }
    }
    groups
}

/// Builds the line of a group of repeats of one metric.
fn line(
    data: &FigureData,
    (series, cells): (usize, &[usize]),
    x: FigureX,
    index: usize,
    metric: &MetricSpec,
) -> Line {
    let display = MetricDisplay::for_metric(metric);
    let curve = |cell: &usize| {
        let point = |row: &WaveRow| Some(((x.row().value)(row), *row.metrics.get(index)?));
        MetricCurve::new(display, data.rows(*cell).iter().filter_map(point))
    };
    let all = cells.iter().map(|cell| (cell, curve(cell)));
    let all: Vec<(&usize, MetricCurve)> = all.filter(|(_, c)| !c.points.is_empty()).collect();
    let finished =
        |(cell, _): &&(&usize, MetricCurve)| is_finished(data.plan, data.measured[*cell]);
    let stops = all.iter().filter(finished);
    let stops = stops.filter_map(|(_, curve)| curve.points.last().copied());
    let stops = stops.collect();
    let curves: Vec<MetricCurve> = all.into_iter().map(|(_, curve)| curve).collect();
    Line {
        series,
        band: band(&curves),
        curves,
        stops,
        floor: None,
        thin: false,
    }
}

/// Writes the points of all panels as CSV, in values of their metrics.
fn csv<'a>(plan: &Plan, panels: impl Iterator<Item = (&'a MetricPanel, MetricDisplay)>) -> String {
    let mut text = crate::text::csv_line(&super::csv_header(plan));
    for (panel, display) in panels {
        for (line, (cell, runs)) in panel.panel.lines.iter().zip(&panel.runs) {
            let band = line.band.as_ref().filter(|b| b.kind != BandKind::Single);
            for (index, (x, mean)) in line.points().iter().enumerate() {
                let mut fields = super::axis_fields(plan, *cell);
                let ends = band.and_then(|band| band.ends.get(index));
                let ends = ends.map(|ends| display.metric_ends(*ends));
                let bound = |bound: Option<f64>| bound.map(format::exact).unwrap_or_default();
                fields.extend([
                    panel.column.clone(),
                    format::exact(*x),
                    format::exact(display.metric_value(*mean)),
                    bound(ends.map(|e| e.0)),
                    bound(ends.map(|e| e.1)),
                    runs.to_string(),
                ]);
                text += &crate::text::csv_line(&fields);
            }
        }
    }
    text
}
