//! The open device that everything else works with.

use std::ffi::CStr;
use std::mem::ManuallyDrop;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ash::{ext, khr, vk};
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};

use super::fault;
use super::instance;
use super::instance::Instance;
use super::physical_device::{Caps, DeviceInfo};
use crate::error::VulkanError;
use crate::pipelines::cache;
use crate::pipelines::compute::PipelineRegistry;

/// Open device with its single queue. All objects made from it keep it alive.
pub struct Device {
    /// Description of the physical device.
    pub info: DeviceInfo,
    /// Functions of the device.
    pub raw: ash::Device,
    /// Functions of acceleration structures, if supported.
    pub accel: Option<khr::acceleration_structure::Device>,
    /// Functions of ray-tracing pipelines, if supported.
    pub tracing: Option<khr::ray_tracing_pipeline::Device>,
    /// Functions of statistics of pipelines, if supported.
    pub statistics: Option<khr::pipeline_executable_properties::Device>,
    fault: Option<ext::device_fault::Device>,
    debug: Option<ext::debug_utils::Device>,
    pub(crate) queue: vk::Queue,
    pub(crate) pool: vk::CommandPool,
    /// Driver's pipeline cache, used to create every pipeline.
    pub pipelines: vk::PipelineCache,
    /// Pipelines created so far.
    pub pipeline_registry: PipelineRegistry,
    allocator: ManuallyDrop<Mutex<Allocator>>,
    /// Set when a pass did not finish: objects that it may still use are leaked instead of
    /// destroyed.
    pub(crate) stuck: AtomicBool,
    /// Name of the last submitted pass; locked while commands are recorded and submitted.
    pub(crate) pass: Mutex<String>,
}

impl Device {
    /// Opens a device with everything that the backends can use, as far as `caps` allows: tests
    /// disable capabilities that the device has.
    ///
    /// # Errors
    /// Returns an error if the device lacks what every backend needs, or cannot be opened.
    pub fn open(mut info: DeviceInfo, caps: Caps) -> Result<Arc<Device>, VulkanError> {
        let instance = instance::shared()?;
        if !caps.scalar_layout {
            return Err(VulkanError::Lacks {
                device: info.line(),
                needed: "scalar block layout".to_owned(),
            });
        }
        info.caps = caps;
        let raw = create_device(instance, &info)?;
        let allocator = create_allocator(instance, &raw, &info)?;
        let pool_info = vk::CommandPoolCreateInfo::default()
            .queue_family_index(info.queue_family)
            .flags(
                vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER
                    | vk::CommandPoolCreateFlags::TRANSIENT,
            );
        let stored = cache::load(&info.cache_key);
        let cache_info = vk::PipelineCacheCreateInfo::default().initial_data(&stored);
        // SAFETY: the device has just been created and the family is the one of its queue; the
        // structures live long enough.
        let (queue, pool, pipelines) = unsafe {
            let queue = raw.get_device_queue(info.queue_family, 0);
            let pool = raw
                .create_command_pool(&pool_info, None)
                .map_err(open_failed("vkCreateCommandPool"))?;
            let pipelines = raw
                .create_pipeline_cache(&cache_info, None)
                .map_err(open_failed("vkCreatePipelineCache"))?;
            (queue, pool, pipelines)
        };
        let device = Arc::new(Device {
            accel: caps
                .traces()
                .then(|| khr::acceleration_structure::Device::new(&instance.raw, &raw)),
            tracing: caps
                .pipeline
                .then(|| khr::ray_tracing_pipeline::Device::new(&instance.raw, &raw)),
            statistics: caps
                .pipeline_statistics
                .then(|| khr::pipeline_executable_properties::Device::new(&instance.raw, &raw)),
            fault: caps
                .fault_report
                .then(|| ext::device_fault::Device::new(&instance.raw, &raw)),
            debug: instance
                .debug
                .then(|| ext::debug_utils::Device::new(&instance.raw, &raw)),
            queue,
            pool,
            pipelines,
            pipeline_registry: PipelineRegistry::default(),
            allocator: ManuallyDrop::new(Mutex::new(allocator)),
            stuck: AtomicBool::new(false),
            pass: Mutex::new("open".to_owned()),
            info,
            raw,
        });
        device.name(queue, "queue");
        device.name(pool, "commands");
        device.name(pipelines, "pipelines");
        Ok(device)
    }

    /// Returns whether the device did not finish a pass, so that objects must be leaked.
    pub fn is_stuck(&self) -> bool {
        self.stuck.load(Ordering::Relaxed)
    }

