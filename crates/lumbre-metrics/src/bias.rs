//! Mean bias and its standard error.

use super::floor::Noise;
use super::map::{Colours, PixelMap};
use super::{Better, DEFAULTS, MetricRow, MetricSpec, ON, pixels};
use lumbre_light::field;
use lumbre_light::film::Image;
use lumbre_light::value::schema::{Table, Ty};

/// Table row of the metric `bias`.
pub const ROW: MetricRow = MetricRow {
    name: "bias",
    label: "Bias",
    long_name: "mean bias",
    unit: "radiance",
    doc: "Mean over pixels and channels of i - r, with its sign.",
    better: Better::NearZero,
    options: Table {
        name: "BiasOptions",
        doc: "Options of `bias`.",
        fields: &[ON],
    },
    eval: |image, reference, _| pixels::mean(image, reference, |i, r| i - r),
    map: Some(PixelMap {
        eval: |image, reference, _| pixels::each(image, reference, |i, r| i - r),
        colours: Colours::CoolWarm,
        top: None,
    }),
    noise: Noise::Silent,
    ..DEFAULTS
};

/// Table row of the metric `bias_se`.
pub const ERROR_ROW: MetricRow = MetricRow {
    name: "bias_se",
    label: "SE of bias",
    long_name: "standard error of the mean bias",
    unit: "radiance",
    doc: "Standard error of `bias` from how the means of square blocks of pixels scatter; it includes the noise of the \
          reference, and where the bias differs over the picture it is too large rather than too small.",
    options: Table {
        name: "BiasSeOptions",
        doc: "Options of `bias_se`.",
        fields: &[
            field! {
                block = "8": Ty::int(1, 4096),
                    "side of a block in pixels; larger than what a pixel filter or a splat makes \
                     alike"
            },
            ON,
        ],
    },
    smallest: |spec| block(spec) as u32 + 1,
    eval: standard_error,
    noise: Noise::AddsSquared,
    ..DEFAULTS
};

fn block(spec: &MetricSpec) -> usize {
    (spec.number("block") as usize).max(1)
}

/// Standard error of the mean difference between two images, from block means.
///
/// For `k` blocks of `n` pixels with mean differences `d`, and `N` pixels in all with mean
/// difference `m`: `sqrt(k / (k - 1) * sum (n (d - m))^2) / N`. For blocks of equal size this is
/// the textbook standard error of a mean.
fn standard_error(image: &Image, reference: &Image, spec: &MetricSpec) -> f64 {
    let (side, width) = (block(spec), image.width as usize);
    let columns = width.div_ceil(side);
    let mut blocks = vec![(0.0, 0u32); columns * (image.height as usize).div_ceil(side)];
    for (at, (i, r)) in image.data.iter().zip(&reference.data).enumerate() {
        let (sum, count) = &mut blocks[at / width / side * columns + at % width / side];
        *sum += (0..3)
            .map(|c| f64::from(i[c]) - f64::from(r[c]))
            .sum::<f64>()
            / 3.0;
        *count += 1;
    }
    let pixels = image.data.len() as f64;
    let mean = blocks.iter().map(|b| b.0).sum::<f64>() / pixels;
    let scatter: f64 = blocks
        .iter()
        .map(|(sum, count)| (sum - f64::from(*count) * mean).powi(2))
        .sum();
    let k = blocks.len() as f64;
    (k / (k - 1.0) * scatter).sqrt() / pixels
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use lumbre_light::math::rng::{normal, pcg4d, unit};
    use lumbre_light::value::Value;

    fn spec(name: &str, block: i64) -> MetricSpec {
        let options = match name {
            "bias_se" => BTreeMap::from([("block".to_owned(), Value::Int(block))]),
            _ => BTreeMap::new(),
        };
        MetricSpec::new(name, name, options).unwrap()
    }

    /// An image of noise with variance 0.04 that is constant over squares of `grain` pixels and
    /// equal in all channels.
    fn noise(seed: u32, grain: u32) -> Image {
        Image::from_fn(67, 50, |x, y| {
            let w = pcg4d([x / grain, y / grain, 0, seed]);
            [0.2 * normal([unit(w[0]), unit(w[1])]); 3]
        })
    }

    #[test]
    fn the_sign_is_kept() {
        let (dark, light) = (Image::new(9, 9), Image::from_fn(9, 9, |_, _| [0.25; 3]));
        assert_eq!(spec("bias", 0).eval(&light, &dark), Ok(0.25));
        assert_eq!(spec("bias", 0).eval(&dark, &light), Ok(-0.25));
        assert_eq!(spec("bias_se", 8).eval(&light, &dark), Ok(0.0));
    }

    #[test]
    fn the_standard_error_is_that_of_the_bias() {
        let zero = Image::new(67, 50);
        // Of 400 pictures of noise about 95 % lie within 1.96 standard errors; 4 standard
        // deviations are 4.4 %.
        for (grain, block) in [(1, 1), (1, 8), (2, 8)] {
            let within = (0..400)
                .filter(|seed| {
                    let image = noise(*seed, grain);
                    let bias = spec("bias", 0).eval(&image, &zero).unwrap();
                    bias.abs() < 1.96 * spec("bias_se", block).eval(&image, &zero).unwrap()
                })
                .count();
            assert!(
                (362..=397).contains(&within),
                "grain {grain}, block {block}: {within} of 400"
            );
        }
        // Pixels are equal in groups of four, so they are fewer observations than there are pixels;
        // blocks of a single pixel cannot detect that.
        let image = noise(1, 2);
        let [each, blocks] = [1, 8].map(|b| spec("bias_se", b).eval(&image, &zero).unwrap());
        assert!((1.5..2.6).contains(&(blocks / each)), "{each} {blocks}");
    }
}
