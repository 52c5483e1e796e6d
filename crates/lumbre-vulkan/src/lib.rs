//! The Vulkan backends: `vulkan` (ray-tracing pipelines), `vulkan-query` (ray queries) and
//! `vulkan-compute` (a BVH traversed in a compute shader).
//!
//! [`renderer`] runs a job. [`context`] opens instance and device, [`memory`] holds buffers and the
//! scene, [`films`] the sums, [`accel`] the acceleration structures, [`pipelines`] the shader
//! modules and pipelines, [`schedule`] splits waves into dispatches, and [`layout`] defines the structs that Rust
//! and GLSL share. `layout` and `pipelines::modules` need no device. Each Vulkan object owns what it
//! was made from and is destroyed when dropped, and every submission is waited for before the
//! objects it uses are dropped, so nothing is destroyed while in use.
#![allow(
    unsafe_code,
    reason = "Vulkan is a C interface; each block states why the call is sound"
)]

pub mod accel;
pub mod context;
pub mod error;
pub mod films;
pub mod layout;
pub mod memory;
pub mod pipelines;
pub mod prepare;
pub mod renderer;
pub mod schedule;

use std::sync::Arc;

use context::physical_device::DeviceInfo;
use error::VulkanError;
use lumbre_light::film::layer::Layer;
use lumbre_light::scene::CompiledScene;
use lumbre_light::transport::integrator::IntegratorRow;
use lumbre_render::backend_choice;
use lumbre_render::path_trace::{PathEvent, SampleAt};
use lumbre_render::shaders::Shaders;
use lumbre_render::{BackendRow, Job, RenderError, Renderer, worker};
use pipelines::glsl::Compiler;
use pipelines::program::TracingMode;
use pipelines::sources::Sources;
use renderer::VulkanRenderer;

/// Layers that the shaders compute. Others of the first hit are computed on the CPU alone.
pub const LAYERS: &[Layer] = &[
    Layer::Depth,
    Layer::Strategies,
    Layer::Bounces,
    Layer::Rays,
    Layer::Albedo,
    Layer::Normal,
    Layer::Distance,
    Layer::Variance,
];

/// Declares the table row of the backend of a tracing mode; `accel` is whether it traverses a BVH
/// built on the CPU.
macro_rules! row {
    ($mode:ident, $name:literal, accel: $accel:literal, $doc:literal) => {
        BackendRow {
            name: $name,
            doc: $doc,
            probe: || probe(TracingMode::$mode),
            layers: LAYERS,
            times: true,
            blends: false,
            light_trees: false,
            uniform_directions: false,
            models: memory::upload::MODELS,
            refuses,
            shaders,
            accel: $accel,
            open: |scene, job| open(TracingMode::$mode, &scene, job),
            paths: |scene, job, samples| paths(TracingMode::$mode, scene, job, samples),
        }
    };
}

/// Table row of the backend with ray-tracing pipelines.
pub const PIPELINE: BackendRow = row! {
    Pipeline, "vulkan", accel: false,
    "GPU with hardware ray tracing, by ray-tracing pipelines."
};

/// Table row of the backend with ray queries.
pub const QUERY: BackendRow = row! {
    Query, "vulkan-query", accel: false,
    "GPU with hardware ray tracing, by ray queries in a compute shader."
};

/// Table row of the backend with its own BVH.
pub const COMPUTE: BackendRow = row! {
    Compute, "vulkan-compute", accel: true,
    "Any GPU: a compute shader that traverses a BVH built on the CPU."
};

fn refuses(integrator: &IntegratorRow, shaders: &Shaders) -> Option<String> {
    let name = integrator.name;
    if Sources::selected(shaders).has_integrator(name) {
        return None;
    }
    Some(match integrator.sharing {
        None => format!("there is no shader for the integrator `{name}`"),
        Some(_) => format!(
            "before each sample `{name}` computes data that all pixels share, which only the \
             backend `cpu` does"
        ),
    })
}

/// Resolves a choice of shaders. A folder needs a compiler, here as well as where a run is opened.
fn shaders(choice: &Shaders) -> Result<Shaders, String> {
    let resolved = Sources::selected(choice).resolved();
    let resolved = resolved.map_err(|e| e.to_string())?;
    if resolved.folder().is_some() {
        Compiler::find().map_err(|e| e.to_string())?;
    }
    Ok(resolved)
}

