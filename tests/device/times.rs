//! Films with a time axis and composed materials: the same samples in the same bins.

use std::sync::Arc;

use lumbre::film::time::{TimeCube, TimeFilter, sum_slots};
use lumbre::render::cpu::renderer::CpuRenderer;
use lumbre::render::vulkan::context::device::Device;
use lumbre::render::vulkan::error::VulkanError;
use lumbre::render::vulkan::pipelines::program::TracingMode;
use lumbre::render::vulkan::pipelines::spirv::Sources;
use lumbre::render::vulkan::renderer::VulkanRenderer;
use lumbre::render::{Job, Renderer};
use lumbre::scene::CompiledScene;
use lumbre::transport::delay::Profile;
use lumbre::transport::path_time::Timing;

use super::harness::{self, slow, timing};
use super::images::{compare, kinds, render, room, with};
use crate::common;

/// Returns the room of glass and metal, with delayed and composed materials of every kind.
fn slow_room() -> Arc<CompiledScene> {
    let mut scene = room();
    slow(Arc::make_mut(&mut scene));
    scene
}

fn open(
    device: &Arc<Device>,
    kind: TracingMode,
    scene: &CompiledScene,
    job: &Job,
) -> VulkanRenderer {
    VulkanRenderer::new(device, kind, &Sources::Embedded, scene, job).unwrap()
}

/// Checks that the bins of both hold the same light: the histogram of the whole picture, and each
/// pixel's.
fn same_bins(name: &str, found: &TimeCube, expected: &TimeCube) {
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
    assert!(lit > 20, "{name}: only {lit} slots show anything");
    // A path that diverges by rounding, or crosses an edge between bins, moves its light.
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
fn every_integrator_fills_the_bins_that_the_cpu_fills() {
    let Some(device) = harness::device() else {
        return;
    };
    let scene = slow_room();
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
            timing: Some(timing),
            resolution: [32, 20],
            ..with(name, 40 + i as u64)
        };
        let mut cpu = CpuRenderer::new(Arc::clone(&scene), job.clone()).unwrap();
        cpu.advance(samples).unwrap();
        let expected = cpu.times().unwrap();
        // Once in a compute shader as well.
        let able = |kind: &TracingMode| {
            *kind == harness::quick(&device) || (*kind == TracingMode::Compute && name == "bpt")
        };
        for kind in kinds(&device).into_iter().filter(able) {
            let name = format!("{name} by {}", kind.backend());
            let mut renderer = open(&device, kind, &scene, &job);
            // In two waves: no state of a sample may be left for the next one.
            for wave in [1, samples - 1] {
                assert_eq!(renderer.advance(wave).unwrap().invalid, 0);
            }
            let found = renderer.times().unwrap();
            same_bins(&name, &found, &expected);
            compare(&name, renderer.film(), cpu.film());
            let sums = found.sum.chunks_exact(found.axis.slots()).map(sum_slots);
            assert!(
                renderer.film().sum.iter().copied().eq(sums),
                "{name}: the film is the sum of its slots, bit by bit"
            );
        }
    }
    harness::silent();
}

#[test]
fn composed_materials_are_the_same_without_a_time_axis() {
    let Some(device) = harness::device() else {
        return;
    };
    let (scene, job) = (
        slow_room(),
        Job {
            resolution: [32, 20],
            ..with("bpt", 50)
        },
    );
    let expected = common::render(&scene, job.clone(), 16);
    compare(
        "composed materials",
        &render(&device, harness::quick(&device), &scene, &job, 16),
        &expected,
    );
    let plain = common::render(&room(), job, 16);
    assert!(plain != expected, "the parts look otherwise");
    harness::silent();
}

#[test]
fn bins_go_on_from_a_checkpoint_to_the_same_bits_and_many_slots_are_all_found() {
    let Some(device) = harness::exact() else {
        return;
    };
    let scene = slow_room();
    // A filter as wide as the axis: every contribution falls into more slots than are cached.
    let wide = Timing {
        filter: TimeFilter::Box(30.0),
        ..timing(1.0, 0.2, 60)
    };
    let job = Job {
        timing: Some(wide),
        resolution: [20, 14],
        ..with("nee", 7)
    };
    let kind = harness::quick(&device);
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
    same_bins("many slots", &whole.times().unwrap(), &cpu.times().unwrap());
    harness::silent();
}

#[test]
fn bins_that_do_not_fit_are_refused_with_both_sizes() {
    let Some(device) = harness::device() else {
        return;
    };
    let mut small = device.info.clone();
    small.limits.storage_range = 1 << 20;
    let small = Device::open(small, device.info.caps).unwrap();
    let job = Job {
        timing: Some(timing(0.0, 1e-3, 5000)),
        ..with("bpt", 1)
    };
    let error = VulkanRenderer::new(
        &small,
        TracingMode::Compute,
        &Sources::Embedded,
        &room(),
        &job,
    )
    .err()
    .unwrap();
    assert!(matches!(error, VulkanError::TooLarge { .. }), "{error:?}");
    let said = error.to_string();
    assert!(
        said.contains("time axis")
            && said.contains("offers 1 MiB")
            && said.contains("fewer or wider bins"),
        "{said}"
    );
    let bare = lumbre::render::vulkan::context::physical_device::Caps {
        doubles: false,
        ..device.info.caps
    };
    let bare = Device::open(device.info.clone(), bare).unwrap();
    let job = Job {
        timing: Some(timing(0.0, 1.0, 4)),
        resolution: [8, 8],
        ..with("bpt", 1)
    };
    let error = VulkanRenderer::new(
        &bare,
        TracingMode::Compute,
        &Sources::Embedded,
        &room(),
        &job,
    )
    .err()
    .unwrap();
    assert!(error.to_string().contains("shaderFloat64"), "{error}");
    harness::silent();
}
