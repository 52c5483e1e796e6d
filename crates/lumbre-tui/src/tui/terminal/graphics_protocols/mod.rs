//! Pictures in full resolution through the protocols of kitty, sixel and iTerm2.
//!
//! The terminal is never queried: under tmux and over slow lines a reply may be lost or arrive as
//! keyboard input. The protocol follows from the environment or from `LUMBRE_GRAPHICS`.

mod iterm2;
mod kitty;
mod palette;
mod sixel;

use std::cell;
use std::fmt::Write;
use std::num::NonZeroU16;
use std::sync::Arc;
use std::time::{Duration, Instant};

use ratatui::buffer::{Buffer, CellDiffOption};
use ratatui::layout::Rect;
use ratatui::widgets::Widget;

use super::terminal_caps::Graphics;
use crate::tui::modes::PictureMode;
use crate::tui::preview::PreviewContent;
use lumbre_light::film::Image;

/// Number of cached pictures: the two that flicker.
const CAPACITY: usize = 4;
/// Shortest lifetime of a cached picture, in multiples of its cost: see [`crate::tui::preview`].
const LIFETIME_FACTOR: u32 = 150;

/// Width of a cell that contains control sequences besides its character.
const ONE_COLUMN: CellDiffOption = CellDiffOption::ForcedWidth(NonZeroU16::MIN);

/// Pixels with 8 bits for each channel.
pub(crate) struct Picture {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// `width * height` sRGB colours in row order.
    pub rgb: Vec<[u8; 3]>,
}

impl Picture {
    /// Rounds display values between 0 and 1.
    pub(crate) fn from_display(shown: &Image) -> Picture {
        let byte = |x: f32| (x.clamp(0.0, 1.0) * 255.0).round() as u8;
        Picture {
            width: shown.width,
            height: shown.height,
            rgb: shown.data.iter().map(|rgb| rgb.map(byte)).collect(),
        }
    }

    /// Returns the picture as a PNG file, or `None` if it cannot be encoded.
    fn png(&self) -> Option<Vec<u8>> {
        let mut out = Vec::new();
        let mut encoder = png::Encoder::new(&mut out, self.width, self.height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::Fast);
        let mut writer = encoder.write_header().ok()?;
        writer.write_image_data(self.rgb.as_flattened()).ok()?;
        writer.finish().ok()?;
        Some(out)
    }
}

/// A picture encoded for the terminal. As a widget it draws at the top left of its area, and only
/// if the picture fits into the area.
pub struct EncodedPicture {
    /// Columns and rows.
    cells: [u16; 2],
    content: Content,
}

enum Content {
    /// A sequence that draws the whole picture from the cursor on, for sixel and iTerm2.
    Sequence(String),
    /// Placeholders for kitty.
    Placeholders {
        id: u32,
        /// Sequences to be sent before the first placeholder; taken by the first drawing.
        transmission: cell::Cell<Option<String>>,
    },
}

impl EncodedPicture {
    /// Encodes a picture that fills `cells` columns and rows. `number` distinguishes pictures in
    /// the memory of the terminal. Returns `None` for blocks, for a picture without pixels, and if
    /// encoding fails.
    pub(crate) fn new(
        graphics: Graphics,
        cells: [u16; 2],
        picture: &Picture,
        number: u8,
    ) -> Option<EncodedPicture> {
        if picture.rgb.is_empty() || cells.contains(&0) {
            return None;
        }
        let content = match graphics {
            Graphics::Blocks => return None,
            Graphics::Kitty { tmux } => {
                let id = kitty::id(number);
                let transmission = kitty::transmission(picture, cells, id, tmux)?;
                Content::Placeholders {
                    id,
                    transmission: cell::Cell::new(Some(transmission)),
                }
            }
            Graphics::Sixel { tmux } => sequence(cells, &sixel::encode(picture), tmux),
            Graphics::Iterm2 { tmux } => sequence(cells, &iterm2::encode(picture, cells)?, tmux),
        };
        Some(EncodedPicture { cells, content })
    }
}

/// Returns the content that first erases the cells and then draws. Text below a picture that does
/// not cover its last cells completely would remain visible.
fn sequence([columns, rows]: [u16; 2], drawing: &str, tmux: bool) -> Content {
    let mut plain = format!("\u{1b}[{columns}X");
    for _ in 1..rows {
        let _ = write!(plain, "\u{1b}[1B\u{1b}[{columns}X");
    }
    if rows > 1 {
        let _ = write!(plain, "\u{1b}[{}A", rows - 1);
    }
    plain.push_str(drawing);
    let mut out = String::new();
    passthrough(&mut out, &plain, tmux);
    Content::Sequence(out)
}

