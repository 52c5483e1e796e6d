//! Devices: what there is, what each can do, and the open one that everything else works with.

use std::ffi::CStr;
use std::mem::ManuallyDrop;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ash::{ext, khr, vk};
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};

use super::cache;
use super::error::VulkanError;
use super::instance::{self, Instance};
use super::pipeline::Shelf;
use crate::render::choice;

/// The variable that names the device to use: its index or a part of its name, as `lumbre doctor` lists them.
pub const DEVICE_VARIABLE: &str = "LUMBRE_DEVICE";

/// What a device can do of what the backends ask.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Caps {
    /// Structures in buffers without padding; everything needs it.
    pub scalar_layout: bool,
    /// Buffers with addresses, which acceleration structures need, and texels where there are many.
    pub addresses: bool,
    /// Ray-tracing pipelines.
    pub pipeline: bool,
    /// Ray queries.
    pub query: bool,
    /// Atomic addition of floats in buffers, unless whole numbers are asked for.
    pub float_atomics: bool,
    /// Numbers of double precision in shaders.
    pub doubles: bool,
}

/// Limits that are asked for rather than assumed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    /// Most bytes of one storage buffer that a shader can see.
    pub storage_range: u64,
    /// Most bytes of texels in one buffer: as many as of any storage buffer, unless a test wants them cut into blocks.
    pub texels: u64,
    /// Bytes of the largest device-local heap.
    pub heap: u64,
    /// Nanoseconds of a step of the device's clock; 0 if it has none.
    pub timestamp_ns: f64,
    /// The bits that a tick has: it starts over beyond them.
    pub timestamp_mask: u64,
    /// Bytes of a shader group's handle.
    pub handle: u64,
    /// Alignment of handles inside a table.
    pub handle_alignment: u64,
    /// Alignment of a table.
    pub base_alignment: u64,
    /// Alignment of scratch memory of acceleration structures.
    pub scratch_alignment: u64,
    /// Most primitives of an acceleration structure.
    pub primitives: u64,
}

/// A device as listed.
#[derive(Clone, Debug)]
pub struct DeviceInfo {
    /// Place in the list.
    pub index: usize,
    /// The name that its driver gives.
    pub name: String,
    /// The driver and its version.
    pub driver: String,
    /// Whether it is a program on the processor.
    pub software: bool,
    /// What it can do.
    pub caps: Caps,
    /// Its limits.
    pub limits: Limits,
    /// Names its pipeline cache: changes with device and driver.
    pub cache_key: String,
    /// Tells it from every other device of this machine, by whatever driver.
    uuid: [u8; vk::UUID_SIZE],
    physical: vk::PhysicalDevice,
    queue_family: u32,
}

impl DeviceInfo {
    /// A line for people.
    pub fn line(&self) -> String {
        format!("{} ({})", self.name, self.driver)
    }

    /// Those of the listed devices that are of the model of this one, and other pieces of hardware: a device that two
    /// drivers, or two entries of one driver, list twice counts once, and programs on the processor share it.
    pub fn alike(&self, listed: &[DeviceInfo]) -> Vec<usize> {
        let mut seen = vec![self.uuid];
        let mut fits = |other: &&DeviceInfo| {
            let fits = !self.software && other.line() == self.line() && !seen.contains(&other.uuid);
            seen.push(other.uuid);
            fits
        };
        listed.iter().filter(|other| fits(other)).map(|other| other.index).collect()
    }
}

/// Every device that can compute, in the loader's order.
///
/// # Errors
/// When there is no loader.
pub fn list() -> Result<Vec<DeviceInfo>, VulkanError> {
    let instance = instance::shared()?;
    // SAFETY: the instance lives as long as the process.
    let physical = unsafe { instance.raw.enumerate_physical_devices() }.map_err(|result| VulkanError::Call {
        call: "vkEnumeratePhysicalDevices",
        result,
        pass: "start".to_owned(),
    })?;
    Ok(physical.into_iter().enumerate().filter_map(|(index, p)| describe(instance, index, p)).collect())
}

