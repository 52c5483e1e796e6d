//! Films: splats of integrators that are written for these tests.

use std::sync::Arc;

use glam::Vec3;
use lumbre_light::film::Film;
use lumbre_light::film::fixed_point::MAX_SPLAT;
use lumbre_light::scene::CompiledScene;
use lumbre_light::transport::contribution::Contribution;
use lumbre_light::transport::integrator::{Context, IntegratorRow, integrator};
use lumbre_light::transport::sampler::Sampler;
use lumbre_render::cpu::renderer::CpuRenderer;
use lumbre_render::{Job, Renderer, WaveStats};

use crate::common::{SceneBuilder, job};

pub const SIZE: [u32; 2] = [23, 11];

/// Contributes light to the sample's own pixel and three splats of very different sizes to random
/// pixels.
pub fn scatter(
    _: &Context,
    pixel: [u32; 2],
    sampler: &mut Sampler,
    sink: &mut dyn FnMut(Contribution),
) {
    let own = Vec3::new(sampler.next_1d(), 0.5, 2.0);
    sink(Contribution {
        pixel,
        value: own,
        unweighted: own * 2.0,
        s: 0,
        t: 2,
        length: 0.0,
    });
    for (i, size) in [1e-6, 1.0, 3000.0].into_iter().enumerate() {
        let [u, v] = sampler.next_2d();
        let at = [(u * SIZE[0] as f32) as u32, (v * SIZE[1] as f32) as u32];
        let value = Vec3::new(1.0, u, v) * size;
        sink(Contribution {
            pixel: at,
            value,
            unweighted: value * 3.0,
            s: 1 + i as u32,
            t: 1,
            length: 0.0,
        });
    }
}

/// Contributes one invalid value of each kind from every sample of pixel (4, 5).
pub fn invalid_splats(
    _: &Context,
    pixel: [u32; 2],
    sampler: &mut Sampler,
    sink: &mut dyn FnMut(Contribution),
) {
    let good = Vec3::splat(sampler.next_1d());
    sink(Contribution {
        pixel,
        value: good,
        unweighted: good,
        s: 0,
        t: 2,
        length: 0.0,
    });
    if pixel == [4, 5] {
        for bad in [f32::NAN, f32::INFINITY, 2.0 * MAX_SPLAT] {
            let value = Vec3::new(0.0, bad, 0.0);
            sink(Contribution {
                pixel: [0, 0],
                value,
                unweighted: value,
                s: 1,
                t: 1,
                length: 0.0,
            });
        }
        sink(Contribution {
            pixel: SIZE,
            value: good,
            unweighted: good,
            s: 1,
            t: 1,
            length: 0.0,
        });
    }
}

/// Returns an integrator with this sample function.
pub fn test_integrator(
    sample: lumbre_light::transport::integrator::SampleFn,
) -> &'static IntegratorRow {
    let bpt = integrator("bpt").unwrap();
    Box::leak(Box::new(IntegratorRow {
        name: "test",
        sample,
        ..*bpt
    }))
}

/// Returns a job of an integrator of these tests.
pub fn test_job(integrator: &'static IntegratorRow, threads: usize) -> Job {
    Job {
        integrator,
        threads,
        ..job(SIZE, 5, 3)
    }
}

/// Returns a scene without surfaces and lights.
pub fn empty_scene() -> Arc<CompiledScene> {
    SceneBuilder::new(Vec3::Z, Vec3::ZERO, 40.0).build()
}

/// Renders waves of these numbers of samples on the empty scene.
pub fn run(job: Job, waves: &[u64]) -> (Film, Vec<WaveStats>) {
    let mut renderer = CpuRenderer::new(empty_scene(), job).unwrap();
    let stats = waves
        .iter()
        .map(|n| renderer.advance(*n).unwrap())
        .collect();
    (renderer.film().clone(), stats)
}

#[test]
fn splats_have_the_same_bits_for_any_threads_and_waves() {
    let row = test_integrator(scatter);
    let (whole, _) = run(test_job(row, 1), &[21]);
    for (threads, waves) in [
        (2, &[21][..]),
        (5, &[21]),
        (1, &[1, 2, 4, 8, 6]),
        (3, &[20, 1]),
        (2, &[7, 7, 7]),
    ] {
        assert_eq!(
            whole,
            run(test_job(row, threads), waves).0,
            "{threads} threads, waves {waves:?}"
        );
    }
}

