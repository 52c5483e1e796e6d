//! Physical devices: listing, capabilities, limits and selection.

use std::ffi::CStr;

use ash::{ext, khr, vk};

use super::instance;
use super::instance::Instance;
use super::limits::{self, Limits};
use crate::error::VulkanError;
use lumbre_render::DeviceKind;
use lumbre_render::backend_choice::{self, DEVICE_VARIABLE};
use lumbre_render::device::VENDOR_NVIDIA;

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
    /// Report of the memory that is left (VK_EXT_memory_budget).
    pub memory_budget: bool,
    /// Report of the reason of a lost device (VK_EXT_device_fault).
    pub fault_report: bool,
    /// Statistics of compiled pipelines (VK_KHR_pipeline_executable_properties).
    pub pipeline_statistics: bool,
}

impl Caps {
    /// Returns whether the device has any kind of hardware ray tracing.
    pub fn traces(&self) -> bool {
        self.pipeline || self.query
    }

    /// Returns the stages of shaders that trace rays through acceleration structures.
    pub fn tracing_stages(&self) -> vk::PipelineStageFlags {
        let mut stages = vk::PipelineStageFlags::empty();
        if self.pipeline {
            stages |= vk::PipelineStageFlags::RAY_TRACING_SHADER_KHR;
        }
        if self.query {
            stages |= vk::PipelineStageFlags::COMPUTE_SHADER;
        }
        stages
    }

    /// Returns whether the device supports extended shader modules.
    pub fn extended(&self) -> bool {
        self.doubles && self.addresses
    }
}

/// Environment variable that permits emulated ray-tracing pipelines if it is `1`.
const EMULATION_VARIABLE: &str = "LUMBRE_EMULATED_TRACING";

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
    /// Number of its vendor, as assigned by the PCI-SIG.
    pub vendor: u32,
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
    /// Returns the description of a device that does not exist, for tests.
    #[cfg(test)]
    pub(crate) fn made_up(name: &str, vendor: u32, caps: Caps, limits: Limits) -> DeviceInfo {
        DeviceInfo {
            index: 0,
            name: name.to_owned(),
            driver: "driver".to_owned(),
            software: false,
            vendor,
            caps,
            limits,
            cache_key: String::new(),
            uuid: [1; vk::UUID_SIZE],
            physical: vk::PhysicalDevice::null(),
            queue_family: 0,
        }
    }

    /// Returns the device as it is recorded, without the features that a run uses.
    pub fn recorded(&self) -> lumbre_render::Device {
        lumbre_render::Device {
            name: self.name.clone(),
            kind: match self.software {
                true => DeviceKind::EmulatedGraphics,
                false => DeviceKind::Graphics,
            },
            vendor: Some(self.vendor),
            driver: Some(self.driver.clone()),
            ..lumbre_render::Device::default()
        }
    }

    /// Returns a line for users: name and driver.
    pub fn line(&self) -> String {
        self.recorded().to_string()
    }

    /// Returns whether its driver most likely emulates ray-tracing pipelines by shaders: NVIDIA's
    /// offers them on cards without ray-tracing units (GTX 10 and 16, A100, H100), but ray queries
    /// only on cards with them [an engineer of NVIDIA in KhronosGroup/Vulkan-Docs issue 1241].
    pub fn emulates_tracing(&self) -> bool {
        self.vendor == VENDOR_NVIDIA && self.caps.pipeline && !self.caps.query
    }

    /// Returns whether ray-tracing pipelines may be used: those of units in hardware or of a software
    /// driver, and emulated ones only on request, since they computed wrong light.
    pub(crate) fn may_use_pipelines(&self) -> bool {
        let requested = || std::env::var_os(EMULATION_VARIABLE).is_some_and(|value| value == "1");
        !self.emulates_tracing() || requested()
    }

    /// Returns the bytes that this process can still allocate in the largest memory of the device,
    /// as its driver estimates; the size of that memory if the driver does not report it.
    pub fn memory_left(&self) -> u64 {
        if !self.caps.memory_budget {
            return self.limits.heap;
        }
        let left = match instance::shared() {
            Ok(instance) => limits::memory_left(&instance.raw, self.physical),
            Err(_) => u64::MAX,
        };
        left.min(self.limits.heap)
    }

    /// Returns the indices of the listed devices that are of the same model but other hardware. A
    /// device that is listed twice, by two drivers or by two entries of one driver, counts once.
    /// Software devices have no others, since they share the CPU.
    pub fn others_of_model(&self, listed: &[DeviceInfo]) -> Vec<usize> {
        let mut known = vec![self.uuid];
        let mut is_other = |other: &&DeviceInfo| {
            let is_same_model = (&other.name, &other.driver) == (&self.name, &self.driver);
            let is_other = !self.software && is_same_model && !known.contains(&other.uuid);
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
    budget: bool,
    fault: bool,
    statistics: bool,
    maintenance4: bool,
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
            budget: has(ext::memory_budget::NAME),
            fault: has(ext::device_fault::NAME),
            statistics: has(khr::pipeline_executable_properties::NAME),
            maintenance4: has(khr::maintenance4::NAME),
        }
    }
}

/// Returns the index of the queue family to use: one for computation only if there is one with a
/// clock, because graphics queues also serve the desktop, which would wait for long dispatches;
/// otherwise the first one that can compute.
fn choose_queue_family(families: &[vk::QueueFamilyProperties]) -> Option<usize> {
    let computes = |f: &vk::QueueFamilyProperties| f.queue_flags.contains(vk::QueueFlags::COMPUTE);
    let apart = |f: &vk::QueueFamilyProperties| {
        let graphics = f.queue_flags.contains(vk::QueueFlags::GRAPHICS);
        computes(f) && !graphics && f.timestamp_valid_bits > 0
    };
    let found = families.iter().position(apart);
    found.or_else(|| families.iter().position(computes))
}

