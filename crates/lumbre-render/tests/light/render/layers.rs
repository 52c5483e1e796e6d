//! Layers: films that add up to the picture, strategies that agree, and first-hit data.

use std::sync::Arc;

use glam::Vec3;
use lumbre_light::film::layer::{LAYERS, Layer, LayerFilm, PathSubset};
use lumbre_light::film::ztest::{Estimate, compare};
use lumbre_light::film::{Film, Image};
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::Material;
use lumbre_light::transport::contribution::Contribution;
use lumbre_light::transport::integrator::{Context, SampleFn};
use lumbre_light::transport::sampler::Sampler;
use lumbre_render::cpu::renderer::CpuRenderer;
use lumbre_render::{Job, RenderError, Renderer};

use crate::common::{SceneBuilder, WHITE, grey, job, light, named_job};
use crate::render::film::{empty_scene, invalid_splats, scatter, test_integrator, test_job};

/// Layers that sum to the film.
const LIGHT: [Layer; 2] = [Layer::Depth, Layer::Strategies];

fn all() -> Vec<Layer> {
    LAYERS.iter().map(|row| row.layer).collect()
}

/// Returns a renderer after some waves.
fn render_waves(scene: &Arc<CompiledScene>, job: Job, waves: &[u64]) -> CpuRenderer {
    let mut renderer = CpuRenderer::new(Arc::clone(scene), job).unwrap();
    waves
        .iter()
        .for_each(|n| assert!(renderer.advance(*n).is_ok()));
    renderer
}

/// Returns a job with layers.
fn layered_job(name: &str, layers: &[Layer], depth: u32, seed: u64) -> Job {
    named_job(name, [12; 2], depth, seed).with(|settings| settings.films = layers.to_vec())
}

/// Returns every film with its sums.
fn films(renderer: &CpuRenderer) -> Vec<(LayerFilm, Film)> {
    let films = renderer.layers().iter().enumerate();
    films
        .map(|(i, film)| (*film, renderer.layer(i).unwrap()))
        .collect()
}

/// Returns the sum of the films for which `wanted` holds.
fn total(films: &[(LayerFilm, Film)], wanted: impl Fn(&LayerFilm) -> bool) -> Vec<[f64; 3]> {
    let mut total = vec![[0.0; 3]; films[0].1.sum.len()];
    for (_, film) in films.iter().filter(|(film, _)| wanted(film)) {
        for (total, sum) in total.iter_mut().zip(&film.sum) {
            (0..3).for_each(|c| total[c] += sum[c]);
        }
    }
    total
}

/// Panics unless films by depth and weighted films by strategy each add up to the picture, to the
/// rounding of `f32` sums.
fn assert_layers_sum_to_the_film(renderer: &CpuRenderer) {
    let films = films(renderer);
    let by_depth = total(&films, |film| film.layer == Layer::Depth);
    let by_strategy = total(&films, |film| {
        matches!(film.subset, PathSubset::Strategy { weighted: true, .. })
    });
    let film = renderer.film();
    assert!(film.sum.iter().any(|s| s[0] > 0.0), "the film is black");
    for sums in [by_depth, by_strategy] {
        for (sum, whole) in sums.as_flattened().iter().zip(film.sum.as_flattened()) {
            assert!(
                (sum - whole).abs() <= 1e-6 * whole.abs(),
                "{sum} instead of {whole}"
            );
        }
    }
}

/// Returns diffuse surfaces that do not touch, so that no connection is very short, under a light.
fn open_room() -> SceneBuilder {
    let red = Material {
        base_color: Vec3::new(0.9, 0.4, 0.3),
        ..WHITE
    };
    SceneBuilder::new(Vec3::new(0.2, 1.2, 3.5), Vec3::new(0.0, 0.7, 0.0), 50.0)
        .quad(
            Vec3::new(-2.0, 0.0, 2.0),
            Vec3::X * 4.0,
            Vec3::Z * -3.0,
            grey(0.8),
        )
        .quad(
            Vec3::new(-2.0, 0.5, -1.8),
            Vec3::X * 4.0,
            Vec3::Y * 2.5,
            red,
        )
        .ceiling(0.8, 2.4, light(4.0))
}

