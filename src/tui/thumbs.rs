//! The films by strategy of a run, as small pictures.

use crate::experiment::CellRef;
use crate::film::Image;
use crate::film::layer::{LayerImage, Part};
use crate::tui::preview::box_average;

/// The most pixels along one side of a small picture.
const SIDE: u32 = 96;

/// One film.
#[derive(Clone, Debug)]
pub struct Thumb {
    /// Vertices from the light.
    pub s: u32,
    /// Vertices from the camera, the lens included.
    pub t: u32,
    /// Whether it is weighted against the others.
    pub weighted: bool,
    /// The reduced film.
    pub image: Image,
}

/// What the strategies of one run found. Its size depends on the depth of paths, not on that of the picture.
#[derive(Clone, Debug)]
pub struct Thumbs {
    /// The run.
    pub cell: CellRef,
    /// Its films.
    pub films: Vec<Thumb>,
}

impl Thumbs {
    /// The films by strategy among a run's layers; `None` where there are none.
    pub fn of(cell: CellRef, layers: &[LayerImage]) -> Option<Thumbs> {
        let films = layers.iter().filter_map(|layer| {
            let Part::Strategy { s, t, weighted } = layer.film.part else { return None };
            Some(Thumb::of(s, t, weighted, &layer.image))
        });
        let films: Vec<Thumb> = films.collect();
        (!films.is_empty()).then_some(Thumbs { cell, films })
    }
}

impl Thumb {
    /// One film, reduced.
    pub fn of(s: u32, t: u32, weighted: bool, image: &Image) -> Thumb {
        let most = image.width.max(image.height).max(1);
        let scale = |side: u32| (u64::from(side) * u64::from(SIDE) / u64::from(most)).max(1) as u32;
        let size = if most <= SIDE { [image.width, image.height] } else { [scale(image.width), scale(image.height)] };
        Thumb { s, t, weighted, image: box_average(image, size[0].max(1), size[1].max(1)) }
    }
}