fn describe(instance: &Instance, index: usize, physical: vk::PhysicalDevice) -> Option<DeviceInfo> {
    let raw = &instance.raw;
    // SAFETY: the physical device comes from this instance; here and below every structure lives through its call.
    let families = unsafe { raw.get_physical_device_queue_family_properties(physical) };
    let queue_family = families.iter().position(|f| f.queue_flags.contains(vk::QueueFlags::COMPUTE))?;
    // SAFETY: as above.
    let extensions = unsafe { raw.enumerate_device_extension_properties(physical) }.unwrap_or_default();
    let has = |name: &CStr| extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(name));
    let (has_accel, has_pipeline) = (has(khr::acceleration_structure::NAME), has(khr::ray_tracing_pipeline::NAME));
    let (has_query, has_atomics) = (has(khr::ray_query::NAME), has(ext::shader_atomic_float::NAME));

    let mut driver = vk::PhysicalDeviceDriverProperties::default();
    let mut identity = vk::PhysicalDeviceIDProperties::default();
    let mut pipeline_limits = vk::PhysicalDeviceRayTracingPipelinePropertiesKHR::default();
    let mut accel_limits = vk::PhysicalDeviceAccelerationStructurePropertiesKHR::default();
    let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut driver).push_next(&mut identity);
    if has_pipeline {
        properties = properties.push_next(&mut pipeline_limits);
    }
    if has_accel {
        properties = properties.push_next(&mut accel_limits);
    }
    // SAFETY: as above.
    unsafe { raw.get_physical_device_properties2(physical, &mut properties) };
    let core = properties.properties;
    if core.api_version < vk::API_VERSION_1_2 {
        return None;
    }

    let mut vulkan12 = vk::PhysicalDeviceVulkan12Features::default();
    let mut accel = vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default();
    let mut pipeline = vk::PhysicalDeviceRayTracingPipelineFeaturesKHR::default();
    let mut query = vk::PhysicalDeviceRayQueryFeaturesKHR::default();
    let mut atomics = vk::PhysicalDeviceShaderAtomicFloatFeaturesEXT::default();
    let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut vulkan12);
    if has_accel {
        features = features.push_next(&mut accel);
    }
    if has_pipeline {
        features = features.push_next(&mut pipeline);
    }
    if has_query {
        features = features.push_next(&mut query);
    }
    if has_atomics {
        features = features.push_next(&mut atomics);
    }
    // SAFETY: as above.
    unsafe { raw.get_physical_device_features2(physical, &mut features) };
    let doubles = features.features.shader_float64 == vk::TRUE;
    let traces = accel.acceleration_structure == vk::TRUE && vulkan12.buffer_device_address == vk::TRUE;
    let caps = Caps {
        scalar_layout: vulkan12.scalar_block_layout == vk::TRUE,
        addresses: vulkan12.buffer_device_address == vk::TRUE,
        pipeline: traces && pipeline.ray_tracing_pipeline == vk::TRUE,
        query: traces && query.ray_query == vk::TRUE,
        float_atomics: atomics.shader_buffer_float32_atomic_add == vk::TRUE && !choice::whole_splats(),
        doubles,
    };
    // SAFETY: as above.
    let memory = unsafe { raw.get_physical_device_memory_properties(physical) };
    let local = |h: &&vk::MemoryHeap| h.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL);
    let heap = memory.memory_heaps_as_slice().iter().filter(local).map(|h| h.size).max().unwrap_or(0);
    let bits = families[queue_family].timestamp_valid_bits;
    let limits = Limits {
        storage_range: u64::from(core.limits.max_storage_buffer_range),
        texels: u64::from(core.limits.max_storage_buffer_range),
        heap,
        timestamp_ns: if bits > 0 { f64::from(core.limits.timestamp_period) } else { 0.0 },
        timestamp_mask: u64::MAX.checked_shr(64 - bits.min(64)).unwrap_or(0),
        handle: u64::from(pipeline_limits.shader_group_handle_size),
        handle_alignment: u64::from(pipeline_limits.shader_group_handle_alignment),
        base_alignment: u64::from(pipeline_limits.shader_group_base_alignment),
        scratch_alignment: u64::from(accel_limits.min_acceleration_structure_scratch_offset_alignment).max(1),
        primitives: accel_limits.max_primitive_count,
    };
    let text = |c: Result<&CStr, _>| c.map(|c| c.to_string_lossy().into_owned()).unwrap_or_default();
    let uuid: String = core.pipeline_cache_uuid.iter().map(|b| format!("{b:02x}")).collect();
    Some(DeviceInfo {
        index,
        name: text(core.device_name_as_c_str()),
        driver: format!("{} {}", text(driver.driver_name_as_c_str()), text(driver.driver_info_as_c_str())),
        software: core.device_type == vk::PhysicalDeviceType::CPU,
        caps,
        limits,
        cache_key: format!("{:04x}-{:04x}-{uuid}", core.vendor_id, core.device_id),
        uuid: identity.device_uuid,
        physical,
        queue_family: queue_family as u32,
    })
}

