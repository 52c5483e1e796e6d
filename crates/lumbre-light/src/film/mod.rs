//! Images and films. An [`Image`] holds finished pixels; a [`Film`] holds the sums that a run
//! accumulates, from which the image and its variance are computed.
//!
//! Every buffer in this module is laid out `[y][x][rgb]`, with the origin at the top left, in
//! linear sRGB and radiance in scene units.

pub mod fixed_point;
pub mod layer;
pub mod prefetch;
pub mod splat;
pub mod state;
pub mod time;
pub mod ztest;

use std::sync::Arc;

use serde::{Deserialize, Serialize};

/// Image of `f32` RGB triples, `[y][x][rgb]`, origin at the top left, linear sRGB.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// All `width * height` pixels, row by row.
    pub data: Vec<[f32; 3]>,
}

impl Image {
    /// Creates a black image.
    pub fn new(width: u32, height: u32) -> Image {
        Image::from_pixels(
            width,
            height,
            vec![[0.0; 3]; width as usize * height as usize],
        )
    }

    /// Creates an image of the given pixels, row by row.
    pub fn from_pixels(width: u32, height: u32, data: Vec<[f32; 3]>) -> Image {
        Image {
            width,
            height,
            data,
        }
    }

    /// Creates an image whose pixel at column `x`, row `y` is `f(x, y)`.
    pub fn from_fn(width: u32, height: u32, mut f: impl FnMut(u32, u32) -> [f32; 3]) -> Image {
        let data = (0..height)
            .flat_map(|y| (0..width).map(move |x| (x, y)))
            .map(|(x, y)| f(x, y))
            .collect();
        Image::from_pixels(width, height, data)
    }

    /// Returns the pixel at column `x`, row `y`.
    pub fn at(&self, x: u32, y: u32) -> [f32; 3] {
        self.data[y as usize * self.width as usize + x as usize]
    }

    /// Returns the mean of each channel over all pixels, summed in `f64`.
    pub fn mean(&self) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for p in &self.data {
            for c in 0..3 {
                sum[c] += f64::from(p[c]);
            }
        }
        sum.map(|s| s / self.data.len().max(1) as f64)
    }
}

/// Sums that a run accumulates: for each pixel and channel the sum and the sum of squares of the
/// samples, in `f64`.
///
/// Samples are added one by one in the order of their index, so the sums do not depend on how
/// samples are grouped into waves, on tiles or on threads. An `f32` running mean would stall where
/// `f64` sums still count.
///
/// Splats are contributions that a sample of another pixel found. They count in `sum` like all
/// others, over the same `samples`. The number of splats on a pixel is nearly Poisson distributed,
/// so the variance of their sum is the plain sum of their squares `q`, without subtracting a mean.
/// `sum2` is stored such that [`Film::variance_of_mean`] is the sum of both variances: with the
/// pixel's own sums `s`, `s2`, the total sum `S` and `n` samples, it is `s2 + q (n - 1) / n + (S^2
/// - s^2) / n`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Film {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Number of samples that every pixel has received.
    pub samples: u64,
    /// Sums of samples, `[y][x][rgb]`.
    pub sum: Vec<[f64; 3]>,
    /// Sums of squared samples, `[y][x][rgb]`; see [`Film`] for splats.
    pub sum2: Vec<[f64; 3]>,
}

impl Film {
    /// Creates a film without samples.
    pub fn new(width: u32, height: u32) -> Film {
        let n = width as usize * height as usize;
        Film {
            width,
            height,
            samples: 0,
            sum: vec![[0.0; 3]; n],
            sum2: vec![[0.0; 3]; n],
        }
    }

