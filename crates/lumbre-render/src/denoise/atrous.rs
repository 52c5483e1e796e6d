//! Edge-avoiding à-trous wavelet filter with variance guidance [Dammertz et al. 2010; Schied et al.
//! 2017, the spatial part].
//!
//! A pixel becomes the weighted mean of its neighbourhood, in several passes whose taps are twice
//! as far apart each time. A tap counts less the more its albedo or normal differs, and the more
//! its luminance differs in units of the noise of both pixels, as a mean over the 3 x 3 pixels
//! around each [Rousselle et al. 2012]. Radiance is divided by the albedo before and multiplied by
//! it afterwards, so that textures stay.
//!
//! The detail that a pass takes away is noise and picture. Its share of noise is estimated from the
//! variances, and only that share is removed: a local Wiener filter [Mıhçak et al. 1999].
//! Reflections, caustics and edges of lamps, which the features do not show, stay where they exceed
//! the noise.
//!
//! Each output pixel is a function of the input alone: the result has the same bits for any number
//! of threads.

use std::collections::BTreeMap;

use rayon::prelude::*;

use lumbre_light::film::Image;
use lumbre_light::math::luminance::luminance_f32;
use lumbre_light::value::Value;
use lumbre_light::value::schema::Ty;

/// Version of the filter; part of the identity of a run.
pub const REVISION: i64 = 2;

lumbre_light::table! {
    /// Parameters of the filter as a table of scripts.
    pub const ATROUS = "Atrous",
        "Parameters of the denoiser `atrous`, an edge-avoiding à-trous wavelet filter with \
         variance guidance [Dammertz et al. 2010; Schied et al. 2017].";
    levels = "4": Ty::int(1, 10),
        "number of passes; the last one reaches 2^levels pixels to each side";
    sigma_luminance = "1.5": Ty::num(0.01, 1000.0),
        "difference of luminance, beyond that of the noise, at which a tap counts 1/e, in standard \
         errors of the difference; the root mean square over 3 x 3 pixels";
    sigma_albedo = "0.2": Ty::num(0.001, 1000.0), "difference of albedo at which a tap counts 1/e";
    normal_power = "64": Ty::num(0.0, 10_000.0),
        "sharpness for normals: a tap whose normal differs by the angle a counts about cos(a) to \
         this power";
}

/// Parameters of the filter, see [`ATROUS`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtrousSettings {
    /// Number of passes.
    pub levels: u32,
    /// Scale of differences of luminance, in standard errors of the difference.
    pub sigma_luminance: f32,
    /// Scale of differences of albedo.
    pub sigma_albedo: f32,
    /// Exponent of the cosine between normals.
    pub normal_power: f32,
}

impl Default for AtrousSettings {
    /// Returns the settings that were chosen by measurement: `docs/notes/techniques.md`.
    fn default() -> AtrousSettings {
        AtrousSettings {
            levels: 4,
            sigma_luminance: 1.5,
            sigma_albedo: 0.2,
            normal_power: 64.0,
        }
    }
}

impl AtrousSettings {
    /// Returns the settings of a table that [`ATROUS`] has accepted.
    pub fn from_map(map: &BTreeMap<String, Value>) -> AtrousSettings {
        let default = AtrousSettings::default();
        let number = |key: &str, default: f32| {
            let value = map.get(key).and_then(Value::as_f64);
            value.map_or(default, |x| x as f32)
        };
        let levels = map.get("levels").and_then(Value::as_i64);
        AtrousSettings {
            levels: levels
                .and_then(|n| u32::try_from(n).ok())
                .unwrap_or(default.levels),
            sigma_luminance: number("sigma_luminance", default.sigma_luminance),
            sigma_albedo: number("sigma_albedo", default.sigma_albedo),
            normal_power: number("normal_power", default.normal_power),
        }
    }

    /// Returns all settings by their keys.
    pub fn to_map(self) -> BTreeMap<String, Value> {
        let number = |x: f32| Value::number(f64::from(x));
        [
            ("levels", Value::Int(i64::from(self.levels))),
            ("sigma_luminance", number(self.sigma_luminance)),
            ("sigma_albedo", number(self.sigma_albedo)),
            ("normal_power", number(self.normal_power)),
        ]
        .map(|(key, value)| (key.to_owned(), value))
        .into()
    }
}

