//! Exposures and tone mappers of HDR-FLIP [Andersson et al. 2021].

use lumbre_light::film::Image;
use lumbre_light::math::luminance::luminance_f32;

/// A tone mapper as a rational function `(a x² + b x + c) / (d x² + e x + f)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToneMapper {
    coefficients: [f32; 6],
    /// Whether luminance is mapped and colours are scaled with it, rather than each channel mapped.
    on_luminance: bool,
}

/// Tone mappers by their names in options.
const TONE_MAPPERS: [(&str, ToneMapper); 3] = [
    // Narkowicz's fit of ACES, without its pre-exposure of 0.6.
    (
        "aces",
        ToneMapper {
            coefficients: [0.36 * 2.51, 0.6 * 0.03, 0.0, 0.36 * 2.43, 0.6 * 0.59, 0.14],
            on_luminance: false,
        },
    ),
    // Hable's curve of Uncharted 2 with its white point divided out.
    (
        "hable",
        ToneMapper {
            coefficients: [0.231_683, 0.013_791, 0.0, 0.18, 0.3, 0.018],
            on_luminance: false,
        },
    ),
    (
        "reinhard",
        ToneMapper {
            coefficients: [0.0, 1.0, 0.0, 0.0, 1.0, 1.0],
            on_luminance: true,
        },
    ),
];

/// Names of all tone mappers.
pub const NAMES: &[&str] = &["aces", "hable", "reinhard"];

/// Display value whose radiance determines the first and last exposure.
const BRIGHT: f64 = 0.85;

/// Radiance to which input is clamped: tone mappers are saturated there, and larger values would
/// overflow when squared.
const LIMIT: f32 = 1e15;

impl ToneMapper {
    /// Returns the tone mapper of this name, or `aces` for an unknown name.
    pub fn named(name: &str) -> ToneMapper {
        TONE_MAPPERS
            .iter()
            .find(|(n, _)| *n == name)
            .map_or(TONE_MAPPERS[0].1, |(_, t)| *t)
    }

    /// Maps linear radiance to display values in 0..=1 that are linear in light. Negative radiance
    /// counts as black; NaN stays NaN.
    pub fn apply(&self, rgb: [f32; 3]) -> [f32; 3] {
        let rgb = rgb.map(|x| x.clamp(0.0, LIMIT));
        if self.on_luminance {
            let scale = 1.0 / (1.0 + luminance_f32(rgb));
            return rgb.map(|x| (x * scale).clamp(0.0, 1.0));
        }
        let [a, b, c, d, e, f] = self.coefficients;
        rgb.map(|x| (((a * x + b) * x + c) / ((d * x + e) * x + f)).clamp(0.0, 1.0))
    }

    /// Radiance that is mapped to [`BRIGHT`].
    fn bright(&self) -> f64 {
        let [a, b, c, d, e, f] = self.coefficients.map(f64::from);
        let [a, b, c] = [a - BRIGHT * d, b - BRIGHT * e, c - BRIGHT * f];
        if a == 0.0 {
            return -c / b;
        }
        let half = -0.5 * b / a;
        half + (half * half - c / a).sqrt()
    }
}

/// Range of exposures in stops, and their number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposures {
    /// First exposure in stops.
    pub start: f64,
    /// Last exposure in stops.
    pub stop: f64,
    /// Number of evenly spaced exposures, at least 2.
    pub count: usize,
}

impl Exposures {
    /// Returns the given values, with missing ones chosen for the reference: the first exposure
    /// maps its brightest pixel to 0.85, the last its median luminance; one exposure per stop, at
    /// least 2.
    ///
    /// The median of an even number of pixels is the upper of the middle two, as in the authors'
    /// program since version 1.7 (earlier versions took their mean). If half of the pixels are
    /// black, the authors' last exposure is infinite; here the median of the other pixels is taken.
    /// A black reference has the single exposure 0.
    pub fn new(
        reference: &Image,
        tone: ToneMapper,
        given: [Option<f64>; 2],
        count: Option<usize>,
    ) -> Exposures {
        let [start, stop] = match given {
            [Some(start), Some(stop)] => [start, stop],
            _ => {
                let [brightest, median] = brightness(reference);
                let stops = |y: f64| {
                    if y > 0.0 {
                        (tone.bright() / y).log2()
                    } else {
                        0.0
                    }
                };
                [
                    given[0].unwrap_or(stops(brightest)),
                    given[1].unwrap_or(stops(median)),
                ]
            }
        };
        let count = count.unwrap_or_else(|| ((stop - start).ceil().max(2.0) as usize).min(MOST));
        Exposures {
            start,
            stop,
            count: count.max(2),
        }
    }

