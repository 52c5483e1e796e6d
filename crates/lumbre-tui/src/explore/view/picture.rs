//! The picture pane: half blocks, or a graphics protocol of the terminal.

use std::sync::Arc;

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::Screen;
use crate::explore::input::PictureArea;
use crate::explore::session::{Frame as Published, SLOTS, Slot, Status};
use crate::explore::state::Overlay;
use crate::tui::format;
use crate::tui::panes::{pane, picture};
use crate::tui::preview::box_average;
use crate::tui::terminal::graphics_protocols::{EncodedPicture, Picture};
use crate::tui::terminal::terminal_caps::{Colors, Graphics};
use lumbre_light::film::Image;
use lumbre_metrics::tonemap::Tonemap;
use lumbre_report::layer::display_values;

/// Inputs of a picture on the screen; equal sources give equal pictures.
#[derive(Clone, Debug)]
struct Source {
    frame: Arc<Published>,
    layer: usize,
    tonemap: Tonemap,
    resolution: [u32; 2],
}

impl Source {
    fn is_same(&self, other: &Source) -> bool {
        Arc::ptr_eq(&self.frame, &other.frame)
            && self.layer == other.layer
            && self.tonemap == other.tonemap
            && self.resolution == other.resolution
    }
}

/// The picture that was drawn last in one of the tiles.
#[derive(Default)]
struct CachedTile {
    shown: Option<(Source, Image)>,
    encoded: Option<(Graphics, [u16; 2], EncodedPicture)>,
    /// Number of encoded pictures so far.
    count: u8,
}

/// The pictures that were drawn last, by tile.
#[derive(Default)]
pub struct PictureCache {
    tiles: [CachedTile; SLOTS],
}

impl CachedTile {
    /// Returns the display values of a source.
    fn display(&mut self, source: Source) -> &Image {
        let same = self
            .shown
            .as_ref()
            .is_some_and(|(known, _)| known.is_same(&source));
        if !same {
            self.encoded = None;
        }
        let (_, image) = match self.shown.take().filter(|_| same) {
            Some(shown) => self.shown.insert(shown),
            None => {
                let image = display(&source);
                self.shown.insert((source, image))
            }
        };
        image
    }

    /// Returns the picture that was passed to [`CachedTile::display`] last, encoded. `first` is the
    /// first of two numbers that distinguish the pictures of this tile in the memory of the
    /// terminal; two suffice, since the terminal shows one while the next one is sent.
    fn encode(
        &mut self,
        graphics: Graphics,
        cells: [u16; 2],
        first: u8,
    ) -> Option<&EncodedPicture> {
        let (_, image) = self.shown.as_ref()?;
        let known = self.encoded.as_ref();
        let same = known.is_some_and(|(g, c, _)| *g == graphics && *c == cells);
        if !same {
            self.count = (self.count + 1) % 2;
            let picture = Picture::from_display(image);
            let encoded = EncodedPicture::new(graphics, cells, &picture, first + self.count)?;
            self.encoded = Some((graphics, cells, encoded));
        }
        self.encoded.as_ref().map(|(.., encoded)| encoded)
    }
}

/// Computes the display values of a source in its resolution.
fn display(source: &Source) -> Image {
    let [width, height] = source.resolution;
    let resized = |image: &Image| {
        if [image.width, image.height] == [width, height] {
            image.clone()
        } else {
            box_average(image, width, height)
        }
    };
    match source
        .layer
        .checked_sub(1)
        .and_then(|i| source.frame.layers.get(i))
    {
        Some(layer) => resized(&display_values(layer, source.tonemap)),
        None => source.tonemap.apply(&resized(&source.frame.image)),
    }
}

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