/// Picture to filter, with what guides the filter. All images have the same size.
#[derive(Clone, Copy, Debug)]
pub struct Guided<'a> {
    /// Mean of the samples.
    pub mean: &'a Image,
    /// Variance of the mean.
    pub variance: &'a Image,
    /// Number of samples per pixel that the variance is estimated from.
    pub samples: u64,
    /// Reflectance of the first surface.
    pub albedo: &'a Image,
    /// Shading normal of the first surface.
    pub normal: &'a Image,
}

/// Smallest albedo by which radiance is divided.
const LEAST_ALBEDO: f32 = 0.01;

/// Number of samples below which the variance is estimated from neighbouring pixels too.
const FEW_SAMPLES: u64 = 4;

/// Radius in pixels of the neighbourhood of that estimate.
const RADIUS: i64 = 3;

/// Ratio of the variance of a tap and of the pixel above which the tap counts in inverse
/// proportion: pixels beside a firefly do not take its light.
const MAX_NOISE_RATIO: f32 = 256.0;

/// Radius in taps of the neighbourhood from which the share of noise in a detail is estimated.
const SHARE_RADIUS: i64 = 3;

/// Factor of the variance that a detail must exceed to be kept: the estimate from a neighbourhood
/// is noisy, and the remains of a firefly are seen.
const NOISE_MARGIN: f32 = 1.15;

/// Exponent beyond which a tap is left out: its weight is below 1e-9.
const NEGLIGIBLE: f32 = 20.0;

/// Weights of a B3 spline at distances of 0, 1 and 2 taps.
const SPLINE: [f32; 3] = [3.0 / 8.0, 1.0 / 4.0, 1.0 / 16.0];

/// Weights of a 3 x 3 Gaussian at distances of 0 and 1 pixel.
const BLUR: [f32; 2] = [1.0 / 2.0, 1.0 / 4.0];

/// Irradiance of a pixel relative to white, and the variance of its luminance.
#[derive(Clone, Copy, Debug, Default)]
struct Pixel {
    light: [f32; 3],
    variance: f32,
}

/// Result of one pass for a pixel.
#[derive(Clone, Copy, Debug, Default)]
struct Smoothed {
    pixel: Pixel,
    /// Variance of the luminance that the pass takes away from the pixel.
    detail_variance: f32,
}

/// Luminance of a pixel and an estimate of its variance that is less noisy than its own.
#[derive(Clone, Copy, Debug, Default)]
struct Guide {
    luminance: f32,
    variance: f32,
}

/// Features by which the surfaces of two pixels are distinguished.
#[derive(Clone, Copy, Debug, Default)]
struct Surface {
    albedo: [f32; 3],
    /// Unit vector, or zero where nothing is hit.
    normal: [f32; 3],
}

/// Filters a picture on the threads of the current pool.
pub fn filter(settings: &AtrousSettings, input: Guided<'_>) -> Image {
    let size = Size {
        width: i64::from(input.mean.width),
        height: i64::from(input.mean.height),
    };
    let surfaces = surfaces(input);
    let mut pixels = demodulated(input, &surfaces);
    if input.samples < FEW_SAMPLES {
        pixels = with_spatial_variance(settings, size, &pixels, &surfaces);
    }
    let mut changes = vec![[0.0f32; 3]; pixels.len()];
    for level in 0..settings.levels {
        let step = 1 << level;
        let next = pass(settings, size, step, &pixels, &surfaces);
        let shares = noise_shares(size, step, &pixels, &next);
        let places = changes.par_iter_mut().zip(&mut pixels);
        places
            .zip(next.par_iter().zip(&shares))
            .for_each(|((change, pixel), (next, share))| {
                for (c, sum) in change.iter_mut().enumerate() {
                    *sum += share * (next.pixel.light[c] - pixel.light[c]);
                }
                *pixel = next.pixel;
            });
    }
    // Only the changes are multiplied, so that a pixel which the passes leave alone keeps its bits.
    let data = input.mean.data.par_iter().zip(&surfaces).zip(&changes);
    let data = data.map(|((mean, surface), change)| {
        [0, 1, 2].map(|c| (mean[c] + divisor(surface, c) * change[c]).max(0.0))
    });
    Image::from_pixels(input.mean.width, input.mean.height, data.collect())
}

