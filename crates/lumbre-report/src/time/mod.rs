//! Output files of films with a time axis: arrays, frames, animations, streak images, curves and
//! arrival maps.
//!
//! All of them are made from a [`Movie`], which is built from a finished run or from the arrays
//! that it wrote.

mod animation;
mod curve;
mod density;
mod npy;
mod still;

pub use animation::{apng, gif};
pub use curve::{TimeCurve, curves_csv, curves_figure};
pub(super) use density::DensityScale;
pub use npy::{decode as read_array, encode as array, read_numbers, read_shape};
pub use still::{arrival, arrival_picture, sheet, streak_x, streak_y};

use std::ops::Range;

use super::OutputError;
use lumbre_light::film::Image;
use lumbre_light::film::time::{CUBE_FILE, TimeAxis, TimeCube, time_unit};
use lumbre_light::math::luminance::luminance_of;
use lumbre_light::transport::time_settings::Timing;
use lumbre_metrics::tonemap::Tonemap;

/// Maximum number of frames of an animation. If there are more bins, groups of bins are summed.
pub const MAX_FRAMES: u32 = 240;

/// Number of frames that a run writes as EXR and on a sheet. They divide the time axis evenly.
pub const STILLS: u32 = 12;

/// Mean radiance of every pixel in every time bin.
#[derive(Clone, Debug, PartialEq)]
pub struct Movie {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Axis with the time bins.
    pub axis: TimeAxis,
    /// Time in seconds that light takes for an optical length of one scene unit, if known.
    pub seconds: Option<f64>,
    /// Mean radiance in linear sRGB, indexed as `[y][x][bin]`.
    pub mean: Vec<[f32; 3]>,
}

impl Movie {
    /// Divides the sums of a run by its number of samples. The slots before and after the time axis
    /// are dropped.
    pub fn from_cube(cube: &TimeCube, seconds: Option<f64>) -> Movie {
        let (bins, scale) = (cube.axis.bins as usize, 1.0 / cube.samples.max(1) as f64);
        let pixels = cube.sum.chunks_exact(cube.axis.slots());
        let mean = pixels
            .flat_map(|slots| {
                slots[1..=bins]
                    .iter()
                    .map(|s| s.map(|v| (v * scale) as f32))
            })
            .collect();
        Movie {
            width: cube.width,
            height: cube.height,
            axis: cube.axis,
            seconds,
            mean,
        }
    }

    /// Builds the movie of a run from the array that it wrote, with the time axis of its film.
    ///
    /// # Errors
    /// Returns an error if the bytes are no array of pixels with the bins of the axis.
    pub fn from_array(bytes: &[u8], timing: &Timing) -> Result<Movie, OutputError> {
        let (shape, numbers) = read_array(bytes)?;
        let bins = timing.axis.bins;
        let (height, width) = match shape[..] {
            [height, width, found, 3] if height * width > 0 && found == bins as usize => {
                (height as u32, width as u32)
            }
            _ => {
                return Err(OutputError::PictureRead {
                    reason: format!(
                        "expected an array of height x width x {bins} bins x 3, found shape \
                         {shape:?}"
                    ),
                });
            }
        };
        let (mean, _) = numbers.as_chunks::<3>();
        Ok(Movie {
            width,
            height,
            axis: timing.axis,
            seconds: timing.seconds(),
            mean: mean.to_vec(),
        })
    }

    /// Returns the bins of a pixel.
    pub fn pixel(&self, x: u32, y: u32) -> &[[f32; 3]] {
        let bins = self.axis.bins as usize;
        let first = (y as usize * self.width as usize + x as usize) * bins;
        &self.mean[first..first + bins]
    }

    /// Sums a range of bins to a picture.
    pub fn frame(&self, bins: Range<u32>) -> Image {
        Image::from_fn(self.width, self.height, |x, y| {
            let bins = &self.pixel(x, y)[bins.start as usize..bins.end as usize];
            bins.iter().fold([0.0; 3], |sum, v| {
                [sum[0] + v[0], sum[1] + v[1], sum[2] + v[2]]
            })
        })
    }

    /// Sums all bins to a picture.
    pub fn steady(&self) -> Image {
        self.frame(0..self.axis.bins)
    }

    /// Returns the bin that contains an optical length, or `None` if it is outside of the axis.
    pub fn bin(&self, length: f64) -> Option<u32> {
        let slot = self.axis.slot(self.axis.bin_position(length));
        (slot >= 1 && slot <= self.axis.bins as usize).then(|| slot as u32 - 1)
    }

