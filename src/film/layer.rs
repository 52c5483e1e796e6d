//! Layers: films that a run fills beside its main one, taken apart by path length or strategy, or of what the camera
//! sees first.
//!
//! A script asks for them by the names of [`LAYERS`]. All but the first three kinds are made of the sample's own camera
//! ray; the first three are made of the very contributions that make the picture, so that the films of one kind add up
//! to it.

use std::iter::once;

use super::{Film, Image};

/// A kind of layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Layer {
    /// Light by the length of its path.
    Depth,
    /// Light by the strategy that found it, weighted and raw.
    Strategies,
    /// How often light has bounced.
    Bounces,
    /// How many rays a sample costs.
    Rays,
    /// The colour of the first surface.
    Albedo,
    /// The direction of the first surface.
    Normal,
    /// The distance of the first surface.
    Distance,
}

/// How a layer becomes a picture for people.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Look {
    /// Radiance: the tone map of the main picture.
    Radiance,
    /// Numbers in the first channel, from 0 to the greatest: a colour map.
    Heat,
    /// Reflectance in 0..=1: the sRGB transfer curve.
    Reflectance,
    /// Components of a unit vector: `0.5 n + 0.5`, without a transfer curve.
    Direction,
}

/// One row of [`LAYERS`].
#[derive(Debug)]
pub struct LayerRow {
    /// Which one.
    pub layer: Layer,
    /// The name in scripts, and of the files or the beginning of their names.
    pub name: &'static str,
    /// What it shows, in a sentence.
    pub doc: &'static str,
    /// What the three channels of its images hold.
    pub channels: [&'static str; 3],
    /// How it becomes a picture for people.
    pub look: Look,
    /// What the three sums of a pixel say: whether the first is divided by the second, which is then what it was
    /// weighted by, or all by the number of samples.
    pub ratio: bool,
    /// Whether splats land on it.
    pub splats: bool,
    /// The films that it has, given the greatest path length.
    pub parts: fn(u32) -> Box<dyn Iterator<Item = Part>>,
}

const RGB: [&str; 3] = ["red", "green", "blue"];

/// Every kind of layer there is.
pub const LAYERS: &[LayerRow] = &[
    LayerRow {
        layer: Layer::Depth,
        name: "depth",
        doc: "radiance of the paths of each number of edges, one film for each from 1 to max_depth; they add up to the \
              picture",
        channels: RGB,
        look: Look::Radiance,
        ratio: false,
        splats: true,
        parts: |max_depth| Box::new((1..=max_depth).map(Part::Depth)),
    },
    LayerRow {
        layer: Layer::Strategies,
        name: "strategies",
        doc: "radiance found by each strategy (s, t), weighted and raw (without weights); the weighted ones add up to \
              the picture, and each raw one is what its strategy alone would say [Veach 1997, ch. 10]",
        channels: RGB,
        look: Look::Radiance,
        ratio: false,
        splats: true,
        parts: |max_depth| {
            let ways = (1..=max_depth).flat_map(|k| (0..=k).map(move |s| (s, k + 1 - s)));
            Box::new(ways.flat_map(|(s, t)| [true, false].map(|weighted| Part::Strategy { s, t, weighted })))
        },
    },
    LayerRow {
        layer: Layer::Bounces,
        name: "bounces",
        doc: "how often the light of a pixel has bounced between its source and the camera: the mean of path edges \
              minus one, weighted by luminance, which is the same for every integrator; 0 where there is no light",
        channels: ["mean bounces", "luminance they are weighted by", "zero"],
        look: Look::Heat,
        ratio: true,
        splats: true,
        parts: |_| Box::new(once(Part::Whole)),
    },
    LayerRow {
        layer: Layer::Rays,
        name: "rays",
        doc: "what a sample of a pixel costs: mean number of rays, shadow rays included, until its paths have ended",
        channels: ["rays per sample"; 3],
        look: Look::Heat,
        ratio: false,
        splats: false,
        parts: |_| Box::new(once(Part::Whole)),
    },
    LayerRow {
        layer: Layer::Albedo,
        name: "albedo",
        doc: "base colour of the first surface, texture included; black where nothing is hit",
        channels: RGB,
        look: Look::Reflectance,
        ratio: false,
        splats: false,
        parts: |_| Box::new(once(Part::Whole)),
    },
    LayerRow {
        layer: Layer::Normal,
        name: "normal",
        doc: "shading normal of the first surface in world space, on the side that the ray came from; its mean is \
              shorter than 1 where samples differ, and 0 where nothing is hit",
        channels: ["x", "y", "z"],
        look: Look::Direction,
        ratio: false,
        splats: false,
        parts: |_| Box::new(once(Part::Whole)),
    },
    LayerRow {
        layer: Layer::Distance,
        name: "distance",
        doc: "mean distance along the ray to the first surface in scene units, over the samples that hit one; 0 where \
              none did",
        channels: ["distance", "share of samples that hit", "zero"],
        look: Look::Heat,
        ratio: true,
        splats: false,
        parts: |_| Box::new(once(Part::Whole)),
    },
];

/// The names of [`LAYERS`], for the check of scripts and for annotations.
pub const LAYER_NAMES: [&str; LAYERS.len()] = {
    let mut names = [""; LAYERS.len()];
    let mut i = 0;
    while i < names.len() {
        names[i] = LAYERS[i].name;
        i += 1;
    }
    names
};

impl Layer {
    /// The kind that a script means by `name`.
    pub fn from_name(name: &str) -> Option<Layer> {
        LAYERS.iter().find(|row| row.name == name).map(|row| row.layer)
    }