    /// Merges two independent films of the same picture into one that has the samples of both.
    ///
    /// The sums of squares are such that [`Film::variance_of_mean`] is the variance of the joint
    /// mean, weighted by the numbers of samples: `(n1² v1 + n2² v2) / (n1 + n2)²`. This also holds
    /// for films with splats, whose sums of squares cannot simply be added. A film of fewer than
    /// two samples has no variance estimate and uses that of the other film.
    ///
    /// # Panics
    /// Panics if the sizes differ.
    pub fn pooled(first: &Film, second: &Film) -> Film {
        assert_eq!(
            [first.width, first.height],
            [second.width, second.height],
            "sizes differ"
        );
        let mut all = Film::new(first.width, first.height);
        all.samples = first.samples + second.samples;
        let n = all.samples as f64;
        if all.samples == 0 {
            return all;
        }
        let counts = [first, second].map(|film| film.samples as f64);
        for (i, (sum, sum2)) in all.sum.iter_mut().zip(&mut all.sum2).enumerate() {
            for c in 0..3 {
                sum[c] = first.sum[i][c] + second.sum[i][c];
                // Sample variance of each film, which has one degree of freedom fewer than it has
                // samples.
                let variances = [first, second].map(|film| {
                    let (s, q, m) = (film.sum[i][c], film.sum2[i][c], film.samples as f64);
                    if m < 2.0 {
                        None
                    } else {
                        Some(((q - s * s / m) / (m - 1.0)).max(0.0))
                    }
                });
                let counted: f64 = variances
                    .iter()
                    .zip(counts)
                    .filter(|(v, _)| v.is_some())
                    .map(|(_, m)| m)
                    .sum();
                let variance = if counted > 0.0 {
                    variances
                        .iter()
                        .zip(counts)
                        .map(|(v, m)| v.unwrap_or(0.0) * m)
                        .sum::<f64>()
                        / counted
                } else {
                    0.0
                };
                sum2[c] = variance * (n - 1.0) + sum[c] * sum[c] / n;
            }
        }
        all
    }

    /// Returns the estimate: the mean over samples, or black if there are none.
    pub fn mean(&self) -> Image {
        let scale = if self.samples == 0 {
            0.0
        } else {
            1.0 / self.samples as f64
        };
        Image::from_pixels(
            self.width,
            self.height,
            self.sum
                .iter()
                .map(|s| s.map(|x| (x * scale) as f32))
                .collect(),
        )
    }

    /// Returns the root mean square standard error of all pixels over the mean of the picture;
    /// `None` if it cannot be estimated.
    pub fn relative_noise(&self) -> Option<f64> {
        let noise = relative_noise(&self.mean(), &self.variance_of_mean());
        noise.filter(|_| self.samples > 1)
    }

    /// Returns the [visible noise](visible_noise) of the picture; `None` if it cannot be estimated.
    pub fn visible_noise(&self) -> Option<f64> {
        let noise = visible_noise(&self.mean(), &self.variance_of_mean());
        noise.filter(|_| self.samples > 1)
    }

    /// Returns the estimated variance of each pixel's mean: sample variance divided by `samples`.
    /// Zero with fewer than two samples.
    ///
    /// The estimate assumes independent samples. Those of the samplers `sobol` and `zsobol16` are
    /// stratified: the true variance of their mean is mostly smaller, and up to about twice as large
    /// where light depends on a product of two random decisions.
    pub fn variance_of_mean(&self) -> Image {
        self.variance_over(self.samples as f64)
    }

    /// Returns the sample variance of each pixel: with its `n` samples, their sum `S` and their sum
    /// of squares `Q`, it is `(Q - S^2 / n) / (n - 1)`. Zero with fewer than two samples. With
    /// splats it is `n` times the variance of the mean.
    pub fn variance(&self) -> Image {
        self.variance_over(1.0)
    }

    /// Returns the sample variance of each pixel divided by `count`.
    fn variance_over(&self, count: f64) -> Image {
        let n = self.samples as f64;
        let pixel = |(s, q): (&[f64; 3], &[f64; 3])| {
            [0, 1, 2].map(|c| {
                if n < 2.0 {
                    0.0
                } else {
                    ((q[c] - s[c] * s[c] / n) / (n - 1.0) / count).max(0.0) as f32
                }
            })
        };
        Image::from_pixels(
            self.width,
            self.height,
            self.sum.iter().zip(&self.sum2).map(pixel).collect(),
        )
    }
}

/// Returns the root mean square standard error of all pixels over the mean of the picture, given the
/// variance of its pixels; `None` if the picture is black.
pub fn relative_noise(image: &Image, variance: &Image) -> Option<f64> {
    let level = level(image);
    (level > 0.0).then(|| self::level(variance).sqrt() / level)
}

/// Returns the mean of all pixels and channels.
fn level(image: &Image) -> f64 {
    image.mean().iter().sum::<f64>() / 3.0
}

