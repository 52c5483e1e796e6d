//! Backends of this program: the table [`BACKENDS`], and the choice among them on this machine.

use std::sync::Arc;

use lumbre_light::film::layer::Layer;
use lumbre_light::scene::CompiledScene;
use lumbre_render::backend_choice;
use lumbre_render::{BackendRow, Job, RenderError, Renderer, cpu, mock};

/// Table of all backends.
pub const BACKENDS: &[BackendRow] = &[
    cpu::ROW,
    #[cfg(feature = "vulkan")]
    lumbre_vulkan::PIPELINE,
    #[cfg(feature = "vulkan")]
    lumbre_vulkan::QUERY,
    #[cfg(feature = "vulkan")]
    lumbre_vulkan::COMPUTE,
    mock::ROW,
];

/// Opens a run of the backend with this name.
///
/// # Errors
/// Returns an error if there is no such backend or it cannot render this job.
pub fn open(
    name: &str,
    scene: Arc<CompiledScene>,
    job: Job,
) -> Result<Box<dyn Renderer>, RenderError> {
    match backend(name) {
        Some(row) => match unsupported_layer(row, &job.settings.films) {
            None => (row.open)(scene, job),
            Some(reason) => Err(RenderError::unsupported(row.name, reason)),
        },
        None => Err(RenderError::unsupported(
            "none",
            format!("there is no backend `{name}`"),
        )),
    }
}

/// Returns why a backend cannot render layers, or `None` if it can.
pub fn unsupported_layer(row: &BackendRow, layers: &[Layer]) -> Option<String> {
    let layer = layers.iter().find(|layer| !row.layers.contains(layer))?;
    Some(format!(
        "it does not support the layer `{}`, which `films` or `denoise` needs: leave that out, or \
         use `cpu`",
        layer.row().name
    ))
}

/// Returns the name of the backend that `auto` selects on this machine, and why: `vulkan` on a
/// device with hardware ray tracing, `vulkan-compute` on other devices, and `cpu` if there is no
/// device or only a software implementation.
pub fn auto_backend() -> (&'static str, String) {
    if let Some(name) = backend_choice::auto_backend() {
        return (name, "as recorded in the night's plan".to_owned());
    }
    #[cfg(feature = "vulkan")]
    let found = lumbre_vulkan::auto_backend();
    #[cfg(not(feature = "vulkan"))]
    let found: Result<(&'static str, String), String> =
        Err("this program was built without Vulkan".to_owned());
    found.unwrap_or_else(|reason| (cpu::ROW.name, reason))
}

/// Opens the device that the device backends of this process render on. Returns why it cannot be
/// opened, or `None` if it was or there is none.
pub fn open_device() -> Option<String> {
    #[cfg(feature = "vulkan")]
    return lumbre_vulkan::open_device();
    #[cfg(not(feature = "vulkan"))]
    None
}

/// Returns an index that identifies the device of this machine that a backend renders on among
/// those of its kind, or an empty string for the CPU.
pub fn device_index(backend: &str) -> String {
    #[cfg(feature = "vulkan")]
    if let Some(place) = lumbre_vulkan::device_index(backend) {
        return place;
    }
    let _ = backend;
    String::new()
}

/// Returns the indices of further devices of this machine that are of the same model as the one a
/// backend renders on; none if a device was selected explicitly.
pub fn same_model_devices(backend: &str) -> Vec<String> {
    #[cfg(feature = "vulkan")]
    return lumbre_vulkan::same_model_devices(backend);
    #[cfg(not(feature = "vulkan"))]
    {
        let _ = backend;
        Vec::new()
    }
}

/// Resolves names of graphics devices, each an index or a part of a name, to indices.
///
/// # Errors
/// Returns a message if a name matches no device, or two names match the same one.
pub fn resolve_devices(names: &[String]) -> Result<Vec<String>, String> {
    #[cfg(feature = "vulkan")]
    return lumbre_vulkan::resolve_devices(names);
    #[cfg(not(feature = "vulkan"))]
    Err(format!(
        "device `{}` is not available: this program was built without Vulkan",
        names.join(", ")
    ))
}

/// Returns the table row of a backend; `auto` means that of [`auto_backend`].
pub fn backend(name: &str) -> Option<&'static BackendRow> {
    let name = if name == "auto" {
        auto_backend().0
    } else {
        name
    };
    BACKENDS.iter().find(|b| b.name == name)
}

/// Makes `auto` mean the backend of this name, on the first call; unknown names are ignored.
pub fn set_auto_backend(name: &str) {
    if let Some(row) = BACKENDS.iter().find(|row| row.name == name) {
        backend_choice::set_auto_backend(row.name);
    }
}
