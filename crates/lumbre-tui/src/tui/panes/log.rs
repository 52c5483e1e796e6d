//! The log pane: the latest messages, newest at the bottom.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::{framed, pane};
use crate::tui::format;
use crate::tui::model::night::{LogMessage, NightModel};
use crate::tui::view::View;
use lumbre_night::experiment::outcome::Level;

/// Width in columns of the time stamp and the space after it.
const STAMP: usize = 6;

fn style(view: &View, level: Level) -> Style {
    match level {
        Level::Info => Style::new(),
        Level::Warn => view.caps.warn(),
        Level::Error => view.caps.bad(),
    }
}

/// Breaks a message into lines; continuation lines are indented to the text.
fn lines(
    view: &View,
    model: &NightModel,
    message: &LogMessage,
    width: usize,
) -> Vec<Line<'static>> {
    let word = match message.level {
        Level::Info => "",
        Level::Warn => "warning: ",
        Level::Error => "error: ",
    };
    let since = message.at_ms as f64 / 1e3 - model.started_s.unwrap_or(0.0);
    let text = format!("{word}{}", message.text);
    let parts = format::wrap(&text, width.saturating_sub(STAMP).max(1));
    let lines = parts.into_iter().enumerate().map(|(i, part)| {
        let stamp = if i == 0 {
            format::stamp(since)
        } else {
            String::new()
        };
        Line::from(vec![
            Span::styled(format!("{stamp:<STAMP$}"), view.caps.dim()),
            Span::styled(part, style(view, message.level)),
        ])
    });
    lines.collect()
}

/// Returns the newest lines, at most `wanted`, oldest first.
fn newest(model: &NightModel, view: &View, width: usize, wanted: usize) -> Vec<Line<'static>> {
    let mut all = Vec::new();
    for message in model.messages.iter().rev() {
        if all.len() >= wanted {
            break;
        }
        all.extend(lines(view, model, message, width).into_iter().rev());
    }
    all.reverse();
    all
}

/// Largest number of lines by which the log can be scrolled back.
pub fn lines_back(model: &NightModel, view: &View, area: Rect) -> usize {
    let (width, height) = (
        usize::from(area.width.saturating_sub(2)),
        usize::from(area.height.saturating_sub(2)),
    );
    newest(model, view, width, usize::MAX)
        .len()
        .saturating_sub(height)
}

/// Draws the log pane.
pub fn draw(frame: &mut Frame, area: Rect, model: &NightModel, view: &View) {
    let block = pane(view.caps, Span::styled(" Log ", view.caps.strong()));
    let inner = framed(frame, area, block);
    let height = usize::from(inner.height);
    if model.messages.is_empty() {
        frame.render_widget(Paragraph::new("no messages").style(view.caps.dim()), inner);
        return;
    }
    let mut lines = newest(
        model,
        view,
        usize::from(inner.width),
        height + view.log_back,
    );
    let back = view.log_back.min(lines.len().saturating_sub(height));
    lines.truncate(lines.len() - back);
    let from = lines.len().saturating_sub(height);
    frame.render_widget(Paragraph::new(lines.split_off(from)), inner);
}
