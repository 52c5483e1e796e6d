//! The bias of techniques that gather light over disks is the one that theory predicts.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use glam::Vec3;
use lumbre_light::math::stats::sidak;
use lumbre_light::math::t_test::{two_sided_p, welch_p};
use lumbre_light::scene::CompiledScene;
use lumbre_light::value::Value;

use crate::common::{SceneBuilder, grey, light, named_job, render};
use crate::render::agreement::{Technique, params};
use crate::render::consistent_fixtures::{
    SIGNIFICANCE, column, constant_job, label, mean_and_error, merging_alone, spread,
};

/// Height of the lamp over the floor.
const HEIGHT: f64 = 0.5;

/// Reflectance of the floor times the lamp's intensity.
const LIGHT: f64 = 0.05;

/// A floor under a point light, seen from between the two in a square of side 0.6.
fn lamp_over_floor() -> Arc<CompiledScene> {
    SceneBuilder::new(Vec3::Y * 0.3, Vec3::ZERO, 90.0)
        .with(|s| s.camera.up = Vec3::Z)
        .floor(9.0, 0.0, grey(0.5))
        .point(Vec3::Y * HEIGHT as f32, Vec3::splat(2.0 * LIGHT as f32))
        .build()
}

/// Returns the mean radiance over the square that the camera sees, with the irradiance at each
/// point averaged over a disk: `a I h / (pi (h^2 + x^2)^(3/2))` blurred.
fn blurred_floor(radius: f64) -> f64 {
    let exact = |x: f64, y: f64| {
        let d2 = HEIGHT * HEIGHT + x * x + y * y;
        LIGHT * HEIGHT / (PI * d2 * d2.sqrt())
    };
    const GRID: u32 = 24;
    let middle = |i: u32, n: u32| (f64::from(i) + 0.5) / f64::from(n);
    let mut sum = 0.0;
    for (i, j) in (0..GRID).flat_map(|j| (0..GRID).map(move |i| (i, j))) {
        let [x, y] = [i, j].map(|k| 0.6 * (middle(k, GRID) - 0.5));
        for (k, l) in (0..GRID).flat_map(|l| (0..GRID).map(move |k| (k, l))) {
            // Rings of equal area.
            let (r, angle) = (radius * middle(k, GRID).sqrt(), TAU * middle(l, GRID));
            sum += exact(x + r * angle.cos(), y + r * angle.sin());
        }
    }
    sum / f64::from(GRID).powi(4)
}

#[test]
fn the_bias_is_the_blur_over_the_disk_and_falls_with_the_square_of_the_radius() {
    for technique in &merging_alone() {
        assert_bias_is_blur(technique);
    }
}

/// Compares the bias of a technique with that of the blur, for two radii.
fn assert_bias_is_blur(technique: &Technique) {
    let scene = lamp_over_floor();
    let truth = blurred_floor(0.0);
    let bias = [0.2, 0.1].map(|radius| {
        let films = spread(
            &scene,
            &constant_job(technique, 8, 2, radius, 20_000),
            8,
            16,
        );
        let (mean, error) = mean_and_error(&column(&films, 0));
        assert!(
            error < 0.004 * truth,
            "{}, radius {radius}: {error} is too noisy",
            label(technique)
        );
        let expected = blurred_floor(radius);
        let p = two_sided_p((mean - expected) / error, 7.0);
        assert!(
            p > sidak(SIGNIFICANCE, 4),
            "{}, radius {radius}: {mean} +- {error} instead of {expected}: {p}",
            label(technique)
        );
        (mean - truth, error)
    });
    let [(wide, wide_error), (narrow, narrow_error)] = bias;
    // To first order the ratio of biases is 4; with the next term of the blur it is a little less.
    let expected = (blurred_floor(0.2) - truth) / (blurred_floor(0.1) - truth);
    assert!((3.5..4.0).contains(&expected), "{expected}");
    assert!(
        wide < -20.0 * wide_error && narrow < -5.0 * narrow_error,
        "{bias:?} of {truth}"
    );
    let slope = wide / narrow;
    let error = slope * (wide_error / wide).hypot(narrow_error / narrow);
    assert!(
        (slope - expected).abs() < 3.5 * error,
        "{slope} +- {error}, {expected}"
    );
}

#[test]
fn the_radius_follows_the_index_of_the_iteration() {
    for technique in &merging_alone() {
        assert_radius_follows_index(technique);
    }
}

/// Compares iterations of a shrinking radius with ones of a constant radius.
fn assert_radius_follows_index(technique: &Technique) {
    // The iterations from 64 on have the radius 64^(-1/2) of the first one if alpha is 0.
    let scene = lamp_over_floor();
    let shrinking = |first_sample, samples| {
        let mut job = constant_job(technique, 8, 2, 0.8, 20_000);
        job.settings
            .params
            .insert("alpha".to_owned(), Value::Int(0));
        job.first_sample = first_sample;
        column(&spread(&scene, &job, 8, samples), 0)
    };
    let constant = |radius| {
        column(
            &spread(&scene, &constant_job(technique, 8, 2, radius, 20_000), 8, 2),
            0,
        )
    };
    for (index, radius) in [(0, 0.8), (1, 0.8 / 2f64.sqrt()), (63, 0.1)] {
        let p = welch_p(&shrinking(index, 1), &constant(radius));
        assert!(
            p > sidak(SIGNIFICANCE, 6),
            "{}, iteration {index}: {p}",
            label(technique)
        );
    }
    assert!(welch_p(&shrinking(63, 1), &constant(0.8)) < 1e-6);
}

#[test]
fn the_automatic_radius_is_three_pixels() {
    // A wall at distance 2 that fills a view of 90 degrees: a pixel is 4 / 16 wide at its middle.
    let scene = SceneBuilder::new(Vec3::ZERO, Vec3::NEG_Z, 90.0)
        .quad(
            Vec3::new(-9.0, -9.0, -2.0),
            Vec3::X * 18.0,
            Vec3::Y * 18.0,
            grey(0.5),
        )
        .sphere(Vec3::new(0.0, 0.0, -1.8), 0.1, light(3.0))
        .build();
    // One photon at a time: a lit pixel and the photon are nearer than the radius. The widest pair
    // of lit pixels therefore measures the diameter.
    let mut widest = 0.0f64;
    for seed in 0..400 {
        let job = named_job("sppm", [16; 2], 2, seed)
            .with(|settings| settings.params = params(&[("photons", Value::Int(1))]));
        let film = render(&scene, job, 1);
        let direct = 0.4 * 3.0;
        let lit: Vec<[f64; 2]> = (0..256)
            .filter(|i| (0.0..direct).contains(&film.sum[*i][0]) && film.sum[*i][0] > 0.0)
            .map(|i| [(i % 16) as f64, (i / 16) as f64])
            .collect();
        for (a, b) in lit.iter().flat_map(|a| lit.iter().map(move |b| (a, b))) {
            widest = widest.max((a[0] - b[0]).hypot(a[1] - b[1]));
        }
    }
    assert!(
        (5.0..=7.5).contains(&widest),
        "the disk is {widest} pixels wide"
    );
}
