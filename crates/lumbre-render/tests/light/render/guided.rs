//! Guided path tracing and guided bidirectional path tracing: less noise where light is hard to
//! find, the same bits however a run is split, and scenes without light. That its pictures are right
//! is tested with all other integrators ([`super::agreement`]).

use std::sync::Arc;

use glam::{Vec2, Vec3};
use lumbre_light::film::Film;
use lumbre_light::film::layer::Layer;
use lumbre_light::film::time::TimeAxis;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::Material;
use lumbre_light::transport::sampler::{INDEPENDENT, SOBOL};
use lumbre_light::transport::time_settings::Timing;
use lumbre_light::value::Value;
use lumbre_render::cpu::guiding_tree::{COLUMNS, GuidingTree, ROWS};
use lumbre_render::hierarchy::LaneMode;
use lumbre_render::{Job, Renderer, cpu::renderer::CpuRenderer};

use crate::common::{SceneBuilder, WHITE, grey, job, job_with, light, render};
use crate::render::agreement::{Technique, technique};
use crate::render::consistent::{assert_same_bits, assert_splits};

/// Both guided techniques.
const GUIDED: [&str; 2] = ["guided", "guided_bdpt"];

/// Returns a guided technique with a tree that has leaves in small pictures too.
fn trained_as(name: &str, training: i64, split: f64) -> Technique {
    let pairs = [
        ("training", Value::Int(training)),
        ("split", Value::Num(split)),
    ];
    technique(name, &pairs)
}

/// Returns guided path tracing with such a tree.
fn trained(training: i64, split: f64) -> Technique {
    trained_as("guided", training, split)
}

/// Returns a room of height 2 whose lamp is behind a wall of the given height.
pub fn behind_a_wall(height: f32) -> SceneBuilder {
    // The camera sees neither the lamp nor the gap, whose edges would be noise of the filter.
    SceneBuilder::new(Vec3::new(0.3, 0.6, 0.9), Vec3::new(-0.7, -0.7, -0.7), 50.0)
        .room(1.0, grey(0.7))
        .quad(
            Vec3::new(0.4, -1.0, 1.0),
            Vec3::Y * height,
            Vec3::Z * -2.0,
            grey(0.7),
        )
        .quad(
            Vec3::new(0.55, -0.6, -0.3),
            Vec3::Z * 0.6,
            Vec3::X * 0.3,
            light(30.0),
        )
}

/// Returns a room whose lamp is behind a wall with a gap at its upper end.
fn hidden_lamp() -> Arc<CompiledScene> {
    behind_a_wall(1.85).build()
}

/// Returns the mean over pixels of the variance of their mean.
fn variance(film: &Film) -> f64 {
    let variance = film.variance_of_mean();
    let pixels = variance.data.len() as f64;
    variance.data.iter().map(|p| f64::from(p[1])).sum::<f64>() / pixels
}

/// Returns a job of a technique.
fn job_of((row, params): &Technique, side: u32, depth: u32) -> Job {
    job_with(row, params.clone(), job([side; 2], depth, 5))
}

#[test]
fn a_hidden_lamp_is_found_with_less_noise_than_by_nee() {
    let scene = hidden_lamp();
    let film = |technique: &Technique| {
        let job = Job {
            first_sample: 2000,
            ..job_of(technique, 16, 6)
        };
        render(&scene, job, 512)
    };
    let plain = variance(&film(&technique("nee", &[])));
    for (target, most) in [("variance", 0.9), ("mean", 0.6)] {
        let (row, mut params) = trained(2000, 1000.0);
        params.insert("target".to_owned(), target.into());
        let guided = variance(&film(&(row, params)));
        assert!(guided < most * plain, "{target}: {guided} and {plain}");
    }
}

#[test]
fn samples_have_less_noise_the_longer_the_tree_was_trained_before() {
    let scene = hidden_lamp();
    let of_samples = |first: u64, count: u64| {
        let job = Job {
            first_sample: first,
            ..job_of(&trained(2000, 1000.0), 16, 6)
        };
        variance(&render(&scene, job, count)) * count as f64
    };
    // The fourth training iteration, the last one, and samples after the training.
    let [early, last, after] = [(15, 16), (511, 1489), (2000, 1024)].map(|(a, n)| of_samples(a, n));
    assert!(
        after < 1.1 * last && last < 0.8 * early,
        "{early}, {last}, {after}"
    );
}

