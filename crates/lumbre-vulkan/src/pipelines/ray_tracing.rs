//! Ray-tracing pipelines and their shader binding tables.

use std::sync::Arc;

use ash::vk;
use bytemuck::Pod;

use super::compute::{Bindings, Module, Pipeline, refused};
use super::statistics;
use crate::context::device::Device;
use crate::error::VulkanError;
use crate::layout::Specialization;
use crate::memory::buffer::Buffer;

/// Shader stages of a ray-tracing pipeline.
pub const STAGES: vk::ShaderStageFlags = vk::ShaderStageFlags::from_raw(
    vk::ShaderStageFlags::RAYGEN_KHR.as_raw()
        | vk::ShaderStageFlags::MISS_KHR.as_raw()
        | vk::ShaderStageFlags::CLOSEST_HIT_KHR.as_raw()
        | vk::ShaderStageFlags::ANY_HIT_KHR.as_raw()
        | vk::ShaderStageFlags::INTERSECTION_KHR.as_raw(),
);

/// Compiled shaders of a ray-tracing pipeline.
pub struct Shaders {
    /// Ray-generation shader of the pipeline.
    pub generation: Vec<u32>,
    /// Miss shader of the pipeline.
    pub miss: Vec<u32>,
    /// Closest-hit shader of triangles.
    pub triangle: Vec<u32>,
    /// Closest-hit shader of spheres.
    pub sphere: Vec<u32>,
    /// Any-hit shader of both, which applies masks.
    pub any: Vec<u32>,
    /// Intersection shader of spheres.
    pub intersection: Vec<u32>,
}

/// Ray-tracing pipeline with its binding table: ray generation and, if rays are traced, miss,
/// triangle hits, sphere hits.
pub struct RayTracingPipeline {
    device: Arc<Device>,
    pipeline: Pipeline,
    _table: Buffer,
    /// Regions of the table: ray generation, miss, hits, callables.
    regions: [vk::StridedDeviceAddressRegionKHR; 4],
}

impl RayTracingPipeline {
    /// Creates a pipeline for a descriptor set and push constants of `push` bytes.
    ///
    /// # Errors
    /// Returns an error if the device has no ray-tracing pipelines or refuses a shader.
    pub fn new(
        name: &str,
        shaders: &Shaders,
        constants: &Specialization,
        bindings: &Bindings,
        push: u32,
    ) -> Result<RayTracingPipeline, VulkanError> {
        let shaders = [
            (&shaders.generation[..], vk::ShaderStageFlags::RAYGEN_KHR),
            (&shaders.miss, vk::ShaderStageFlags::MISS_KHR),
            (&shaders.triangle, vk::ShaderStageFlags::CLOSEST_HIT_KHR),
            (&shaders.sphere, vk::ShaderStageFlags::CLOSEST_HIT_KHR),
            (&shaders.any, vk::ShaderStageFlags::ANY_HIT_KHR),
            (
                &shaders.intersection,
                vk::ShaderStageFlags::INTERSECTION_KHR,
            ),
        ];
        let groups = [
            group(vk::RayTracingShaderGroupTypeKHR::GENERAL).general_shader(0),
            group(vk::RayTracingShaderGroupTypeKHR::GENERAL).general_shader(1),
            group(vk::RayTracingShaderGroupTypeKHR::TRIANGLES_HIT_GROUP)
                .closest_hit_shader(2)
                .any_hit_shader(4),
            group(vk::RayTracingShaderGroupTypeKHR::PROCEDURAL_HIT_GROUP)
                .closest_hit_shader(3)
                .any_hit_shader(4)
                .intersection_shader(5),
        ];
        RayTracingPipeline::with_groups(name, &shaders, &groups, constants, bindings, push)
    }

    /// Creates a pipeline with only a ray-generation shader that traces no rays.
    ///
    /// # Errors
    /// Returns an error in the cases of [`RayTracingPipeline::new`].
    pub fn generation_only(
        name: &str,
        generation: &[u32],
        constants: &Specialization,
        bindings: &Bindings,
        push: u32,
    ) -> Result<RayTracingPipeline, VulkanError> {
        let shaders = [(generation, vk::ShaderStageFlags::RAYGEN_KHR)];
        let groups = [group(vk::RayTracingShaderGroupTypeKHR::GENERAL).general_shader(0)];
        RayTracingPipeline::with_groups(name, &shaders, &groups, constants, bindings, push)
    }

