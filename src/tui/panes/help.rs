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
use crate::tui::words;

const KEYS: &[(&str, &str)] = &[
    ("q Ctrl-C", "stop after this wave; again: leave now"),
    ("p Space", "pause, go on"),
    ("s", "give up this cell"),
    ("Tab", "larger pane, in turn"),
    ("1 to 9", "metric of the chart"),
    ("x", "chart over time or spp"),
    ("e E", "picture darker, brighter"),
    ("j k arrows", "scroll plan or large log"),
    ("PgUp PgDn", "by a page"),
    ("Home End", "to the first, to the last"),
    ("Esc", "all panes, follow the night"),
    ("? F1", "this help"),
];

/// Columns of the keys and the spaces behind them.
const KEY: usize = 12;

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
    let room = usize::from(area.width).saturating_sub(KEY + 4);
    let mut lines: Vec<Line> = Vec::new();
    for (key, text) in KEYS {
        for (i, part) in words::wrap(text, room).into_iter().enumerate() {
            let key = if i == 0 { key } else { "" };
            lines.push(Line::from(vec![Span::styled(format!("{key:<KEY$}"), look.accent()), Span::raw(part)]));
        }
    }
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
