//! The samples of a pixel may be rendered at once, or each as soon as the path before it has ended. This
//! changes no bit of the film, the checkpoint and the counts, and a run of one kind continues from a
//! checkpoint of the other.

use std::sync::Arc;

use glam::Vec3;
use lumbre_light::film::layer::Layer;
use lumbre_light::scene::CompiledScene;
use lumbre_render::{Job, Renderer};
use lumbre_vulkan::context::device::Device;
use lumbre_vulkan::pipelines::program::TracingMode;
use lumbre_vulkan::renderer::VulkanRenderer;
use lumbre_vulkan::schedule::pixel_samples::PixelSamples;

use super::ahead::counts;
use super::harness;
use super::images::{room, state, supported_modes, technique_job};
use crate::common::{SceneBuilder, grey};

/// Fewer samples at once than a wave has, so that it has several parts, and no divisor of them.
const PARALLEL: PixelSamples = PixelSamples::Parallel(3);

/// Samples of each wave, and number of samples announced to follow.
const WAVES: [(u64, u64); 4] = [(1, 5), (8, 20), (20, 2), (2, 0)];

fn open(
    device: &Arc<Device>,
    kind: TracingMode,
    scene: &CompiledScene,
    job: &Job,
    samples: PixelSamples,
) -> VulkanRenderer {
    let sources = harness::sources();
    VulkanRenderer::with_samples(device, kind, &sources, scene, job, samples).unwrap()
}

/// Renders a job with samples in turn and by another schedule, and compares everything after every
/// wave. Returns the number of invalid samples.
fn compare(
    device: &Arc<Device>,
    kind: TracingMode,
    scene: &CompiledScene,
    job: &Job,
    schedule: PixelSamples,
) -> u64 {
    let name = format!(
        "{} by {}, {schedule:?}",
        job.integrator.name,
        kind.backend()
    );
    let [mut in_turn, mut other] =
        [PixelSamples::InTurn, schedule].map(|samples| open(device, kind, scene, job, samples));
    let mut invalid = 0;
    for (i, (samples, more)) in WAVES.into_iter().enumerate() {
        let expected = in_turn.render(&harness::ahead(samples, more)).unwrap();
        let found = other.render(&harness::ahead(samples, more)).unwrap();
        assert_eq!(counts(&found), counts(&expected), "{name}, wave {i}");
        assert_eq!(
            found.first_invalid, expected.first_invalid,
            "{name}, wave {i}"
        );
        assert!(
            state(&other) == state(&in_turn),
            "{name}, wave {i}: the films differ"
        );
        invalid += found.invalid;
    }
    // A run continues from the checkpoint of one of the other kind.
    in_turn.restore(&state(&other)).unwrap();
    in_turn.advance(2).unwrap();
    other.advance(2).unwrap();
    assert!(state(&other) == state(&in_turn), "{name}: continued");
    invalid
}

#[test]
fn samples_at_once_have_the_bits_of_samples_in_turn() {
    let device = or_return!(harness::integer_splat_device());
    let (scene, fastest) = (room(), harness::fastest_to_compile(&device));
    let small = |name: &str| Job {
        resolution: [21, 13],
        first_sample: u64::from(u32::MAX) - 4,
        ..technique_job(name, 81)
    };
    for name in ["bpt", "nee", "bdpt"] {
        compare(&device, fastest, &scene, &small(name), PARALLEL);
    }
    for kind in supported_modes(&device) {
        if kind != fastest {
            compare(&device, kind, &scene, &small("bpt"), PARALLEL);
        }
    }
    harness::assert_no_validation_messages();
}

#[test]
fn regenerated_paths_have_the_bits_of_samples_in_turn() {
    let device = or_return!(harness::integer_splat_device());
    let (scene, kind) = (room(), harness::fastest_to_compile(&device));
    let plain = |name: &str| Job {
        resolution: [21, 13],
        ..technique_job(name, 83)
    };
    let with_films = plain("nee").with(|settings| {
        settings.films = vec![Layer::Depth, Layer::Rays];
        settings.timing = Some(harness::timing(0.0, 1.0, 8));
    });
    for job in [plain("bpt"), plain("nee"), plain("bdpt"), with_films] {
        compare(&device, kind, &scene, &job, PixelSamples::Regenerated);
    }
    harness::assert_no_validation_messages();
}

#[test]
fn invalid_samples_at_once_are_refused_as_those_in_turn() {
    let device = or_return!(harness::device());
    // A lamp so bright that its light is infinite in some samples.
    let mut lamp = grey(0.5);
    lamp.emission = Vec3::splat(3e38);
    let scene = SceneBuilder::new(Vec3::new(0.0, 0.0, 1.9), Vec3::ZERO, 60.0)
        .room(2.0, grey(0.9))
        .ceiling(0.5, 1.9, lamp)
        .build();
    let job = Job {
        resolution: [21, 13],
        ..technique_job("bpt", 82)
    }
    .with(|settings| settings.rr_start = Some(1));
    let kind = harness::fastest_to_compile(&device);
    for schedule in [PARALLEL, PixelSamples::Regenerated] {
        let invalid = compare(&device, kind, &scene, &job, schedule);
        assert!(invalid > 0, "the scene has no invalid sample");
    }
    harness::assert_no_validation_messages();
}