/// The device to use: the one that [`DEVICE_VARIABLE`] names, or else the first that is no program, or the first.
///
/// # Errors
/// When there is no loader, no device, or none of that name.
pub fn choose() -> Result<DeviceInfo, VulkanError> {
    let devices = list()?;
    if let Some(wanted) = choice::device(DEVICE_VARIABLE) {
        return find(&devices, &wanted).cloned();
    }
    let first = devices.iter().find(|d| !d.software).or(devices.first()).cloned();
    first.ok_or_else(|| VulkanError::NoDevice("the loader knows none with Vulkan 1.2 and compute".to_owned()))
}

/// The listed device of an index, or the first with a name of which this is a part.
///
/// # Errors
/// When there is none; the message lists those that there are.
pub fn find<'a>(devices: &'a [DeviceInfo], wanted: &str) -> Result<&'a DeviceInfo, VulkanError> {
    let lower = wanted.to_lowercase();
    let fits = |d: &&DeviceInfo| {
        wanted.parse() == Ok(d.index) || (wanted.parse::<usize>().is_err() && d.name.to_lowercase().contains(&lower))
    };
    devices.iter().find(fits).ok_or_else(|| {
        let names: Vec<String> = devices.iter().map(|d| format!("{} {}", d.index, d.name)).collect();
        VulkanError::NoDevice(format!(
            "`{wanted}` was asked for (--device, --devices, {DEVICE_VARIABLE}); there are: {}",
            names.join(", ")
        ))
    })
}

/// An open device with its one queue. Everything made from it keeps it alive.
pub struct Device {
    /// What it is.
    pub info: DeviceInfo,
    /// Its functions.
    pub raw: ash::Device,
    /// Functions of acceleration structures, where it has them.
    pub accel: Option<khr::acceleration_structure::Device>,
    /// Functions of ray-tracing pipelines, where it has them.
    pub tracing: Option<khr::ray_tracing_pipeline::Device>,
    debug: Option<ext::debug_utils::Device>,
    pub(super) queue: vk::Queue,
    pub(super) pool: vk::CommandPool,
    /// The cache that every pipeline is made with.
    pub pipelines: vk::PipelineCache,
    /// The pipelines that were made.
    pub shelf: Shelf,
    allocator: ManuallyDrop<Mutex<Allocator>>,
    /// Set when a pass did not finish: what it may still use must not be destroyed, and is leaked.
    pub(super) stuck: AtomicBool,
    /// Held while commands are recorded and handed to the queue, and names the last pass handed to it.
    pub(super) pass: Mutex<String>,
}

