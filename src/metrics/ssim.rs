//! Structural similarity [Wang 2004], equal to scikit-image's `structural_similarity`.
//!
//! Each window compares mean, variance and covariance of the two images, per channel; the value is the mean over the
//! windows that lie wholly inside the image, and over the channels.

use rayon::prelude::*;

use super::{Better, MetricRow, MetricSpec, ON, RANGE};
use crate::film::Image;
use crate::value::schema::{Field, Table, Ty};

/// The row of `ssim`.
pub const ROW: MetricRow = MetricRow {
    name: "ssim",
    label: "SSIM",
    long_name: "structural similarity",
    unit: "",
    doc: "Mean structural similarity [Wang 2004] with K1 = 0.01 and K2 = 0.03, equal to scikit-image's \
          `structural_similarity`. Images smaller than the window are an error.",
    better: Better::Higher,
    perfect: 1.0,
    options: Table {
        name: "SsimOptions",
        doc: "Options of `ssim`.",
        fields: &[
            RANGE,
            Field {
                key: "window",
                ty: Ty::Word(&["uniform", "gauss"]),
                required: false,
                default: "uniform",
                doc: "`uniform`: 7x7 pixels, sample covariance; `gauss`: sigma 1.5 cut to 11x11 pixels, as in the paper",
            },
            ON,
        ],
    },
    smallest: |spec| if is_gauss(spec) { GAUSS as u32 } else { UNIFORM as u32 },
    eval: |image, reference, spec| {
        let range = spec.number(RANGE.key);
        if is_gauss(spec) {
            mean_ssim(image, reference, range, gauss_weights(), 1.0)
        } else {
            let pixels = (UNIFORM * UNIFORM) as f64;
            mean_ssim(image, reference, range, [1.0 / UNIFORM as f64; UNIFORM], pixels / (pixels - 1.0))
        }
    },
};

/// Side of the uniform window in pixels.
const UNIFORM: usize = 7;
/// Side of the Gaussian window in pixels: 3.5 sigma to either side.
const GAUSS: usize = 11;
/// Standard deviation of the Gaussian window in pixels.
const GAUSS_SIGMA: f64 = 1.5;
/// Rows of windows that one task handles; it filters `window - 1` rows more than these.
const BAND: usize = 48;

fn is_gauss(spec: &MetricSpec) -> bool {
    spec.says("window", "gauss")
}

fn gauss_weights() -> [f64; GAUSS] {
    let unscaled: [f64; GAUSS] = std::array::from_fn(|i| {
        let d = (i as f64 - (GAUSS / 2) as f64) / GAUSS_SIGMA;
        (-0.5 * d * d).exp()
    });
    let sum: f64 = unscaled.iter().sum();
    unscaled.map(|w| w / sum)
}

/// The weighted moments of one row of windows: E[x], E[y], E[x² + y²] and E[xy], three channels interleaved.
type Moments = [Vec<f64>; 4];

/// Mean SSIM for the separable window `weights` x `weights`; `bessel` scales variances and covariance.
///
/// Filters are plain sums of few terms rather than running sums: a firefly that enters and leaves a running sum
/// leaves its rounding error behind in all later windows.
fn mean_ssim<const N: usize>(x: &Image, y: &Image, range: f64, weights: [f64; N], bessel: f64) -> f64 {
    let rows = x.height as usize - N + 1;
    let bands: Vec<f64> = (0..rows.div_ceil(BAND))
        .into_par_iter()
        .map(|band| band_sum(x, y, range, &weights, bessel, band * BAND..((band + 1) * BAND).min(rows)))
        .collect();
    let windows = rows * (x.width as usize - N + 1);
    bands.iter().sum::<f64>() / (3 * windows) as f64
}

