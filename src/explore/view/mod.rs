//! The screen: a pure function of the state and of what the session published.
//!
//! The picture is on the left and the panel on the right, under a title and above a line of hints.
//! Below 64 columns there is only one of them at a time.

mod facts;
mod overlays;
mod panel;
pub mod picture;

use std::cell::RefCell;

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::input::PictureArea;
use super::session::{Published, Slot, Status};
use super::state::{Overlay, State};
use crate::tui::format;
use crate::tui::terminal::terminal_caps::{Graphics, TerminalCaps};
use picture::PictureCache;

/// Smallest screen that is drawn: columns and rows.
pub const SMALLEST: [u16; 2] = [24, 8];

/// Number of columns from which picture and panel are shown side by side.
const BOTH: u16 = 64;

/// Everything that a frame depends on.
pub struct Screen<'a> {
    /// State of the screen.
    pub state: &'a State,
    /// State that the session published.
    pub published: &'a Published,
    /// Capabilities of the terminal.
    pub caps: TerminalCaps,
    /// Graphics protocol, and the size of a character cell in pixels if the protocol needs it.
    pub graphics: (Graphics, [u16; 2]),
    /// Pictures encoded for the terminal.
    pub cache: &'a RefCell<PictureCache>,
}

/// Positions of the panes; a hidden pane has an empty rectangle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Regions {
    /// The title line.
    pub title: Rect,
    /// The picture with its border.
    pub picture: Rect,
    /// The list of parameters with its border.
    pub panel: Rect,
    /// Facts about the picture.
    pub facts: Rect,
    /// The line at the bottom: hints, or a message.
    pub hints: Rect,
}

/// Divides the screen into panes.
pub fn regions(area: Rect, panel_hidden: bool) -> Regions {
    let lines = [
        Constraint::Length(1),
        Constraint::Fill(1),
        Constraint::Length(1),
    ];
    let [title, body, hints] = Layout::vertical(lines).areas(area);
    let width = match area.width {
        140.. => 46,
        100.. => 40,
        BOTH.. => 32,
        _ => area.width,
    };
    let regions = Regions {
        title,
        hints,
        ..Regions::default()
    };
    if panel_hidden {
        return Regions {
            picture: body,
            ..regions
        };
    }
    let columns = [Constraint::Fill(1), Constraint::Length(width)];
    let [picture, side] = Layout::horizontal(columns).areas(body);
    let facts_rows = if side.height >= 20 { 7 } else { 0 };
    let rows = [Constraint::Fill(1), Constraint::Length(facts_rows)];
    let [panel, facts] = Layout::vertical(rows).areas(side);
    Regions {
        picture,
        panel,
        facts,
        ..regions
    }
}

/// Returns the cells of the picture and its resolution: two pixels in every cell, or the pixels of
/// the cells if the terminal has a graphics protocol.
pub fn picture_area(area: Rect, panel_hidden: bool, graphics: (Graphics, [u16; 2])) -> PictureArea {
    let outer = regions(area, panel_hidden).picture;
    let cells = Rect {
        x: outer.x + 1,
        y: outer.y + 1,
        width: outer.width.saturating_sub(2),
        height: outer.height.saturating_sub(2),
    };
    let [wide, high] = match graphics {
        (Graphics::Blocks, _) | (_, [0, _] | [_, 0]) => [1, 2],
        (_, size) => size,
    };
    PictureArea {
        cells,
        resolution: [
            u32::from(cells.width) * u32::from(wide),
            u32::from(cells.height) * u32::from(high),
        ],
    }
}

/// Draws the whole screen.
pub fn draw(frame: &mut Frame, screen: &Screen) {
    let area = frame.area();
    if area.width < SMALLEST[0] || area.height < SMALLEST[1] {
        frame.render_widget(Paragraph::new("too small"), area);
        return;
    }
    let regions = regions(area, screen.state.panel_hidden);
    title(frame, regions.title, screen);
    hints(frame, regions.hints, screen);
    if regions.picture.width > 2 {
        picture::draw(frame, regions.picture, screen);
    }
    if regions.panel.width > 2 {
        panel::draw(frame, regions.panel, screen);
    }
    if regions.facts.height > 2 {
        facts::draw(frame, regions.facts, screen);
    }
    match &screen.state.overlay {
        Overlay::None | Overlay::Edit(_) => {}
        Overlay::Help => overlays::help(frame, area, screen.caps),
        Overlay::Picker(picker) => overlays::picker(frame, area, screen.caps, picker),
    }
}

fn title(frame: &mut Frame, area: Rect, screen: &Screen) {
    let (state, caps) = (screen.state, screen.caps);
    let live = screen.published.slot(Slot::Live);
    let scene = state.scene.as_ref().map_or("", |scene| scene.name.as_str());
    let (text, style) = match &live.status {
        Status::Idle => ("", caps.dim()),
        Status::Loading => ("loading", caps.warn()),
        Status::Rendering => ("rendering", caps.accent()),
        Status::Paused => ("paused", caps.warn()),
        Status::Finished => ("limit reached", caps.good()),
        Status::Failed(_) => ("failed", caps.bad()),
    };
    let samples = live.frame.as_ref().map_or(0, |frame| frame.samples);
    let spans = vec![
        Span::styled(" Lumbre explore  ", caps.accent()),
        Span::styled(format::clean(scene), caps.strong()),
        Span::raw(format!("  {}  ", state.settings.technique().name)),
        Span::raw(format!("{samples} spp  ")),
        Span::styled(text, style),
    ];
    frame.render_widget(Line::from(spans), area);
}

fn hints(frame: &mut Frame, area: Rect, screen: &Screen) {
    let (state, caps) = (screen.state, screen.caps);
    let columns = usize::from(area.width);
    let ellipsis = caps.glyphs().ellipsis;
    let line = match (&state.overlay, &state.message) {
        (Overlay::Edit(text), message) => {
            let name = state.selected().map(|row| row.name().to_owned());
            let reason = message.as_ref().map(|message| message.text.clone());
            Line::from(vec![
                Span::styled(format!(" {}: ", name.unwrap_or_default()), caps.accent()),
                Span::raw(text.clone()),
                Span::raw(caps.glyphs().cursor),
                Span::styled(format!("  {}", reason.unwrap_or_default()), caps.bad()),
            ])
        }
        (_, Some(message)) => {
            let style = if message.failed {
                caps.bad()
            } else {
                caps.good()
            };
            let text = format::fit(
                &format!(" {}", format::clean(&message.text)),
                columns,
                ellipsis,
            );
            Line::styled(text, style)
        }
        _ => {
            let text = " ? keys  q quit  arrows change  Enter type  wasd orbit  +- dolly  \
                        t technique  space pause  p save  x script  o scenes";
            Line::styled(format::fit(text, columns, ellipsis), caps.dim())
        }
    };
    frame.render_widget(line, area);
}
