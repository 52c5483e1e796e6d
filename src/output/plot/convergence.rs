//! Figures of metrics against render time or samples.

use super::axis::Scale;
use super::style::style;
use super::{Figure, FigureData, HorizontalAxis, MetricPanel, PlotCurve, metric_panel, subtitle};
use crate::experiment::WaveRow;
use crate::experiment::plan::Plan;
use crate::experiment::spec::FigureX;
use crate::metrics::MetricSpec;
use crate::output::format;
use crate::output::report::metric_display::MetricDisplay;
use crate::output::report::repeats::{Band, BandKind, MetricCurve, band};

/// Builds the figure of the metric columns `y`, and its data as CSV.
pub(super) fn figure(data: &FigureData, x: FigureX, y: &[String]) -> (Figure, String) {
    let groups = repeat_groups(data);
    let panels = y.iter().filter_map(|column| {
        let (index, metric) = format::column(data.plan, column)?;
        let curves = groups.iter().map(|(style_index, cells)| {
            let is_shared = groups.iter().filter(|(s, _)| s == style_index).count() > 1;
            PlotCurve {
                style: style(*style_index),
                shared: is_shared,
                ..curve(data, cells, x, index, metric)
            }
        });
        Some(metric_panel(column, metric, curves.collect()))
    });
    let x_label = match x {
        FigureX::RenderS => "render time (s)",
        FigureX::Samples => "samples per pixel",
    };
    let figure = data.figure(
        panels.collect(),
        subtitle(&groups),
        x_label.to_owned(),
        HorizontalAxis::Numbers(Scale::Log),
    );
    let text = csv(data.plan, &figure.panels);
    (figure, text)
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

/// Builds the curve of a group of repeats: their mean and its band, or the measurements of a single
/// run.
fn curve(
    data: &FigureData,
    cells: &[usize],
    x: FigureX,
    index: usize,
    metric: &MetricSpec,
) -> PlotCurve {
    let band = if cells.len() > 1 {
        repeats_band(data, cells, x, index, metric)
    } else {
        None
    };
    let (points, ends, kind) = match band {
        Some(band) => (band.mean, band.ends, band.kind),
        None => {
            let display = MetricDisplay::for_metric(metric);
            let rows = data.rows(cells[0]).iter();
            let points = rows.filter_map(|row| {
                let value = display.drawn_value(*row.metrics.get(index)?)?;
                Some((x_value(x, row), value))
            });
            let points = points.filter(|(x, _)| Scale::Log.accepts(*x)).collect();
            (points, Vec::new(), BandKind::Single)
        }
    };
    PlotCurve {
        style: style(0),
        shared: false,
        points,
        ends,
        kind,
        cell: cells[0],
        runs: cells.len(),
    }
}

/// Computes mean and band of several repeats of one metric.
fn repeats_band(
    data: &FigureData,
    cells: &[usize],
    x: FigureX,
    index: usize,
    metric: &MetricSpec,
) -> Option<Band> {
    let curve = |cell: &usize| {
        let points = data
            .rows(*cell)
            .iter()
            .filter_map(|row| Some((x_value(x, row), *row.metrics.get(index)?)));
        MetricCurve::new(MetricDisplay::for_metric(metric), points)
    };
    band(&cells.iter().map(curve).collect::<Vec<_>>())
}

fn x_value(x: FigureX, row: &WaveRow) -> f64 {
    match x {
        FigureX::RenderS => row.render_s,
        FigureX::Samples => row.samples as f64,
    }
}

/// Writes the points of all panels as CSV.
fn csv(plan: &Plan, panels: &[MetricPanel]) -> String {
    let mut text = crate::text::csv_line(&super::csv_header(plan));
    for panel in panels {
        for curve in &panel.curves {
            for (index, (x, mean)) in curve.points.iter().enumerate() {
                let mut line = super::axis_fields(plan, curve.cell);
                let ends = curve
                    .ends
                    .get(index)
                    .filter(|_| curve.kind != BandKind::Single);
                let bound = |bound: Option<f64>| bound.map(format::exact).unwrap_or_default();
                line.extend([
                    panel.column.clone(),
                    format::exact(*x),
                    format::exact(*mean),
                    bound(ends.map(|e| e.0)),
                    bound(ends.map(|e| e.1)),
                    curve.runs.to_string(),
                ]);
                text += &crate::text::csv_line(&line);
            }
        }
    }
    text
}
