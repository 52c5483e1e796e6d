//! The error chart: a metric of the current cell over render time or samples, on logarithmic axes.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::{Color, Style};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;
use ratatui::widgets::canvas::{Canvas, Line as Stroke, Points};

use super::pane;
use crate::experiment::{CellRef, StopRule, WaveRow};
use crate::metrics::{Better, MetricSpec};
use crate::tui::axis::{Axis, Scale};
use crate::tui::curve::Curve;
use crate::tui::look::Look;
use crate::tui::model::{Current, Model};
use crate::tui::view::{ChartX, View};
use crate::tui::words;

/// Draws the pane.
pub fn draw(frame: &mut Frame, area: Rect, model: &Model, view: &View) {
    let look = view.look;
    let metrics = model.plan.as_ref().map_or(&[][..], |plan| &plan.metrics[..]);
    let spec = metrics.get(view.metric);
    let current = model.current.as_ref();
    let mut block = pane(look, headline(spec, current, view, area.width));
    if metrics.len() > 1 {
        block = block.title_bottom(tabs(metrics, view, area.width));
    }
    if spec.is_some() && current.is_some() {
        let unit = Line::styled(format!(" over {} ", unit_of(view.chart_x)), look.dim());
        block = block.title_bottom(unit.right_aligned());
    }
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let (Some(spec), Some(current)) = (spec, current) else {
        let note =
            if spec.is_none() && model.plan.is_some() { "the plan measures nothing" } else { "nothing to plot yet" };
        frame.render_widget(Paragraph::new(note).style(look.dim()), inner);
        return;
    };
    let points = points(&current.curve, view);
    if points.is_empty() {
        let width = usize::from(inner.width);
        let lines: Vec<Line> = words::wrap(note(current), width).into_iter().map(Line::from).collect();
        frame.render_widget(Paragraph::new(lines).style(look.dim()), inner);
        return;
    }
    let threshold = model.stop_rule(current.cell).and_then(|rule| threshold(rule, &spec.column));
    // The cells before, and those that take turns with this one, stand behind, so that techniques can be compared while they render.
    let past = model.past.iter().filter(|(cell, _)| *cell != current.cell);
    let rivals = model.rivals.values().map(|rival| &rival.curve);
    let others = past.map(|(_, curve)| curve.as_ref()).chain(rivals);
    let past: Vec<Vec<(f64, f64)>> = others.map(|curve| self::points(curve, view)).collect();
    plot(frame, inner, look, spec, &Lines { points, past, threshold, floor: model.floor_of(view.metric) });
}

/// What a chart shows.
struct Lines {
    /// The current cell.
    points: Vec<(f64, f64)>,
    /// The cells before it.
    past: Vec<Vec<(f64, f64)>>,
    /// Where the stop rule holds.
    threshold: Option<f64>,
    /// Where only the noise of the reference is measured.
    floor: Option<f64>,
}

/// Why there is no curve.
fn note(current: &Current) -> &'static str {
    match current.cell {
        CellRef::Reference(_) => "This is a reference: cells are measured against it, so it has no error of its own.",
        CellRef::Cell(_) if current.reference.is_none() && current.curve.rows().all(|r| r.metrics.is_empty()) => {
            "This cell has no reference, so there is no error to show."
        }
        CellRef::Cell(_) => "No measurement can be plotted yet.",
    }
}

/// The metric, its newest value, and how it falls.
fn headline(spec: Option<&MetricSpec>, current: Option<&Current>, view: &View, width: u16) -> Line<'static> {
    let look = view.look;
    let Some(spec) = spec else { return Line::styled(" Error ", look.strong()) };
    let mut spans = vec![Span::styled(format!(" {} ", spec.column), look.strong())];
    let mut room = usize::from(width).saturating_sub(words::width(&spec.column) + 6);
    let mut add = |text: String, style: Style| {
        if words::width(&text) <= room {
            room -= words::width(&text);
            spans.push(Span::styled(text, style));
        }
    };
    if let Some(current) = current {
        if let Some(value) = current.curve.last().and_then(|row| row.metrics.get(view.metric)) {
            add(format!("{} ", words::number(*value)), look.accent());
            if !spec.unit().is_empty() {
                add(format!("{} ", spec.unit()), look.dim());
            }
        }
        if spec.row.better == Better::Lower
            && let Some(slope) = current.curve.slope(view.metric, |row| x_of(row, view.chart_x))
        {
            add(format!(" slope {slope:.2} "), look.strong());
        }
    }
    if spec.row.long_name != spec.column {
        add(format!(" {} ", spec.row.long_name), look.dim());
    }
    Line::from(spans)
}

