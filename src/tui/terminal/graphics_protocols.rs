//! Pictures in full resolution through the protocols of kitty, sixel and iTerm2.
//!
//! The terminal is never queried: under tmux and over slow lines a reply may be lost or arrive as
//! keyboard input. The protocol follows from the environment or from `LUMBRE_GRAPHICS`.

use std::sync::Arc;
use std::time::{Duration, Instant};

use image::{DynamicImage, RgbImage};
use ratatui::layout::Size;
use ratatui_image::protocol::Protocol;
use ratatui_image::protocol::iterm2::Iterm2;
use ratatui_image::protocol::kitty::Kitty;
use ratatui_image::protocol::sixel::Sixel;

use super::terminal_caps::Graphics;
use crate::film::Image;
use crate::tui::preview::PreviewContent;
use crate::tui::view::PictureMode;

/// Number of cached pictures: the two that flicker.
const CAPACITY: usize = 2;
/// Shortest lifetime of a cached picture, in multiples of its cost: see [`crate::tui::preview`].
const LIFETIME_FACTOR: u32 = 50;

/// A picture encoded for the terminal.
struct CachedPicture {
    kind: PictureMode,
    cells: [u16; 2],
    exposure: f32,
    content: Arc<PreviewContent>,
    protocol: Protocol,
    made: Instant,
    cost: Duration,
}

/// Cache of the pictures encoded last.
#[derive(Default)]
pub struct GraphicsCache {
    entries: Vec<CachedPicture>,
    made: u32,
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
    ) -> Option<&Protocol> {
        let index = self
            .entries
            .iter()
            .position(|k| k.kind == kind && k.cells == cells && k.exposure == exposure);
        if let Some(i) = index {
            let entry = &self.entries[i];
            if Arc::ptr_eq(&entry.content, content)
                || entry.made.elapsed() < entry.cost * LIFETIME_FACTOR
            {
                return Some(&self.entries[i].protocol);
            }
            self.entries.remove(i);
        } else if self.entries.len() >= CAPACITY {
            self.entries.remove(0);
        }
        let start = Instant::now();
        self.made = self.made.wrapping_add(1);
        let protocol = protocol(graphics, cells, &shown(), self.made)?;
        self.entries.push(CachedPicture {
            kind,
            cells,
            exposure,
            content: Arc::clone(content),
            protocol,
            made: Instant::now(),
            cost: start.elapsed(),
        });
        self.entries.last().map(|entry| &entry.protocol)
    }
}

fn protocol(
    graphics: Graphics,
    [columns, rows]: [u16; 2],
    shown: &Image,
    number: u32,
) -> Option<Protocol> {
    let byte = |x: &f32| (x.clamp(0.0, 1.0) * 255.0).round() as u8;
    let bytes = shown.data.iter().flatten().map(byte).collect();
    let picture = DynamicImage::ImageRgb8(RgbImage::from_raw(shown.width, shown.height, bytes)?);
    let size = Size::new(columns, rows);
    // Reusing a few ids makes a new picture replace an old one in the terminal's memory.
    let id = 0x4c75_6d00 + number % 4;
    match graphics {
        Graphics::Blocks => None,
        Graphics::Kitty { tmux } => Kitty::new(picture, size, id, tmux, false)
            .ok()
            .map(Protocol::Kitty),
        Graphics::Sixel { tmux } => Sixel::new(picture, size, tmux).ok().map(Protocol::Sixel),
        Graphics::Iterm2 { tmux } => Iterm2::new(picture, size, tmux).ok().map(Protocol::ITerm2),
    }
}