    /// Returns the error of a failed call, which may be a lost device.
    pub fn failed(&self, call: &'static str, result: vk::Result) -> VulkanError {
        let pass = self
            .pass
            .try_lock()
            .map_or_else(|_| "unknown".to_owned(), |pass| pass.clone());
        self.failed_in(call, result, pass)
    }

    /// Returns the error of a failed call that belongs to the given pass.
    pub(crate) fn failed_in(
        &self,
        call: &'static str,
        result: vk::Result,
        pass: String,
    ) -> VulkanError {
        match result {
            vk::Result::ERROR_DEVICE_LOST => VulkanError::Lost {
                device: self.info.line(),
                pass,
                fault: (self.fault.as_ref())
                    .and_then(|functions| fault::report(functions, self.raw.handle())),
            },
            result => VulkanError::Call { call, result, pass },
        }
    }

    /// Locks the allocator of device memory.
    pub fn allocator(&self) -> MutexGuard<'_, Allocator> {
        self.allocator
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }

    /// Names an object for messages of the validation layer.
    pub fn name(&self, object: impl vk::Handle, name: &str) {
        let Some(debug) = &self.debug else { return };
        let Ok(name) = std::ffi::CString::new(name) else {
            return;
        };
        let info = vk::DebugUtilsObjectNameInfoEXT::default()
            .object_handle(object)
            .object_name(&name);
        // SAFETY: the object was created by this device, and the name lives through the call.
        // Failure is harmless.
        let _ = unsafe { debug.set_debug_utils_object_name(&info) };
    }

    /// Stores the pipeline cache on disk. Called after every new pipeline, since a process that is
    /// killed or a device that is lost leaves no opportunity later.
    pub fn save_pipeline_cache(&self) {
        // SAFETY: the cache lives as long as the device.
        if let Ok(data) = unsafe { self.raw.get_pipeline_cache_data(self.pipelines) } {
            cache::store(&self.info.cache_key, &data);
        }
    }

    /// Records a barrier: copies wait for everything that shaders have written so far.
    pub fn barrier_to_copy(&self, commands: vk::CommandBuffer) {
        let stages = vk::PipelineStageFlags::COMPUTE_SHADER | self.tracing_stage();
        self.barrier(
            commands,
            (stages, vk::AccessFlags::SHADER_WRITE),
            (
                vk::PipelineStageFlags::TRANSFER,
                vk::AccessFlags::TRANSFER_READ | vk::AccessFlags::TRANSFER_WRITE,
            ),
        );
    }

    /// Records a barrier: shaders wait for everything that copies, fills and shaders have written
    /// so far.
    pub fn barrier_to_shaders(&self, commands: vk::CommandBuffer) {
        let stages = vk::PipelineStageFlags::COMPUTE_SHADER | self.tracing_stage();
        self.barrier(
            commands,
            (
                vk::PipelineStageFlags::TRANSFER | stages,
                vk::AccessFlags::TRANSFER_WRITE | vk::AccessFlags::SHADER_WRITE,
            ),
            (
                stages,
                vk::AccessFlags::SHADER_READ
                    | vk::AccessFlags::SHADER_WRITE
                    | vk::AccessFlags::UNIFORM_READ,
            ),
        );
    }

    /// Returns the stage of ray-tracing shaders, if the device supports them.
    fn tracing_stage(&self) -> vk::PipelineStageFlags {
        match self.tracing {
            Some(_) => vk::PipelineStageFlags::RAY_TRACING_SHADER_KHR,
            None => vk::PipelineStageFlags::empty(),
        }
    }

    /// Records a barrier: later work in the stages `to` waits for earlier work in the stages
    /// `from`.
    pub fn barrier(
        &self,
        commands: vk::CommandBuffer,
        from: (vk::PipelineStageFlags, vk::AccessFlags),
        to: (vk::PipelineStageFlags, vk::AccessFlags),
    ) {
        let memory = [vk::MemoryBarrier::default()
            .src_access_mask(from.1)
            .dst_access_mask(to.1)];
        // SAFETY: the commands are being recorded.
        unsafe {
            self.raw.cmd_pipeline_barrier(
                commands,
                from.0,
                to.0,
                vk::DependencyFlags::empty(),
                &memory,
                &[],
                &[],
            );
        }
    }

    /// Records commands, submits them as the pass `pass`, and waits until they are done.
    ///
    /// # Errors
    /// Returns an error if recording fails, the device is lost, or it does not finish in time.
    pub fn run(
        self: &Arc<Device>,
        pass: &str,
        record: impl FnOnce(vk::CommandBuffer),
    ) -> Result<(), VulkanError> {
        self.submit(pass, record, |_| ())?.wait().map(drop)
    }
}

