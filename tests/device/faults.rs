//! Failures are errors that state what was needed and what was found; nothing else is lost.

use std::process::Command;
use std::sync::Arc;

use glam::Vec3;
use lumbre::render::vulkan::context::{device::Device, physical_device::Caps};
use lumbre::render::vulkan::error::VulkanError;
use lumbre::render::vulkan::memory::buffer::Buffer;
use lumbre::render::vulkan::pipelines::program::TracingMode;
use lumbre::render::vulkan::pipelines::spirv::{ShaderError, Sources};
use lumbre::render::vulkan::renderer::{VulkanRenderer, into_render_error};
use lumbre::render::{Job, RenderError, Renderer};
use lumbre::transport::integrator::integrator;

use super::harness;
use crate::common::{SceneBuilder, grey, job};

fn scene() -> Arc<lumbre::scene::CompiledScene> {
    SceneBuilder::new(Vec3::Z * 3.0, Vec3::ZERO, 50.0)
        .quad(
            Vec3::new(-1.0, -1.0, 0.0),
            Vec3::X * 2.0,
            Vec3::Y * 2.0,
            grey(0.5),
        )
        .environment(None, Vec3::ONE, 0.0)
        .build()
}

fn open(
    device: &Arc<Device>,
    kind: TracingMode,
    sources: &Sources,
    job: &Job,
) -> Result<VulkanRenderer, VulkanError> {
    VulkanRenderer::new(device, kind, sources, &scene(), job)
}

#[test]
fn a_device_without_a_feature_says_which_one_is_needed() {
    let Some(device) = harness::device() else {
        return;
    };
    let bare = Caps {
        scalar_layout: true,
        ..Caps::default()
    };
    let bare = Device::open(device.info.clone(), bare).unwrap();
    for (kind, what) in [
        (TracingMode::Pipeline, "ray_tracing_pipeline"),
        (TracingMode::Query, "ray_query"),
    ] {
        let error = open(&bare, kind, &Sources::Embedded, &job([8, 8], 2, 1))
            .err()
            .unwrap();
        assert!(
            error.to_string().contains(what) && error.to_string().contains(&bare.info.name),
            "{error}"
        );
        assert!(matches!(
            into_render_error(kind, error),
            RenderError::Unsupported { .. }
        ));
    }
    let bdpt = Job {
        integrator: integrator("bdpt").unwrap(),
        ..job([8, 8], 2, 1)
    };
    let error = open(&bare, TracingMode::Compute, &Sources::Embedded, &bdpt)
        .err()
        .unwrap()
        .to_string();
    assert!(error.contains("shaderFloat64"), "{error}");
    // The remaining features still work: a grey card before a white sky.
    let mut renderer = open(
        &bare,
        TracingMode::Compute,
        &Sources::Embedded,
        &job([8, 8], 2, 1),
    )
    .unwrap();
    renderer.advance(4).unwrap();
    let mean = renderer.film().mean().at(0, 0)[0];
    assert!((0.4..=1.0).contains(&mean), "{mean}");
    assert!(
        Device::open(device.info.clone(), Caps::default()).is_err(),
        "nothing works without scalar layouts"
    );
    harness::silent();
}

#[test]
fn a_folder_of_shaders_changes_the_picture_or_names_its_mistake() {
    let Some(device) = harness::device() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let entry = folder.path().join("transport/integrator");
    std::fs::create_dir_all(&entry).unwrap();
    let file = entry.join("bpt.glsl");
    std::fs::write(
        &file,
        "#include \"film/film.glsl\"\nvoid bpt_sample(uvec2 pixel, inout Sampler n) { oops; }\n",
    )
    .unwrap();
    let sources = Sources::Folder(folder.path().to_owned());
    let error = open(&device, TracingMode::Compute, &sources, &job([8, 8], 2, 1))
        .err()
        .unwrap();
    let named = error.to_string();
    assert!(
        named.contains("transport/integrator/bpt.glsl:2") && named.contains("oops"),
        "{named}"
    );
    assert!(matches!(
        error,
        VulkanError::Shader(ShaderError::Invalid { .. })
    ));
    let constant = "void bpt_sample(uvec2 pixel, inout Sampler n) { sink(Contribution(pixel, vec3(2.5), vec3(2.5), 0u, 2u, 0.0)); }";
    std::fs::write(&file, constant).unwrap();
    let mut renderer = open(&device, TracingMode::Compute, &sources, &job([8, 8], 2, 1)).unwrap();
    renderer.advance(3).unwrap();
    assert!(renderer.film().mean().data.iter().all(|p| *p == [2.5; 3]));
    assert!(renderer.film().sum2.iter().all(|p| *p == [18.75; 3]));
    harness::silent();
}

#[test]
fn invalid_samples_are_counted_and_the_first_is_named() {
    let Some(device) = harness::device() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let entry = folder.path().join("transport/integrator");
    std::fs::create_dir_all(&entry).unwrap();
    let bad = "void bpt_sample(uvec2 pixel, inout Sampler n) {\n\
               float odd = pixel == uvec2(5u, 6u) ? uintBitsToFloat(0x7f800000u) : 1.0;\n\
               sink(Contribution(pixel, vec3(odd), vec3(odd), 0u, 2u, 0.0)); }";
    std::fs::write(entry.join("bpt.glsl"), bad).unwrap();
    let sources = Sources::Folder(folder.path().to_owned());
    let mut renderer = open(&device, TracingMode::Compute, &sources, &job([8, 8], 2, 1)).unwrap();
    let stats = renderer.advance(3).unwrap();
    assert_eq!((stats.invalid, stats.first_invalid), (3, Some([5, 6, 0])));
    assert_eq!(
        renderer.film().sum[6 * 8 + 5],
        [0.0; 3],
        "they count as black"
    );
    assert_eq!(renderer.film().sum[0], [3.0; 3]);
    harness::silent();
}

