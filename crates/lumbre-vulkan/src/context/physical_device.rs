//! Physical devices: listing, capabilities, limits and selection.

use std::ffi::CStr;

use ash::{ext, khr, vk};

use super::instance;
use super::instance::Instance;
use crate::error::VulkanError;
use lumbre_render::backend_choice;

/// Environment variable that selects a device by its index or a part of its name, as listed by
/// `lumbre doctor`.
pub const DEVICE_VARIABLE: &str = "LUMBRE_DEVICE";

/// Capabilities of a device that the backends use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Caps {
    /// Scalar block layout of structs in buffers; required by all backends.
    pub scalar_layout: bool,
    /// Buffer device addresses, required by acceleration structures and by extended shaders.
    pub addresses: bool,
    /// Support of ray-tracing pipelines.
    pub pipeline: bool,
    /// Support of ray queries.
    pub query: bool,
    /// Atomic addition of floats in buffers, unless fixed-point splats were requested.
    pub float_atomics: bool,
    /// Double precision in shaders.
    pub doubles: bool,
}

impl Caps {
    /// Returns whether the device has any kind of hardware ray tracing.
    pub fn traces(&self) -> bool {
        self.pipeline || self.query
    }

    /// Returns whether the device supports extended shader modules.
    pub fn extended(&self) -> bool {
        self.doubles && self.addresses
    }
}

/// Limits of a device that the backends respect.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    /// Maximum size of a storage buffer that a shader can access, in bytes.
    pub storage_range: u64,
    /// Maximum size of a texel buffer in bytes: the same, unless a test forces smaller blocks.
    pub texels: u64,
    /// Size of the largest device-local heap in bytes.
    pub heap: u64,
    /// Period of the device's clock in nanoseconds; 0 if it has none.
    pub timestamp_ns: f64,
    /// Mask of the valid bits of a timestamp, which wraps around beyond them.
    pub timestamp_mask: u64,
    /// Size of a shader group's handle in bytes.
    pub handle: u64,
    /// Alignment of handles inside a shader binding table in bytes.
    pub handle_alignment: u64,
    /// Alignment of a shader binding table in bytes.
    pub base_alignment: u64,
    /// Alignment of scratch memory of acceleration structures in bytes.
    pub scratch_alignment: u64,
    /// Maximum number of primitives of an acceleration structure.
    pub primitives: u64,
}

/// Physical device of this machine.
#[derive(Clone, Debug)]
pub struct DeviceInfo {
    /// Index in the list of devices.
    pub index: usize,
    /// Name reported by its driver.
    pub name: String,
    /// Name and version of the driver.
    pub driver: String,
    /// Whether it is a software implementation.
    pub software: bool,
    /// Capabilities of the device.
    pub caps: Caps,
    /// Limits of the device.
    pub limits: Limits,
    /// Key of its pipeline cache; changes with device and driver.
    pub cache_key: String,
    /// Identifies the hardware among all devices of this machine, for any driver.
    uuid: [u8; vk::UUID_SIZE],
    pub(super) physical: vk::PhysicalDevice,
    pub(super) queue_family: u32,
}

impl DeviceInfo {
    /// Returns a line for users: name and driver.
    pub fn line(&self) -> String {
        format!("{} ({})", self.name, self.driver)
    }

    /// Returns the indices of the listed devices that are of the same model but other hardware. A
    /// device that is listed twice, by two drivers or by two entries of one driver, counts once.
    /// Software devices have no others, since they share the CPU.
    pub fn others_of_model(&self, listed: &[DeviceInfo]) -> Vec<usize> {
        let mut known = vec![self.uuid];
        let mut is_other = |other: &&DeviceInfo| {
            let is_other =
                !self.software && other.line() == self.line() && !known.contains(&other.uuid);
            known.push(other.uuid);
            is_other
        };
        listed
            .iter()
            .filter(|other| is_other(other))
            .map(|other| other.index)
            .collect()
    }
}

/// Lists all devices with Vulkan 1.2 and a compute queue, in the loader's order.
///
/// # Errors
/// Returns an error if there is no loader.
pub fn list() -> Result<Vec<DeviceInfo>, VulkanError> {
    let instance = instance::shared()?;
    // SAFETY: the instance lives as long as the process.
    let physical = unsafe { instance.raw.enumerate_physical_devices() }.map_err(|result| {
        VulkanError::Call {
            call: "vkEnumeratePhysicalDevices",
            result,
            pass: "start".to_owned(),
        }
    })?;
    Ok(physical
        .into_iter()
        .enumerate()
        .filter_map(|(index, p)| describe(instance, index, p))
        .collect())
}

/// Device extensions that the backends use, if available.
struct Extensions {
    accel: bool,
    pipeline: bool,
    query: bool,
    atomics: bool,
}