/// Size of a picture in pixels.
#[derive(Clone, Copy)]
struct Size {
    width: i64,
    height: i64,
}

impl Size {
    /// Returns the index of a pixel, or `None` outside of the picture.
    fn index(self, x: i64, y: i64) -> Option<usize> {
        let inside = (0..self.width).contains(&x) && (0..self.height).contains(&y);
        inside.then(|| (y * self.width + x) as usize)
    }

    /// Returns the index of the pixel of the picture that is nearest to this place.
    fn nearest(self, x: i64, y: i64) -> usize {
        (y.clamp(0, self.height - 1) * self.width + x.clamp(0, self.width - 1)) as usize
    }

    /// Returns the row of `values` that is nearest to this one.
    fn row<T>(self, values: &[T], y: i64) -> &[T] {
        let start = self.nearest(0, y);
        &values[start..start + self.width as usize]
    }

    /// Computes every row by its index, in parallel. `f` fills a row of default values.
    fn rows<T: Send + Default + Clone>(self, f: impl Fn(i64, &mut [T]) + Sync) -> Vec<T> {
        let mut out = vec![T::default(); (self.width * self.height) as usize];
        let rows = out.par_chunks_mut(self.width.max(1) as usize).enumerate();
        rows.for_each(|(y, row)| f(y as i64, row));
        out
    }

    /// Computes every pixel from its column and row, in parallel by rows.
    fn map<T: Send + Default + Clone>(self, f: impl Fn(i64, i64) -> T + Sync) -> Vec<T> {
        self.rows(|y, row| {
            for (x, pixel) in row.iter_mut().enumerate() {
                *pixel = f(x as i64, y);
            }
        })
    }
}

fn surfaces(input: Guided<'_>) -> Vec<Surface> {
    let guides = input.albedo.data.par_iter().zip(&input.normal.data);
    let surface = |(albedo, normal): (&[f32; 3], &[f32; 3])| {
        let length = dot(*normal, *normal).sqrt();
        let scale = if length > 0.0 { 1.0 / length } else { 0.0 };
        Surface {
            albedo: *albedo,
            normal: normal.map(|x| x * scale),
        }
    };
    guides.map(surface).collect()
}

/// Number by which channel `c` of a pixel's radiance is divided.
fn divisor(surface: &Surface, c: usize) -> f32 {
    surface.albedo[c].max(LEAST_ALBEDO)
}

/// Divides radiance by albedo. The channels of a sample are taken to be fully correlated, which
/// overestimates the variance of luminance where they are not.
fn demodulated(input: Guided<'_>, surfaces: &[Surface]) -> Vec<Pixel> {
    let pixels = input.mean.data.par_iter().zip(&input.variance.data);
    let pixel = |((mean, variance), surface): ((&[f32; 3], &[f32; 3]), &Surface)| {
        let light = [0, 1, 2].map(|c| mean[c] / divisor(surface, c));
        let deviations = [0, 1, 2].map(|c| variance[c].sqrt() / divisor(surface, c));
        let deviation = luminance_f32(deviations);
        Pixel {
            light,
            variance: deviation * deviation,
        }
    };
    pixels.zip(surfaces).map(pixel).collect()
}

