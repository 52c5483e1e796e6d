//! The chart pane: a metric of the current cell over render time or samples, on log axes.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::{Color, Style};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;
use ratatui::widgets::canvas::{Canvas, Context, Line as Stroke, Points};

use super::{framed, pane};
use crate::tui::axis::{AxisScale, ChartAxis};
use crate::tui::format;
use crate::tui::model::curve::Curve;
use crate::tui::model::night::{CurrentRun, NightModel};
use crate::tui::modes::ChartX;
use crate::tui::terminal::terminal_caps::TerminalCaps;
use crate::tui::view::View;
use lumbre_metrics::{Better, MetricSpec};
use lumbre_night::experiment::{CellRef, StopRule, WaveRow};

/// Draws the chart pane.
pub fn draw(frame: &mut Frame, area: Rect, model: &NightModel, view: &View) {
    let caps = view.caps;
    let metrics = model.metrics();
    let spec = metrics.get(view.metric);
    let current = model.current.as_ref();
    if let Some(reference) = current.filter(|c| matches!(c.cell, CellRef::Reference(_))) {
        return reference_noise(frame, area, reference, view);
    }
    let mut block = pane(caps, headline(spec, current, view, area.width));
    if metrics.len() > 1 {
        block = block.title_bottom(tabs(metrics, view, area.width));
    }
    if spec.is_some() && current.is_some() {
        let unit = Line::styled(format!(" over {} ", axis_unit(view.chart_x)), caps.dim());
        block = block.title_bottom(unit.right_aligned());
    }
    let inner = framed(frame, area, block);
    let (Some(spec), Some(current)) = (spec, current) else {
        let note = if spec.is_none() && model.planned().is_some() {
            "this plan has no metrics"
        } else {
            "nothing to plot yet"
        };
        frame.render_widget(Paragraph::new(note).style(caps.dim()), inner);
        return;
    };
    let points = points(&current.curve, view.chart_x, view.metric);
    if points.is_empty() {
        super::draw_note(frame, inner, caps, note(current));
        return;
    }
    let threshold = model
        .stop_rule(current.cell)
        .and_then(|rule| threshold(rule, &spec.column));
    let lines = Lines {
        current: ChartCurve {
            series: series(model, current.cell, current.cell),
            points,
        },
        others: other_curves(model, current, view),
        threshold,
        floor: model.noise_floor(view.metric),
    };
    plot(frame, inner, caps, spec.row.better, &lines);
}

/// Draws the noise of a reference that renders: what the errors of its cells cannot fall below.
fn reference_noise(frame: &mut Frame, area: Rect, run: &CurrentRun, view: &View) {
    let caps = view.caps;
    let mut title = vec![Span::styled(" Noise of the reference ", caps.strong())];
    if let Some(noise) = run.noise.last().and_then(|row| row.metrics.first()) {
        let value = format!("{} of its mean ", format::number(*noise));
        title.push(Span::styled(value, caps.accent()));
        if let Some(slope) = run.noise.slope(0, |row| x_of(row, view.chart_x)) {
            title.push(Span::styled(format!(" slope {slope:.2} "), caps.strong()));
        }
    }
    let unit = Line::styled(format!(" over {} ", axis_unit(view.chart_x)), caps.dim());
    let block = pane(caps, Line::from(title)).title_bottom(unit.right_aligned());
    let inner = framed(frame, area, block);
    let points = points(&run.noise, view.chart_x, 0);
    if points.is_empty() {
        let note = if view.watching {
            "This is a reference: cells are measured against it, so it has no error of its own. \
             Its noise is shown by the process that renders it."
        } else {
            "This is a reference: cells are measured against it, so it has no error of its own. \
             Its noise is estimated from its second sample on."
        };
        return super::draw_note(frame, inner, caps, note);
    }
    let lines = Lines {
        current: ChartCurve {
            series: None,
            points,
        },
        others: Vec::new(),
        threshold: None,
        floor: None,
    };
    plot(frame, inner, caps, Better::Lower, &lines);
}

