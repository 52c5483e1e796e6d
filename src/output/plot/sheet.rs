//! Contact sheets: the films of a layer beside one another with small labels.
//!
//! The films of strategies make the pyramid that Veach drew [Veach 1997, fig. 10.3]: a row for each path length, a
//! column for each number of light vertices. Longer paths bring less light, so rows are brightened by a power of two,
//! which their label names: the same for the weighted sheet and the raw one, so that the two can be compared.

use super::raster;
use super::style::{FAINT, INK};
use super::svg::{Anchor, Drawing, Font};
use crate::film::Image;
use crate::film::layer::{LayerImage, Part};
use crate::metrics::tonemap::Tonemap;
use crate::output::{OutputError, check_shape, layer, png};

/// Widest and narrowest picture on a sheet, in pixels.
const WIDEST: u32 = 320;
const NARROWEST: u32 = 96;

/// The most pixels that the pictures of a row take together.
const WIDEST_ROW: u32 = 8192;

/// Space to the left of the pictures, above them, between them, and for the label below each.
const LEFT: u32 = 96;
const TOP: u32 = 64;
const GAP: u32 = 10;
const LABEL: u32 = 18;

/// Rows are brightened by at most two to this.
const MOST_STOPS: f64 = 10.0;

/// One picture's place on a sheet and what stands below it.
struct Tile<'a> {
    layer: &'a LayerImage,
    /// Column and row.
    at: [u32; 2],
    label: String,
}

