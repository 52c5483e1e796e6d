//! Descriptor sets, shader modules, the registry of pipelines, and compute pipelines.

use std::sync::Arc;

use ash::vk;
use bytemuck::Pod;

pub use super::bound_resource::BoundResource;
pub use super::registry::{Pipeline, PipelineRegistry};
use super::statistics;
use crate::context::device::Device;
use crate::error::VulkanError;
use crate::layout::Specialization;

/// Descriptor set with its layout: binding `i` is the `i`-th resource.
pub struct Bindings {
    /// Device of the set.
    pub device: Arc<Device>,
    stages: vk::ShaderStageFlags,
    kinds: Vec<vk::DescriptorType>,
    layout: vk::DescriptorSetLayout,
    pool: vk::DescriptorPool,
    set: vk::DescriptorSet,
}

impl Bindings {
    /// Binds resources, which must outlive every use, for shaders of the given stages.
    ///
    /// # Errors
    /// Returns an error if a shader of the device cannot access so many, or it has no room for them.
    pub fn new(
        device: &Arc<Device>,
        stages: vk::ShaderStageFlags,
        bound: &[BoundResource],
    ) -> Result<Bindings, VulkanError> {
        check_count(device, bound)?;
        let bindings: Vec<_> = (0u32..)
            .zip(bound)
            .map(|(i, b)| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(i)
                    .descriptor_type(descriptor_type(b))
                    .descriptor_count(1)
                    .stage_flags(stages)
            })
            .collect();
        let size = vk::DescriptorPoolSize::default().descriptor_count(1);
        let sizes: Vec<_> = bound.iter().map(|b| size.ty(descriptor_type(b))).collect();
        let layout_info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        let pool_info = vk::DescriptorPoolCreateInfo::default()
            .max_sets(1)
            .pool_sizes(&sizes);
        let mut made = Bindings {
            device: Arc::clone(device),
            stages,
            kinds: bound.iter().map(descriptor_type).collect(),
            layout: vk::DescriptorSetLayout::null(),
            pool: vk::DescriptorPool::null(),
            set: vk::DescriptorSet::null(),
        };
        // SAFETY: the device is open and the structures live through the calls; the objects are
        // destroyed on drop.
        unsafe {
            made.layout = device
                .raw
                .create_descriptor_set_layout(&layout_info, None)
                .map_err(|r| device.failed("vkCreateDescriptorSetLayout", r))?;
            made.pool = device
                .raw
                .create_descriptor_pool(&pool_info, None)
                .map_err(|r| device.failed("vkCreateDescriptorPool", r))?;
            let layouts = [made.layout];
            let info = vk::DescriptorSetAllocateInfo::default()
                .descriptor_pool(made.pool)
                .set_layouts(&layouts);
            made.set = device
                .raw
                .allocate_descriptor_sets(&info)
                .map_err(|r| device.failed("vkAllocateDescriptorSets", r))?[0];
        }
        device.name(made.layout, "scene and films");
        device.name(made.pool, "scene and films");
        device.name(made.set, "scene and films");
        for (i, resource) in (0u32..).zip(bound) {
            made.write(i, resource);
        }
        Ok(made)
    }

    /// Writes a resource to a binding of the set, which must not be in use.
    fn write(&self, binding: u32, resource: &BoundResource) {
        let write = vk::WriteDescriptorSet::default()
            .dst_set(self.set)
            .dst_binding(binding)
            .descriptor_type(descriptor_type(resource));
        match resource {
            BoundResource::Uniform(buffer) | BoundResource::Storage(buffer) => {
                let info = [vk::DescriptorBufferInfo::default()
                    .buffer(buffer.raw)
                    .offset(0)
                    .range(vk::WHOLE_SIZE)];
                // SAFETY: the buffer is alive, and nothing uses the set yet.
                unsafe {
                    self.device
                        .raw
                        .update_descriptor_sets(&[write.buffer_info(&info)], &[])
                };
            }
            BoundResource::Acceleration(structure) => {
                let structures = [*structure];
                let mut info = vk::WriteDescriptorSetAccelerationStructureKHR::default()
                    .acceleration_structures(&structures);
                // SAFETY: the structure is alive, and nothing uses the set yet.
                unsafe {
                    self.device.raw.update_descriptor_sets(
                        &[write.descriptor_count(1).push_next(&mut info)],
                        &[],
                    );
                }
            }
        }
    }

    /// Records a bind of the set.
    pub fn bind(
        &self,
        commands: vk::CommandBuffer,
        point: vk::PipelineBindPoint,
        layout: vk::PipelineLayout,
    ) {
        // SAFETY: the commands are being recorded, and the pipeline's layout was made from this
        // set's layout.
        unsafe {
            self.device
                .raw
                .cmd_bind_descriptor_sets(commands, point, layout, 0, &[self.set], &[])
        };
    }
}