    /// Divides the bins from the first to the last lit one into at most `most` groups of equal
    /// size.
    pub fn groups(&self, most: u32) -> Vec<Range<u32>> {
        let bins = self.axis.bins;
        let mut lit = vec![false; bins as usize];
        for pixel in self.mean.chunks_exact(bins as usize) {
            for (lit, v) in lit.iter_mut().zip(pixel) {
                *lit |= v.iter().any(|c| *c > 0.0);
            }
        }
        let first = lit.iter().position(|l| *l).unwrap_or(0) as u32;
        let last = lit
            .iter()
            .rposition(|l| *l)
            .map_or(bins, |l| l as u32 + 1)
            .max(first + 1);
        let step = (last - first).div_ceil(most.max(1)).max(1);
        (first..last)
            .step_by(step as usize)
            .map(|b| b..(b + step).min(bins))
            .collect()
    }

    /// Divides the axis evenly into at most [`STILLS`] ranges. They are the same for all films with
    /// this axis.
    pub fn stills(&self) -> Vec<Range<u32>> {
        let bins = self.axis.bins;
        let parts = STILLS.min(bins);
        let edge = |i: u32| (u64::from(i) * u64::from(bins) / u64::from(parts)) as u32;
        (0..parts).map(|i| edge(i)..edge(i + 1)).collect()
    }

    /// Returns the optical length at the centre of a range of bins.
    pub fn middle(&self, bins: &Range<u32>) -> f64 {
        0.5 * (self.axis.bin_start(bins.start) + self.axis.bin_start(bins.end))
    }

    /// Returns the tone map of frames: the sRGB curve with the exposure at which 99.5 % of the lit
    /// pixels of all frames stay below white.
    pub fn exposure(&self, groups: &[Range<u32>]) -> Tonemap {
        let mut lit: Vec<f32> = Vec::new();
        for pixel in self.mean.chunks_exact(self.axis.bins as usize) {
            for group in groups {
                let sum: f32 = pixel[group.start as usize..group.end as usize]
                    .iter()
                    .map(|v| v[0].max(v[1]).max(v[2]))
                    .sum();
                if sum > 0.0 && sum.is_finite() {
                    lit.push(sum);
                }
            }
        }
        if lit.is_empty() {
            return Tonemap::Srgb { exposure: 0.0 };
        }
        let at = (lit.len() * 199 / 200).min(lit.len() - 1);
        let (_, white, _) = lit.select_nth_unstable_by(at, f32::total_cmp);
        // Quarters of a stop, so that runs that differ only by noise get the same exposure.
        let exposure = -f64::from(*white).log2();
        Tonemap::Srgb {
            exposure: (exposure * 4.0).round() as f32 / 4.0,
        }
    }

    /// Formats an optical length, with the time that light takes for it if known.
    pub fn length_text(&self, length: f64) -> String {
        match self.seconds {
            Some(seconds) => format!(
                "{} = {}",
                crate::format::significant(length, 4),
                time_text(length * seconds)
            ),
            None => crate::format::significant(length, 4),
        }
    }
}

/// Formats a time in a suitable unit.
fn time_text(seconds: f64) -> String {
    let (unit, name) = time_unit(seconds);
    format!("{} {name}", crate::format::significant(seconds / unit, 4))
}

/// Returns the luminance of a pixel in linear sRGB.
fn pixel_luminance(v: &[f32; 3]) -> f64 {
    luminance_of(glam::Vec3::from_array(*v))
}

/// Applies the tone map and converts to 8 bits.
fn bytes(image: &Image, display: Tonemap) -> Vec<u8> {
    display
        .apply(image)
        .data
        .as_flattened()
        .iter()
        .map(|x| (x * 255.0).round() as u8)
        .collect()
}

fn encode_error(reason: impl std::fmt::Display) -> OutputError {
    OutputError::PngWrite {
        reason: reason.to_string(),
    }
}

/// An output file of a film with a time axis.
pub struct TimeFile {
    /// Name of the file.
    pub name: String,
    /// Content of the file.
    pub bytes: Vec<u8>,
}