/// Returns the curves of earlier and interleaved cells. They are drawn behind the current curve, so
/// that techniques can be compared while they render.
fn other_curves(model: &NightModel, current: &CurrentRun, view: &View) -> Vec<ChartCurve> {
    let past = model
        .past_curves
        .iter()
        .filter(|(cell, _)| *cell != current.cell)
        .map(|(cell, curve)| (*cell, curve.as_ref()));
    let interleaved = model
        .interleaved
        .iter()
        .map(|(cell, run)| (*cell, &run.curve));
    let others = past.chain(interleaved);
    let mut curves: Vec<ChartCurve> = others
        .map(|(cell, curve)| ChartCurve {
            series: series(model, current.cell, cell),
            points: points(curve, view.chart_x, view.metric),
        })
        .collect();
    // Curves that are not compared are drawn first, behind the others.
    curves.sort_by_key(|curve| curve.series.is_some());
    curves
}

/// Returns index and name of the series of a cell, if it is compared with the current one.
fn series(model: &NightModel, current: CellRef, cell: CellRef) -> Option<(usize, String)> {
    let (CellRef::Cell(current), CellRef::Cell(cell)) = (current, cell) else {
        return None;
    };
    let comparison = model.comparison.as_ref()?;
    if !comparison.are_comparable(&model.columns, current, cell) {
        return None;
    }
    let (index, name) = comparison.series(&model.columns, cell)?;
    Some((index, name.to_owned()))
}

/// One curve of the chart.
pub(crate) struct ChartCurve {
    /// Index and name of its series, if it is compared with the current cell.
    pub series: Option<(usize, String)>,
    /// Positive horizontal coordinates with values.
    pub points: Vec<(f64, f64)>,
}

impl ChartCurve {
    /// Returns the colour of the curve; `None` without colours.
    fn colour(&self, caps: TerminalCaps) -> Option<Color> {
        match &self.series {
            Some((index, _)) => caps.series(*index),
            None => caps.behind(),
        }
    }
}

/// Curves and lines of the chart.
pub(crate) struct Lines {
    /// Curve of the current cell.
    pub current: ChartCurve,
    /// Curves of earlier and interleaved cells.
    pub others: Vec<ChartCurve>,
    /// Value at which the stop rule is met.
    pub threshold: Option<f64>,
    /// Noise floor of the reference.
    pub floor: Option<f64>,
}

/// Explains why there is no curve.
fn note(current: &CurrentRun) -> &'static str {
    let measured = current.curve.rows().any(|row| !row.metrics.is_empty());
    if current.reference.is_none() && !measured {
        "This cell has no reference, so there is no error to show."
    } else {
        "There is no measurement to plot yet."
    }
}

/// Formats the metric, its newest value, and the slope of its error.
fn headline(
    spec: Option<&MetricSpec>,
    current: Option<&CurrentRun>,
    view: &View,
    width: u16,
) -> Line<'static> {
    let caps = view.caps;
    let Some(spec) = spec else {
        return Line::styled(" Error ", caps.strong());
    };
    let mut spans = vec![Span::styled(format!(" {} ", spec.column), caps.strong())];
    let mut room = usize::from(width).saturating_sub(format::width(&spec.column) + 6);
    let mut add = |text: String, style: Style| {
        if format::width(&text) <= room {
            room -= format::width(&text);
            spans.push(Span::styled(text, style));
        }
    };
    if let Some(current) = current {
        if let Some(value) = current
            .curve
            .last()
            .and_then(|row| row.metrics.get(view.metric))
        {
            add(format!("{} ", format::number(*value)), caps.accent());
            if !spec.unit().is_empty() {
                add(format!("{} ", spec.unit()), caps.dim());
            }
        }
        if spec.row.better == Better::Lower
            && let Some(slope) = current
                .curve
                .slope(view.metric, |row| x_of(row, view.chart_x))
        {
            add(format!(" slope {slope:.2} "), caps.strong());
        }
    }
    if spec.row.long_name != spec.column {
        add(format!(" {} ", spec.row.long_name), caps.dim());
    }
    Line::from(spans)
}