/// Opens a run, in a worker process if this process uses any.
fn open(
    kind: TracingMode,
    scene: &Arc<CompiledScene>,
    job: Job,
) -> Result<Box<dyn Renderer>, RenderError> {
    Ok(match worker::pool() {
        Some(pool) => Box::new(pool.open(kind.backend(), scene, job)?),
        None => Box::new(VulkanRenderer::open(kind, scene, &job)?),
    })
}

/// Records the events of samples on the device of this process.
fn paths(
    kind: TracingMode,
    scene: &CompiledScene,
    job: &Job,
    samples: &[SampleAt],
) -> Result<Vec<Vec<PathEvent>>, RenderError> {
    let into_error = |e| renderer::into_render_error(kind, e);
    let device = context::session::device().map_err(into_error)?;
    Sources::of(&job.settings.shaders)
        .map_err(VulkanError::from)
        .and_then(|sources| VulkanRenderer::recording(&device, kind, &sources, scene, job))
        .and_then(|mut renderer| renderer.paths(samples))
        .map_err(|e| {
            context::session::forget(&device);
            into_error(e)
        })
}

/// Returns the device that a mode would run on, or why none can.
fn probe(kind: TracingMode) -> Result<String, String> {
    let device = context::physical_device::choose().map_err(|e| e.to_string())?;
    match kind.lacking(&device) {
        None => Ok(device.line()),
        Some(what) => Err(format!("{} does not support {what}", device.line())),
    }
}

/// Opens the device of this process. Returns why it cannot be opened, or `None` if it was or there
/// is none.
pub fn open_device() -> Option<String> {
    context::physical_device::choose().ok()?;
    context::session::device().err().map(|e| e.to_string())
}

/// Returns the index, in the list of devices, of the device that one of these backends renders on;
/// `None` for other backends.
pub fn device_index(backend: &str) -> Option<String> {
    TracingMode::ALL
        .iter()
        .find(|kind| kind.backend() == backend)?;
    context::physical_device::choose()
        .ok()
        .map(|device| device.index.to_string())
}

/// Returns the indices of further devices of this machine of the model that one of these backends
/// renders on. None if a device was selected explicitly: only that one is used then.
pub fn same_model_devices(backend: &str) -> Vec<String> {
    if TracingMode::ALL
        .iter()
        .all(|kind| kind.backend() != backend)
        || backend_choice::device().is_some()
    {
        return Vec::new();
    }
    let found = || {
        Ok::<_, VulkanError>((
            context::physical_device::choose()?,
            context::physical_device::list()?,
        ))
    };
    found().map_or_else(
        |_| Vec::new(),
        |(chosen, all)| {
            chosen
                .others_of_model(&all)
                .iter()
                .map(usize::to_string)
                .collect()
        },
    )
}

/// Resolves names of devices to their indices.
///
/// # Errors
/// Returns a message if a name matches no device, or two names match the same one.
pub fn resolve_devices(names: &[String]) -> Result<Vec<String>, String> {
    let all = context::physical_device::list().map_err(|e| e.to_string())?;
    let mut indices: Vec<String> = Vec::new();
    for name in names {
        let index = context::physical_device::find(&all, name)
            .map_err(|e| e.to_string())?
            .index
            .to_string();
        if indices.contains(&index) {
            return Err(format!("device {index} is selected twice"));
        }
        indices.push(index);
    }
    Ok(indices)
}

/// Returns the backend that suits this machine's device and why, or why none does.
pub fn auto_backend() -> Result<(&'static str, String), String> {
    let device = context::physical_device::choose().map_err(|e| e.to_string())?;
    let (kind, why) = suitable_mode(&device)?;
    Ok((kind.backend(), why))
}

/// Returns the tracing mode that suits a device and why, or why none does.
fn suitable_mode(device: &DeviceInfo) -> Result<(TracingMode, String), String> {
    let line = device.line();
    if device.software {
        return Err(format!("{line} is a software implementation"));
    }
    let able = |kind: TracingMode| kind.lacking(device).is_none();
    if able(TracingMode::Pipeline) && !device.emulates_tracing() {
        let why = format!("{line}: it supports hardware ray tracing");
        return Ok((TracingMode::Pipeline, why));
    }
    if !able(TracingMode::Compute) {
        return Err(format!("{line} supports none of the Vulkan backends"));
    }
    let why = match device.emulates_tracing() {
        true => "its driver emulates ray tracing",
        false => "it has no hardware ray tracing",
    };
    Ok((TracingMode::Compute, format!("{line}: {why}")))
}