#[test]
fn layers_by_depth_and_by_strategy_sum_to_the_film() {
    let glass = Material {
        opacity: 0.0,
        ..WHITE
    };
    let mirror = Material {
        metallic: 1.0,
        base_color: Vec3::splat(0.9),
        ..WHITE
    };
    let scene = open_room()
        .sphere(Vec3::new(-0.6, 0.6, 0.3), 0.4, glass)
        .sphere(Vec3::new(0.7, 0.6, 0.3), 0.4, mirror)
        .build();
    for name in ["bpt", "nee", "bdpt"] {
        let plain = render_waves(&scene, layered_job(name, &[], 5, 7), &[8]);
        let renderer = render_waves(
            &scene,
            layered_job(name, &[LIGHT[0], LIGHT[1], Layer::Bounces], 5, 7),
            &[3, 5],
        );
        assert_eq!(
            renderer.film(),
            plain.film(),
            "{name}: layers change the film"
        );
        assert!(plain.layers().is_empty() && plain.layer(0).is_err());
        assert_layers_sum_to_the_film(&renderer);
        let films = films(&renderer);
        let (_, bounces) = films
            .iter()
            .find(|(film, _)| film.layer == Layer::Bounces)
            .unwrap();
        for (pixel, [weighted, weight, _]) in bounces.sum.iter().enumerate() {
            let (mut moment, mut light) = (0.0, 0.0);
            for (film, sums) in &films {
                let PathSubset::Depth(k) = film.subset else {
                    continue;
                };
                let [r, g, b] = sums.sum[pixel];
                let luminance = 0.2126 * r + 0.7152 * g + 0.0722 * b;
                (moment, light) = (moment + f64::from(k - 1) * luminance, light + luminance);
            }
            assert!(
                (weighted - moment).abs() <= 1e-5 * moment
                    && (weight - light).abs() <= 1e-5 * light
            );
        }
    }
}

#[test]
fn layers_of_splats_sum_to_the_film_with_the_same_bits_for_any_threads_and_waves() {
    let scene = empty_scene();
    let row = test_integrator(scatter);
    let with = |threads| test_job(row, threads).with(|settings| settings.films = all());
    let whole = render_waves(&scene, with(1), &[21]);
    assert_layers_sum_to_the_film(&whole);
    let expected = films(&whole);
    let splatted = expected
        .iter()
        .find(|(film, _)| film.name() == "strategies-s2-t1-raw")
        .unwrap();
    assert!(splatted.1.sum.iter().any(|s| s[0] > 0.0));
    for (threads, waves) in [
        (2, &[21][..]),
        (4, &[21]),
        (1, &[1, 2, 4, 8, 6]),
        (3, &[7, 7, 7]),
    ] {
        assert!(
            expected == films(&render_waves(&scene, with(threads), waves)),
            "{threads} threads, waves {waves:?}"
        );
    }
}

/// Contributes light of one edge, and light of two edges that is NaN in a corner of the picture.
fn invalid_in_a_corner(
    _: &Context,
    pixel: [u32; 2],
    _: &mut Sampler,
    sink: &mut dyn FnMut(Contribution),
) {
    for (t, value) in [
        (2, 1.0),
        (
            3,
            if pixel[0] < 5 && pixel[1] < 5 {
                f32::NAN
            } else {
                2.0
            },
        ),
    ] {
        let value = Vec3::splat(value);
        sink(Contribution {
            pixel,
            value,
            unweighted: value,
            s: 0,
            t,
            length: 0.0,
        });
    }
}

#[test]
fn values_that_the_film_rejects_are_rejected_by_every_layer() {
    for sample in [invalid_splats as SampleFn, invalid_in_a_corner] {
        let renderer = render_waves(
            &empty_scene(),
            test_job(test_integrator(sample), 0).with(|settings| settings.films = LIGHT.to_vec()),
            &[5],
        );
        assert_layers_sum_to_the_film(&renderer);
        for (film, sums) in films(&renderer) {
            assert!(
                sums.sum
                    .as_flattened()
                    .iter()
                    .all(|x| x.is_finite() && *x <= 10.0),
                "{}",
                film.name()
            );
        }
    }
}

