//! Tests whether two estimates of one image differ by more than their noise.
//!
//! Pixels of a path tracer are far from normally distributed: most samples are black and few are
//! bright. Sums over square blocks are nearly normal once enough samples are expected to have found
//! light, so blocks are compared, and blocks too dark for a test of their own are pooled into one.
//!
//! Where few pixels have most of the noise of an image and the other image has little there, as
//! where a lamp behind glass was met by chance, a block without such pixels seems to have little
//! noise, but only has not met them. This noise is *lone*. If it is uneven, no block is taken to
//! have less than its share of it ([`EVEN_NOISE`]), and a sum over the whole image is tested only if
//! enough pixels share it ([`MIN_NOISY_PIXELS`]). Noise that both images have in the same pixels, as
//! at the edge of a lamp, is known.
//!
//! The remaining skew is removed by comparing square roots. An image that found less light than it
//! should have also underestimates its variance, because both come from the same samples, and
//! `(a - b) / sigma` would give far too many false alarms at the small significance levels that
//! many comparisons require. The square root of a sum of rare events has nearly constant variance;
//! for noise that is small relative to the mean the result is unchanged.

use crate::film::Image;
use crate::math::stats::{normal_two_sided_p, sidak};

/// An estimate of an image: its mean, and the variance of that mean, per pixel and channel.
#[derive(Clone, Copy, Debug)]
pub struct Estimate<'a> {
    /// Mean image, linear radiance.
    pub mean: &'a Image,
    /// Variance of the mean; zero for exact pixels.
    pub variance: &'a Image,
}

/// Summary of the comparison of two estimates.
#[derive(Clone, Debug, PartialEq)]
pub struct ZTest {
    /// Number of comparisons: blocks times channels.
    pub comparisons: usize,
    /// Smallest p-value of all blocks.
    pub worst_p: f64,
    /// Column and row of the first pixel of that block, or `None` for the pooled dark blocks.
    pub worst_at: Option<[u32; 2]>,
    /// Ratio of the sums over the whole picture, first over second; NaN where the second is black.
    pub ratio: f64,
    /// Standard normal deviate of the difference of those sums, for the channel in which it is
    /// greatest. Channels share their noise, so they are not combined as if independent.
    pub z: f64,
}

impl ZTest {
    /// Returns whether the images agree at significance `alpha`, shared among `tests` such tests
    /// and all their blocks [Sidak 1967]. The three channel sums count as comparisons too.
    pub fn agrees(&self, alpha: f64, tests: usize) -> bool {
        let each = self.level(alpha, tests);
        self.worst_p > each && normal_two_sided_p(self.z) > each
    }

    /// Significance of each comparison when `alpha` is shared among `tests` such tests.
    pub fn level(&self, alpha: f64, tests: usize) -> f64 {
        sidak(alpha, (self.comparisons + 3) * tests.max(1))
    }
}

#[derive(Clone, Copy, Default)]
struct Sums {
    first: f64,
    second: f64,
    /// Sums of `first` and of `second`.
    variance: [f64; 2],
    /// Number of pixels.
    pixels: usize,
    /// Sums of the variances of those pixels of `first` and of `second` that are lone, and of their
    /// squares.
    lone: [f64; 2],
    squared_lone: [f64; 2],
}

/// Ratio of the shares that a pixel has in the noise of both images, from which that in the image with
/// the larger share is lone. Shares do not depend on how many samples an image has.
const LONE: f64 = 4.0;

/// Effective share of the pixels that have the noise of an image, from which it is taken to be
/// even: the squared sum of their variances over the sum of the squared lone ones and over their
/// number. In simulations of techniques of which one has rare bright paths and the other none, 17 to
/// 100 of 100 pairs are called different at 1 % without this rule, and 0 to 4 with it.
const EVEN_NOISE: f64 = 0.3;

/// Effective number of pixels from which a sum over an image is taken to be normally distributed. Of
/// small images a quarter must share the noise.
const MIN_NOISY_PIXELS: f64 = 20.0;

