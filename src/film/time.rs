//! Films with a time axis: for every pixel, light by the optical length of its path, in bins.
//!
//! Times are optical lengths in scene units: the distance that light would go in the same time in vacuum.
//!
//! A slot is a bin or one of the two beside them: slot 0 holds what arrives before the first bin, slot `bins + 1` what
//! arrives after the last. So nothing is lost, and the sum over all slots, in their order, *is* the picture.

use std::borrow::Borrow;
use std::ops::{Add, Div};

use super::Image;

/// The file in which a run leaves the mean radiance of every bin, an array of NumPy: [row][column][bin][rgb].
pub const CUBE_FILE: &str = "time-cube.npy";

/// Where bins lie on the axis of optical length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeAxis {
    /// Where the first bin begins, in scene units.
    pub start: f64,
    /// Width of a bin in scene units, positive.
    pub bin: f64,
    /// Number of bins, at least one.
    pub bins: u32,
}

impl TimeAxis {
    /// Number of bins with the two slots beside them.
    #[inline]
    pub fn slots(&self) -> usize {
        self.bins as usize + 2
    }

    /// Place of an optical length in bins from the start: 1.5 is the middle of the second one.
    #[inline]
    pub fn place(&self, length: f64) -> f64 {
        self.places(length, |number| number)
    }

    /// Places of many lengths at once, where `of` makes as many of one number.
    #[inline(always)]
    pub fn places<T: Add<Output = T> + Div<Output = T>>(&self, lengths: T, of: impl Fn(f64) -> T) -> T {
        (lengths + of(-self.start)) / of(self.bin)
    }

    /// The slot of a place in bins; what is not a number is late.
    #[inline]
    pub fn slot(&self, place: f64) -> usize {
        if place < 0.0 {
            0
        } else if place < f64::from(self.bins) {
            // There are fewer bins than such numbers, and to make them takes less than to make longer ones.
            place as i32 as usize + 1
        } else {
            self.bins as usize + 1
        }
    }

    /// Where bin `i` begins, from 0.
    pub fn begin(&self, i: u32) -> f64 {
        self.start + f64::from(i) * self.bin
    }

    /// Where the last bin ends.
    pub fn end(&self) -> f64 {
        self.begin(self.bins)
    }
}

/// How a contribution is spread over the bins about its time. Every kind keeps its light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TimeFilter {
    /// All goes to the bin in which it arrives.
    None,
    /// Evenly over so many bins to either side.
    Box(f64),
    /// By a Gaussian of this standard deviation in bins, cut off at three of them.
    Gauss(f64),
}

impl TimeFilter {
    /// The names of the kinds in scripts.
    pub const WORDS: &'static [&'static str] = &["none", "box", "gauss"];

    /// The kind with a name, and its size in bins.
    pub fn named(name: &str, radius: f64) -> Option<TimeFilter> {
        match name {
            "none" => Some(TimeFilter::None),
            "box" => Some(TimeFilter::Box(radius)),
            "gauss" => Some(TimeFilter::Gauss(radius)),
            _ => None,
        }
    }

    /// Its name and size; 0 for none.
    pub fn parts(&self) -> (&'static str, f64) {
        match self {
            TimeFilter::None => ("none", 0.0),
            TimeFilter::Box(radius) => ("box", *radius),
            TimeFilter::Gauss(sigma) => ("gauss", *sigma),
        }
    }

    /// Hands the slots of a place in bins to `give`, each with its share; the shares sum to one.
    #[inline]
    pub fn spread(&self, axis: &TimeAxis, place: f64, mut give: impl FnMut(usize, f64)) {
        let (reach, gauss) = match *self {
            TimeFilter::Box(radius) if radius > 0.0 => (radius, None),
            TimeFilter::Gauss(sigma) if sigma > 0.0 => (3.0 * sigma, Some(sigma)),
            _ => return give(axis.slot(place), 1.0),
        };
        if !place.is_finite() {
            return give(axis.slot(place), 1.0);
        }
        // The part of the filter below a place.
        let below = |x: f64| {
            let t = (x - place).clamp(-reach, reach);
            match gauss {
                None => 0.5 + 0.5 * t / reach,
                Some(sigma) => 0.5 + 0.5 * erf(t / sigma / std::f64::consts::SQRT_2) / CUT,
            }
        };
        let (first, last) = (axis.slot(place - reach), axis.slot(place + reach));
        let mut before = 0.0;
        for slot in first..=last {
            let until = if slot == last { 1.0 } else { below(slot as f64) };
            if until > before {
                give(slot, until - before);
                before = until;
            }
        }
    }
}