/// Returns the same as [`relative_noise`] without the [`FIREFLIES`] pixels of largest variance: the
/// noise that one sees, since a few bright pixels can hold most of the other.
pub fn visible_noise(image: &Image, variance: &Image) -> Option<f64> {
    let level = level(image);
    let mut variances: Vec<f32> = variance.data.iter().map(|v| v.iter().sum()).collect();
    let kept = variances.len() - (variances.len() as f64 * FIREFLIES) as usize;
    if kept < variances.len() {
        variances.select_nth_unstable_by(kept, f32::total_cmp);
    }
    let sum: f64 = variances[..kept].iter().map(|v| f64::from(*v)).sum();
    (level > 0.0).then(|| (sum / (3 * kept) as f64).sqrt() / level)
}

/// Fraction of pixels that [`visible_noise`] leaves out.
const FIREFLIES: f64 = 1e-3;

/// Shared immutable image, cheap to pass to several receivers.
pub type SharedImage = Arc<Image>;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_to_the_26_samples_are_not_lost() {
        let mut film = Film::new(1, 1);
        for _ in 0..1u64 << 26 {
            let x = f64::from(0.1f32);
            film.sum[0][0] += x;
            film.sum2[0][0] += x * x;
        }
        film.samples = 1 << 26;
        let mean = film.mean().at(0, 0)[0];
        assert!((mean / 0.1 - 1.0).abs() < 1e-6, "{mean}");
        let running = (0..1u32 << 26).fold(0.0f32, |s, _| s + 0.1) / (1u32 << 26) as f32;
        assert!(
            (running / 0.1 - 1.0).abs() > 0.1,
            "an f32 sum would have done: {running}"
        );
    }

    #[test]
    fn a_firefly_is_no_visible_noise() {
        let image = Image::from_pixels(50, 40, vec![[1.0; 3]; 2000]);
        let mut variance = Image::from_pixels(50, 40, vec![[0.01; 3]; 2000]);
        variance.data[7] = [2e4; 3];
        let seen = visible_noise(&image, &variance).unwrap();
        assert!((seen - 0.1).abs() < 1e-4, "{seen}");
        let all = relative_noise(&image, &variance).unwrap();
        assert!((all - 3.16).abs() < 0.02, "{all}");
        let black = Image::from_pixels(50, 40, vec![[0.0; 3]; 2000]);
        assert_eq!(visible_noise(&black, &variance), None);
    }

    #[test]
    fn two_films_are_pooled_by_their_samples() {
        let film = |values: &[f64]| {
            let mut film = Film::new(1, 1);
            for x in values {
                film.sum[0] = film.sum[0].map(|s| s + x);
                film.sum2[0] = film.sum2[0].map(|s| s + x * x);
            }
            film.samples = values.len() as u64;
            film
        };
        let (few, many) = (film(&[1.0, 3.0]), film(&[2.0, 6.0, 7.0, 1.0]));
        let all = Film::pooled(&few, &many);
        assert_eq!(
            (all.samples, all.mean().at(0, 0)[0]),
            (6, (20.0 / 6.0) as f32)
        );
        // Variances of the means: 1 and 26 / 12; joint: (4 * 1 + 16 * 26 / 12) / 36.
        let expected = (4.0 + 16.0 * 26.0 / 12.0) / 36.0;
        assert!((f64::from(all.variance_of_mean().at(0, 0)[1]) - expected).abs() < 1e-6);
        // A single sample has no variance estimate and uses that of the other film.
        let single = Film::pooled(&film(&[4.0]), &many)
            .variance_of_mean()
            .at(0, 0)[0];
        assert!(
            (f64::from(single) - 26.0 / 3.0 / 5.0).abs() < 1e-6,
            "{single}"
        );
        assert_eq!(Film::pooled(&Film::new(1, 1), &many).mean(), many.mean());
        assert_eq!(
            Film::pooled(&Film::new(1, 1), &Film::new(1, 1)),
            Film::new(1, 1)
        );
    }

    #[test]
    fn variance_of_the_mean_matches_the_textbook() {
        let mut film = Film::new(1, 1);
        for x in [1.0f64, 2.0, 4.0, 7.0] {
            film.sum[0] = film.sum[0].map(|s| s + x);
            film.sum2[0] = film.sum2[0].map(|s| s + x * x);
        }
        film.samples = 4;
        // Mean 3.5, sample variance 7, variance of the mean 7/4.
        assert!((film.variance_of_mean().at(0, 0)[1] - 1.75).abs() < 1e-6);
    }
}
