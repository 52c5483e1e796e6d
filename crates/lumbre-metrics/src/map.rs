//! Error maps: one value per pixel, and the colour maps that display them.

use std::sync::LazyLock;

use super::colour::{from_lab, lab};
use super::{MetricSpec, tonemap};
use lumbre_light::film::Image;

/// Definition of a metric's error map.
pub struct PixelMap {
    /// Computes one value per pixel in row order from image, reference and options, as
    /// [`super::MetricRow::eval`].
    pub eval: fn(&Image, &Image, &MetricSpec) -> Vec<f32>,
    /// Colour map that suits the values.
    pub colours: Colours,
    /// Largest possible value, if there is one; the colour scale then always covers 0 to it.
    pub top: Option<f32>,
}

lumbre_light::named! {
    /// Perceptually uniform colour maps: equal steps in value are about equal steps in appearance.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Colours {
        /// Black over violet and orange to a pale yellow, for values of at least 0; lightness rises
        /// evenly. By N. Smith and S. van der Walt, released under CC0 with matplotlib; the colours
        /// of the paper on FLIP.
        Magma = "magma",
        /// Blue over grey to red, for values of both signs; grey is 0 [Moreland 2009].
        CoolWarm = "cool to warm",
    }
}

/// 8-bit sRGB colour of NaN, which occurs in no colour map.
pub const NAN_COLOUR: [u8; 3] = [0, 255, 0];

impl Colours {
    /// Returns the 8-bit sRGB colour at a position, which is clamped to 0..=1.
    pub fn at(self, position: f32) -> [u8; 3] {
        if position.is_nan() {
            return NAN_COLOUR;
        }
        let table = match self {
            Colours::Magma => &MAGMA_TABLE,
            Colours::CoolWarm => &COOL_WARM_TABLE,
        };
        table[(position.clamp(0.0, 1.0) * 255.0).round() as usize]
    }
}

/// One value for every pixel of an image.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorMap {
    /// Width in pixels, that is, number of columns.
    pub width: u32,
    /// Height in pixels, that is, number of rows.
    pub height: u32,
    /// Values in row order, `width * height` of them.
    pub values: Vec<f32>,
    /// Colour map that suits the metric.
    pub colours: Colours,
    /// Largest value that the metric can have, if there is one.
    pub top: Option<f32>,
}

impl ErrorMap {
    /// Returns the values at both ends of the colour scale. The upper end is `top`, or else the
    /// metric's largest value, or else the 99th percentile of the magnitudes, so that single
    /// outliers do not make all other pixels black. Scales of signed values cover `-top..=top`,
    /// others start at 0.
    pub fn scale(&self, top: Option<f32>) -> [f32; 2] {
        let top = top.or(self.top).unwrap_or_else(|| {
            let mut sizes: Vec<f32> = self
                .values
                .iter()
                .map(|v| v.abs())
                .filter(|v| v.is_finite())
                .collect();
            sizes.sort_unstable_by(f32::total_cmp);
            let percentile = sizes
                .get((sizes.len() * 99).div_ceil(100).max(1) - 1)
                .copied()
                .unwrap_or(0.0);
            let largest = sizes.last().copied().unwrap_or(0.0);
            [percentile, largest, 1.0]
                .into_iter()
                .find(|v| *v > 0.0)
                .unwrap_or(1.0)
        });
        if self.colours == Colours::CoolWarm {
            [-top, top]
        } else {
            [0.0, top]
        }
    }

    /// Returns the 8-bit sRGB colour of every pixel in row order, with the scale over `low..=high`.
    pub fn coloured(&self, [low, high]: [f32; 2]) -> Vec<[u8; 3]> {
        let position = |v: f32| {
            if v == low {
                0.0
            } else {
                (v - low) / (high - low)
            }
        };
        self.values
            .iter()
            .map(|v| self.colours.at(position(*v)))
            .collect()
    }

    /// Returns column, row and value of the pixel with the largest magnitude, NaN excluded; `None`
    /// if all pixels are NaN.
    pub fn worst(&self) -> Option<(u32, u32, f32)> {
        let numbers = self.values.iter().enumerate().filter(|(_, v)| !v.is_nan());
        // The first of equal pixels, so that the result does not depend on the search order.
        let (at, value) = numbers.reduce(|a, b| if b.1.abs() > a.1.abs() { b } else { a })?;
        Some((at as u32 % self.width, at as u32 / self.width, *value))
    }
}

type Table = [[u8; 3]; 256];

