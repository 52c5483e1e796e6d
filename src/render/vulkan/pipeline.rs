//! Descriptors and compute pipelines.

use std::sync::Arc;

use ash::vk;
use bytemuck::Pod;

use super::buffer::Buffer;
use super::device::Device;
use super::error::VulkanError;
use super::spirv;

/// What a binding of a descriptor set is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Slot {
    /// A storage buffer.
    Storage,
    /// An acceleration structure.
    Acceleration,
}

/// What is bound.
pub enum Bound<'a> {
    /// A storage buffer.
    Storage(&'a Buffer),
    /// An acceleration structure.
    Acceleration(vk::AccelerationStructureKHR),
}

/// One descriptor set with its layout, bound once: binding `i` is the `i`-th resource.
pub struct Bindings {
    device: Arc<Device>,
    layout: vk::DescriptorSetLayout,
    pool: vk::DescriptorPool,
    set: vk::DescriptorSet,
}

impl Bindings {
    /// Binds resources, which must outlive every use, for shaders of the given stages.
    ///
    /// # Errors
    /// When the device has no room for them.
    pub fn new(device: &Arc<Device>, stages: vk::ShaderStageFlags, bound: &[Bound]) -> Result<Bindings, VulkanError> {
        let kind = |b: &Bound| match b {
            Bound::Storage(_) => vk::DescriptorType::STORAGE_BUFFER,
            Bound::Acceleration(_) => vk::DescriptorType::ACCELERATION_STRUCTURE_KHR,
        };
        let bindings: Vec<_> = (0u32..)
            .zip(bound)
            .map(|(i, b)| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(i)
                    .descriptor_type(kind(b))
                    .descriptor_count(1)
                    .stage_flags(stages)
            })
            .collect();
        let sizes: Vec<_> =
            bound.iter().map(|b| vk::DescriptorPoolSize::default().ty(kind(b)).descriptor_count(1)).collect();
        let layout_info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        let pool_info = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
        let mut made = Bindings {
            device: Arc::clone(device),
            layout: vk::DescriptorSetLayout::null(),
            pool: vk::DescriptorPool::null(),
            set: vk::DescriptorSet::null(),
        };
        // SAFETY: the device is open and the structures live through the calls; what was made is destroyed on drop.
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
            let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(made.pool).set_layouts(&layouts);
            made.set =
                device.raw.allocate_descriptor_sets(&info).map_err(|r| device.failed("vkAllocateDescriptorSets", r))?
                    [0];
        }
        for (i, b) in (0u32..).zip(bound) {
            let write = vk::WriteDescriptorSet::default().dst_set(made.set).dst_binding(i).descriptor_type(kind(b));
            match b {
                Bound::Storage(buffer) => {
                    let info = [vk::DescriptorBufferInfo::default().buffer(buffer.raw).offset(0).range(vk::WHOLE_SIZE)];
                    // SAFETY: the buffer lives, and nothing uses the set yet.
                    unsafe { device.raw.update_descriptor_sets(&[write.buffer_info(&info)], &[]) };
                }
                Bound::Acceleration(structure) => {
                    let structures = [*structure];
                    let mut info =
                        vk::WriteDescriptorSetAccelerationStructureKHR::default().acceleration_structures(&structures);
                    // SAFETY: the structure lives, and nothing uses the set yet.
                    unsafe {
                        device.raw.update_descriptor_sets(&[write.descriptor_count(1).push_next(&mut info)], &[]);
                    }
                }
            }
        }
        Ok(made)
    }

    /// Binds the set while commands are recorded.
    pub fn bind(&self, commands: vk::CommandBuffer, point: vk::PipelineBindPoint, layout: vk::PipelineLayout) {
        // SAFETY: the commands are being recorded, and the pipeline's layout was made from this set's.
        unsafe { self.device.raw.cmd_bind_descriptor_sets(commands, point, layout, 0, &[self.set], &[]) };
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
            self.device.raw.destroy_descriptor_set_layout(self.layout, None);
        }
    }
}

/// A shader module, for as long as pipelines are made from it.
pub struct Module {
    device: Arc<Device>,
    /// The module.
    pub raw: vk::ShaderModule,
}

impl Module {
    /// Hands SPIR-V to the device.
    ///
    /// # Errors
    /// When the device lacks something, or refuses it.
    pub fn new(device: &Arc<Device>, words: &[u32]) -> Result<Module, VulkanError> {
        if spirv::uses_doubles(words) && !device.info.caps.doubles {
            let needed = "numbers of double precision in shaders (shaderFloat64)".to_owned();
            return Err(VulkanError::Lacks { device: device.info.line(), needed });
        }
        let info = vk::ShaderModuleCreateInfo::default().code(words);
        // SAFETY: the words come from the compiler and live through the call.
        let raw = unsafe { device.raw.create_shader_module(&info, None) }
            .map_err(|r| device.failed("vkCreateShaderModule", r))?;
        Ok(Module { device: Arc::clone(device), raw })
    }