/// Raises the variance of each pixel to that of its neighbours on the same surface, for pictures of
/// so few samples that their own variances say little.
fn with_spatial_variance(
    settings: &AtrousSettings,
    size: Size,
    pixels: &[Pixel],
    surfaces: &[Surface],
) -> Vec<Pixel> {
    size.map(|x, y| {
        let centre = (y * size.width + x) as usize;
        let [mut sum, mut sum2, mut weights] = [0.0f32; 3];
        for dy in -RADIUS..=RADIUS {
            for dx in -RADIUS..=RADIUS {
                let Some(tap) = size.index(x + dx, y + dy) else {
                    continue;
                };
                let exponent = settings.surface_exponent(&surfaces[centre], &surfaces[tap]);
                if exponent < NEGLIGIBLE {
                    let weight = (-exponent).exp();
                    let luminance = luminance_f32(pixels[tap].light);
                    sum += weight * luminance;
                    sum2 += weight * luminance * luminance;
                    weights += weight;
                }
            }
        }
        let mean = sum / weights;
        let spatial = (sum2 / weights - mean * mean).max(0.0);
        Pixel {
            light: pixels[centre].light,
            variance: pixels[centre].variance.max(spatial),
        }
    })
}

/// One pass, with `step` pixels between two taps.
fn pass(
    settings: &AtrousSettings,
    size: Size,
    step: i64,
    pixels: &[Pixel],
    surfaces: &[Surface],
) -> Vec<Smoothed> {
    let guides = size.map(|x, y| {
        let pixel = pixels[size.nearest(x, y)];
        Guide {
            luminance: luminance_f32(pixel.light),
            // A firefly has the noise of its own, not the smaller one around it.
            variance: blurred_variance(size, pixels, x, y).max(pixel.variance),
        }
    });
    let own = SPLINE[0] * SPLINE[0];
    size.rows(|y, row: &mut [Smoothed]| {
        let mut weights = vec![own; row.len()];
        let mut distances = vec![0.0; row.len()];
        for (dx, dy) in (-2..=2i64).flat_map(|dy| (-2..=2i64).map(move |dx| (dx, dy))) {
            let shift = [dx * step, dy * step];
            if (dx, dy) == (0, 0) || !(0..size.height).contains(&(y + shift[1])) {
                continue;
            }
            patch_distances(settings, size, &guides, y, shift, &mut distances);
            let spline = SPLINE[dx.unsigned_abs() as usize] * SPLINE[dy.unsigned_abs() as usize];
            for (x, sum) in row.iter_mut().enumerate() {
                let Some(tap) = size.index(x as i64 + shift[0], y + shift[1]) else {
                    continue;
                };
                let centre = size.nearest(x as i64, y);
                let exponent =
                    distances[x] + settings.surface_exponent(&surfaces[centre], &surfaces[tap]);
                if exponent < NEGLIGIBLE {
                    let (pixel, other) = (&pixels[centre], &pixels[tap]);
                    let excess = guides[tap].variance / (MAX_NOISE_RATIO * guides[centre].variance);
                    let weight = spline * (-exponent).exp() / excess.max(1.0);
                    // Differences are summed, not values: taps equal to the pixel leave its bits
                    // alone.
                    for c in 0..3 {
                        sum.pixel.light[c] += weight * (other.light[c] - pixel.light[c]);
                    }
                    sum.pixel.variance += weight * weight * other.variance;
                    weights[x] += weight;
                }
            }
        }
        for (x, (sum, weights)) in row.iter_mut().zip(weights).enumerate() {
            let pixel = &pixels[size.nearest(x as i64, y)];
            let others = sum.pixel.variance / (weights * weights);
            let kept = own / weights;
            *sum = Smoothed {
                pixel: Pixel {
                    light: [0, 1, 2].map(|c| pixel.light[c] + sum.pixel.light[c] / weights),
                    variance: others + kept * kept * pixel.variance,
                },
                detail_variance: others + (1.0 - kept) * (1.0 - kept) * pixel.variance,
            };
        }
    })
}

