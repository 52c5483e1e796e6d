//! Layers: films that a run fills beside its main one. Some split the light by path length or
//! strategy; others record what the camera sees first.
//!
//! Scripts select layers by the names in [`LAYERS`]. The first three kinds are made from the very
//! contributions that make the picture, so the films of one kind add up to it. All others but
//! [`Layer::Variance`] are computed from the sample's own camera ray.

use std::iter::once;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::{Film, Image};

/// Kind of a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Layer {
    /// Radiance by path length.
    Depth,
    /// Radiance by the strategy that found it, weighted and raw.
    Strategies,
    /// Mean number of bounces of the light.
    Bounces,
    /// Mean number of rays per sample.
    Rays,
    /// Base colour of the first surface.
    Albedo,
    /// Shading normal of the first surface.
    Normal,
    /// Distance to the first surface.
    Distance,
    /// Position of the first surface.
    Position,
    /// Texture coordinates of the first surface.
    Uv,
    /// Index of the object that the first sample hits.
    ShapeIndex,
    /// Index of the primitive that the first sample hits, in its object.
    PrimIndex,
    /// Sample variance of the picture.
    Variance,
}

/// First surface that the camera ray of a sample hits.
#[derive(Clone, Copy, Debug, Default)]
pub struct FirstHit {
    /// Base colour, textures included.
    pub albedo: Vec3,
    /// Unit shading normal in world space, on the side of the camera.
    pub normal: Vec3,
    /// Distance along the ray, in scene units.
    pub distance: f32,
    /// Position in world space, in scene units.
    pub position: Vec3,
    /// Texture coordinates before tiling.
    pub uv: [f32; 2],
    /// Index of its object in the description of the scene.
    pub shape: u32,
    /// Index of its primitive in that object.
    pub primitive: u32,
}

/// Origin of the values of a layer.
#[derive(Clone, Copy, Debug)]
pub enum LayerSource {
    /// Contributions to the picture, splats included.
    Contributions,
    /// Number of rays of each sample.
    Rays,
    /// Value of the first surface of each sample; zero for a sample that hits nothing.
    FirstHit(fn(&FirstHit) -> Vec3),
    /// Index of the first surface of the pixel's first sample, since a mean of indices has no
    /// meaning. The sum of a film is the index plus one, and zero where nothing is hit.
    FirstIndex(fn(&FirstHit) -> u32),
    /// Sums of the picture itself, whose sample variance it shows. Such films have no sums of their
    /// own, and follow all others.
    Variance,
}

/// Display of a layer as a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LayerDisplay {
    /// Radiance, displayed with the tone map of the main picture.
    Radiance,
    /// Numbers in the first channel, displayed with a colour map from 0 to the greatest.
    Heat,
    /// Reflectance in 0..=1, displayed with the sRGB transfer curve.
    Reflectance,
    /// Components of a unit vector, displayed as `0.5 n + 0.5` without a transfer curve.
    Direction,
    /// Numbers of any range, each channel displayed from its least to its greatest value.
    Range,
    /// Indices in the first channel, each displayed in a colour of its own; -1 is black.
    Index,
}

/// Table row of [`LAYERS`].
#[derive(Debug)]
pub struct LayerRow {
    /// The kind that this row describes.
    pub layer: Layer,
    /// Name in scripts, also used for file names or as their prefix.
    pub name: &'static str,
    /// Description in one sentence.
    pub doc: &'static str,
    /// Meaning of the three channels of its images.
    pub channels: [&'static str; 3],
    /// Names of the first of these channels in the OpenEXR file of the picture, as pbrt-v4 writes
    /// them if it does. Empty if its films are stored in files of their own.
    pub exr: &'static [&'static str],
    /// Origin of its values.
    pub source: LayerSource,
    /// Display of its images as pictures.
    pub display: LayerDisplay,
    /// Whether the image is a ratio: the first sum of a pixel divided by the second, which holds
    /// the weights. Otherwise all sums are divided by the number of samples.
    pub ratio: bool,
    /// Iterates over the films that this layer has, given the greatest path length.
    pub subsets: fn(u32) -> Box<dyn Iterator<Item = PathSubset>>,
}

const RGB: [&str; 3] = ["red", "green", "blue"];
const XYZ: [&str; 3] = ["x", "y", "z"];

/// Subsets of a layer that has a single film.
fn whole(_: u32) -> Box<dyn Iterator<Item = PathSubset>> {
    Box::new(once(PathSubset::Whole))
}

