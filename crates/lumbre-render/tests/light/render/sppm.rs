//! Stochastic progressive photon mapping: its bias is the one that theory predicts, it converges to
//! the pictures of unbiased integrators, and its bits do not depend on how a run is split.
//!
//! Pixels that gather the same photons have common noise, so all errors come from the spread over
//! pictures with different seeds.

use std::f64::consts::TAU;
use std::sync::Arc;

use glam::Vec3;
use lumbre_light::film::Film;
use lumbre_light::math::stats::sidak;
use lumbre_light::math::t_test::{two_sided_p, welch_p};
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{Material, Model, Texture};
use lumbre_light::scene::desc::{ConeDesc, ConeEdge};
use lumbre_light::transport::integrator::integrator;
use lumbre_light::transport::sampler::SOBOL;
use lumbre_light::value::Value;
use lumbre_render::{Job, Renderer, cpu::renderer::CpuRenderer};

use crate::common::{SceneBuilder, WHITE, grey, job, light, render, timing};
use crate::render::agreement::{Params, params};

/// Probability that any comparison of one test fails by chance alone.
const SIGNIFICANCE: f64 = 0.001;

/// Returns a job for `sppm` with a constant radius.
pub fn sppm_job(side: u32, depth: u32, radius: f64, photons: i64, seed: u64) -> Job {
    Job {
        integrator: integrator("sppm").unwrap(),
        params: constant_radius(radius, photons),
        ..job([side; 2], depth, seed)
    }
}

fn constant_radius(radius: f64, photons: i64) -> Params {
    params(&[
        ("radius", Value::Num(radius)),
        ("photons", Value::Int(photons)),
        ("alpha", Value::Int(1)),
    ])
}

/// Means of all channels over the whole film, and over its quarters.
fn means(film: &Film) -> [f64; 5] {
    let mut sums = [0.0; 5];
    let (width, height) = (film.width as usize, film.height as usize);
    for (i, sum) in film.sum.iter().enumerate() {
        let quarter =
            2 * usize::from(i / width * 2 >= height) + usize::from(i % width * 2 >= width);
        let value = sum.iter().sum::<f64>() / (3 * film.samples) as f64 / film.sum.len() as f64;
        sums[0] += value;
        sums[1 + quarter] += 4.0 * value;
    }
    sums
}

/// Returns the means of films with different seeds.
fn spread(scene: &Arc<CompiledScene>, job: &Job, seeds: u64, samples: u64) -> Vec<[f64; 5]> {
    let film = |seed| {
        render(
            scene,
            Job {
                seed,
                ..job.clone()
            },
            samples,
        )
    };
    (0..seeds).map(|seed| means(&film(seed + 1))).collect()
}

fn column(of: &[[f64; 5]], place: usize) -> Vec<f64> {
    of.iter().map(|means| means[place]).collect()
}

fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

/// Height and radius of the lamp over the floor.
const LAMP: [f64; 2] = [0.5, 0.1];

/// A floor under an emissive sphere, seen from between the two in a square of side 0.6.
fn lamp_over_floor() -> Arc<CompiledScene> {
    let [height, radius] = LAMP.map(|x| x as f32);
    SceneBuilder::new(Vec3::Y * 0.3, Vec3::ZERO, 90.0)
        .with(|s| s.camera.up = Vec3::Z)
        .quad(
            Vec3::new(-9.0, 0.0, 9.0),
            Vec3::X * 18.0,
            Vec3::Z * -18.0,
            grey(0.5),
        )
        .sphere(Vec3::Y * height, radius, light(3.0))
        .build()
}

