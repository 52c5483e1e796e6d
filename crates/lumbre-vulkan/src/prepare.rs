//! Preparation of a job for a device: flattening, limits of films, and shader definitions.

use std::borrow::Cow;

use super::context::device::Device;
use super::error::VulkanError;
use super::films::device_film::SplatMode;
use super::memory::delay_tables::is_composed;
use super::memory::upload;
use lumbre_light::film::layer::LayerLayout;
use lumbre_light::film::time;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::MAX_FLATTENED_PRIMITIVES;
use lumbre_render::Job;

/// Returns the scene as the device can render it: flattened if it has instances and the device no
/// double precision, in which instances are placed as on the CPU.
pub(super) fn supported_scene<'a>(
    device: &Device,
    scene: &'a CompiledScene,
) -> Result<Cow<'a, CompiledScene>, VulkanError> {
    if scene.instances.placements.is_empty() || device.info.caps.doubles {
        return Ok(Cow::Borrowed(scene));
    }
    scene
        .flattened(MAX_FLATTENED_PRIMITIVES)
        .map(Cow::Owned)
        .map_err(|found| VulkanError::Lacks {
            device: device.info.line(),
            needed: format!(
                "double precision in shaders (shaderFloat64), which instances of meshes need; \
                 without them the scene has {found} triangles (at most {MAX_FLATTENED_PRIMITIVES})"
            ),
        })
}

/// Returns the layout of the job's layers, or an error if its films exceed the program's limits.
pub(super) fn check_films(job: &Job) -> Result<LayerLayout, VulkanError> {
    let pixels = u64::from(job.resolution[0]) * u64::from(job.resolution[1]);
    let layout =
        LayerLayout::new(&job.layers, job.max_depth, pixels).map_err(VulkanError::OverLimit)?;
    if let Some(timing) = &job.timing {
        time::bytes(&timing.axis, pixels, job.integrator.splats).map_err(VulkanError::OverLimit)?;
    }
    Ok(layout)
}

/// Returns the preprocessor definitions that the shaders of a job are compiled with.
pub(super) fn shader_defines(
    scene: &CompiledScene,
    job: &Job,
    splat_mode: SplatMode,
    texel_shift: Option<u32>,
    record_events: bool,
) -> Vec<(&'static str, String)> {
    let mut defines = vec![
        (
            "SAMPLER_KIND",
            format!("{}u", u32::from(job.sampler.name == "sobol")),
        ),
        ("MODELS", upload::models(scene).to_string()),
    ];
    let composed = is_composed(scene) || (job.timing.is_some() && !scene.delays.is_empty());
    let flags = [
        ("LAYERS", !job.layers.is_empty()),
        ("SPLAT_NONE", splat_mode == SplatMode::None),
        ("SPLAT_FLOAT", splat_mode == SplatMode::Float),
        ("TIMES", job.timing.is_some()),
        ("PARTS", composed),
        ("COPIES", !scene.instances.placements.is_empty()),
        ("SECOND_UVS", !scene.second_uvs.is_empty()),
        ("PATHS", record_events),
    ];
    let flags = flags.into_iter().filter(|(_, is_set)| *is_set);
    defines.extend(flags.map(|(name, _)| (name, String::new())));
    defines.extend(texel_shift.map(|shift| ("TEXEL_SHIFT", format!("{shift}u"))));
    defines
}
