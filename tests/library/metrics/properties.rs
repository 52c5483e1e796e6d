//! Properties that every row of the metric table must have. New rows are covered without a change
//! here.

use std::collections::{BTreeMap, BTreeSet};

use lumbre_light::film::Image;
use lumbre_metrics::{Better, METRICS, MetricError, MetricRow, MetricSpec, metric};

const WIDTH: u32 = 32;
const HEIGHT: u32 = 24;

fn spec(row: &MetricRow) -> MetricSpec {
    MetricSpec::new(row.name, row.name, BTreeMap::new()).unwrap()
}

fn scene() -> Image {
    Image::from_fn(WIDTH, HEIGHT, |x, y| {
        let edge = if x > 14 && y > 9 { 0.5 } else { 0.1 };
        [edge + x as f32 / 90.0, edge + y as f32 / 70.0, edge * 0.7]
    })
}

/// Returns the scene with noise of the given amplitude; the pattern is fixed, so a larger amplitude
/// is worse everywhere.
fn noisy(amplitude: f32) -> Image {
    let mut state = 0x9e37_79b9_u32;
    let mut image = scene();
    for x in image.data.as_flattened_mut() {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        *x += amplitude * ((state >> 8) as f32 / (1 << 23) as f32 - 1.0);
    }
    image
}

#[test]
fn names_are_unique_snake_case_and_documented() {
    let names: BTreeSet<&str> = METRICS.iter().map(|m| m.name).collect();
    assert_eq!(names.len(), METRICS.len());
    for row in METRICS {
        let snake = |s: &str| {
            s.chars()
                .all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
        };
        assert!(!row.name.is_empty() && snake(row.name), "{}", row.name);
        for text in [
            row.label,
            row.long_name,
            row.doc,
            row.options.name,
            row.options.doc,
        ] {
            assert!(!text.trim().is_empty(), "{} lacks a text", row.name);
        }
        for field in row.options.fields {
            assert!(
                snake(field.key) && !field.doc.is_empty(),
                "{}.{}",
                row.name,
                field.key
            );
        }
        let maps_tones = row
            .options
            .fields
            .iter()
            .any(|f| f.key == "on" || f.key == "tonemapper");
        assert!(maps_tones, "{} has no tone map", row.name);
    }
}

#[test]
fn equal_images_have_the_perfect_value() {
    for row in METRICS {
        let value = spec(row).eval(&scene(), &scene()).unwrap();
        let near = value == row.perfect || (value - row.perfect).abs() < 1e-12;
        assert!(near, "{}: {value}, perfect is {}", row.name, row.perfect);
        assert_eq!(
            row.better != Better::Higher,
            row.perfect == 0.0,
            "{}",
            row.name
        );
    }
}

#[test]
fn more_noise_gives_a_worse_value() {
    for row in METRICS {
        let values: Vec<f64> = [0.01, 0.05, 0.2]
            .iter()
            .map(|a| spec(row).eval(&noisy(*a), &scene()).unwrap())
            .collect();
        let worse = |a: &f64, b: &f64| match row.better {
            // A count of pixels may stay the same.
            Better::Lower if row.unit == "pixels" => a <= b,
            Better::Lower => a < b,
            Better::Higher => a > b,
            Better::NearZero => a.abs() < b.abs(),
        };
        assert!(values.is_sorted_by(worse), "{}: {values:?}", row.name);
    }
}

#[test]
fn a_nan_in_either_image_makes_the_value_nan() {
    let mut broken = scene();
    broken.data[100][2] = f32::NAN;
    for row in METRICS {
        assert!(
            spec(row).eval(&broken, &scene()).unwrap().is_nan(),
            "{} hides a NaN of the image",
            row.name
        );
        assert!(
            spec(row).eval(&scene(), &broken).unwrap().is_nan(),
            "{} hides a NaN of the reference",
            row.name
        );
    }
}

#[test]
fn images_of_different_sizes_are_an_error() {
    for row in METRICS {
        let e = spec(row)
            .eval(&Image::new(16, 12), &Image::new(12, 16))
            .unwrap_err();
        assert_eq!(
            e,
            MetricError::Size {
                image: [16, 12],
                reference: [12, 16]
            }
        );
        assert_eq!(e.to_string(), "image is 16x12 but reference is 12x16");
    }
}

#[test]
fn error_maps_of_equal_images_are_zero_and_the_mean_of_a_map_is_the_metric() {
    // Maps of a root, of windows at pixels, and of an excess: their means are not the metric.
    let others = ["rmse", "ssim", "fireflies"];
    for row in METRICS.iter().filter(|row| row.map.is_some()) {
        let spec = spec(row);
        let perfect = spec.error_map(&scene(), &scene()).unwrap();
        assert_eq!(
            (perfect.width, perfect.height, perfect.values.len()),
            (WIDTH, HEIGHT, (WIDTH * HEIGHT) as usize)
        );
        assert!(
            perfect.values.iter().all(|v| v.abs() < 1e-6),
            "{}",
            row.name
        );
        let map = spec.error_map(&noisy(0.2), &scene()).unwrap();
        assert!(
            map.worst().is_some_and(|(_, _, value)| value != 0.0) || row.unit == "pixels",
            "{}",
            row.name
        );
        let mean = map.values.iter().map(|v| f64::from(*v)).sum::<f64>() / map.values.len() as f64;
        let value = spec.eval(&noisy(0.2), &scene()).unwrap();
        let equal = (mean - value).abs() < 1e-6 * value.abs().max(1e-3);
        assert!(
            equal || others.contains(&row.name),
            "{}: {mean} {value}",
            row.name
        );
    }
}

#[test]
fn a_nan_pixel_is_nan_in_the_error_map_and_others_stay_finite() {
    let mut broken = scene();
    broken.data[100][2] = f32::NAN;
    for row in METRICS.iter().filter(|row| row.map.is_some()) {
        let map = spec(row).error_map(&broken, &scene()).unwrap();
        assert!(map.values[100].is_nan(), "{}", row.name);
        assert!(
            map.values.iter().any(|v| v.is_finite()),
            "{}: no pixel is finite",
            row.name
        );
    }
}

#[test]
fn the_error_of_a_metric_without_a_map_lists_those_with_one() {
    let e = spec(metric("psnr").unwrap())
        .error_map(&scene(), &scene())
        .unwrap_err()
        .to_string();
    assert!(e.contains("`psnr`") && e.contains("flip"), "{e}");
}

#[test]
fn settled_options_given_explicitly_give_the_same_value() {
    for row in METRICS.iter().filter(|row| row.settle.is_some()) {
        let settled = MetricSpec::new(row.name, row.name, spec(row).settled(&scene())).unwrap();
        let [automatic, explicit] =
            [spec(row), settled.clone()].map(|s| s.eval(&noisy(0.2), &scene()).unwrap());
        assert_eq!(automatic, explicit, "{}", row.name);
        assert_ne!(settled.identity(), spec(row).identity());
    }
}
