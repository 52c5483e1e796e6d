//! Laws that every row of the table obeys, so that a new row is checked from the day it is added.

use std::collections::{BTreeMap, BTreeSet};

use lumbre::film::Image;
use lumbre::metrics::{Better, METRICS, MetricError, MetricRow, MetricSpec};

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

/// The scene with noise of the given amplitude; the pattern is fixed, so a larger amplitude is worse everywhere.
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
        let snake = |s: &str| s.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_');
        assert!(!row.name.is_empty() && snake(row.name), "{}", row.name);
        for text in [row.label, row.long_name, row.doc, row.options.name, row.options.doc] {
            assert!(!text.trim().is_empty(), "{} lacks a text", row.name);
        }
        for field in row.options.fields {
            assert!(snake(field.key) && !field.doc.is_empty(), "{}.{}", row.name, field.key);
        }
        assert!(row.options.fields.iter().any(|f| f.key == "on"), "{} has no tone map", row.name);
    }
}

#[test]
fn equal_images_are_perfect() {
    for row in METRICS {
        let value = spec(row).eval(&scene(), &scene()).unwrap();
        let near = value == row.perfect || (value - row.perfect).abs() < 1e-12;
        assert!(near, "{}: {value}, perfect is {}", row.name, row.perfect);
        assert_eq!(row.better == Better::Lower, row.perfect == 0.0, "{}", row.name);
    }
}

#[test]
fn more_noise_is_worse_in_the_direction_of_the_row() {
    for row in METRICS {
        let values: Vec<f64> =
            [0.01, 0.05, 0.2].iter().map(|a| spec(row).eval(&noisy(*a), &scene()).unwrap()).collect();
        let worse = |a: &f64, b: &f64| match row.better {
            Better::Lower => a < b,
            Better::Higher => a > b,
        };
        assert!(values.is_sorted_by(worse), "{}: {values:?}", row.name);
    }
}

#[test]
fn a_nan_anywhere_makes_the_value_nan() {
    let mut broken = scene();
    broken.data[100][2] = f32::NAN;
    for row in METRICS {
        assert!(spec(row).eval(&broken, &scene()).unwrap().is_nan(), "{} hides a NaN of the image", row.name);
        assert!(spec(row).eval(&scene(), &broken).unwrap().is_nan(), "{} hides a NaN of the reference", row.name);
    }
}

#[test]
fn sizes_must_agree() {
    for row in METRICS {
        let e = spec(row).eval(&Image::new(16, 12), &Image::new(12, 16)).unwrap_err();
        assert_eq!(e, MetricError::Size { image: [16, 12], reference: [12, 16] });
        assert_eq!(e.to_string(), "image is 16x12 but reference is 12x16");
    }
}