/// Relative difference that single-precision rounding explains in images without noise.
const ROUNDING: f64 = 1e-5;

impl Sums {
    fn add(&mut self, other: Sums) {
        self.first += other.first;
        self.second += other.second;
        self.variance = [0, 1].map(|i| self.variance[i] + other.variance[i]);
        self.pixels += other.pixels;
        self.lone = [0, 1].map(|i| self.lone[i] + other.lone[i]);
        self.squared_lone = [0, 1].map(|i| self.squared_lone[i] + other.squared_lone[i]);
    }

    /// Returns the effective number of pixels that share the noise of each image; infinite if none of
    /// it is lone, NaN without noise.
    fn noisy_pixels(&self) -> [f64; 2] {
        [0, 1].map(|i| self.variance[i] * self.variance[i] / self.squared_lone[i])
    }

    /// Returns whether enough pixels share the noise for a test that assumes a normal distribution.
    fn is_shared(&self) -> bool {
        let least = MIN_NOISY_PIXELS.min(0.25 * self.pixels as f64);
        let [i, j] = self.variance;
        let noisy = self.noisy_pixels()[usize::from(i <= j)];
        noisy.is_nan() || noisy >= least
    }

    /// Raises the variances to the share of these pixels in the lone ones of the whole image, where
    /// few of its pixels have most of the noise.
    fn raise_variance(&mut self, whole: &Sums) {
        let noisy = whole.noisy_pixels();
        for i in [0, 1] {
            if noisy[i] < EVEN_NOISE * whole.pixels as f64 {
                let share = self.pixels as f64 / whole.pixels as f64;
                self.variance[i] = self.variance[i].max(share * whole.lone[i]);
            }
        }
    }

    fn z(&self) -> f64 {
        let difference = self.first - self.second;
        let [v1, v2] = self.variance;
        if difference.abs() <= ROUNDING * self.second.abs() {
            0.0
        } else if self.first >= 0.0 && self.second >= 0.0 {
            let relative = |sum: f64, variance: f64| if sum > 0.0 { variance / sum } else { 0.0 };
            let sigma = (relative(self.first, v1) + relative(self.second, v2)).sqrt();
            2.0 * (self.first.sqrt() - self.second.sqrt()) / sigma
        } else {
            difference / (v1 + v2).sqrt()
        }
    }
}

/// One comparison: a block of pixels, or all pooled dark blocks, in one channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judged {
    /// Column and row of the block's first pixel; `None` for the pooled dark blocks.
    pub at: Option<[u32; 2]>,
    /// Channel index, 0 for red.
    pub channel: usize,
    /// Standard normal deviate of the difference, first minus second.
    pub z: f64,
    /// Two-sided p-value of the deviate.
    pub p: f64,
}

/// All comparisons of two estimates, by block and for the whole image.
#[derive(Clone, Debug, PartialEq)]
pub struct Blocks {
    /// Blocks that are bright enough, row by row, then the pooled dark blocks.
    pub judged: Vec<Judged>,
    /// Dark blocks one by one. They show where light is, but are not significant on their own.
    pub dark: Vec<Judged>,
    /// Deviates of the differences of the channel sums over the whole image; `None` where a few
    /// pixels have most of the noise.
    pub whole: [Option<f64>; 3],
    /// Ratio of the sums over the whole picture, first over second; NaN where the second is black.
    pub ratio: f64,
}

/// Compares two estimates of equal size by blocks of `block` pixels a side. Blocks whose sum in the
/// second image is below `bright_enough` are pooled. If the pool is below it in both images, it is
/// not tested.
///
/// Blocks at the right and lower edge hold the remaining pixels.
///
/// # Panics
/// When the sizes differ.
pub fn compare(first: Estimate, second: Estimate, block: u32, bright_enough: f64) -> ZTest {
    let Blocks {
        judged,
        whole,
        ratio,
        ..
    } = blocks(first, second, block, bright_enough);
    let worst = judged
        .iter()
        .filter(|j| j.p < 1.0)
        .reduce(|a, b| if b.p < a.p { b } else { a });
    ZTest {
        comparisons: judged.len(),
        worst_p: worst.map_or(1.0, |j| j.p),
        worst_at: worst.and_then(|j| j.at),
        ratio,
        z: whole
            .into_iter()
            .flatten()
            .max_by(|a, b| a.abs().total_cmp(&b.abs()))
            .unwrap_or_default(),
    }
}

