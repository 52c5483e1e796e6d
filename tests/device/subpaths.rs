//! The vertices of subpaths are in buffers: paths of any length, and more samples than have room at once.

use glam::Vec3;
use lumbre_light::transport::sampler::SOBOL;
use lumbre_render::{Job, Renderer};
use lumbre_vulkan::layout::SubpathVertex;
use lumbre_vulkan::memory::subpaths::SubpathRoom;
use lumbre_vulkan::renderer::VulkanRenderer;

use super::harness;
use super::images::{render, room, state, technique_job};
use super::verdict::difference;
use crate::common::{self, SceneBuilder, grey, light};

#[test]
fn pictures_of_which_a_few_rows_have_room_have_the_same_bits() {
    let device = or_return!(harness::integer_splat_device());
    let (scene, kind) = (room(), harness::fastest_to_compile(&device));
    for name in ["bdpt", "lvc"] {
        let job = Job {
            resolution: [64, 40],
            max_depth: 20,
            sampler: SOBOL,
            ..technique_job(name, 33)
        };
        let whole = SubpathRoom::new(&job, None, u64::MAX);
        assert_eq!(whole.rows(64), 40, "{name}");
        // Just more than three rows have room beside the subpaths that samples share.
        let vertices = whole.shared() + (3 * 64 + 10) * u64::from(whole.of_sample);
        let narrow = harness::changed(&device, |limits, _| {
            limits.storage_range = vertices * size_of::<SubpathVertex>() as u64;
        });
        let room = SubpathRoom::new(&job, None, narrow.info.limits.storage_range);
        assert_eq!(room.rows(64), 3, "{name}");
        let states = [&device, &narrow].map(|device| {
            let sources = harness::sources();
            let mut run = VulkanRenderer::new(device, kind, &sources, &scene, &job).unwrap();
            for (samples, more) in [(1, 4), (5, 0), (3, 3)] {
                run.render(&harness::ahead(samples, more)).unwrap();
            }
            state(&run)
        });
        assert!(states[0] == states[1], "{name}: the films differ");
    }
    harness::assert_no_validation_messages();
}

#[test]
fn paths_of_hundreds_of_edges_bring_the_light_that_they_bring_on_the_cpu() {
    let device = or_return!(harness::device());
    // Without roulette all paths in a closed room go on to the end, and in a white one these matter.
    let scene = SceneBuilder::new(Vec3::new(0.0, 0.0, 1.9), Vec3::ZERO, 60.0)
        .room(2.0, grey(0.99))
        .ceiling(0.5, 1.99, light(8.0))
        .build();
    let long = Job {
        resolution: [16, 12],
        max_depth: 160,
        ..technique_job("bdpt", 34)
    }
    .with(|settings| settings.rr_start = None);
    let short = Job {
        max_depth: 60,
        ..long.clone()
    };
    let kind = harness::fastest_to_compile(&device);
    let expected = common::render(&scene, long.clone(), 2);
    let [long, short] = [long, short].map(|job| {
        let found = difference(&render(&device, kind, &scene, &job, 2), &expected);
        let total = found.mean * (3 * found.pixels) as f64;
        (found.sum / total, found.deviation / total)
    });
    // After so many edges rounding has led many paths another way, so only the means are equal.
    assert!(long.0.abs() < 3.0 * long.1 + 1e-3, "{long:?}");
    assert!(long.1 < 0.03, "{long:?}");
    assert!(short.0 < -0.1, "{short:?}");
    harness::assert_no_validation_messages();
}