/// Builds all files of a run's time axis: arrays of means and variances and of the light outside of
/// the bins, a sheet of frames, animations, streak images through the centre, the curve of the
/// whole picture, and the arrival map. `seconds` is as in [`Movie::seconds`].
///
/// # Errors
/// Returns an error if an encoder fails.
pub fn files(
    cube: &TimeCube,
    seconds: Option<f64>,
    meta: &[(String, String)],
) -> Result<Vec<TimeFile>, OutputError> {
    let movie = Movie::from_cube(cube, seconds);
    let [w, h, bins] = [cube.width, cube.height, cube.axis.bins].map(|n| n as usize);
    let at = |x: usize, y: usize, slot: usize| cube.mean(x as u32, y as u32, slot);
    let pixels = || (0..w * h).map(move |p| (p % w, p / w));
    let outside = pixels()
        .flat_map(|(x, y)| [at(x, y, 0), at(x, y, bins + 1)])
        .flatten();
    let variance = pixels()
        .flat_map(|(x, y)| {
            (1..=bins).map(move |slot| cube.variance_of_mean(x as u32, y as u32, slot))
        })
        .flatten();
    let mut files = vec![
        TimeFile {
            name: CUBE_FILE.into(),
            bytes: array(&[h, w, bins, 3], movie.mean.iter().flatten().copied()),
        },
        TimeFile {
            name: "time-outside.npy".into(),
            bytes: array(&[h, w, 2, 3], outside),
        },
        TimeFile {
            name: "time-variance.npy".into(),
            bytes: array(&[h, w, bins, 3], variance),
        },
    ];
    for (i, group) in movie.stills().into_iter().enumerate() {
        let name = still_name(i, movie.middle(&group));
        let mut meta = meta.to_vec();
        meta.push((
            "length".to_owned(),
            format!(
                "{} to {}",
                movie.axis.bin_start(group.start),
                movie.axis.bin_start(group.end)
            ),
        ));
        files.push(TimeFile {
            name: format!("{name}.exr"),
            bytes: super::exr::encode(&movie.frame(group), &meta)?,
        });
    }
    files.extend(pictures(&movie, [cube.width / 2, cube.height / 2], meta)?);
    Ok(files)
}

/// Returns the name of a still without extension, from its index and the optical length at its
/// centre.
pub fn still_name(i: usize, middle: f64) -> String {
    format!("time-frame-{:02}-{middle:.4}", i + 1)
}

/// Parses the optical length at the centre of a still from its name.
pub fn still_length(name: &str) -> Option<f64> {
    name.strip_prefix("time-frame-")?
        .split_once('-')?
        .1
        .parse()
        .ok()
}

