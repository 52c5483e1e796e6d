//! Films with a time axis and composed materials: the same samples in the same bins.

use std::sync::Arc;

use lumbre_light::film::time::{TimeCube, TimeFilter, sum_slots};
use lumbre_light::scene::CompiledScene;
use lumbre_light::transport::delay::Profile;
use lumbre_light::transport::time_settings::Timing;
use lumbre_render::cpu::renderer::CpuRenderer;
use lumbre_render::{Job, Renderer};
use lumbre_vulkan::context::device::Device;
use lumbre_vulkan::error::VulkanError;
use lumbre_vulkan::pipelines::program::TracingMode;
use lumbre_vulkan::renderer::VulkanRenderer;

use super::harness::{self, add_delays, timing};
use super::images::{render, room, supported_modes, technique_job};
use super::verdict::compare;
use crate::common;

/// Returns the room of glass and metal, with delayed and composed materials of every kind.
fn room_with_delays() -> Arc<CompiledScene> {
    let mut scene = room();
    add_delays(Arc::make_mut(&mut scene));
    scene
}

fn open(
    device: &Arc<Device>,
    kind: TracingMode,
    scene: &CompiledScene,
    job: &Job,
) -> VulkanRenderer {
    VulkanRenderer::new(device, kind, &harness::sources(), scene, job).unwrap()
}

/// Checks that the bins of both hold the same light: the histogram of the whole picture, and each
/// pixel's.
fn assert_same_bins(name: &str, found: &TimeCube, expected: &TimeCube) {
    assert_eq!(
        (found.axis, found.samples),
        (expected.axis, expected.samples)
    );
    let (slots, n) = (found.axis.slots(), found.sum.len());
    let whole: f64 = expected.sum.as_flattened().iter().sum();
    let histogram = |cube: &TimeCube, slot: usize| -> f64 {
        cube.sum
            .chunks_exact(slots)
            .map(|pixel| pixel[slot].iter().sum::<f64>())
            .sum()
    };
    let lit = (0..slots)
        .filter(|slot| histogram(expected, *slot) > 1e-4 * whole)
        .count();
    assert!(lit > 20, "{name}: only {lit} slots have light");
    // A path that diverges by rounding, or crosses the edge between two bins, moves its light.
    for slot in 0..slots {
        let (a, b) = (histogram(found, slot), histogram(expected, slot));
        assert!(
            (a - b).abs() <= 2e-3 * whole,
            "{name}, slot {slot}: {a} instead of {b} of {whole}"
        );
    }
    let scale = whole / (3 * n) as f64;
    let far = |(a, b): &(&f64, &f64)| (*a - *b).abs() > 0.01 * b.abs().max(scale);
    let off = found
        .sum
        .as_flattened()
        .iter()
        .zip(expected.sum.as_flattened())
        .filter(far)
        .count();
    let far = |(a, b): &(&f32, &f32)| {
        f64::from((*a - *b).abs()) > 0.02 * f64::from(b.abs()).max(scale * scale)
    };
    let squares = found
        .square
        .as_flattened()
        .iter()
        .zip(expected.square.as_flattened())
        .filter(far)
        .count();
    let lit = expected
        .sum
        .as_flattened()
        .iter()
        .filter(|x| **x != 0.0)
        .count();
    println!("{name}: {off} sums and {squares} sums of squares of {lit} are off by more than 1 %");
    assert!(
        off * 100 <= lit && squares * 100 <= lit,
        "{name}: {off} and {squares} of {lit} are off"
    );
}

#[test]
fn every_integrator_fills_the_bins_of_the_cpu() {
    let device = or_return!(harness::device());
    let scene = room_with_delays();
    let plain = timing(1.0, 0.2, 60);
    let cases: [(&str, Timing, u64); 3] = [
        ("bpt", plain.clone(), 16),
        (
            "nee",
            Timing {
                filter: TimeFilter::Gauss(0.75),
                medium: 1.25,
                camera: false,
                ..plain.clone()
            },
            8,
        ),
        (
            "bdpt",
            Timing {
                filter: TimeFilter::Box(0.5),
                emission: Profile::Exponential(3.0),
                ..plain
            },
            4,
        ),
    ];
    for (i, (name, timing, samples)) in cases.into_iter().enumerate() {
        let job = Job {
            resolution: [32, 20],
            ..technique_job(name, 40 + i as u64)
        }
        .with(|settings| settings.timing = Some(timing));
        let mut cpu = CpuRenderer::new(Arc::clone(&scene), job.clone()).unwrap();
        cpu.advance(samples).unwrap();
        let expected = cpu.times().unwrap();
        // `bpt` is tested in a compute shader as well.
        let able = |kind: &TracingMode| {
            *kind == harness::fastest_to_compile(&device)
                || (*kind == TracingMode::Compute && name == "bpt")
        };
        for kind in supported_modes(&device).into_iter().filter(able) {
            let name = format!("{name} by {}", kind.backend());
            let mut renderer = open(&device, kind, &scene, &job);
            // Two waves detect state of a sample that is left for the next one.
            for wave in [1, samples - 1] {
                assert_eq!(renderer.advance(wave).unwrap().invalid, 0);
            }
            let found = renderer.times().unwrap();
            assert_same_bins(&name, &found, &expected);
            compare(&name, renderer.film(), cpu.film());
            let sums = found.sum.chunks_exact(found.axis.slots()).map(sum_slots);
            assert!(
                renderer.film().sum.iter().copied().eq(sums),
                "{name}: the film is not the sum of its slots, bit by bit"
            );
        }
    }
    harness::assert_no_validation_messages();
}

