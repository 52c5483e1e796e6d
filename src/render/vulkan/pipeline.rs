//! Descriptors and compute pipelines.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

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
    kinds: Vec<vk::DescriptorType>,
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
            kinds: bound.iter().map(kind).collect(),
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
        device.name(made.layout, "scene and films");
        device.name(made.pool, "scene and films");
        device.name(made.set, "scene and films");
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
    /// Hands SPIR-V to the device, under a name for messages.
    ///
    /// # Errors
    /// When the device lacks something, or refuses it.
    pub fn new(device: &Arc<Device>, name: &str, words: &[u32]) -> Result<Module, VulkanError> {
        if spirv::uses_doubles(words) && !device.info.caps.doubles {
            let needed = "numbers of double precision in shaders (shaderFloat64)".to_owned();
            return Err(VulkanError::Lacks { device: device.info.line(), needed });
        }
        let info = vk::ShaderModuleCreateInfo::default().code(words);
        // SAFETY: the words come from the compiler and live through the call.
        let raw = unsafe { device.raw.create_shader_module(&info, None) }
            .map_err(|r| device.failed("vkCreateShaderModule", r))?;
        device.name(raw, name);
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

/// The pipelines of a device, by the hash of all that they are made of. What a run has made is there for every later one:
/// a new scene, seed or resolution makes no pipeline, nor does going back to an earlier technique.
#[derive(Default)]
pub struct Shelf(Mutex<BTreeMap<[u8; 32], Pipeline>>);

/// A pipeline with its layout. It is the device's, and lives as long.
#[derive(Clone, Copy)]
pub struct Pipeline {
    /// The layout.
    pub layout: vk::PipelineLayout,
    /// The pipeline.
    pub raw: vk::Pipeline,
}

impl Shelf {
    /// Number of pipelines so far.
    pub fn count(&self) -> usize {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).len()
    }

    /// Takes all pipelines away, for the end of their device.
    pub fn empty(&self) -> impl Iterator<Item = Pipeline> {
        std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner)).into_values()
    }
}

impl Pipeline {
    /// The device's pipeline of these shaders, for a set like `bindings` and push constants of so many bytes. Where there is
    /// none yet, `make` makes it with a layout; it says which call failed.
    ///
    /// # Errors
    /// When the device refuses either.
    pub fn of(
        bindings: &Bindings,
        name: &str,
        shaders: &[&[u32]],
        (stages, push): (vk::ShaderStageFlags, u32),
        make: impl FnOnce(vk::PipelineLayout) -> Result<vk::Pipeline, VulkanError>,
    ) -> Result<Pipeline, VulkanError> {
        let device = &bindings.device;
        let mut recipe = blake3::Hasher::new();
        for words in shaders {
            recipe.update(&(words.len() as u64).to_le_bytes()).update(bytemuck::cast_slice(words));
        }
        for kind in &bindings.kinds {
            recipe.update(&kind.as_raw().to_le_bytes());
        }
        recipe.update(&stages.as_raw().to_le_bytes()).update(&push.to_le_bytes());
        // Held while it is made, so that nobody makes it a second time.
        let mut shelf = device.shelf.0.lock().unwrap_or_else(PoisonError::into_inner);
        let key = *recipe.finalize().as_bytes();
        if let Some(made) = shelf.get(&key) {
            return Ok(*made);
        }
        let layouts = [bindings.layout];
        let ranges = [vk::PushConstantRange::default().stage_flags(stages).size(push)];
        let mut info = vk::PipelineLayoutCreateInfo::default().set_layouts(&layouts);
        if push > 0 {
            info = info.push_constant_ranges(&ranges);
        }
        // SAFETY: the device is open and the structures live through the call.
        let layout = unsafe { device.raw.create_pipeline_layout(&info, None) }
            .map_err(|r| device.failed("vkCreatePipelineLayout", r))?;
        let raw = make(layout).inspect_err(|_| {
            // SAFETY: nothing was made with it.
            unsafe { device.raw.destroy_pipeline_layout(layout, None) };
        })?;
        device.name(raw, name);
        device.name(layout, name);
        device.keep_cache();
        let made = Pipeline { layout, raw };
        shelf.insert(key, made);
        Ok(made)
    }
}

/// A compute pipeline.
pub struct Compute {
    device: Arc<Device>,
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
        let pipeline = Pipeline::of(bindings, name, &[words], (vk::ShaderStageFlags::COMPUTE, push), |layout| {
            let module = Module::new(device, name, words)?;
            let stage = module.stage(vk::ShaderStageFlags::COMPUTE);
            let info = vk::ComputePipelineCreateInfo::default().stage(stage).layout(layout);
            // SAFETY: module and layout live through the call.
            let made = unsafe { device.raw.create_compute_pipelines(device.pipelines, &[info], None) };
            let made = made.map_err(|(_, result)| device.failed("vkCreateComputePipelines", result));
            made.map(|pipelines| pipelines[0])
        })?;
        Ok(Compute { device: Arc::clone(device), pipeline })
    }

    /// Records a dispatch of so many workgroups with its push constants.
    pub fn dispatch<P: Pod>(&self, commands: vk::CommandBuffer, bindings: &Bindings, push: &P, groups: [u32; 3]) {
        let (raw, point) = (&self.device.raw, vk::PipelineBindPoint::COMPUTE);
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
