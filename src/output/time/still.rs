//! Still pictures of a film with a time axis: sheets of frames, streaks, and maps of arrival.

use super::{Movie, bright};
use crate::film::Image;
use crate::metrics::map::{Colours, ErrorMap};
use crate::output::plot::svg::{Anchor, Drawing, Font};
use crate::output::plot::{rasterize, style::INK};
use crate::output::{OutputError, png};

/// Columns of a sheet.
const COLUMNS: u32 = 4;

/// A pixel has light from the first bin on that holds so much of what its brightest bin holds.
const ONSET: f64 = 0.1;

/// A sheet of frames, each the sum of the bins that its label names.
///
/// # Errors
/// Those of the encoders.
pub fn sheet(movie: &Movie) -> Result<Vec<u8>, OutputError> {
    let groups = movie.stills();
    // Frames of a sheet sum more bins than those of an animation, which their exposure must know.
    let display = movie.exposure(&groups);
    let width = 180.0;
    let height = width * f64::from(movie.height) / f64::from(movie.width);
    let (step_x, step_y) = (width + 6.0, height + 18.0);
    let mut drawing = Drawing::default();
    let label = Font::new(9.0, INK);
    for (i, group) in groups.iter().enumerate() {
        let (x, y) = (f64::from(i as u32 % COLUMNS) * step_x, f64::from(i as u32 / COLUMNS) * step_y);
        drawing.image([x, y, width, height], &png::encode(&movie.frame(group.clone()), display, &[])?);
        drawing.text((x + width / 2.0, y + height + 11.0), label, Anchor::Middle, &movie.words(movie.middle(group)));
    }
    let rows = (groups.len() as u32).div_ceil(COLUMNS).max(1);
    let (w, h) = (f64::from(COLUMNS) * step_x - 6.0, f64::from(rows) * step_y);
    let svg = drawing.finish_scaled(w, h, 1.5, "Frames", "each is the sum of its bins; below: optical length");
    rasterize(&svg)
}

/// A row over time: columns to the right, bins downwards.
pub fn streak_x(movie: &Movie, row: u32) -> Image {
    let row = row.min(movie.height - 1);
    Image::from_fn(movie.width, movie.axis.bins, |x, bin| movie.pixel(x, row)[bin as usize])
}

/// A column over time: bins to the right, rows downwards.
pub fn streak_y(movie: &Movie, column: u32) -> Image {
    let column = column.min(movie.width - 1);
    Image::from_fn(movie.axis.bins, movie.height, |bin, y| movie.pixel(column, y)[bin as usize])
}

/// When light arrives at every pixel, in optical length: the middle of the first bin that holds a tenth of what the brightest
/// one holds, that of the brightest, and the mean over all bins weighted by luminance. 0 where no light is.
pub fn arrival(movie: &Movie) -> Image {
    let middle = |i: usize| movie.axis.begin(i as u32) + 0.5 * movie.axis.bin;
    Image::from_fn(movie.width, movie.height, |x, y| {
        let light: Vec<f64> = movie.pixel(x, y).iter().map(bright).collect();
        let (mut peak, mut sum, mut moment) = (0, 0.0, 0.0);
        for (i, v) in light.iter().enumerate() {
            if *v > light[peak] {
                peak = i;
            }
            sum += v;
            moment += v * middle(i);
        }
        let greatest = light.get(peak).copied().unwrap_or(0.0);
        if greatest <= 0.0 {
            return [0.0; 3];
        }
        let first = light.iter().position(|v| *v >= ONSET * greatest).unwrap_or(peak);
        [middle(first), middle(peak), moment / sum].map(|v| v as f32)
    })
}

/// The first arrival in colours, from the earliest to the latest pixel; without light green.
///
/// # Errors
/// Those of the encoder.
pub fn arrival_picture(movie: &Movie, meta: &[(String, String)]) -> Result<Vec<u8>, OutputError> {
    let first = arrival(movie);
    let values: Vec<f32> = first.data.iter().map(|v| if v[1] == 0.0 { f32::NAN } else { v[0] }).collect();
    let lit = || values.iter().copied().filter(|v| v.is_finite());
    let low = lit().fold(f32::INFINITY, f32::min);
    let high = lit().fold(f32::NEG_INFINITY, f32::max);
    let scale = if low < high { [low, high] } else { [0.0, 1.0] };
    let mut meta = meta.to_vec();
    meta.push(("scale".to_owned(), format!("{} to {}", scale[0], scale[1])));
    let map = ErrorMap { width: first.width, height: first.height, values, colours: Colours::Magma, top: None };
    png::encode_map(&map, scale, &meta)
}
