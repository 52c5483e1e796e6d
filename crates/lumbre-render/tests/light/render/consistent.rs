//! Techniques that gather light over disks converge to the pictures of unbiased integrators, and
//! their bits do not depend on how a run is split.

use std::sync::Arc;

use glam::Vec3;
use lumbre_light::film::Film;
use lumbre_light::math::stats::sidak;
use lumbre_light::math::t_test::two_sided_p;
use lumbre_light::scene::compile::{MaskMode, Material, Model, Texture};
use lumbre_light::scene::desc::{CameraKind, ConeDesc, ConeEdge};
use lumbre_light::transport::integrator::integrator;
use lumbre_light::transport::sampler::{INDEPENDENT, SOBOL, SamplerRow};
use lumbre_light::value::Value;
use lumbre_render::{Job, Renderer, cpu::renderer::CpuRenderer};

use crate::common::{SceneBuilder, WHITE, grey, job, light, named_job, render, timing};
use crate::render::agreement::Technique;
use crate::render::consistent_fixtures::{
    GLASS, SIDE, SIGNIFICANCE, SMALL, agree_with, assert_close, boxed, column, constant_job, label,
    mean_and_error, panel, polished, spread, stage, techniques, varied,
};

#[test]
fn they_agree_on_a_diffuse_box() {
    agree_with("nee", &panel(boxed(grey(0.5))), 5, 6000);
}

#[test]
fn they_agree_in_pictures_of_orthographic_and_spherical_cameras() {
    for kind in [CameraKind::Orthographic, CameraKind::Spherical] {
        let mut scene = Arc::unwrap_or_clone(panel(boxed(grey(0.5))));
        (scene.camera.kind, scene.camera.view_height) = (kind, 1.5);
        agree_with("nee", &Arc::new(scene), 5, 3000);
    }
}

#[test]
fn they_agree_on_caustics_of_glass_and_mirror() {
    agree_with("bdpt", &panel(boxed(GLASS)), 6, 6000);
    let mirror = Material {
        metallic: 1.0,
        ..WHITE
    };
    agree_with("bdpt", &panel(boxed(mirror)), 5, 6000);
}

#[test]
fn they_agree_on_a_caustic_of_a_small_lamp_under_glass() {
    // The lamp is inside a ball of glass, so that no connection reaches it.
    let lamp = Vec3::new(0.2, 0.5, 0.0);
    let scene = boxed(grey(0.5)).sphere(lamp, 0.3, GLASS);
    let scene = scene.sphere(lamp, 0.12, light(40.0)).build();
    agree_with("bdpt", &scene, 6, 6000);
}

#[test]
fn they_agree_on_glossy_metal_and_plastic() {
    for (metallic, roughness) in [(1.0, 0.15), (1.0, 0.5), (0.0, 0.3)] {
        let ball = Material {
            model: Model::Disney,
            metallic,
            roughness,
            ..grey(0.8)
        };
        agree_with("nee", &panel(boxed(ball)), 5, 3000);
    }
}

#[test]
fn they_agree_on_masks_with_values_between_0_and_1() {
    let mut scene = stage(WHITE);
    let faint = |scene: &mut SceneBuilder, value: f32| Material {
        mask_texture: scene.texture(Texture::new(1, 1, vec![[value; 3]])),
        mask_mode: MaskMode::Blend,
        ..grey(0.8)
    };
    // A sheet over the floor, and a ball, whose mask decides at both crossings.
    let (sheet, ball) = (faint(&mut scene, 0.25), faint(&mut scene, 0.6));
    let corner = Vec3::new(-1.5, 0.3, 1.5);
    let scene = scene
        .quad(corner, Vec3::X * 3.0, Vec3::Z * -3.0, sheet)
        .sphere(Vec3::new(0.9, 0.8, 0.2), 0.4, ball)
        .ceiling(0.5, 2.0, light(8.0))
        .build();
    let truth_job = named_job("nee", [SIDE; 2], 4, 99);
    let truth = spread(&scene, &truth_job, 12, 96);
    let least = 0.25 * mean_and_error(&column(&truth, 0)).0;
    for technique in techniques() {
        let found = spread(
            &scene,
            &constant_job(&technique, SIDE, 4, SMALL, 12_000),
            12,
            24,
        );
        for place in 0..5 {
            let (found, truth) = (column(&found, place), column(&truth, place));
            let what = format!("{}, place {place}", label(&technique));
            assert_close(&what, &found, &truth, least, 5 * techniques().len());
        }
    }
}

