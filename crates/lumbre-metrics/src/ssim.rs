//! Structural similarity [Wang 2004], equal to scikit-image's `structural_similarity`.
//!
//! Each window compares mean, variance and covariance of the two images, per channel; the value is
//! the mean over the windows that lie wholly inside the image, and over the channels.

use rayon::prelude::*;

use super::floor::Noise;
use super::map::{Colours, PixelMap};
use super::{Better, DEFAULTS, DISPLAY_ON, MetricRow, MetricSpec, RANGE};
use lumbre_light::field;
use lumbre_light::film::Image;
use lumbre_light::value::schema::{Table, Ty};

/// Table row of the metric `ssim`.
pub const ROW: MetricRow = MetricRow {
    name: "ssim",
    label: "SSIM",
    long_name: "structural similarity",
    doc: "Mean structural similarity [Wang 2004] with K1 = 0.01 and K2 = 0.03, equal to scikit-image's \
          `structural_similarity`. Images smaller than the window are an error.",
    better: Better::Higher,
    perfect: 1.0,
    options: Table {
        name: "SsimOptions",
        doc: "Options of `ssim`.",
        fields: &[
            RANGE,
            field! {
                window = "uniform": Ty::Word(&["uniform", "gauss"]),
                    "`uniform`: 7x7 pixels, sample covariance; `gauss`: sigma 1.5 cut to 11x11 \
                     pixels, as in the paper"
            },
            DISPLAY_ON,
        ],
    },
    smallest: |spec| {
        if is_gauss(spec) {
            GAUSS as u32
        } else {
            UNIFORM as u32
        }
    },
    eval: |image, reference, spec| {
        let range = spec.number(RANGE.key);
        if is_gauss(spec) {
            Windows::gauss(image, reference, range).mean()
        } else {
            Windows::uniform(image, reference, range).mean()
        }
    },
    map: Some(PixelMap {
        eval: |image, reference, spec| {
            let range = spec.number(RANGE.key);
            if is_gauss(spec) {
                Windows::gauss(image, reference, range).map()
            } else {
                Windows::uniform(image, reference, range).map()
            }
        },
        colours: Colours::Magma,
        top: Some(1.0),
    }),
    noise: Noise::Similarity,
    ..DEFAULTS
};

/// Side of the uniform window in pixels.
const UNIFORM: usize = 7;
/// Side of the Gaussian window in pixels: 3.5 sigma to either side.
const GAUSS: usize = 11;
/// Standard deviation of the Gaussian window in pixels.
const GAUSS_SIGMA: f64 = 1.5;
/// Rows of windows per task; a task filters `window - 1` more pixel rows than this.
const BAND: usize = 48;

fn is_gauss(spec: &MetricSpec) -> bool {
    spec.says("window", "gauss")
}

/// The weighted moments of one row of windows: E[x], E[y], E[x² + y²] and E[xy], three channels
/// interleaved.
type Moments = [Vec<f64>; 4];

/// Number of values that are filtered together, so that they stay in registers.
const LANES: usize = 8;

/// Two images and the separable window `weights` x `weights` that compares them.
///
/// Filters are plain sums of few terms rather than running sums, because a firefly that enters and
/// leaves a running sum leaves its rounding error in all later windows.
struct Windows<'a, const N: usize> {
    x: &'a Image,
    y: &'a Image,
    weights: [f64; N],
    /// Factor for the variances and covariances of windows.
    bessel: f64,
    /// Constants C1 and C2 of [Wang 2004].
    c: [f64; 2],
}

impl<'a> Windows<'a, UNIFORM> {
    fn uniform(x: &'a Image, y: &'a Image, range: f64) -> Self {
        let pixels = (UNIFORM * UNIFORM) as f64;
        let weights = [1.0 / UNIFORM as f64; UNIFORM];
        Windows {
            x,
            y,
            weights,
            bessel: pixels / (pixels - 1.0),
            c: constants(range),
        }
    }
}

impl<'a> Windows<'a, GAUSS> {
    fn gauss(x: &'a Image, y: &'a Image, range: f64) -> Self {
        let unscaled: [f64; GAUSS] = std::array::from_fn(|i| {
            let d = (i as f64 - (GAUSS / 2) as f64) / GAUSS_SIGMA;
            (-0.5 * d * d).exp()
        });
        let sum: f64 = unscaled.iter().sum();
        Windows {
            x,
            y,
            weights: unscaled.map(|w| w / sum),
            bessel: 1.0,
            c: constants(range),
        }
    }
}