    /// Its row.
    pub fn row(self) -> &'static LayerRow {
        &LAYERS[self as usize]
    }
}

/// What of the light a film of a layer shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// All that its layer shows.
    Whole,
    /// Paths of so many edges.
    Depth(u32),
    /// What one strategy finds.
    Strategy {
        /// Vertices from the light.
        s: u32,
        /// Vertices from the camera, the lens included.
        t: u32,
        /// Whether it is weighted against the others.
        weighted: bool,
    },
}

/// One film of a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LayerFilm {
    /// The kind.
    pub layer: Layer,
    /// What of it.
    pub part: Part,
    /// Whether splats land on it.
    pub splats: bool,
}

impl LayerFilm {
    /// Its name, that of its files: `depth-3`, `strategies-s2-t1-raw`, `albedo`.
    pub fn name(&self) -> String {
        let name = self.layer.row().name;
        match self.part {
            Part::Whole => name.to_owned(),
            Part::Depth(k) => format!("{name}-{k}"),
            Part::Strategy { s, t, weighted } => {
                format!("{name}-s{s}-t{t}-{}", if weighted { "weighted" } else { "raw" })
            }
        }
    }

    /// The image of the sums of this film.
    pub fn image(&self, film: &Film) -> Image {
        if !self.layer.row().ratio {
            return film.mean();
        }
        let n = film.samples.max(1) as f64;
        let pixel = |&[weighted, weight, _]: &[f64; 3]| {
            [if weight > 0.0 { (weighted / weight) as f32 } else { 0.0 }, (weight / n) as f32, 0.0]
        };
        Image { width: film.width, height: film.height, data: film.sum.iter().map(pixel).collect() }
    }
}

/// The films of a run's layers, and where in its sums each is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Layout {
    films: Vec<LayerFilm>,
    /// Place of the first film of each kind that is there.
    first: [Option<usize>; LAYERS.len()],
    pixels: u64,
    bytes_per_pixel: u64,
}

/// Bytes of a film's sums for each pixel: three sums and three sums of squares.
pub const BYTES_PER_PIXEL: u64 = 48;

/// Bytes of the sums of its splats for each pixel, for a film on which they land.
pub const SPLAT_BYTES_PER_PIXEL: u64 = 96;

/// The most bytes that the layers of one run may take: 8 GiB.
pub const MAX_BYTES: u64 = 8 << 30;

/// The most films that the layers of one run may have; each becomes two files.
pub const MAX_FILMS: usize = 4096;

impl Layout {
    /// The films of some kinds of layers, in the order of [`LAYERS`], for paths of up to `max_depth` edges and pictures
    /// of `pixels` pixels.
    ///
    /// # Errors
    /// In words, when they are more than [`MAX_FILMS`] or take more than [`MAX_BYTES`].
    pub fn new(layers: &[Layer], max_depth: u32, pixels: u64) -> Result<Layout, String> {
        let mut layout = Layout { pixels, ..Layout::default() };
        for row in LAYERS.iter().filter(|row| layers.contains(&row.layer)) {
            layout.first[row.layer as usize] = Some(layout.films.len());
            for part in (row.parts)(max_depth) {
                let splats = row.splats && !matches!(part, Part::Strategy { t: 2.., .. });
                layout.bytes_per_pixel += BYTES_PER_PIXEL + u64::from(splats) * SPLAT_BYTES_PER_PIXEL;
                layout.films.push(LayerFilm { layer: row.layer, part, splats });
                layout.check(max_depth)?;
            }
        }
        Ok(layout)
    }