/// Builds those of the [`files`] that are pictures or curves, with streak images through the column
/// and row `through`.
///
/// # Errors
/// Returns an error if an encoder fails.
pub fn pictures(
    movie: &Movie,
    through: [u32; 2],
    meta: &[(String, String)],
) -> Result<Vec<TimeFile>, OutputError> {
    let groups = movie.groups(MAX_FRAMES);
    let display = movie.exposure(&groups);
    let mut meta = meta.to_vec();
    meta.push(("display".to_owned(), display.to_string()));
    let [column, row] = through;
    let picture = TimeCurve::region(
        movie,
        [0, 0, movie.width, movie.height],
        "mean of the picture",
    );
    let pixel = TimeCurve::region(
        movie,
        [column, row, column + 1, row + 1],
        &format!("pixel {column}, {row}"),
    );
    let curves = [picture, pixel];
    let file = |name: &str, bytes: Vec<u8>| TimeFile {
        name: name.to_owned(),
        bytes,
    };
    let (svg, png) = curves_figure(movie, &curves)?;
    Ok(vec![
        file("time-frames.png", sheet(movie)?),
        file("time-animation.png", apng(movie, &groups, display, &meta)?),
        file("time-animation.gif", gif(movie, &groups, display)?),
        file(
            "time-streak-x.png",
            super::png::encode(&streak_x(movie, row), display, &meta)?,
        ),
        file(
            "time-streak-y.png",
            super::png::encode(&streak_y(movie, column), display, &meta)?,
        ),
        file("time-curve.csv", curves_csv(movie, &curves).into_bytes()),
        file("time-curve.svg", svg.into_bytes()),
        file("time-curve.png", png),
        file(
            "time-arrival.exr",
            super::exr::encode(&arrival(movie), &meta)?,
        ),
        file("time-arrival.png", arrival_picture(movie, &meta)?),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a film of 2 by 3 pixels and `bins` bins from 10.0, half a unit wide, with two samples.
    /// `value` is the mean of a pixel in a slot, in all channels.
    fn cube(bins: u32, value: impl Fn(u32, u32, u32) -> f64) -> TimeCube {
        let (width, height, slots) = (2, 3, bins + 2);
        let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let sum: Vec<[f64; 3]> = places
            .flat_map(|(x, y)| (0..slots).map(move |slot| (x, y, slot)))
            .map(|(x, y, slot)| [2.0 * value(x, y, slot); 3])
            .collect();
        TimeCube {
            axis: TimeAxis {
                start: 10.0,
                bin: 0.5,
                bins,
            },
            width,
            height,
            samples: 2,
            square: vec![[0.0; 3]; sum.len()],
            sum,
        }
    }

    /// Returns a film whose pixels and bins all differ.
    fn distinct() -> Movie {
        let value = |x, y, slot| f64::from(100 * y + 10 * x + slot);
        Movie::from_cube(&cube(4, value), None)
    }

    #[test]
    fn a_movie_has_the_means_of_the_bins_without_the_light_outside() {
        let movie = distinct();
        let red = |x, y| movie.pixel(x, y).iter().map(|v| v[0]).collect::<Vec<_>>();
        assert_eq!(red(0, 0), [1.0, 2.0, 3.0, 4.0]);
        assert_eq!(red(1, 2), [211.0, 212.0, 213.0, 214.0]);
        assert_eq!(movie.steady().data[1], [11.0 + 12.0 + 13.0 + 14.0; 3]);
        let bins = [9.99, 10.0, 10.6, 11.99, 12.0].map(|length| movie.bin(length));
        assert_eq!(bins, [None, Some(0), Some(1), Some(3), None]);
    }

    #[test]
    fn streaks_show_a_row_with_bins_downwards_and_a_column_with_bins_to_the_right() {
        let movie = distinct();
        let red = |image: &Image| image.data.iter().map(|v| v[0]).collect::<Vec<_>>();
        let row = streak_x(&movie, 1);
        assert_eq!([row.width, row.height], [2, 4]);
        assert_eq!(red(&row)[..4], [101.0, 111.0, 102.0, 112.0]);
        let column = streak_y(&movie, 1);
        assert_eq!([column.width, column.height], [4, 3]);
        assert_eq!(red(&column)[3..6], [14.0, 111.0, 112.0]);
    }

    #[test]
    fn stills_cover_the_axis_without_gaps() {
        for bins in [1, 5, 12, 13, 25, 100] {
            let stills = Movie::from_cube(&cube(bins, |_, _, _| 1.0), None).stills();
            assert_eq!(stills.len() as u32, bins.min(STILLS));
            assert_eq!(stills[0].start, 0);
            assert_eq!(stills.last().unwrap().end, bins);
            assert!(stills.windows(2).all(|pair| pair[0].end == pair[1].start));
        }
    }

    #[test]
    fn animations_span_the_lit_bins() {
        let lit = |slots: Range<u32>| {
            let value = move |x, _, slot| f64::from(u8::from(x == 1 && slots.contains(&slot)));
            Movie::from_cube(&cube(20, value), None)
        };
        assert_eq!(
            lit(4..11).groups(10),
            [3..4, 4..5, 5..6, 6..7, 7..8, 8..9, 9..10]
        );
        assert_eq!(lit(4..11).groups(3), [3..6, 6..9, 9..12]);
        assert_eq!(lit(20..21).groups(3), vec![19..20; 1]);
        assert_eq!(
            lit(0..0).groups(1),
            vec![0..20; 1],
            "all bins of a black film"
        );
    }

    #[test]
    fn arrival_times_are_centres_of_bins() {
        // Slot 1 is the bin from 10.0 to 10.5.
        let light = [0.0, 0.05, 0.2, 1.0, 0.75];
        let value = |x, y, slot| match (x, y) {
            (1, 0) => light.get(slot as usize).copied().unwrap_or(0.0),
            _ => 0.0,
        };
        let found = arrival(&Movie::from_cube(&cube(6, value), None));
        assert_eq!(found.data[0], [0.0; 3], "no light arrives");
        let [first, peak, mean] = found.data[1].map(f64::from);
        let expected = (0.05 * 10.25 + 0.2 * 10.75 + 11.25 + 0.75 * 11.75) / 2.0;
        assert_eq!([first, peak], [10.75, 11.25]);
        assert!((mean - expected).abs() < 1e-5, "{mean} {expected}");
    }

    #[test]
    fn curves_are_means_of_their_region() {
        let movie = distinct();
        let whole = TimeCurve::region(&movie, [0, 0, 9, 9], "all");
        let expected = [1.0, 2.0, 3.0, 4.0].map(|bin| 100.0 + 5.0 + bin);
        for (value, expected) in whole.values.iter().zip(expected) {
            assert!((value[1] - expected).abs() < 1e-9, "{value:?} {expected}");
        }
        let pixel = TimeCurve::region(&movie, [1, 2, 2, 3], "one");
        assert_eq!(pixel.values[3], [214.0; 3]);
        let csv = curves_csv(&movie, &[pixel]);
        assert_eq!(
            csv.lines().nth(1),
            Some("10,211,211,211"),
            "length of the start of the bin, then the colour"
        );
    }
}
