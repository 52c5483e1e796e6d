//! The validation layer's own checks: accesses of shaders outside of buffers (GPU-assisted), and
//! missing barriers. An instance has one of the two kinds, so each runs in a process of its own, and
//! each must find a planted fault. All other tests have the second kind.

use std::process::Command;
use std::sync::Arc;

use ash::vk;
use lumbre_light::scene::CompiledScene;
use lumbre_render::{Job, Renderer};
use lumbre_vulkan::context::{device::Device, instance};
use lumbre_vulkan::memory::buffer::Buffer;
use lumbre_vulkan::pipelines::program::TracingMode;
use lumbre_vulkan::pipelines::sources::Sources;
use lumbre_vulkan::renderer::VulkanRenderer;

use super::harness;
use super::images::{scene_with_all_lights, technique_job};

/// Runs one of the ignored tests of this file in another process, with this kind of validation.
/// Does nothing without a device or, unless devices are required, without the layer.
fn run_apart(name: &str, kind: &str) {
    if harness::device().is_none() {
        return;
    }
    if !instance::shared().unwrap().validated {
        assert!(
            !harness::required(),
            "the validation layer is not installed"
        );
        return crate::common::skipped("the validation layer is not installed");
    }
    let output = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", name, "--ignored", "--nocapture"])
        .env("LUMBRE_VALIDATION", kind)
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.success() && text.contains("1 passed"),
        "{text}"
    );
}

/// Renders a sample of a small picture.
fn render(
    device: &Arc<Device>,
    kind: TracingMode,
    sources: &Sources,
    scene: &Arc<CompiledScene>,
    job: &Job,
) {
    let small = Job {
        resolution: [9, 5],
        ..job.clone()
    };
    let mut renderer = VulkanRenderer::new(device, kind, sources, scene, &small).unwrap();
    renderer.advance(1).unwrap();
}

#[test]
fn gpu_assisted_validation_accepts_shaders_and_finds_a_planted_access() {
    run_apart("validation::shaders_stay_inside_their_buffers", "gpu");
}

#[test]
#[ignore = "run by the test above, in a process with another kind of validation"]
fn shaders_stay_inside_their_buffers() {
    let device = harness::device().unwrap();
    assert!(instance::shared().unwrap().validated);
    // Software drivers take minutes and gigabytes to compile larger shaders with these checks.
    let (kind, job) = (
        harness::fastest_to_compile(&device),
        technique_job("bpt", 90),
    );
    let scene = scene_with_all_lights();
    render(&device, kind, &Sources::Embedded, &scene, &job);
    harness::assert_no_validation_messages();
    let beyond = harness::replaced_integrator!("beyond");
    render(&device, kind, &beyond, &scene, &job);
    let messages = instance::validation_messages().join("\n");
    assert!(messages.contains("out of bounds"), "{messages}");
}

#[test]
fn synchronisation_validation_finds_a_planted_hazard() {
    run_apart("validation::a_missing_barrier_is_reported", "1");
}

#[test]
#[ignore = "run by the test above, in a process whose messages no other test sees"]
#[expect(unsafe_code, reason = "Vulkan is a C interface")]
fn a_missing_barrier_is_reported() {
    let device = harness::device().unwrap();
    let buffer = Buffer::zeros(&device, "filled twice", 64).unwrap();
    let fill_twice = |barrier: bool| {
        device
            .run("fill twice", |commands| {
                for value in [1, 2] {
                    // SAFETY: the commands are being recorded, and the buffer may be filled.
                    unsafe {
                        (device.raw).cmd_fill_buffer(commands, buffer.raw, 0, vk::WHOLE_SIZE, value)
                    };
                    let copies = vk::PipelineStageFlags::TRANSFER;
                    let write = (copies, vk::AccessFlags::TRANSFER_WRITE);
                    if barrier {
                        device.barrier(commands, write, write);
                    }
                }
            })
            .unwrap();
    };
    fill_twice(true);
    harness::assert_no_validation_messages();
    fill_twice(false);
    let messages = instance::validation_messages().join("\n");
    assert!(messages.contains("WRITE_AFTER_WRITE"), "{messages}");
}
