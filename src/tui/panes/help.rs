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

/// Keys that reach the night; of no use to those who only watch.
const NIGHT: &[(&str, &str)] = &[
    ("q Ctrl-C", "stop after this wave; again: now"),
    ("Q", "stop after this cell, or not"),
    ("p Space", "pause, go on"),
    ("s   R", "give up this cell; restart it"),
];

const SCREEN: &[(&str, &str)] = &[
    (":", "command bar: pause 64spp, show flip"),
    ("/", "filter the plan"),
    ("Tab", "larger pane, in turn"),
    ("1 to 9", "metric of the chart"),
    ("x", "chart over time or spp"),
    ("v   f", "next kind of picture; flicker"),
    ("t   < >", "light through time; arrows: frames"),
    ("e E 0", "picture darker, brighter, as is"),
    ("g", "tree, open tree, list"),
    ("j k Pg", "scroll plan or large log"),
    ("Esc", "all panes, follow the night"),
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
    let night = if view.watching { &[("q Ctrl-C", "leave; the night goes on")][..] } else { NIGHT };
    for (key, text) in night.iter().chain(SCREEN) {
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
