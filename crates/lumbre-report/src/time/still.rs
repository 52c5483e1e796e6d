//! Still pictures of films with a time axis: sheets of frames, streak images and arrival maps.

use super::{Movie, pixel_luminance};
use crate::plot::grid::Grid;
use crate::plot::rasterize;
use crate::plot::sizes::FULL;
use crate::{OutputError, png};
use lumbre_light::film::Image;
use lumbre_metrics::map::{Colours, ErrorMap};

/// Number of columns of a sheet.
const COLUMNS: usize = 4;

/// Fraction of a pixel's brightest bin that a bin must reach to count as the first arrival of
/// light.
const ONSET: f64 = 0.1;

/// Draws a sheet of frames as PNG. Each frame is the sum of the bins around the optical length in
/// its label.
///
/// # Errors
/// Returns an error if an encoder fails.
pub fn sheet(movie: &Movie) -> Result<Vec<u8>, OutputError> {
    let groups = movie.stills();
    // Frames of a sheet sum more bins than those of an animation, so their exposure differs.
    let display = movie.exposure(&groups);
    let mut grid = Grid::new(COLUMNS, Vec::new(), FULL);
    for (i, group) in groups.iter().enumerate() {
        let label = movie.length_text(movie.middle(group));
        let frame = movie.frame(group.clone());
        grid.picture([i % COLUMNS, i / COLUMNS], &frame, display, label)?;
    }
    rasterize(&grid.svg(
        "Frames",
        "each frame is the sum of its bins; label: optical length",
    ))
}

/// Returns one row over time: columns to the right, bins downwards.
pub fn streak_x(movie: &Movie, row: u32) -> Image {
    let row = row.min(movie.height - 1);
    Image::from_fn(movie.width, movie.axis.bins, |x, bin| {
        movie.pixel(x, row)[bin as usize]
    })
}

/// Returns one column over time: bins to the right, rows downwards.
pub fn streak_y(movie: &Movie, column: u32) -> Image {
    let column = column.min(movie.width - 1);
    Image::from_fn(movie.axis.bins, movie.height, |bin, y| {
        movie.pixel(column, y)[bin as usize]
    })
}

/// Returns arrival times of light at every pixel as optical lengths, in three channels: the centre
/// of the first bin with at least a tenth of the brightest bin's light, the centre of the brightest
/// bin, and the luminance-weighted mean over all bins. Pixels without light are 0.
pub fn arrival(movie: &Movie) -> Image {
    let centre = |i: usize| movie.axis.bin_start(i as u32) + 0.5 * movie.axis.bin;
    Image::from_fn(movie.width, movie.height, |x, y| {
        let light: Vec<f64> = movie.pixel(x, y).iter().map(pixel_luminance).collect();
        let (mut peak, mut sum, mut moment) = (0, 0.0, 0.0);
        for (i, v) in light.iter().enumerate() {
            if *v > light[peak] {
                peak = i;
            }
            sum += v;
            moment += v * centre(i);
        }
        let greatest = light.get(peak).copied().unwrap_or(0.0);
        if greatest <= 0.0 {
            return [0.0; 3];
        }
        let first = light
            .iter()
            .position(|v| *v >= ONSET * greatest)
            .unwrap_or(peak);
        [centre(first), centre(peak), moment / sum].map(|v| v as f32)
    })
}

/// Draws the first arrival in colours, from the earliest to the latest pixel. Pixels without light
/// are green.
///
/// # Errors
/// Returns an error if the encoder fails.
pub fn arrival_picture(movie: &Movie, meta: &[(String, String)]) -> Result<Vec<u8>, OutputError> {
    let first = arrival(movie);
    let values: Vec<f32> = first
        .data
        .iter()
        .map(|v| if v[1] == 0.0 { f32::NAN } else { v[0] })
        .collect();
    let lit = || values.iter().copied().filter(|v| v.is_finite());
    let low = lit().fold(f32::INFINITY, f32::min);
    let high = lit().fold(f32::NEG_INFINITY, f32::max);
    let scale = if low < high { [low, high] } else { [0.0, 1.0] };
    let mut meta = meta.to_vec();
    meta.push(("scale".to_owned(), format!("{} to {}", scale[0], scale[1])));
    let map = ErrorMap {
        width: first.width,
        height: first.height,
        values,
        colours: Colours::Magma,
        top: None,
    };
    png::encode_map(&map, scale, &meta)
}
