//! The device that tests share, and skipping without one.

use std::sync::{Arc, OnceLock};

use glam::Vec3;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{DelayProfile, Delays, MaterialComponent};
use lumbre_light::scene::desc::{DelayDesc, DelayKind};
use lumbre_light::transport::integrator::IntegratorRow;
use lumbre_render::Advance;
use lumbre_render::shaders::Shaders;
use lumbre_vulkan::context::instance;
use lumbre_vulkan::context::limits::Limits;
use lumbre_vulkan::context::physical_device;
use lumbre_vulkan::context::{device::Device, physical_device::Caps};
use lumbre_vulkan::pipelines::glsl::Compiler;
use lumbre_vulkan::pipelines::program::TracingMode;
use lumbre_vulkan::pipelines::sources::Sources;

use super::rounding;
pub use crate::common::timing;

/// Returns a request of samples of which `more` may be started ahead.
pub fn ahead(samples: u64, more: u64) -> Advance<'static> {
    Advance {
        more,
        ..Advance::by(samples)
    }
}

/// Returns whether devices render an integrator.
pub fn renders(row: &IntegratorRow) -> bool {
    (lumbre_vulkan::COMPUTE.refuses)(row, &Shaders::BuiltIn).is_none()
}

/// Returns the device of this process, or `None` after printing a line `SKIPPED` if there is none.
pub fn device() -> Option<Arc<Device>> {
    static SHARED: OnceLock<Result<Arc<Device>, String>> = OnceLock::new();
    let shared = SHARED.get_or_init(|| {
        instance::enable_validation();
        let info = physical_device::choose().map_err(|e| e.to_string())?;
        let caps = info.caps;
        Device::open(info, caps).map_err(|e| e.to_string())
    });
    match shared {
        Ok(device) => Some(Arc::clone(device)),
        Err(reason) if required() => panic!("REQUIRE_DEVICE is set, but: {reason}"),
        Err(reason) => {
            crate::common::skipped(format_args!("needs a Vulkan device: {reason}"));
            None
        }
    }
}

/// Returns whether the compiler of shaders is installed; prints a line `SKIPPED` if not.
pub fn has_compiler() -> bool {
    let found = Compiler::find();
    if let Err(reason) = &found {
        crate::common::skipped(reason);
    }
    found.is_ok()
}

/// Returns the same device without float atomics: splats are integers, whose bits do not depend on
/// the order of addition. All tests share it, since it caches their pipelines.
pub fn integer_splat_device() -> Option<Arc<Device>> {
    static SHARED: OnceLock<Arc<Device>> = OnceLock::new();
    let device = device()?;
    let open = || changed(&device, |_, caps| caps.float_atomics = false);
    Some(Arc::clone(SHARED.get_or_init(open)))
}

/// Returns the device with other limits and capabilities.
pub fn changed(device: &Device, change: impl FnOnce(&mut Limits, &mut Caps)) -> Arc<Device> {
    let (mut info, mut caps) = (device.info.clone(), device.info.caps);
    change(&mut info.limits, &mut caps);
    Device::open(info, caps).unwrap()
}

/// Returns the tracing mode for tests that do not depend on it. A software driver spends nearly all
/// of its time on compiling, and compiles ray-tracing pipelines four to six times as fast as
/// compute shaders, which it treats as one function.
pub fn fastest_to_compile(device: &Device) -> TracingMode {
    if TracingMode::Pipeline.lacking(&device.info).is_none() {
        TracingMode::Pipeline
    } else {
        TracingMode::Compute
    }
}

/// Delays every third material of a scene, by each kind of profile in turn, and makes every third
/// one a composition of two.
pub fn add_delays(scene: &mut CompiledScene) {
    let plain = |kind: DelayKind, a: f32, b: f32| {
        DelayProfile::plain(&DelayDesc {
            kind,
            constant: [a, 0.0],
            rate: [a, 0.0],
            mean: [a, 0.0],
            width: [b, 0.0],
            table: vec![0.0, 0.0, 0.5, 2.0, 1.0, 0.5],
        })
    };
    let mut delays = Delays {
        profiles: vec![
            plain(DelayKind::Constant, 0.5, 0.0),
            plain(DelayKind::Exponential, 2.0, 0.0),
            plain(DelayKind::Epanechnikov, 0.5, 0.3),
            plain(DelayKind::Table, 0.0, 0.0),
        ],
        ..Delays::default()
    };
    let count = scene.materials.len() as u32;
    for row in 0..count {
        let first = delays.components.len() as u32;
        let emits = scene.materials[row as usize].emission != Vec3::ZERO;
        if !emits && row % 3 == 0 {
            delays.components.push(MaterialComponent {
                cumulative_weight: 1.0,
                material: row,
                profiles: [row / 3 % 4, 1],
            });
        } else if !emits && row % 3 == 1 {
            // The other component must not emit.
            let dark = |other: &u32| scene.materials[*other as usize].emission == Vec3::ZERO;
            let other = (1..count)
                .map(|step| (row + step) % count)
                .find(dark)
                .unwrap_or(row);
            delays.components.push(MaterialComponent {
                cumulative_weight: 0.375,
                material: other,
                profiles: [0, 0],
            });
            delays.components.push(MaterialComponent {
                cumulative_weight: 1.0,
                material: row,
                profiles: [row % 3, 2],
            });
        }
        delays
            .rows
            .push([first, delays.components.len() as u32 - first]);
    }
    scene.delays = delays;
}

/// Returns the shaders that tests of pictures run: those of the program or, if the environment
/// variable `LUMBRE_TEST_ROUNDING` is `1`, the same with noise of a few units in the last place.
pub fn sources() -> Sources {
    let noisy = std::env::var("LUMBRE_TEST_ROUNDING").is_ok_and(|v| v == "1");
    if noisy {
        rounding::noisy_sources()
    } else {
        Sources::Embedded
    }
}

/// Returns whether a missing device is a failure.
pub fn required() -> bool {
    std::env::var("REQUIRE_DEVICE").is_ok_and(|v| v == "1")
}

/// Panics if the validation layer has reported any message so far.
pub fn assert_no_validation_messages() {
    let messages = instance::validation_messages();
    assert!(
        messages.is_empty(),
        "messages of the validation layer:\n{}",
        messages.join("\n")
    );
    if required() {
        assert!(
            instance::shared().unwrap().validated,
            "the validation layer is not installed"
        );
    }
}

/// Returns sources in which `bpt` is another integrator: `parity/NAME.integrator`.
macro_rules! replaced_integrator {
    ($name:literal) => {{
        macro_rules! module {
            ($file:literal, $extension:literal) => {
                (
                    concat!("bpt.", $extension),
                    include_bytes!(concat!("parity/spirv/", $file, ".", $extension)).as_slice(),
                )
            };
        }
        lumbre_vulkan::pipelines::sources::Sources::Replaced(std::sync::Arc::new([
            module!($name, "comp.spv"),
            module!($name, "query.comp.spv"),
            module!($name, "rgen.spv"),
        ]))
    }};
}
pub(crate) use replaced_integrator;
