//! The device that tests share, and what they do without one.

use std::sync::{Arc, OnceLock};

use glam::Vec3;
use lumbre::film::time::TimeAxis;
use lumbre::render::vulkan::device::{self, Caps, Device};
use lumbre::render::vulkan::instance;
use lumbre::render::vulkan::program::Kind;
use lumbre::scene::CompiledScene;
use lumbre::scene::compile::{DelayProfile, Delays, Part};
use lumbre::scene::desc::{DelayDesc, DelayKind};
use lumbre::transport::flight::Timing;

/// The device of this process, or `None` after a line `SKIPPED` where there is none.
pub fn device() -> Option<Arc<Device>> {
    static SHARED: OnceLock<Result<Arc<Device>, String>> = OnceLock::new();
    let shared = SHARED.get_or_init(|| {
        instance::validate();
        let info = device::choose().map_err(|e| e.to_string())?;
        let caps = info.caps;
        Device::open(info, caps).map_err(|e| e.to_string())
    });
    match shared {
        Ok(device) => Some(Arc::clone(device)),
        Err(reason) if required() => panic!("REQUIRE_DEVICE is set, but: {reason}"),
        Err(reason) => {
            println!("SKIPPED: needs a Vulkan device: {reason}");
            None
        }
    }
}

/// The same device without float atomics: splats are whole numbers, whose bits do not depend on chance. One for all tests,
/// since it keeps the pipelines that they make.
pub fn exact() -> Option<Arc<Device>> {
    static SHARED: OnceLock<Arc<Device>> = OnceLock::new();
    let device = device()?;
    let caps = Caps { float_atomics: false, ..device.info.caps };
    Some(Arc::clone(SHARED.get_or_init(|| Device::open(device.info.clone(), caps).unwrap())))
}

/// The kind on which tests render that are not about kinds. What a software driver compiles takes nearly all of their time, and
/// it compiles ray-tracing pipelines four to six times as fast as compute shaders, which are one function to it.
pub fn quick(device: &Device) -> Kind {
    if Kind::Pipeline.lacking(&device.info.caps).is_none() { Kind::Pipeline } else { Kind::Compute }
}

/// A time axis without anything special.
pub fn timing(start: f64, bin: f64, bins: u32) -> Timing {
    Timing::plain(TimeAxis { start, bin, bins })
}

/// Delays every third material of a scene by each kind of profile in turn, and composes every other third of two.
pub fn slow(scene: &mut CompiledScene) {
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
        let first = delays.parts.len() as u32;
        let shines = scene.materials[row as usize].emission != Vec3::ZERO;
        if !shines && row % 3 == 0 {
            delays.parts.push(Part { upto: 1.0, material: row, profiles: [row / 3 % 4, 1] });
        } else if !shines && row % 3 == 1 {
            // The other part must not shine.
            let dark = |other: &u32| scene.materials[*other as usize].emission == Vec3::ZERO;
            let other = (1..count).map(|step| (row + step) % count).find(dark).unwrap_or(row);
            delays.parts.push(Part { upto: 0.375, material: other, profiles: [0, 0] });
            delays.parts.push(Part { upto: 1.0, material: row, profiles: [row % 3, 2] });
        }
        delays.rows.push([first, delays.parts.len() as u32 - first]);
    }
    scene.delays = delays;
}

/// Whether a missing device is a failure.
pub fn required() -> bool {
    std::env::var("REQUIRE_DEVICE").is_ok_and(|v| v == "1")
}

/// Fails if the validation layer has said anything so far.
pub fn silent() {
    let messages = instance::messages();
    assert!(messages.is_empty(), "the validation layer says:\n{}", messages.join("\n"));
    if required() {
        assert!(instance::shared().unwrap().validated, "the validation layer is not installed");
    }
}
