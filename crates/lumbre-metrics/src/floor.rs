//! Noise floor: the error that a noisy reference adds to every measurement against it.
//!
//! A reference is an estimate. Even the true image has an error against it, the floor (for a
//! similarity, the ceiling), and no run can be measured to be better. The floor follows from two
//! independent halves `A` and `B` of the reference `R`: with `a` and `b` samples,
//! `D = (A - B) sqrt(a b) / (a + b)` has mean zero, the variance of `R`, and no correlation with
//! `R`. So the images `R + D` and `R - D` are as far from `R` as `R` is from the truth, and any
//! metric of them against `R` is the floor.
//!
//! Structural similarity needs a correction, because the noise of `R` is part of the structure to
//! which `D` is added. With `S` for structure plus constant and `V` for the noise, the two images
//! have similarity `q = 2S / (2S + 4V)` to each other, the truth has `2S / (2S + V)` to `R`, which
//! is `4q / (1 + 3q)`. It is computed window by window.
//!
//! Squared errors against `R` are on average squared errors against the truth plus the floor,
//! because no run shares its noise with a reference. The difference is the net error. It is an
//! estimate and can be negative if the measured error is only noise.

use std::f64::consts::SQRT_2;

use super::{MetricError, MetricSpec};
use lumbre_light::film::Image;
use lumbre_light::math::t_test::{standard_error, two_sided_t};

/// Effect of the noise of a reference on the value of a metric.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Noise {
    /// Adds the floor to the value: mean squared errors.
    Adds,
    /// Adds the floor to the value, which is divided by the squared reference: see
    /// [`MetricSpec::samples_for_ratios`].
    AddsRelative,
    /// Adds the squared floor to the squared value: roots of mean squared errors.
    AddsSquared,
    /// Adds to the squared error whose level in decibels the value is.
    Decibels,
    /// Limits a similarity to a ceiling below 1.
    Similarity,
    /// Keeps the value above zero by an amount that is not known.
    Bounds,
    /// Has an effect that no single number describes.
    Silent,
}

/// A noise floor: the value that the true image would measure against a reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Floor {
    /// Estimate of the value.
    pub value: f64,
    /// Standard error of the difference between the estimate and what the reference's noise adds to
    /// each value; 0 if it is not known. All runs that are measured against the reference share it.
    pub error: f64,
}

impl Floor {
    /// Returns a floor of which no error is known.
    pub fn exact(value: f64) -> Floor {
        Floor { value, error: 0.0 }
    }

    /// Returns the ends of the 95 % confidence interval, not below zero.
    pub fn ends(self) -> [f64; 2] {
        let half = two_sided_t(0.05, GROUPS as f64 - 1.0) * self.error;
        [(self.value - half).max(0.0), self.value + half]
    }
}

/// Largest squared noise of a reference, relative to its pixels, with which metrics that divide by it
/// are compared: 10 % of a pixel.
const MAX_RELATIVE_FLOOR: f64 = 0.01;

/// Number of groups of pixels of which the standard error of a floor is computed.
const GROUPS: usize = 32;

/// Greatest side in pixels of the squares of which groups consist, larger than what a pixel filter
/// makes alike. Small images have smaller squares, so that each group has two.
const SQUARE: u32 = 8;

/// Returns the pixels of an image in groups, each as an image of one row. Squares belong to the groups
/// in turn, so that each group has pixels from all over the image.
fn groups(image: &Image) -> Vec<Image> {
    let share = image.data.len() / (2 * GROUPS);
    let side = (share.isqrt() as u32).clamp(1, SQUARE);
    let columns = image.width.div_ceil(side);
    let mut groups: Vec<Vec<[f32; 3]>> = vec![Vec::new(); GROUPS];
    let places = (0..image.height).flat_map(|y| (0..image.width).map(move |x| (x, y)));
    for ((x, y), pixel) in places.zip(&image.data) {
        let square = y / side * columns + x / side;
        // A step from row to row, so that groups are no columns where a row has as many squares.
        groups[(square + y / side * 5) as usize % GROUPS].push(*pixel);
    }
    let row = |data: Vec<[f32; 3]>| Image::from_pixels(data.len() as u32, 1, data);
    groups.into_iter().map(row).collect()
}

