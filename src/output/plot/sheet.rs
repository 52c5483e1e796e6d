//! Contact sheets: the films of a layer side by side with labels.
//!
//! The films by strategy form the pyramid of Veach [Veach 1997, fig. 10.3]: one row for each path
//! length, one column for each number of light vertices. Longer paths contribute less light, so
//! rows are brightened by a power of two that their label states. The weighted and the raw sheet
//! use the same factors and can be compared.

use super::raster;
use super::style::{FAINT, INK};
use super::svg::{Anchor, Drawing, Font};
use crate::metrics::tonemap::Tonemap;
use crate::output::{OutputError, check_shape, layer, png};
use lumbre_light::film::Image;
use lumbre_light::film::layer::{LayerImage, PathSubset};

/// Maximum width of a picture on a sheet, in pixels.
const WIDEST: u32 = 320;
/// Minimum width of a picture on a sheet, in pixels, unless a row has too many pictures.
const NARROWEST: u32 = 96;

/// Maximum total width of the pictures of a row, in pixels.
const WIDEST_ROW: u32 = 8192;

/// Space left of the pictures.
const LEFT: u32 = 96;
/// Space above the pictures.
const TOP: u32 = 64;
/// Space between pictures.
const GAP: u32 = 10;
/// Height of the label below each picture.
const LABEL: u32 = 18;

/// Maximum brightening of a row, in stops (powers of two).
const MOST_STOPS: f64 = 10.0;

/// A picture on a sheet with its label.
struct SheetTile<'a> {
    layer: &'a LayerImage,
    /// Column and row.
    cell: [u32; 2],
    label: String,
}

