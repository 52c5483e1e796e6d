//! Samples of `lvc` share light subpaths, which a device traces before each of them and lists in an
//! order that depends on nothing but the scene, the job and the sample.

use std::sync::Arc;

use glam::Vec3;
use lumbre_light::film::layer::Layer;
use lumbre_light::scene::CompiledScene;
use lumbre_light::transport::sampler::SOBOL;
use lumbre_light::value::Value;
use lumbre_render::cpu::renderer::CpuRenderer;
use lumbre_render::{Job, Renderer};
use lumbre_vulkan::context::device::Device;
use lumbre_vulkan::error::VulkanError;
use lumbre_vulkan::renderer::VulkanRenderer;

use super::harness;
use super::images::{render, room, scene_with_all_lights, state, supported_modes, technique_job};
use super::verdict::compare_loosely;
use crate::common::{self, SceneBuilder, grey, light};

/// Returns a job of `lvc` with parameters.
fn job(resolution: [u32; 2], params: &[(&str, f64)]) -> Job {
    let params = params
        .iter()
        .map(|(key, value)| ((*key).to_owned(), Value::Num(*value)));
    Job {
        resolution,
        ..technique_job("lvc", 21)
    }
    .with(|settings| settings.params = params.collect())
}

fn open(device: &Arc<Device>, scene: &CompiledScene, job: &Job) -> VulkanRenderer {
    let kind = harness::fastest_to_compile(device);
    VulkanRenderer::new(device, kind, &harness::sources(), scene, job).unwrap()
}

/// Few subpaths, so that hardly any goes another way by rounding: one that does changes the places
/// of all later vertices in the list.
#[test]
fn a_device_draws_the_vertices_that_the_cpu_draws() {
    let device = or_return!(harness::device());
    let kind = harness::fastest_to_compile(&device);
    let subpaths = |photons: f64| vec![("photons", photons)];
    let drawn = |photons: f64, connections: f64, candidates: f64| {
        vec![
            ("photons", photons),
            ("connections", connections),
            ("candidates", candidates),
        ]
    };
    for (name, scene, params) in [
        ("fewer subpaths than pixels", room(), subpaths(100.0)),
        ("more subpaths than pixels", room(), subpaths(700.0)),
        ("several connections", room(), drawn(200.0, 3.0, 5.0)),
        ("one candidate", room(), drawn(200.0, 1.0, 1.0)),
        ("all lights", scene_with_all_lights(), subpaths(200.0)),
    ] {
        let job = job([20, 14], &params);
        let found = render(&device, kind, &scene, &job, 4);
        compare_loosely(name, &found, &common::render(&scene, job, 4));
    }
    harness::assert_no_validation_messages();
}

/// More subpaths than a workgroup has sums of blocks, which makes it add them in several rounds.
#[test]
fn long_lists_of_vertices_are_those_of_the_cpu() {
    let device = or_return!(harness::device());
    // An open scene without roulette, in which every subpath ends at once or after a second vertex.
    let scene = SceneBuilder::new(Vec3::new(0.0, 1.0, 4.0), Vec3::new(0.0, 0.5, 0.0), 40.0)
        .floor(2.0, 0.0, grey(0.8))
        .quad(
            Vec3::new(-2.0, 0.0, -1.0),
            Vec3::X * 4.0,
            Vec3::Y * 2.0,
            grey(0.6),
        )
        .ceiling(0.5, 2.0, light(8.0))
        .build();
    let job = Job {
        max_depth: 3,
        ..job([12, 10], &[("photons", 70_000.0)])
    }
    .with(|settings| settings.rr_start = None);
    let kind = harness::fastest_to_compile(&device);
    let found = render(&device, kind, &scene, &job, 1);
    compare_loosely("a long list", &found, &common::render(&scene, job, 1));
    harness::assert_no_validation_messages();
}

#[test]
fn waves_and_checkpoints_do_not_change_the_bits_of_shared_subpaths() {
    let device = or_return!(harness::integer_splat_device());
    let scene = room();
    let job = Job {
        sampler: SOBOL,
        ..job([20, 14], &[("photons", 300.0)])
    }
    .with(|settings| settings.films = vec![Layer::Depth, Layer::Strategies]);
    let mut whole = open(&device, &scene, &job);
    let rays = whole.advance(5).unwrap().rays;
    let mut first = open(&device, &scene, &job);
    let mut parts = first.advance(2).unwrap().rays;
    let saved = state(&first);
    drop(first);
    let mut second = open(&device, &scene, &job);
    second.restore(&saved).unwrap();
    parts += second.render(&harness::ahead(1, 5)).unwrap().rays;
    parts += second.advance(2).unwrap().rays;
    assert!(second.film() == whole.film(), "the film differs");
    for i in 0..whole.layers().len() {
        assert!(second.layer(i) == whole.layer(i), "layer {i} differs");
    }
    assert_eq!(parts, rays);
    // Films of consecutive ranges of samples are parts of one run.
    let later = Job {
        first_sample: 2,
        ..job
    };
    let mut rest = open(&device, &scene, &later);
    rest.advance(3).unwrap();
    let mut cpu = CpuRenderer::new(Arc::clone(&scene), later).unwrap();
    cpu.advance(3).unwrap();
    compare_loosely("samples from the third on", rest.film(), cpu.film());
    harness::assert_no_validation_messages();
}

#[test]
fn subpaths_that_no_storage_buffer_holds_are_an_error_that_names_the_mend() {
    let device = or_return!(harness::device());
    let job = Job {
        max_depth: 128,
        ..job([16, 16], &[("photons", f64::from(1 << 28))])
    };
    let kind = supported_modes(&device)[0];
    let made = VulkanRenderer::new(&device, kind, &harness::sources(), &room(), &job);
    let Err(error) = made else {
        panic!("more than a terabyte of vertices was accepted");
    };
    assert!(matches!(error, VulkanError::TooLarge { .. }), "{error}");
    assert!(error.to_string().contains("lower `photons`"), "{error}");
}