/// Two independent halves of a reference with their sample counts.
#[derive(Clone, Copy, Debug)]
pub struct Halves<'a> {
    /// Images of the two halves, of equal size.
    pub means: [&'a Image; 2],
    /// Samples per pixel of the two halves.
    pub samples: [u64; 2],
}

impl Halves<'_> {
    /// Returns the reference plus and minus a difference image that has the variance of the
    /// reference.
    fn beside(&self, reference: &Image) -> [Image; 2] {
        let [a, b] = self.samples.map(|n| n.max(1) as f64);
        let scale = (a * b).sqrt() / (a + b);
        [scale, -scale].map(|scale| {
            let halves = self.means[0].data.iter().zip(&self.means[1].data);
            let pixel = |(r, (a, b)): (&[f32; 3], (&[f32; 3], &[f32; 3]))| {
                [0, 1, 2]
                    .map(|c| (f64::from(r[c]) + scale * (f64::from(a[c]) - f64::from(b[c]))) as f32)
            };
            let data = reference.data.iter().zip(halves).map(pixel).collect();
            Image::from_pixels(reference.width, reference.height, data)
        })
    }
}

impl MetricSpec {
    /// Estimates the value that the true image would have against this reference, from its halves.
    /// Returns `None` for metrics without such an estimate. Only means over pixels have a standard
    /// error, from how the floors of groups of pixels scatter.
    ///
    /// # Errors
    /// Those of [`MetricSpec::eval`].
    pub fn floor(&self, reference: &Image, halves: Halves) -> Result<Option<Floor>, MetricError> {
        let size = [reference.width, reference.height];
        for half in halves.means {
            if [half.width, half.height] != size {
                return Err(MetricError::Size {
                    image: [half.width, half.height],
                    reference: size,
                });
            }
        }
        let [over, under] = halves.beside(reference);
        match self.row.noise {
            Noise::Silent => Ok(None),
            Noise::Similarity => {
                let map = self.error_map(&over, &under)?;
                let ceiling = |dissimilar: f32| {
                    let q = (1.0 - f64::from(dissimilar)).max(0.0);
                    4.0 * q / (1.0 + 3.0 * q)
                };
                // At the border the map repeats the nearest window; the metric counts it once.
                let (width, rim) = (map.width as usize, (self.row.smallest)(self) as usize / 2);
                let rows = map
                    .values
                    .chunks_exact(width)
                    .take(map.height as usize - rim)
                    .skip(rim);
                let windows = rows.flat_map(|row| &row[rim..width - rim]);
                let (sum, count) =
                    windows.fold((0.0, 0u64), |(sum, n), d| (sum + ceiling(*d), n + 1));
                Ok(Some(Floor::exact(sum / count as f64)))
            }
            _ => {
                let value = |over: &Image, under: &Image, reference: &Image| {
                    Ok(0.5 * (self.eval(over, reference)? + self.eval(under, reference)?))
                };
                let floor = Floor::exact(value(&over, &under, reference)?);
                let is_root = match self.row.noise {
                    Noise::Adds | Noise::AddsRelative => false,
                    Noise::AddsSquared => true,
                    _ => return Ok(Some(floor)),
                };
                let [overs, unders, references] = [&over, &under, reference].map(groups);
                let parts = (0..GROUPS).map(|i| {
                    let part: Result<f64, MetricError> =
                        value(&overs[i], &unders[i], &references[i]);
                    part.map(|value| if is_root { value * value } else { value })
                });
                // Neither has a metric of which single pixels have no value, nor an image of fewer
                // pixels than there are groups.
                let Ok(parts) = parts.collect::<Result<Vec<f64>, _>>() else {
                    return Ok(Some(floor));
                };
                // The noise of the reference is one draw of what its halves tell the variance of,
                // so it differs from the estimate by as much again.
                let error = SQRT_2 * standard_error(&parts);
                let error = if is_root && floor.value > 0.0 {
                    error / (2.0 * floor.value)
                } else {
                    error
                };
                Ok(Some(Floor { error, ..floor }))
            }
        }
    }