/// Returns an error if there are more storage buffers than one shader can access.
fn check_count(device: &Device, bound: &[BoundResource]) -> Result<(), VulkanError> {
    let is_storage = |b: &&BoundResource| matches!(b, BoundResource::Storage(_));
    let (count, max) = (
        bound.iter().filter(is_storage).count(),
        device.info.limits.storage_buffers,
    );
    if count as u64 <= u64::from(max) {
        return Ok(());
    }
    Err(VulkanError::Lacks {
        device: device.info.line(),
        needed: format!("{count} storage buffers in one shader (at most {max})"),
    })
}

fn descriptor_type(resource: &BoundResource) -> vk::DescriptorType {
    match resource {
        BoundResource::Uniform(_) => vk::DescriptorType::UNIFORM_BUFFER,
        BoundResource::Storage(_) => vk::DescriptorType::STORAGE_BUFFER,
        BoundResource::Acceleration(_) => vk::DescriptorType::ACCELERATION_STRUCTURE_KHR,
    }
}

impl Drop for Bindings {
    fn drop(&mut self) {
        if self.device.is_stuck() {
            return;
        }
        // SAFETY: every submission that uses the set was waited for.
        unsafe {
            self.device.raw.destroy_descriptor_pool(self.pool, None);
            self.device
                .raw
                .destroy_descriptor_set_layout(self.layout, None);
        }
    }
}

/// SPIR-V capability of double precision.
const FLOAT64: u32 = 10;

/// SPIR-V capability of addresses of storage buffers.
const ADDRESSES: u32 = 5347;

/// Returns whether SPIR-V needs a capability.
fn needs(words: &[u32], capability: u32) -> bool {
    let mut rest = words.get(5..).unwrap_or_default();
    while let [first, second, ..] = rest
        && first & 0xffff == 17
    {
        if *second == capability {
            return true;
        }
        rest = &rest[2..];
    }
    false
}

/// Shader module, needed while pipelines are created from it.
pub struct Module {
    device: Arc<Device>,
    /// Handle of the module.
    pub raw: vk::ShaderModule,
}

impl Module {
    /// Creates a module from SPIR-V; `name` appears in messages.
    ///
    /// # Errors
    /// Returns an error if the device lacks a feature or refuses the module.
    pub fn new(device: &Arc<Device>, name: &str, words: &[u32]) -> Result<Module, VulkanError> {
        let caps = &device.info.caps;
        let missing = [
            (
                FLOAT64,
                caps.doubles,
                "double precision in shaders (shaderFloat64)",
            ),
            (
                ADDRESSES,
                caps.addresses,
                "addresses of buffers (bufferDeviceAddress)",
            ),
        ];
        for (capability, supported, needed) in missing {
            if needs(words, capability) && !supported {
                return Err(VulkanError::Lacks {
                    device: device.info.line(),
                    needed: needed.to_owned(),
                });
            }
        }
        let info = vk::ShaderModuleCreateInfo::default().code(words);
        // SAFETY: the words are SPIR-V of the compiler and live through the call.
        let raw = unsafe { device.raw.create_shader_module(&info, None) }
            .map_err(|r| device.failed("vkCreateShaderModule", r))?;
        device.name(raw, name);
        Ok(Module {
            device: Arc::clone(device),
            raw,
        })
    }

