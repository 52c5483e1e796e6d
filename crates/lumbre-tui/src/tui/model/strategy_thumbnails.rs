//! Thumbnails of a run's per-strategy films.

use crate::tui::preview::box_average;
use lumbre_light::film::Image;
use lumbre_light::film::layer::{LayerImage, PathSubset};
use lumbre_night::experiment::CellRef;

/// Longest side of a thumbnail in pixels.
const SIDE: u32 = 96;

/// Thumbnail of one strategy's film.
#[derive(Clone, Debug)]
pub struct StrategyThumbnail {
    /// Number of vertices of the light subpath.
    pub s: u32,
    /// Number of vertices of the camera subpath, including the lens vertex.
    pub t: u32,
    /// Whether the film is weighted by multiple importance sampling.
    pub weighted: bool,
    /// Reduced film, in linear radiance.
    pub image: Image,
}

/// Thumbnails of all strategies of one run. Memory depends on the path depth and not on the
/// resolution of the film.
#[derive(Clone, Debug)]
pub struct StrategyThumbnails {
    /// Run to which the films belong.
    pub cell: CellRef,
    /// Thumbnails, one for each strategy.
    pub films: Vec<StrategyThumbnail>,
}

impl StrategyThumbnails {
    /// Reduces the per-strategy films among a run's layers; `None` if there are none.
    pub fn from_layers(cell: CellRef, layers: &[LayerImage]) -> Option<StrategyThumbnails> {
        let films = layers.iter().filter_map(StrategyThumbnail::from_layer);
        let films: Vec<StrategyThumbnail> = films.collect();
        (!films.is_empty()).then_some(StrategyThumbnails { cell, films })
    }
}

impl StrategyThumbnail {
    /// Reduces one film to at most `SIDE` pixels along each side; `None` for other layers.
    pub fn from_layer(layer: &LayerImage) -> Option<StrategyThumbnail> {
        let PathSubset::Strategy { s, t, weighted } = layer.film.subset else {
            return None;
        };
        let image = &layer.image;
        let most = image.width.max(image.height).max(1);
        let scale = |side: u32| (u64::from(side) * u64::from(SIDE) / u64::from(most)).max(1) as u32;
        let size = if most <= SIDE {
            [image.width, image.height]
        } else {
            [scale(image.width), scale(image.height)]
        };
        Some(StrategyThumbnail {
            s,
            t,
            weighted,
            image: box_average(image, size[0].max(1), size[1].max(1)),
        })
    }
}
