//! The screen: a pure function of the state and of what the session published.
//!
//! The picture is on the left and the panel on the right, under a title and above a line of hints.
//! Below 64 columns there is only one of them at a time.

mod errors;
mod facts;
mod lobe;
mod overlays;
mod panel;
pub mod picture;
pub mod picture_cache;
mod pixel;

use std::cell::RefCell;

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::input::PictureArea;
use super::session::{Published, Status};
use super::state::{Overlay, State};
use crate::tui::format;
use crate::tui::terminal::terminal_caps::{Graphics, TerminalCaps};
use picture_cache::PictureCache;

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
    /// Errors against the reference, or the inspector.
    pub lower: Rect,
    /// Facts about the picture.
    pub facts: Rect,
    /// The line at the bottom: hints, or a message.
    pub hints: Rect,
}

/// Divides the screen into panes. `has_lower` is whether there is a pane below the parameters:
/// errors or the inspector.
pub fn regions(area: Rect, panel_hidden: bool, has_lower: bool) -> Regions {
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
    let free = side.height.saturating_sub(facts_rows);
    let lower_rows = if has_lower { free * 6 / 10 } else { 0 };
    let rows = [
        Constraint::Fill(1),
        Constraint::Length(lower_rows),
        Constraint::Length(facts_rows),
    ];
    let [panel, lower, facts] = Layout::vertical(rows).areas(side);
    Regions {
        picture,
        panel,
        lower,
        facts,
        ..regions
    }
}

/// Returns the cells of the picture pane without its border.
pub fn picture_pane(area: Rect, panel_hidden: bool) -> Rect {
    let outer = regions(area, panel_hidden, false).picture;
    Rect {
        x: outer.x + 1,
        y: outer.y + 1,
        width: outer.width.saturating_sub(2),
        height: outer.height.saturating_sub(2),
    }
}

/// Returns the width and height in pixels of a character cell: the pixels of the terminal if it has
/// a graphics protocol, else two, one above the other.
fn cell_pixels(graphics: (Graphics, [u16; 2])) -> [u32; 2] {
    match graphics {
        (Graphics::Blocks, _) | (_, [0, _] | [_, 0]) => [1, 2],
        (_, size) => size.map(u32::from),
    }
}

/// Returns the width and height in pixels of a picture that fills a pane.
pub fn resolution(pane: Rect, graphics: (Graphics, [u16; 2])) -> [u32; 2] {
    let [wide, high] = cell_pixels(graphics);
    [u32::from(pane.width) * wide, u32::from(pane.height) * high]
}

/// Returns the cells in the middle of an area that a picture of some resolution fills at its aspect
/// ratio.
fn tile(area: Rect, resolution: [u32; 2], cell: [u32; 2]) -> Rect {
    let [wide, high] = resolution.map(|side| f64::from(side.max(1)));
    let [cell_wide, cell_high] = cell.map(f64::from);
    let scale =
        (f64::from(area.width) * cell_wide / wide).min(f64::from(area.height) * cell_high / high);
    let cells = |pixels: f64, cell: f64, most: u16| {
        ((pixels * scale / cell).round() as u16).clamp(most.min(1), most)
    };
    let (width, height) = (
        cells(wide, cell_wide, area.width),
        cells(high, cell_high, area.height),
    );
    Rect {
        x: area.x + (area.width - width) / 2,
        y: area.y + (area.height - height) / 2,
        width,
        height,
    }
}

/// Returns the positions of the visible pictures.
pub fn picture_area(area: Rect, state: &State, graphics: (Graphics, [u16; 2])) -> PictureArea {
    let pane = picture_pane(area, state.panel_hidden);
    let cell = cell_pixels(graphics);
    let place = |area| tile(area, state.resolution, cell);
    let tiles = if state.visible().len() > 1 {
        let half = Rect {
            width: pane.width.saturating_sub(1) / 2,
            ..pane
        };
        let right = Rect {
            x: pane.right() - half.width,
            ..half
        };
        [place(half), place(right)]
    } else {
        [place(pane), Rect::ZERO]
    };
    PictureArea {
        pane,
        tiles,
        resolution: state.resolution,
    }
}

/// Draws the whole screen.
pub fn draw(frame: &mut Frame, screen: &Screen) {
    let area = frame.area();
    if area.width < SMALLEST[0] || area.height < SMALLEST[1] {
        frame.render_widget(Paragraph::new("too small"), area);
        return;
    }
    let state = screen.state;
    let has_lower = state.reference.is_some() || state.inspector.is_some();
    let regions = regions(area, state.panel_hidden, has_lower);
    title(frame, regions.title, screen);
    hints(frame, regions.hints, screen);
    if regions.picture.width > 2 {
        picture::draw(frame, regions.picture, screen);
    }
    if regions.panel.width > 2 {
        panel::draw(frame, regions.panel, screen);
    }
    if regions.lower.height > 2 {
        match &state.inspector {
            Some(inspector) => pixel::draw(frame, regions.lower, screen, inspector),
            None => errors::draw(frame, regions.lower, screen),
        }
    }
    if regions.facts.height > 2 {
        facts::draw(frame, regions.facts, screen);
    }
    if let Some(inspector) = state.inspector.as_ref().filter(|known| known.window) {
        let inner = Rect {
            y: area.y + 1,
            height: area.height - 2,
            ..area
        };
        lobe::draw(frame, inner, screen, inspector);
    }
    match &state.overlay {
        Overlay::None | Overlay::Edit(_) => {}
        Overlay::Help(first) => overlays::help(frame, area, screen.caps, *first),
        Overlay::Picker(picker) => overlays::picker(frame, area, screen.caps, picker),
    }
}

fn title(frame: &mut Frame, area: Rect, screen: &Screen) {
    let (state, caps) = (screen.state, screen.caps);
    let live = screen.published.slot(state.side);
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
        Span::styled(side_name(state), caps.accent()),
        Span::raw(format!("  {}  ", state.settings.technique().name)),
        Span::raw(format!("{samples} spp  ")),
        Span::styled(text, style),
    ];
    frame.render_widget(Line::from(spans), area);
}

/// Name of the side that the panel edits, if there are two.
fn side_name(state: &State) -> String {
    let name = state.comparison.as_ref().map(|_| state.side.name());
    name.map_or_else(String::new, |name| format!("  {name}:"))
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
                        t technique  space pause  c compare  f reference  p save  x script";
            Line::styled(format::fit(text, columns, ellipsis), caps.dim())
        }
    };
    frame.render_widget(line, area);
}