#[test]
fn what_does_not_fit_is_an_error_with_both_sizes() {
    let Some(device) = harness::device() else {
        return;
    };
    let range = device.info.limits.storage_range;
    let error = Buffer::new(&device, "texels", range + 4, Default::default())
        .err()
        .unwrap();
    let said = error.to_string();
    assert!(
        said.contains("texels") && said.contains("MiB") && said.contains("smaller"),
        "{said}"
    );
    assert!(matches!(
        into_render_error(TracingMode::Compute, error),
        RenderError::Unsupported { .. }
    ));
    harness::silent();
}

#[test]
fn a_scene_larger_than_the_device_is_refused_with_both_sizes() {
    let Some(device) = harness::device() else {
        return;
    };
    let mut small = device.info.clone();
    small.limits.heap = 1 << 10;
    let small = Device::open(small, device.info.caps).unwrap();
    let error = open(
        &small,
        TracingMode::Compute,
        &Sources::Embedded,
        &job([64, 64], 2, 1),
    )
    .err()
    .unwrap();
    let said = error.to_string();
    assert!(matches!(error, VulkanError::TooLarge { .. }), "{error:?}");
    assert!(
        said.contains(&small.info.name)
            && said.contains("offers 0 MiB")
            && said.contains("must fit"),
        "{said}"
    );
    harness::silent();
}

#[test]
fn a_lost_device_is_worth_another_try_and_says_in_which_pass_it_was_lost() {
    let (device, pass) = ("a device".to_owned(), "render".to_owned());
    let lost = VulkanError::Lost {
        device: device.clone(),
        pass: pass.clone(),
    };
    let stuck = VulkanError::Stuck {
        device,
        pass,
        seconds: 300,
    };
    for error in [lost, stuck] {
        let told = into_render_error(TracingMode::Pipeline, error);
        assert!(
            matches!(
                &told,
                RenderError::Lost {
                    backend: "vulkan",
                    ..
                }
            ),
            "{told:?}"
        );
        assert!(
            told.to_string().contains("a device") && told.to_string().contains("`render`"),
            "{told}"
        );
    }
    let result = ash::vk::Result::ERROR_INVALID_SHADER_NV;
    let refused = VulkanError::Call {
        call: "vkCreateComputePipelines",
        result,
        pass: "upload".to_owned(),
    };
    let told = into_render_error(TracingMode::Query, refused);
    assert!(matches!(&told, RenderError::Failed { .. }), "{told:?}");
    assert!(
        told.to_string().contains("vkCreateComputePipelines")
            && told.to_string().contains("INVALID_SHADER")
    );
}

#[test]
fn sums_lose_nothing_over_many_samples() {
    let Some(device) = harness::device() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let entry = folder.path().join("transport/integrator");
    std::fs::create_dir_all(&entry).unwrap();
    let tenth = "void bpt_sample(uvec2 pixel, inout Sampler n) { sink(Contribution(pixel, vec3(0.1), vec3(0.1), 0u, 2u, 0.0)); }";
    std::fs::write(entry.join("bpt.glsl"), tenth).unwrap();
    let sources = Sources::Folder(folder.path().to_owned());
    let mut renderer = open(&device, TracingMode::Compute, &sources, &job([1, 1], 2, 1)).unwrap();
    renderer.advance(1 << 20).unwrap();
    let exact = f64::from(0.1f32) * f64::from(1 << 20);
    let relative = (renderer.film().sum[0][0] / exact - 1.0).abs();
    let plain = (0..1u32 << 20).fold(0.0f32, |s, _| s + 0.1);
    assert!(relative < 1e-10, "{relative:e}");
    assert!(
        (f64::from(plain) / exact - 1.0).abs() > 1e-3,
        "a plain sum would have done"
    );
    harness::silent();
}

/// Needs no device: the loader is directed to a folder without drivers.
#[test]
fn without_a_device_the_plan_is_refused_with_what_was_found_and_auto_is_the_processor() {
    let place = tempfile::tempdir().unwrap();
    std::fs::write(
        place.path().join("ball.scn"),
        include_str!("../common/ball.scn"),
    )
    .unwrap();
    let script = "local x = experiment('night', { seed = 1 })\n\
        x:render(function(p) return { scene = 'ball.scn', integrator = 'bpt', resolution = { 8, 8 } } end)\n\
        x:stop(stop.samples(2))\nreturn x\n";
    std::fs::write(place.path().join("night.lua"), script).unwrap();
    let run = |backend: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_lumbre"));
        command
            .current_dir(place.path())
            .args(["run", "night.lua", "-q", "--backend", backend]);
        let nowhere = place.path().join("nowhere.json");
        let ended = command
            .env("VK_DRIVER_FILES", &nowhere)
            .env("VK_ICD_FILENAMES", &nowhere)
            .output()
            .unwrap();
        (
            ended.status.code(),
            String::from_utf8_lossy(&ended.stderr)
                .split_whitespace()
                .collect::<Vec<_>>()
                .join(" "),
        )
    };
    for backend in ["vulkan", "vulkan-query", "vulkan-compute"] {
        let (code, said) = run(backend);
        assert_eq!(code, Some(2), "{said}");
        assert!(
            said.contains(&format!("`{backend}` cannot be used on this machine: no")),
            "{said}"
        );
        assert!(said.contains("Vulkan loader"), "{said}");
    }
    assert!(!place.path().join("out").exists(), "nothing was begun");
    let (code, said) = run("auto");
    assert_eq!(code, Some(0), "{said}");
}