/// Formats the number keys of the metrics, as many as fit.
fn tabs(metrics: &[MetricSpec], view: &View, width: u16) -> Line<'static> {
    let mut line = Line::from(" ");
    for (i, spec) in metrics.iter().take(9).enumerate() {
        let text = format!("{} {} ", i + 1, spec.column);
        // The unit of the horizontal axis is written at the end of this line.
        if line.width() + format::width(&text) + axis_unit(view.chart_x).len() + 12
            > usize::from(width)
        {
            break;
        }
        line.push_span(Span::styled(
            text,
            if i == view.metric {
                view.caps.accent()
            } else {
                view.caps.dim()
            },
        ));
    }
    line
}

/// Returns quantity and unit of the horizontal axis.
pub(crate) fn axis_unit(axis: ChartX) -> &'static str {
    match axis {
        ChartX::RenderS => "render time, s",
        ChartX::Samples => "samples, spp",
    }
}

/// Horizontal coordinate of a measurement.
pub(crate) fn x_of(row: &WaveRow, axis: ChartX) -> f64 {
    match axis {
        ChartX::RenderS => row.render_s,
        ChartX::Samples => row.samples as f64,
    }
}

/// Returns the finite points of a metric with a positive horizontal coordinate.
pub(crate) fn points(curve: &Curve, axis: ChartX, metric: usize) -> Vec<(f64, f64)> {
    let point = |row: &WaveRow| {
        let (x, y) = (x_of(row, axis), *row.metrics.get(metric)?);
        (x > 0.0 && x.is_finite() && y.is_finite()).then_some((x, y))
    };
    curve.rows().filter_map(point).collect()
}

/// Returns the value of `column` at which the rule, or a part of it, is met.
fn threshold(rule: &StopRule, column: &str) -> Option<f64> {
    match rule {
        StopRule::When {
            column: c, value, ..
        } => (c == column && value.is_finite()).then_some(*value),
        StopRule::Any(rules) | StopRule::All(rules) => {
            rules.iter().find_map(|r| threshold(r, column))
        }
        StopRule::Not(rule) => threshold(rule, column),
        _ => None,
    }
}

/// Draws axes, threshold, noise floor and curves.
pub(crate) fn plot(
    frame: &mut Frame,
    area: Rect,
    caps: TerminalCaps,
    better: Better,
    lines: &Lines,
) {
    let points = &lines.current.points[..];
    if area.width < 16 || area.height < 4 {
        return;
    }
    // Errors follow power laws. A quality such as SSIM or PSNR does not, and may be <= 0.
    let log_y = better == Better::Lower && points.iter().any(|p| p.1 > 0.0);
    let scale_y = if log_y {
        AxisScale::Log
    } else {
        AxisScale::Linear
    };
    let threshold = lines.threshold.filter(|t| near(*t, points, scale_y));
    let floor = lines.floor.filter(|f| near(*f, points, scale_y));
    let all = || {
        let others = lines.others.iter().flat_map(|curve| &curve.points);
        points.iter().chain(others)
    };
    let values = all().map(|p| p.1).chain(threshold).chain(floor);
    let y = ChartAxis::covering(values, scale_y, usize::from(area.height - 2) / 2);
    let x = ChartAxis::covering(
        all().map(|p| p.0),
        AxisScale::Log,
        usize::from(area.width) / 10,
    );
    let gutter = y
        .ticks
        .iter()
        .map(|tick| tick.label.len())
        .max()
        .unwrap_or(0) as u16;
    let plot = Rect {
        x: area.x + gutter + 1,
        y: area.y,
        width: area.width.saturating_sub(gutter + 2),
        height: area.height - 2,
    };
    axes(frame, area, plot, caps, &x, &y);
    if let Some(share) = threshold.and_then(|t| y.position(t)) {
        horizontal_line(frame, plot, share, caps, caps.warn());
    }
    if let Some(share) = floor.and_then(|f| y.position(f)) {
        horizontal_line(frame, plot, share, caps, caps.dim());
        let label = " reference noise floor ";
        if usize::from(plot.width) > label.len() + 8 {
            let row = row_at(plot, share);
            frame
                .buffer_mut()
                .set_string(plot.x + 2, row, label, caps.dim());
        }
    }
    curves(frame, plot, caps, lines, &x, &y);
}

