//! Failures are errors that state what was needed and what was found; nothing else is lost.

use std::process::Command;
use std::sync::Arc;

use glam::Vec3;
use lumbre_render::{Job, RenderError, Renderer};
use lumbre_vulkan::context::{device::Device, physical_device::Caps};
use lumbre_vulkan::error::VulkanError;
use lumbre_vulkan::memory::buffer::Buffer;
use lumbre_vulkan::pipelines::program::TracingMode;
use lumbre_vulkan::pipelines::sources::{ShaderError, Sources};
use lumbre_vulkan::renderer::{VulkanRenderer, into_render_error};

use super::harness;
use super::images::supported_modes;
use crate::common::{SceneBuilder, grey, job, named_job};

fn scene() -> Arc<lumbre_light::scene::CompiledScene> {
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
fn a_missing_feature_is_an_error_that_names_the_feature_and_the_device() {
    let device = or_return!(harness::device());
    let limited = Caps {
        scalar_layout: true,
        ..Caps::default()
    };
    let limited = Device::open(device.info.clone(), limited).unwrap();
    for (kind, what) in [
        (TracingMode::Pipeline, "ray_tracing_pipeline"),
        (TracingMode::Query, "ray_query"),
    ] {
        let error = open(&limited, kind, &Sources::Embedded, &job([8, 8], 2, 1))
            .err()
            .unwrap();
        assert!(
            error.to_string().contains(what) && error.to_string().contains(&limited.info.name),
            "{error}"
        );
        assert!(matches!(
            into_render_error(kind, error),
            RenderError::Unsupported { .. }
        ));
    }
    // The remaining features still work: the picture shows a grey square before a white sky.
    for name in ["bpt", "bdpt"] {
        let job = named_job(name, [8, 8], 2, 1);
        let mut renderer = open(&limited, TracingMode::Compute, &Sources::Embedded, &job).unwrap();
        renderer.advance(4).unwrap();
        let mean = renderer.film().mean().at(0, 0)[0];
        assert!((0.4..=1.2).contains(&mean), "{name}: {mean}");
    }
    assert!(
        Device::open(device.info.clone(), Caps::default()).is_err(),
        "scalar layouts must be required"
    );
    harness::assert_no_validation_messages();
}

#[test]
fn shaders_of_a_folder_replace_the_embedded_ones_and_their_errors_name_the_line() {
    let device = or_return!(harness::device().filter(|_| harness::has_compiler()));
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
    let constant = "void bpt_sample(uvec2 pixel, inout Sampler n) { \
                    sink(Contribution(pixel, vec3(2.5), vec3(2.5), 0u, 2u, Length(0.0))); }";
    std::fs::write(&file, constant).unwrap();
    let mut renderer = open(&device, TracingMode::Compute, &sources, &job([8, 8], 2, 1)).unwrap();
    renderer.advance(3).unwrap();
    assert!(renderer.film().mean().data.iter().all(|p| *p == [2.5; 3]));
    assert!(renderer.film().sum2.iter().all(|p| *p == [18.75; 3]));
    harness::assert_no_validation_messages();
}

/// Returns sources in which `bpt` is the integrator of `parity/constant.integrator`, and a seed with
/// which it returns `value`, and `odd` at pixel (5, 6).
fn constant(value: f32, odd: f32) -> (Sources, u64) {
    let seed = u64::from(odd.to_bits()) << 32 | u64::from(value.to_bits());
    (harness::replaced_integrator!("constant"), seed)
}

#[test]
fn invalid_samples_are_counted_and_the_first_is_named() {
    let device = or_return!(harness::device());
    let (sources, seed) = constant(1.0, f32::INFINITY);
    let job = job([8, 8], 2, seed);
    for kind in supported_modes(&device) {
        let mut renderer = open(&device, kind, &sources, &job).unwrap();
        let stats = renderer.advance(3).unwrap();
        assert_eq!((stats.invalid, stats.first_invalid), (3, Some([5, 6, 0])));
        assert_eq!(
            renderer.film().sum[6 * 8 + 5],
            [0.0; 3],
            "invalid samples must count as black"
        );
        assert_eq!(renderer.film().sum[0], [3.0; 3]);
    }
    harness::assert_no_validation_messages();
}

/// Rays with NaN, infinite origins or directions of no length are undefined in ray-tracing
/// hardware: they must not reach it.
#[test]
fn rays_that_are_undefined_for_devices_hit_nothing() {
    let device = or_return!(harness::device());
    let ball = SceneBuilder::new(Vec3::Z * 3.0, Vec3::ZERO, 50.0)
        .sphere(Vec3::ZERO, 0.5, grey(0.5))
        .build();
    let seed = u64::from(f32::INFINITY.to_bits()) << 32 | u64::from(f32::NAN.to_bits());
    let sources = harness::replaced_integrator!("odd_rays");
    let traces = |kind: &TracingMode| *kind != TracingMode::Compute;
    for kind in supported_modes(&device).into_iter().filter(traces) {
        let job = job([8, 1], 2, seed);
        let mut renderer = VulkanRenderer::new(&device, kind, &sources, &ball, &job).unwrap();
        renderer.advance(1).unwrap();
        let hits: Vec<f64> = renderer.film().sum.iter().map(|sum| sum[0]).collect();
        let expected = [3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        assert_eq!(hits, expected, "{}", kind.backend());
    }
    harness::assert_no_validation_messages();
}

#[test]
fn a_buffer_beyond_the_limit_is_an_error_with_both_sizes() {
    let device = or_return!(harness::device());
    let range = device.info.limits.storage_range;
    let error = Buffer::new(&device, "texels", range + 4, Default::default())
        .err()
        .unwrap();
    let message = error.to_string();
    assert!(
        message.contains("texels") && message.contains("MiB") && message.contains("smaller"),
        "{message}"
    );
    assert!(matches!(
        into_render_error(TracingMode::Compute, error),
        RenderError::Unsupported { .. }
    ));
    harness::assert_no_validation_messages();
}

/// Returns the error of a buffer of `bytes` bytes that is never bound.
fn unbound_buffer(device: &Arc<Device>, bytes: u64) -> String {
    let error = Buffer::by_address(device, "a large array", bytes, Default::default())
        .err()
        .unwrap();
    assert!(matches!(error, VulkanError::TooLarge { .. }), "{error:?}");
    error.to_string()
}

#[test]
fn memory_is_asked_for_before_it_is_allocated() {
    let device = or_return!(harness::device());
    let mut info = device.info.clone();
    info.limits.allocation = 1 << 20;
    let limited = Device::open(info, device.info.caps).unwrap();
    let message = unbound_buffer(&limited, (1 << 20) + 4);
    assert!(message.contains("no larger buffer"), "{message}");
    if !device.info.caps.memory_budget {
        return crate::common::skipped(format_args!(
            "{} does not report free memory",
            device.info.line()
        ));
    }
    let (left, heap) = (device.info.memory_left(), device.info.limits.heap);
    assert!(0 < left && left < heap, "{left} of {heap} bytes are left");
    let mut info = device.info.clone();
    info.limits.allocation = u64::MAX;
    let unlimited = Device::open(info, device.info.caps).unwrap();
    let message = unbound_buffer(&unlimited, heap);
    assert!(message.contains("is in use"), "{message}");
    harness::assert_no_validation_messages();
}

#[test]
fn more_arrays_than_a_shader_of_the_device_can_access_are_refused() {
    let device = or_return!(harness::device());
    let mut info = device.info.clone();
    info.limits.storage_buffers = 31;
    let limited = Device::open(info, device.info.caps).unwrap();
    let error = open(
        &limited,
        TracingMode::Compute,
        &Sources::Embedded,
        &job([8, 8], 2, 1),
    );
    let error = error.err().unwrap().to_string();
    assert!(
        error.contains("36 storage buffers in one shader (at most 31)"),
        "{error}"
    );
}

#[test]
fn a_scene_larger_than_the_device_is_refused_with_both_sizes() {
    let device = or_return!(harness::device());
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
    let message = error.to_string();
    assert!(matches!(error, VulkanError::TooLarge { .. }), "{error:?}");
    assert!(
        message.contains(&small.info.name)
            && message.contains("offers 0 MiB")
            && message.contains("must fit"),
        "{message}"
    );
    harness::assert_no_validation_messages();
}

#[test]
fn a_lost_device_is_an_error_to_retry_that_names_the_pass() {
    let (device, pass) = ("a device".to_owned(), "render".to_owned());
    let lost = VulkanError::Lost {
        device: device.clone(),
        pass: pass.clone(),
        fault: Some("invalid read at 0x10".to_owned()),
    };
    assert!(lost.to_string().ends_with("`render`: invalid read at 0x10"));
    let stuck = VulkanError::Stuck {
        device,
        pass,
        seconds: 300,
    };
    for error in [lost, stuck] {
        let mapped = into_render_error(TracingMode::Pipeline, error);
        assert!(
            matches!(
                &mapped,
                RenderError::Lost {
                    backend: "vulkan",
                    ..
                }
            ),
            "{mapped:?}"
        );
        assert!(
            mapped.to_string().contains("a device") && mapped.to_string().contains("`render`"),
            "{mapped}"
        );
    }
    let result = ash::vk::Result::ERROR_INVALID_SHADER_NV;
    let refused = VulkanError::Call {
        call: "vkCreateComputePipelines",
        result,
        pass: "upload".to_owned(),
    };
    let mapped = into_render_error(TracingMode::Query, refused);
    assert!(matches!(&mapped, RenderError::Failed { .. }), "{mapped:?}");
    assert!(
        mapped.to_string().contains("vkCreateComputePipelines")
            && mapped.to_string().contains("INVALID_SHADER")
    );
}

#[test]
fn sums_stay_accurate_over_many_samples() {
    let device = or_return!(harness::device());
    let (sources, seed) = constant(0.1, 0.1);
    let job = job([1, 1], 2, seed);
    let mut renderer = open(&device, TracingMode::Compute, &sources, &job).unwrap();
    renderer.advance(1 << 20).unwrap();
    let exact = f64::from(0.1f32) * f64::from(1 << 20);
    let relative = (renderer.film().sum[0][0] / exact - 1.0).abs();
    let plain = (0..1u32 << 20).fold(0.0f32, |s, _| s + 0.1);
    assert!(relative < 1e-10, "{relative:e}");
    assert!(
        (f64::from(plain) / exact - 1.0).abs() > 1e-3,
        "a plain `f32` sum is exact enough, so this tests nothing"
    );
    harness::assert_no_validation_messages();
}

/// Names and values of variables of the environment.
type Variables<'a> = &'a [(&'a str, &'a std::path::Path)];

/// A folder with a script of one run, in which the program is started.
struct Place(tempfile::TempDir);

impl Place {
    fn new() -> Place {
        let place = tempfile::tempdir().unwrap();
        let script = "local x = experiment('night', { seed = 1 })\n\
            x:render(function(p)\n\
            return { scene = 'ball.scn', integrator = 'bpt', resolution = { 8, 8 } } end)\n\
            x:stop(stop.samples(2))\nreturn x\n";
        let write = |name: &str, text: &str| std::fs::write(place.path().join(name), text).unwrap();
        write("ball.scn", include_str!("../common/ball.scn"));
        write("night.lua", script);
        Place(place)
    }

    /// Runs the program with variables of the environment. Returns its exit code and what it
    /// printed, with single spaces.
    fn run(&self, variables: Variables<'_>, arguments: &[&str]) -> (Option<i32>, String) {
        let mut command = Command::new(env!("CARGO_BIN_EXE_lumbre"));
        command.current_dir(self.0.path()).args(arguments);
        let output = command.envs(variables.iter().copied()).output().unwrap();
        let text = [output.stdout, output.stderr].concat();
        let words = String::from_utf8_lossy(&text);
        (
            output.status.code(),
            words.split_whitespace().collect::<Vec<_>>().join(" "),
        )
    }

    /// Asserts that plans for devices are refused with a reason that contains `reason`, that
    /// `doctor` states it as well, and that `auto` renders on the CPU.
    fn assert_only_the_cpu_works(&self, variables: Variables<'_>, reason: &str) {
        for backend in ["vulkan", "vulkan-query", "vulkan-compute"] {
            for verb in ["plan", "run"] {
                let (code, message) =
                    self.run(variables, &[verb, "night.lua", "-q", "--backend", backend]);
                assert_eq!(code, Some(2), "{message}");
                assert!(
                    message.contains(&format!("`{backend}` cannot be used on this machine: "))
                        && message.contains(reason),
                    "{message}"
                );
            }
        }
        assert!(
            !self.0.path().join("out").exists(),
            "a refused plan must not write an output folder"
        );
        let (code, message) = self.run(variables, &["doctor"]);
        assert_eq!(code, Some(0), "{message}");
        assert!(
            message.contains("selected by auto") && message.contains(reason),
            "{message}"
        );
        let (code, message) = self.run(variables, &["run", "night.lua", "-q"]);
        assert_eq!(code, Some(0), "{message}");
    }
}

/// Needs no device: the loader is directed to a driver file that does not exist, or there is no
/// loader.
#[test]
fn without_a_device_vulkan_plans_are_refused_with_the_reason_and_auto_is_the_cpu() {
    let place = Place::new();
    let missing = place.0.path().join("missing.json");
    let variables = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"].map(|name| (name, missing.as_path()));
    place.assert_only_the_cpu_works(&variables, "Vulkan loader");
}

/// Files named like the Vulkan loader that are not one: noise, a library without its functions, and
/// libraries whose functions crash or return nothing.
#[test]
#[cfg(target_os = "linux")]
fn a_loader_that_is_damaged_or_crashes_is_named_and_the_cpu_works() {
    let get = "void *vkGetInstanceProcAddr(void *instance, const char *name)";
    let loaders = [
        ("noise", None, "libvulkan.so.1"),
        ("other", Some("int x;".to_owned()), "vkGetInstanceProcAddr"),
        (
            "crashes",
            Some(format!("{get} {{ __builtin_trap(); }}")),
            "a driver fails",
        ),
        (
            "empty",
            Some(format!("{get} {{ return 0; }}")),
            "a driver fails",
        ),
    ];
    for (name, source, reason) in loaders {
        let place = Place::new();
        let folder = place.0.path().join(name);
        std::fs::create_dir(&folder).unwrap();
        let library = folder.join("libvulkan.so.1");
        match source {
            None => std::fs::write(&library, [7; 4096]).unwrap(),
            Some(source) => {
                let file = folder.join("loader.c");
                std::fs::write(&file, source).unwrap();
                let mut compiler = Command::new("cc");
                compiler.args(["-shared", "-fPIC", "-w", "-o"]);
                let made = compiler.arg(&library).arg(&file).status().unwrap();
                assert!(made.success());
            }
        }
        place.assert_only_the_cpu_works(&[("LD_LIBRARY_PATH", &folder)], reason);
    }
}