/// Returns the error of a call that failed while a device was opened.
fn open_failed(call: &'static str) -> impl Fn(vk::Result) -> VulkanError {
    move |result| VulkanError::Call {
        call,
        result,
        pass: "open".to_owned(),
    }
}

/// Creates the allocator of device memory.
fn create_allocator(
    instance: &Instance,
    raw: &ash::Device,
    info: &DeviceInfo,
) -> Result<Allocator, VulkanError> {
    Allocator::new(&AllocatorCreateDesc {
        instance: instance.raw.clone(),
        device: raw.clone(),
        physical_device: info.physical,
        debug_settings: Default::default(),
        buffer_device_address: info.caps.addresses || info.caps.traces(),
        allocation_sizes: Default::default(),
    })
    .map_err(|e| VulkanError::NoDevice(format!("its memory allocator cannot be created: {e}")))
}

/// Creates a logical device with one queue and the features of the given capabilities.
fn create_device(instance: &Instance, info: &DeviceInfo) -> Result<ash::Device, VulkanError> {
    let caps = info.caps;
    let traces = caps.traces();
    let addresses = caps.addresses || traces;
    let mut names = Vec::new();
    if traces {
        names.extend([
            khr::acceleration_structure::NAME,
            khr::deferred_host_operations::NAME,
        ]);
    }
    for (there, name) in [
        (caps.pipeline, khr::ray_tracing_pipeline::NAME),
        (caps.query, khr::ray_query::NAME),
        (caps.float_atomics, ext::shader_atomic_float::NAME),
        (caps.memory_budget, ext::memory_budget::NAME),
        (caps.fault_report, ext::device_fault::NAME),
        (
            caps.pipeline_statistics,
            khr::pipeline_executable_properties::NAME,
        ),
    ] {
        names.extend(there.then_some(name));
    }
    let names: Vec<_> = names.into_iter().map(CStr::as_ptr).collect();
    let mut vulkan12 = vk::PhysicalDeviceVulkan12Features::default()
        .scalar_block_layout(true)
        .buffer_device_address(addresses);
    let mut accel =
        vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default().acceleration_structure(true);
    let mut pipeline =
        vk::PhysicalDeviceRayTracingPipelineFeaturesKHR::default().ray_tracing_pipeline(true);
    let mut query = vk::PhysicalDeviceRayQueryFeaturesKHR::default().ray_query(true);
    let mut atomics = vk::PhysicalDeviceShaderAtomicFloatFeaturesEXT::default()
        .shader_buffer_float32_atomic_add(true);
    let mut fault = vk::PhysicalDeviceFaultFeaturesEXT::default().device_fault(true);
    let mut statistics = vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default()
        .pipeline_executable_info(true);
    let priorities = [1.0];
    let queues = [vk::DeviceQueueCreateInfo::default()
        .queue_family_index(info.queue_family)
        .queue_priorities(&priorities)];
    let features = vk::PhysicalDeviceFeatures::default().shader_float64(caps.doubles);
    let mut create = vk::DeviceCreateInfo::default()
        .queue_create_infos(&queues)
        .enabled_features(&features)
        .enabled_extension_names(&names)
        .push_next(&mut vulkan12);
    if traces {
        create = create.push_next(&mut accel);
    }
    if caps.pipeline {
        create = create.push_next(&mut pipeline);
    }
    if caps.query {
        create = create.push_next(&mut query);
    }
    if caps.float_atomics {
        create = create.push_next(&mut atomics);
    }
    if caps.fault_report {
        create = create.push_next(&mut fault);
    }
    if caps.pipeline_statistics {
        create = create.push_next(&mut statistics);
    }
    // SAFETY: the physical device comes from this instance, and the structures live through the
    // call.
    unsafe { instance.raw.create_device(info.physical, &create, None) }
        .map_err(open_failed("vkCreateDevice"))
}

impl Drop for Device {
    fn drop(&mut self) {
        if self.is_stuck() {
            return;
        }
        // SAFETY: all objects made from the device keep it alive, so this runs last; the queue is
        // idle, since every submission was waited for, or lost.
        unsafe {
            let _ = self.raw.device_wait_idle();
            for pipeline in self.pipeline_registry.drain() {
                self.raw.destroy_pipeline(pipeline.raw, None);
                self.raw.destroy_pipeline_layout(pipeline.layout, None);
            }
            ManuallyDrop::drop(&mut self.allocator);
            self.raw.destroy_pipeline_cache(self.pipelines, None);
            self.raw.destroy_command_pool(self.pool, None);
            self.raw.destroy_device(None);
        }
    }
}
