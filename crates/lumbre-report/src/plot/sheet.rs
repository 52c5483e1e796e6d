//! Sheets of the films of a run side by side: Veach's pyramid of strategies and strips by path
//! length. Runs store them beside their films, and reports show them.
//!
//! The films by strategy form the pyramid of Veach [Veach 1997, fig. 10.3]: one row for each path
//! length, one column for each number of light vertices, and beside it the complete picture. Longer
//! paths contribute less light, so rows are brightened by a power of two that their label states.
//! The weighted and the raw sheet use the same factors and can be compared.

use super::grid::Grid;
use super::raster;
use crate::{OutputError, check_shape, exposure, png};
use lumbre_light::film::Image;
use lumbre_light::film::layer::{LayerImage, PathSubset};
use lumbre_metrics::tonemap::Tonemap;

/// Maximum width of a picture, in points.
const WIDEST: f64 = 96.0;
/// Maximum brightening of a row, in stops (powers of two).
const MOST_STOPS: f64 = 10.0;

/// A sheet of films.
pub struct Sheet {
    /// File name without extension: `pyramid-weighted`, `pyramid-raw` or `depths`.
    pub stem: &'static str,
    /// Title of the sheet.
    pub heading: &'static str,
    /// Explanation of its symbols, brightening and tone map.
    pub notes: String,
    tiles: Vec<Tile>,
}

/// A picture on a sheet with its label.
struct Tile {
    image: Image,
    /// Column and row.
    cell: [usize; 2],
    /// Number of edges of its paths; `None` for the complete picture.
    length: Option<u32>,
    label: String,
}

/// The sheets of a run's films.
pub struct Sheets {
    /// The sheets that have pictures: by strategy, weighted and raw, and by path length.
    pub sheets: Vec<Sheet>,
    stops: Vec<f64>,
    display: Tonemap,
}

impl Sheets {
    /// Arranges the films of a run. `display` is the tone map; `None` is sRGB with an exposure for
    /// the complete picture.
    ///
    /// # Errors
    /// Returns an error if a picture has no pixels.
    pub fn new(layers: &[LayerImage], display: Option<Tonemap>) -> Result<Sheets, OutputError> {
        for layer in layers {
            check_shape(&layer.image)?;
        }
        let total = total_radiance(layers);
        let display = match (&total, display) {
            (_, Some(display)) => display,
            (Some(total), None) => exposure::automatic(total),
            (None, None) => Tonemap::Srgb { exposure: 0.0 },
        };
        let strategies = "k: edges of a path from the camera to the light; s, t: vertices of its \
                          light subpath and its camera subpath, k = s + t − 1";
        let all = [
            (
                "pyramid-weighted",
                "Light by strategy, weighted",
                strategies,
                strategy_tiles(layers, true),
            ),
            (
                "pyramid-raw",
                "Light by strategy, unweighted",
                strategies,
                strategy_tiles(layers, false),
            ),
            (
                "depths",
                "Light by path length",
                "k: edges of a path from the camera to the light",
                depth_tiles(layers),
            ),
        ];
        let filled = all.into_iter().filter(|(.., tiles)| !tiles.is_empty());
        let sheet = |(stem, heading, symbols, mut tiles): (_, _, &str, Vec<Tile>)| {
            tiles.extend(total.clone().map(|total| complete_tile(total, &tiles)));
            Sheet {
                stem,
                heading,
                notes: format!(
                    "{symbols}; ×: brightening of longer paths, which have less light. Tone map: \
                     {display}."
                ),
                tiles,
            }
        };
        Ok(Sheets {
            sheets: filled.map(sheet).collect(),
            stops: stops(layers),
            display,
        })
    }