    /// Subtracts the contribution of the reference's noise from a measured value: an estimate of
    /// the error against the truth. A squared error can become negative; its root is then zero.
    /// Returns `None` for metrics from which it cannot be subtracted.
    pub fn net(&self, value: f64, floor: f64) -> Option<f64> {
        match self.row.noise {
            Noise::Adds | Noise::AddsRelative => Some(value - floor),
            Noise::AddsSquared => {
                let own = value * value - floor * floor;
                Some(if own < 0.0 { 0.0 } else { own.sqrt() })
            }
            Noise::Decibels => {
                let own = 10f64.powf(-value / 10.0) - 10f64.powf(-floor / 10.0);
                Some(if own.is_nan() {
                    own
                } else {
                    -10.0 * own.max(0.0).log10()
                })
            }
            Noise::Similarity | Noise::Bounds | Noise::Silent => None,
        }
    }

    /// Returns [`MetricSpec::net`] of a value with the floor as estimated, and at both ends of its
    /// confidence interval; the value itself where nothing can be subtracted. The ends are NaN if
    /// the reference is too noisy for ratios: see [`MetricSpec::samples_for_ratios`].
    pub fn net_at_noise(&self, value: f64, floor: Option<Floor>) -> [f64; 3] {
        let Some(floor) = floor else {
            return [value; 3];
        };
        let [low, high] = floor.ends();
        let net = [floor.value, low, high].map(|floor| self.net(value, floor).unwrap_or(value));
        match self.samples_for_ratios(floor.value, 1) {
            Some(_) => [net[0], f64::NAN, f64::NAN],
            None => net,
        }
    }

    /// Returns how many samples a reference of so many samples would need for ratios of a metric
    /// against it to be trusted; `None` if they can be. Only metrics that divide by the squared
    /// reference need more: noise of 10 % of a pixel makes relMSE 6 % too large, of 20 % twice as
    /// large, and of 37 % twenty times, so that the ratio of two errors tends to 1.
    pub fn samples_for_ratios(&self, floor: f64, samples: u64) -> Option<u64> {
        let is_too_noisy = self.row.noise == Noise::AddsRelative && floor > MAX_RELATIVE_FLOOR;
        is_too_noisy.then(|| (samples as f64 * floor / MAX_RELATIVE_FLOOR).ceil() as u64)
    }

    /// Returns the expected value between two pictures of the same scene, given what the true image
    /// would have against each. Returns `None` for metrics in which noise does not add up.
    pub fn sum_of_noise(&self, [a, b]: [f64; 2]) -> Option<f64> {
        match self.row.noise {
            Noise::Adds | Noise::AddsRelative => Some(a + b),
            Noise::AddsSquared => Some(a.hypot(b)),
            Noise::Decibels | Noise::Similarity | Noise::Bounds | Noise::Silent => None,
        }
    }