#[test]
fn samples_after_the_training_are_those_of_nee_if_the_bsdf_samples_all_directions() {
    let scene = hidden_lamp();
    let film = |technique: &Technique| {
        let job = Job {
            first_sample: 7,
            ..job_of(technique, 16, 6)
        };
        render(&scene, job, 20).sum
    };
    let params = [
        ("bsdf_fraction", Value::Num(1.0)),
        ("training", Value::Int(7)),
    ];
    let plain = film(&technique("nee", &[]));
    assert_eq!(film(&technique("guided", &params)), plain);
}

#[test]
fn a_hidden_lamp_is_found_with_less_noise_than_by_bdpt() {
    let scene = hidden_lamp();
    let film = |technique: &Technique| render(&scene, job_of(technique, 16, 6), 256);
    let plain = film(&technique("bdpt", &[]));
    let guided = film(&trained_as("guided_bdpt", 2000, 1000.0));
    let [guided, without] = [&guided, &plain].map(variance);
    assert!(guided < 0.8 * without, "{guided} and {without}");
    let all_by_bsdf = technique("guided_bdpt", &[("bsdf_fraction", Value::Num(1.0))]);
    assert_eq!(film(&all_by_bsdf).sum, plain.sum);
}

#[test]
fn any_number_of_threads_and_any_waves_give_the_same_bits() {
    for sampler in [INDEPENDENT, SOBOL] {
        assert_same_bits(&trained_as("guided_bdpt", 61, 40.0), sampler);
        // The first wave ends before, with or after the training.
        assert_same_bits(&trained(2, 40.0), sampler);
        assert_same_bits(&trained(9, 40.0), sampler);
    }
}

#[test]
fn wide_pictures_have_the_same_bits_in_all_lanes_with_layers_and_with_time() {
    let scene = hidden_lamp();
    let axis = TimeAxis {
        start: 1.0,
        bin: 0.5,
        bins: 12,
    };
    let films = |lanes, layers: &[Layer], timed: bool| {
        let mut job = Job {
            resolution: [301, 2],
            ..job_of(&trained(4, 40.0), 1, 5)
        }
        .with(|settings| {
            settings.films = layers.to_vec();
            settings.timing = timed.then(|| Timing::plain(axis));
        });
        job.settings.accel.lanes = lanes;
        let mut renderer = CpuRenderer::new(Arc::clone(&scene), job).unwrap();
        renderer.advance(6).unwrap();
        let layers: Vec<Film> = (0..renderer.layers().len())
            .map(|i| renderer.layer(i).unwrap())
            .collect();
        (renderer.film().clone(), layers, renderer.times())
    };
    let layers = [Layer::Depth, Layer::Rays];
    for timed in [false, true] {
        let (plain, _, times) = films(LaneMode::Never, &[], timed);
        let single = films(LaneMode::Never, &layers, timed);
        assert_eq!((&single.0, &single.2), (&plain, &times));
        assert_eq!(films(LaneMode::Auto, &layers, timed), single);
        assert_eq!(films(LaneMode::Auto, &[], timed).0, plain);
        assert!(plain.sum.iter().any(|sum| sum[0] > 0.0));
        let rays = single.1.last().unwrap().sum.iter().map(|sum| sum[0]);
        let fewest = rays.clone().reduce(f64::min).unwrap();
        let most = rays.reduce(f64::max).unwrap();
        // Six samples with one to five edges, and as many shadow rays.
        assert!(
            fewest >= 6.0 && most > fewest && most <= 60.0,
            "{fewest} to {most}"
        );
    }
}

#[test]
fn a_checkpoint_and_ranges_of_samples_give_the_picture_of_the_whole() {
    for name in GUIDED {
        assert_splits(&trained_as(name, 20, 40.0));
    }
}

#[test]
fn the_tree_depends_on_the_seed_and_the_training() {
    let scene = hidden_lamp();
    let film = |seed, training| {
        let job = Job {
            seed,
            ..job_of(&trained(training, 40.0), 9, 4)
        };
        render(&scene, job, 12).sum
    };
    assert_eq!(film(1, 8), film(1, 8));
    assert_ne!(film(1, 8), film(2, 8));
    assert_ne!(film(1, 8), film(1, 9));
}

#[test]
fn training_counts_its_rays_once() {
    let scene = hidden_lamp();
    let waves = |technique: &Technique| {
        let mut renderer = CpuRenderer::new(Arc::clone(&scene), job_of(technique, 8, 4)).unwrap();
        [4, 4].map(|samples| renderer.advance(samples).unwrap().rays)
    };
    let apart = waves(&trained_as("guided_bdpt", 100, 40.0));
    assert!(apart[0] > 10 * apart[1], "{apart:?}");
    let samples = waves(&trained(4, 40.0));
    assert!(
        2 * samples[0] > samples[1] && samples[0] < 2 * samples[1],
        "{samples:?}"
    );
}

