//! The help that lies over everything.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Clear, Paragraph};

use super::pane;
use crate::tui::look::Look;
use crate::tui::model::Model;
use crate::tui::view::View;

const KEYS: &[(&str, &str)] = &[
    ("q  Ctrl-C", "stop after this wave; again: leave now"),
    ("p  Space", "pause, go on"),
    ("s", "give up the current cell"),
    ("1 to 9", "metric of the chart"),
    ("x", "chart over render time or samples"),
    ("e  E", "picture darker, brighter by half a stop"),
    ("Tab", "enlarge picture, chart, log in turn"),
    ("j k  arrows", "scroll the plan, or the large log"),
    ("PgUp  PgDn", "the same by a page; Home, End: ends"),
    ("Esc", "all panes, following the current cell"),
    ("?  F1", "this help"),
];

fn signs(look: Look) -> Vec<Line<'static>> {
    let g = look.glyphs();
    let sign = |glyph: &'static str, style: Style, text: &'static str| {
        [Span::styled(glyph, style), Span::raw(format!(" {text:<13}"))]
    };
    let rows = [
        [(g.waiting, look.dim(), "waiting"), (g.running, look.accent(), "rendering"), (g.done, look.good(), "done")],
        [
            (g.cached, look.good(), "done before"),
            (g.failed, look.bad(), "failed"),
            (g.interrupted, look.warn(), "interrupted"),
        ],
    ];
    rows.into_iter()
        .map(|row| Line::from_iter(row.into_iter().flat_map(|(g, style, text)| sign(g, style, text))))
        .collect()
}

/// Draws the help.
pub fn draw(frame: &mut Frame, area: Rect, _model: &Model, view: &View) {
    let look = view.look;
    let mut lines: Vec<Line> = KEYS
        .iter()
        .map(|(key, text)| Line::from(vec![Span::styled(format!("{key:<13}"), look.accent()), Span::raw(*text)]))
        .collect();
    lines.push(Line::default());
    lines.extend(signs(look));
    let width = (lines.iter().map(Line::width).max().unwrap_or(0) as u16 + 4).min(area.width);
    let height = (lines.len() as u16 + 2).min(area.height);
    let at = Rect { x: area.x + (area.width - width) / 2, y: area.y + (area.height - height) / 2, width, height };
    frame.render_widget(Clear, at);
    let block =
        pane(look, Span::styled(" Keys and signs ", look.strong())).padding(ratatui::widgets::Padding::horizontal(1));
    frame.render_widget(Paragraph::new(lines).block(block), at);
}