    /// Draws a sheet as SVG. `heading` is written above and may be empty; `title` and `description`
    /// are those of the document.
    ///
    /// # Errors
    /// Returns an error if a picture cannot be encoded.
    pub fn draw(
        &self,
        sheet: &Sheet,
        heading: &str,
        title: &str,
        description: &str,
    ) -> Result<String, OutputError> {
        let tiles = &sheet.tiles;
        let count = |axis: usize| tiles.iter().map(|tile| tile.cell[axis] + 1).max();
        let [columns, rows] = [0, 1].map(|axis| count(axis).unwrap_or(1));
        let row_label = |row: usize| {
            let own = tiles.iter().filter(|tile| tile.cell[1] == row);
            let length = own.filter_map(|tile| tile.length).next()?;
            let gain = self.gain(length);
            let gain = (gain > 1.0).then(|| format!("\n×{gain}"));
            Some(format!("k = {length}{}", gain.unwrap_or_default()))
        };
        let row_labels = (0..rows).filter(|_| rows > 1);
        let row_labels = row_labels.map(|row| row_label(row).unwrap_or_default());
        let mut grid = Grid::new(columns, row_labels.collect(), WIDEST);
        for tile in tiles {
            let gain = tile.length.map_or(1.0, |length| self.gain(length));
            let brightened = Image {
                data: tile
                    .image
                    .data
                    .iter()
                    .map(|p| p.map(|v| v * gain as f32))
                    .collect(),
                ..tile.image
            };
            let label = match rows {
                1 if gain > 1.0 => format!("{}, ×{gain}", tile.label),
                _ => tile.label.clone(),
            };
            grid.picture(tile.cell, &brightened, self.display, label)?;
        }
        (grid.heading, grid.notes) = (heading.to_owned(), sheet.notes.clone());
        Ok(grid.svg(title, description))
    }

    /// Returns the brightening factor of a path length.
    fn gain(&self, length: u32) -> f64 {
        let stops = self.stops.get(length as usize - 1);
        stops.copied().unwrap_or(0.0).exp2()
    }
}

/// Draws the sheets of a run's films as PNG files and returns file stem and content of each.
/// `path` is the readable path of the run, `meta` is embedded in every file.
///
/// # Errors
/// Returns an error if a picture has no pixels or an encoder fails.
pub fn files(
    layers: &[LayerImage],
    display: Option<Tonemap>,
    path: &str,
    meta: &[(String, String)],
) -> Result<Vec<(&'static str, Vec<u8>)>, OutputError> {
    let sheets = Sheets::new(layers, display)?;
    let file = |sheet: &Sheet| {
        let parts = [sheet.heading, path];
        let parts = parts.into_iter().filter(|part| !part.is_empty());
        let heading = parts.collect::<Vec<_>>().join(": ");
        let svg = sheets.draw(sheet, &heading, &heading, "")?;
        let (size, pixels) = raster::pixels(&svg, 1.0)?;
        let bytes = png::encode_bytes(size, ::png::ColorType::Rgb, &pixels, meta)?;
        Ok((sheet.stem, bytes))
    };
    sheets.sheets.iter().map(file).collect()
}

/// Returns the tiles of the films by strategy.
fn strategy_tiles(layers: &[LayerImage], wanted: bool) -> Vec<Tile> {
    let tile = |layer: &LayerImage| match layer.film.subset {
        PathSubset::Strategy { s, t, weighted } if weighted == wanted => Some(Tile {
            image: layer.image.clone(),
            cell: [s as usize, (s + t - 2) as usize],
            length: Some(s + t - 1),
            label: format!("s = {s}, t = {t}"),
        }),
        _ => None,
    };
    layers.iter().filter_map(tile).collect()
}

/// Returns the tiles of the films by path length.
fn depth_tiles(layers: &[LayerImage]) -> Vec<Tile> {
    let tile = |layer: &LayerImage| match layer.film.subset {
        PathSubset::Depth(k) => Some(Tile {
            image: layer.image.clone(),
            cell: [k as usize - 1, 0],
            length: Some(k),
            label: format!("k = {k}"),
        }),
        _ => None,
    };
    layers.iter().filter_map(tile).collect()
}

/// Returns the tile of the complete picture: at the right end of the first row.
fn complete_tile(total: Image, tiles: &[Tile]) -> Tile {
    let widest = tiles.iter().map(|tile| tile.cell[0]).max().unwrap_or(0);
    let in_first_row = tiles.iter().filter(|tile| tile.cell[1] == 0);
    let after = in_first_row.map(|tile| tile.cell[0] + 1).max().unwrap_or(0);
    Tile {
        image: total,
        cell: [widest.max(after), 0],
        length: None,
        label: "all paths".to_owned(),
    }
}