fn constants(range: f64) -> [f64; 2] {
    [(0.01 * range).powi(2), (0.03 * range).powi(2)]
}

impl<const N: usize> Windows<'_, N> {
    /// Number of rows of windows that lie wholly inside the image.
    fn rows(&self) -> usize {
        self.x.height as usize - N + 1
    }

    /// Windows in a row.
    fn columns(&self) -> usize {
        self.x.width as usize - N + 1
    }

    /// Returns the mean over all windows and channels. Rows are added in order for any number of
    /// threads.
    fn mean(&self) -> f64 {
        let rows = self.rows();
        let bands: Vec<f64> = (0..rows.div_ceil(BAND))
            .into_par_iter()
            .map(|band| {
                let mut sum = 0.0;
                self.visit(band * BAND..((band + 1) * BAND).min(rows), |moments| {
                    let values = (0..3 * self.columns()).map(|i| self.similarity(moments, i));
                    sum += values.sum::<f64>();
                });
                sum
            })
            .collect();
        bands.iter().sum::<f64>() / (3 * rows * self.columns()) as f64
    }

    /// Returns 1 - SSIM of the window around every pixel, mean over channels; pixels at the border
    /// take the nearest window.
    fn map(&self) -> Vec<f32> {
        let (width, rows, columns) = (self.x.width as usize, self.rows(), self.columns());
        let mut windows = vec![0.0; rows * columns];
        windows
            .par_chunks_mut(BAND * columns)
            .enumerate()
            .for_each(|(band, values)| {
                let mut lines = values.chunks_exact_mut(columns);
                self.visit(band * BAND..((band + 1) * BAND).min(rows), |moments| {
                    for (i, value) in lines.next().into_iter().flatten().enumerate() {
                        let similarity = (0..3)
                            .map(|c| self.similarity(moments, 3 * i + c))
                            .sum::<f64>()
                            / 3.0;
                        *value = (1.0 - similarity) as f32;
                    }
                });
            });
        let nearest = |at: usize, count: usize| at.saturating_sub(N / 2).min(count - 1);
        let pixels = (0..self.x.data.len())
            .map(|i| nearest(i / width, rows) * columns + nearest(i % width, columns));
        pixels.map(|window| windows[window]).collect()
    }

    /// Calls `visit` with the moments of every row of windows whose first pixel rows are `rows`.
    fn visit(&self, rows: std::ops::Range<usize>, mut each: impl FnMut(&Moments)) {
        let width = self.x.width as usize;
        let stride = (3 * self.columns()).next_multiple_of(LANES);
        let empty = |len: usize| -> Moments { std::array::from_fn(|_| vec![0.0; len]) };
        let mut products = empty(stride + 3 * (N - 1));
        let mut filtered: [Moments; N] = std::array::from_fn(|_| empty(stride));
        let mut window = empty(stride);
        for row in rows.start..rows.end + N - 1 {
            let at = row * width..(row + 1) * width;
            row_products(
                self.x.data[at.clone()].as_flattened(),
                self.y.data[at].as_flattened(),
                &mut products,
            );
            for (out, product) in filtered[row % N].iter_mut().zip(&products) {
                self.weigh(out, |j, at| &product[3 * j + at..]);
            }
            let Some(first) = (row + 1)
                .checked_sub(N)
                .filter(|first| *first >= rows.start)
            else {
                continue;
            };
            for (m, out) in window.iter_mut().enumerate() {
                self.weigh(out, |j, at| &filtered[(first + j) % N][m][at..]);
            }
            each(&window);
        }
    }

    /// Returns the weighted sum of `N` lines, where `line(j, at)` is line `j` from position `at`
    /// on.
    fn weigh<'l>(&self, out: &mut [f64], line: impl Fn(usize, usize) -> &'l [f64]) {
        for (i, chunk) in out.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
            let mut sum = [0.0; LANES];
            for (j, w) in self.weights.iter().enumerate() {
                for (s, v) in sum.iter_mut().zip(&line(j, i * LANES)[..LANES]) {
                    *s += w * v;
                }
            }
            *chunk = sum;
        }
    }

    /// SSIM of one window and channel.
    fn similarity(&self, [mx, my, squares, xy]: &Moments, at: usize) -> f64 {
        let (mx, my, [c1, c2]) = (mx[at], my[at], self.c);
        let (mean2, product) = (mx * mx + my * my, mx * my);
        let variances = self.bessel * (squares[at] - mean2);
        let covariance = self.bessel * (xy[at] - product);
        (2.0 * product + c1) * (2.0 * covariance + c2) / ((mean2 + c1) * (variances + c2))
    }
}

