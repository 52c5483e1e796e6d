//! Bidirectional path tracing with a light vertex cache: its mean for any number of connections,
//! candidates and light subpaths, the independence of its iterations, and its determinism.

use std::sync::Arc;

use glam::Vec3;
use lumbre_light::math::stats::sidak;
use lumbre_light::math::t_test::welch_p;
use lumbre_light::transport::sampler::{INDEPENDENT, SOBOL};
use lumbre_light::value::Value;
use lumbre_render::{Job, Renderer, cpu::renderer::CpuRenderer};

use crate::common::{grey, job, job_with, light, named_job, render, render_waves};
use crate::render::agreement::technique;
use crate::render::consistent_fixtures::{
    GLASS, SIGNIFICANCE, assert_degenerate_scenes_render, boxed, column, mean_and_error, spread,
    varied,
};

/// Returns a job for `lvc` with numbers of connections, candidates and light subpaths.
fn lvc([connections, candidates, photons]: [i64; 3], side: u32, depth: u32) -> Job {
    let (row, params) = technique(
        "lvc",
        &[
            ("connections", Value::Int(connections)),
            ("candidates", Value::Int(candidates)),
            ("photons", Value::Int(photons)),
        ],
    );
    job_with(row, params, job([side; 2], depth, 1))
}

#[test]
fn any_connections_candidates_and_light_subpaths_give_the_mean_of_bdpt() {
    let scene = varied();
    let bdpt = named_job("bdpt", [12; 2], 5, 99);
    let truth = spread(&scene, &bdpt, 24, 96);
    for numbers in [[1, 1, 144], [1, 8, 144], [2, 3, 500], [3, 16, 17]] {
        let found = spread(&scene, &lvc(numbers, 12, 5), 24, 48);
        for place in 0..5 {
            let (found, truth) = (column(&found, place), column(&truth, place));
            let ((a, noise), (b, error)) = (mean_and_error(&found), mean_and_error(&truth));
            assert!(error < 0.02 * b, "{b} +- {error} is too noisy");
            assert!(noise < 0.05 * b, "{a} +- {noise} is too noisy");
            let p = welch_p(&found, &truth);
            assert!(
                p > sidak(SIGNIFICANCE, 20),
                "{numbers:?}, place {place}: {a} instead of {b}: {p}"
            );
        }
    }
}

/// With few light subpaths most noise is that of the cache. If iterations had the same cache, it
/// would stay in the mean over iterations.
#[test]
fn every_iteration_has_a_cache_of_its_own() {
    let scene = varied();
    let few = lvc([1, 8, 4], 12, 5);
    let variance = |samples| {
        let (_, error) = mean_and_error(&column(&spread(&scene, &few, 48, samples), 0));
        error * error
    };
    let (one, sixteen) = (variance(1), variance(16));
    let ratio = one / sixteen;
    assert!(
        (16.0 / 3.0..16.0 * 3.0).contains(&ratio),
        "{one} / {sixteen} = {ratio} instead of 16"
    );
}

/// A lamp that shines at the ceiling, so that most light arrives by connections with lit vertices.
#[test]
fn candidates_lower_the_noise_of_indirect_light() {
    let scene = boxed(grey(0.6))
        .quad(
            Vec3::new(-0.2, 0.5, -0.2),
            Vec3::Z * 0.4,
            Vec3::X * 0.4,
            light(30.0),
        )
        .build();
    let noise = |candidates| {
        let film = render(&scene, lvc([1, candidates, 144], 12, 6), 256);
        film.variance_of_mean().mean()[1]
    };
    let (one, eight) = (noise(1), noise(8));
    assert!(eight < 0.6 * one, "{eight} and {one}");
}

#[test]
fn threads_waves_and_checkpoints_do_not_change_its_bits() {
    let scene = varied();
    for sampler in [INDEPENDENT, SOBOL] {
        let with = |threads| {
            Job {
                threads,
                sampler,
                ..lvc([2, 4, 3000], 17, 6)
            }
            .with(|settings| settings.rr_start = Some(3))
        };
        let whole = render(&scene, with(1), 6);
        assert!(whole.sum.iter().any(|sum| sum[0] > 0.0));
        assert_eq!(whole, render(&scene, with(2), 6), "{}", sampler.name);
        assert_eq!(whole, render(&scene, with(7), 6), "{}", sampler.name);
        let waves = render_waves(&scene, with(2), &[1, 3, 2]);
        assert_eq!(&whole, waves.film(), "{}", sampler.name);
        let open = || CpuRenderer::new(Arc::clone(&scene), with(2)).unwrap();
        let (mut before, mut after) = (open(), open());
        before.advance(4).unwrap();
        let mut state = Vec::new();
        assert!(before.save(&mut state).unwrap());
        after.restore(&state).unwrap();
        after.advance(2).unwrap();
        assert_eq!(&whole, after.film(), "{}", sampler.name);
    }
}

#[test]
fn degenerate_scenes_render() {
    for numbers in [[1, 1, 1], [2, 8, 200]] {
        let dark = [grey(0.5), GLASS, light(0.0)];
        let case = format!("{numbers:?}");
        assert_degenerate_scenes_render(&case, (&dark, 4), &[1, 2, 3], |depth| {
            lvc(numbers, 8, depth)
        });
    }
}