/// Draws the sheets of a run's layers. Returns file stem and PNG of each: one sheet of the films by
/// depth, and one each of the weighted and the raw films by strategy, as far as the run has them.
/// `title` is written above, `display` is the tone map of the pictures, `meta` is embedded in every
/// file.
///
/// # Errors
/// Returns an error if a picture has no pixels or an encoder fails.
pub fn sheets(
    layers: &[LayerImage],
    display: Tonemap,
    title: &str,
    meta: &[(String, String)],
) -> Result<Vec<(String, Vec<u8>)>, OutputError> {
    let stops = stops(layers);
    let strategies = |wanted: bool| -> Vec<SheetTile<'_>> {
        let tile = |layer| match layer_part(layer) {
            PathSubset::Strategy { s, t, weighted } if weighted == wanted => Some(SheetTile {
                layer,
                cell: [s, s + t - 2],
                label: format!("s = {s}, t = {t}"),
            }),
            _ => None,
        };
        layers.iter().filter_map(tile).collect()
    };
    let depths = layers.iter().filter_map(|layer| match layer_part(layer) {
        PathSubset::Depth(k) => Some(SheetTile {
            layer,
            cell: [k - 1, 0],
            label: brightened(&format!("k = {k}"), stops_at(&stops, k)),
        }),
        _ => None,
    });
    let all = [
        ("depths", "light by path length k", depths.collect()),
        (
            "pyramid-weighted",
            "light by strategy (s, t), weighted",
            strategies(true),
        ),
        (
            "pyramid-raw",
            "light by strategy (s, t), unweighted",
            strategies(false),
        ),
    ];
    let drawn = all
        .into_iter()
        .filter(|(_, _, tiles): &(_, _, Vec<SheetTile<'_>>)| !tiles.is_empty());
    drawn
        .map(|(stem, heading, tiles)| {
            let heading = if title.is_empty() {
                heading.to_owned()
            } else {
                format!("{title}: {heading}")
            };
            Ok((
                stem.to_owned(),
                sheet(&tiles, &stops, display, &heading, meta)?,
            ))
        })
        .collect()
}

fn layer_part(layer: &LayerImage) -> PathSubset {
    layer.film.subset
}

/// Returns the brightening of each path length in stops, starting at length 1. Paths are brightened
/// to about the brightness of the brightest paths that hit a surface (length 2 or more).
pub fn stops(layers: &[LayerImage]) -> Vec<f64> {
    let mean = |image: &Image| image.mean().iter().sum::<f64>();
    let mut means: Vec<f64> = Vec::new();
    let by_depth = layers
        .iter()
        .any(|layer| matches!(layer_part(layer), PathSubset::Depth(_)));
    for layer in layers {
        let (k, share) = match layer_part(layer) {
            PathSubset::Depth(k) => (k, mean(&layer.image)),
            PathSubset::Strategy {
                s,
                t,
                weighted: true,
            } if !by_depth => (s + t - 1, mean(&layer.image)),
            PathSubset::Strategy { .. } | PathSubset::Whole => continue,
        };
        let index = k as usize - 1;
        means.resize(means.len().max(index + 1), 0.0);
        means[index] += share;
    }
    let brightest = means.iter().skip(1).copied().fold(0.0, f64::max);
    let stop = |mean: &f64| {
        if *mean > 0.0 {
            (brightest / mean).log2().round().clamp(0.0, MOST_STOPS)
        } else {
            0.0
        }
    };
    means.iter().map(stop).collect()
}

fn stops_at(stops: &[f64], k: u32) -> f64 {
    stops.get(k as usize - 1).copied().unwrap_or(0.0)
}

fn brightened(label: &str, stops: f64) -> String {
    if stops > 0.0 {
        format!("{label}, ×{}", stops.exp2())
    } else {
        label.to_owned()
    }
}

/// Positions of the pictures on a sheet, in pixels.
struct SheetLayout {
    columns: u32,
    rows: u32,
    scale: TileScale,
    tile_size: [u32; 2],
}

impl SheetLayout {
    fn new(tiles: &[SheetTile<'_>]) -> SheetLayout {
        let count = |axis: usize| {
            tiles
                .iter()
                .map(|tile| tile.cell[axis] + 1)
                .max()
                .unwrap_or(1)
        };
        let [columns, rows] = [count(0), count(1)];
        let scale = TileScale::for_row(&tiles[0].layer.image, columns);
        let tile_size = scale.size(&tiles[0].layer.image);
        SheetLayout {
            columns,
            rows,
            scale,
            tile_size,
        }
    }

    /// Returns the left and top edge of a picture, or of the cell after the last one.
    fn position(&self, [column, row]: [u32; 2]) -> [u32; 2] {
        let left = if self.rows > 1 { LEFT } else { GAP };
        [
            left + column * (self.tile_size[0] + GAP),
            TOP + row * (self.tile_size[1] + LABEL + GAP),
        ]
    }

    /// Returns the path length of a tile.
    fn path_length(&self, tile: &SheetTile<'_>) -> u32 {
        1 + if self.rows > 1 {
            tile.cell[1]
        } else {
            tile.cell[0]
        }
    }
}

/// Draws one sheet. A sheet of several rows has a heading for each row and column.
fn sheet(
    tiles: &[SheetTile<'_>],
    stops: &[f64],
    display: Tonemap,
    heading: &str,
    meta: &[(String, String)],
) -> Result<Vec<u8>, OutputError> {
    for tile in tiles {
        check_shape(&tile.layer.image)?;
    }
    let layout = SheetLayout::new(tiles);
    let svg = draw_labels(tiles, &layout, stops, heading);
    let ([width, _], mut pixels) = raster::pixels(&svg, 1.0)?;
    for tile in tiles {
        let gain = stops_at(stops, layout.path_length(tile)).exp2() as f32;
        let scaled = LayerImage {
            film: tile.layer.film,
            image: layout.scale.apply(&tile.layer.image, gain),
        };
        let picture = layer::display_values(&scaled, display);
        let [x, y] = layout.position(tile.cell);
        for (row, line) in picture.data.chunks(picture.width as usize).enumerate() {
            let start = ((y as usize + row) * width as usize + x as usize) * 3;
            for (to, from) in pixels[start..].iter_mut().zip(line.as_flattened()) {
                *to = (from * 255.0).round() as u8;
            }
        }
    }
    let height = pixels.len() / 3 / width as usize;
    png::encode_bytes([width, height as u32], ::png::ColorType::Rgb, &pixels, meta)
}

/// Draws the text of a sheet as SVG, with space for the pictures.
fn draw_labels(
    tiles: &[SheetTile<'_>],
    layout: &SheetLayout,
    stops: &[f64],
    heading: &str,
) -> String {
    let [tile_width, tile_height] = layout.tile_size;
    let [width, height] = layout.position([layout.columns, layout.rows]);
    let mut drawing = Drawing::default();
    drawing.text(
        (f64::from(GAP), 26.0),
        Font::strong(16.0),
        Anchor::Start,
        heading,
    );
    for tile in tiles {
        let [x, y] = layout.position(tile.cell);
        let centre = f64::from(x) + 0.5 * f64::from(tile_width);
        let baseline = f64::from(y + tile_height) + 14.0;
        drawing.text(
            (centre, baseline),
            Font::new(12.0, FAINT),
            Anchor::Middle,
            &tile.label,
        );
    }
    if layout.rows > 1 {
        draw_row_headings(&mut drawing, layout, stops);
        for column in 0..layout.columns {
            let x = f64::from(layout.position([column, 0])[0]) + 0.5 * f64::from(tile_width);
            drawing.text(
                (x, f64::from(TOP) - 8.0),
                Font::new(14.0, INK),
                Anchor::Middle,
                &format!("s = {column}"),
            );
        }
    }
    drawing.finish(f64::from(width), f64::from(height), heading, "")
}

/// Writes the path length of each row and its brightening.
fn draw_row_headings(drawing: &mut Drawing, layout: &SheetLayout, stops: &[f64]) {
    for row in 0..layout.rows {
        let y = f64::from(layout.position([0, row])[1]) + 0.5 * f64::from(layout.tile_size[1]);
        drawing.text(
            (f64::from(GAP), y),
            Font::new(14.0, INK),
            Anchor::Start,
            &format!("k = {}", row + 1),
        );
        let brightening = stops_at(stops, row + 1);
        if brightening > 0.0 {
            drawing.text(
                (f64::from(GAP), y + 18.0),
                Font::new(12.0, FAINT),
                Anchor::Start,
                &format!("×{}", brightening.exp2()),
            );
        }
    }
}

/// Scaling of pictures by an integer factor along each side. When reduced, each output pixel
/// averages
/// a square of pixels; when enlarged, each pixel is repeated.
enum TileScale {
    Down(u32),
    Up(u32),
}

impl TileScale {
    fn for_row(image: &Image, columns: u32) -> TileScale {
        let widest = (WIDEST_ROW / columns).saturating_sub(GAP).clamp(1, WIDEST);
        if image.width > widest {
            TileScale::Down(image.width.div_ceil(widest))
        } else {
            TileScale::Up((NARROWEST.min(widest) / image.width).max(1))
        }
    }

    fn size(&self, image: &Image) -> [u32; 2] {
        [image.width, image.height].map(|side| match self {
            TileScale::Down(n) => (side / n).max(1),
            TileScale::Up(n) => side * n,
        })
    }

    /// Scales and brightens a picture. When reduced, output pixels are means; remaining pixels at
    /// the edges are dropped.
    fn apply(&self, image: &Image, gain: f32) -> Image {
        let [width, height] = self.size(image);
        match self {
            TileScale::Up(n) => Image::from_fn(width, height, |x, y| {
                image.at(x / n, y / n).map(|v| v * gain)
            }),
            TileScale::Down(n) => Image::from_fn(width, height, |x, y| {
                let mut sum = [0.0f64; 3];
                let columns = x * n..(x * n + n).min(image.width);
                let rows = y * n..(y * n + n).min(image.height);
                let count = columns.len() * rows.len();
                for (x, y) in rows.flat_map(|y| columns.clone().map(move |x| (x, y))) {
                    for (sum, value) in sum.iter_mut().zip(image.at(x, y)) {
                        *sum += f64::from(value);
                    }
                }
                sum.map(|s| (s / count as f64) as f32 * gain)
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumbre_light::film::layer::{Layer, LayerLayout};

    const SRGB: Tonemap = Tonemap::Srgb { exposure: 0.0 };

    /// Builds films of 120 x 50 pixels with a distinct grey each: strategies get brighter with s,
    /// and each path length has an eighth of the light of the previous one.
    fn layers(kinds: &[Layer], max_depth: u32) -> Vec<LayerImage> {
        let grey = |part: PathSubset| match part {
            PathSubset::Depth(k) => 0.8 * 0.125f32.powi(k as i32 - 2),
            PathSubset::Strategy { s, t, weighted } => {
                (0.1 + 0.1 * s as f32)
                    * 0.125f32.powi((s + t) as i32 - 3)
                    * if weighted { 1.0 } else { 2.0 }
            }
            PathSubset::Whole => 0.0,
        };
        let layout = LayerLayout::new(kinds, max_depth, 6000).unwrap();
        let image = |film| LayerImage {
            film,
            image: Image::from_fn(120, 50, |_, _| [grey(film.subset); 3]),
        };
        layout.films().iter().map(|film| image(*film)).collect()
    }

    fn decoded(bytes: &[u8]) -> image::RgbImage {
        image::load_from_memory(bytes).unwrap().to_rgb8()
    }

    #[test]
    fn a_pyramid_has_a_cell_for_every_strategy() {
        let sheets = sheets(&layers(&[Layer::Strategies], 3), SRGB, "test", &[]).unwrap();
        let names: Vec<&str> = sheets.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["pyramid-weighted", "pyramid-raw"]);
        let weighted = decoded(&sheets[0].1);
        let centre = |sheet: &image::RgbImage, s: u32, k: u32| {
            sheet
                .get_pixel(
                    LEFT + s * (120 + GAP) + 60,
                    TOP + (k - 1) * (50 + LABEL + GAP) + 25,
                )
                .0[0]
        };
        for k in 2..=3 {
            for s in 0..k {
                let (here, next) = (centre(&weighted, s, k), centre(&weighted, s + 1, k));
                assert!(here < next, "k = {k}, s = {s}: {here} {next}");
            }
            assert_eq!(
                centre(&weighted, 3, 2),
                255,
                "cells without a strategy are white"
            );
        }
        // Length 3 has 1.0 / 8 of light over all s, length 2 has 0.6: a factor of 4 as power of
        // two.
        assert_eq!(stops(&layers(&[Layer::Strategies], 3))[1..], [0.0, 2.0]);
        let raw = decoded(&sheets[1].1);
        assert!(
            centre(&raw, 1, 3) > centre(&weighted, 1, 3),
            "the same factor, twice the light"
        );
        assert_eq!(raw.dimensions(), weighted.dimensions());
        let ink = |x: u32, y: u32, w: u32, h: u32| {
            let at = |i: u32| raw.get_pixel(x + i % w, y + i / w).0[0];
            (0..w * h).filter(|i| at(*i) < 128).count()
        };
        assert!(ink(GAP, 8, 200, 24) > 50, "the title is drawn");
        assert!(
            ink(GAP, TOP + 10, LEFT - 2 * GAP, 20) > 10,
            "rows are labelled"
        );
    }

    #[test]
    fn depths_form_one_row_and_are_brightened() {
        let layers = layers(&[Layer::Depth], 4);
        assert_eq!(stops(&layers)[1..], [0.0, 3.0, 6.0]);
        let sheets = sheets(&layers, SRGB, "", &[("run".to_owned(), "3f9a".to_owned())]).unwrap();
        assert_eq!((sheets.len(), sheets[0].0.as_str()), (1, "depths"));
        let sheet = decoded(&sheets[0].1);
        let grey = |k: u32| {
            sheet
                .get_pixel(GAP + (k - 1) * (120 + GAP) + 60, TOP + 25)
                .0[0]
        };
        assert_eq!((grey(3), grey(4)), (grey(2), grey(2)));
        assert!(super::sheets(&[], SRGB, "", &[]).unwrap().is_empty());
    }

    #[test]
    fn large_pictures_are_averaged_and_small_ones_enlarged() {
        let image = Image::from_fn(1280, 3, |x, _| [x as f32; 3]);
        let scale = TileScale::for_row(&image, 4);
        assert_eq!(scale.size(&image), [320, 1]);
        assert_eq!(
            scale.apply(&image, 2.0).at(1, 0),
            [11.0; 3],
            "twice the mean of 4, 5, 6, 7"
        );
        let image = Image::from_fn(16, 9, |x, y| [x as f32, y as f32, 0.0]);
        let scale = TileScale::for_row(&image, 4);
        assert_eq!(scale.size(&image), [96, 54]);
        assert_eq!(scale.apply(&image, 1.0).at(95, 53), [15.0, 8.0, 0.0]);
        assert!(TileScale::for_row(&image, 1000).size(&image)[0] <= 16);
    }
}