/// erf(3 / sqrt 2): the part of a Gaussian within three standard deviations.
const CUT: f64 = 0.997_300_203_936_739_8;

/// The error function to 1.2e-7 [Abramowitz and Stegun 1964, 7.1.26 has the form; a rational Chebyshev fit of `erfc`].
fn erf(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.327_591_1 * x.abs());
    let poly =
        t * (0.254_829_592 + t * (-0.284_496_736 + t * (1.421_413_741 + t * (-1.453_152_027 + t * 1.061_405_429))));
    (1.0 - poly * (-x * x).exp()).copysign(x)
}

/// Bytes of own sums for each pixel and slot: three sums in double, three sums of squares in single precision, and four that
/// keep the next one's in line.
pub const BYTES_PER_SLOT: u64 = 40;

/// Bytes of the sums of splats for each pixel and slot, where splats land.
pub const SPLAT_BYTES_PER_SLOT: u64 = 96;

/// The most bytes that the sums of one run with a time axis may take: 12 GiB.
pub const MAX_BYTES: u64 = 12 << 30;

/// Up to so many bytes of sums the CPU has in memory before a run's clock starts, and keeps for later runs: 1 GiB. Those of
/// splats come second: they are had beforehand where all of it fits.
pub const MAX_KEPT_BYTES: u64 = 1 << 30;

/// The most bytes that sums with a time axis take: beyond [`MAX_KEPT_BYTES`] those of slots that light never reaches are not
/// touched, and an operating system gives no memory for them.
///
/// # Errors
/// In words, when they are more than [`MAX_BYTES`].
pub fn bytes(axis: &TimeAxis, pixels: u64, splats: bool) -> Result<u64, String> {
    let each = BYTES_PER_SLOT + u64::from(splats) * SPLAT_BYTES_PER_SLOT;
    let bytes = pixels.saturating_mul(axis.slots() as u64).saturating_mul(each);
    if bytes <= MAX_BYTES && pixels.saturating_mul(axis.slots() as u64) < u64::from(u32::MAX) {
        return Ok(bytes);
    }
    Err(format!(
        "{} bins for each of {pixels} pixels need {:.1} GiB at {each} bytes, more than {} GiB: take fewer or wider bins, a \
         smaller picture, or another integrator than one that finds light for other pixels",
        axis.bins,
        bytes as f64 / (1u64 << 30) as f64,
        MAX_BYTES >> 30
    ))
}

/// The unit in which a time is read best, in seconds, and its name: femtoseconds to seconds.
pub fn unit_of(seconds: f64) -> (f64, &'static str) {
    const UNITS: [(f64, &str); 6] =
        [(1.0, "s"), (1e-3, "ms"), (1e-6, "us"), (1e-9, "ns"), (1e-12, "ps"), (1e-15, "fs")];
    *UNITS.iter().find(|(unit, _)| seconds.abs() >= *unit).unwrap_or(&UNITS[5])
}

/// The light of every pixel by its time.
#[derive(Clone, Debug, PartialEq)]
pub struct TimeCube {
    /// The axis.
    pub axis: TimeAxis,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Samples per pixel.
    pub samples: u64,
    /// Sums over all samples, `[y][x][slot][rgb]`.
    pub sum: Vec<[f64; 3]>,
    /// Sums of the squares of what each sample brought, as [`Film::sum2`](super::Film::sum2), in the same order.
    pub square: Vec<[f32; 3]>,
}

impl TimeCube {
    fn scale(&self) -> f64 {
        if self.samples == 0 { 0.0 } else { 1.0 / self.samples as f64 }
    }

    /// The slots of a pixel.
    #[inline]
    pub fn slots(&self, x: u32, y: u32) -> &[[f64; 3]] {
        let n = self.axis.slots();
        let first = (y as usize * self.width as usize + x as usize) * n;
        &self.sum[first..first + n]
    }

    /// The mean of a pixel in a slot: radiance, not divided by the width of the bin.
    #[inline]
    pub fn mean(&self, x: u32, y: u32, slot: usize) -> [f32; 3] {
        let scale = self.scale();
        self.slots(x, y)[slot].map(|v| (v * scale) as f32)
    }

