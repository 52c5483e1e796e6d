//! Preparation of a job for a device: flattening, limits of films, and specialisation constants.

use std::borrow::Cow;

use super::context::device::Device;
use super::error::VulkanError;
use super::layout::Specialization;
use super::memory::delay_tables::is_composed;
use super::memory::upload;
use super::schedule::pixel_samples::PixelSamples;
use lumbre_light::film::layer::LayerLayout;
use lumbre_light::film::time;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{LinearTexels, MAX_FLATTENED_PRIMITIVES, Material, NONE};
use lumbre_light::transport::integrator::settings::{Settings, has_uniform_directions};
use lumbre_light::transport::light::LightSelection;
use lumbre_light::transport::sampler::Sequence;
use lumbre_render::Job;

/// Returns the scene as the device can render it: flattened if it has instances and the device no
/// double precision, in which instances are placed as on the CPU. Fails if weights of a composed
/// material have a texture, or if the job chooses lights by a tree or continues paths in uniform
/// directions.
pub(super) fn supported_scene<'a>(
    device: &Device,
    scene: &'a CompiledScene,
    job: &Job,
) -> Result<Cow<'a, CompiledScene>, VulkanError> {
    if !scene.delays.blends.is_empty() {
        return Err(VulkanError::Lacks {
            device: device.info.line(),
            needed: "a texture as the weights of a composed material".to_owned(),
        });
    }
    if LightSelection::from_params(&job.settings.params) == LightSelection::Tree {
        return Err(VulkanError::Lacks {
            device: device.info.line(),
            needed: "a tree over lights".to_owned(),
        });
    }
    if has_uniform_directions(&job.settings.params) {
        return Err(VulkanError::Lacks {
            device: device.info.line(),
            needed: "paths in uniform directions".to_owned(),
        });
    }
    if scene.instances.placements.is_empty() || device.info.caps.extended() {
        return Ok(Cow::Borrowed(scene));
    }
    scene
        .flattened(MAX_FLATTENED_PRIMITIVES)
        .map(Cow::Owned)
        .map_err(|found| VulkanError::Lacks {
            device: device.info.line(),
            needed: format!(
                "double precision and addresses of buffers in shaders (shaderFloat64, \
                 bufferDeviceAddress), which instances of meshes need; \
                 without them the scene has {found} triangles (at most {MAX_FLATTENED_PRIMITIVES})"
            ),
        })
}

/// Returns the layout of the job's layers, or an error if its films exceed the program's limits.
pub(super) fn check_films(job: &Job) -> Result<LayerLayout, VulkanError> {
    let pixels = u64::from(job.resolution[0]) * u64::from(job.resolution[1]);
    let layout = LayerLayout::new(&job.settings.films, job.max_depth, pixels)
        .map_err(VulkanError::OverLimit)?;
    if let Some(timing) = &job.settings.timing {
        time::bytes(&timing.axis, pixels, job.integrator.splats).map_err(VulkanError::OverLimit)?;
    }
    Ok(layout)
}

/// Returns whether a parameter of a material has a texture.
fn has_texture(m: &Material) -> bool {
    let textures = [
        m.base_color_texture,
        m.emission_texture,
        m.roughness_texture,
        m.metallic_texture,
        m.opacity_texture,
        m.transmittance_texture,
    ];
    textures.iter().any(|texture| *texture != NONE)
}

/// Returns the specialisation constants of the shaders of a job; `texel_shift` as of
/// [`upload::SceneBuffers::texel_shift`].
pub fn specialization(
    scene: &CompiledScene,
    job: &Job,
    texel_shift: Option<u32>,
    samples: PixelSamples,
) -> Specialization {
    let composed =
        is_composed(scene) || (job.settings.timing.is_some() && !scene.delays.is_empty());
    let any = |has: fn(&Material) -> bool| u32::from(scene.materials.iter().any(has));
    let any_texels = |are: fn(&LinearTexels) -> bool| {
        u32::from(scene.textures.iter().any(|texture| are(&texture.texels)))
    };
    let only_surfaces =
        scene.points.is_empty() && scene.directionals.is_empty() && scene.environment.is_none();
    Specialization {
        sampler_kind: match job.sampler.sequence {
            Sequence::Independent => 0,
            Sequence::Sobol => 1,
            Sequence::Zsobol { block } => 2 + block.ilog2(),
        },
        models: upload::models(scene),
        layers: u32::from(!job.settings.films.is_empty()),
        paths: u32::from(samples == PixelSamples::Recorded),
        parts: u32::from(composed),
        second_uvs: u32::from(!scene.second_uvs.is_empty()),
        texel_shift: texel_shift.unwrap_or(NONE),
        times: u32::from(job.settings.timing.is_some()),
        instances: u32::from(!scene.instances.placements.is_empty()),
        textures: any(has_texture),
        byte_texels: any_texels(|texels| matches!(texels, LinearTexels::Bytes(..))),
        float_texels: any_texels(|texels| matches!(texels, LinearTexels::Floats(_))),
        masks: any(|m| m.mask_texture != NONE),
        tangents: any(Material::uses_tangents),
        bumps: any(|m| m.bump_texture != NONE),
        terminators: any(|m| m.shadow_terminator),
        other_lights: u32::from(!only_surfaces),
        all_lights: u32::from(Settings::new(&job.settings.params).all_lights),
        parallel_samples: u32::from(samples.at_once().is_some()),
        regenerated: u32::from(samples == PixelSamples::Regenerated),
        candidates: Settings::new(&job.settings.params).candidates,
    }
}