impl Extensions {
    fn query(raw: &ash::Instance, physical: vk::PhysicalDevice) -> Extensions {
        // SAFETY: the physical device comes from this instance.
        let extensions =
            unsafe { raw.enumerate_device_extension_properties(physical) }.unwrap_or_default();
        let has = |name: &CStr| {
            extensions
                .iter()
                .any(|e| e.extension_name_as_c_str() == Ok(name))
        };
        Extensions {
            accel: has(khr::acceleration_structure::NAME),
            pipeline: has(khr::ray_tracing_pipeline::NAME),
            query: has(khr::ray_query::NAME),
            atomics: has(ext::shader_atomic_float::NAME),
        }
    }
}

/// Describes a physical device, or returns `None` if it lacks Vulkan 1.2 or a compute queue.
fn describe(instance: &Instance, index: usize, physical: vk::PhysicalDevice) -> Option<DeviceInfo> {
    let raw = &instance.raw;
    // SAFETY: the physical device comes from this instance; here and below every structure lives
    // through its call.
    let families = unsafe { raw.get_physical_device_queue_family_properties(physical) };
    let queue_family = families
        .iter()
        .position(|f| f.queue_flags.contains(vk::QueueFlags::COMPUTE))?;
    let extensions = Extensions::query(raw, physical);
    let mut driver = vk::PhysicalDeviceDriverProperties::default();
    let mut identity = vk::PhysicalDeviceIDProperties::default();
    let mut pipeline_limits = vk::PhysicalDeviceRayTracingPipelinePropertiesKHR::default();
    let mut accel_limits = vk::PhysicalDeviceAccelerationStructurePropertiesKHR::default();
    let mut properties = vk::PhysicalDeviceProperties2::default()
        .push_next(&mut driver)
        .push_next(&mut identity);
    if extensions.pipeline {
        properties = properties.push_next(&mut pipeline_limits);
    }
    if extensions.accel {
        properties = properties.push_next(&mut accel_limits);
    }
    // SAFETY: as above.
    unsafe { raw.get_physical_device_properties2(physical, &mut properties) };
    let core = properties.properties;
    if core.api_version < vk::API_VERSION_1_2 {
        return None;
    }
    let caps = capabilities(raw, physical, &extensions);
    let limits = Limits {
        heap: largest_local_heap(raw, physical),
        ..device_limits(
            &core.limits,
            families[queue_family].timestamp_valid_bits,
            &pipeline_limits,
            &accel_limits,
        )
    };
    let uuid = core
        .pipeline_cache_uuid
        .map(|b| format!("{b:02x}"))
        .concat();
    Some(DeviceInfo {
        index,
        name: text(core.device_name_as_c_str()),
        driver: format!(
            "{} {}",
            text(driver.driver_name_as_c_str()),
            text(driver.driver_info_as_c_str())
        ),
        software: core.device_type == vk::PhysicalDeviceType::CPU,
        caps,
        limits,
        cache_key: format!("{:04x}-{:04x}-{uuid}", core.vendor_id, core.device_id),
        uuid: identity.device_uuid,
        physical,
        queue_family: queue_family as u32,
    })
}

/// Converts a name reported by a driver; empty if it is invalid.
fn text<E>(name: Result<&CStr, E>) -> String {
    name.map(|name| name.to_string_lossy().into_owned())
        .unwrap_or_default()
}

/// Returns the capabilities of a device.
fn capabilities(
    raw: &ash::Instance,
    physical: vk::PhysicalDevice,
    extensions: &Extensions,
) -> Caps {
    let mut vulkan12 = vk::PhysicalDeviceVulkan12Features::default();
    let mut accel = vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default();
    let mut pipeline = vk::PhysicalDeviceRayTracingPipelineFeaturesKHR::default();
    let mut query = vk::PhysicalDeviceRayQueryFeaturesKHR::default();
    let mut atomics = vk::PhysicalDeviceShaderAtomicFloatFeaturesEXT::default();
    let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut vulkan12);
    if extensions.accel {
        features = features.push_next(&mut accel);
    }
    if extensions.pipeline {
        features = features.push_next(&mut pipeline);
    }
    if extensions.query {
        features = features.push_next(&mut query);
    }
    if extensions.atomics {
        features = features.push_next(&mut atomics);
    }
    // SAFETY: the physical device comes from this instance; the structures live through the call.
    unsafe { raw.get_physical_device_features2(physical, &mut features) };
    let doubles = features.features.shader_float64 == vk::TRUE;
    let traces =
        accel.acceleration_structure == vk::TRUE && vulkan12.buffer_device_address == vk::TRUE;
    Caps {
        scalar_layout: vulkan12.scalar_block_layout == vk::TRUE,
        addresses: vulkan12.buffer_device_address == vk::TRUE,
        pipeline: traces && pipeline.ray_tracing_pipeline == vk::TRUE,
        query: traces && query.ray_query == vk::TRUE,
        float_atomics: atomics.shader_buffer_float32_atomic_add == vk::TRUE
            && !backend_choice::fixed_point_splats(),
        doubles,
    }
}