static MAGMA_TABLE: LazyLock<Table> = LazyLock::new(|| {
    let digit = |i: usize| char::from(MAGMA.as_bytes()[i]).to_digit(16).unwrap_or(0) as u8;
    std::array::from_fn(|i| [0, 1, 2].map(|c| 16 * digit(6 * i + 2 * c) + digit(6 * i + 2 * c + 1)))
});

static COOL_WARM_TABLE: LazyLock<Table> =
    LazyLock::new(|| std::array::from_fn(|i| cool_warm(i as f32 / 255.0)));

/// Ends of the diverging map in 8-bit sRGB, and the magnitude of the Msh vector at its middle.
const COOL: [u8; 3] = [59, 76, 192];
const WARM: [u8; 3] = [180, 4, 38];
const MIDDLE: f32 = 88.0;

/// Evaluates the diverging map of [Moreland 2009]: polar CIELAB (Msh) from either end to an
/// unsaturated middle, with a hue that rotates as saturation falls so that steps stay even.
fn cool_warm(t: f32) -> [u8; 3] {
    let (end, t) = if t < 0.5 {
        (COOL, 1.0 - 2.0 * t)
    } else {
        (WARM, 2.0 * t - 1.0)
    };
    let [l, a, b] = lab(end.map(|c| tonemap::srgb_light(f32::from(c) / 255.0)));
    let m = (l * l + a * a + b * b).sqrt();
    let (s, h) = ((l / m).acos(), b.atan2(a));
    let spin = s * (MIDDLE * MIDDLE - m * m).max(0.0).sqrt() / (m * s.sin());
    let spun = if h > -std::f32::consts::FRAC_PI_3 {
        h + spin
    } else {
        h - spin
    };
    let mix = |middle: f32, end: f32| middle + t * (end - middle);
    let (m, s, h) = (mix(MIDDLE, m), mix(0.0, s), mix(spun, h));
    let rgb = from_lab([m * s.cos(), m * s.sin() * h.cos(), m * s.sin() * h.sin()]);
    rgb.map(|x| (tonemap::srgb(x) * 255.0).round() as u8)
}

/// Magma in 256 steps of 8-bit sRGB, six hexadecimal digits each, rounded from the table in
/// matplotlib 3.11.
const MAGMA: &str = "\
    00000401000501010601010802010902020b02020d03030f03031204041405041606051806051a07061c08071e090720\
    0a08220b09240c09260d0a290e0b2b100b2d110c2f120d31130d34140e36150e38160f3b180f3d19103f1a10421c1044\
    1d11471e114920114b21114e22115024125325125527125829115a2a115c2c115f2d11612f1163311165331067341069\
    36106b38106c390f6e3b0f703d0f713f0f72400f74420f75440f764510774710784910784a10794c117a4e117b4f127b\
    51127c52137c54137d56147d57157e59157e5a167e5c167f5d177f5f187f601880621980641a80651a80671b80681c81\
    6a1c816b1d816d1d816e1e81701f81721f817320817521817621817822817922827b23827c23827e2482802582812581\
    8326818426818627818827818928818b29818c29818e2a81902a81912b81932b80942c80962c80982d80992d809b2e7f\
    9c2e7f9e2f7fa02f7fa1307ea3307ea5317ea6317da8327daa337dab337cad347cae347bb0357bb2357bb3367ab5367a\
    b73779b83779ba3878bc3978bd3977bf3a77c03a76c23b75c43c75c53c74c73d73c83e73ca3e72cc3f71cd4071cf4070\
    d0416fd2426fd3436ed5446dd6456cd8456cd9466bdb476adc4869de4968df4a68e04c67e24d66e34e65e44f64e55064\
    e75263e85362e95462ea5661eb5760ec5860ed5a5fee5b5eef5d5ef05f5ef1605df2625df2645cf3655cf4675cf4695c\
    f56b5cf66c5cf66e5cf7705cf7725cf8745cf8765cf9785df9795df97b5dfa7d5efa7f5efa815ffb835ffb8560fb8761\
    fc8961fc8a62fc8c63fc8e64fc9065fd9266fd9467fd9668fd9869fd9a6afd9b6bfe9d6cfe9f6dfea16efea36ffea571\
    fea772fea973feaa74feac76feae77feb078feb27afeb47bfeb67cfeb77efeb97ffebb81febd82febf84fec185fec287\
    fec488fec68afec88cfeca8dfecc8ffecd90fecf92fed194fed395fed597fed799fed89afdda9cfddc9efddea0fde0a1\
    fde2a3fde3a5fde5a7fde7a9fde9aafdebacfcecaefceeb0fcf0b2fcf2b4fcf4b6fcf6b8fcf7b9fcf9bbfcfbbdfcfdbf";