#[test]
fn they_agree_under_lights_that_no_camera_path_hits() {
    let high = Vec3::new(0.5, 2.0, 1.0);
    let point = stage(GLASS).point(high, Vec3::splat(6.0)).build();
    agree_with("bdpt", &point, 5, 10_000);
    let cone = ConeDesc {
        beam_deg: 25.0,
        cutoff_deg: 40.0,
        edge: ConeEdge::Linear,
    };
    let spot = stage(polished()).spot(high, Vec3::Y * 0.5 - high, Vec3::splat(9.0), cone);
    agree_with("bdpt", &spot.build(), 5, 10_000);
    let sun = stage(polished()).directional(Vec3::new(-0.3, -1.0, -0.5), Vec3::splat(3.0));
    agree_with("bdpt", &sun.build(), 5, 10_000);
}

#[test]
fn they_agree_under_an_environment_map() {
    let texels = (0..32).map(|i| if i == 11 { [30.0; 3] } else { [0.4, 0.5, 0.7] });
    let map = Texture::new(8, 4, texels.collect::<Vec<_>>());
    let scene = stage(polished()).environment(Some(map), Vec3::ONE, 0.0);
    agree_with("bdpt", &scene.build(), 5, 12_000);
}

#[test]
fn a_furnace_has_the_radiance_of_its_series() {
    // Corners lose the part of a disk that lies beyond the edge; the camera looks at one wall.
    let (albedo, emitted, edges) = (0.7, 0.5, 4);
    let walls = Material {
        emission: Vec3::splat(emitted),
        ..grey(albedo)
    };
    let scene = SceneBuilder::new(Vec3::ZERO, Vec3::X, 40.0)
        .room(1.0, walls)
        .build();
    let [a, e] = [albedo, emitted].map(f64::from);
    let expected = e * (1.0 - a.powi(edges)) / (1.0 - a);
    for technique in techniques() {
        let job = constant_job(&technique, 12, edges as u32, 0.1, 20_000);
        let films = spread(&scene, &job, 8, 16);
        for place in 0..5 {
            let (mean, error) = mean_and_error(&column(&films, place));
            assert!(error < 0.01, "{}: {error}", label(&technique));
            let p = two_sided_p((mean - expected) / error, 7.0);
            assert!(
                p > sidak(SIGNIFICANCE, 5 * techniques().len()),
                "{}, place {place}: {mean} +- {error} instead of {expected}: {p}",
                label(&technique)
            );
        }
    }
    // A convex body in an environment of constant radiance shows its albedo.
    let ball = SceneBuilder::new(Vec3::Z * 4.0, Vec3::ZERO, 10.0)
        .sphere(Vec3::ZERO, 1.0, grey(0.8))
        .environment(None, Vec3::splat(2.0), 0.0)
        .build();
    for technique in techniques() {
        let job = constant_job(&technique, 12, 3, 0.05, 20_000);
        let films = spread(&ball, &job, 8, 16);
        let (mean, error) = mean_and_error(&column(&films, 0));
        assert!(
            error < 0.01 && (mean - 1.6).abs() < 5.0 * error,
            "{}: {mean} +- {error}",
            label(&technique)
        );
    }
}

/// Returns a job with the automatic radius and a number of photons that no unit of work divides.
fn split_job((row, params): &Technique, threads: usize) -> Job {
    let photons = ("photons".to_owned(), Value::Int(3001));
    Job {
        integrator: row,
        threads,
        ..job([17, 13], 5, 11)
    }
    .with(|settings| {
        settings.params = params.clone().into_iter().chain([photons]).collect();
        settings.rr_start = Some(3);
    })
}

