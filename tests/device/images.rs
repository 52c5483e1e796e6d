//! Image parity: the same seed on a device and on the CPU gives nearly the same image, sample by
//! sample. The differences are rounding, and the few paths that diverge because of it.

use std::sync::Arc;

use glam::{Vec2, Vec3};
use lumbre_light::film::Film;
use lumbre_light::film::layer::Layer;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{Material, Model, Texture};
use lumbre_light::scene::desc::CameraKind;
use lumbre_light::transport::camera::{FilterKind, FilterSpec};
use lumbre_light::transport::sampler::SOBOL;
use lumbre_render::cpu::renderer::CpuRenderer;
use lumbre_render::{Job, Renderer};
use lumbre_vulkan::context::device::Device;
use lumbre_vulkan::pipelines::program::TracingMode;
use lumbre_vulkan::pipelines::sources::Sources;
use lumbre_vulkan::renderer::VulkanRenderer;

use super::corners::balls;
use super::harness;
use super::verdict::{compare, compare_loosely};
use super::weights::seen_by;
use crate::common::{self, SceneBuilder, WHITE, grey, job, light, named_job};

/// Returns the tracing modes that the device supports.
pub fn supported_modes(device: &Device) -> Vec<TracingMode> {
    let able = |kind: &TracingMode| {
        let lacking = kind.lacking(&device.info);
        if let Some(what) = lacking {
            common::skipped(format_args!("{} lacks {what}", device.info.line()));
        }
        lacking.is_none()
    };
    TracingMode::ALL.into_iter().filter(able).collect()
}

/// Renders `samples` samples on a device.
pub fn render(
    device: &Arc<Device>,
    kind: TracingMode,
    scene: &CompiledScene,
    job: &Job,
    samples: u64,
) -> Film {
    let mut renderer = VulkanRenderer::new(device, kind, &harness::sources(), scene, job).unwrap();
    let stats = renderer.advance(samples).unwrap();
    assert_eq!(
        stats.invalid, 0,
        "invalid samples, first at {:?}",
        stats.first_invalid
    );
    assert!(stats.rays >= stats.paths && stats.device_s > 0.0);
    renderer.film().clone()
}

/// Returns a closed room with an area light, a glossy ball, a glass ball and a rough one.
pub fn room() -> Arc<CompiledScene> {
    let mut glass = grey(1.0);
    (glass.model, glass.opacity, glass.roughness) = (Model::Disney, 0.0, 0.3);
    let mut metal = grey(0.9);
    (metal.model, metal.metallic, metal.roughness) = (Model::Disney, 1.0, 0.2);
    let mut coated = grey(0.4);
    (
        coated.model,
        coated.clearcoat,
        coated.sheen,
        coated.anisotropic,
    ) = (Model::Disney, 1.0, 0.5, 0.5);
    SceneBuilder::new(Vec3::new(0.0, 0.0, 1.9), Vec3::ZERO, 60.0)
        .room(2.0, grey(0.7))
        .ceiling(0.5, 1.99, light(8.0))
        .quad(
            Vec3::new(-1.5, -1.0, -1.0),
            Vec3::new(0.0, 1.0, 0.0),
            Vec3::new(0.0, 0.0, 1.0),
            coated,
        )
        .sphere(Vec3::new(-0.7, -1.4, -0.5), 0.5, metal)
        .sphere(Vec3::new(0.8, -1.4, 0.0), 0.5, glass)
        .sphere(Vec3::new(0.0, 0.2, -1.0), 0.3, WHITE)
        .build()
}

/// Renders a job on the CPU and in some tracing modes, and compares the films.
///
/// The modes differ only in how a ray is traced, and with a software driver compiling takes nearly
/// all of the time of these tests. Therefore closest hits and shadow rays are tested in every mode,
/// with every kind of primitive, masks and instances (`corners.rs`, `instances.rs`); every
/// integrator on ray-tracing pipelines and in compute shaders; and every job in the mode that
/// compiles fastest.
fn assert_same_in_modes(
    of: &[TracingMode],
    name: &str,
    scene: &Arc<CompiledScene>,
    job: &Job,
    samples: u64,
) {
    let device = or_return!(harness::device());
    let expected = common::render(scene, job.clone(), samples);
    for kind in supported_modes(&device)
        .into_iter()
        .filter(|kind| of.contains(kind))
    {
        let found = render(&device, kind, scene, job, samples);
        compare(&format!("{name} by {}", kind.backend()), &found, &expected);
    }
    harness::assert_no_validation_messages();
}