/// The keys of the metrics, as many as fit.
fn tabs(metrics: &[MetricSpec], view: &View, width: u16) -> Line<'static> {
    let mut line = Line::from(" ");
    for (i, spec) in metrics.iter().take(9).enumerate() {
        let text = format!("{} {} ", i + 1, spec.column);
        // The unit of the other axis stands at the end of the line.
        if line.width() + words::width(&text) + unit_of(view.chart_x).len() + 12 > usize::from(width) {
            break;
        }
        line.push_span(Span::styled(text, if i == view.metric { view.look.accent() } else { view.look.dim() }));
    }
    line
}

fn unit_of(axis: ChartX) -> &'static str {
    match axis {
        ChartX::RenderS => "render time, s",
        ChartX::Samples => "samples, spp",
    }
}

fn x_of(row: &WaveRow, axis: ChartX) -> f64 {
    match axis {
        ChartX::RenderS => row.render_s,
        ChartX::Samples => row.samples as f64,
    }
}

/// Finite points with a positive place on the horizontal axis.
fn points(curve: &Curve, view: &View) -> Vec<(f64, f64)> {
    let point = |row: &WaveRow| {
        let (x, y) = (x_of(row, view.chart_x), *row.metrics.get(view.metric)?);
        (x > 0.0 && x.is_finite() && y.is_finite()).then_some((x, y))
    };
    curve.rows().filter_map(point).collect()
}

/// The value of `column` at which the rule, or a part of it, holds.
fn threshold(rule: &StopRule, column: &str) -> Option<f64> {
    match rule {
        StopRule::When { column: c, value, .. } => (c == column && value.is_finite()).then_some(*value),
        StopRule::Any(rules) | StopRule::All(rules) => rules.iter().find_map(|r| threshold(r, column)),
        StopRule::Not(rule) => threshold(rule, column),
        _ => None,
    }
}

fn plot(frame: &mut Frame, area: Rect, look: Look, spec: &MetricSpec, lines: &Lines) {
    let points = &lines.points[..];
    if area.width < 16 || area.height < 4 {
        return;
    }
    // Errors fall by powers; a quality such as SSIM or PSNR does not, and may be zero or negative.
    let log_y = spec.row.better == Better::Lower && points.iter().any(|p| p.1 > 0.0);
    let scale_y = if log_y { Scale::Log } else { Scale::Linear };
    let threshold = lines.threshold.filter(|t| near(*t, points, scale_y));
    let floor = lines.floor.filter(|f| near(*f, points, scale_y));
    let all = || points.iter().chain(lines.past.iter().flatten());
    let values = all().map(|p| p.1).chain(threshold).chain(floor);
    let y = Axis::around(values, scale_y, usize::from(area.height - 2) / 2);
    let x = Axis::around(all().map(|p| p.0), Scale::Log, usize::from(area.width) / 10);
    let gutter = y.ticks.iter().map(|tick| tick.label.len()).max().unwrap_or(0) as u16;
    let plot = Rect {
        x: area.x + gutter + 1,
        y: area.y,
        width: area.width.saturating_sub(gutter + 2),
        height: area.height - 2,
    };
    axes(frame, area, plot, look, &x, &y);
    if let Some(row) = threshold.and_then(|t| y.place(t)).map(|share| row_at(plot, share)) {
        let line = look.glyphs().threshold.repeat(usize::from(plot.width));
        frame.buffer_mut().set_string(plot.x, row, line, look.warn());
    }
    if let Some(row) = floor.and_then(|f| y.place(f)).map(|share| row_at(plot, share)) {
        let line = look.glyphs().threshold.repeat(usize::from(plot.width));
        frame.buffer_mut().set_string(plot.x, row, line, look.dim());
        let label = " noise of the reference ";
        if usize::from(plot.width) > label.len() + 8 {
            frame.buffer_mut().set_string(plot.x + 2, row, label, look.dim());
        }
    }
    let placed = |points: &[(f64, f64)]| -> Vec<(f64, f64)> {
        points.iter().filter_map(|p| Some((x.place(p.0)?, y.place(p.1)?))).collect()
    };
    let dots = placed(points);
    let ink = look.glow().fg.unwrap_or(Color::Reset);
    // Without colours nothing would tell the curves apart.
    let past: Vec<Vec<(f64, f64)>> = match look.behind() {
        Some(_) => lines.past.iter().map(|points| placed(points)).collect(),
        None => Vec::new(),
    };
    let behind = look.behind().unwrap_or(Color::Reset);
    let canvas = Canvas::default()
        .marker(if look.ascii { Marker::Custom('*') } else { Marker::Braille })
        .x_bounds([0.0, 1.0])
        .y_bounds([0.0, 1.0])
        .paint(|ctx| {
            let mut draw = |dots: &[(f64, f64)], color| {
                ctx.draw(&Points { coords: dots, color });
                for pair in dots.windows(2) {
                    ctx.draw(&Stroke { x1: pair[0].0, y1: pair[0].1, x2: pair[1].0, y2: pair[1].1, color });
                }
            };
            past.iter().for_each(|dots| draw(dots, behind));
            draw(&dots, ink);
        });
    frame.render_widget(canvas, plot);
}