#[test]
fn any_number_of_threads_and_any_waves_give_the_same_bits() {
    for technique in &techniques() {
        for sampler in [INDEPENDENT, SOBOL] {
            let rays = assert_same_bits(technique, sampler);
            assert!(rays > 4 * 3001, "rays of photons are not counted: {rays}");
        }
    }
}

/// Compares a technique on one thread with other numbers of threads, and with other waves. Returns
/// the number of rays of four samples.
pub fn assert_same_bits(technique: &Technique, sampler: &'static SamplerRow) -> u64 {
    let scene = varied();
    let job = |threads| Job {
        sampler,
        ..split_job(technique, threads)
    };
    let whole = render(&scene, job(1), 4);
    assert!(whole.sum.iter().any(|s| s[0] > 0.0));
    for threads in [2, 7] {
        assert_eq!(whole, render(&scene, job(threads), 4), "{threads} threads");
    }
    let rays = [[1, 3], [2, 2], [3, 1]].map(|waves| {
        let mut renderer = CpuRenderer::new(Arc::clone(&scene), job(2)).unwrap();
        let rays = waves.map(|wave| renderer.advance(wave).unwrap().rays);
        assert_eq!(&whole, renderer.film(), "waves {waves:?}");
        rays.iter().sum()
    });
    assert!(rays.iter().all(|n| *n == rays[0]), "{rays:?} rays");
    rays[0]
}

#[test]
fn a_checkpoint_and_ranges_of_samples_give_the_picture_of_the_whole() {
    for technique in &techniques() {
        assert_splits(technique);
    }
}

/// Compares a run with one that is restored from a checkpoint, and with two ranges of samples.
pub fn assert_splits(technique: &Technique) {
    let scene = varied();
    let open = |first_sample| {
        let job = Job {
            first_sample,
            ..split_job(technique, 2)
        };
        CpuRenderer::new(Arc::clone(&scene), job).unwrap()
    };
    let mut whole = open(0);
    whole.advance(5).unwrap();
    let (mut before, mut after) = (open(0), open(0));
    before.advance(2).unwrap();
    let mut state = Vec::new();
    assert!(before.save(&mut state).unwrap());
    after.restore(&state).unwrap();
    after.advance(3).unwrap();
    assert_eq!(after.film(), whole.film());
    let mut rest = open(2);
    rest.advance(3).unwrap();
    let parts = [before.film(), rest.film()].map(|film| film.sum.as_flattened());
    for (i, expected) in whole.film().sum.as_flattened().iter().enumerate() {
        let sum = parts[0][i] + parts[1][i];
        assert!(
            (sum - expected).abs() <= 1e-12 * expected.abs(),
            "{sum} {expected}"
        );
    }
    let mut again = open(0);
    again.advance(3).unwrap();
    assert_ne!(
        again.film().sum,
        rest.film().sum,
        "ranges repeat the same iterations"
    );
}

#[test]
fn iterations_are_independent_and_errors_of_pixels_are_right() {
    for technique in &techniques() {
        assert_errors_are_right(technique);
    }
}

/// Compares the spread of pixels over pictures with the errors that each picture estimates.
fn assert_errors_are_right(technique: &Technique) {
    let scene = varied();
    let films: Vec<Film> = (0..48)
        .map(|seed| {
            let job = Job {
                seed,
                threads: 1,
                ..constant_job(technique, 10, 4, 0.1, 500)
            };
            render(&scene, job, 16)
        })
        .collect();
    let n = films.len() as f64;
    let (mut between, mut within) = (0.0, 0.0);
    for pixel in 0..100 {
        let values: Vec<f64> = films.iter().map(|f| f.sum[pixel][1] / 16.0).collect();
        between += mean_and_error(&values).1.powi(2) * n;
    }
    for film in &films {
        let variance = film.variance_of_mean();
        within += variance.data.iter().map(|p| f64::from(p[1])).sum::<f64>() / n;
    }
    let ratio = within / between;
    assert!((ratio - 1.0).abs() < 0.12, "{within} instead of {between}");
}