/// Returns a scene with every kind of light, masks, a textured floor, and surfaces of ideal models.
pub fn scene_with_all_lights() -> Arc<CompiledScene> {
    let image = |width: u32, texels: Vec<[f32; 3]>| {
        Texture::new(width, texels.len() as u32 / width, texels)
    };
    let mut builder = SceneBuilder::new(Vec3::new(0.3, 0.8, 3.0), Vec3::new(0.0, 0.3, 0.0), 50.0);
    let checks = builder.texture(image(
        2,
        vec![[0.9, 0.2, 0.1], [0.1, 0.3, 0.8], [0.5; 3], [0.8, 0.8, 0.2]],
    ));
    let holes = builder.texture(image(2, vec![[1.0; 3], [0.0; 3], [0.3; 3], [0.8; 3]]));
    let floor = Material {
        base_color_texture: checks,
        ..grey(0.8)
    };
    let leaf = Material {
        mask_texture: holes,
        ..grey(0.6)
    };
    let grid = Material {
        mask_texture: holes,
        ..grey(0.3)
    };
    let glass = Material {
        model: Model::Lambert,
        opacity: 0.0,
        ..WHITE
    };
    let sky = image(
        4,
        (0..8)
            .map(|i| [0.1 * i as f32, 0.3, 1.0 - 0.1 * i as f32])
            .collect(),
    );
    builder
        .floor(3.0, 0.0, floor)
        .quad(Vec3::new(-1.5, 0.0, 0.5), Vec3::X, Vec3::Y, leaf)
        .quad(Vec3::new(0.5, 0.0, 0.5), Vec3::X, Vec3::Y, grid)
        .triangle(
            [
                Vec3::new(-1.0, 1.5, 0.0),
                Vec3::new(0.0, 1.5, 0.0),
                Vec3::new(0.0, 1.5, 1.0),
            ],
            [Vec2::ZERO; 3],
            light(5.0),
        )
        .sphere(Vec3::new(0.0, 0.4, -0.5), 0.4, glass)
        .sphere(Vec3::new(1.2, 1.2, -0.5), 0.2, light(6.0))
        .point(Vec3::new(-0.5, 1.0, 1.0), Vec3::new(0.5, 0.4, 0.3))
        .directional(Vec3::new(0.4, -1.0, -0.2), Vec3::new(0.8, 0.9, 1.0))
        .environment(Some(sky), Vec3::splat(0.4), 40.0)
        .with(|s| {
            (s.camera.optics, s.camera.focus_distance) =
                (s.camera.optics.with_aperture(0.05), Some(3.0))
        })
        .build()
}

/// Returns a job of an integrator, with Russian roulette.
pub fn technique_job(name: &str, seed: u64) -> Job {
    named_job(name, [64, 36], 5, seed).with(|settings| settings.rr_start = Some(3))
}

#[test]
fn bpt_renders_the_samples_of_the_cpu_in_every_tracing_mode() {
    assert_same_in_modes(
        &TracingMode::ALL,
        "bpt",
        &room(),
        &technique_job("bpt", 1),
        16,
    );
}

/// Replaces the any-hit shader by one that ignores every hit: where it runs, a surface is invisible.
#[test]
fn only_triangles_with_masks_call_the_any_hit_shader() {
    let device = or_return!(harness::device());
    if !supported_modes(&device).contains(&TracingMode::Pipeline) {
        return;
    }
    let mut builder = SceneBuilder::new(Vec3::Z * 3.0, Vec3::ZERO, 40.0);
    let whole = builder.texture(Texture::new(1, 1, vec![[1.0; 3]]));
    let masked = Material {
        mask_texture: whole,
        ..light(1.0)
    };
    let (left, right, edge) = (Vec3::new(-2.0, -2.0, 0.0), Vec3::NEG_Y * 2.0, Vec3::X * 2.0);
    let scene = builder
        .quad(left, edge, Vec3::Y * 4.0, light(1.0))
        .quad(right, edge, Vec3::Y * 4.0, masked)
        .sphere(Vec3::Z * 0.5, 0.2, masked)
        .build();
    let module = include_bytes!("parity/spirv/ignore_all.rahit.spv").as_slice();
    let ignoring = Sources::Replaced(Arc::new([("mask.rahit.spv", module)]));
    let job = job([9, 9], 2, 1);
    for (sources, right) in [(Sources::Embedded, 1.0), (ignoring, 0.0)] {
        let mut renderer =
            VulkanRenderer::new(&device, TracingMode::Pipeline, &sources, &scene, &job).unwrap();
        renderer.advance(1).unwrap();
        let seen = [1, 4, 7].map(|x| renderer.film().mean().at(x, 4)[0]);
        assert_eq!(seen, [1.0, 1.0, right], "left, on the sphere, right");
    }
    harness::assert_no_validation_messages();
}