#[test]
fn the_sum_of_splats_is_the_sum_of_all_contributions() {
    let (film, stats) = run(test_job(test_integrator(scatter), 0), &[40]);
    assert_eq!(stats[0].invalid, 0);
    assert_eq!(film.samples, 40);
    let mut expected = [0.0f64; 3];
    for y in 0..SIZE[1] {
        for x in 0..SIZE[0] {
            for sample in 0..40 {
                let mut s = Sampler::new(3, [x, y], sample);
                let mut values = vec![Vec3::new(s.next_1d(), 0.5, 2.0)];
                for size in [1e-6, 1.0, 3000.0] {
                    let [u, v] = s.next_2d();
                    values.push(Vec3::new(1.0, u, v) * size);
                }
                for v in values {
                    for c in 0..3 {
                        expected[c] += f64::from(v[c]);
                    }
                }
            }
        }
    }
    for c in 0..3 {
        let sum: f64 = film.sum.iter().map(|s| s[c]).sum();
        assert!(
            (sum / expected[c] - 1.0).abs() < 1e-11,
            "{sum} instead of {}",
            expected[c]
        );
    }
}

#[test]
fn the_variance_estimate_of_splats_is_the_variance_over_seeds() {
    // The variance over films of different seeds is what each film estimates.
    let row = test_integrator(scatter);
    let runs = 60u64;
    let films: Vec<Film> = (0..runs)
        .map(|seed| {
            run(
                Job {
                    seed,
                    ..test_job(row, 0)
                },
                &[16],
            )
            .0
        })
        .collect();
    let means: Vec<f64> = films
        .iter()
        .flat_map(|f| f.mean().data)
        .map(|p| f64::from(p[0]))
        .collect();
    let n = means.len() as f64;
    let mean = means.iter().sum::<f64>() / n;
    let spread = means.iter().map(|m| (m - mean) * (m - mean)).sum::<f64>() / n;
    let estimated = films
        .iter()
        .flat_map(|f| f.variance_of_mean().data)
        .map(|p| f64::from(p[0]))
        .sum::<f64>()
        / n;
    // 15,180 nearly independent pixels: the relative error of the variance is about 2 %.
    assert!(
        (spread / estimated - 1.0).abs() < 0.06,
        "{spread} {estimated}"
    );
}

#[test]
fn standardised_errors_of_splats_have_unit_variance() {
    let row = test_integrator(scatter);
    let films: Vec<Film> = (0..20)
        .map(|seed| {
            run(
                Job {
                    seed,
                    ..test_job(row, 0)
                },
                &[256],
            )
            .0
        })
        .collect();
    let mut squares = Vec::new();
    for film in films {
        for (mean, variance) in film.mean().data.iter().zip(film.variance_of_mean().data) {
            // On average a sample contributes 1/2 to its own pixel, and one splat of each size
            // lands on every pixel.
            let expected = 0.5 + 3_001.000_001;
            let deviate = (f64::from(mean[0]) - expected) / f64::from(variance[0]).sqrt();
            squares.push(deviate * deviate);
        }
    }
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    // 5060 squares of variance 2, and a little more since the variances are estimates from 256
    // splats on a pixel.
    assert!((mean - 1.0).abs() < 0.1, "{mean}");
}

#[test]
fn invalid_splats_are_reported_and_do_not_change_the_film() {
    let (film, stats) = run(test_job(test_integrator(invalid_splats), 0), &[2, 3]);
    assert_eq!(
        (stats[0].invalid, stats[0].first_invalid),
        (8, Some([4, 5, 0]))
    );
    assert_eq!(
        (stats[1].invalid, stats[1].first_invalid),
        (12, Some([4, 5, 2]))
    );
    let all = film.sum.iter().flatten().chain(film.sum2.iter().flatten());
    assert!(all.into_iter().all(|x| x.is_finite() && *x <= 5.0));
}