    /// A stage of a pipeline that starts at this module's `main`.
    pub fn stage(&self, stage: vk::ShaderStageFlags) -> vk::PipelineShaderStageCreateInfo<'static> {
        vk::PipelineShaderStageCreateInfo::default().stage(stage).module(self.raw).name(c"main")
    }
}

impl Drop for Module {
    fn drop(&mut self) {
        if self.device.is_stuck() {
            return;
        }
        // SAFETY: pipelines do not need the module once they are made.
        unsafe { self.device.raw.destroy_shader_module(self.raw, None) };
    }
}

/// A pipeline with its layout.
pub struct Pipeline {
    device: Arc<Device>,
    /// The layout.
    pub layout: vk::PipelineLayout,
    /// The pipeline.
    pub raw: vk::Pipeline,
}

impl Pipeline {
    /// What `make` makes with a layout for a set and push constants of so many bytes; it says which call failed.
    ///
    /// # Errors
    /// When the device refuses either.
    pub fn new(
        bindings: &Bindings,
        name: &str,
        (stages, push): (vk::ShaderStageFlags, u32),
        make: impl FnOnce(vk::PipelineLayout) -> Result<vk::Pipeline, (&'static str, vk::Result)>,
    ) -> Result<Pipeline, VulkanError> {
        let device = &bindings.device;
        let layouts = [bindings.layout];
        let ranges = [vk::PushConstantRange::default().stage_flags(stages).size(push)];
        let mut info = vk::PipelineLayoutCreateInfo::default().set_layouts(&layouts);
        if push > 0 {
            info = info.push_constant_ranges(&ranges);
        }
        // SAFETY: the device is open and the structures live through the call.
        let layout = unsafe { device.raw.create_pipeline_layout(&info, None) }
            .map_err(|r| device.failed("vkCreatePipelineLayout", r))?;
        // From here on both are destroyed when they are dropped; there may be no pipeline.
        let mut made = Pipeline { device: Arc::clone(device), layout, raw: vk::Pipeline::null() };
        made.raw = make(layout).map_err(|(call, result)| device.failed(call, result))?;
        device.name(made.raw, name);
        Ok(made)
    }
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        if self.device.is_stuck() {
            return;
        }
        // SAFETY: every submission that uses the pipeline was waited for.
        unsafe {
            self.device.raw.destroy_pipeline(self.raw, None);
            self.device.raw.destroy_pipeline_layout(self.layout, None);
        }
    }
}

/// A compute pipeline.
pub struct Compute {
    pipeline: Pipeline,
}

impl Compute {
    /// Makes a pipeline for a set and push constants of so many bytes.
    ///
    /// # Errors
    /// When the device refuses the shader.
    pub fn new(
        device: &Arc<Device>,
        name: &str,
        words: &[u32],
        bindings: &Bindings,
        push: u32,
    ) -> Result<Compute, VulkanError> {
        let module = Module::new(device, words)?;
        let stage = module.stage(vk::ShaderStageFlags::COMPUTE);
        let pipeline = Pipeline::new(bindings, name, (vk::ShaderStageFlags::COMPUTE, push), |layout| {
            let info = vk::ComputePipelineCreateInfo::default().stage(stage).layout(layout);
            // SAFETY: module and layout live through the call.
            let made = unsafe { device.raw.create_compute_pipelines(device.pipelines, &[info], None) };
            made.map(|pipelines| pipelines[0]).map_err(|(_, result)| ("vkCreateComputePipelines", result))
        })?;
        Ok(Compute { pipeline })
    }

    /// Records a dispatch of so many workgroups with its push constants.
    pub fn dispatch<P: Pod>(&self, commands: vk::CommandBuffer, bindings: &Bindings, push: &P, groups: [u32; 3]) {
        let (raw, point) = (&self.pipeline.device.raw, vk::PipelineBindPoint::COMPUTE);
        bindings.bind(commands, point, self.pipeline.layout);
        let bytes = bytemuck::bytes_of(push);
        // SAFETY: the commands are being recorded; the pipeline's layout has push constants of this size.
        unsafe {
            raw.cmd_bind_pipeline(commands, point, self.pipeline.raw);
            if !bytes.is_empty() {
                raw.cmd_push_constants(commands, self.pipeline.layout, vk::ShaderStageFlags::COMPUTE, 0, bytes);
            }
            raw.cmd_dispatch(commands, groups[0], groups[1], groups[2]);
        }
    }
}
