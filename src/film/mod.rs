//! Pixels: finished images, and the sums a run accumulates.
//!
//! Every buffer here is `[y][x][rgb]`, origin top-left, linear sRGB, radiance in scene units.

pub mod layer;
pub mod prefetch;
pub mod splat;
pub mod state;
pub mod time;

use std::sync::Arc;

/// An image of `f32` colour triples, `[y][x][rgb]`, origin top-left, linear sRGB.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width * height` pixels in row order.
    pub data: Vec<[f32; 3]>,
}

impl Image {
    /// A black image.
    pub fn new(width: u32, height: u32) -> Image {
        Image { width, height, data: vec![[0.0; 3]; width as usize * height as usize] }
    }

    /// An image whose pixel at column `x`, row `y` is `f(x, y)`.
    pub fn from_fn(width: u32, height: u32, mut f: impl FnMut(u32, u32) -> [f32; 3]) -> Image {
        let data = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| f(x, y)).collect();
        Image { width, height, data }
    }

    /// The pixel at column `x`, row `y`.
    pub fn at(&self, x: u32, y: u32) -> [f32; 3] {
        self.data[y as usize * self.width as usize + x as usize]
    }

    /// The mean of every channel over all pixels, summed in `f64`.
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

/// What a run accumulates: per pixel and channel the sum and the sum of squares of its samples, in `f64`.
///
/// Samples are added one by one in the order of their sample index, so the sums do not depend on how samples were
/// grouped into waves, on tiles, or on threads; and `f64` keeps counting where an `f32` running mean would stall.
///
/// Splats, which are light that a sample of another pixel brought, count in `sum` like everything else, over the same
/// `samples`. How many land on a pixel is nearly a Poisson number, so the variance of their sum is the plain sum of their
/// squares `q`, without a mean taken off. `sum2` is therefore kept such that [`Film::variance_of_mean`] is the sum of
/// both variances: with own sums `s`, `s2`, all sums `S` and `n` samples it is `s2 + q (n - 1) / n + (S^2 - s^2) / n`.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Samples every pixel has received.
    pub samples: u64,
    /// Sums, `[y][x][rgb]`.
    pub sum: Vec<[f64; 3]>,
    /// Sums of squares, `[y][x][rgb]`.
    pub sum2: Vec<[f64; 3]>,
}

impl Film {
    /// A film without samples.
    pub fn new(width: u32, height: u32) -> Film {
        let n = width as usize * height as usize;
        Film { width, height, samples: 0, sum: vec![[0.0; 3]; n], sum2: vec![[0.0; 3]; n] }
    }

    /// Two independent films of the same picture as one: all their samples together.
    ///
    /// The sums of squares are such that [`Film::variance_of_mean`] is that of the joint mean, whose weights are the
    /// numbers of samples: `(n1² v1 + n2² v2) / (n1 + n2)²`. That holds for films with splats too, whose sums of squares
    /// cannot simply be added. A film of fewer than two samples knows no variance, and lends that of the other.
    ///
    /// # Panics
    /// When the sizes differ.
    pub fn pooled(first: &Film, second: &Film) -> Film {
        assert_eq!([first.width, first.height], [second.width, second.height], "sizes differ");
        let mut all = Film::new(first.width, first.height);
        all.samples = first.samples + second.samples;
        let n = all.samples as f64;
        if all.samples == 0 {
            return all;
        }
        let parts = [first, second].map(|film| film.samples as f64);
        for (i, (sum, sum2)) in all.sum.iter_mut().zip(&mut all.sum2).enumerate() {
            for c in 0..3 {
                sum[c] = first.sum[i][c] + second.sum[i][c];
                // The sample variance of each part, in which it has one degree of freedom less than samples.
                let spread = [first, second].map(|film| {
                    let (s, q, m) = (film.sum[i][c], film.sum2[i][c], film.samples as f64);
                    if m < 2.0 { None } else { Some(((q - s * s / m) / (m - 1.0)).max(0.0)) }
                });
                let known: f64 = spread.iter().zip(parts).filter(|(v, _)| v.is_some()).map(|(_, m)| m).sum();
                let variance = if known > 0.0 {
                    spread.iter().zip(parts).map(|(v, m)| v.unwrap_or(0.0) * m).sum::<f64>() / known
                } else {
                    0.0
                };
                sum2[c] = variance * (n - 1.0) + sum[c] * sum[c] / n;
            }
        }
        all
    }

    /// The estimate: mean over samples. Black while there are none.
    pub fn mean(&self) -> Image {
        let scale = if self.samples == 0 { 0.0 } else { 1.0 / self.samples as f64 };
        Image {
            width: self.width,
            height: self.height,
            data: self.sum.iter().map(|s| s.map(|x| (x * scale) as f32)).collect(),
        }
    }

    /// The estimated variance of each pixel's mean: sample variance over `samples`. Zero with fewer than two samples.
    ///
    /// That is for independent samples. Those of the sampler `sobol` keep out of each other's way: their mean mostly varies
    /// less than is said here (and up to about twice as much where light hangs on a product of two decisions).
    pub fn variance_of_mean(&self) -> Image {
        let n = self.samples as f64;
        let pixel = |(s, q): (&[f64; 3], &[f64; 3])| {
            [0, 1, 2].map(|c| if n < 2.0 { 0.0 } else { ((q[c] - s[c] * s[c] / n) / (n - 1.0) / n).max(0.0) as f32 })
        };
        Image { width: self.width, height: self.height, data: self.sum.iter().zip(&self.sum2).map(pixel).collect() }
    }
}

/// A shared, immutable image, cheap to hand to several listeners.
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
        assert!((running / 0.1 - 1.0).abs() > 0.1, "an f32 sum would have done: {running}");
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
        assert_eq!((all.samples, all.mean().at(0, 0)[0]), (6, (20.0 / 6.0) as f32));
        // Variances of the means: 1 and 26 / 12; joint: (4 * 1 + 16 * 26 / 12) / 36.
        let expected = (4.0 + 16.0 * 26.0 / 12.0) / 36.0;
        assert!((f64::from(all.variance_of_mean().at(0, 0)[1]) - expected).abs() < 1e-6);
        // One sample alone has no variance; it borrows.
        let lent = Film::pooled(&film(&[4.0]), &many).variance_of_mean().at(0, 0)[0];
        assert!((f64::from(lent) - 26.0 / 3.0 / 5.0).abs() < 1e-6, "{lent}");
        assert_eq!(Film::pooled(&Film::new(1, 1), &many).mean(), many.mean());
        assert_eq!(Film::pooled(&Film::new(1, 1), &Film::new(1, 1)), Film::new(1, 1));
    }

    #[test]
    fn variance_of_the_mean_matches_the_textbook() {
        let mut film = Film::new(1, 1);
        for x in [1.0f64, 2.0, 4.0, 7.0] {
            film.sum[0] = film.sum[0].map(|s| s + x);
            film.sum2[0] = film.sum2[0].map(|s| s + x * x);
        }
        film.samples = 4;
        // mean 3.5, sample variance 7, variance of the mean 7/4
        assert!((film.variance_of_mean().at(0, 0)[1] - 1.75).abs() < 1e-6);
    }
}