/// Describes a physical device, or returns `None` if it lacks Vulkan 1.2 or a compute queue.
fn describe(instance: &Instance, index: usize, physical: vk::PhysicalDevice) -> Option<DeviceInfo> {
    let raw = &instance.raw;
    // SAFETY: the physical device comes from this instance; here and below every structure lives
    // through its call.
    let families = unsafe { raw.get_physical_device_queue_family_properties(physical) };
    let queue_family = choose_queue_family(&families)?;
    let extensions = Extensions::query(raw, physical);
    let mut driver = vk::PhysicalDeviceDriverProperties::default();
    let mut identity = vk::PhysicalDeviceIDProperties::default();
    let mut pipeline = vk::PhysicalDeviceRayTracingPipelinePropertiesKHR::default();
    let mut accel = vk::PhysicalDeviceAccelerationStructurePropertiesKHR::default();
    let mut maintenance3 = vk::PhysicalDeviceMaintenance3Properties::default();
    let mut maintenance4 = vk::PhysicalDeviceMaintenance4Properties::default();
    let mut properties = vk::PhysicalDeviceProperties2::default()
        .push_next(&mut driver)
        .push_next(&mut identity)
        .push_next(&mut maintenance3);
    if extensions.pipeline {
        properties = properties.push_next(&mut pipeline);
    }
    if extensions.accel {
        properties = properties.push_next(&mut accel);
    }
    if extensions.maintenance4 {
        properties = properties.push_next(&mut maintenance4);
    }
    // SAFETY: as above.
    unsafe { raw.get_physical_device_properties2(physical, &mut properties) };
    let core = properties.properties;
    if core.api_version < vk::API_VERSION_1_2 {
        return None;
    }
    let limits = Limits {
        heap: limits::largest_local_heap(raw, physical),
        // A device without the extension does not state its limit of a buffer.
        allocation: match maintenance4.max_buffer_size {
            0 => maintenance3.max_memory_allocation_size,
            buffer => maintenance3.max_memory_allocation_size.min(buffer),
        },
        ..Limits::from_properties(
            &core.limits,
            families[queue_family].timestamp_valid_bits,
            &pipeline,
            &accel,
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
        vendor: core.vendor_id,
        caps: capabilities(raw, physical, &extensions),
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
    let mut fault = vk::PhysicalDeviceFaultFeaturesEXT::default();
    let mut statistics = vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default();
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
    if extensions.fault {
        features = features.push_next(&mut fault);
    }
    if extensions.statistics {
        features = features.push_next(&mut statistics);
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
        memory_budget: extensions.budget,
        fault_report: fault.device_fault == vk::TRUE,
        pipeline_statistics: statistics.pipeline_executable_info == vk::TRUE,
    }
}

/// Returns the device to use: the one that [`DEVICE_VARIABLE`] selects, otherwise the first
/// hardware device, otherwise the first device.
///
/// # Errors
/// Returns an error if there is no loader, no device, or none that matches the selection.
pub fn choose() -> Result<DeviceInfo, VulkanError> {
    let devices = list()?;
    if let Some(wanted) = backend_choice::device() {
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
            driver: driver.to_owned(),
            software: driver == "llvmpipe",
            uuid: [uuid; vk::UUID_SIZE],
            ..DeviceInfo::made_up(name, 0, Caps::default(), Limits::default())
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

    #[test]
    fn only_nvidias_pipelines_without_queries_are_emulated() {
        let device = |vendor: u32, pipeline: bool, query: bool| DeviceInfo {
            vendor,
            caps: Caps {
                pipeline,
                query,
                ..Caps::default()
            },
            ..listed(0, "card", "driver", 1)
        };
        assert!(device(VENDOR_NVIDIA, true, false).emulates_tracing());
        assert!(!device(VENDOR_NVIDIA, true, true).emulates_tracing());
        assert!(!device(VENDOR_NVIDIA, false, false).emulates_tracing());
        assert!(!device(0x1002, true, false).emulates_tracing());
    }

    #[test]
    fn queues_apart_from_graphics_are_preferred_if_they_have_a_clock() {
        let (graphics, compute, copy) = (
            vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE,
            vk::QueueFlags::COMPUTE | vk::QueueFlags::TRANSFER,
            vk::QueueFlags::TRANSFER,
        );
        let chosen = |families: &[(vk::QueueFlags, u32)]| {
            let family = |(flags, bits): &(vk::QueueFlags, u32)| {
                vk::QueueFamilyProperties::default()
                    .queue_flags(*flags)
                    .timestamp_valid_bits(*bits)
            };
            choose_queue_family(&families.iter().map(family).collect::<Vec<_>>())
        };
        assert_eq!(
            chosen(&[(graphics, 64), (copy, 64), (compute, 64)]),
            Some(2)
        );
        assert_eq!(chosen(&[(copy, 64), (graphics, 64), (compute, 0)]), Some(1));
        assert_eq!(chosen(&[(copy, 64), (compute, 0)]), Some(1));
        assert_eq!(chosen(&[(copy, 64)]), None);
    }

    #[test]
    fn rays_of_every_kind_of_shader_wait_for_builds() {
        let stages = |pipeline: bool, query: bool| {
            let caps = Caps {
                pipeline,
                query,
                ..Caps::default()
            };
            caps.tracing_stages()
        };
        let (tracing, compute) = (
            vk::PipelineStageFlags::RAY_TRACING_SHADER_KHR,
            vk::PipelineStageFlags::COMPUTE_SHADER,
        );
        assert_eq!(stages(true, true), tracing | compute);
        assert_eq!(stages(true, false), tracing);
        assert_eq!(stages(false, true), compute);
    }
}