    /// Returns whether a value is dominated by the noise of the reference: at least half of a
    /// squared error is the reference's own, or the value is better than that of the true image.
    pub fn is_at_floor(&self, value: f64, floor: f64) -> bool {
        match self.row.noise {
            Noise::Adds | Noise::AddsRelative => value <= 2.0 * floor,
            Noise::AddsSquared => value * value <= 2.0 * floor * floor,
            Noise::Decibels => value >= floor - 10.0 * 2f64.log10(),
            Noise::Similarity => 1.0 - value <= 2.0 * (1.0 - floor),
            Noise::Bounds => value <= SQRT_2 * floor,
            Noise::Silent => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::METRICS;
    use lumbre_light::math::rng::{normal, pcg4d, unit};

    const SIZE: [u32; 2] = [96, 80];

    /// A picture with flat parts, edges and fine grain.
    fn truth() -> Image {
        Image::from_fn(SIZE[0], SIZE[1], |x, y| {
            let checks = if (x / 16 + y / 16) % 2 == 0 {
                0.25
            } else {
                0.6
            };
            let grain = if y < 40 {
                0.15 * unit(pcg4d([x, y, 0, 99])[0])
            } else {
                0.0
            };
            [0, 1, 2].map(|c| checks + grain * (1.0 + c as f32))
        })
    }

    /// The true image with normal noise of the given standard deviation.
    fn noisy(seed: u32, sigma: f32) -> Image {
        let mut image = truth();
        for (i, pixel) in image.data.iter_mut().enumerate() {
            for (c, x) in pixel.iter_mut().enumerate() {
                let w = pcg4d([i as u32, c as u32, seed, 7]);
                *x += sigma * normal([unit(w[0]), unit(w[1])]);
            }
        }
        image
    }

    /// A reference whose mean has noise `sigma`, from halves of `a` and `b` samples.
    fn reference(seed: u32, sigma: f32, [a, b]: [u64; 2]) -> (Image, [Image; 2]) {
        let n = (a + b) as f32;
        let [first, second] =
            [(a, 0), (b, 1)].map(|(m, i)| noisy(2 * seed + i, sigma * (n / m as f32).sqrt()));
        let mix =
            |i: usize, c: usize| (a as f32 * first.data[i][c] + b as f32 * second.data[i][c]) / n;
        let data = (0..first.data.len())
            .map(|i| [0, 1, 2].map(|c| mix(i, c)))
            .collect();
        (
            Image {
                data,
                ..first.clone()
            },
            [first, second],
        )
    }

    fn specs() -> Vec<MetricSpec> {
        METRICS
            .iter()
            .map(|m| MetricSpec::new(m.name, m.name, BTreeMap::new()).unwrap())
            .collect()
    }

    #[test]
    fn the_floor_is_what_the_truth_has_against_the_reference() {
        let truth = truth();
        for (sigma, samples, tolerance) in [
            (0.004, [8, 8], 0.04),
            (0.03, [5, 4], 0.04),
            (0.08, [2, 1], 0.08),
        ] {
            let (r, halves) = reference(3, sigma, samples);
            let halves = Halves {
                means: [&halves[0], &halves[1]],
                samples,
            };
            for spec in specs()
                .iter()
                .filter(|s| s.row.noise != Noise::Silent && s.row.name != "hdr_flip")
            {
                let floor = spec.floor(&r, halves).unwrap().unwrap().value;
                let real = spec.eval(&truth, &r).unwrap();
                // As distances from perfection; decibels are compared as what they are.
                let away = |x: f64| {
                    if spec.row.perfect.is_finite() {
                        (x - spec.row.perfect).abs()
                    } else {
                        x / 10.0
                    }
                };
                let tolerance = match spec.row.name {
                    // There are few blocks, so their standard deviation is itself uncertain.
                    "bias_se" => 0.2,
                    // Noise within windows of 49 pixels bends the ceiling a little.
                    "ssim" => 0.08,
                    // The noise of the denominator is left out: good while the noise is small
                    // beside the picture.
                    "relmse" | "relmse_trimmed" | "mape" | "smape" if sigma > 0.05 => 0.3,
                    _ => tolerance,
                };
                let off = away(floor) / away(real) - 1.0;
                assert!(
                    off.abs() < tolerance,
                    "{} at {sigma}: {floor} for {real}",
                    spec.row.name
                );
            }
        }
    }

    #[test]
    fn net_errors_are_those_against_the_truth() {
        let truth = truth();
        let (r, halves) = reference(5, 0.03, [8, 8]);
        let halves = Halves {
            means: [&halves[0], &halves[1]],
            samples: [8, 8],
        };
        for name in ["mse", "rmse", "psnr", "relmse"] {
            let spec = MetricSpec::new(name, name, BTreeMap::new()).unwrap();
            let floor = spec.floor(&r, halves).unwrap().unwrap().value;
            // A run that is better than its reference.
            let image = noisy(77, 0.02);
            let (gross, real) = (
                spec.eval(&image, &r).unwrap(),
                spec.eval(&image, &truth).unwrap(),
            );
            let net = spec.net(gross, floor).unwrap();
            // 23,040 normal values: the net mean square has a standard error of 2.9 % here.
            let tolerance = if name == "psnr" { 0.01 } else { 0.09 };
            assert!(
                (net / real - 1.0).abs() < tolerance,
                "{name}: {net} for {real}"
            );
            assert!(
                (gross / real - 1.0).abs() > 3.0 * tolerance,
                "{name}: subtracting is needed, {gross} for {real}"
            );
            assert!(spec.is_at_floor(gross, floor), "{name}");
            let worse = spec.eval(&noisy(78, 0.1), &r).unwrap();
            assert!(!spec.is_at_floor(worse, floor), "{name}");
        }
        let rmse = MetricSpec::new("rmse", "rmse", BTreeMap::new()).unwrap();
        assert_eq!(rmse.net(0.5, 0.6), Some(0.0));
        assert!(
            rmse.net(0.5, 0.4)
                .is_some_and(|net| (net - 0.3).abs() < 1e-12)
        );
        let psnr = MetricSpec::new("psnr", "psnr", BTreeMap::new()).unwrap();
        assert_eq!(psnr.net(40.0, 30.0), Some(f64::INFINITY));
        assert!(
            rmse.net(f64::NAN, 0.1).is_some_and(f64::is_nan),
            "what is no number stays none"
        );
        let ssim = MetricSpec::new("ssim", "ssim", BTreeMap::new()).unwrap();
        assert_eq!(ssim.net(0.5, 0.9), None);
    }

    #[test]
    fn the_error_of_a_floor_is_how_far_it_is_from_what_the_noise_adds() {
        let truth = truth();
        for name in ["mse", "rmse"] {
            let spec = MetricSpec::new(name, name, BTreeMap::new()).unwrap();
            // Of 200 references about 95 % add what lies within the interval; 4 standard deviations
            // are 6 %.
            let within = (0..200).filter(|seed| {
                let (r, halves) = reference(100 + seed, 0.03, [8, 8]);
                let halves = Halves {
                    means: [&halves[0], &halves[1]],
                    samples: [8, 8],
                };
                let [low, high] = spec.floor(&r, halves).unwrap().unwrap().ends();
                (low..=high).contains(&spec.eval(&truth, &r).unwrap())
            });
            let within = within.count();
            assert!((178..=199).contains(&within), "{name}: {within} of 200");
        }
    }

    #[test]
    fn only_metrics_that_divide_by_a_noisy_reference_need_more_samples() {
        let needed = |name: &str, floor| {
            let spec = MetricSpec::new(name, name, BTreeMap::new()).unwrap();
            spec.samples_for_ratios(floor, 64)
        };
        assert_eq!(
            (needed("relmse", 0.009), needed("relmse", 0.04)),
            (None, Some(256))
        );
        assert_eq!((needed("mse", 0.04), needed("rmse", 0.2)), (None, None));
    }

    #[test]
    fn an_exact_reference_has_no_floor_and_sizes_must_agree() {
        let truth = truth();
        let same = Halves {
            means: [&truth, &truth],
            samples: [1, 1],
        };
        for spec in specs().iter().filter(|s| s.row.noise != Noise::Silent) {
            assert_eq!(
                spec.floor(&truth, same).unwrap(),
                Some(Floor::exact(spec.row.perfect)),
                "{}",
                spec.row.name
            );
        }
        let small = Image::new(4, 4);
        let halves = Halves {
            means: [&truth, &small],
            samples: [1, 1],
        };
        assert!(specs()[0].floor(&truth, halves).is_err());
        assert_eq!(
            specs()
                .iter()
                .filter(|s| s.row.noise == Noise::Silent)
                .count(),
            2
        );
    }
}