/// Draws a line across the plot at a fraction of its height from below.
fn horizontal_line(frame: &mut Frame, plot: Rect, share: f64, caps: TerminalCaps, style: Style) {
    let line = caps.glyphs().threshold.repeat(usize::from(plot.width));
    frame
        .buffer_mut()
        .set_string(plot.x, row_at(plot, share), line, style);
}

/// Draws the current curve in front of the earlier and interleaved ones.
fn curves(
    frame: &mut Frame,
    plot: Rect,
    caps: TerminalCaps,
    lines: &Lines,
    x: &ChartAxis,
    y: &ChartAxis,
) {
    let placed = |points: &[(f64, f64)]| -> Vec<(f64, f64)> {
        points
            .iter()
            .filter_map(|p| Some((x.position(p.0)?, y.position(p.1)?)))
            .collect()
    };
    let current = &lines.current;
    let ink = current.colour(caps).filter(|_| current.series.is_some());
    let ink = ink.or(caps.glow().fg).unwrap_or(Color::Reset);
    let mut drawn = vec![(current, placed(&current.points), ink)];
    // Without colours the other curves could not be distinguished.
    drawn.extend(lines.others.iter().filter_map(|curve| {
        let colour = curve.colour(caps)?;
        Some((curve, placed(&curve.points), colour))
    }));
    let canvas = Canvas::default()
        .marker(if caps.ascii {
            Marker::Custom('*')
        } else {
            Marker::Braille
        })
        .x_bounds([0.0, 1.0])
        .y_bounds([0.0, 1.0])
        .paint(|ctx| {
            for (_, dots, colour) in drawn[1..].iter().chain(&drawn[..1]) {
                polyline(ctx, dots, *colour);
            }
        });
    frame.render_widget(canvas, plot);
    // A single series needs no name.
    let series = |curve: &ChartCurve| curve.series.as_ref().map(|(index, _)| *index);
    let first = series(current);
    let is_other = |curve: &ChartCurve| series(curve).is_some() && series(curve) != first;
    if drawn.iter().any(|(curve, ..)| is_other(curve)) {
        series_names(frame, plot, caps, &drawn);
    }
}

/// A curve with its points, as fractions of the plot, and its colour.
type DrawnCurve<'a> = (&'a ChartCurve, Vec<(f64, f64)>, Color);

/// Writes the name of each series once, beside the end of one of its curves.
fn series_names(frame: &mut Frame, plot: Rect, caps: TerminalCaps, curves: &[DrawnCurve<'_>]) {
    let mut named: Vec<usize> = Vec::new();
    let mut taken: Vec<u16> = Vec::new();
    for (curve, dots, _) in curves {
        let (Some((index, name)), Some(end)) = (&curve.series, dots.last()) else {
            continue;
        };
        let width = format::width(name) as u16;
        if named.contains(index) || width + 2 > plot.width {
            continue;
        }
        let wanted = row_at(plot, end.1);
        let below = (wanted..plot.bottom()).find(|row| !taken.contains(row));
        let above = || (plot.top()..wanted).rev().find(|row| !taken.contains(row));
        let Some(row) = below.or_else(above) else {
            continue;
        };
        let column = plot.x + (end.0 * f64::from(plot.width)) as u16 + 1;
        let column = column.min(plot.right() - width);
        let style = caps
            .series(*index)
            .map_or(Style::new(), |c| Style::new().fg(c));
        frame.buffer_mut().set_string(column, row, name, style);
        named.push(*index);
        taken.push(row);
    }
}

/// Draws points and the lines between them.
fn polyline(ctx: &mut Context<'_>, dots: &[(f64, f64)], color: Color) {
    ctx.draw(&Points {
        coords: dots,
        color,
    });
    for pair in dots.windows(2) {
        ctx.draw(&Stroke {
            x1: pair[0].0,
            y1: pair[0].1,
            x2: pair[1].0,
            y2: pair[1].1,
            color,
        });
    }
}

/// Whether a threshold is close enough to the curve to share a chart with it: within two decades,
/// or within twice the height of the curve on a linear axis.
fn near(threshold: f64, points: &[(f64, f64)], scale: AxisScale) -> bool {
    let position = |y: f64| {
        if scale == AxisScale::Log {
            y.log10()
        } else {
            y
        }
    };
    let ys = points
        .iter()
        .map(|p| position(p.1))
        .filter(|y| y.is_finite());
    let (low, high) = ys.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), y| {
        (l.min(y), h.max(y))
    });
    let reach = if scale == AxisScale::Log {
        2.0
    } else {
        2.0 * (high - low)
    };
    (low - reach..=high + reach).contains(&position(threshold))
}

