//! Vertex connection and merging: what it shares with `bdpt`, and that its error falls.

use std::sync::Arc;

use glam::Vec3;
use lumbre_light::math::stats::{median, sidak};
use lumbre_light::math::t_test::welch_p;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::Material;
use lumbre_light::transport::sampler::{INDEPENDENT, SOBOL};
use lumbre_light::value::Value;
use lumbre_render::{Job, Renderer};

use crate::common::{WHITE, grey, job, job_with, light, named_job, render, render_waves};
use crate::render::agreement::{Technique, technique};
use crate::render::consistent_fixtures::{
    GLASS, SIGNIFICANCE, assert_degenerate_scenes_render, boxed, column, constant_job,
    mean_and_error, panel, spread, varied,
};

fn vcm() -> Technique {
    technique("vcm", &[])
}

#[test]
fn connecting_alone_gives_the_bits_of_bidirectional_path_tracing() {
    let scene = varied();
    for sampler in [INDEPENDENT, SOBOL] {
        let with = |(row, params): Technique| {
            Job {
                integrator: row,
                sampler,
                ..job([17, 13], 6, 4)
            }
            .with(|settings| {
                settings.params = params;
                settings.rr_start = Some(3);
            })
        };
        let connected = with(technique("vcm", &[("join", "connect".into())]));
        let film = render(&scene, connected, 4);
        assert_eq!(film, render(&scene, with(technique("bdpt", &[])), 4));
        assert_ne!(film, render(&scene, with(vcm()), 4));
    }
}

/// A radius within which next to nothing is merged.
const NO_RADIUS: f64 = 1e-5;

#[test]
fn any_number_of_shared_light_subpaths_gives_the_mean_of_bidirectional_path_tracing() {
    let scene = varied();
    let bdpt = named_job("bdpt", [12; 2], 5, 99);
    let truth = spread(&scene, &bdpt, 24, 96);
    for photons in [17, 144, 500] {
        let found = spread(
            &scene,
            &constant_job(&vcm(), 12, 5, NO_RADIUS, photons),
            24,
            48,
        );
        for place in 0..5 {
            let (found, truth) = (column(&found, place), column(&truth, place));
            let ((a, _), (b, error)) = (mean_and_error(&found), mean_and_error(&truth));
            assert!(error < 0.02 * b, "{b} +- {error} is too noisy");
            let p = welch_p(&found, &truth);
            assert!(
                p > sidak(SIGNIFICANCE, 15),
                "{photons} light subpaths, place {place}: {a} instead of {b}: {p}"
            );
        }
    }
}

/// A box in which a lamp in glass lights a mirror, so that no connection finds the light that the
/// camera sees reflected.
fn reflected_caustic() -> Arc<CompiledScene> {
    let mirror = Material {
        metallic: 1.0,
        ..WHITE
    };
    let lamp = Vec3::new(0.2, 0.5, 0.0);
    boxed(mirror)
        .sphere(lamp, 0.3, GLASS)
        .sphere(lamp, 0.06, light(80.0))
        .build()
}

/// Returns the root mean square error of the pixels that do not show the lamp, relative to their mean.
fn error(scene: &Arc<CompiledScene>, job: &Job, samples: u64, truth: &[f64]) -> f64 {
    let film = render(scene, job.clone(), samples);
    let lamp = 3.0 * median(truth.to_vec());
    let (mut squares, mut total, mut count) = (0.0, 0.0, 0.0);
    for (sum, truth) in film
        .sum
        .iter()
        .zip(truth)
        .filter(|(_, truth)| **truth < lamp)
    {
        squares += (sum[1] / samples as f64 - truth).powi(2);
        total += truth;
        count += 1.0;
    }
    (squares / count).sqrt() / (total / count)
}

#[test]
fn it_finds_reflected_caustics_with_less_noise_than_connections() {
    let scene = reflected_caustic();
    let merging = constant_job(&technique("sppm", &[]), 16, 6, 0.02, 30_000);
    let truth: Vec<f64> = render(&scene, merging, 200)
        .sum
        .iter()
        .map(|sum| sum[1] / 200.0)
        .collect();
    let bdpt = named_job("bdpt", [16; 2], 6, 1);
    let connected = error(&scene, &bdpt, 64, &truth);
    let mut vcm = constant_job(&vcm(), 16, 6, 0.06, 256);
    vcm.settings
        .params
        .insert("alpha".to_owned(), Value::Num(0.75));
    let errors = [16, 64, 256].map(|samples| error(&scene, &vcm, samples, &truth));
    println!("bdpt {connected}, vcm {errors:?}");
    assert!(errors[1] < 0.5 * connected, "{errors:?} and {connected}");
    assert!(
        errors[1] < 0.75 * errors[0] && errors[2] < 0.75 * errors[1],
        "{errors:?}"
    );
}

#[test]
fn degenerate_scenes_render() {
    for join in ["both", "connect", "merge"] {
        let dark = [grey(0.5), GLASS];
        assert_degenerate_scenes_render(join, (&dark, 4), &[1, 2, 3], |depth| {
            let (row, params) = technique("vcm", &[("join", join.into())]);
            job_with(row, params, job([8, 8], depth, 1))
        });
    }
}

#[test]
fn rays_of_light_subpaths_are_counted() {
    let scene = panel(boxed(GLASS));
    let rays = |photons| {
        let job = constant_job(&vcm(), 8, 4, 0.01, photons);
        let mut renderer = render_waves(&scene, job, &[1]);
        renderer.advance(1).unwrap().rays
    };
    let (few, many) = (rays(64), rays(6464));
    assert!(many > few + 6400, "{few} {many}");
}
