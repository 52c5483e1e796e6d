//! Windows that cover the screen: the list of keys and the list of scenes.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Clear, Paragraph};

use crate::explore::picker::Picker;
use crate::tui::format;
use crate::tui::panes::{framed, pane};
use crate::tui::terminal::terminal_caps::TerminalCaps;

/// Keys and what they do.
const KEYS: &[(&str, &str)] = &[
    ("up down", "select a setting; PgUp PgDn: a group"),
    ("left right", "change it; with Shift ten steps"),
    ("Enter", "type a value; Backspace: default"),
    ("t T", "next technique, previous one"),
    ("w a s d", "orbit; with Shift pan"),
    ("+ -", "dolly"),
    ("g", "focus on the clicked point"),
    ("0", "reset the camera"),
    ("e E", "exposure: darker, brighter"),
    ("l", "next film of the layers"),
    ("Space", "pause, resume"),
    ("r", "restart"),
    ("c C", "compare settings, switch sides; end"),
    ("v", "side by side, or flicker"),
    ("m M", "metric of comparisons and curves"),
    ("f F", "freeze as reference; remove it"),
    ("h", "curves over time, or samples"),
    ("i", "inspect a pixel; arrows move the cursor"),
    ("", "n N: sample; Enter: steps and lobe"),
    ("p", "save the picture as EXR and PNG"),
    ("x", "write the settings as a script"),
    ("o", "choose another scene"),
    ("Tab", "hide or show the settings"),
    ("q", "quit"),
    ("mouse", "drag: orbit; right drag: pan"),
    ("", "wheel: dolly; right click: focus"),
];

/// Width of the column of keys.
const KEY: usize = 11;

/// Draws a pane in the middle of the screen.
fn window(frame: &mut Frame, area: Rect, caps: TerminalCaps, title: &str, size: [u16; 2]) -> Rect {
    let [width, height] = [size[0].min(area.width), size[1].min(area.height)];
    let at = Rect {
        x: area.x + (area.width - width) / 2,
        y: area.y + (area.height - height) / 2,
        width,
        height,
    };
    frame.render_widget(Clear, at);
    let block = pane(caps, Span::styled(format!(" {title} "), caps.accent()));
    framed(frame, at, block)
}

/// Draws the list of keys, from a row on if it does not fit.
pub fn help(frame: &mut Frame, area: Rect, caps: TerminalCaps, first: usize) {
    let fits = usize::from(area.height) >= KEYS.len() + 2;
    let title = if fits {
        "Keys"
    } else {
        "Keys, more with up and down"
    };
    let inner = window(frame, area, caps, title, [54, KEYS.len() as u16 + 2]);
    let shown = usize::from(inner.height);
    let lines: Vec<Line> = KEYS
        .iter()
        .skip(first.min(KEYS.len().saturating_sub(shown)))
        .map(|(keys, doc)| {
            Line::from(vec![
                Span::styled(format!(" {keys:<KEY$}"), caps.strong()),
                Span::raw(*doc),
            ])
        })
        .collect();
    frame.render_widget(Paragraph::new(lines), inner);
}

/// Draws the list of scenes.
pub fn picker(frame: &mut Frame, area: Rect, caps: TerminalCaps, picker: &Picker) {
    let size = [area.width.min(72), area.height.saturating_sub(4).min(30)];
    let inner = window(frame, area, caps, "Scenes", size);
    let listed = picker.listed();
    let rows = usize::from(inner.height).saturating_sub(2);
    let first = picker
        .selected
        .saturating_sub(rows / 2)
        .min(listed.len().saturating_sub(rows));
    let mut lines = vec![
        Line::from(vec![
            Span::styled(" filter: ", caps.dim()),
            Span::raw(picker.filter.clone()),
            Span::raw(caps.glyphs().cursor),
            Span::styled(
                format!("  {} of {}", listed.len(), picker.scenes.len()),
                caps.dim(),
            ),
        ]),
        Line::from(""),
    ];
    let columns = usize::from(inner.width).saturating_sub(12);
    for (index, scene) in listed.iter().enumerate().skip(first).take(rows) {
        let is_selected = index == picker.selected;
        let name = format::fit(&format::clean(&scene.name), columns, caps.glyphs().ellipsis);
        let marker = if is_selected { " > " } else { "   " };
        let style = if is_selected {
            caps.accent()
        } else {
            caps.strong()
        };
        lines.push(Line::from(vec![
            Span::styled(marker, caps.accent()),
            Span::styled(name, style),
            Span::styled(if scene.built_in { "  built in" } else { "" }, caps.dim()),
        ]));
    }
    frame.render_widget(Paragraph::new(lines), inner);
}
