//! Films with a time axis: for every pixel, light binned by the optical length of its path.
//!
//! Times are optical lengths in scene units: the distance that light travels in vacuum in that
//! time.
//!
//! A slot is a bin or one of the two overflow bins: slot 0 holds what arrives before the first bin,
//! slot `bins + 1` what arrives after the last. Nothing is lost, and the sum over all slots, in
//! their order, equals the picture bit by bit.

use std::borrow::Borrow;
use std::ops::{Add, Div};

use serde::{Deserialize, Serialize};

use super::Image;

/// Name of the file with the mean radiance of every bin, a NumPy array `[row][column][bin][rgb]`.
pub const CUBE_FILE: &str = "time-cube.npy";

/// Layout of the bins on the axis of optical length.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TimeAxis {
    /// Start of the first bin in scene units.
    pub start: f64,
    /// Width of a bin in scene units, positive.
    pub bin: f64,
    /// Number of bins, at least one.
    pub bins: u32,
}

impl TimeAxis {
    /// Returns the number of bins plus the two overflow slots.
    #[inline]
    pub fn slots(&self) -> usize {
        self.bins as usize + 2
    }

    /// Returns the position of an optical length in bins from the start: 1.5 is the middle of the
    /// second bin.
    #[inline]
    pub fn bin_position(&self, length: f64) -> f64 {
        self.bin_positions(length, |number| number)
    }

    /// Returns the positions of several lengths at once; `broadcast` turns a number into such a
    /// vector.
    #[inline(always)]
    pub fn bin_positions<T: Add<Output = T> + Div<Output = T>>(
        &self,
        lengths: T,
        broadcast: impl Fn(f64) -> T,
    ) -> T {
        (lengths + broadcast(-self.start)) / broadcast(self.bin)
    }

    /// Returns the slot of a position in bins; NaN goes to the last slot.
    #[inline]
    pub fn slot(&self, position: f64) -> usize {
        if position < 0.0 {
            0
        } else if position < f64::from(self.bins) {
            // All bin indices fit into `i32`, and that conversion is cheaper than one to `usize`.
            position as i32 as usize + 1
        } else {
            self.bins as usize + 1
        }
    }

    /// Returns where bin `i` begins, in scene units; `i` counts from 0.
    pub fn bin_start(&self, i: u32) -> f64 {
        self.start + f64::from(i) * self.bin
    }

    /// Returns where the last bin ends, in scene units.
    pub fn end(&self) -> f64 {
        self.bin_start(self.bins)
    }
}

/// Reconstruction filter along the time axis. Every filter conserves energy.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum TimeFilter {
    /// The whole contribution goes to the bin in which it arrives.
    None,
    /// Evenly over this number of bins to either side.
    Box(f64),
    /// By a Gaussian of this standard deviation in bins, truncated at three standard deviations.
    Gauss(f64),
}

impl TimeFilter {
    /// Names of the filters in scripts.
    pub const WORDS: &'static [&'static str] = &["none", "box", "gauss"];

    /// Returns the filter with a name, and a size in bins.
    pub fn from_name(name: &str, radius: f64) -> Option<TimeFilter> {
        match name {
            "none" => Some(TimeFilter::None),
            "box" => Some(TimeFilter::Box(radius)),
            "gauss" => Some(TimeFilter::Gauss(radius)),
            _ => None,
        }
    }

    /// Returns its name and its size in bins; the size is 0 for [`TimeFilter::None`].
    pub fn name_and_size(&self) -> (&'static str, f64) {
        match self {
            TimeFilter::None => ("none", 0.0),
            TimeFilter::Box(radius) => ("box", *radius),
            TimeFilter::Gauss(sigma) => ("gauss", *sigma),
        }
    }

    /// Calls `add` with each slot that a contribution at a position in bins reaches and its weight;
    /// the weights sum to one.
    #[inline]
    pub fn spread(&self, axis: &TimeAxis, position: f64, mut add: impl FnMut(usize, f64)) {
        let (reach, gauss) = match *self {
            TimeFilter::Box(radius) if radius > 0.0 => (radius, None),
            TimeFilter::Gauss(sigma) if sigma > 0.0 => (3.0 * sigma, Some(sigma)),
            _ => return add(axis.slot(position), 1.0),
        };
        if !position.is_finite() {
            return add(axis.slot(position), 1.0);
        }
        // Integral of the filter below a position.
        let below = |x: f64| {
            let t = (x - position).clamp(-reach, reach);
            match gauss {
                None => 0.5 + 0.5 * t / reach,
                Some(sigma) => 0.5 + 0.5 * erf(t / sigma / std::f64::consts::SQRT_2) / CUT,
            }
        };
        let (first, last) = (axis.slot(position - reach), axis.slot(position + reach));
        let mut before = 0.0;
        for slot in first..=last {
            let until = if slot == last {
                1.0
            } else {
                below(slot as f64)
            };
            if until > before {
                add(slot, until - before);
                before = until;
            }
        }
    }
}

