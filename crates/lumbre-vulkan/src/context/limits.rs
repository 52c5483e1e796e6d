//! Limits of a physical device, and the memory that is left on it.

use ash::vk;

/// Limits of a device that the backends respect.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    /// Maximum size of a storage buffer that a shader can access, in bytes.
    pub storage_range: u64,
    /// Maximum size of a texel buffer in bytes: the same, unless a test forces smaller blocks.
    pub texels: u64,
    /// Size of the largest device-local heap in bytes.
    pub heap: u64,
    /// Maximum size of one buffer and its memory in bytes.
    pub allocation: u64,
    /// Maximum number of storage buffers that one shader accesses.
    pub storage_buffers: u32,
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
    /// Maximum number of geometries of an acceleration structure.
    pub geometries: u64,
}

impl Limits {
    /// Returns the limits of a device except those of its memory; `bits` is the number of valid
    /// timestamp bits.
    pub(super) fn from_properties(
        core: &vk::PhysicalDeviceLimits,
        bits: u32,
        pipeline_limits: &vk::PhysicalDeviceRayTracingPipelinePropertiesKHR,
        accel_limits: &vk::PhysicalDeviceAccelerationStructurePropertiesKHR,
    ) -> Limits {
        Limits {
            storage_range: u64::from(core.max_storage_buffer_range),
            texels: u64::from(core.max_storage_buffer_range),
            heap: 0,
            allocation: 0,
            storage_buffers: core.max_per_stage_descriptor_storage_buffers,
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
            geometries: accel_limits.max_geometry_count,
        }
    }
}

/// Returns the size of the largest device-local memory heap in bytes.
pub(super) fn largest_local_heap(raw: &ash::Instance, physical: vk::PhysicalDevice) -> u64 {
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

/// Returns the bytes that this process can still allocate in the largest device-local heap, as the
/// driver estimates. The device must support `VK_EXT_memory_budget`.
pub(super) fn memory_left(raw: &ash::Instance, physical: vk::PhysicalDevice) -> u64 {
    let mut budget = vk::PhysicalDeviceMemoryBudgetPropertiesEXT::default();
    let mut properties = vk::PhysicalDeviceMemoryProperties2::default().push_next(&mut budget);
    // SAFETY: the physical device comes from this instance; the structures live through the call.
    unsafe { raw.get_physical_device_memory_properties2(physical, &mut properties) };
    let memory = properties.memory_properties;
    let heaps = memory.memory_heaps_as_slice().iter().zip(0..);
    let local = heaps.filter(|(heap, _)| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL));
    let largest = local.max_by_key(|(heap, _)| heap.size);
    largest.map_or(0, |(_, i): (_, usize)| {
        budget.heap_budget[i].saturating_sub(budget.heap_usage[i])
    })
}
