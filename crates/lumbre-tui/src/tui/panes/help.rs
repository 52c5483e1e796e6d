//! The help overlay: keys and symbols.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Clear, Paragraph};

use super::pane;
use crate::tui::format;
use crate::tui::model::night::NightModel;
use crate::tui::terminal::terminal_caps::TerminalCaps;
use crate::tui::view::View;

/// Keys that control the night; hidden when watching.
const NIGHT: &[(&str, &str)] = &[
    ("q Ctrl-C", "stop after this wave; again: quit now"),
    ("Q", "toggle stop after this cell"),
    ("p Space", "pause, resume"),
    ("s   R", "skip cell; restart it"),
];

const SCREEN: &[(&str, &str)] = &[
    (":", "command bar: pause 64spp, show flip"),
    ("/", "filter the plan"),
    ("Tab", "enlarge the next pane"),
    ("1 to 9", "metric of the chart"),
    ("x", "chart axis: time or samples"),
    ("v   f", "next picture mode; flicker"),
    ("t   < >", "play time bins; arrows: one frame"),
    ("e E 0", "exposure: darker, brighter, reset"),
    ("g", "plan as tree, open tree, list"),
    ("j k Pg", "scroll plan or enlarged log"),
    ("Esc", "all panes, follow the night"),
];

/// Width in columns of the keys and the spaces after them.
const KEY: usize = 12;

fn signs(caps: TerminalCaps) -> Vec<Line<'static>> {
    let g = caps.glyphs();
    let sign = |glyph: &'static str, style: Style, text: &'static str| {
        [
            Span::styled(glyph, style),
            Span::raw(format!(" {text:<13}")),
        ]
    };
    let rows = [
        [
            (g.waiting, caps.dim(), "waiting"),
            (g.running, caps.accent(), "rendering"),
            (g.done, caps.good(), "done"),
        ],
        [
            (g.cached, caps.good(), "cached"),
            (g.failed, caps.bad(), "failed"),
            (g.interrupted, caps.warn(), "interrupted"),
        ],
    ];
    rows.into_iter()
        .map(|row| {
            Line::from_iter(
                row.into_iter()
                    .flat_map(|(g, style, text)| sign(g, style, text)),
            )
        })
        .collect()
}

/// Draws the help overlay.
pub fn draw(frame: &mut Frame, area: Rect, _model: &NightModel, view: &View) {
    let caps = view.caps;
    let room = usize::from(area.width).saturating_sub(KEY + 4);
    let mut lines: Vec<Line> = Vec::new();
    let night = if view.watching {
        &[("q Ctrl-C", "quit watching; the night continues")][..]
    } else {
        NIGHT
    };
    for (key, text) in night.iter().chain(SCREEN) {
        for (i, part) in format::wrap(text, room).into_iter().enumerate() {
            let key = if i == 0 { key } else { "" };
            lines.push(Line::from(vec![
                Span::styled(format!("{key:<KEY$}"), caps.accent()),
                Span::raw(part),
            ]));
        }
    }
    lines.push(Line::default());
    lines.extend(signs(caps));
    let width = (lines.iter().map(Line::width).max().unwrap_or(0) as u16 + 4).min(area.width);
    let height = (lines.len() as u16 + 2).min(area.height);
    let at = Rect {
        x: area.x + (area.width - width) / 2,
        y: area.y + (area.height - height) / 2,
        width,
        height,
    };
    frame.render_widget(Clear, at);
    let block = pane(caps, Span::styled(" Keys and symbols ", caps.strong()))
        .padding(ratatui::widgets::Padding::horizontal(1));
    frame.render_widget(Paragraph::new(lines).block(block), at);
}
