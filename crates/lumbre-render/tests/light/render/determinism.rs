//! A run has the same bits for any number of threads, any waves, and after a checkpoint.

use std::sync::Arc;

use glam::Vec3;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::Material;
use lumbre_light::transport::integrator::integrator;
use lumbre_light::transport::sampler::{SAMPLERS, SOBOL};
use lumbre_render::{Job, Renderer, cpu::renderer::CpuRenderer};

use crate::common::{
    SceneBuilder, WHITE, grey, job, light, render, render_waves, timed_job, timing,
};

fn scene() -> Arc<CompiledScene> {
    SceneBuilder::new(Vec3::new(0.0, 0.0, 0.95), Vec3::ZERO, 60.0)
        .room(1.0, grey(0.7))
        .ceiling(0.3, 0.99, light(10.0))
        .sphere(
            Vec3::new(0.3, -0.6, 0.0),
            0.4,
            Material {
                opacity: 0.0,
                ..WHITE
            },
        )
        .build()
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let scene = scene();
    for sampler in SAMPLERS {
        let with = |threads| {
            render(
                &scene,
                Job {
                    threads,
                    sampler,
                    ..job([33, 17], 5, 11)
                },
                9,
            )
        };
        let one = with(1);
        assert_eq!(one, with(2), "{}", sampler.name);
        assert_eq!(one, with(5), "{}", sampler.name);
        assert!(one.sum.iter().any(|s| s[0] > 0.0));
    }
}

#[test]
fn any_grouping_into_waves_gives_the_same_bits() {
    let scene = scene();
    for sampler in SAMPLERS {
        let job = Job {
            sampler,
            ..job([16, 16], 5, 12)
        };
        let whole = render(&scene, job.clone(), 21);
        let mut renderer = CpuRenderer::new(Arc::clone(&scene), job).unwrap();
        for wave in [1, 2, 4, 8, 6] {
            renderer.advance(wave).unwrap();
        }
        assert_eq!(&whole, renderer.film(), "{}", sampler.name);
    }
}

#[test]
fn another_seed_gives_another_picture() {
    let scene = scene();
    let a = render(&scene, job([16, 16], 5, 13), 4);
    let b = render(&scene, job([16, 16], 5, 14), 4);
    assert_ne!(a, b);
    let [c, d] = [13, 14].map(|seed| {
        render(
            &scene,
            Job {
                sampler: SOBOL,
                ..job([16, 16], 5, seed)
            },
            4,
        )
    });
    assert!(c != d && c != a);
}

#[test]
fn a_run_resumed_from_a_checkpoint_has_the_same_bits() {
    let scene = scene();
    let all = lumbre_light::film::layer::LAYERS
        .iter()
        .map(|row| row.layer)
        .collect::<Vec<_>>();
    for (name, layers) in [("bpt", vec![]), ("bdpt", vec![]), ("bdpt", all)] {
        let integrator = integrator(name).unwrap();
        let job = Job {
            integrator,
            ..job([12, 10], 3, 15)
        }
        .with(|settings| settings.films = layers);
        let open = || CpuRenderer::new(Arc::clone(&scene), job.clone()).unwrap();
        let mut whole = open();
        whole.advance(6).unwrap();
        for cut in [0, 1, 5] {
            let (mut before, mut after) = (open(), open());
            if cut > 0 {
                before.advance(cut).unwrap();
            }
            let mut state = Vec::new();
            assert!(before.save(&mut state).unwrap());
            after.restore(&state).unwrap();
            assert_eq!(after.film(), before.film(), "{name} after {cut}");
            after.advance(6 - cut).unwrap();
            assert_eq!(after.film(), whole.film(), "{name} after {cut}");
            for film in 0..whole.layers().len() {
                assert_eq!(
                    after.layer(film),
                    whole.layer(film),
                    "{name} after {cut}, film {film}"
                );
            }
            assert!(open().restore(&state[..state.len() - 8]).is_err());
        }
    }
}

#[test]
fn films_of_sample_ranges_sum_to_the_film_of_all_samples() {
    let scene = scene();
    for name in ["nee", "bdpt"] {
        for sampler in SAMPLERS {
            let whole = Job {
                integrator: integrator(name).unwrap(),
                sampler,
                ..job([16, 12], 4, 21)
            };
            let all = render(&scene, whole.clone(), 13);
            let first = render(&scene, whole.clone(), 5);
            let rest = render(
                &scene,
                Job {
                    first_sample: 5,
                    ..whole
                },
                8,
            );
            assert_ne!(first.sum, rest.sum);
            let [all, first, rest] = [&all, &first, &rest].map(|film| film.sum.as_flattened());
            for ((whole, a), b) in all.iter().zip(first).zip(rest) {
                assert!(
                    (a + b - whole).abs() <= 1e-13 * whole.abs(),
                    "{name}: {a} + {b}, {whole}"
                );
            }
        }
    }
}

#[test]
fn a_timed_film_that_was_looked_at_between_waves_has_all_samples() {
    let timed = timed_job("nee", timing(0.0, 0.5, 20), [8, 8], 3, 5);
    let mut looked_at = render_waves(&scene(), timed.clone(), &[2]);
    let early = looked_at.film().clone();
    looked_at.advance(3).unwrap();
    let whole = render_waves(&scene(), timed, &[5]);
    assert_eq!(looked_at.film(), whole.film());
    assert_ne!(&early, whole.film());
}