/// The sum of SSIM over the windows whose first rows are `rows`, and over channels.
fn band_sum<const N: usize>(
    x: &Image,
    y: &Image,
    range: f64,
    weights: &[f64; N],
    bessel: f64,
    rows: std::ops::Range<usize>,
) -> f64 {
    let width = x.width as usize;
    let values = 3 * (width - N + 1);
    let empty = |len: usize| -> Moments { std::array::from_fn(|_| vec![0.0; len]) };
    let mut products = empty(3 * width);
    let mut filtered: [Moments; N] = std::array::from_fn(|_| empty(values));
    let mut window = empty(values);
    let (c1, c2) = ((0.01 * range).powi(2), (0.03 * range).powi(2));
    let mut sum = 0.0;
    for row in rows.start..rows.end + N - 1 {
        let at = row * width..(row + 1) * width;
        row_products(x.data[at.clone()].as_flattened(), y.data[at].as_flattened(), &mut products);
        for (out, product) in filtered[row % N].iter_mut().zip(&products) {
            out.fill(0.0);
            for (j, w) in weights.iter().enumerate() {
                accumulate(out, &product[3 * j..3 * j + values], *w);
            }
        }
        let Some(first) = (row + 1).checked_sub(N).filter(|first| *first >= rows.start) else { continue };
        for (m, out) in window.iter_mut().enumerate() {
            out.fill(0.0);
            for (j, w) in weights.iter().enumerate() {
                accumulate(out, &filtered[(first + j) % N][m], *w);
            }
        }
        sum += row_ssim(&window, c1, c2, bessel);
    }
    sum
}

fn accumulate(out: &mut [f64], input: &[f64], weight: f64) {
    for (o, i) in out.iter_mut().zip(input) {
        *o += weight * i;
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

fn row_ssim([mx, my, squares, xy]: &Moments, c1: f64, c2: f64, bessel: f64) -> f64 {
    let windows = mx.iter().zip(my).zip(squares.iter().zip(xy));
    windows
        .map(|((mx, my), (squares, xy))| {
            let (mean2, product) = (mx * mx + my * my, mx * my);
            let variances = bessel * (squares - mean2);
            let covariance = bessel * (xy - product);
            (2.0 * product + c1) * (2.0 * covariance + c2) / ((mean2 + c1) * (variances + c2))
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::metrics::MetricError;

    #[test]
    fn images_smaller_than_the_window_are_an_error() {
        let spec = MetricSpec::new("ssim", "ssim", BTreeMap::new()).unwrap();
        let image = Image::new(7, 6);
        let e = spec.eval(&image, &image).unwrap_err();
        assert_eq!(e, MetricError::TooSmall { metric: "ssim", smallest: 7, image: [7, 6] });
        let image = Image::new(7, 7);
        assert_eq!(spec.eval(&image, &image), Ok(1.0));
        let options = BTreeMap::from([("window".to_owned(), "gauss".into())]);
        let spec = MetricSpec::new("ssim", "ssim", options).unwrap();
        assert!(matches!(spec.eval(&image, &image), Err(MetricError::TooSmall { smallest: 11, .. })));
    }

    #[test]
    fn the_bands_of_a_tall_image_add_up_to_the_whole() {
        // Rows repeat with period 1, so every row of windows has the same sum whatever band it falls into.
        let noise = |x: u32, c: u32| ((x * 7 + c * 3) % 11) as f32 / 11.0;
        let a = Image::from_fn(20, 130, |x, _| [0, 1, 2].map(|c| noise(x, c)));
        let b = Image::from_fn(20, 130, |x, _| [0, 1, 2].map(|c| noise(x + 1, c)));
        let short = |i: &Image| Image { width: 20, height: 7, data: i.data[..140].to_vec() };
        let spec = MetricSpec::new("ssim", "ssim", BTreeMap::new()).unwrap();
        let (tall, small) = (spec.eval(&a, &b).unwrap(), spec.eval(&short(&a), &short(&b)).unwrap());
        assert!((tall - small).abs() < 1e-12, "{tall} {small}");
        assert!(small < 0.9, "{small}");
    }
}
