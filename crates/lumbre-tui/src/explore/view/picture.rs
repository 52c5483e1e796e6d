//! The picture pane: half blocks, or a graphics protocol of the terminal.

use std::sync::Arc;

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::Screen;
use super::picture_cache::Source;
use crate::explore::input::PictureArea;
use crate::explore::session::{Frame as Published, Slot, Status};
use crate::explore::state::Overlay;
use crate::tui::format;
use crate::tui::panes::{pane, picture};
use crate::tui::terminal::terminal_caps::{Colors, Graphics};

/// Returns the index of the film that is shown: 0 is the picture, from 1 on the films of layers.
fn shown_layer(screen: &Screen, frame: &Published) -> usize {
    screen.state.layer % (frame.layers.len() + 1)
}

/// Draws the pane.
pub fn draw(frame: &mut Frame, area: Rect, screen: &Screen) {
    let block = pane(screen.caps, title(screen));
    frame.render_widget(block, area);
    let place = super::picture_area(frame.area(), screen.state, screen.graphics);
    for (index, slot) in screen.state.visible().into_iter().enumerate() {
        let at = place.tiles[index];
        if at.width > 0 && at.height > 0 {
            draw_tile(frame, at, screen, (index, slot));
        }
    }
    if screen.state.comparison.is_some() {
        names(frame, area, screen, &place);
    }
}

/// Draws the picture of a slot, or why there is none.
fn draw_tile(frame: &mut Frame, inner: Rect, screen: &Screen, (index, slot): (usize, Slot)) {
    let caps = screen.caps;
    let view = screen.published.slot(slot);
    if let Status::Failed(reason) = &view.status {
        let lines: Vec<Line> = format::wrap(&format::clean(reason), usize::from(inner.width))
            .into_iter()
            .map(Line::from)
            .collect();
        frame.render_widget(Paragraph::new(lines).style(caps.bad()), inner);
        return;
    }
    let Some(published) = &view.frame else {
        let text = match view.status {
            Status::Loading => "loading the scene",
            _ => "no picture yet",
        };
        frame.render_widget(Paragraph::new(text).style(caps.dim()), inner);
        return;
    };
    let source = Source {
        frame: Arc::clone(published),
        layer: shown_layer(screen, published),
        tonemap: screen.state.tonemap(),
        resolution: super::resolution(inner, screen.graphics),
    };
    let mut cache = screen.cache.borrow_mut();
    let cache = &mut cache.tiles[index];
    let (graphics, cell) = screen.graphics;
    // Text cannot be drawn over such a picture, so overlays are shown over blocks.
    let blocks = graphics == Graphics::Blocks
        || cell.contains(&0)
        || caps.colors == Colors::None
        || !matches!(screen.state.overlay, Overlay::None | Overlay::Edit(_))
        || screen
            .state
            .inspector
            .as_ref()
            .is_some_and(|known| known.window);
    let image = cache.display(source);
    if blocks {
        picture::draw_display(frame, inner, caps, image);
        cursor(frame, inner, screen);
    } else if let Some(encoded) =
        cache.encode(graphics, [inner.width, inner.height], 2 * index as u8)
    {
        frame.render_widget(encoded, inner);
    }
}

/// Writes the names of compared pictures into the border above them; that of the edited one is
/// highlighted.
fn names(frame: &mut Frame, area: Rect, screen: &Screen, place: &PictureArea) {
    let (state, caps) = (screen.state, screen.caps);
    for (slot, at) in state.visible().into_iter().zip(place.tiles) {
        let technique = state.settings_of(slot).map_or("", |s| s.technique().name);
        let samples = screen.published.slot(slot).frame.as_ref();
        let samples = samples.map_or(0, |frame| frame.samples);
        let text = format!(" {} {technique} {samples} spp ", slot.name());
        let style = if slot == state.side {
            caps.accent()
        } else {
            caps.strong()
        };
        let room = usize::from(at.width);
        let text = format::fit(&text, room, caps.glyphs().ellipsis);
        frame.buffer_mut().set_string(at.x, area.y, text, style);
    }
}

/// Marks the pixel under the cursor.
fn cursor(frame: &mut Frame, inner: Rect, screen: &Screen) {
    let [width, height] = screen.state.resolution;
    let Some([x, y]) = screen.state.cursor.filter(|_| width > 0 && height > 0) else {
        return;
    };
    let column = inner.x + (x * u32::from(inner.width) / width) as u16;
    let row = inner.y + (y * u32::from(inner.height) / height) as u16;
    if let Some(cell) = frame.buffer_mut().cell_mut((column, row)) {
        cell.set_char('+');
    }
}

/// Title of the pane: what is shown. The names of compared pictures take its place.
fn title(screen: &Screen) -> Line<'static> {
    let caps = screen.caps;
    if screen.state.comparison.is_some() {
        return Line::default();
    }
    let live = screen.published.slot(screen.state.side);
    let layer = live.frame.as_ref().and_then(|frame| {
        let index = shown_layer(screen, frame).checked_sub(1)?;
        Some(frame.layers.get(index)?.film.name())
    });
    let mut spans = vec![Span::styled(
        layer.map_or_else(|| " Picture ".to_owned(), |name| format!(" {name} ")),
        caps.strong(),
    )];
    if let Some(frame) = &live.frame
        && frame.samples == 0
    {
        spans.push(Span::styled("reduced resolution ", caps.warn()));
    }
    Line::from(spans)
}