#[test]
fn light_by_depth_agrees_with_bidirectional_path_tracing() {
    use lumbre_light::film::layer::Layer;
    let scene = panel(boxed(GLASS));
    let layers = |job: Job, samples| {
        let job = job.with(|settings| settings.films = vec![Layer::Depth]);
        let mut renderer = CpuRenderer::new(Arc::clone(&scene), job).unwrap();
        assert_eq!(renderer.advance(samples).unwrap().invalid, 0);
        let films: Vec<Film> = (0..5).map(|k| renderer.layer(k).unwrap()).collect();
        let whole = renderer.film().mean().mean()[1];
        let depths = films.iter().map(|f| f.mean().mean()[1]).collect::<Vec<_>>();
        let sum: f64 = depths.iter().sum();
        assert!((sum / whole - 1.0).abs() < 1e-5, "{sum} {whole}");
        depths
    };
    let bdpt = integrator("bdpt").unwrap();
    let runs = |of: &dyn Fn(u64) -> Vec<f64>| (1..=10).map(of).collect::<Vec<_>>();
    let truth = runs(&|seed| {
        let job = job([12; 2], 5, seed);
        layers(
            Job {
                integrator: bdpt,
                ..job
            },
            256,
        )
    });
    for technique in techniques() {
        let job = constant_job(&technique, 12, 5, SMALL, 12_000);
        let found = runs(&|seed| {
            layers(
                Job {
                    seed,
                    ..job.clone()
                },
                24,
            )
        });
        for depth in 1..5 {
            let of = |runs: &[Vec<f64>]| runs.iter().map(|run| run[depth]).collect::<Vec<_>>();
            let what = format!("{}, {} edges", label(&technique), depth + 1);
            assert_close(&what, &of(&found), &of(&truth), 0.0, 12);
        }
    }
}

#[test]
fn arrival_times_agree_with_bidirectional_path_tracing() {
    // The lamp is inside glass, so light paths and camera paths state lengths in different media.
    let lamp = Vec3::new(0.2, 0.68, 0.0);
    let scene = boxed(GLASS).sphere(lamp, 0.3, GLASS);
    let scene = scene.sphere(lamp, 0.15, light(40.0)).build();
    let histograms = |job: &Job, samples| -> Vec<Vec<f64>> {
        let histogram = |seed| {
            let job = Job {
                seed,
                ..job.clone()
            }
            .with(|settings| settings.timing = Some(timing(0.5, 0.7, 8)));
            let mut renderer = CpuRenderer::new(Arc::clone(&scene), job).unwrap();
            assert_eq!(renderer.advance(samples).unwrap().invalid, 0);
            let cube = renderer.times().unwrap();
            let mut sums = vec![0.0; cube.axis.slots()];
            for (i, sum) in cube.sum.iter().enumerate() {
                sums[i % cube.axis.slots()] += sum[1] / samples as f64;
            }
            sums
        };
        (1..=12).map(histogram).collect()
    };
    let bdpt = integrator("bdpt").unwrap();
    let truth = histograms(
        &Job {
            integrator: bdpt,
            ..job([12; 2], 5, 1)
        },
        400,
    );
    let slot = |of: &[Vec<f64>], slot: usize| of.iter().map(|h| h[slot]).collect::<Vec<_>>();
    let total: f64 = truth[0].iter().sum();
    let bright: Vec<usize> = (0..truth[0].len())
        .filter(|i| truth[0][*i] > 0.05 * total)
        .collect();
    assert!(bright.len() >= 4, "{:?}", truth[0]);
    for technique in techniques() {
        let found = histograms(&constant_job(&technique, 12, 5, SMALL, 6000), 48);
        for i in &bright {
            let (found, truth) = (slot(&found, *i), slot(&truth, *i));
            let what = format!("{}, slot {i}", label(&technique));
            assert_close(&what, &found, &truth, 0.0, 3 * bright.len());
        }
    }
}