    /// Returns a pipeline stage that starts at this module's `main`.
    pub fn stage<'a>(
        &self,
        stage: vk::ShaderStageFlags,
        constants: &'a vk::SpecializationInfo<'a>,
    ) -> vk::PipelineShaderStageCreateInfo<'a> {
        vk::PipelineShaderStageCreateInfo::default()
            .stage(stage)
            .module(self.raw)
            .specialization_info(constants)
            .name(c"main")
    }
}

impl Drop for Module {
    fn drop(&mut self) {
        if self.device.is_stuck() {
            return;
        }
        // SAFETY: pipelines do not need the module after their creation.
        unsafe { self.device.raw.destroy_shader_module(self.raw, None) };
    }
}

impl Pipeline {
    /// Returns the device's pipeline of these shaders with these constants, for a descriptor set
    /// like `bindings` and push constants of a number of bytes. If there is none yet, `create`
    /// creates it with a layout and the specialisation of all its stages.
    ///
    /// # Errors
    /// Returns an error if the device refuses the layout or the pipeline.
    pub fn get_or_create(
        bindings: &Bindings,
        name: &str,
        shaders: &[&[u32]],
        constants: &Specialization,
        (stages, push): (vk::ShaderStageFlags, u32),
        create: impl FnOnce(
            &Arc<Device>,
            vk::PipelineLayout,
            &vk::SpecializationInfo,
        ) -> Result<vk::Pipeline, VulkanError>,
    ) -> Result<Pipeline, VulkanError> {
        let device = &bindings.device;
        let data = bytemuck::bytes_of(constants);
        let mut hasher = blake3::Hasher::new();
        for words in shaders {
            hasher
                .update(&(words.len() as u64).to_le_bytes())
                .update(bytemuck::cast_slice(words));
        }
        for kind in &bindings.kinds {
            hasher.update(&kind.as_raw().to_le_bytes());
        }
        hasher
            .update(data)
            .update(&bindings.stages.as_raw().to_le_bytes())
            .update(&stages.as_raw().to_le_bytes())
            .update(&push.to_le_bytes());
        let key = *hasher.finalize().as_bytes();
        device.pipeline_registry.0.get_or_create(key, || {
            let layout = create_layout(bindings, stages, push)?;
            let entries = Specialization::entries();
            let specialization = vk::SpecializationInfo::default()
                .map_entries(&entries)
                .data(data);
            let raw = create(device, layout, &specialization).inspect_err(|_| {
                // SAFETY: nothing was made with it.
                unsafe { device.raw.destroy_pipeline_layout(layout, None) };
            })?;
            device.name(raw, name);
            device.name(layout, name);
            device.save_pipeline_cache();
            statistics::append(device, name, raw);
            Ok(Pipeline { layout, raw })
        })
    }
}

/// Creates the layout of a pipeline with a descriptor set and push constants of `push` bytes.
fn create_layout(
    bindings: &Bindings,
    stages: vk::ShaderStageFlags,
    push: u32,
) -> Result<vk::PipelineLayout, VulkanError> {
    let device = &bindings.device;
    let layouts = [bindings.layout];
    let ranges = [vk::PushConstantRange::default()
        .stage_flags(stages)
        .size(push)];
    let mut info = vk::PipelineLayoutCreateInfo::default().set_layouts(&layouts);
    if push > 0 {
        info = info.push_constant_ranges(&ranges);
    }
    // SAFETY: the device is open and the structures live through the call.
    unsafe { device.raw.create_pipeline_layout(&info, None) }
        .map_err(|r| device.failed("vkCreatePipelineLayout", r))
}

/// Returns the error of a pipeline that the driver could not create.
pub(super) fn refused(
    device: &Device,
    call: &'static str,
    pipeline: &str,
    result: vk::Result,
) -> VulkanError {
    match result {
        vk::Result::ERROR_DEVICE_LOST => device.failed(call, result),
        _ => VulkanError::PipelineRefused {
            device: device.info.line(),
            pipeline: pipeline.to_owned(),
            result,
        },
    }
}