#[test]
fn composed_materials_are_the_same_without_a_time_axis() {
    let device = or_return!(harness::device());
    let (scene, job) = (
        room_with_delays(),
        Job {
            resolution: [32, 20],
            ..technique_job("bpt", 50)
        },
    );
    let expected = common::render(&scene, job.clone(), 16);
    compare(
        "composed materials",
        &render(
            &device,
            harness::fastest_to_compile(&device),
            &scene,
            &job,
            16,
        ),
        &expected,
    );
    let plain = common::render(&room(), job, 16);
    assert!(
        plain != expected,
        "composed materials must change the picture"
    );
    harness::assert_no_validation_messages();
}

#[test]
fn bins_resumed_from_a_checkpoint_have_the_same_bits_and_wide_filters_fill_all_slots() {
    let device = or_return!(harness::integer_splat_device());
    let scene = room_with_delays();
    // A filter as wide as the axis: every contribution falls into more slots than are cached.
    let wide = Timing {
        filter: TimeFilter::Box(30.0),
        ..timing(1.0, 0.2, 60)
    };
    let job = Job {
        resolution: [20, 14],
        ..technique_job("nee", 7)
    }
    .with(|settings| settings.timing = Some(wide));
    let kind = harness::fastest_to_compile(&device);
    let mut whole = open(&device, kind, &scene, &job);
    whole.advance(4).unwrap();
    let mut first = open(&device, kind, &scene, &job);
    first.advance(1).unwrap();
    let mut saved = Vec::new();
    assert!(first.save(&mut saved).unwrap());
    let mut second = open(&device, kind, &scene, &job);
    second.restore(&saved).unwrap();
    second.advance(3).unwrap();
    assert!(second.times() == whole.times() && second.film() == whole.film());
    let mut cpu = CpuRenderer::new(scene, job).unwrap();
    cpu.advance(4).unwrap();
    assert_same_bins("many slots", &whole.times().unwrap(), &cpu.times().unwrap());
    harness::assert_no_validation_messages();
}

#[test]
fn bins_that_do_not_fit_are_refused_with_both_sizes() {
    let device = or_return!(harness::device());
    let mut small = device.info.clone();
    small.limits.storage_range = 1 << 20;
    let small = Device::open(small, device.info.caps).unwrap();
    let job =
        technique_job("bpt", 1).with(|settings| settings.timing = Some(timing(0.0, 1e-3, 5000)));
    let error = VulkanRenderer::new(
        &small,
        TracingMode::Compute,
        &harness::sources(),
        &room(),
        &job,
    )
    .err()
    .unwrap();
    assert!(matches!(error, VulkanError::TooLarge { .. }), "{error:?}");
    let message = error.to_string();
    assert!(
        message.contains("time axis")
            && message.contains("offers 1 MiB")
            && message.contains("fewer or wider bins"),
        "{message}"
    );
    let limited = lumbre_vulkan::context::physical_device::Caps {
        doubles: false,
        ..device.info.caps
    };
    let limited = Device::open(device.info.clone(), limited).unwrap();
    let job = Job {
        resolution: [8, 8],
        ..technique_job("bpt", 1)
    }
    .with(|settings| settings.timing = Some(timing(0.0, 1.0, 4)));
    let error = VulkanRenderer::new(
        &limited,
        TracingMode::Compute,
        &harness::sources(),
        &room(),
        &job,
    )
    .err()
    .unwrap();
    assert!(error.to_string().contains("shaderFloat64"), "{error}");
    harness::assert_no_validation_messages();
}