/// Character row at a fraction of the plot's height from below.
fn row_at(plot: Rect, share: f64) -> u16 {
    let from_top = (1.0 - share) * f64::from(plot.height);
    plot.y + (from_top as u16).min(plot.height.saturating_sub(1))
}

/// Draws axes, grid lines, ticks and labels.
fn axes(
    frame: &mut Frame,
    area: Rect,
    plot: Rect,
    caps: TerminalCaps,
    x: &ChartAxis,
    y: &ChartAxis,
) {
    let glyphs = caps.glyphs();
    let buffer = frame.buffer_mut();
    let (axis_column, axis_row) = (plot.x - 1, plot.bottom());
    for row in plot.top()..plot.bottom() {
        buffer.set_string(axis_column, row, glyphs.axis_y[0], caps.dim());
    }
    buffer.set_string(axis_column, axis_row, glyphs.axis_x[2], caps.dim());
    buffer.set_string(
        plot.x,
        axis_row,
        glyphs.axis_x[0].repeat(usize::from(plot.width)),
        caps.dim(),
    );
    for tick in &y.ticks {
        let Some(share) = y.position(tick.value) else {
            continue;
        };
        let row = row_at(plot, share);
        buffer.set_string(
            plot.x,
            row,
            glyphs.grid.repeat(usize::from(plot.width)),
            caps.dim(),
        );
        buffer.set_string(axis_column, row, glyphs.axis_y[1], caps.dim());
        let label = &tick.label;
        let at = axis_column.saturating_sub(label.len() as u16).max(area.x);
        buffer.set_string(at, row, label, Style::new());
    }
    let mut free_from = area.x;
    for tick in &x.ticks {
        let Some(share) = x.position(tick.value) else {
            continue;
        };
        let column =
            plot.x + ((share * f64::from(plot.width)) as u16).min(plot.width.saturating_sub(1));
        buffer.set_string(column, axis_row, glyphs.axis_x[1], caps.dim());
        let length = tick.label.len() as u16;
        let at = column
            .saturating_sub(length / 2)
            .min(area.right().saturating_sub(length));
        if at >= free_from && at + length <= area.right() {
            buffer.set_string(at, axis_row + 1, &tick.label, Style::new());
            free_from = at + length + 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumbre_night::experiment::stop::Comparison;

    #[test]
    fn a_threshold_is_that_of_the_metric() {
        let when = |column: &str, value: f64| StopRule::When {
            column: column.to_owned(),
            op: Comparison::Less,
            value,
            hold: 1,
        };
        let rule = StopRule::Any(vec![when("rmse", 0.01), when("flip", 0.2)]);
        assert_eq!(threshold(&rule, "rmse"), Some(0.01));
        assert_eq!(threshold(&rule, "flip"), Some(0.2));
        assert_eq!(threshold(&rule, "ssim"), None);
    }
}