#[test]
fn nee_renders_the_samples_of_the_cpu_with_all_lights_masks_textures_and_a_lens() {
    let filter = FilterSpec {
        kind: FilterKind::Gauss,
        radius: 1.0,
    };
    assert_same_in_modes(
        &[TracingMode::Pipeline, TracingMode::Query],
        "nee",
        &scene_with_all_lights(),
        &technique_job("nee", 2).with(|settings| settings.filter = filter),
        8,
    );
}

#[test]
fn bdpt_renders_the_samples_of_the_cpu_with_float_and_integer_splats() {
    let (scene, job) = (room(), technique_job("bdpt", 3));
    assert_same_in_modes(&[TracingMode::Pipeline], "bdpt", &scene, &job, 4);
    let whole = or_return!(harness::integer_splat_device());
    let expected = common::render(&scene, job.clone(), 4);
    let once = render(&whole, TracingMode::Compute, &scene, &job, 4);
    compare("bdpt with integer splats", &once, &expected);
    let mut waves = VulkanRenderer::new(
        &whole,
        TracingMode::Compute,
        &harness::sources(),
        &scene,
        &job,
    )
    .unwrap();
    for samples in [1, 3] {
        waves.advance(samples).unwrap();
    }
    assert!(
        *waves.film() == once,
        "other waves change the bits of the film"
    );
    harness::assert_no_validation_messages();
}

#[test]
fn all_kinds_of_cameras_show_the_picture_of_the_cpu() {
    let filter = FilterSpec {
        kind: FilterKind::Tent,
        radius: 1.5,
    };
    for kind in [CameraKind::Orthographic, CameraKind::Spherical] {
        for name in ["nee", "bdpt"] {
            assert_same_in_modes(
                &[TracingMode::Pipeline],
                &format!("{name}, {}", kind.name()),
                &seen_by(kind),
                &technique_job(name, 4).with(|settings| settings.filter = filter),
                4,
            );
        }
    }
}

#[test]
fn layers_and_sobol_samples_are_those_of_the_cpu() {
    let device = or_return!(harness::device());
    let layers = lumbre_vulkan::LAYERS.to_vec();
    // This job has the same pipeline as one in `corners.rs`.
    let job = Job {
        sampler: SOBOL,
        resolution: [24, 16],
        ..technique_job("bdpt", 4)
    }
    .with(|settings| settings.films = layers);
    let scene = balls("environment");
    let mut cpu = CpuRenderer::new(Arc::clone(&scene), job.clone()).unwrap();
    cpu.advance(4).unwrap();
    let kind = harness::fastest_to_compile(&device);
    let mut renderer =
        VulkanRenderer::new(&device, kind, &harness::sources(), &scene, &job).unwrap();
    renderer.advance(1).unwrap();
    renderer.advance(3).unwrap();
    compare_loosely("picture with layers", renderer.film(), cpu.film());
    assert_eq!(renderer.layers(), cpu.layers());
    let mut lit = 0;
    for (i, film) in cpu.layers().iter().enumerate() {
        let (found, expected) = (renderer.layer(i).unwrap(), cpu.layer(i).unwrap());
        let total = |f: &Film| f.sum.as_flattened().iter().map(|x| x.abs()).sum::<f64>();
        let far = found
            .sum
            .as_flattened()
            .iter()
            .zip(expected.sum.as_flattened())
            .map(|(a, b)| (a - b).abs());
        let scale = total(&expected) / expected.sum.len() as f64;
        // Nearly all values agree; paths behind glass balls that diverge by rounding change a few.
        let off = far.filter(|d| *d > 0.01 * scale.max(1e-6)).count();
        assert!(
            off as f64 <= 0.02 * (3 * expected.sum.len()) as f64,
            "{}: {off} values differ",
            film.name()
        );
        lit += usize::from(total(&expected) > 0.0);
    }
    assert!(lit > 20, "only {lit} films have light");
    harness::assert_no_validation_messages();
}