/// Table of all layers.
pub const LAYERS: &[LayerRow] = &[
    LayerRow {
        layer: Layer::Depth,
        name: "depth",
        doc: "radiance by number of path edges, one film for each from 1 to max_depth; they add \
              up to the picture",
        channels: RGB,
        exr: &[],
        source: LayerSource::Contributions,
        display: LayerDisplay::Radiance,
        ratio: false,
        subsets: |max_depth| Box::new((1..=max_depth).map(PathSubset::Depth)),
    },
    LayerRow {
        layer: Layer::Strategies,
        name: "strategies",
        doc: "radiance found by each strategy (s, t), weighted and raw (unweighted); the weighted \
              films add up to the picture, and each raw film is the estimate of its strategy alone \
              [Veach 1997, ch. 10]",
        channels: RGB,
        exr: &[],
        source: LayerSource::Contributions,
        display: LayerDisplay::Radiance,
        ratio: false,
        subsets: |max_depth| {
            let strategies = (1..=max_depth).flat_map(|k| (0..=k).map(move |s| (s, k + 1 - s)));
            Box::new(strategies.flat_map(|(s, t)| {
                [true, false].map(|weighted| PathSubset::Strategy { s, t, weighted })
            }))
        },
    },
    LayerRow {
        layer: Layer::Bounces,
        name: "bounces",
        doc: "mean number of bounces between light source and camera: path edges minus one, \
              weighted by luminance; the same for every integrator, and 0 where there is no light",
        channels: ["mean bounces", "luminance used as weight", "zero"],
        exr: &["Bounces"],
        source: LayerSource::Contributions,
        display: LayerDisplay::Heat,
        ratio: true,
        subsets: whole,
    },
    LayerRow {
        layer: Layer::Rays,
        name: "rays",
        doc: "cost of a sample: mean number of rays traced per sample, shadow rays included",
        channels: ["rays per sample"; 3],
        exr: &["Rays"],
        source: LayerSource::Rays,
        display: LayerDisplay::Heat,
        ratio: false,
        subsets: whole,
    },
    LayerRow {
        layer: Layer::Albedo,
        name: "albedo",
        doc: "base colour of the first surface, including its texture; black where nothing is hit",
        channels: RGB,
        exr: &["Albedo.R", "Albedo.G", "Albedo.B"],
        source: LayerSource::FirstHit(|hit| hit.albedo),
        display: LayerDisplay::Reflectance,
        ratio: false,
        subsets: whole,
    },
    LayerRow {
        layer: Layer::Normal,
        name: "normal",
        doc: "shading normal of the first surface in world space, on the side of the camera; \
              shorter than 1 where the normals of samples differ, and 0 where nothing is hit",
        channels: XYZ,
        exr: &["Ns.X", "Ns.Y", "Ns.Z"],
        source: LayerSource::FirstHit(|hit| hit.normal),
        display: LayerDisplay::Direction,
        ratio: false,
        subsets: whole,
    },
    LayerRow {
        layer: Layer::Distance,
        name: "distance",
        doc: "mean distance along the ray to the first surface in scene units, over the samples \
              that hit one; 0 where none did",
        channels: ["distance", "share of samples that hit", "zero"],
        exr: &["Distance.Z", "Distance.A"],
        source: LayerSource::FirstHit(|hit| Vec3::new(hit.distance, 1.0, 0.0)),
        display: LayerDisplay::Heat,
        ratio: true,
        subsets: whole,
    },
    LayerRow {
        layer: Layer::Position,
        name: "position",
        doc: "position of the first surface in world space, in scene units, the mean over all \
              samples of the pixel; a sample that hits nothing counts as 0",
        channels: XYZ,
        exr: &["P.X", "P.Y", "P.Z"],
        source: LayerSource::FirstHit(|hit| hit.position),
        display: LayerDisplay::Range,
        ratio: false,
        subsets: whole,
    },
    LayerRow {
        layer: Layer::Uv,
        name: "uv",
        doc: "texture coordinates of the first surface before tiling, the mean over all samples of \
              the pixel; a sample that hits nothing counts as 0",
        channels: ["u", "v", "zero"],
        exr: &["u", "v"],
        source: LayerSource::FirstHit(|hit| Vec3::new(hit.uv[0], hit.uv[1], 0.0)),
        display: LayerDisplay::Range,
        ratio: false,
        subsets: whole,
    },
    LayerRow {
        layer: Layer::ShapeIndex,
        name: "shape_index",
        doc: "index of the first object that the first sample of the pixel hits, counted from 0 in \
              the order of the scene; -1 where that sample hits nothing",
        channels: ["index of the object", "zero", "zero"],
        exr: &["ShapeIndex"],
        source: LayerSource::FirstIndex(|hit| hit.shape),
        display: LayerDisplay::Index,
        ratio: false,
        subsets: whole,
    },
    LayerRow {
        layer: Layer::PrimIndex,
        name: "prim_index",
        doc: "index in its object of the first triangle that the first sample of the pixel hits, \
              counted from 0 without triangles that have no area; 0 on spheres, and -1 where that \
              sample hits nothing",
        channels: ["index of the primitive", "zero", "zero"],
        exr: &["PrimIndex"],
        source: LayerSource::FirstIndex(|hit| hit.primitive),
        display: LayerDisplay::Index,
        ratio: false,
        subsets: whole,
    },
    LayerRow {
        layer: Layer::Variance,
        name: "variance",
        doc: "sample variance of the pixel, (sum of x^2 - (sum of x)^2 / n) / (n - 1) over the n \
              samples x, before denoising; divided by n it is the variance of the mean, and it is \
              0 for a single sample",
        channels: RGB,
        exr: &["Variance.R", "Variance.G", "Variance.B"],
        source: LayerSource::Variance,
        display: LayerDisplay::Radiance,
        ratio: false,
        subsets: whole,
    },
];