/// Returns the limits of a device except the size of its memory; `bits` is the number of valid
/// timestamp bits.
fn device_limits(
    core: &vk::PhysicalDeviceLimits,
    bits: u32,
    pipeline_limits: &vk::PhysicalDeviceRayTracingPipelinePropertiesKHR,
    accel_limits: &vk::PhysicalDeviceAccelerationStructurePropertiesKHR,
) -> Limits {
    Limits {
        storage_range: u64::from(core.max_storage_buffer_range),
        texels: u64::from(core.max_storage_buffer_range),
        heap: 0,
        timestamp_ns: if bits > 0 {
            f64::from(core.timestamp_period)
        } else {
            0.0
        },
        timestamp_mask: u64::MAX.checked_shr(64 - bits.min(64)).unwrap_or(0),
        handle: u64::from(pipeline_limits.shader_group_handle_size),
        handle_alignment: u64::from(pipeline_limits.shader_group_handle_alignment),
        base_alignment: u64::from(pipeline_limits.shader_group_base_alignment),
        scratch_alignment: u64::from(
            accel_limits.min_acceleration_structure_scratch_offset_alignment,
        )
        .max(1),
        primitives: accel_limits.max_primitive_count,
    }
}

/// Returns the size of the largest device-local memory heap in bytes.
fn largest_local_heap(raw: &ash::Instance, physical: vk::PhysicalDevice) -> u64 {
    // SAFETY: the physical device comes from this instance.
    let memory = unsafe { raw.get_physical_device_memory_properties(physical) };
    let local = |h: &&vk::MemoryHeap| h.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL);
    memory
        .memory_heaps_as_slice()
        .iter()
        .filter(local)
        .map(|h| h.size)
        .max()
        .unwrap_or(0)
}

/// Returns the device to use: the one that [`DEVICE_VARIABLE`] selects, otherwise the first
/// hardware device, otherwise the first device.
///
/// # Errors
/// Returns an error if there is no loader, no device, or none that matches the selection.
pub fn choose() -> Result<DeviceInfo, VulkanError> {
    let devices = list()?;
    if let Some(wanted) = backend_choice::device(DEVICE_VARIABLE) {
        return find(&devices, &wanted).cloned();
    }
    let first = devices
        .iter()
        .find(|d| !d.software)
        .or(devices.first())
        .cloned();
    first.ok_or_else(|| {
        VulkanError::NoDevice("the Vulkan loader lists none with Vulkan 1.2 and compute".to_owned())
    })
}

/// Finds a listed device by its index, or the first whose name contains `wanted`, ignoring case.
///
/// # Errors
/// Returns an error that lists all devices if none matches.
pub fn find<'a>(devices: &'a [DeviceInfo], wanted: &str) -> Result<&'a DeviceInfo, VulkanError> {
    let lower = wanted.to_lowercase();
    let is_other = |d: &&DeviceInfo| {
        wanted.parse() == Ok(d.index)
            || (wanted.parse::<usize>().is_err() && d.name.to_lowercase().contains(&lower))
    };
    devices.iter().find(is_other).ok_or_else(|| {
        let names: Vec<String> = devices
            .iter()
            .map(|d| format!("{} {}", d.index, d.name))
            .collect();
        VulkanError::NoDevice(format!(
            "`{wanted}` (from --device, --devices or {DEVICE_VARIABLE}) matches none of: {}",
            names.join(", ")
        ))
    })
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
    fn devices_of_the_same_model_are_counted_once() {
        let all = [
            listed(0, "H200", "NVIDIA 570", 1),
            listed(1, "llvmpipe", "llvmpipe", 9),
            listed(2, "H200", "NVIDIA 570", 2),
            listed(3, "H200", "NVIDIA 570", 1),
            listed(4, "A100", "NVIDIA 570", 3),
            listed(5, "H200", "NVK", 4),
            listed(6, "llvmpipe", "llvmpipe", 8),
        ];
        assert_eq!(
            all[0].others_of_model(&all),
            [2],
            "neither itself under another index, nor another model or driver"
        );
        assert_eq!(all[2].others_of_model(&all), [0]);
        assert!(all[4].others_of_model(&all).is_empty());
        assert!(
            all[1].others_of_model(&all).is_empty(),
            "software devices share one CPU"
        );
        assert_eq!(find(&all, "a100").unwrap().index, 4);
        assert_eq!(find(&all, "2").unwrap().index, 2);
        let error = find(&all, "7").unwrap_err().to_string();
        assert!(error.contains("`7`") && error.contains("4 A100"), "{error}");
    }
}