/// Returns the single comparisons that [`compare`] summarises.
///
/// # Panics
/// When the sizes differ.
pub fn blocks(first: Estimate, second: Estimate, block: u32, bright_enough: f64) -> Blocks {
    assert_eq!(
        [first.mean.width, first.mean.height],
        [second.mean.width, second.mean.height],
        "sizes differ"
    );
    let [width, height] = [first.mean.width, first.mean.height];
    let [columns, rows] = [width, height].map(|side| side.div_ceil(block));
    let mut judged = Vec::new();
    let mut dark_blocks = Vec::new();
    let judge = |sums: &Sums, channel: usize, at: Option<[u32; 2]>| {
        let z = sums.z();
        Judged {
            at,
            channel,
            z,
            p: normal_two_sided_p(z),
        }
    };
    let totals = [first, second].map(|e| {
        let mean = e.variance.mean();
        mean.map(|variance| variance * e.variance.data.len() as f64)
    });
    let mut whole = [Sums::default(); 3];
    let mut blocks = Vec::new();
    for (bx, by) in (0..rows).flat_map(|y| (0..columns).map(move |x| (x, y))) {
        for (c, whole) in whole.iter_mut().enumerate() {
            let mut sums = Sums::default();
            let inside = |(x, y): &(u32, u32)| *x < width && *y < height;
            for (x, y) in (0..block * block)
                .map(|i| (bx * block + i % block, by * block + i / block))
                .filter(inside)
            {
                let variance = [first, second].map(|e| f64::from(e.variance.at(x, y)[c]));
                let lone = [0, 1].map(|i| {
                    let [own, other] = [totals[i][c], totals[1 - i][c]];
                    // An image without noise shows nothing about that of the other.
                    let is_lone = variance[i] * other >= LONE * variance[1 - i] * own;
                    if is_lone { variance[i] } else { 0.0 }
                });
                sums.add(Sums {
                    first: f64::from(first.mean.at(x, y)[c]),
                    second: f64::from(second.mean.at(x, y)[c]),
                    variance,
                    pixels: 1,
                    lone,
                    squared_lone: lone.map(|v| v * v),
                });
            }
            whole.add(sums);
            blocks.push(([bx * block, by * block], c, sums));
        }
    }
    let mut dark = [Sums::default(); 3];
    for (at, c, mut sums) in blocks {
        sums.raise_variance(&whole[c]);
        if sums.second >= bright_enough {
            judged.push(judge(&sums, c, Some(at)));
        } else {
            dark_blocks.push(judge(&sums, c, Some(at)));
            dark[c].add(sums);
        }
    }
    for (c, sums) in dark
        .iter()
        .enumerate()
        .filter(|(_, sums)| sums.first.max(sums.second) >= bright_enough)
    {
        judged.push(judge(sums, c, None));
    }
    let [first, second] =
        [|s: &Sums| s.first, |s: &Sums| s.second].map(|of| whole.iter().map(of).sum::<f64>());
    Blocks {
        judged,
        dark: dark_blocks,
        whole: whole.map(|sums| sums.is_shared().then(|| sums.z())),
        ratio: first / second,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::{normal, pcg4d, unit};

    /// A constant image of 1 with normal noise of variance 0.01 in every pixel, and a bias.
    fn noisy(seed: u32, bias: f32) -> Image {
        Image::from_fn(80, 60, |x, y| {
            [0, 1, 2].map(|c| {
                let w = pcg4d([x, y, c, seed]);
                1.0 + bias + 0.1 * normal([unit(w[0]), unit(w[1])])
            })
        })
    }

    fn constant(v: f32) -> Image {
        Image::from_fn(80, 60, |_, _| [v; 3])
    }

    fn test(a: &Image, b: &Image, variance: f32) -> ZTest {
        let variance = constant(variance);
        let zero = constant(0.0);
        compare(
            Estimate {
                mean: a,
                variance: &variance,
            },
            Estimate {
                mean: b,
                variance: &zero,
            },
            10,
            1.0,
        )
    }

    #[test]
    fn noise_alone_agrees_and_p_values_are_honest() {
        // About one in a hundred of 200 unbiased images may be called different at 1 %.
        let truth = constant(1.0);
        let alarms = (0..200)
            .filter(|s| !test(&noisy(*s, 0.0), &truth, 0.01).agrees(0.01, 1))
            .count();
        assert!(alarms <= 7, "{alarms} of 200");
    }

    #[test]
    fn a_small_bias_everywhere_is_found_by_the_sums() {
        let t = test(&noisy(7, 0.01), &constant(1.0), 0.01);
        assert!(!t.agrees(0.01, 1), "{t:?}");
        assert!((t.ratio - 1.01).abs() < 0.005);
    }

    #[test]
    fn channels_that_share_their_noise_count_once() {
        let grey = |seed| {
            let image = noisy(seed, 0.0);
            Image::from_fn(80, 60, |x, y| [image.at(x, y)[0]; 3])
        };
        let beyond = |seed: &u32| test(&grey(*seed), &constant(1.0), 0.01).z.abs() > 1.96;
        let count = (0..200).filter(beyond).count();
        assert!((2..=20).contains(&count), "{count} of 200, 10 are expected");
    }

    #[test]
    fn a_wrong_block_is_found_and_placed() {
        let mut image = noisy(8, 0.0);
        for y in 20..30 {
            for x in 50..60 {
                image.data[y * 80 + x][1] += 0.1;
            }
        }
        let t = test(&image, &constant(1.0), 0.01);
        assert!(!t.agrees(0.01, 1));
        assert_eq!(t.worst_at, Some([50, 20]));
    }

    /// An image of rare events of equal size, `expected` on average in every block of 10 x 10
    /// pixels.
    fn found(seed: u32, expected: f32) -> (Image, Image) {
        let rate = expected / 100.0;
        let image = Image::from_fn(80, 60, |x, y| {
            [0, 1, 2].map(|c| {
                (0..64)
                    .filter(|i| unit(pcg4d([x, y, c * 64 + i, seed])[0]) < rate / 64.0)
                    .count() as f32
            })
        });
        let variance = image.clone();
        (image, variance)
    }

    #[test]
    fn rare_finds_do_not_cry_wolf_at_small_levels() {
        // 300 images of 144 blocks with 50 events each: at 1e-4, 4.3 of all blocks should be called
        // different. The plain deviate calls several times as many.
        let truth = constant(0.5);
        let zero = constant(0.0);
        let mut alarms = 0;
        for seed in 0..300 {
            let (image, variance) = found(seed, 50.0);
            let first = Estimate {
                mean: &image,
                variance: &variance,
            };
            let t = compare(
                first,
                Estimate {
                    mean: &truth,
                    variance: &zero,
                },
                10,
                1.0,
            );
            alarms += usize::from(t.worst_p < 1e-4);
        }
        assert!(alarms <= 12, "{alarms} of 300");
    }

    /// A picture of 64 samples a pixel: one of `rarity` is `brightness` times as bright as the others.
    fn rare(seed: u32, rarity: f32, brightness: f64) -> (Image, Image) {
        let mut variance = Image::new(80, 60);
        let mean = Image::from_fn(80, 60, |x, y| {
            [0, 1, 2].map(|c| {
                let sample = |i: u32| {
                    let w = pcg4d([x, y, 64 * c + i, seed]);
                    let is_bright = unit(w[0]) < 1.0 / rarity;
                    f64::from(unit(w[1])) * if is_bright { brightness } else { 1.0 }
                };
                let samples: Vec<f64> = (0..64).map(sample).collect();
                let mean = samples.iter().sum::<f64>() / 64.0;
                let squares: f64 = samples.iter().map(|s| (s - mean).powi(2)).sum();
                let of_mean = squares / 63.0 / 64.0;
                variance.data[(80 * y + x) as usize][c as usize] = of_mean as f32;
                mean as f32
            })
        });
        (mean, variance)
    }

    #[test]
    fn a_technique_that_met_few_bright_paths_does_not_differ_from_one_without() {
        // Both have the mean 0.5 (1 + 299 / 12800). Of 100 pairs at 1 %, 1 may be called different;
        // without the rule of even noise it is nine of ten.
        let smooth = |seed: u32| {
            let (mut mean, mut variance) = rare(seed, f32::INFINITY, 1.0);
            let scale = 1.0 + 299.0 / 12800.0;
            mean.data
                .as_flattened_mut()
                .iter_mut()
                .for_each(|x| *x *= scale);
            variance
                .data
                .as_flattened_mut()
                .iter_mut()
                .for_each(|x| *x *= scale * scale);
            (mean, variance)
        };
        let alarms = (0..100).filter(|seed| {
            let [a, b] = [rare(2 * seed, 12800.0, 300.0), smooth(2 * seed + 1)];
            let [a, b] = [&a, &b].map(|(mean, variance)| Estimate { mean, variance });
            !compare(a, b, 10, 1.0).agrees(0.01, 1)
        });
        let alarms = alarms.count();
        assert!(alarms <= 5, "{alarms} of 100");
    }

    #[test]
    fn noise_that_both_images_have_in_few_pixels_hides_no_bias() {
        // The edge of a lamp has nearly all of the noise, of variance 1 in 14 pixels.
        let variance = Image::from_fn(80, 60, |x, y| {
            [if y == 30 && x < 14 { 1.0 } else { 1e-6 }; 3]
        });
        let image = |seed: u32, bias: f32| {
            let deviates = noisy(seed, 0.0);
            Image::from_fn(80, 60, |x, y| {
                let deviate = deviates.at(x, y).map(|v| (v - 1.0) / 0.1);
                let sigma = variance.at(x, y)[0].sqrt();
                deviate.map(|deviate| 5.0 + bias + sigma * deviate)
            })
        };
        let [biased, other] = [image(1, 0.01), image(2, 0.0)];
        let of = |mean| Estimate {
            mean,
            variance: &variance,
        };
        let t = compare(of(&biased), of(&other), 10, 1.0);
        assert!(t.z.abs() > 5.0, "{t:?}");
    }

    #[test]
    fn what_is_too_dark_to_be_judged_is_not() {
        let (image, variance) = found(3, 0.002);
        let zero = constant(0.0);
        let first = Estimate {
            mean: &image,
            variance: &variance,
        };
        assert_eq!(
            compare(
                first,
                Estimate {
                    mean: &zero,
                    variance: &zero
                },
                10,
                50.0
            )
            .comparisons,
            0
        );
        let bright = constant(1.0);
        let first = Estimate {
            mean: &bright,
            variance: &bright,
        };
        let t = compare(
            first,
            Estimate {
                mean: &zero,
                variance: &zero,
            },
            10,
            50.0,
        );
        assert_eq!(
            t.comparisons, 3,
            "light where there should be none is judged"
        );
        assert!(!t.agrees(0.01, 1), "{t:?}");
    }

    #[test]
    fn exact_pictures_are_compared_exactly_and_dark_ones_together() {
        assert!(test(&constant(1.0), &constant(1.0), 0.0).agrees(0.01, 1));
        assert!(!test(&constant(1.001), &constant(1.0), 0.0).agrees(0.01, 1));
        let dark = test(&constant(0.001), &constant(0.0011), 1e-12);
        assert_eq!((dark.comparisons, dark.worst_at), (3, None));
        assert!(!dark.agrees(0.01, 1));
        let black = test(&constant(0.0), &constant(0.0), 0.0);
        assert!(black.agrees(0.01, 1) && black.comparisons == 0 && black.ratio.is_nan());
    }
}