/// Names of all [`LAYERS`], used to check scripts and for annotations.
pub const LAYER_NAMES: [&str; LAYERS.len()] = {
    let mut names = [""; LAYERS.len()];
    let mut i = 0;
    while i < names.len() {
        names[i] = LAYERS[i].name;
        i += 1;
    }
    names
};

/// Kinds of all [`LAYERS`].
pub const ALL: [Layer; LAYERS.len()] = {
    let mut layers = [Layer::Depth; LAYERS.len()];
    let mut i = 0;
    while i < layers.len() {
        layers[i] = LAYERS[i].layer;
        i += 1;
    }
    layers
};

impl Layer {
    /// Returns the kind with this name in scripts.
    pub fn from_name(name: &str) -> Option<Layer> {
        LAYERS
            .iter()
            .find(|row| row.name == name)
            .map(|row| row.layer)
    }

    /// Returns its table row.
    pub fn row(self) -> &'static LayerRow {
        &LAYERS[self as usize]
    }
}

/// Subset of the light that a film of a layer shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PathSubset {
    /// Everything that its layer shows.
    Whole,
    /// Paths with this number of edges.
    Depth(u32),
    /// Paths found by one strategy.
    Strategy {
        /// Number of vertices of the light subpath.
        s: u32,
        /// Number of vertices of the camera subpath, the lens included.
        t: u32,
        /// Whether contributions are weighted against the other strategies by multiple importance
        /// sampling.
        weighted: bool,
    },
}

/// Description of one film of a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LayerFilm {
    /// Kind of its layer.
    pub layer: Layer,
    /// Subset of the light that it shows.
    pub subset: PathSubset,
    /// Whether splats contribute to it.
    pub splats: bool,
}

impl LayerFilm {
    /// Returns its name, also used for its files: `depth-3`, `strategies-s2-t1-raw`, `albedo`.
    pub fn name(&self) -> String {
        let name = self.layer.row().name;
        match self.subset {
            PathSubset::Whole => name.to_owned(),
            PathSubset::Depth(k) => format!("{name}-{k}"),
            PathSubset::Strategy { s, t, weighted } => {
                format!(
                    "{name}-s{s}-t{t}-{}",
                    if weighted { "weighted" } else { "raw" }
                )
            }
        }
    }

    /// Returns the image for the sums of this film.
    pub fn image(&self, film: &Film) -> Image {
        let n = film.samples.max(1) as f64;
        let ratio = |&[weighted, weight, _]: &[f64; 3]| {
            [
                if weight > 0.0 {
                    (weighted / weight) as f32
                } else {
                    0.0
                },
                (weight / n) as f32,
                0.0,
            ]
        };
        let row = self.layer.row();
        let data = match row.source {
            LayerSource::Variance => return film.variance(),
            LayerSource::FirstIndex(_) => {
                let index = |sum: &[f64; 3]| [(sum[0] - 1.0) as f32, 0.0, 0.0];
                film.sum.iter().map(index).collect()
            }
            _ if row.ratio => film.sum.iter().map(ratio).collect(),
            _ => return film.mean(),
        };
        Image::from_pixels(film.width, film.height, data)
    }
}

