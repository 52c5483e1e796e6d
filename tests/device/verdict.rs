//! The verdict on pictures of the same samples: whether a device's differs from the CPU's only by
//! rounding.
//!
//! Devices may fuse a product and a sum, and divide and take roots to a few units in the last place.
//! That changes nearly every value by parts in a million. It also sends a path another way now and
//! then, where a decision is close: its pixel then has the value of another, equally valid sample.
//! The verdict therefore allows few pixels that diverge, requires all others to agree closely, and
//! requires the means to agree within what the diverged pixels explain if they are not biased.

use lumbre_light::film::Film;

/// What a picture may differ by.
#[derive(Clone, Copy, Debug)]
pub struct Tolerance {
    /// Largest share of pixels that may diverge.
    diverged: f64,
    /// Largest relative RMSE of the pixels that do not.
    rmse: f64,
}

/// Tolerance of pictures of ordinary scenes with few samples.
pub const STRICT: Tolerance = Tolerance {
    diverged: 0.003,
    rmse: 3e-4,
};

/// Tolerance of scenes with many small lobes, where decisions are close more often, and of pictures
/// with many samples, where another path changes its pixel by less than 1 %.
pub const LOOSE: Tolerance = Tolerance {
    diverged: 0.01,
    rmse: 1e-3,
};

/// Number of diverged pixels that are allowed in pictures of any size.
const ALWAYS_ALLOWED: f64 = 2.0;

/// Number of standard deviations of the sum over the diverged pixels that is still explained by
/// their independent values.
const DEVIATIONS: f64 = 3.0;

/// How a picture differs from another.
#[derive(Debug)]
pub struct Difference {
    /// Mean of the expected values.
    pub mean: f64,
    /// RMSE of the pixels that do not diverge, relative to the mean.
    pub rmse: f64,
    /// Difference of the sums of all values.
    pub sum: f64,
    /// Standard deviation of that difference if every diverged pixel is unbiased.
    pub deviation: f64,
    /// Number of pixels with a value that is off by more than 1 %.
    pub diverged: usize,
    /// Number of all pixels.
    pub pixels: usize,
}

impl Difference {
    /// Compares red, green and blue values of the same pixels.
    pub fn new(found: &[f32], expected: &[f32]) -> Difference {
        assert!(found.len() == expected.len() && found.len().is_multiple_of(3));
        let total: f64 = expected.iter().map(|x| f64::from(*x)).sum();
        let mean = total / expected.len() as f64;
        let (mut sum, mut squares, mut diverged_squares, mut diverged) = (0.0, 0.0, 0.0, 0);
        for (a, b) in found.chunks(3).zip(expected.chunks(3)) {
            let off: Vec<f64> = a.iter().zip(b).map(|(x, y)| f64::from(x - y)).collect();
            let far = |(d, y): (&f64, &f32)| d.abs() > 0.01 * f64::from(y.abs()).max(mean);
            let pixel = off.iter().sum::<f64>();
            sum += pixel;
            if off.iter().zip(b).any(far) {
                diverged += 1;
                diverged_squares += pixel * pixel;
            } else {
                squares += off.iter().map(|d| d * d).sum::<f64>();
            }
        }
        let pixels = expected.len() / 3;
        let values = (3 * (pixels - diverged)).max(1) as f64;
        Difference {
            mean,
            rmse: (squares / values).sqrt() / mean,
            sum,
            deviation: diverged_squares.sqrt(),
            diverged,
            pixels,
        }
    }

    /// Returns why the difference is more than rounding explains; `None` if it is not.
    pub fn problem(&self, tolerance: Tolerance) -> Option<String> {
        let total = self.mean * (3 * self.pixels) as f64;
        let allowed = (tolerance.diverged * self.pixels as f64).max(ALWAYS_ALLOWED);
        let bias = tolerance.rmse * total + DEVIATIONS * self.deviation;
        // Written so that NaN is a problem.
        if self.mean.is_nan() || self.mean <= 0.0 {
            Some("the picture is black".to_owned())
        } else if self.diverged as f64 > allowed {
            Some(format!("more than {allowed:.1} pixels diverge"))
        } else if self.rmse.is_nan() || self.rmse >= tolerance.rmse {
            let most = tolerance.rmse;
            Some(format!("the other pixels differ by more than {most:e}"))
        } else if self.sum.is_nan() || self.sum.abs() > bias {
            Some(format!("the sums differ by {:e} of {total:e}", self.sum))
        } else {
            None
        }
    }
}