    fn check(&self, max_depth: u32) -> Result<(), String> {
        let gib = MAX_BYTES >> 30;
        let limit = match self.films.len() {
            0..=MAX_FILMS if self.bytes() <= MAX_BYTES => return Ok(()),
            0..=MAX_FILMS => format!("{gib} GiB, at {} bytes for each of {} pixels", self.bytes_per_pixel, self.pixels),
            _ => format!("{MAX_FILMS} films"),
        };
        Err(format!(
            "the layers in `films` need more than {limit}, for paths of up to {max_depth} edges: lower max_depth or the \
             resolution, or ask for fewer layers"
        ))
    }

    /// The films.
    pub fn films(&self) -> &[LayerFilm] {
        &self.films
    }

    /// Where the film of a layer with one film is.
    #[inline]
    pub fn whole(&self, layer: Layer) -> Option<usize> {
        self.first[layer as usize]
    }

    /// Where the film of paths of `k` edges is, from 1.
    #[inline]
    pub fn depth(&self, k: u32) -> Option<usize> {
        self.first[Layer::Depth as usize].map(|first| first + k as usize - 1)
    }

    /// Where the weighted film of a strategy is; the raw one is next. At least two vertices are a path.
    #[inline]
    pub fn strategy(&self, s: u32, t: u32) -> Option<usize> {
        // Depth k has k + 1 strategies, so (k - 1)(k + 2) / 2 come before them.
        let k = (s + t - 1) as usize;
        self.first[Layer::Strategies as usize].map(|first| first + (k - 1) * (k + 2) + 2 * s as usize)
    }

    /// Bytes of memory that the sums take at most. Those for splats are taken only once there is one.
    pub fn bytes(&self) -> u64 {
        self.bytes_per_pixel.saturating_mul(self.pixels)
    }
}

/// The image of one film of a layer.
#[derive(Clone, Debug, PartialEq)]
pub struct LayerImage {
    /// Which.
    pub film: LayerFilm,
    /// Its pixels; the channels are those of its layer's row.
    pub image: Image,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_stand_where_their_kind_says() {
        for (i, row) in LAYERS.iter().enumerate() {
            assert_eq!(row.layer as usize, i);
            assert_eq!(Layer::from_name(row.name), Some(row.layer));
            assert!(row.layer.row().doc.len() > 20);
        }
        assert_eq!(Layer::from_name("depths"), None);
    }

    #[test]
    fn every_film_is_found_where_it_is() {
        let all: Vec<Layer> = LAYERS.iter().map(|row| row.layer).collect();
        let layout = Layout::new(&all, 6, 1).unwrap();
        for (i, film) in layout.films().iter().enumerate() {
            let found = match film.part {
                Part::Whole => layout.whole(film.layer),
                Part::Depth(k) => layout.depth(k),
                Part::Strategy { s, t, weighted } => layout.strategy(s, t).map(|at| at + usize::from(!weighted)),
            };
            assert_eq!(found, Some(i), "{}", film.name());
        }
        let mut names: Vec<String> = layout.films().iter().map(LayerFilm::name).collect();
        assert_eq!(names.len(), 6 + 2 * (2 + 3 + 4 + 5 + 6 + 7) + 5);
        names.sort();
        names.dedup();
        assert_eq!(names.len(), layout.films().len(), "names are unique");
        let none = Layout::new(&[], 6, 1).unwrap();
        assert_eq!((none.depth(2), none.strategy(1, 2), none.whole(Layer::Rays)), (None, None, None));
    }

    #[test]
    fn memory_is_known_and_limited() {
        // Depth 2: (0,2) (1,1) (0,3) (1,2) (2,1), each twice, and two of them with splats.
        let bytes = |layers: &[Layer], depth, pixels| Layout::new(layers, depth, pixels).map(|layout| layout.bytes());
        assert_eq!(bytes(&[Layer::Strategies], 2, 10), Ok(10 * (10 * 48 + 4 * 96)));
        assert_eq!(bytes(&[], 10_000, 1 << 40), Ok(0));
        let error = bytes(&[Layer::Strategies], 20, 1 << 20).unwrap_err();
        assert!(error.contains("8 GiB") && error.contains("lower max_depth"), "{error}");
        let error = bytes(&[Layer::Strategies], 10_000, 1).unwrap_err();
        assert!(error.contains("4096 films"), "{error}");
    }

    #[test]
    fn ratios_are_taken_once_all_is_summed() {
        let mut film = Film::new(2, 1);
        (film.samples, film.sum[0]) = (4, [6.0, 2.0, 0.0]);
        let bounces = Layout::new(&[Layer::Bounces], 5, 2).unwrap().films()[0];
        assert_eq!(bounces.image(&film).data, [[3.0, 0.5, 0.0], [0.0; 3]]);
    }
}