/// Films of a run's layers and their indices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LayerLayout {
    films: Vec<LayerFilm>,
    /// Index of the first film of each kind, `None` if the run does not have it.
    first: [Option<usize>; LAYERS.len()],
    pixels: u64,
    bytes_per_pixel: u64,
}

/// Size of a film's sums in bytes per pixel: three sums and three sums of squares.
pub const BYTES_PER_PIXEL: u64 = 48;

/// Size of the splat sums in bytes per pixel, for a film that receives splats.
pub const SPLAT_BYTES_PER_PIXEL: u64 = 96;

/// Maximum memory of the layers of one run: 8 GiB.
pub const MAX_BYTES: u64 = 8 << 30;

/// Maximum number of films of the layers of one run; each is written to two files.
pub const MAX_FILMS: usize = 4096;

impl LayerLayout {
    /// Lays out the films of some kinds of layers, in the order of [`LAYERS`], for paths of up to
    /// `max_depth` edges and pictures of `pixels` pixels.
    ///
    /// # Errors
    /// Returns a message if there are more than [`MAX_FILMS`] or they need more than [`MAX_BYTES`].
    pub fn new(layers: &[Layer], max_depth: u32, pixels: u64) -> Result<LayerLayout, String> {
        let mut layout = LayerLayout {
            pixels,
            ..LayerLayout::default()
        };
        for row in LAYERS.iter().filter(|row| layers.contains(&row.layer)) {
            layout.first[row.layer as usize] = Some(layout.films.len());
            for subset in (row.subsets)(max_depth) {
                let splats = matches!(row.source, LayerSource::Contributions)
                    && !matches!(subset, PathSubset::Strategy { t: 2.., .. });
                let own = !matches!(row.source, LayerSource::Variance);
                layout.bytes_per_pixel +=
                    u64::from(own) * BYTES_PER_PIXEL + u64::from(splats) * SPLAT_BYTES_PER_PIXEL;
                layout.films.push(LayerFilm {
                    layer: row.layer,
                    subset,
                    splats,
                });
                layout.check(max_depth)?;
            }
        }
        Ok(layout)
    }

    fn check(&self, max_depth: u32) -> Result<(), String> {
        let gib = MAX_BYTES >> 30;
        let limit = match self.films.len() {
            0..=MAX_FILMS if self.bytes() <= MAX_BYTES => return Ok(()),
            0..=MAX_FILMS => format!(
                "{gib} GiB, at {} bytes for each of {} pixels",
                self.bytes_per_pixel, self.pixels
            ),
            _ => format!("{MAX_FILMS} films"),
        };
        Err(format!(
            "the layers in `films` need more than {limit}, for paths of up to {max_depth} edges: \
             lower max_depth or the resolution, or select fewer layers"
        ))
    }

    /// Returns all films.
    pub fn films(&self) -> &[LayerFilm] {
        &self.films
    }

    /// Returns the films that have sums of their own, which precede all others.
    pub fn summed(&self) -> &[LayerFilm] {
        let has_sums = |film: &LayerFilm| !matches!(film.layer.row().source, LayerSource::Variance);
        &self.films[..self.films.partition_point(has_sums)]
    }

    /// Returns the number of films to which contributions are added, which precede all others.
    pub fn contribution_films(&self) -> usize {
        let adds = |film: &LayerFilm| matches!(film.layer.row().source, LayerSource::Contributions);
        self.films.partition_point(adds)
    }

    /// Returns the index of the film of a layer that has a single film.
    #[inline]
    pub fn single(&self, layer: Layer) -> Option<usize> {
        self.first[layer as usize]
    }

    /// Returns the index of the film of paths of `k` edges, `k >= 1`.
    #[inline]
    pub fn depth(&self, k: u32) -> Option<usize> {
        self.first[Layer::Depth as usize].map(|first| first + k as usize - 1)
    }

    /// Returns the index of the weighted film of a strategy; the raw film follows it. `s + t` must
    /// be at least 2.
    #[inline]
    pub fn strategy(&self, s: u32, t: u32) -> Option<usize> {
        // Depth k has k + 1 strategies, so (k - 1)(k + 2) / 2 strategies precede those of depth k.
        let k = (s + t - 1) as usize;
        self.first[Layer::Strategies as usize]
            .map(|first| first + (k - 1) * (k + 2) + 2 * s as usize)
    }

    /// Returns the maximum memory of the sums in bytes. Splat sums are allocated only when the
    /// first splat arrives.
    pub fn bytes(&self) -> u64 {
        self.bytes_per_pixel.saturating_mul(self.pixels)
    }
}

