//! The panel: one row for each parameter, under the headings of their groups, and the description
//! of the selected one.

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::Screen;
use crate::explore::parameters::{self, Parameter};
use crate::tui::format;
use crate::tui::panes::{framed, pane};

/// Width of the column of names.
const NAMES: usize = 15;

/// Rows of the description of the selected parameter.
const DESCRIPTION: u16 = 4;

/// Draws the panel.
pub fn draw(frame: &mut Frame, area: Rect, screen: &Screen) {
    let block = pane(
        screen.caps,
        Span::styled(" Settings ", screen.caps.strong()),
    );
    let inner = framed(frame, area, block);
    let rows = if inner.height >= 14 { DESCRIPTION } else { 0 };
    let parts = [Constraint::Fill(1), Constraint::Length(rows)];
    let [list, description] = Layout::vertical(parts).areas(inner);
    let (lines, selected) = lines(screen, usize::from(inner.width));
    let shown = usize::from(list.height);
    // The selected row stays in the middle of a list that does not fit.
    let first = selected
        .saturating_sub(shown / 2)
        .min(lines.len().saturating_sub(shown));
    let visible: Vec<Line> = lines.into_iter().skip(first).take(shown).collect();
    frame.render_widget(Paragraph::new(visible), list);
    if let Some(parameter) = screen.state.selected() {
        describe(frame, description, screen, &parameter);
    }
}

/// Returns all lines, and the index of the selected one.
fn lines(screen: &Screen, width: usize) -> (Vec<Line<'static>>, usize) {
    let (state, caps) = (screen.state, screen.caps);
    let (mut lines, mut selected, mut group) = (Vec::new(), 0, None);
    for (index, parameter) in state.parameters().iter().enumerate() {
        if group != Some(parameter.group) {
            group = Some(parameter.group);
            lines.push(Line::styled(parameter.group.name(), caps.accent()));
        }
        let set = state.settings.get(&parameter.path).cloned();
        let known = set.clone().or_else(|| state.default_of(parameter));
        let value = match &known {
            Some(value) => parameters::text(value),
            None => parameter.field.default.to_owned(),
        };
        let is_selected = index == state.row;
        if is_selected {
            selected = lines.len();
        }
        lines.push(row(
            screen,
            parameter,
            &value,
            set.is_some(),
            is_selected,
            width,
        ));
    }
    (lines, selected)
}

fn row(
    screen: &Screen,
    parameter: &Parameter,
    value: &str,
    is_set: bool,
    is_selected: bool,
    width: usize,
) -> Line<'static> {
    let caps = screen.caps;
    let ellipsis = caps.glyphs().ellipsis;
    let name = format::fit(parameter.name(), NAMES, ellipsis);
    let space = width.saturating_sub(NAMES + 3);
    let value = format::fit(value, space, ellipsis);
    let style = match (is_selected, is_set) {
        (true, _) => Style::new().add_modifier(Modifier::REVERSED),
        (false, true) => caps.strong(),
        (false, false) => caps.dim(),
    };
    let marker = if is_selected { ">" } else { " " };
    Line::from(vec![
        Span::styled(marker, caps.accent()),
        Span::raw(format!(" {name:<NAMES$} ")),
        Span::styled(value, style),
    ])
}

fn describe(frame: &mut Frame, area: Rect, screen: &Screen, parameter: &Parameter) {
    let doc = parameter.field.doc.split_whitespace();
    let text = doc.collect::<Vec<_>>().join(" ");
    let lines: Vec<Line> = format::wrap(&text, usize::from(area.width))
        .into_iter()
        .take(usize::from(area.height))
        .map(Line::from)
        .collect();
    frame.render_widget(Paragraph::new(lines).style(screen.caps.dim()), area);
}