/// Whether a threshold is so close to the curve that both can be seen on one chart: within two decades, or twice
/// the height of the curve.
fn near(threshold: f64, points: &[(f64, f64)], scale: Scale) -> bool {
    let place = |y: f64| if scale == Scale::Log { y.log10() } else { y };
    let ys = points.iter().map(|p| place(p.1)).filter(|y| y.is_finite());
    let (low, high) = ys.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), y| (l.min(y), h.max(y)));
    let reach = if scale == Scale::Log { 2.0 } else { 2.0 * (high - low) };
    (low - reach..=high + reach).contains(&place(threshold))
}

/// The row of characters in which a share of the height from below lies.
fn row_at(plot: Rect, share: f64) -> u16 {
    let from_top = (1.0 - share) * f64::from(plot.height);
    plot.y + (from_top as u16).min(plot.height.saturating_sub(1))
}

fn axes(frame: &mut Frame, area: Rect, plot: Rect, look: Look, x: &Axis, y: &Axis) {
    let glyphs = look.glyphs();
    let buffer = frame.buffer_mut();
    let (axis_column, axis_row) = (plot.x - 1, plot.bottom());
    for row in plot.top()..plot.bottom() {
        buffer.set_string(axis_column, row, glyphs.axis_y[0], look.dim());
    }
    buffer.set_string(axis_column, axis_row, glyphs.axis_x[2], look.dim());
    buffer.set_string(plot.x, axis_row, glyphs.axis_x[0].repeat(usize::from(plot.width)), look.dim());
    for tick in &y.ticks {
        let Some(share) = y.place(tick.value) else { continue };
        let row = row_at(plot, share);
        buffer.set_string(plot.x, row, glyphs.grid.repeat(usize::from(plot.width)), look.dim());
        buffer.set_string(axis_column, row, glyphs.axis_y[1], look.dim());
        let label = &tick.label;
        let at = axis_column.saturating_sub(label.len() as u16).max(area.x);
        buffer.set_string(at, row, label, Style::new());
    }
    let mut free_from = area.x;
    for tick in &x.ticks {
        let Some(share) = x.place(tick.value) else { continue };
        let column = plot.x + ((share * f64::from(plot.width)) as u16).min(plot.width.saturating_sub(1));
        buffer.set_string(column, axis_row, glyphs.axis_x[1], look.dim());
        let length = tick.label.len() as u16;
        let at = column.saturating_sub(length / 2).min(area.right().saturating_sub(length));
        if at >= free_from && at + length <= area.right() {
            buffer.set_string(at, axis_row + 1, &tick.label, Style::new());
            free_from = at + length + 1;
        }
    }
}