/// Image of one film of a layer.
#[derive(Clone, Debug, PartialEq)]
pub struct LayerImage {
    /// Film that the image was made from.
    pub film: LayerFilm,
    /// Pixels; the channels are those of the layer's table row.
    pub image: Image,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_indexed_by_their_kind() {
        for (i, row) in LAYERS.iter().enumerate() {
            assert_eq!(row.layer as usize, i);
            assert_eq!(Layer::from_name(row.name), Some(row.layer));
            assert!(row.layer.row().doc.len() > 20);
        }
        assert_eq!(Layer::from_name("depths"), None);
    }

    #[test]
    fn every_film_has_the_index_that_is_looked_up() {
        let all: Vec<Layer> = LAYERS.iter().map(|row| row.layer).collect();
        let layout = LayerLayout::new(&all, 6, 1).unwrap();
        for (i, film) in layout.films().iter().enumerate() {
            let found = match film.subset {
                PathSubset::Whole => layout.single(film.layer),
                PathSubset::Depth(k) => layout.depth(k),
                PathSubset::Strategy { s, t, weighted } => {
                    layout.strategy(s, t).map(|at| at + usize::from(!weighted))
                }
            };
            assert_eq!(found, Some(i), "{}", film.name());
        }
        let mut names: Vec<String> = layout.films().iter().map(LayerFilm::name).collect();
        assert_eq!(names.len(), 6 + 2 * (2 + 3 + 4 + 5 + 6 + 7) + 10);
        assert_eq!(
            layout.summed().len(),
            names.len() - 1,
            "all but the variance"
        );
        assert_eq!(layout.contribution_films(), 6 + 2 * 27 + 1);
        names.sort();
        names.dedup();
        assert_eq!(names.len(), layout.films().len(), "names are unique");
        let none = LayerLayout::new(&[], 6, 1).unwrap();
        assert_eq!(
            (none.depth(2), none.strategy(1, 2), none.single(Layer::Rays)),
            (None, None, None)
        );
    }

    #[test]
    fn memory_is_computed_and_limited() {
        // Depth 2: (0,2) (1,1) (0,3) (1,2) (2,1), each twice, and two of them with splats.
        let bytes = |layers: &[Layer], depth, pixels| {
            LayerLayout::new(layers, depth, pixels).map(|layout| layout.bytes())
        };
        assert_eq!(
            bytes(&[Layer::Strategies], 2, 10),
            Ok(10 * (10 * 48 + 4 * 96))
        );
        assert_eq!(bytes(&[], 10_000, 1 << 40), Ok(0));
        assert_eq!(bytes(&[Layer::Variance, Layer::Uv], 2, 10), Ok(10 * 48));
        let error = bytes(&[Layer::Strategies], 20, 1 << 20).unwrap_err();
        assert!(
            error.contains("8 GiB") && error.contains("lower max_depth"),
            "{error}"
        );
        let error = bytes(&[Layer::Strategies], 10_000, 1).unwrap_err();
        assert!(error.contains("4096 films"), "{error}");
    }

    #[test]
    fn ratios_are_computed_from_the_final_sums() {
        let mut film = Film::new(2, 1);
        (film.samples, film.sum[0]) = (4, [6.0, 2.0, 0.0]);
        let bounces = LayerLayout::new(&[Layer::Bounces], 5, 2).unwrap().films()[0];
        assert_eq!(bounces.image(&film).data, [[3.0, 0.5, 0.0], [0.0; 3]]);
        let image = |layer| {
            let films = LayerLayout::new(&[layer], 5, 2).unwrap().films;
            films[0].image(&film).data
        };
        assert_eq!(
            image(Layer::ShapeIndex),
            [[5.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]
        );
    }

    #[test]
    fn variance_is_that_of_the_samples() {
        let mut film = Film::new(1, 1);
        // Samples 1, 2, 3, 6 have a mean of 3: (4 + 1 + 0 + 9) / 3.
        (film.samples, film.sum[0][0], film.sum2[0][0]) = (4, 12.0, 50.0);
        let layout = LayerLayout::new(&[Layer::Variance], 5, 1).unwrap();
        let [r, g, _] = layout.films()[0].image(&film).data[0];
        assert!((r - 14.0 / 3.0).abs() < 1e-6 && g == 0.0, "{r} {g}");
        film.samples = 1;
        assert_eq!(layout.films()[0].image(&film).data, [[0.0; 3]]);
    }
}