/// Compares two films of the same samples.
pub fn difference(found: &Film, expected: &Film) -> Difference {
    assert_eq!(found.samples, expected.samples);
    let (found, expected) = (found.mean(), expected.mean());
    Difference::new(found.data.as_flattened(), expected.data.as_flattened())
}

/// Panics if values of the same many samples differ by more than rounding explains.
pub fn compare_values(name: &str, found: &[f32], expected: &[f32]) {
    judge(name, &Difference::new(found, expected), LOOSE);
}

/// Panics if two films of the same samples differ by more than rounding explains.
pub fn compare(name: &str, found: &Film, expected: &Film) {
    judge(name, &difference(found, expected), STRICT);
}

/// Panics if two films of the same samples differ by more than rounding explains in scenes with
/// small lobes and few pixels.
pub fn compare_loosely(name: &str, found: &Film, expected: &Film) {
    judge(name, &difference(found, expected), LOOSE);
}

fn judge(name: &str, found: &Difference, tolerance: Tolerance) {
    println!(
        "{name}: mean {:.5}, relative RMSE {:.1e}, {} of {} pixels diverge",
        found.mean, found.rmse, found.diverged, found.pixels
    );
    let problem = found.problem(tolerance);
    assert!(problem.is_none(), "{name}: {}: {found:?}", problem.unwrap());
}

/// Returns the values of a picture with noise.
fn noisy_picture() -> Vec<f32> {
    use lumbre_light::math::rng::{pcg4d, unit};
    (0..3 * 2304)
        .map(|i| 0.2 + unit(pcg4d([i, 7, 7, 7])[0]))
        .collect()
}

#[test]
fn few_other_paths_are_allowed_and_bugs_are_not() {
    let expected = noisy_picture();
    let of = |tolerance: Tolerance, change: &dyn Fn(usize, f32) -> f32| {
        let found: Vec<f32> = (expected.iter().enumerate())
            .map(|(i, x)| change(i, *x))
            .collect();
        Difference::new(&found, &expected).problem(tolerance)
    };
    // Rounding, and another path in each of six of 2,304 pixels.
    let rounded = |i: usize, x: f32| x * (1.0 + 1e-6 * (i % 3) as f32);
    assert_eq!(of(STRICT, &rounded), None);
    let swapped = |i: usize, x: f32| match (i / 3) % 400 {
        7 => 1.4 - x,
        _ => rounded(i, x),
    };
    assert_eq!(of(STRICT, &swapped), None);
    // Too many other paths; twenty that are all darker; a little more light; nothing; no number.
    let often = |i: usize, x: f32| if (i / 3) % 100 == 7 { 1.4 - x } else { x };
    let darker = |i: usize, x: f32| if (i / 3) % 115 == 7 { 1e-3 * x } else { x };
    for (problem, found) in [
        ("diverge", of(STRICT, &often)),
        ("sums", of(LOOSE, &darker)),
        ("other pixels", of(LOOSE, &|_, x| 1.002 * x)),
        ("other pixels", of(STRICT, &|_, x| 1.0005 * x)),
        ("diverge", of(LOOSE, &|_, _| 0.0)),
        ("other pixels", of(LOOSE, &|_, _| f32::NAN)),
    ] {
        let message = found.unwrap_or_default();
        assert!(message.contains(problem), "{problem}: {message:?}");
    }
    let black = vec![0.0; expected.len()];
    let nothing = Difference::new(&black, &black).problem(LOOSE);
    assert!(nothing.is_some_and(|message| message.contains("black")));
}
