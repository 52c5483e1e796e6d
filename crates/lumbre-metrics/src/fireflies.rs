//! Fireflies: pixels far brighter than the noise of their picture explains.
//!
//! With luminance `Y` and `f` the fraction `floor` of the reference's mean luminance, the relative
//! excess of a pixel is `e = (Y(i) - Y(r)) / (Y(r) + f)`. The noise is estimated robustly by the
//! median `m` of `e` over the image and `s = 1.4826 median |e - m|` [Hampel 1974], which is the
//! standard deviation if `e` is normal. A pixel is a firefly if
//! `e > max(m + deviations * s, excess)`. The second bound prevents false positives in converged
//! images.
//!
//! If more than half of an image is still black, `s` is zero and `excess` alone decides.

use super::floor::Noise;
use super::map::{Colours, PixelMap};
use super::{DEFAULTS, MetricRow, MetricSpec, ON};
use lumbre_light::field;
use lumbre_light::film::Image;
use lumbre_light::math::luminance::luminance;
use lumbre_light::math::stats::median;
use lumbre_light::value::schema::{Table, Ty};

/// Table row of the metric `fireflies`.
pub const ROW: MetricRow = MetricRow {
    name: "fireflies",
    label: "Fireflies",
    long_name: "fireflies",
    unit: "pixels",
    doc: "Pixels whose luminance exceeds the reference by more than `deviations` robust standard deviations of the \
          picture's own relative error, and by more than `excess` times the reference (median and MAD [Hampel 1974]).",
    options: Table {
        name: "FirefliesOptions",
        doc: "Options of `fireflies`.",
        fields: &[
            field! {
                deviations = "10": Ty::num(0.0, 1e6),
                    "robust standard deviations above the median relative error"
            },
            field! {
                excess = "1": Ty::num(0.0, 1e6),
                    "smallest relative excess over the reference; 1 is twice as bright"
            },
            field! {
                floor = "0.1": Ty::num(1e-6, 1e3),
                    "added to the reference's luminance, as a fraction of its mean, so that black \
                     pixels can be compared"
            },
            ON,
        ],
    },
    eval: |image, reference, spec| {
        let excess = excess(image, reference, spec);
        if excess.iter().any(|e| e.is_nan()) {
            return f64::NAN;
        }
        excess.iter().filter(|e| **e > 0.0).count() as f64
    },
    map: Some(PixelMap {
        eval: excess,
        colours: Colours::Magma,
        top: None,
    }),
    noise: Noise::Silent,
    ..DEFAULTS
};

/// Relative excess of every firefly, 0 for all other pixels, NaN for pixels that are NaN.
fn excess(image: &Image, reference: &Image, spec: &MetricSpec) -> Vec<f32> {
    let luminance = |p: &[f32; 3]| luminance(p.map(f64::from));
    let all = reference.data.iter().map(luminance);
    let finite: Vec<f64> = all.filter(|y| y.is_finite()).collect();
    let mean = finite.iter().sum::<f64>() / finite.len().max(1) as f64;
    // Relative to a black reference every lit pixel has an infinite excess.
    let floor = (spec.number("floor") * mean).max(f64::MIN_POSITIVE);
    let pairs = image.data.iter().zip(&reference.data);
    let relative: Vec<f64> = pairs
        .map(|(i, r)| {
            let (i, r) = (luminance(i), luminance(r));
            if i == r { 0.0 } else { (i - r) / (r + floor) }
        })
        .collect();
    let known: Vec<f64> = relative.iter().copied().filter(|e| !e.is_nan()).collect();
    let middle = median(known.iter().copied());
    let spread = 1.4826 * median(known.iter().map(|e| (e - middle).abs()));
    let bound = (middle + spec.number("deviations") * spread).max(spec.number("excess"));
    relative
        .iter()
        .map(|e| {
            if e.is_nan() || *e > bound {
                *e as f32
            } else {
                0.0
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use lumbre_light::math::rng::{normal, pcg4d, unit};
    use lumbre_light::value::Value;

    fn count(image: &Image, reference: &Image, options: &[(&str, f64)]) -> f64 {
        let options: BTreeMap<String, Value> = options
            .iter()
            .map(|(k, v)| ((*k).to_owned(), Value::number(*v)))
            .collect();
        MetricSpec::new("fireflies", "fireflies", options)
            .unwrap()
            .eval(image, reference)
            .unwrap()
    }

    fn reference() -> Image {
        Image::from_fn(64, 48, |x, _| [0.1 + x as f32 / 64.0; 3])
    }

    /// The reference with relative noise added, and `fireflies` pixels set to 20 times their value.
    fn noisy(noise: f32, fireflies: usize) -> Image {
        let mut image = reference();
        for (i, p) in image.data.iter_mut().enumerate() {
            let w = pcg4d([i as u32, 1, 2, 3]);
            *p = p.map(|x| x * (1.0 + noise * normal([unit(w[0]), unit(w[1])])));
        }
        for i in 0..fireflies {
            image.data[100 * i + 7] = reference().data[100 * i + 7].map(|x| 20.0 * x);
        }
        image
    }

    #[test]
    fn outliers_are_counted_and_noise_is_not() {
        for noise in [0.0, 0.02, 0.3] {
            assert_eq!(
                count(&noisy(noise, 0), &reference(), &[]),
                0.0,
                "noise {noise}"
            );
            assert_eq!(
                count(&noisy(noise, 23), &reference(), &[]),
                23.0,
                "noise {noise}"
            );
        }
        // Strong noise hides them: none is ten deviations above the median.
        assert_eq!(count(&noisy(3.0, 23), &reference(), &[]), 0.0);
        assert!(
            count(
                &noisy(0.3, 23),
                &reference(),
                &[("deviations", 2.0), ("excess", 0.0)]
            ) > 30.0
        );
    }

    #[test]
    fn the_scale_of_radiance_does_not_matter() {
        let scaled = |image: Image| {
            let data = image.data.iter().map(|p| p.map(|x| 1024.0 * x)).collect();
            Image { data, ..image }
        };
        let [image, reference] = [noisy(0.2, 5), reference()];
        assert_eq!(
            count(&scaled(image.clone()), &scaled(reference.clone()), &[]),
            count(&image, &reference, &[])
        );
    }

    #[test]
    fn black_pictures_and_few_lit_pixels() {
        let black = Image::new(8, 8);
        assert_eq!(count(&black, &black, &[]), 0.0);
        let mut spark = black.clone();
        spark.data[5] = [1.0; 3];
        assert_eq!(count(&spark, &black, &[]), 1.0);
        assert_eq!(
            count(&black, &reference_of(0.5), &[]),
            0.0,
            "darkness is no firefly"
        );
        let mut few = black.clone();
        few.data[9] = [16.0; 3];
        assert_eq!(count(&few, &reference_of(0.5), &[]), 1.0);
    }

    fn reference_of(value: f32) -> Image {
        Image::from_fn(8, 8, |_, _| [value; 3])
    }
}