#[test]
fn scenes_seeds_and_sizes_share_a_pipeline_and_techniques_reuse_theirs() {
    let device = or_return!(harness::device());
    // Other tests create pipelines at the same time, so this one opens another device.
    let device = Device::open(device.info.clone(), device.info.caps).unwrap();
    let ball = |x: f32| {
        let builder =
            SceneBuilder::new(Vec3::Z * 3.0, Vec3::ZERO, 50.0).sphere(Vec3::X * x, 0.5, grey(0.5));
        builder.environment(None, Vec3::ONE, 0.0).build()
    };
    let film = |x: f32, job: Job| {
        render(
            &device,
            harness::fastest_to_compile(&device),
            &ball(x),
            &job,
            1,
        )
    };
    let plain = job([16, 16], 2, 1);
    film(0.0, plain.clone());
    assert_eq!(device.pipeline_registry.count(), 1);
    film(
        0.3,
        Job {
            seed: 2,
            resolution: [20, 12],
            max_depth: 3,
            ..plain.clone()
        },
    );
    assert_eq!(device.pipeline_registry.count(), 1);
    let late = plain
        .clone()
        .with(|settings| settings.timing = Some(harness::timing(0.0, 1.0, 8)));
    film(0.0, late.clone());
    assert_eq!(
        device.pipeline_registry.count(),
        2,
        "a time axis must have another pipeline, so that jobs without one pay nothing for it"
    );
    let shared = common::render(&ball(0.3), plain.clone(), 1);
    compare("from the pipeline registry", &film(0.3, plain), &shared);
    film(0.1, late);
    assert_eq!(device.pipeline_registry.count(), 2);
    harness::assert_no_validation_messages();
}

/// Returns the checkpoint of a run.
pub fn state(renderer: &VulkanRenderer) -> Vec<u8> {
    let mut state = Vec::new();
    assert!(renderer.save(&mut state).unwrap());
    state
}

#[test]
fn a_run_resumed_from_a_checkpoint_has_the_same_bits() {
    let exact = or_return!(harness::integer_splat_device());
    let scene = room();
    // `bdpt` uses the compute shader of the test of its splats.
    let open = |job: &Job| {
        let kind = if job.integrator.splats {
            TracingMode::Compute
        } else {
            harness::fastest_to_compile(&exact)
        };
        VulkanRenderer::new(&exact, kind, &harness::sources(), &scene, job).unwrap()
    };
    let small = |name: &str, layers: &[Layer]| {
        Job {
            resolution: [20, 14],
            ..technique_job(name, 5)
        }
        .with(|settings| settings.films = layers.to_vec())
    };
    let splats = small("bdpt", &[]);
    let mut last = None;
    for job in [small("nee", &[Layer::Depth, Layer::Rays]), splats.clone()] {
        let mut whole = open(&job);
        whole.advance(5).unwrap();
        let mut first = open(&job);
        first.advance(2).unwrap();
        let saved = state(&first);
        drop(first);
        let mut second = open(&job);
        second.restore(&saved).unwrap();
        assert_eq!(second.film().samples, 2);
        assert_eq!(
            state(&second),
            saved,
            "a restored checkpoint is saved with other bytes"
        );
        second.advance(3).unwrap();
        assert!(
            second.film() == whole.film(),
            "the film of {} differs",
            job.integrator.name
        );
        for i in 0..whole.layers().len() {
            assert!(
                second.layer(i) == whole.layer(i),
                "{}",
                whole.layers()[i].name()
            );
        }
        last = Some((second, saved));
    }
    let (second, saved) = last.unwrap();
    // Refused are a run without splats, a run of another size, and a truncated checkpoint.
    let (smaller, without) = (
        Job {
            resolution: [10, 14],
            ..splats
        },
        technique_job("bpt", 5),
    );
    for (mut other, bytes) in [
        (open(&without), &saved[..]),
        (open(&smaller), &saved[..]),
        (second, &saved[..99]),
    ] {
        let error = other.restore(bytes).unwrap_err().to_string();
        assert!(error.contains("does not match this run"), "{error}");
    }
    harness::assert_no_validation_messages();
}