#[test]
fn every_strategy_of_a_diffuse_scene_finds_all_the_light_of_its_depth() {
    let scene = open_room().build();
    let truth = films(&render_waves(
        &scene,
        layered_job("bpt", &[Layer::Depth], 4, 1),
        &[12_000],
    ));
    let found = films(&render_waves(
        &scene,
        layered_job("bdpt", &[Layer::Strategies], 4, 2),
        &[3000],
    ));
    let images = |film: &Film| -> (Image, Image) { (film.mean(), film.variance_of_mean()) };
    let raw: Vec<_> = found
        .iter()
        .filter_map(|(film, sums)| match film.subset {
            // The light is outside the view, so paths of one edge contribute nothing.
            PathSubset::Strategy {
                s,
                t,
                weighted: false,
            } if s + t >= 3 => Some((s, t, sums)),
            _ => None,
        })
        .collect();
    assert_eq!(raw.len(), 3 + 4 + 5);
    let mut failures = Vec::new();
    for (s, t, sums) in &raw {
        let depth = &truth
            .iter()
            .find(|(film, _)| film.subset == PathSubset::Depth(s + t - 1))
            .unwrap()
            .1;
        let ((mean, variance), (depth_mean, depth_variance)) = (images(sums), images(depth));
        let first = Estimate {
            mean: &mean,
            variance: &variance,
        };
        let test = compare(
            first,
            Estimate {
                mean: &depth_mean,
                variance: &depth_variance,
            },
            4,
            0.02,
        );
        assert!(test.comparisons >= 9, "too few comparisons: {test:?}");
        if !test.agrees(0.001, raw.len()) {
            failures.push(format!("s = {s}, t = {t}: {test:?}"));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn depth_layers_of_a_furnace_are_a_geometric_series() {
    // Every wall emits 0.5 and reflects half: paths of k edges contribute 0.5^k, without noise.
    let wall = Material {
        emission: Vec3::splat(0.5),
        emitter_reflects: true,
        ..grey(0.5)
    };
    let scene = SceneBuilder::new(Vec3::new(0.0, 0.0, 0.3), Vec3::ZERO, 60.0)
        .room(1.0, wall)
        .build();
    let films = films(&render_waves(
        &scene,
        layered_job("bpt", &all(), 4, 3),
        &[16],
    ));
    let image = |name: &str| {
        let (film, sums) = films.iter().find(|(film, _)| film.name() == name).unwrap();
        film.image(sums)
    };
    let near = |image: &Image, expected: [f32; 3]| {
        for p in &image.data {
            assert!(
                (0..3).all(|c| (p[c] - expected[c]).abs() < 1e-5),
                "{p:?} instead of {expected:?}"
            );
        }
    };
    for k in 1..=4 {
        near(&image(&format!("depth-{k}")), [0.5f32.powi(k); 3]);
        near(
            &image(&format!("strategies-s0-t{}-raw", k + 1)),
            [0.5f32.powi(k); 3],
        );
    }
    // Mean number of bounces: (0 * 1/2 + 1 * 1/4 + 2 * 1/8 + 3 * 1/16) / (15/16).
    near(&image("bounces"), [0.6875 / 0.9375, 0.9375, 0.0]);
    near(&image("rays"), [4.0; 3]);
    near(&image("albedo"), [0.5; 3]);
}

#[test]
fn first_hit_layers_hold_albedo_normal_and_distance() {
    // A square, seen from behind at distance 2, that fills the left half of the picture.
    let ochre = Material {
        base_color: Vec3::new(0.6, 0.4, 0.1),
        ..WHITE
    };
    let scene = SceneBuilder::new(Vec3::new(0.0, 0.0, 2.0), Vec3::ZERO, 40.0)
        .quad(
            Vec3::new(-5.0, -5.0, 0.0),
            Vec3::Y * 10.0,
            Vec3::X * 5.0,
            ochre,
        )
        .build();
    let job = job([12; 2], 3, 4)
        .with(|settings| settings.films = vec![Layer::Distance, Layer::Normal, Layer::Albedo]);
    let renderer = render_waves(&scene, job, &[64]);
    let images: Vec<Image> = films(&renderer)
        .iter()
        .map(|(film, sums)| film.image(sums))
        .collect();
    let [albedo, normal, distance] = images.as_slice() else {
        panic!("{} films", images.len())
    };
    for (x, y) in (0..12).flat_map(|y| (0..12).map(move |x| (x, y))) {
        if x < 6 {
            assert!((0..3).all(|c| (albedo.at(x, y)[c] - [0.6, 0.4, 0.1][c]).abs() < 1e-6));
            assert!(
                (0..3).all(|c| (normal.at(x, y)[c] - [0.0, 0.0, 1.0][c]).abs() < 1e-6),
                "the normal does not face the camera"
            );
            let [u, v] = [x, y].map(|i| (i as f32 - 5.5) / 6.0 * 20f32.to_radians().tan());
            let expected = 2.0 * (1.0 + u * u + v * v).sqrt();
            let [distance, hit, _] = distance.at(x, y);
            assert!(
                (distance - expected).abs() < 0.01 && hit == 1.0,
                "{x},{y}: {distance} instead of {expected}"
            );
        } else {
            assert_eq!(
                [albedo, normal, distance].map(|image| image.at(x, y)),
                [[0.0; 3]; 3]
            );
        }
    }
}

#[test]
fn first_hit_layers_hold_position_uv_and_indices() {
    // A plane at z = 2 in the left half, and a sphere in the right half, whose primitive is 2.
    let scene = SceneBuilder::new(Vec3::new(0.0, 0.0, 4.0), Vec3::ZERO, 40.0)
        .quad(
            Vec3::new(-2.0, -2.0, 2.0),
            Vec3::X * 2.0,
            Vec3::Y * 4.0,
            WHITE,
        )
        .sphere(Vec3::new(0.45, 0.0, 1.0), 0.3, WHITE)
        .build();
    let layers = [
        Layer::Position,
        Layer::Uv,
        Layer::ShapeIndex,
        Layer::PrimIndex,
    ];
    let images = |samples| {
        let renderer = render_waves(&scene, layered_job("nee", &layers, 2, 4), &[samples]);
        renderer
            .layer_images()
            .unwrap()
            .into_iter()
            .map(|layer| layer.image)
    };
    let found: Vec<Image> = images(64).collect();
    let [position, uv, shape, primitive] = found.as_slice() else {
        panic!("{} films", found.len())
    };
    for (x, y) in (0..12).flat_map(|y| (0..6).map(move |x| (x, y))) {
        let expected =
            [x as f32 - 5.5, 5.5 - y as f32].map(|i| i / 6.0 * 2.0 * 20f32.to_radians().tan());
        let ([px, py, pz], [u, v, _]) = (position.at(x, y), uv.at(x, y));
        assert!((px - expected[0]).abs() < 0.02 && (py - expected[1]).abs() < 0.02);
        assert!((pz - 2.0).abs() < 1e-6 && (u - (px + 2.0) / 2.0).abs() < 1e-5);
        assert!((v - (py + 2.0) / 4.0).abs() < 1e-5);
        assert!(shape.at(x, y)[0] == 0.0 && primitive.at(x, y)[0] < 2.0);
    }
    assert_eq!([8, 11].map(|x| primitive.at(x, 5)[0]), [2.0, -1.0]);
    assert_eq!([8, 11].map(|x| shape.at(x, 5)[0]), [0.0, -1.0]);
    assert_eq!([position, uv].map(|image| image.at(11, 0)), [[0.0; 3]; 2]);
    let [x, y, z] = position.at(8, 5);
    assert!((Vec3::new(x, y, z) - Vec3::new(0.45, 0.0, 1.0)).length() < 0.31);
    // Later samples do not change the index of the first one.
    assert!(images(1).skip(2).eq(found[2..].iter().cloned()));
}

#[test]
fn the_layer_of_the_variance_is_that_of_single_samples() {
    let scene = open_room().build();
    let job = layered_job("nee", &[Layer::Variance], 3, 9);
    let renderer = render_waves(&scene, job.clone(), &[3, 5]);
    let found = &renderer.layer_images().unwrap()[0].image;
    let single = |first_sample| {
        let job = Job {
            first_sample,
            ..job.clone()
        };
        render_waves(&scene, job, &[1]).film().sum.clone()
    };
    let samples: Vec<Vec<[f64; 3]>> = (0..8).map(single).collect();
    let mut positive = 0;
    for (i, value) in found.data.iter().enumerate() {
        for c in 0..3 {
            let mean = samples.iter().map(|s| s[i][c]).sum::<f64>() / 8.0;
            let squares = samples.iter().map(|s| (s[i][c] - mean).powi(2));
            let expected = squares.sum::<f64>() / 7.0;
            assert!((f64::from(value[c]) - expected).abs() <= 1e-6 * expected.max(mean * mean));
            positive += usize::from(value[c] > 0.0);
        }
    }
    assert!(positive > 100, "{positive}");
}

#[test]
fn layers_that_do_not_fit_or_are_unsupported_are_refused_before_rendering() {
    let huge = Job {
        max_depth: 40,
        resolution: [4096; 2],
        ..layered_job("bdpt", &[], 1, 1)
    }
    .with(|settings| settings.films = vec![Layer::Strategies]);
    let Err(RenderError::Unsupported { reason, .. }) = CpuRenderer::new(empty_scene(), huge) else {
        panic!("a job of more than 8 GiB was accepted")
    };
    assert!(reason.contains("lower max_depth"), "{reason}");
    let mock =
        (lumbre_render::mock::ROW.open)(empty_scene(), layered_job("bpt", &[Layer::Depth], 2, 1));
    assert!(matches!(
        mock.err(),
        Some(RenderError::Unsupported {
            backend: "mock",
            ..
        })
    ));
}
