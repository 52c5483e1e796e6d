//! Techniques that gather light over disks, which are consistent but biased: `sppm`, `vcm`, and `vcm`
//! with merging alone. Scenes, and statistics of their pictures.
//!
//! Pixels that gather the same photons have common noise, so all errors come from the spread over
//! pictures with different seeds.

use std::sync::Arc;

use glam::{Vec2, Vec3};
use lumbre_light::film::Film;
use lumbre_light::math::stats::sidak;
use lumbre_light::math::t_test::two_sided_p;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{Material, Model};
use lumbre_light::value::Value;
use lumbre_render::Job;

use crate::common::{SceneBuilder, WHITE, grey, job, job_with, light, named_job, render};
use crate::render::agreement::{Technique, technique};

/// Probability that any comparison of one test fails by chance alone.
pub const SIGNIFICANCE: f64 = 0.001;

/// Returns all techniques that gather light over disks.
pub fn techniques() -> Vec<Technique> {
    let mut all = merging_alone();
    all.push(technique("vcm", &[]));
    all
}

/// Returns the techniques that find the light of point lights by nothing else.
pub fn merging_alone() -> Vec<Technique> {
    let join = [("join", "merge".into())];
    vec![technique("sppm", &[]), technique("vcm", &join)]
}

/// Returns a job for a technique with a constant radius.
pub fn constant_job(
    (row, params): &Technique,
    side: u32,
    depth: u32,
    radius: f64,
    photons: i64,
) -> Job {
    let mut job = job_with(row, params.clone(), job([side; 2], depth, 1));
    let constant = [
        ("radius", Value::Num(radius)),
        ("photons", Value::Int(photons)),
        ("alpha", Value::Int(1)),
    ];
    job.settings
        .params
        .extend(constant.map(|(key, value)| (key.to_owned(), value)));
    job
}

/// Means of all channels over the whole film, and over its quarters.
pub fn means(film: &Film) -> [f64; 5] {
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
pub fn spread(scene: &Arc<CompiledScene>, job: &Job, seeds: u64, samples: u64) -> Vec<[f64; 5]> {
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

/// Returns the means at one place.
pub fn column(of: &[[f64; 5]], place: usize) -> Vec<f64> {
    of.iter().map(|means| means[place]).collect()
}

/// Returns the mean of values and its standard error.
pub fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

/// Radius that is small beside all scenes here, in scene units.
pub const SMALL: f64 = 0.03;

/// Side of compared pictures in pixels.
pub const SIDE: u32 = 20;

/// Names a technique in messages.
pub fn label((row, params): &Technique) -> String {
    format!("{} {params:?}", row.name)
}

/// Compares `sppm` and `vcm` with a small radius with an unbiased integrator, over the picture and its
/// quarters: they may differ by 2 % of the light and by noise.
pub fn agree_with(name: &str, scene: &Arc<CompiledScene>, depth: u32, photons: i64) {
    let truth_job = named_job(name, [SIDE; 2], depth, 99);
    let truth = spread(scene, &truth_job, 12, 96);
    // Dark quarters need not be more precise than a quarter of the mean.
    let least = 0.25 * mean_and_error(&column(&truth, 0)).0;
    let techniques = ["sppm", "vcm"].map(|name| technique(name, &[]));
    for technique in &techniques {
        let job = constant_job(technique, SIDE, depth, SMALL, photons);
        let found = spread(scene, &job, 12, 24);
        for place in 0..5 {
            let (found, truth) = (column(&found, place), column(&truth, place));
            let what = format!("{}, place {place}", label(technique));
            assert_close(&what, &found, &truth, least, 5 * techniques.len());
        }
    }
}

/// Panics if the means of two samples differ by more than noise and 2 % of the light, which is at
/// least `least`, as one of `tests` tests; or if noise is too large for the test to mean anything.
pub fn assert_close(what: &str, found: &[f64], truth: &[f64], least: f64, tests: usize) {
    let ((a, ea), (b, eb)) = (mean_and_error(found), mean_and_error(truth));
    let (error, light) = (ea.hypot(eb), b.max(least));
    let what = format!("{what}: {a} +- {ea} instead of {b} +- {eb}");
    assert!(error < 0.05 * light, "{what} is too noisy");
    let beyond = ((a - b).abs() - 0.02 * light).max(0.0);
    let p = two_sided_p(beyond / error, found.len() as f64 - 1.0);
    assert!(p > sidak(SIGNIFICANCE, tests), "{what}: {p}");
}

/// Glass with a smooth surface.
pub const GLASS: Material = Material {
    opacity: 0.0,
    ior: 1.5,
    ..WHITE
};

/// A closed box with a ball, seen from inside.
pub fn boxed(ball: Material) -> SceneBuilder {
    SceneBuilder::new(Vec3::new(0.0, 0.1, 0.95), Vec3::new(0.0, -0.2, 0.0), 60.0)
        .room(1.0, grey(0.6))
        .sphere(Vec3::new(0.1, -0.5, -0.2), 0.4, ball)
}

/// Completes a scene with a lamp below the ceiling.
pub fn panel(scene: SceneBuilder) -> Arc<CompiledScene> {
    let corner = Vec3::new(-0.3, 0.98, -0.3);
    scene
        .quad(corner, Vec3::X * 0.6, Vec3::Z * 0.6, light(8.0))
        .build()
}

/// An open stage: a floor with a ball above it.
pub fn stage(ball: Material) -> SceneBuilder {
    SceneBuilder::new(Vec3::new(0.0, 1.0, 2.4), Vec3::new(0.0, 0.5, 0.0), 45.0)
        .floor(1.5, 0.0, grey(0.6))
        .sphere(Vec3::new(0.0, 0.8, 0.0), 0.5, ball)
}

/// A metal whose highlight is sampled rather than gathered.
pub fn polished() -> Material {
    Material {
        model: Model::Disney,
        metallic: 1.0,
        roughness: 0.3,
        ..grey(0.9)
    }
}

/// A scene with every kind of event, of which light and camera paths need several.
pub fn varied() -> Arc<CompiledScene> {
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

/// Checks scenes of one triangle with the job of a number of path edges: black if it has one of the
/// dark materials, and not if it is a lamp.
pub fn assert_degenerate_scenes_render(
    case: &str,
    (dark, dark_depth): (&[Material], u32),
    lamp_depths: &[u32],
    job: impl Fn(u32) -> Job,
) {
    let film = |material, depth| {
        let corners = [
            Vec3::new(-1.0, 0.0, -2.0),
            Vec3::new(1.0, 0.0, -2.0),
            Vec3::Y - Vec3::Z * 2.0,
        ];
        let scene = SceneBuilder::new(Vec3::ZERO, Vec3::NEG_Z, 60.0)
            .triangle(corners, [Vec2::ZERO; 3], material)
            .build();
        render(&scene, job(depth), 4)
    };
    for material in dark {
        let black = film(*material, dark_depth);
        assert!(black.sum.iter().all(|sum| *sum == [0.0; 3]), "{case}");
    }
    for depth in lamp_depths {
        let lamp = film(light(2.0), *depth);
        assert!(lamp.sum.iter().any(|sum| sum[0] > 7.9), "{case}");
    }
}