fn row_products(x: &[f32], y: &[f32], [px, py, squares, xy]: &mut Moments) {
    for (i, (x, y)) in x.iter().zip(y).enumerate() {
        let (x, y) = (f64::from(*x), f64::from(*y));
        px[i] = x;
        py[i] = y;
        squares[i] = x * x + y * y;
        xy[i] = x * y;
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::MetricError;

    #[test]
    fn images_smaller_than_the_window_are_an_error() {
        let spec = MetricSpec::new("ssim", "ssim", BTreeMap::new()).unwrap();
        let image = Image::new(7, 6);
        let e = spec.eval(&image, &image).unwrap_err();
        assert_eq!(
            e,
            MetricError::TooSmall {
                metric: "ssim",
                smallest: 7,
                image: [7, 6]
            }
        );
        let image = Image::new(7, 7);
        assert_eq!(spec.eval(&image, &image), Ok(1.0));
        let options = BTreeMap::from([("window".to_owned(), "gauss".into())]);
        let spec = MetricSpec::new("ssim", "ssim", options).unwrap();
        assert!(matches!(
            spec.eval(&image, &image),
            Err(MetricError::TooSmall { smallest: 11, .. })
        ));
    }

    #[test]
    fn the_bands_of_a_tall_image_add_up_to_the_whole() {
        // Rows repeat with period 1, so every row of windows has the same sum whatever band it
        // falls into.
        let noise = |x: u32, c: u32| ((x * 7 + c * 3) % 11) as f32 / 11.0;
        let a = Image::from_fn(20, 130, |x, _| [0, 1, 2].map(|c| noise(x, c)));
        let b = Image::from_fn(20, 130, |x, _| [0, 1, 2].map(|c| noise(x + 1, c)));
        let short = |i: &Image| Image::from_pixels(20, 7, i.data[..140].to_vec());
        let spec = MetricSpec::new("ssim", "ssim", BTreeMap::new()).unwrap();
        let (tall, small) = (
            spec.eval(&a, &b).unwrap(),
            spec.eval(&short(&a), &short(&b)).unwrap(),
        );
        assert!((tall - small).abs() < 1e-12, "{tall} {small}");
        assert!(small < 0.9, "{small}");
    }

    #[test]
    fn the_map_has_the_value_inside_and_repeats_it_at_the_border() {
        let wave = |x: u32, y: u32, shift: u32| ((x * 5 + y * 3 + shift) % 13) as f32 / 13.0;
        let a = Image::from_fn(19, 60, |x, y| [wave(x, y, 0), wave(x, y, 1), 0.5]);
        let b = Image::from_fn(19, 60, |x, y| [wave(x, y, 2), wave(x, y, 1), 0.4]);
        for window in ["uniform", "gauss"] {
            let options = BTreeMap::from([("window".to_owned(), window.into())]);
            let spec = MetricSpec::new("ssim", "ssim", options).unwrap();
            let r = (spec.row.smallest)(&spec) / 2;
            let map = spec.error_map(&a, &b).unwrap();
            let at = |x: u32, y: u32| f64::from(map.values[(y * 19 + x) as usize]);
            let inside: Vec<f64> = (r..60 - r)
                .flat_map(|y| (r..19 - r).map(move |x| (x, y)))
                .map(|(x, y)| at(x, y))
                .collect();
            let mean = 1.0 - inside.iter().sum::<f64>() / inside.len() as f64;
            assert!((mean - spec.eval(&a, &b).unwrap()).abs() < 1e-7, "{window}");
            assert_eq!((at(0, 0), at(18, 30)), (at(r, r), at(18 - r, 30)));
        }
    }
}