/// Returns the mean radiance over the square that the camera sees, with the irradiance at each
/// point averaged over a disk: `a L R^2 h / (h^2 + x^2)^(3/2)` blurred.
fn blurred_floor(radius: f64) -> f64 {
    let [h, lamp] = LAMP;
    let exact = |x: f64, y: f64| {
        let d2 = h * h + x * x + y * y;
        0.5 * 3.0 * lamp * lamp * h / (d2 * d2.sqrt())
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
fn its_bias_is_the_blur_over_the_disk_and_falls_with_the_square_of_the_radius() {
    let scene = lamp_over_floor();
    let truth = blurred_floor(0.0);
    let bias = [0.2, 0.1].map(|radius| {
        let films = spread(&scene, &sppm_job(8, 2, radius, 20_000, 1), 8, 16);
        let (mean, error) = mean_and_error(&column(&films, 0));
        assert!(
            error < 0.004 * truth,
            "radius {radius}: {error} is too noisy"
        );
        let expected = blurred_floor(radius);
        let p = two_sided_p((mean - expected) / error, 7.0);
        assert!(
            p > sidak(SIGNIFICANCE, 2),
            "radius {radius}: {mean} +- {error} instead of {expected}: {p}"
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
    // The iterations from 64 on have the radius 64^(-1/2) of the first one if alpha is 0.
    let scene = lamp_over_floor();
    let shrinking = |first_sample, samples| {
        let mut job = sppm_job(8, 2, 0.8, 20_000, 1);
        job.params.insert("alpha".to_owned(), Value::Int(0));
        job.first_sample = first_sample;
        column(&spread(&scene, &job, 8, samples), 0)
    };
    let constant = |radius| column(&spread(&scene, &sppm_job(8, 2, radius, 20_000, 1), 8, 2), 0);
    for (index, radius) in [(0, 0.8), (1, 0.8 / 2f64.sqrt()), (63, 0.1)] {
        let p = welch_p(&shrinking(index, 1), &constant(radius));
        assert!(p > sidak(SIGNIFICANCE, 3), "iteration {index}: {p}");
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
        let mut job = sppm_job(16, 2, 1.0, 1, seed);
        job.params = params(&[("photons", Value::Int(1))]);
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

/// Radius that is small beside all scenes here, in scene units.
const SMALL: f64 = 0.03;

/// Side of compared pictures in pixels.
const SIDE: u32 = 20;

/// Compares `sppm` of a small radius with an unbiased integrator, over the picture and its quarters:
/// they may differ by 2 % of the light and by noise.
fn agrees_with(name: &str, scene: &Arc<CompiledScene>, depth: u32, photons: i64) {
    let truth_job = Job {
        integrator: integrator(name).unwrap(),
        ..job([SIDE; 2], depth, 99)
    };
    let truth = spread(scene, &truth_job, 12, 96);
    let found = spread(scene, &sppm_job(SIDE, depth, SMALL, photons, 1), 12, 24);
    // Dark quarters need not be more precise than a quarter of the mean.
    let least = 0.25 * mean_and_error(&column(&truth, 0)).0;
    for place in 0..5 {
        let (found, truth) = (column(&found, place), column(&truth, place));
        assert_close(&format!("place {place}"), &found, &truth, least, 5);
    }
}

/// Panics if the means of two samples differ by more than noise and 2 % of the light, which is at
/// least `least`, as one of `tests` tests; or if noise is too large for the test to mean anything.
fn assert_close(what: &str, found: &[f64], truth: &[f64], least: f64, tests: usize) {
    let ((a, ea), (b, eb)) = (mean_and_error(found), mean_and_error(truth));
    let (error, light) = (ea.hypot(eb), b.max(least));
    let what = format!("{what}: {a} +- {ea} instead of {b} +- {eb}");
    assert!(error < 0.05 * light, "{what} is too noisy");
    let beyond = ((a - b).abs() - 0.02 * light).max(0.0);
    let p = two_sided_p(beyond / error, found.len() as f64 - 1.0);
    assert!(p > sidak(SIGNIFICANCE, tests), "{what}: {p}");
}

const GLASS: Material = Material {
    opacity: 0.0,
    ior: 1.5,
    ..WHITE
};

/// A closed box with a ball, seen from inside.
fn boxed(ball: Material) -> SceneBuilder {
    SceneBuilder::new(Vec3::new(0.0, 0.1, 0.95), Vec3::new(0.0, -0.2, 0.0), 60.0)
        .room(1.0, grey(0.6))
        .sphere(Vec3::new(0.1, -0.5, -0.2), 0.4, ball)
}

fn panel(scene: SceneBuilder) -> Arc<CompiledScene> {
    let corner = Vec3::new(-0.3, 0.98, -0.3);
    scene
        .quad(corner, Vec3::X * 0.6, Vec3::Z * 0.6, light(8.0))
        .build()
}

#[test]
fn it_agrees_on_a_diffuse_box() {
    agrees_with("nee", &panel(boxed(grey(0.5))), 5, 6000);
}

#[test]
fn it_agrees_on_caustics_of_glass_and_mirror() {
    agrees_with("bdpt", &panel(boxed(GLASS)), 6, 12_000);
    let mirror = Material {
        metallic: 1.0,
        ..WHITE
    };
    agrees_with("bdpt", &panel(boxed(mirror)), 5, 12_000);
}

#[test]
fn it_agrees_on_a_caustic_of_a_small_lamp_under_glass() {
    // The lamp is inside a ball of glass, so that no connection reaches it.
    let lamp = Vec3::new(0.2, 0.5, 0.0);
    let scene = boxed(grey(0.5)).sphere(lamp, 0.3, GLASS);
    let scene = scene.sphere(lamp, 0.12, light(40.0)).build();
    agrees_with("bdpt", &scene, 6, 12_000);
}

#[test]
fn it_agrees_on_glossy_metal_and_plastic() {
    for (metallic, roughness) in [(1.0, 0.15), (1.0, 0.5), (0.0, 0.3)] {
        let ball = Material {
            model: Model::Disney,
            metallic,
            roughness,
            ..grey(0.8)
        };
        agrees_with("nee", &panel(boxed(ball)), 5, 6000);
    }
}

/// An open stage: a floor with a ball above it.
fn stage(ball: Material) -> SceneBuilder {
    SceneBuilder::new(Vec3::new(0.0, 1.0, 2.4), Vec3::new(0.0, 0.5, 0.0), 45.0)
        .quad(
            Vec3::new(-1.5, 0.0, 1.5),
            Vec3::X * 3.0,
            Vec3::Z * -3.0,
            grey(0.6),
        )
        .sphere(Vec3::new(0.0, 0.8, 0.0), 0.5, ball)
}

/// A metal whose highlight is sampled rather than gathered.
fn polished() -> Material {
    Material {
        model: Model::Disney,
        metallic: 1.0,
        roughness: 0.3,
        ..grey(0.9)
    }
}

#[test]
fn it_agrees_under_lights_that_no_camera_path_hits() {
    let high = Vec3::new(0.5, 2.0, 1.0);
    let point = stage(GLASS).point(high, Vec3::splat(6.0)).build();
    agrees_with("bdpt", &point, 5, 20_000);
    let cone = ConeDesc {
        beam_deg: 25.0,
        cutoff_deg: 40.0,
        edge: ConeEdge::Linear,
    };
    let spot = stage(polished()).spot(high, Vec3::Y * 0.5 - high, Vec3::splat(9.0), cone);
    agrees_with("bdpt", &spot.build(), 5, 20_000);
    let sun = stage(polished()).directional(Vec3::new(-0.3, -1.0, -0.5), Vec3::splat(3.0));
    agrees_with("bdpt", &sun.build(), 5, 20_000);
}

#[test]
fn it_agrees_under_an_environment_map() {
    let texels = (0..32).map(|i| if i == 11 { [30.0; 3] } else { [0.4, 0.5, 0.7] });
    let map = Texture::new(8, 4, texels.collect::<Vec<_>>());
    let scene = stage(polished()).environment(Some(map), Vec3::ONE, 0.0);
    agrees_with("bdpt", &scene.build(), 5, 12_000);
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
    let films = spread(&scene, &sppm_job(12, edges as u32, 0.1, 20_000, 1), 8, 16);
    for place in 0..5 {
        let (mean, error) = mean_and_error(&column(&films, place));
        assert!(error < 0.006, "{error}");
        let p = two_sided_p((mean - expected) / error, 7.0);
        assert!(
            p > sidak(SIGNIFICANCE, 5),
            "place {place}: {mean} +- {error} instead of {expected}: {p}"
        );
    }
    // A convex body in an environment of constant radiance shows its albedo.
    let ball = SceneBuilder::new(Vec3::Z * 4.0, Vec3::ZERO, 10.0)
        .sphere(Vec3::ZERO, 1.0, grey(0.8))
        .environment(None, Vec3::splat(2.0), 0.0)
        .build();
    let films = spread(&ball, &sppm_job(12, 3, 0.05, 20_000, 1), 8, 16);
    let (mean, error) = mean_and_error(&column(&films, 0));
    assert!(
        error < 0.01 && (mean - 1.6).abs() < 5.0 * error,
        "{mean} +- {error}"
    );
}

/// A scene with every kind of event, of which light and camera paths need several.
fn varied() -> Arc<CompiledScene> {
    let glossy = Material {
        model: Model::Disney,
        roughness: 0.3,
        ..grey(0.6)
    };
    panel(
        boxed(GLASS)
            .sphere(Vec3::new(-0.6, -0.7, 0.2), 0.25, glossy)
            .point(Vec3::new(0.6, 0.6, 0.3), Vec3::splat(0.4))
            .environment(None, Vec3::splat(0.2), 0.0),
    )
}

/// Returns a job with the automatic radius and a number of photons that no unit of work divides.
fn split_job(threads: usize) -> Job {
    Job {
        integrator: integrator("sppm").unwrap(),
        params: params(&[("photons", Value::Int(3001))]),
        rr_start: Some(3),
        threads,
        ..job([17, 13], 5, 11)
    }
}

#[test]
fn any_number_of_threads_and_any_waves_give_the_same_bits() {
    let scene = varied();
    for sampler in [lumbre_light::transport::sampler::INDEPENDENT, SOBOL] {
        let job = |threads| Job {
            sampler,
            ..split_job(threads)
        };
        let whole = render(&scene, job(1), 4);
        assert!(whole.sum.iter().any(|s| s[0] > 0.0));
        for threads in [2, 5] {
            assert_eq!(whole, render(&scene, job(threads), 4), "{threads} threads");
        }
        for waves in [[1, 3], [2, 2], [3, 1]] {
            let mut renderer = CpuRenderer::new(Arc::clone(&scene), job(2)).unwrap();
            let mut rays = 0;
            for wave in waves {
                rays += renderer.advance(wave).unwrap().rays;
            }
            assert_eq!(&whole, renderer.film(), "waves {waves:?}");
            assert!(rays > 4 * 3001, "rays of photons are not counted: {rays}");
        }
    }
}

#[test]
fn a_checkpoint_and_ranges_of_samples_give_the_picture_of_the_whole() {
    let scene = varied();
    let open = |first_sample| {
        let job = Job {
            first_sample,
            ..split_job(2)
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
    let scene = varied();
    let films: Vec<Film> = (0..48)
        .map(|seed| {
            let mut job = sppm_job(10, 4, 0.1, 500, seed);
            job.threads = 1;
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
        let job = Job {
            layers: vec![Layer::Depth],
            ..job
        };
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
    let found = runs(&|seed| layers(sppm_job(12, 5, SMALL, 12_000, seed), 24));
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
    for depth in 1..5 {
        let of = |runs: &[Vec<f64>]| runs.iter().map(|run| run[depth]).collect::<Vec<_>>();
        assert_close(
            &format!("{} edges", depth + 1),
            &of(&found),
            &of(&truth),
            0.0,
            4,
        );
    }
}

#[test]
fn arrival_times_agree_with_bidirectional_path_tracing() {
    // The lamp is inside glass, so light paths and camera paths state lengths in different media.
    let lamp = Vec3::new(0.2, 0.68, 0.0);
    let scene = boxed(GLASS).sphere(lamp, 0.3, GLASS);
    let scene = scene.sphere(lamp, 0.15, light(40.0)).build();
    let histograms = |name: &str, job: &Job, samples| -> Vec<Vec<f64>> {
        let histogram = |seed| {
            let job = Job {
                integrator: integrator(name).unwrap(),
                timing: Some(timing(0.5, 0.7, 8)),
                seed,
                ..job.clone()
            };
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
    let found = histograms("sppm", &sppm_job(12, 5, SMALL, 6000, 1), 48);
    let truth = histograms("bdpt", &job([12; 2], 5, 1), 400);
    let slot = |of: &[Vec<f64>], slot: usize| of.iter().map(|h| h[slot]).collect::<Vec<_>>();
    let total: f64 = truth[0].iter().sum();
    let bright: Vec<usize> = (0..truth[0].len())
        .filter(|i| truth[0][*i] > 0.05 * total)
        .collect();
    assert!(bright.len() >= 4, "{:?}", truth[0]);
    for i in &bright {
        let (found, truth) = (slot(&found, *i), slot(&truth, *i));
        assert_close(&format!("slot {i}"), &found, &truth, 0.0, bright.len());
    }
}