impl Device {
    /// Opens a device with everything that the backends can use of it, as far as `caps` allows: a capability that is
    /// there can be left off, which tests use.
    ///
    /// # Errors
    /// When the device lacks what every backend needs, or does not open.
    pub fn open(mut info: DeviceInfo, caps: Caps) -> Result<Arc<Device>, VulkanError> {
        let instance = instance::shared()?;
        if !caps.scalar_layout {
            return Err(VulkanError::Lacks { device: info.line(), needed: "scalar block layout".to_owned() });
        }
        info.caps = caps;
        let call = |call: &'static str| move |result| VulkanError::Call { call, result, pass: "open".to_owned() };
        let traces = caps.pipeline || caps.query;
        let addresses = caps.addresses || traces;
        let mut names = Vec::new();
        if traces {
            names.extend([khr::acceleration_structure::NAME, khr::deferred_host_operations::NAME]);
        }
        for (there, name) in [
            (caps.pipeline, khr::ray_tracing_pipeline::NAME),
            (caps.query, khr::ray_query::NAME),
            (caps.float_atomics, ext::shader_atomic_float::NAME),
        ] {
            names.extend(there.then_some(name));
        }
        let names: Vec<_> = names.into_iter().map(CStr::as_ptr).collect();
        let mut vulkan12 =
            vk::PhysicalDeviceVulkan12Features::default().scalar_block_layout(true).buffer_device_address(addresses);
        let mut accel = vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default().acceleration_structure(true);
        let mut pipeline = vk::PhysicalDeviceRayTracingPipelineFeaturesKHR::default().ray_tracing_pipeline(true);
        let mut query = vk::PhysicalDeviceRayQueryFeaturesKHR::default().ray_query(true);
        let mut atomics =
            vk::PhysicalDeviceShaderAtomicFloatFeaturesEXT::default().shader_buffer_float32_atomic_add(true);
        let priorities = [1.0];
        let queues =
            [vk::DeviceQueueCreateInfo::default().queue_family_index(info.queue_family).queue_priorities(&priorities)];
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
        // SAFETY: the physical device comes from this instance, and the structures live through the call.
        let raw =
            unsafe { instance.raw.create_device(info.physical, &create, None) }.map_err(call("vkCreateDevice"))?;
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: instance.raw.clone(),
            device: raw.clone(),
            physical_device: info.physical,
            debug_settings: Default::default(),
            buffer_device_address: addresses,
            allocation_sizes: Default::default(),
        })
        .map_err(|e| VulkanError::NoDevice(format!("its memory cannot be managed: {e}")))?;
        let pool_info = vk::CommandPoolCreateInfo::default()
            .queue_family_index(info.queue_family)
            .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER | vk::CommandPoolCreateFlags::TRANSIENT);
        let stored = cache::load(&info.cache_key);
        let cache_info = vk::PipelineCacheCreateInfo::default().initial_data(&stored);
        // SAFETY: the device has just been made and the family is the one of its queue; the structures live long enough.
        let (queue, pool, pipelines) = unsafe {
            let queue = raw.get_device_queue(info.queue_family, 0);
            let pool = raw.create_command_pool(&pool_info, None).map_err(call("vkCreateCommandPool"))?;
            let pipelines = raw.create_pipeline_cache(&cache_info, None).map_err(call("vkCreatePipelineCache"))?;
            (queue, pool, pipelines)
        };
        let device = Arc::new(Device {
            accel: traces.then(|| khr::acceleration_structure::Device::new(&instance.raw, &raw)),
            tracing: caps.pipeline.then(|| khr::ray_tracing_pipeline::Device::new(&instance.raw, &raw)),
            debug: instance.debug.then(|| ext::debug_utils::Device::new(&instance.raw, &raw)),
            queue,
            pool,
            pipelines,
            shelf: Shelf::default(),
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

    /// Whether the device did not finish a pass, so that objects must be leaked rather than destroyed.
    pub fn is_stuck(&self) -> bool {
        self.stuck.load(Ordering::Relaxed)
    }

    /// An error for a call that failed: a lost device where that is why.
    pub fn failed(&self, call: &'static str, result: vk::Result) -> VulkanError {
        let pass = self.pass.try_lock().map_or_else(|_| "unknown".to_owned(), |pass| pass.clone());
        self.failed_in(call, result, pass)
    }

    /// The same of a call that belongs to another pass than the last one.
    pub(super) fn failed_in(&self, call: &'static str, result: vk::Result, pass: String) -> VulkanError {
        match result {
            vk::Result::ERROR_DEVICE_LOST => VulkanError::Lost { device: self.info.line(), pass },
            result => VulkanError::Call { call, result, pass },
        }
    }

    /// The allocator of device memory.
    pub fn allocator(&self) -> MutexGuard<'_, Allocator> {
        self.allocator.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Gives an object the name that messages call it by.
    pub fn name(&self, object: impl vk::Handle, name: &str) {
        let Some(debug) = &self.debug else { return };
        let Ok(name) = std::ffi::CString::new(name) else { return };
        let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(object).object_name(&name);
        // SAFETY: the object was made by this device, and the name lives through the call. A name is only a convenience.
        let _ = unsafe { debug.set_debug_utils_object_name(&info) };
    }

    /// Writes the pipeline cache back: after every pipeline, since a process that ends, or a device that is lost, leaves no
    /// moment to do it later.
    pub fn keep_cache(&self) {
        // SAFETY: the cache lives as long as the device.
        if let Ok(data) = unsafe { self.raw.get_pipeline_cache_data(self.pipelines) } {
            cache::store(&self.info.cache_key, &data);
        }
    }

    /// Records that copies wait for what shaders have written so far.
    pub fn barrier_to_copy(&self, commands: vk::CommandBuffer) {
        let stages = vk::PipelineStageFlags::COMPUTE_SHADER | self.tracing_stage();
        self.barrier(
            commands,
            (stages, vk::AccessFlags::SHADER_WRITE),
            (vk::PipelineStageFlags::TRANSFER, vk::AccessFlags::TRANSFER_READ | vk::AccessFlags::TRANSFER_WRITE),
        );
    }

    /// Records that shaders wait for what copies, fills and shaders have written so far.
    pub fn barrier_to_shaders(&self, commands: vk::CommandBuffer) {
        let stages = vk::PipelineStageFlags::COMPUTE_SHADER | self.tracing_stage();
        self.barrier(
            commands,
            (
                vk::PipelineStageFlags::TRANSFER | stages,
                vk::AccessFlags::TRANSFER_WRITE | vk::AccessFlags::SHADER_WRITE,
            ),
            (stages, vk::AccessFlags::SHADER_READ | vk::AccessFlags::SHADER_WRITE),
        );
    }

    /// The stage of ray-tracing shaders, where the device has it.
    fn tracing_stage(&self) -> vk::PipelineStageFlags {
        match self.tracing {
            Some(_) => vk::PipelineStageFlags::RAY_TRACING_SHADER_KHR,
            None => vk::PipelineStageFlags::empty(),
        }
    }

    /// Records that what comes later in the stages `to` waits for what came earlier in the stages `from`.
    pub fn barrier(
        &self,
        commands: vk::CommandBuffer,
        from: (vk::PipelineStageFlags, vk::AccessFlags),
        to: (vk::PipelineStageFlags, vk::AccessFlags),
    ) {
        let memory = [vk::MemoryBarrier::default().src_access_mask(from.1).dst_access_mask(to.1)];
        // SAFETY: the commands are being recorded.
        unsafe {
            self.raw.cmd_pipeline_barrier(commands, from.0, to.0, vk::DependencyFlags::empty(), &memory, &[], &[]);
        }
    }

    /// Records commands, hands them to the queue under the name `pass`, and waits until they are done.
    ///
    /// # Errors
    /// When recording fails, the device is lost, or it does not finish.
    pub fn run(self: &Arc<Device>, pass: &str, record: impl FnOnce(vk::CommandBuffer)) -> Result<(), VulkanError> {
        self.submit(pass, record, |_| ())?.wait().map(drop)
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        if self.is_stuck() {
            return;
        }
        // SAFETY: everything made from the device holds it, so this is the last of all; the queue is idle, since every
        // submission was waited for, or lost.
        unsafe {
            let _ = self.raw.device_wait_idle();
            for pipeline in self.shelf.empty() {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn listed(index: usize, name: &str, driver: &str, uuid: u8) -> DeviceInfo {
        DeviceInfo {
            index,
            name: name.to_owned(),
            driver: driver.to_owned(),
            software: driver == "llvmpipe",
            caps: Caps::default(),
            limits: Limits::default(),
            cache_key: String::new(),
            uuid: [uuid; vk::UUID_SIZE],
            physical: vk::PhysicalDevice::null(),
            queue_family: 0,
        }
    }

    #[test]
    fn devices_of_one_model_are_counted_once_each() {
        let all = [
            listed(0, "H200", "NVIDIA 570", 1),
            listed(1, "llvmpipe", "llvmpipe", 9),
            listed(2, "H200", "NVIDIA 570", 2),
            listed(3, "H200", "NVIDIA 570", 1),
            listed(4, "A100", "NVIDIA 570", 3),
            listed(5, "H200", "NVK", 4),
            listed(6, "llvmpipe", "llvmpipe", 8),
        ];
        assert_eq!(all[0].alike(&all), [2], "not itself, under whatever number, nor another model or driver");
        assert_eq!(all[2].alike(&all), [0]);
        assert!(all[4].alike(&all).is_empty());
        assert!(all[1].alike(&all).is_empty(), "two programs share one processor");
        assert_eq!(find(&all, "a100").unwrap().index, 4);
        assert_eq!(find(&all, "2").unwrap().index, 2);
        let said = find(&all, "7").unwrap_err().to_string();
        assert!(said.contains("`7`") && said.contains("4 A100"), "{said}");
    }
}
