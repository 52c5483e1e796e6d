//! Errors against the frozen picture: a curve for each setting, with the noise floor.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};

use super::Screen;
use crate::explore::reference::{FloorDistance, SettingCurve, floor_distance, metrics};
use crate::tui::format;
use crate::tui::panes::chart::{self, ChartCurve, Lines};
use crate::tui::panes::{draw_note, framed, pane};
use lumbre_metrics::MetricSpec;

/// Draws the pane.
pub fn draw(frame: &mut Frame, area: Rect, screen: &Screen) {
    let (state, caps) = (screen.state, screen.caps);
    let mut specs = metrics();
    let spec = specs.swap_remove(state.metric.min(specs.len() - 1));
    let floor = state.floors.get(state.metric).copied().flatten();
    let current = state.curve(state.side);
    let value = current
        .and_then(|known| known.curve.last())
        .and_then(|row| row.metrics.get(state.metric))
        .copied();
    let block = pane(caps, headline(screen, &spec, value));
    let warning = value.and_then(|value| warning(screen, &spec, value, floor));
    let unit = format!(" over {} ", chart::axis_unit(state.chart_x));
    let room = usize::from(area.width).saturating_sub(unit.len() + 4);
    let fits = warning.as_ref().is_none_or(|line| line.width() <= room);
    let block = match warning {
        Some(line) => block.title_bottom(line),
        None => block,
    };
    let block = if fits {
        block.title_bottom(Line::styled(unit, caps.dim()).right_aligned())
    } else {
        block
    };
    let inner = framed(frame, area, block);
    if let Some(mismatch) = state.mismatch(state.side) {
        return draw_note(frame, inner, caps, mismatch.text());
    }
    let points = |known: &SettingCurve| ChartCurve {
        series: Some((known.colour, known.label.clone())),
        points: chart::points(&known.curve, state.chart_x, state.metric),
    };
    let others = state.curves.list().iter();
    let mut others: Vec<ChartCurve> = others
        .filter(|known| current.is_none_or(|current| !std::ptr::eq(*known, current)))
        .map(points)
        .collect();
    let current = current.map(points).filter(|curve| !curve.points.is_empty());
    let Some(current) = current.or_else(|| others.pop()) else {
        return draw_note(frame, inner, caps, "nothing is measured yet");
    };
    if current.points.is_empty() {
        return draw_note(frame, inner, caps, "this metric has no values here");
    }
    let lines = Lines {
        current,
        others,
        threshold: None,
        floor,
    };
    chart::plot(frame, inner, caps, spec.row.better, &lines);
}

/// Name of the metric, its newest value, and the slope of the error.
fn headline(screen: &Screen, spec: &MetricSpec, value: Option<f64>) -> Line<'static> {
    let (state, caps) = (screen.state, screen.caps);
    let mut spans = vec![Span::styled(format!(" {} ", spec.column), caps.strong())];
    if let Some(value) = value {
        let text = format!("{} ", format::measured(spec, value));
        spans.push(Span::styled(text, caps.accent()));
    }
    let slope = state.curve(state.side).and_then(|known| {
        known
            .curve
            .slope(state.metric, |row| chart::x_of(row, state.chart_x))
    });
    if let Some(slope) = slope {
        spans.push(Span::styled(format!(" slope {slope:.2} "), caps.strong()));
    }
    Line::from(spans)
}

/// Warns of values that the noise of the reference decides.
fn warning(
    screen: &Screen,
    spec: &MetricSpec,
    value: f64,
    floor: Option<f64>,
) -> Option<Line<'static>> {
    let text = match floor_distance(spec, value, floor) {
        FloorDistance::Far => return None,
        FloorDistance::Near => " below twice the noise ",
        FloorDistance::AtFloor => " half of it is noise ",
    };
    Some(Line::styled(text, screen.caps.warn()))
}