/// Appends control sequences, with `tmux` in the sequence that makes tmux pass them on.
fn passthrough(out: &mut String, sequences: &str, tmux: bool) {
    if tmux {
        out.push_str("\u{1b}Ptmux;");
        out.push_str(&sequences.replace('\u{1b}', "\u{1b}\u{1b}"));
        out.push_str("\u{1b}\\");
    } else {
        out.push_str(sequences);
    }
}

impl Widget for &EncodedPicture {
    fn render(self, area: Rect, buffer: &mut Buffer) {
        let [width, height] = self.cells;
        let area = area.intersection(buffer.area);
        if area.width < width || area.height < height {
            return;
        }
        for (row, y) in (area.top()..).take(height.into()).enumerate() {
            for (column, x) in (area.left()..).take(width.into()).enumerate() {
                let cell = &mut buffer[(x, y)];
                match &self.content {
                    Content::Sequence(sequence) if (row, column) == (0, 0) => {
                        cell.set_symbol(sequence).set_diff_option(ONE_COLUMN);
                    }
                    Content::Sequence(_) => {
                        cell.set_diff_option(CellDiffOption::Skip);
                    }
                    Content::Placeholders { id, transmission } => {
                        let mut symbol = transmission.take().unwrap_or_default();
                        if kitty::placeholder(&mut symbol, *id, row as u16, column as u16) {
                            cell.set_symbol(&symbol)
                                .set_fg(kitty::color(*id))
                                .set_diff_option(ONE_COLUMN);
                        }
                    }
                }
            }
        }
    }
}

/// An encoded picture and the inputs from which it was made.
struct CachedPicture {
    kind: PictureMode,
    cells: [u16; 2],
    exposure: f32,
    content: Arc<PreviewContent>,
    encoded: EncodedPicture,
    /// Number of the picture in the terminal's memory.
    number: u8,
    made: Instant,
    cost: Duration,
}

/// Cache of the pictures encoded last.
#[derive(Default)]
pub struct GraphicsCache {
    entries: Vec<CachedPicture>,
}

impl std::fmt::Debug for GraphicsCache {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GraphicsCache")
            .field("entries", &self.entries.len())
            .finish_non_exhaustive()
    }
}

impl GraphicsCache {
    /// Returns a picture that fills `cells` character cells, or `None` if it cannot be encoded.
    ///
    /// `shown` computes its display values; `content` and `exposure` are the inputs of `shown` and
    /// serve as the cache key.
    pub fn get(
        &mut self,
        graphics: Graphics,
        kind: PictureMode,
        cells: [u16; 2],
        exposure: f32,
        content: &Arc<PreviewContent>,
        shown: impl FnOnce() -> Image,
    ) -> Option<&EncodedPicture> {
        let index = self
            .entries
            .iter()
            .position(|k| k.kind == kind && k.cells == cells && k.exposure == exposure);
        let number = self.free_number();
        if let Some(i) = index {
            let entry = &self.entries[i];
            if Arc::ptr_eq(&entry.content, content)
                || entry.made.elapsed() < entry.cost * LIFETIME_FACTOR
            {
                return Some(&self.entries[i].encoded);
            }
            self.entries.remove(i);
        } else if self.entries.len() >= CAPACITY {
            self.entries.remove(0);
        }
        let start = Instant::now();
        let picture = Picture::from_display(&shown());
        let encoded = EncodedPicture::new(graphics, cells, &picture, number)?;
        self.entries.push(CachedPicture {
            kind,
            cells,
            exposure,
            content: Arc::clone(content),
            encoded,
            number,
            made: Instant::now(),
            cost: start.elapsed(),
        });
        self.entries.last().map(|entry| &entry.encoded)
    }

    /// Returns the smallest number that no cached picture has. A new picture with the number of
    /// another would replace it in the terminal's memory, while it is cached or on the screen.
    fn free_number(&self) -> u8 {
        let free = |number: &u8| self.entries.iter().all(|entry| entry.number != *number);
        (0..=CAPACITY as u8).find(free).unwrap_or_default()
    }
}