    /// Factors by which radiance is multiplied, one per exposure.
    pub fn scales(&self) -> impl Iterator<Item = f32> {
        let Exposures { start, stop, count } = *self;
        let step = (stop - start) / (count - 1) as f64;
        (0..count).map(move |i| (start + i as f64 * step).exp2() as f32)
    }
}

/// Largest number of automatic exposures; an `f32` spans no more stops.
const MOST: usize = 280;

/// Returns the largest finite luminance and the median luminance.
fn brightness(image: &Image) -> [f64; 2] {
    let all = image
        .data
        .iter()
        .map(|p| luminance_f32(*p))
        .filter(|y| y.is_finite());
    let mut sorted: Vec<f32> = all.collect();
    sorted.sort_unstable_by(f32::total_cmp);
    let median = |of: &[f32]| of.get(of.len() / 2).map_or(0.0, |y| f64::from(*y));
    let lit = &sorted[sorted.partition_point(|y| *y <= 0.0)..];
    let middle = median(&sorted);
    [
        sorted.last().map_or(0.0, |y| f64::from(*y)),
        if middle > 0.0 { middle } else { median(lit) },
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_chosen_radiance_becomes_bright_and_limits_are_kept() {
        assert_eq!(NAMES, TONE_MAPPERS.map(|(name, _)| name));
        for (name, tone) in TONE_MAPPERS {
            let x = tone.bright() as f32;
            let shown = tone.apply([x; 3]);
            assert!((shown[1] - 0.85).abs() < 1e-5, "{name}: {shown:?}");
            for extreme in [f32::INFINITY, f32::MAX, -1.0, f32::NEG_INFINITY] {
                let [v, ..] = tone.apply([extreme, 0.5, 0.5]);
                assert!((0.0..=1.0).contains(&v), "{name} {extreme}: {v}");
            }
            assert!(tone.apply([f32::NAN; 3])[0].is_nan());
        }
    }

    #[test]
    fn exposures_follow_the_reference() {
        let tone = ToneMapper::named("reinhard");
        let x = tone.bright() as f32;
        // Brightest pixel 8x, median 1x: from -3 to 0 stops.
        let image = Image::from_fn(5, 1, |i, _| [[0.5, 0.5, 1.0, 2.0, 8.0][i as usize] * x; 3]);
        let e = Exposures::new(&image, tone, [None; 2], None);
        assert!((e.start + 3.0).abs() < 1e-5 && e.stop.abs() < 1e-5, "{e:?}");
        assert_eq!(e.scales().count(), e.count);
        assert!((e.scales().last().unwrap() - 1.0).abs() < 1e-5);
        let fixed = Exposures::new(&image, tone, [Some(-1.0), None], Some(7));
        assert_eq!((fixed.start, fixed.count), (-1.0, 7));
    }

    #[test]
    fn the_median_of_a_mostly_black_reference_is_that_of_its_lit_pixels() {
        let tone = ToneMapper::named("reinhard");
        let x = tone.bright() as f32;
        let image = Image::from_fn(9, 1, |i, _| {
            [if i < 3 {
                [1.0, 2.0, 8.0][i as usize] * x
            } else {
                0.0
            }; 3]
        });
        let e = Exposures::new(&image, tone, [None; 2], None);
        assert!((e.start + 3.0).abs() < 1e-5, "brightest pixel 8x: {e:?}");
        assert!(
            (e.stop + 1.0).abs() < 1e-5,
            "median of the lit pixels 2x: {e:?}"
        );
    }

    #[test]
    fn dark_and_broken_references_still_get_finite_exposures() {
        let tone = ToneMapper::named("aces");
        let mostly_black = Image::from_fn(4, 1, |i, _| [if i == 3 { 2.0 } else { 0.0 }; 3]);
        let broken = Image::from_fn(2, 1, |i, _| [if i == 0 { f32::INFINITY } else { 1.0 }; 3]);
        for image in [mostly_black, broken, Image::new(3, 3), Image::new(1, 1)] {
            let e = Exposures::new(&image, tone, [None; 2], None);
            assert!(
                e.start.is_finite() && e.stop.is_finite() && e.count == 2,
                "{e:?}"
            );
        }
    }
}