/// The sheets of a run's layers: a file stem and the bytes of a PNG for each. There is one of the films by depth, and
/// one each of the weighted and the raw films by strategy, where the run has them. `title` is written above, `display`
/// is the tone map of the pictures, `meta` goes into every file.
///
/// # Errors
/// Images without pixels, or a failure of an encoder.
pub fn sheets(
    layers: &[LayerImage],
    display: Tonemap,
    title: &str,
    meta: &[(String, String)],
) -> Result<Vec<(String, Vec<u8>)>, OutputError> {
    let stops = stops(layers);
    let strategies = |wanted: bool| -> Vec<Tile<'_>> {
        let tile = |layer| match layer_part(layer) {
            Part::Strategy { s, t, weighted } if weighted == wanted => {
                Some(Tile { layer, at: [s, s + t - 2], label: format!("s = {s}, t = {t}") })
            }
            _ => None,
        };
        layers.iter().filter_map(tile).collect()
    };
    let depths = layers.iter().filter_map(|layer| match layer_part(layer) {
        Part::Depth(k) => {
            Some(Tile { layer, at: [k - 1, 0], label: brightened(&format!("k = {k}"), stops_of(&stops, k)) })
        }
        _ => None,
    });
    let all = [
        ("depths", "light by path length k", depths.collect()),
        ("pyramid-weighted", "light by strategy (s, t), weighted", strategies(true)),
        ("pyramid-raw", "light by strategy (s, t), unweighted", strategies(false)),
    ];
    let drawn = all.into_iter().filter(|(_, _, tiles): &(_, _, Vec<Tile<'_>>)| !tiles.is_empty());
    drawn
        .map(|(stem, heading, tiles)| {
            let heading = if title.is_empty() { heading.to_owned() } else { format!("{title}: {heading}") };
            Ok((stem.to_owned(), sheet(&tiles, &stops, display, &heading, meta)?))
        })
        .collect()
}

fn layer_part(layer: &LayerImage) -> Part {
    layer.film.part
}

/// By how many powers of two paths of each length are brightened, from length 1: such that they are about as bright as
/// the brightest of those that have met a surface.
pub fn stops(layers: &[LayerImage]) -> Vec<f64> {
    let mean = |image: &Image| image.mean().iter().sum::<f64>();
    let mut means: Vec<f64> = Vec::new();
    let by_depth = layers.iter().any(|layer| matches!(layer_part(layer), Part::Depth(_)));
    for layer in layers {
        let (k, share) = match layer_part(layer) {
            Part::Depth(k) => (k, mean(&layer.image)),
            Part::Strategy { s, t, weighted: true } if !by_depth => (s + t - 1, mean(&layer.image)),
            Part::Strategy { .. } | Part::Whole => continue,
        };
        let place = k as usize - 1;
        means.resize(means.len().max(place + 1), 0.0);
        means[place] += share;
    }
    let brightest = means.iter().skip(1).copied().fold(0.0, f64::max);
    let stop = |mean: &f64| if *mean > 0.0 { (brightest / mean).log2().round().clamp(0.0, MOST_STOPS) } else { 0.0 };
    means.iter().map(stop).collect()
}

fn stops_of(stops: &[f64], k: u32) -> f64 {
    stops.get(k as usize - 1).copied().unwrap_or(0.0)
}

fn brightened(label: &str, stops: f64) -> String {
    if stops > 0.0 { format!("{label}, ×{}", stops.exp2()) } else { label.to_owned() }
}

/// One sheet. A sheet of more than one row has a heading for each row and column.
fn sheet(
    tiles: &[Tile<'_>],
    stops: &[f64],
    display: Tonemap,
    heading: &str,
    meta: &[(String, String)],
) -> Result<Vec<u8>, OutputError> {
    let size = |axis: usize| tiles.iter().map(|tile| tile.at[axis] + 1).max().unwrap_or(1);
    let [columns, rows] = [size(0), size(1)];
    for tile in tiles {
        check_shape(&tile.layer.image)?;
    }
    let scale = Scale::of(&tiles[0].layer.image, columns);
    let [tile_width, tile_height] = scale.size(&tiles[0].layer.image);
    let left = if rows > 1 { LEFT } else { GAP };
    let place = |[column, row]: [u32; 2]| [left + column * (tile_width + GAP), TOP + row * (tile_height + LABEL + GAP)];
    let [width, height] = place([columns, rows]);
    let mut drawing = Drawing::default();
    let below = |y: u32| f64::from(y + tile_height) + 14.0;
    drawing.text((f64::from(GAP), 26.0), Font::strong(16.0), Anchor::Start, heading);
    for tile in tiles {
        let [x, y] = place(tile.at);
        let middle = f64::from(x) + 0.5 * f64::from(tile_width);
        drawing.text((middle, below(y)), Font::new(12.0, FAINT), Anchor::Middle, &tile.label);
    }
    if rows > 1 {
        for row in 0..rows {
            let y = f64::from(place([0, row])[1]) + 0.5 * f64::from(tile_height);
            drawing.text((f64::from(GAP), y), Font::new(14.0, INK), Anchor::Start, &format!("k = {}", row + 1));
            let more = stops_of(stops, row + 1);
            if more > 0.0 {
                let label = format!("×{}", more.exp2());
                drawing.text((f64::from(GAP), y + 18.0), Font::new(12.0, FAINT), Anchor::Start, &label);
            }
        }
        for column in 0..columns {
            let x = f64::from(place([column, 0])[0]) + 0.5 * f64::from(tile_width);
            drawing.text((x, f64::from(TOP) - 8.0), Font::new(14.0, INK), Anchor::Middle, &format!("s = {column}"));
        }
    }
    let svg = drawing.finish(f64::from(width), f64::from(height), heading, "");
    let ([width, _], mut pixels) = raster::pixels(&svg, 1.0)?;
    for tile in tiles {
        let k = if rows > 1 { tile.at[1] } else { tile.at[0] } + 1;
        let gain = stops_of(stops, k).exp2() as f32;
        let small = scale.apply(&tile.layer.image, gain);
        let shown = layer::shown(&LayerImage { film: tile.layer.film, image: small }, display);
        let [x, y] = place(tile.at);
        for (row, line) in shown.data.chunks(shown.width as usize).enumerate() {
            let start = ((y as usize + row) * width as usize + x as usize) * 3;
            for (to, from) in pixels[start..].iter_mut().zip(line.as_flattened()) {
                *to = (from * 255.0).round() as u8;
            }
        }
    }
    let height = pixels.len() / 3 / width as usize;
    png::encode_bytes([width, height as u32], ::png::ColorType::Rgb, &pixels, meta)
}

/// How large pictures become: so many of their pixels one, or each of them so many, along each side.
enum Scale {
    Down(u32),
    Up(u32),
}

impl Scale {
    fn of(image: &Image, columns: u32) -> Scale {
        let widest = (WIDEST_ROW / columns).saturating_sub(GAP).clamp(1, WIDEST);
        if image.width > widest {
            Scale::Down(image.width.div_ceil(widest))
        } else {
            Scale::Up((NARROWEST.min(widest) / image.width).max(1))
        }
    }

    fn size(&self, image: &Image) -> [u32; 2] {
        [image.width, image.height].map(|side| match self {
            Scale::Down(n) => (side / n).max(1),
            Scale::Up(n) => side * n,
        })
    }

    /// The picture at its new size, brightened. Smaller ones are means of whole pixels; the rest of a division is cut.
    fn apply(&self, image: &Image, gain: f32) -> Image {
        let [width, height] = self.size(image);
        match self {
            Scale::Up(n) => Image::from_fn(width, height, |x, y| image.at(x / n, y / n).map(|v| v * gain)),
            Scale::Down(n) => Image::from_fn(width, height, |x, y| {
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
    use crate::film::layer::{Layer, Layout};

    const SRGB: Tonemap = Tonemap::Srgb { exposure: 0.0 };

    /// Films of 120 x 50 pixels whose grey says what they are: strategies get brighter with s, depths fall by eight.
    fn layers(kinds: &[Layer], max_depth: u32) -> Vec<LayerImage> {
        let grey = |part: Part| match part {
            Part::Depth(k) => 0.8 * 0.125f32.powi(k as i32 - 2),
            Part::Strategy { s, t, weighted } => {
                (0.1 + 0.1 * s as f32) * 0.125f32.powi((s + t) as i32 - 3) * if weighted { 1.0 } else { 2.0 }
            }
            Part::Whole => 0.0,
        };
        let layout = Layout::new(kinds, max_depth, 6000).unwrap();
        let image = |film| LayerImage { film, image: Image::from_fn(120, 50, |_, _| [grey(film.part); 3]) };
        layout.films().iter().map(|film| image(*film)).collect()
    }

    fn decoded(bytes: &[u8]) -> image::RgbImage {
        image::load_from_memory(bytes).unwrap().to_rgb8()
    }

    #[test]
    fn a_pyramid_has_a_place_for_every_strategy() {
        let sheets = sheets(&layers(&[Layer::Strategies], 3), SRGB, "test", &[]).unwrap();
        let names: Vec<&str> = sheets.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["pyramid-weighted", "pyramid-raw"]);
        let weighted = decoded(&sheets[0].1);
        let middle = |sheet: &image::RgbImage, s: u32, k: u32| {
            sheet.get_pixel(LEFT + s * (120 + GAP) + 60, TOP + (k - 1) * (50 + LABEL + GAP) + 25).0[0]
        };
        for k in 2..=3 {
            for s in 0..k {
                let (here, next) = (middle(&weighted, s, k), middle(&weighted, s + 1, k));
                assert!(here < next, "k = {k}, s = {s}: {here} {next}");
            }
            assert_eq!(middle(&weighted, 3, 2), 255, "where there is no strategy there is paper");
        }
        // Depth 3 has 1.0/8 of light over all s, and depth 2 0.6: brightened by 4, rounded to a power of two.
        assert_eq!(stops(&layers(&[Layer::Strategies], 3))[1..], [0.0, 2.0]);
        let raw = decoded(&sheets[1].1);
        assert!(middle(&raw, 1, 3) > middle(&weighted, 1, 3), "the same gain, twice the light");
        assert_eq!(raw.dimensions(), weighted.dimensions());
        let ink = |x: u32, y: u32, w: u32, h: u32| {
            let at = |i: u32| raw.get_pixel(x + i % w, y + i / w).0[0];
            (0..w * h).filter(|i| at(*i) < 128).count()
        };
        assert!(ink(GAP, 8, 200, 24) > 50, "the title is drawn");
        assert!(ink(GAP, TOP + 10, LEFT - 2 * GAP, 20) > 10, "rows are labelled");
    }

    #[test]
    fn depths_stand_in_one_row_and_are_brightened() {
        let layers = layers(&[Layer::Depth], 4);
        assert_eq!(stops(&layers)[1..], [0.0, 3.0, 6.0]);
        let sheets = sheets(&layers, SRGB, "", &[("run".to_owned(), "3f9a".to_owned())]).unwrap();
        assert_eq!((sheets.len(), sheets[0].0.as_str()), (1, "depths"));
        let sheet = decoded(&sheets[0].1);
        let grey = |k: u32| sheet.get_pixel(GAP + (k - 1) * (120 + GAP) + 60, TOP + 25).0[0];
        assert_eq!((grey(3), grey(4)), (grey(2), grey(2)));
        assert!(super::sheets(&[], SRGB, "", &[]).unwrap().is_empty());
    }

    #[test]
    fn large_pictures_are_averaged_and_small_ones_enlarged() {
        let image = Image::from_fn(1280, 3, |x, _| [x as f32; 3]);
        let scale = Scale::of(&image, 4);
        assert_eq!(scale.size(&image), [320, 1]);
        assert_eq!(scale.apply(&image, 2.0).at(1, 0), [11.0; 3], "twice the mean of 4, 5, 6, 7");
        let image = Image::from_fn(16, 9, |x, y| [x as f32, y as f32, 0.0]);
        let scale = Scale::of(&image, 4);
        assert_eq!(scale.size(&image), [96, 54]);
        assert_eq!(scale.apply(&image, 1.0).at(95, 53), [15.0, 8.0, 0.0]);
        assert!(Scale::of(&image, 1000).size(&image)[0] <= 16);
    }
}