#[cfg(test)]
mod tests {
    use super::*;

    fn lightness(colour: [u8; 3]) -> f32 {
        lab(colour.map(|c| tonemap::srgb_light(f32::from(c) / 255.0)))[0]
    }

    fn steps(colours: Colours) -> Vec<f32> {
        let at = |i: u32| {
            let colour = colours.at(i as f32 / 255.0);
            lab(colour.map(|c| tonemap::srgb_light(f32::from(c) / 255.0)))
        };
        let distance =
            |a: [f32; 3], b: [f32; 3]| (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f32>().sqrt();
        // Sixteenths of the map, since single steps are close to the rounding to 8 bits.
        (0..15)
            .map(|i| distance(at(17 * i), at(17 * i + 17)))
            .collect()
    }

    #[test]
    fn lightness_of_magma_rises_evenly() {
        let all: Vec<f32> = (0..256)
            .map(|i| lightness(Colours::Magma.at(i as f32 / 255.0)))
            .collect();
        assert!(all[0] < 1.0 && all[255] > 97.0, "{all:?}");
        assert!(
            all.windows(17)
                .all(|w| (3.0..8.0).contains(&(w[16] - w[0]))),
            "{all:?}"
        );
        assert_eq!(Colours::Magma.at(0.0), [0, 0, 4]);
        assert_eq!(Colours::Magma.at(7.0), [252, 253, 191]);
    }

    #[test]
    fn the_diverging_map_is_even_and_equals_published_colours() {
        let all = steps(Colours::CoolWarm);
        let (least, most) = all
            .iter()
            .fold((f32::MAX, 0f32), |(l, m), s| (l.min(*s), m.max(*s)));
        assert!(most / least < 2.0, "{all:?}");
        // Matplotlib's `coolwarm`, which samples the same map more coarsely.
        for (i, expected) in [
            (0, [59, 76, 192]),
            (64, [141, 176, 254]),
            (128, [221, 220, 220]),
            (192, [244, 152, 122]),
            (255, [180, 4, 38]),
        ] {
            let colour = Colours::CoolWarm.at(i as f32 / 255.0);
            let near = colour.iter().zip(expected).all(|(a, b)| a.abs_diff(b) <= 2);
            assert!(near, "{i}: {colour:?}, expected {expected:?}");
        }
    }

    fn map(values: &[f32], colours: Colours, top: Option<f32>) -> ErrorMap {
        ErrorMap {
            width: values.len() as u32,
            height: 1,
            values: values.to_vec(),
            colours,
            top,
        }
    }

    #[test]
    fn scales_ignore_outliers_but_not_the_only_value() {
        let mut values: Vec<f32> = (0..200).map(|i| i as f32 / 200.0).collect();
        values[3] = 1e9;
        assert_eq!(map(&values, Colours::Magma, None).scale(None), [0.0, 0.99]);
        assert_eq!(
            map(&values, Colours::CoolWarm, None).scale(None),
            [-0.99, 0.99]
        );
        assert_eq!(
            map(&values, Colours::Magma, Some(1.0)).scale(None),
            [0.0, 1.0]
        );
        assert_eq!(
            map(&values, Colours::Magma, Some(1.0)).scale(Some(0.5)),
            [0.0, 0.5]
        );
        let mut one = vec![0.0; 200];
        one[0] = 3.0;
        assert_eq!(map(&one, Colours::Magma, None).scale(None), [0.0, 3.0]);
        assert_eq!(
            map(&[0.0, f32::NAN], Colours::Magma, None).scale(None),
            [0.0, 1.0]
        );
    }

    #[test]
    fn pixels_get_their_colours_and_the_worst_is_found() {
        let m = map(
            &[-2.0, 0.0, f32::NAN, 1.0, -2.0, f32::INFINITY],
            Colours::CoolWarm,
            None,
        );
        let colours = m.coloured([-1.0, 1.0]);
        assert_eq!(
            (colours[0], colours[2], colours[3]),
            (COOL, NAN_COLOUR, WARM)
        );
        assert_eq!(colours[5], WARM);
        assert_eq!(m.worst(), Some((5, 0, f32::INFINITY)));
        assert_eq!(
            map(&[1.0, -2.0, 2.0], Colours::CoolWarm, None).worst(),
            Some((1, 0, -2.0))
        );
        assert_eq!(map(&[f32::NAN], Colours::Magma, None).worst(), None);
    }
}