/// Lists the devices of this machine for users: name and driver, and which backends each supports.
pub fn devices() -> Vec<(String, String)> {
    let listed = match context::physical_device::list() {
        Ok(devices) => devices,
        Err(e) => return vec![("devices".to_owned(), e.to_string())],
    };
    let line = |d: &DeviceInfo| (format!("device {}", d.index), describe_device(d));
    listed.iter().map(line).collect()
}

/// Returns a line about a device for users: memory, how splats are summed, how rays are traced, and
/// which backends it supports.
fn describe_device(d: &DeviceInfo) -> String {
    let able = |kind: &TracingMode| kind.lacking(d).is_none();
    let backends: Vec<&str> = TracingMode::ALL
        .iter()
        .filter(|kind| able(kind))
        .map(|kind| kind.backend())
        .collect();
    let sort = if d.software { "software" } else { "hardware" };
    let splats = if d.caps.float_atomics {
        "splats by float atomics"
    } else {
        "splats in fixed point"
    };
    let tracing = match d.caps.traces() {
        true if d.software || d.emulates_tracing() => "ray tracing emulated",
        true => "ray tracing in hardware",
        false => "no ray tracing",
    };
    let [heap, left, at_once] = [d.limits.heap, d.memory_left(), d.limits.allocation]
        .map(|bytes| format!("{:.0} MiB", error::mib(bytes)));
    let memory = format!("{heap} ({left} free, {at_once} at once)");
    let backends = backends.join(", ");
    format!(
        "{}: {sort}, {memory}, {splats}, {tracing}; {backends}",
        d.line()
    )
}

#[cfg(test)]
mod tests {
    use context::limits::Limits;
    use context::physical_device::Caps;
    use lumbre_render::DeviceKind;
    use lumbre_render::device::{VENDOR_AMD, VENDOR_NVIDIA};
    use lumbre_render::hierarchy::AccelSpec;

    use super::*;

    #[test]
    fn auto_chooses_own_traversal_where_ray_tracing_is_emulated() {
        let device = |vendor: u32, pipeline: bool, query: bool| {
            let caps = Caps {
                scalar_layout: true,
                pipeline,
                query,
                ..Caps::default()
            };
            DeviceInfo::made_up("card", vendor, caps, Limits::default())
        };
        let chosen = |device: &DeviceInfo| suitable_mode(device).unwrap();
        let (nvidia, amd) = (VENDOR_NVIDIA, VENDOR_AMD);
        for (device, expected) in [
            (device(nvidia, true, true), TracingMode::Pipeline),
            (device(amd, true, false), TracingMode::Pipeline),
            (device(nvidia, true, false), TracingMode::Compute),
            (device(amd, false, false), TracingMode::Compute),
        ] {
            assert_eq!(chosen(&device).0, expected, "{:?}", device.caps);
        }
        let emulated = device(nvidia, true, false);
        let lacking = TracingMode::Pipeline.lacking(&emulated).unwrap();
        assert!(lacking.contains("use `vulkan-compute`"), "{lacking}");
        assert!(chosen(&emulated).1.contains("emulates ray tracing"));
        assert!(describe_device(&emulated).contains("ray tracing emulated; vulkan-compute"));
        let traced = describe_device(&device(nvidia, true, true));
        assert!(traced.contains("ray tracing in hardware"), "{traced}");
        let mut software = device(nvidia, true, true);
        software.software = true;
        assert!(suitable_mode(&software).is_err());
        assert!(describe_device(&software).contains("ray tracing emulated"));
    }

    #[test]
    fn a_recorded_device_states_vendor_driver_and_tracing() {
        let caps = Caps {
            pipeline: true,
            ..Caps::default()
        };
        let mut card = DeviceInfo::made_up("card", VENDOR_NVIDIA, caps, Limits::default());
        let recorded = card.recorded();
        assert_eq!(
            (recorded.kind, recorded.vendor, recorded.to_string()),
            (
                DeviceKind::Graphics,
                Some(VENDOR_NVIDIA),
                "card (driver)".to_owned()
            )
        );
        let spec = AccelSpec::default();
        let tracing = |kind: TracingMode| kind.features(&card, &spec).tracing.unwrap();
        assert_eq!(tracing(TracingMode::Query), "ray queries, emulated");
        assert_eq!(tracing(TracingMode::Compute), "compute shader");
        assert!(
            TracingMode::ALL
                .iter()
                .all(|kind| kind.features(&card, &spec).hierarchy.is_some()
                    == (*kind == TracingMode::Compute)),
            "only a compute shader traverses a BVH of this program"
        );
        card.software = true;
        assert_eq!(card.recorded().kind, DeviceKind::EmulatedGraphics);
        assert_eq!(card.line(), "card (driver)");
    }
}