#[test]
fn scenes_without_light_are_black() {
    let triangle = |material| {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
        SceneBuilder::new(Vec3::new(0.2, 0.2, 2.0), Vec3::ZERO, 40.0).triangle(
            corners,
            [Vec2::ZERO; 3],
            material,
        )
    };
    let black = Material {
        base_color: Vec3::ZERO,
        ..WHITE
    };
    for (scene, lit) in [
        (triangle(grey(0.5)).build(), false),
        (triangle(black).build(), false),
        (triangle(light(2.0)).build(), true),
        (
            triangle(black).environment(None, Vec3::ONE, 0.0).build(),
            true,
        ),
        (SceneBuilder::new(Vec3::Z, Vec3::ZERO, 40.0).build(), false),
        (
            SceneBuilder::new(Vec3::Z, Vec3::ZERO, 40.0)
                .room(2.0, grey(0.8))
                .build(),
            false,
        ),
    ] {
        for depth in [1, 2, 7] {
            for name in GUIDED {
                let guided = trained_as(name, 6, 2.0);
                let film = render(&scene, job_of(&guided, 6, depth), 3);
                assert_eq!(film.sum.iter().any(|s| s[0] > 0.0), lit, "{name}");
            }
        }
    }
}

#[test]
fn a_tree_can_be_looked_at_and_its_densities_integrate_to_one() {
    let scene = hidden_lamp();
    let tree =
        |technique: &Technique| GuidingTree::train(&scene, &job_of(technique, 12, 6)).unwrap();
    let guided = tree(&trained(200, 200.0)).unwrap();
    let size = guided.size();
    assert!(size.guiding > 1 && size.guiding <= size.regions, "{size:?}");
    let cell = 4.0 * std::f64::consts::PI / (ROWS * COLUMNS) as f64;
    for region in (0..size.regions as u32).filter(|region| guided.guides(*region)) {
        let mass = guided.density(region).unwrap().iter().sum::<f64>() * cell;
        assert!((mass - 1.0).abs() < 0.02, "region {region}: {mass}");
    }
    // The camera is inside of the room.
    assert!(guided.regions.iter().all(Option::is_some));
    assert_eq!(guided.region_at([11, 3]), guided.regions[3 * 12 + 11]);
    assert!(tree(&technique("nee", &[])).is_none());
    assert!(tree(&technique("sppm", &[])).is_none());
}

#[test]
fn light_that_vertices_find_by_their_own_shadow_rays_trains_no_tree() {
    // Paths leave the floor for nothing: all light comes by shadow rays from its vertices.
    let floor = || {
        SceneBuilder::new(Vec3::new(0.2, 0.3, 2.0), Vec3::ZERO, 40.0)
            .quad(
                Vec3::new(-2.0, -2.0, 0.0),
                Vec3::X * 4.0,
                Vec3::Y * 4.0,
                grey(0.5),
            )
            .point(Vec3::new(0.5, 0.5, 1.0), Vec3::ONE)
    };
    let sky = floor().environment(None, Vec3::ONE, 0.0);
    for (scene, guides) in [(floor().build(), false), (sky.build(), true)] {
        for name in GUIDED {
            let tree = GuidingTree::train(&scene, &job_of(&trained_as(name, 8, 40.0), 8, 4));
            let size = tree.unwrap().unwrap().size();
            assert_eq!(size.guiding > 0, guides, "{name}: {size:?}");
        }
    }
}

/// The first four numbers of the Sobol sequence for a pixel's columns are two in either half of the
/// pixel. Training iterations of one and of three samples have sequences of their own: in half of all
/// pixels their halves differ.
#[test]
fn training_iterations_have_seeds_of_their_own() {
    let side = 8;
    let half = 1.0 / side as f32;
    // The left half of every pixel emits.
    let stripes = (0..side).fold(
        SceneBuilder::new(Vec3::Z, Vec3::ZERO, 90.0),
        |scene, column| {
            let left = -1.0 + 2.0 * half * column as f32;
            scene.quad(
                Vec3::new(left, -1.0, 0.0),
                Vec3::X * half,
                Vec3::Y * 2.0,
                light(1.0),
            )
        },
    );
    let scene = stripes.build();
    let even = |technique: &Technique| {
        let job = Job {
            sampler: SOBOL,
            ..job_of(technique, side, 2)
        };
        let film = render(&scene, job, 4);
        film.sum.iter().filter(|sum| sum[1] == 2.0).count()
    };
    assert_eq!(even(&technique("nee", &[])), 64);
    let trained = even(&trained(4, 1000.0));
    // Five standard deviations of a binomial distribution.
    assert!((12..=52).contains(&trained), "{trained} of 64 pixels");
}