/// Returns the sum of the films by path length, or of the weighted films by strategy: the complete
/// picture. `None` if there are neither.
fn total_radiance(layers: &[LayerImage]) -> Option<Image> {
    let is_by_depth = |layer: &&LayerImage| matches!(layer.film.subset, PathSubset::Depth(_));
    let by_depth = layers.iter().any(|layer| is_by_depth(&layer));
    let is_counted = |layer: &&LayerImage| match layer.film.subset {
        PathSubset::Depth(_) => true,
        PathSubset::Strategy { weighted, .. } => weighted && !by_depth,
        PathSubset::Whole => false,
    };
    let mut counted = layers.iter().filter(is_counted);
    let first = counted.next()?;
    Some(counted.fold(first.image.clone(), |mut total, layer| {
        for (to, from) in total.data.iter_mut().zip(&layer.image.data) {
            (0..3).for_each(|c| to[c] += from[c]);
        }
        total
    }))
}

/// Returns the brightening of each path length in stops, starting at length 1. Paths are brightened
/// to about the brightness of the brightest paths that hit a surface (length 2 or more).
fn stops(layers: &[LayerImage]) -> Vec<f64> {
    let mean = |image: &Image| image.mean().iter().sum::<f64>();
    let mut means: Vec<f64> = Vec::new();
    let by_depth = layers
        .iter()
        .any(|layer| matches!(layer.film.subset, PathSubset::Depth(_)));
    for layer in layers {
        let (k, share) = match layer.film.subset {
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

#[cfg(test)]
mod tests {
    use super::*;
    use lumbre_light::film::layer::{Layer, LayerLayout};

    /// Builds films of 12 x 5 pixels with a distinct grey each: strategies get brighter with s, and
    /// each path length has an eighth of the light of the previous one.
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
        let layout = LayerLayout::new(kinds, max_depth, 60).unwrap();
        let image = |film| LayerImage {
            film,
            image: Image::from_fn(12, 5, |_, _| [grey(film.subset); 3]),
        };
        layout.films().iter().map(|film| image(*film)).collect()
    }

    fn svg(sheets: &Sheets, index: usize) -> String {
        let sheet = &sheets.sheets[index];
        sheets.draw(sheet, "", "test", "run 3f9a").unwrap()
    }

    #[test]
    fn a_pyramid_has_a_cell_for_every_strategy_and_the_complete_picture() {
        let layers = layers(&[Layer::Strategies], 3);
        let sheets = Sheets::new(&layers, None).unwrap();
        let stems: Vec<&str> = sheets.sheets.iter().map(|sheet| sheet.stem).collect();
        assert_eq!(stems, ["pyramid-weighted", "pyramid-raw"]);
        let weighted = svg(&sheets, 0);
        let strategies = layers.iter().filter(|layer| {
            matches!(
                layer.film.subset,
                PathSubset::Strategy { weighted: true, .. }
            )
        });
        assert_eq!(weighted.matches("<image").count(), strategies.count() + 1);
        for text in ["k = 1", "k = 3", "s = 2, t = 2", "all paths", "×4"] {
            assert!(weighted.contains(&format!(">{text}</text>")), "{text}");
        }
        // Length 3 has 1.0 / 8 of light over all s, length 2 has 0.6: a factor of 4 as power of
        // two.
        assert_eq!(stops(&layers)[1..], [0.0, 2.0]);
        assert!(weighted.contains("exposure"), "the tone map is stated");
        let own = Sheets::new(
            &layers,
            Some(Tonemap::Gamma {
                gamma: 2.0,
                exposure: 1.0,
            }),
        );
        assert!(svg(&own.unwrap(), 0).contains("gamma"));
    }

    #[test]
    fn depths_form_one_row_and_are_brightened() {
        let layers = layers(&[Layer::Depth], 4);
        assert_eq!(stops(&layers)[1..], [0.0, 3.0, 6.0]);
        let total = total_radiance(&layers).unwrap().at(0, 0)[0];
        let sum: f32 = layers.iter().map(|layer| layer.image.at(0, 0)[0]).sum();
        assert!((total - sum).abs() < 1e-6, "{total} {sum}");
        let files = files(
            &layers,
            None,
            "depth=4",
            &[("run".to_owned(), "3f9a".to_owned())],
        );
        let files = files.unwrap();
        assert_eq!((files.len(), files[0].0), (1, "depths"));
        let picture = image::load_from_memory(&files[0].1).unwrap().to_rgb8();
        assert!(picture.width() > 400, "five pictures beside each other");
        let sheets = Sheets::new(&layers, None).unwrap();
        let text = svg(&sheets, 0);
        assert!(text.contains(">k = 4, ×64</text>") && text.contains(">all paths</text>"));
        assert!(Sheets::new(&[], None).unwrap().sheets.is_empty());
    }
}