/// Fraction of a Gaussian within three standard deviations: erf(3 / sqrt 2).
const CUT: f64 = 0.997_300_203_936_739_8;

/// Returns the error function to 1.2e-7 [Abramowitz and Stegun 1964, 7.1.26 has the form; a
/// rational Chebyshev fit of `erfc`].
fn erf(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.327_591_1 * x.abs());
    let poly = t
        * (0.254_829_592
            + t * (-0.284_496_736
                + t * (1.421_413_741 + t * (-1.453_152_027 + t * 1.061_405_429))));
    (1.0 - poly * (-x * x).exp()).copysign(x)
}

/// Size of a film's own sums in bytes per pixel and slot: three sums in double precision, three
/// sums of squares in single precision, and four bytes of padding.
pub const BYTES_PER_SLOT: u64 = 40;

/// Size of the splat sums in bytes per pixel and slot, for films that receive splats.
pub const SPLAT_BYTES_PER_SLOT: u64 = 96;

/// Maximum memory of the sums of one run with a time axis: 12 GiB.
pub const MAX_BYTES: u64 = 12 << 30;

/// Memory of sums, in bytes, that the CPU backend allocates before a run's clock starts and
/// recycles for later runs: 1 GiB. Splat sums are second in line: they are allocated beforehand if
/// everything fits.
pub const MAX_KEPT_BYTES: u64 = 1 << 30;

/// Returns the maximum memory of the sums of a film with a time axis, in bytes. Beyond
/// [`MAX_KEPT_BYTES`], slots that light never reaches are not touched, and the operating system
/// provides no memory for them.
///
/// # Errors
/// Returns a message if they need more than [`MAX_BYTES`].
pub fn bytes(axis: &TimeAxis, pixels: u64, splats: bool) -> Result<u64, String> {
    let each = BYTES_PER_SLOT + u64::from(splats) * SPLAT_BYTES_PER_SLOT;
    let bytes = pixels
        .saturating_mul(axis.slots() as u64)
        .saturating_mul(each);
    if bytes <= MAX_BYTES && pixels.saturating_mul(axis.slots() as u64) < u64::from(u32::MAX) {
        return Ok(bytes);
    }
    Err(format!(
        "{} bins for each of {pixels} pixels need {:.1} GiB at {each} bytes, more than {} GiB: use \
         fewer or wider bins, a lower resolution, or an integrator without splats",
        axis.bins,
        bytes as f64 / (1u64 << 30) as f64,
        MAX_BYTES >> 30
    ))
}

/// Returns the unit in which a time is read best, in seconds, and its name: femtoseconds to
/// seconds.
pub fn time_unit(seconds: f64) -> (f64, &'static str) {
    const UNITS: [(f64, &str); 6] = [
        (1.0, "s"),
        (1e-3, "ms"),
        (1e-6, "us"),
        (1e-9, "ns"),
        (1e-12, "ps"),
        (1e-15, "fs"),
    ];
    *UNITS
        .iter()
        .find(|(unit, _)| seconds.abs() >= *unit)
        .unwrap_or(&UNITS[5])
}

/// Light of every pixel by its time of arrival.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TimeCube {
    /// Time axis of the film.
    pub axis: TimeAxis,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Number of samples per pixel.
    pub samples: u64,
    /// Sums over all samples, `[y][x][slot][rgb]`.
    pub sum: Vec<[f64; 3]>,
    /// Sums of squared samples as in [`Film::sum2`](super::Film::sum2), `[y][x][slot][rgb]`.
    pub square: Vec<[f32; 3]>,
}

impl TimeCube {
    fn scale(&self) -> f64 {
        if self.samples == 0 {
            0.0
        } else {
            1.0 / self.samples as f64
        }
    }

    /// Returns the sums of all slots of a pixel.
    #[inline]
    pub fn slots(&self, x: u32, y: u32) -> &[[f64; 3]] {
        let n = self.axis.slots();
        let first = (y as usize * self.width as usize + x as usize) * n;
        &self.sum[first..first + n]
    }

    /// Returns the mean of a pixel in a slot: radiance, not divided by the width of the bin.
    #[inline]
    pub fn mean(&self, x: u32, y: u32, slot: usize) -> [f32; 3] {
        let scale = self.scale();
        self.slots(x, y)[slot].map(|v| (v * scale) as f32)
    }