    fn with_groups(
        name: &str,
        shaders: &[(&[u32], vk::ShaderStageFlags)],
        groups: &[vk::RayTracingShaderGroupCreateInfoKHR<'_>],
        constants: &Specialization,
        bindings: &Bindings,
        push: u32,
    ) -> Result<RayTracingPipeline, VulkanError> {
        let device = &bindings.device;
        let lacks = || VulkanError::Lacks {
            device: device.info.line(),
            needed: "ray-tracing pipelines".to_owned(),
        };
        let tracing = device.tracing.as_ref().ok_or_else(lacks)?;
        let words: Vec<&[u32]> = shaders.iter().map(|(words, _)| *words).collect();
        let create = |device: &Arc<Device>,
                      layout: vk::PipelineLayout,
                      specialization: &vk::SpecializationInfo| {
            let modules: Vec<(Module, vk::ShaderStageFlags)> = shaders
                .iter()
                .map(|(words, stage)| Ok((Module::new(device, name, words)?, *stage)))
                .collect::<Result<_, VulkanError>>()?;
            let stages: Vec<_> = modules
                .iter()
                .map(|(module, stage)| module.stage(*stage, specialization))
                .collect();
            let info = vk::RayTracingPipelineCreateInfoKHR::default()
                .flags(statistics::flags(device))
                .stages(&stages)
                .groups(groups)
                .max_pipeline_ray_recursion_depth(1)
                .layout(layout);
            // SAFETY: modules and layout live through the call.
            let made = unsafe {
                tracing.create_ray_tracing_pipelines(
                    vk::DeferredOperationKHR::null(),
                    device.pipelines,
                    &[info],
                    None,
                )
            };
            let call = "vkCreateRayTracingPipelinesKHR";
            let made = made.map_err(|(_, result)| refused(device, call, name, result));
            made.map(|pipelines| pipelines[0])
        };
        let pipeline =
            Pipeline::get_or_create(bindings, name, &words, constants, (STAGES, push), create)?;
        let table = ShaderBindingTable::new(device, tracing, pipeline.raw, groups.len())?;
        Ok(RayTracingPipeline {
            device: Arc::clone(device),
            pipeline,
            _table: table.buffer,
            regions: table.regions,
        })
    }

    /// Records one invocation of ray generation for each element of `size`.
    pub fn trace<P: Pod>(
        &self,
        commands: vk::CommandBuffer,
        bindings: &Bindings,
        push: &P,
        size: [u32; 3],
    ) {
        let Some(tracing) = &self.device.tracing else {
            return;
        };
        let (raw, point) = (&self.device.raw, vk::PipelineBindPoint::RAY_TRACING_KHR);
        bindings.bind(commands, point, self.pipeline.layout);
        let [generation, miss, hit, callable] = &self.regions;
        // SAFETY: the commands are being recorded; the table was made from this pipeline, whose
        // layout has push constants of this size.
        unsafe {
            raw.cmd_bind_pipeline(commands, point, self.pipeline.raw);
            raw.cmd_push_constants(
                commands,
                self.pipeline.layout,
                STAGES,
                0,
                bytemuck::bytes_of(push),
            );
            tracing.cmd_trace_rays(
                commands, generation, miss, hit, callable, size[0], size[1], size[2],
            );
        }
    }
}

/// Returns a shader group without shaders.
fn group(
    kind: vk::RayTracingShaderGroupTypeKHR,
) -> vk::RayTracingShaderGroupCreateInfoKHR<'static> {
    vk::RayTracingShaderGroupCreateInfoKHR::default()
        .ty(kind)
        .general_shader(vk::SHADER_UNUSED_KHR)
        .closest_hit_shader(vk::SHADER_UNUSED_KHR)
        .any_hit_shader(vk::SHADER_UNUSED_KHR)
        .intersection_shader(vk::SHADER_UNUSED_KHR)
}

/// Shader binding table, aligned as the device requires.
struct ShaderBindingTable {
    buffer: Buffer,
    regions: [vk::StridedDeviceAddressRegionKHR; 4],
}

impl ShaderBindingTable {
    fn new(
        device: &Arc<Device>,
        tracing: &ash::khr::ray_tracing_pipeline::Device,
        pipeline: vk::Pipeline,
        groups: usize,
    ) -> Result<ShaderBindingTable, VulkanError> {
        let limits = &device.info.limits;
        let handle = limits.handle as usize;
        // SAFETY: the pipeline has this number of groups.
        let handles = unsafe {
            tracing.get_ray_tracing_shader_group_handles(
                pipeline,
                0,
                groups as u32,
                groups * handle,
            )
        }
        .map_err(|r| device.failed("vkGetRayTracingShaderGroupHandlesKHR", r))?;
        let stride = limits
            .handle
            .next_multiple_of(limits.handle_alignment.max(1));
        let base = limits.base_alignment.max(1);
        // Offsets of the four records: the two hit records are adjacent, and every region is
        // aligned.
        let hits = 2 * stride.next_multiple_of(base);
        let offsets = [0, stride.next_multiple_of(base), hits, hits + stride];
        let mut bytes = vec![0u8; (hits + 2 * stride + base) as usize];
        let usage = vk::BufferUsageFlags::SHADER_BINDING_TABLE_KHR
            | vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS;
        let buffer = Buffer::new(device, "shader binding table", bytes.len() as u64, usage)?;
        let start = buffer.address().next_multiple_of(base);
        let shift = start - buffer.address();
        for (offset, handle) in offsets.iter().zip(handles.chunks_exact(handle)) {
            let at = (offset + shift) as usize;
            bytes[at..at + handle.len()].copy_from_slice(handle);
        }
        buffer.write(&bytes)?;
        let region = |offset: u64, records: u64| {
            vk::StridedDeviceAddressRegionKHR::default()
                .device_address(start + offset)
                .stride(stride)
                .size(records * stride)
        };
        let nothing = vk::StridedDeviceAddressRegionKHR::default();
        let regions = match groups {
            1 => [region(offsets[0], 1), nothing, nothing, nothing],
            _ => [
                region(offsets[0], 1),
                region(offsets[1], 1),
                region(offsets[2], 2),
                nothing,
            ],
        };
        Ok(ShaderBindingTable { buffer, regions })
    }
}