    /// The estimated variance of that mean; zero with fewer than two samples.
    pub fn variance_of_mean(&self, x: u32, y: u32, slot: usize) -> [f32; 3] {
        let n = self.samples as f64;
        let at = (y as usize * self.width as usize + x as usize) * self.axis.slots() + slot;
        let (s, q) = (self.sum[at], self.square[at]);
        [0, 1, 2].map(|c| {
            let spread = f64::from(q[c]) - s[c] * s[c] / n;
            if n < 2.0 { 0.0 } else { (spread / (n - 1.0) / n).max(0.0) as f32 }
        })
    }

    /// The picture of one slot.
    pub fn frame(&self, slot: usize) -> Image {
        Image::from_fn(self.width, self.height, |x, y| self.mean(x, y, slot))
    }

    /// The picture: the sum over all slots, the same bits as the film of the run.
    pub fn steady(&self) -> Image {
        let scale = self.scale();
        let pixel = |sums: &[[f64; 3]]| total(sums).map(|v| (v * scale) as f32);
        let data = self.sum.chunks_exact(self.axis.slots()).map(pixel).collect();
        Image { width: self.width, height: self.height, data }
    }
}

/// The sum over the slots of a pixel, in their order.
#[inline]
pub fn total(slots: impl IntoIterator<Item: Borrow<[f64; 3]>>) -> [f64; 3] {
    slots.into_iter().fold([0.0; 3], |sum, slot| {
        let v = slot.borrow();
        [sum[0] + v[0], sum[1] + v[1], sum[2] + v[2]]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const AXIS: TimeAxis = TimeAxis { start: 2.0, bin: 0.25, bins: 8 };

    #[test]
    fn lengths_find_their_slots_and_the_ends_take_the_rest() {
        let slot = |length: f64| AXIS.slot(AXIS.place(length));
        assert_eq!([slot(1.99), slot(2.0), slot(2.249), slot(2.25), slot(3.99)], [0, 1, 1, 2, 8]);
        assert_eq!([slot(4.0), slot(1e30), slot(f64::INFINITY), slot(f64::NAN), slot(-1e30)], [9, 9, 9, 9, 0]);
        assert_eq!((AXIS.slots(), AXIS.begin(1), AXIS.end()), (10, 2.25, 4.0));
        assert!((0..AXIS.slots()).all(|slot| AXIS.slot(slot as f64 - 0.5) == slot));
    }

    #[test]
    fn filters_keep_all_light_and_have_their_shape() {
        let spread = |filter: TimeFilter, place: f64| {
            let mut shares = vec![0.0; AXIS.slots()];
            filter.spread(&AXIS, place, |slot, share| shares[slot] += share);
            shares
        };
        for filter in [TimeFilter::None, TimeFilter::Box(0.5), TimeFilter::Box(1.7), TimeFilter::Gauss(0.8)] {
            for place in [-3.0, -0.2, 0.0, 0.4, 3.5, 7.99, 8.3, 40.0, f64::INFINITY] {
                let shares = spread(filter, place);
                assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{filter:?} at {place}");
                assert!(shares.iter().all(|s| *s >= 0.0));
            }
        }
        // A bin to either side of 3.25: half of the second bin's, all of the third's.
        let shares = spread(TimeFilter::Box(1.0), 3.25);
        let expected = [0.0, 0.0, 0.0, 0.375, 0.5, 0.125, 0.0];
        assert!(shares.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{shares:?}");
        let shares = spread(TimeFilter::Gauss(1.0), 4.0);
        // Within one standard deviation of a Gaussian cut at three.
        assert!((shares[4] + shares[5] - 0.682_689_492 / CUT).abs() < 1e-6, "{shares:?}");
        let early = spread(TimeFilter::Box(1.0), 0.0);
        assert!((early[0] - 0.5).abs() < 1e-12, "what is spread before the first bin is kept beside it");
    }

    #[test]
    fn memory_is_known_and_limited() {
        let thousand = TimeAxis { start: 0.0, bin: 0.01, bins: 1000 };
        assert_eq!(bytes(&thousand, 320 * 240, false), Ok(320 * 240 * 1002 * 40));
        assert!(bytes(&thousand, 320 * 240, true).is_ok(), "bidirectional pictures of this size fit as well");
        let error = bytes(&thousand, 1920 * 1080, false).unwrap_err();
        assert!(error.contains("77.4 GiB") && error.contains("fewer or wider bins"), "{error}");
    }
}