    /// Returns the estimated variance of that mean; zero with fewer than two samples.
    pub fn variance_of_mean(&self, x: u32, y: u32, slot: usize) -> [f32; 3] {
        let n = self.samples as f64;
        let at = (y as usize * self.width as usize + x as usize) * self.axis.slots() + slot;
        let (s, q) = (self.sum[at], self.square[at]);
        [0, 1, 2].map(|c| {
            let spread = f64::from(q[c]) - s[c] * s[c] / n;
            if n < 2.0 {
                0.0
            } else {
                (spread / (n - 1.0) / n).max(0.0) as f32
            }
        })
    }

    /// Returns the picture of one slot.
    pub fn frame(&self, slot: usize) -> Image {
        Image::from_fn(self.width, self.height, |x, y| self.mean(x, y, slot))
    }

    /// Returns the picture, the sum over all slots, with the same bits as the film of the run.
    pub fn steady(&self) -> Image {
        let scale = self.scale();
        let pixel = |sums: &[[f64; 3]]| sum_slots(sums).map(|v| (v * scale) as f32);
        let data = self
            .sum
            .chunks_exact(self.axis.slots())
            .map(pixel)
            .collect();
        Image::from_pixels(self.width, self.height, data)
    }
}

/// Returns the sum over the slots of a pixel, in their order.
#[inline]
pub fn sum_slots(slots: impl IntoIterator<Item: Borrow<[f64; 3]>>) -> [f64; 3] {
    slots.into_iter().fold([0.0; 3], |sum, slot| {
        let v = slot.borrow();
        [sum[0] + v[0], sum[1] + v[1], sum[2] + v[2]]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const AXIS: TimeAxis = TimeAxis {
        start: 2.0,
        bin: 0.25,
        bins: 8,
    };

    #[test]
    fn lengths_map_to_slots_and_the_rest_to_the_overflow_slots() {
        let slot = |length: f64| AXIS.slot(AXIS.bin_position(length));
        assert_eq!(
            [slot(1.99), slot(2.0), slot(2.249), slot(2.25), slot(3.99)],
            [0, 1, 1, 2, 8]
        );
        assert_eq!(
            [
                slot(4.0),
                slot(1e30),
                slot(f64::INFINITY),
                slot(f64::NAN),
                slot(-1e30)
            ],
            [9, 9, 9, 9, 0]
        );
        assert_eq!(
            (AXIS.slots(), AXIS.bin_start(1), AXIS.end()),
            (10, 2.25, 4.0)
        );
        assert!((0..AXIS.slots()).all(|slot| AXIS.slot(slot as f64 - 0.5) == slot));
    }

    #[test]
    fn filters_conserve_light_and_have_their_shape() {
        let spread = |filter: TimeFilter, position: f64| {
            let mut shares = vec![0.0; AXIS.slots()];
            filter.spread(&AXIS, position, |slot, share| shares[slot] += share);
            shares
        };
        for filter in [
            TimeFilter::None,
            TimeFilter::Box(0.5),
            TimeFilter::Box(1.7),
            TimeFilter::Gauss(0.8),
        ] {
            for position in [-3.0, -0.2, 0.0, 0.4, 3.5, 7.99, 8.3, 40.0, f64::INFINITY] {
                let shares = spread(filter, position);
                assert!(
                    (shares.iter().sum::<f64>() - 1.0).abs() < 1e-12,
                    "{filter:?} at {position}"
                );
                assert!(shares.iter().all(|s| *s >= 0.0));
            }
        }
        // One bin to either side of 3.25: half of the second bin's share, all of the third's.
        let shares = spread(TimeFilter::Box(1.0), 3.25);
        let expected = [0.0, 0.0, 0.0, 0.375, 0.5, 0.125, 0.0];
        assert!(
            shares
                .iter()
                .zip(expected)
                .all(|(a, b)| (a - b).abs() < 1e-12),
            "{shares:?}"
        );
        let shares = spread(TimeFilter::Gauss(1.0), 4.0);
        // Fraction within one standard deviation of a Gaussian truncated at three.
        assert!(
            (shares[4] + shares[5] - 0.682_689_492 / CUT).abs() < 1e-6,
            "{shares:?}"
        );
        let early = spread(TimeFilter::Box(1.0), 0.0);
        assert!(
            (early[0] - 0.5).abs() < 1e-12,
            "what falls before the first bin is kept in the slot before it"
        );
    }

    #[test]
    fn memory_is_computed_and_limited() {
        let thousand = TimeAxis {
            start: 0.0,
            bin: 0.01,
            bins: 1000,
        };
        assert_eq!(
            bytes(&thousand, 320 * 240, false),
            Ok(320 * 240 * 1002 * 40)
        );
        assert!(
            bytes(&thousand, 320 * 240, true).is_ok(),
            "bidirectional pictures of this size fit as well"
        );
        let error = bytes(&thousand, 1920 * 1080, false).unwrap_err();
        assert!(
            error.contains("77.4 GiB") && error.contains("fewer or wider bins"),
            "{error}"
        );
    }
}