/// Writes the distance of each pixel of row `y` from the pixel `shift` away: the square of the
/// difference of their luminances less its expectation by noise, relative to the variance at which
/// a tap counts 1/e, as a mean over the 3 x 3 pixels around both, and at least 0. Pixels beyond the
/// border repeat the border.
fn patch_distances(
    settings: &AtrousSettings,
    size: Size,
    guides: &[Guide],
    y: i64,
    shift: [i64; 2],
    out: &mut [f32],
) {
    let scale = settings.sigma_luminance * settings.sigma_luminance;
    let mut columns = vec![0.0; out.len()];
    let last = columns.len() - 1;
    for y in y - 1..=y + 1 {
        let (from, to) = (size.row(guides, y), size.row(guides, y + shift[1]));
        for (x, sum) in columns.iter_mut().enumerate() {
            let a = &from[x];
            let b = &to[(x as i64 + shift[0]).clamp(0, last as i64) as usize];
            let difference = a.luminance - b.luminance;
            let noise = a.variance + a.variance.min(b.variance);
            let variance = scale * (a.variance + b.variance) + f32::MIN_POSITIVE;
            *sum += (difference * difference - noise) / variance;
        }
    }
    for (x, distance) in out.iter_mut().enumerate() {
        let sum = columns[x.saturating_sub(1)] + columns[x] + columns[(x + 1).min(last)];
        *distance = (sum / 9.0).max(0.0);
    }
}

/// Returns the share of noise, 0 to 1, in the detail that a pass takes away from each pixel. Both
/// the variance of the detail and its square are summed over a neighbourhood of taps, since a pixel
/// that no rare path has reached has no variance.
fn noise_shares(size: Size, step: i64, pixels: &[Pixel], next: &[Smoothed]) -> Vec<f32> {
    let energies = size.map(|x, y| {
        let i = size.nearest(x, y);
        let detail = luminance_f32(pixels[i].light) - luminance_f32(next[i].pixel.light);
        [detail * detail, next[i].detail_variance]
    });
    let sums = |energies: &[[f32; 2]], [dx, dy]: [i64; 2]| {
        size.map(|x, y| {
            let taps =
                (-SHARE_RADIUS..=SHARE_RADIUS).filter_map(|k| size.index(x + k * dx, y + k * dy));
            taps.fold([0.0f32; 2], |sum, tap| {
                [0, 1].map(|e| sum[e] + energies[tap][e])
            })
        })
    };
    let sums = sums(&sums(&energies, [step, 0]), [0, step]);
    let share = |[energy, noise]: &[f32; 2]| {
        let noise = NOISE_MARGIN * noise;
        // The square is steeper than the Wiener filter, which makes up for the margin.
        if *energy > noise {
            (noise / energy).powi(2)
        } else {
            1.0
        }
    };
    sums.par_iter().map(share).collect()
}

/// Returns the variance around a pixel, blurred because that of a single pixel is itself noisy, and
/// without the largest of the 3 x 3 pixels, which may be a firefly.
fn blurred_variance(size: Size, pixels: &[Pixel], x: i64, y: i64) -> f32 {
    let (mut sum, mut weights) = (0.0, 0.0);
    // Variance and weight of the largest so far.
    let mut largest = (0.0, 0.0);
    for dy in -1..=1i64 {
        for dx in -1..=1i64 {
            if let Some(tap) = size.index(x + dx, y + dy) {
                let weight = BLUR[dx.unsigned_abs() as usize] * BLUR[dy.unsigned_abs() as usize];
                let mut counted = (pixels[tap].variance, weight);
                if counted.0 > largest.0 {
                    std::mem::swap(&mut counted, &mut largest);
                }
                sum += counted.1 * counted.0;
                weights += counted.1;
            }
        }
    }
    // A picture of one pixel has no others.
    if weights > 0.0 {
        sum / weights
    } else {
        largest.0
    }
}

impl AtrousSettings {
    /// Returns the negative logarithm of the weight that two surfaces give a tap.
    fn surface_exponent(&self, a: &Surface, b: &Surface) -> f32 {
        let albedo = [0, 1, 2].map(|c| a.albedo[c] - b.albedo[c]);
        let albedo = dot(albedo, albedo) / (self.sigma_albedo * self.sigma_albedo);
        // Where neither pixel has a surface, both normals are zero and nothing differs.
        let nothing = a.normal == [0.0; 3] && b.normal == [0.0; 3];
        let angle = if nothing {
            0.0
        } else {
            1.0 - dot(a.normal, b.normal)
        };
        albedo + self.normal_power * angle.max(0.0)
    }
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
#[path = "atrous_tests.rs"]
mod tests;