/// Compute pipeline of one shader.
pub struct ComputePipeline {
    device: Arc<Device>,
    pipeline: Pipeline,
}

impl ComputePipeline {
    /// Creates a pipeline for a descriptor set and push constants of `push` bytes.
    ///
    /// # Errors
    /// Returns an error if the device refuses the shader.
    pub fn new(
        name: &str,
        words: &[u32],
        constants: &Specialization,
        bindings: &Bindings,
        push: u32,
    ) -> Result<ComputePipeline, VulkanError> {
        let pipeline = Pipeline::get_or_create(
            bindings,
            name,
            &[words],
            constants,
            (vk::ShaderStageFlags::COMPUTE, push),
            |device, layout, specialization| {
                let module = Module::new(device, name, words)?;
                let stage = module.stage(vk::ShaderStageFlags::COMPUTE, specialization);
                let info = vk::ComputePipelineCreateInfo::default()
                    .flags(statistics::flags(device))
                    .stage(stage)
                    .layout(layout);
                // SAFETY: module and layout live through the call.
                let made = unsafe {
                    device
                        .raw
                        .create_compute_pipelines(device.pipelines, &[info], None)
                };
                let call = "vkCreateComputePipelines";
                let made = made.map_err(|(_, result)| refused(device, call, name, result));
                made.map(|pipelines| pipelines[0])
            },
        )?;
        Ok(ComputePipeline {
            device: Arc::clone(&bindings.device),
            pipeline,
        })
    }

    /// Records a dispatch of `groups` workgroups with its push constants.
    pub fn dispatch<P: Pod>(
        &self,
        commands: vk::CommandBuffer,
        bindings: &Bindings,
        push: &P,
        groups: [u32; 3],
    ) {
        let (raw, point) = (&self.device.raw, vk::PipelineBindPoint::COMPUTE);
        bindings.bind(commands, point, self.pipeline.layout);
        let bytes = bytemuck::bytes_of(push);
        // SAFETY: the commands are being recorded; the pipeline's layout has push constants of this
        // size.
        unsafe {
            raw.cmd_bind_pipeline(commands, point, self.pipeline.raw);
            if !bytes.is_empty() {
                raw.cmd_push_constants(
                    commands,
                    self.pipeline.layout,
                    vk::ShaderStageFlags::COMPUTE,
                    0,
                    bytes,
                );
            }
            raw.cmd_dispatch(commands, groups[0], groups[1], groups[2]);
        }
    }
}

#[cfg(test)]
mod tests {
    use ash::vk;
    use lumbre_render::RenderError;

    use super::{ADDRESSES, FLOAT64, needs};
    use crate::error::VulkanError;
    use crate::pipelines::modules;
    use crate::pipelines::program::TracingMode;
    use crate::pipelines::sources::Sources;
    use crate::renderer::into_render_error;

    #[test]
    fn a_pipeline_that_a_driver_refuses_is_an_error_with_a_mend() {
        let refused = VulkanError::PipelineRefused {
            device: "a card".to_owned(),
            pipeline: "bdpt by vulkan".to_owned(),
            result: vk::Result::ERROR_UNKNOWN,
        };
        let error = into_render_error(TracingMode::Pipeline, refused);
        assert!(matches!(error, RenderError::Unsupported { .. }));
        let message = error.to_string();
        for part in ["a card", "bdpt by vulkan", "UNKNOWN", "another backend"] {
            assert!(message.contains(part), "{message}");
        }
    }

    #[test]
    fn only_extended_modules_need_doubles_and_addresses() {
        for recipe in modules::recipes() {
            let words = Sources::Embedded.module(&recipe).unwrap();
            let extended = recipe.defines.contains(&"EXTENDED");
            for capability in [FLOAT64, ADDRESSES] {
                let found = needs(&words, capability);
                assert!(extended || !found, "{}: {capability}", recipe.file);
            }
        }
    }
}
