//! The pictures that were drawn last, as display values and encoded for the terminal.

use std::sync::Arc;

use crate::explore::session::{Frame as Published, SLOTS};
use crate::tui::preview::box_average;
use crate::tui::terminal::graphics_protocols::{EncodedPicture, Picture};
use crate::tui::terminal::terminal_caps::Graphics;
use lumbre_light::film::Image;
use lumbre_metrics::tonemap::Tonemap;
use lumbre_report::layer::display_values;

/// Inputs of a picture on the screen; equal sources give equal pictures.
#[derive(Clone, Debug)]
pub(super) struct Source {
    pub(super) frame: Arc<Published>,
    pub(super) layer: usize,
    pub(super) tonemap: Tonemap,
    pub(super) resolution: [u32; 2],
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
pub(super) struct CachedTile {
    shown: Option<(Source, Image)>,
    encoded: Option<(Graphics, [u16; 2], EncodedPicture)>,
    /// Number of encoded pictures so far.
    count: u8,
}

/// The pictures that were drawn last, by tile.
#[derive(Default)]
pub struct PictureCache {
    pub(super) tiles: [CachedTile; SLOTS],
}

impl CachedTile {
    /// Returns the display values of a source.
    pub(super) fn display(&mut self, source: Source) -> &Image {
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
    pub(super) fn encode(
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
