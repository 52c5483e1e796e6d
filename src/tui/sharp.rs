//! Pictures in full resolution, for terminals that can show them: the protocols of kitty, sixel and iTerm2.
//!
//! No terminal is asked what it can do: under tmux and over slow lines an answer may never come, or come as if it had
//! been typed. What it can do follows from the environment, or is said by `LUMBRE_GRAPHICS`.

use std::sync::Arc;
use std::time::{Duration, Instant};

use image::{DynamicImage, RgbImage};
use ratatui::layout::Size;
use ratatui_image::protocol::Protocol;
use ratatui_image::protocol::iterm2::Iterm2;
use ratatui_image::protocol::kitty::Kitty;
use ratatui_image::protocol::sixel::Sixel;

use super::look::Graphics;
use super::preview::Content;
use super::view::Picture;
use crate::film::Image;

/// Pictures that are kept: two that flicker.
const KEPT: usize = 2;
/// How long a picture is kept at least, in multiples of what it cost: see [`super::preview`].
const REST: u32 = 50;

/// A picture as the terminal wants it.
struct Kept {
    kind: Picture,
    cells: [u16; 2],
    exposure: f32,
    content: Arc<Content>,
    protocol: Protocol,
    made: Instant,
    cost: Duration,
}

/// The pictures that were made last.
#[derive(Default)]
pub struct Sharp {
    kept: Vec<Kept>,
    made: u32,
}

impl std::fmt::Debug for Sharp {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Sharp").field("kept", &self.kept.len()).finish_non_exhaustive()
    }
}

impl Sharp {
    /// A picture that fills `cells` character cells, made of `shown`, whose values are display values; `None` where it
    /// cannot be made. `content` and `exposure` are what `shown` was made of.
    pub fn get(
        &mut self,
        graphics: Graphics,
        kind: Picture,
        cells: [u16; 2],
        exposure: f32,
        content: &Arc<Content>,
        shown: impl FnOnce() -> Image,
    ) -> Option<&Protocol> {
        let place = self.kept.iter().position(|k| k.kind == kind && k.cells == cells && k.exposure == exposure);
        if let Some(i) = place {
            let kept = &self.kept[i];
            if Arc::ptr_eq(&kept.content, content) || kept.made.elapsed() < kept.cost * REST {
                return Some(&self.kept[i].protocol);
            }
            self.kept.remove(i);
        } else if self.kept.len() >= KEPT {
            self.kept.remove(0);
        }
        let start = Instant::now();
        self.made = self.made.wrapping_add(1);
        let protocol = protocol(graphics, cells, &shown(), self.made)?;
        self.kept.push(Kept {
            kind,
            cells,
            exposure,
            content: Arc::clone(content),
            protocol,
            made: Instant::now(),
            cost: start.elapsed(),
        });
        self.kept.last().map(|kept| &kept.protocol)
    }
}

fn protocol(graphics: Graphics, [columns, rows]: [u16; 2], shown: &Image, number: u32) -> Option<Protocol> {
    let byte = |x: &f32| (x.clamp(0.0, 1.0) * 255.0).round() as u8;
    let bytes = shown.data.iter().flatten().map(byte).collect();
    let picture = DynamicImage::ImageRgb8(RgbImage::from_raw(shown.width, shown.height, bytes)?);
    let size = Size::new(columns, rows);
    // Few numbers, so that a new picture takes the place of an old one in the terminal's memory.
    let id = 0x4c75_6d00 + number % 4;
    match graphics {
        Graphics::Blocks => None,
        Graphics::Kitty { tmux } => Kitty::new(picture, size, id, tmux, false).ok().map(Protocol::Kitty),
        Graphics::Sixel { tmux } => Sixel::new(picture, size, tmux).ok().map(Protocol::Sixel),
        Graphics::Iterm2 { tmux } => Iterm2::new(picture, size, tmux).ok().map(Protocol::ITerm2),
    }
}
