//! Samplers: pictures of the same scene by different samplers have the same mean, and some have
//! less noise.

use std::sync::Arc;

use glam::Vec3;
use lumbre_light::film::Film;
use lumbre_light::math::stats::{normal_two_sided_p, sidak};
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::Material;
use lumbre_light::transport::integrator::{INTEGRATORS, IntegratorRow};
use lumbre_light::transport::sampler::{INDEPENDENT, SamplerRow, sampler};
use lumbre_render::Job;

use crate::common::{SceneBuilder, WHITE, grey, job, light, render};

const SEEDS: u64 = 48;
const SIZE: [u32; 2] = [8, 8];

/// Returns a room with an area light, glass and a lens: every kind of decision of a path.
fn scene() -> Arc<CompiledScene> {
    let glass = Material {
        opacity: 0.0,
        roughness: 0.0,
        ..WHITE
    };
    let mut scene = Arc::unwrap_or_clone(
        SceneBuilder::new(Vec3::new(0.0, 0.0, 0.95), Vec3::ZERO, 70.0)
            .room(1.0, grey(0.6))
            .ceiling(0.6, 0.98, light(4.0))
            .sphere(Vec3::new(0.3, -0.5, -0.2), 0.4, glass)
            .build(),
    );
    scene.camera.optics = scene.camera.optics.with_aperture(0.1);
    Arc::new(scene)
}

fn films(
    scene: &Arc<CompiledScene>,
    integrator: &'static IntegratorRow,
    sampler: &'static SamplerRow,
) -> Vec<Film> {
    let film = |seed| {
        render(
            scene,
            Job {
                integrator,
                sampler,
                ..job(SIZE, 5, seed)
            }
            .with(|settings| settings.rr_start = Some(3)),
            16,
        )
    };
    (0..SEEDS).map(film).collect()
}

/// Returns the mean and the variance of the mean of numbers, one for each film.
fn estimate(numbers: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let n = SEEDS as f64;
    let mean = numbers.clone().sum::<f64>() / n;
    (
        mean,
        numbers.map(|x| (x - mean) * (x - mean)).sum::<f64>() / (n - 1.0) / n,
    )
}

/// Returns the variance over films of a pixel's mean, averaged over all pixels.
fn spread(films: &[Film]) -> f64 {
    let pixels = films[0].sum.len();
    let of = |i: usize| {
        estimate(films.iter().map(move |f| f.sum[i][0] / f.samples as f64)).1 * SEEDS as f64
    };
    (0..pixels).map(of).sum::<f64>() / pixels as f64
}

#[test]
fn every_integrator_has_the_same_mean_with_every_sampler_and_less_noise_if_stratified() {
    let scene = scene();
    for row in INTEGRATORS {
        let independent = films(&scene, row, INDEPENDENT);
        for (name, most) in [("sobol", 0.9), ("zsobol16", 0.97)] {
            let films = films(&scene, row, sampler(name).unwrap());
            assert_less_noise(row, &independent, (name, &films), most);
        }
    }
}

/// Checks that the films of a sampler that stratifies have the mean of those of independent numbers,
/// and less than `most` of their noise.
fn assert_less_noise(
    row: &IntegratorRow,
    independent: &[Film],
    (name, films): (&str, &[Film]),
    most: f64,
) {
    // The films are independent, so their spread gives the error for any correlation within a
    // film.
    let means = |films: &[Film]| {
        let means: Vec<f64> = films.iter().map(|f| f.mean().mean()[0]).collect();
        estimate(means.into_iter())
    };
    let ((a, va), (b, vb)) = (means(independent), means(films));
    let p = normal_two_sided_p((a - b) / (va + vb).sqrt());
    assert!(
        p > sidak(0.001, 2 * INTEGRATORS.len()),
        "{} of {name}: {a} and {b}: {p}",
        row.name
    );
    let (noise, less) = (spread(independent), spread(films));
    assert!(
        less < most * noise,
        "{} of {name}: {less} instead of {noise}",
        row.name
    );
    // The error estimates of the films are right for independent samples and too large for
    // stratified ones.
    let estimated = |films: &[Film]| {
        films
            .iter()
            .map(|f| f.variance_of_mean().mean()[0])
            .sum::<f64>()
            / SEEDS as f64
    };
    assert!(
        (estimated(independent) / noise - 1.0).abs() < 0.15,
        "{} of {name}: {} {noise}",
        row.name,
        estimated(independent)
    );
    assert!(
        estimated(films) > less,
        "{} of {name}: {} {less}",
        row.name,
        estimated(films)
    );
}
