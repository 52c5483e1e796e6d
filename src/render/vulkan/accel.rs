//! Acceleration structures: one over the triangles that are no copies, one over the boxes of all spheres, and one over each mesh
//! that stands in many places, each made compact; and one above all, with an instance of the first two and one for every copy.
//!
//! Copies are placed in single precision here, which decides what a ray meets and no more: where on a triangle, and how far,
//! shaders compute from the triangle as it lies in the world. So a hit of a copy is always shown to a shader, which refuses
//! those that are not before the ray's origin.

use std::sync::Arc;
use std::time::Instant;

use ash::{khr, vk};
use glam::DAffine3;

use super::buffer::Buffer;
use super::device::Device;
use super::error::VulkanError;
use super::layout::{INSTANCE_COPIES, INSTANCE_SPHERES, INSTANCE_TRIANGLES, Triangle};
use super::upload::SceneBuffers;
use crate::scene::CompiledScene;
use crate::scene::compile::NONE;

/// What a buffer is for that a build reads.
const BUILD_INPUT: vk::BufferUsageFlags = vk::BufferUsageFlags::from_raw(
    vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS.as_raw()
        | vk::BufferUsageFlags::ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_KHR.as_raw(),
);

/// A structure and its memory.
struct Structure {
    device: Arc<Device>,
    raw: vk::AccelerationStructureKHR,
    memory: Buffer,
}

impl Drop for Structure {
    fn drop(&mut self) {
        if self.device.is_stuck() {
            return;
        }
        if let Some(accel) = &self.device.accel {
            // SAFETY: every submission that uses the structure was waited for.
            unsafe { accel.destroy_acceleration_structure(self.raw, None) };
        }
    }
}

/// A scene's acceleration structures.
pub struct Accel {
    top: Structure,
    _bottom: Vec<Structure>,
    _boxes: Option<Buffer>,
    /// Seconds spent building.
    pub build_s: f64,
    /// Bytes of all structures.
    pub bytes: u64,
}

/// Custom indices have 24 bits.
const MOST_COPIES: usize = (1 << 24) - INSTANCE_COPIES as usize;

impl Accel {
    /// Builds the structures of a scene whose buffers are on the device.
    ///
    /// # Errors
    /// When the device has no acceleration structures, or they do not fit.
    pub fn new(device: &Arc<Device>, scene: &CompiledScene, buffers: &SceneBuffers) -> Result<Accel, VulkanError> {
        let start = Instant::now();
        let lacks = || VulkanError::Lacks { device: device.info.line(), needed: "acceleration structures".to_owned() };
        let accel = device.accel.as_ref().ok_or_else(lacks)?;
        let most = device.info.limits.primitives;
        if scene.primitive_count() as u64 > most {
            let needed =
                format!("acceleration structures over {} primitives (it takes {most})", scene.primitive_count());
            return Err(VulkanError::Lacks { device: device.info.line(), needed });
        }
        let masked = scene.materials.iter().any(|m| m.mask_texture != NONE);
        // Where nothing has a mask, no hit needs a shader to count.
        let flags = if masked { vk::GeometryFlagsKHR::empty() } else { vk::GeometryFlagsKHR::OPAQUE };
        let (mut bottom, mut instances, mut boxes) = (Vec::new(), Vec::new(), None);
        if scene.instances.places.len() > MOST_COPIES {
            let needed = format!("{} copies of meshes (at most {MOST_COPIES})", scene.instances.places.len());
            return Err(VulkanError::Lacks { device: device.info.line(), needed });
        }
        let mut mesh = |name: &str, rows: std::ops::Range<u32>, flags: vk::GeometryFlagsKHR| {
            let count = rows.len() as u32;
            let first = buffers.triangles.address() + u64::from(rows.start) * size_of::<Triangle>() as u64;
            let triangles = vk::AccelerationStructureGeometryTrianglesDataKHR::default()
                .vertex_format(vk::Format::R32G32B32_SFLOAT)
                .vertex_data(vk::DeviceOrHostAddressConstKHR { device_address: first })
                .vertex_stride(size_of::<Triangle>() as u64 / 3)
                .max_vertex(3 * count - 1)
                .index_type(vk::IndexType::NONE_KHR);
            let geometry = vk::AccelerationStructureGeometryKHR::default()
                .geometry_type(vk::GeometryTypeKHR::TRIANGLES)
                .geometry(vk::AccelerationStructureGeometryDataKHR { triangles })
                .flags(flags);
            bottom.push(build(device, accel, name, geometry, count, true)?);
            Ok::<u64, VulkanError>(address(accel, &bottom))
        };
        let world = scene.world_triangles() as u32;
        if world > 0 {
            let made = mesh("triangles", 0..world, flags)?;
            instances.push(instance(made, INSTANCE_TRIANGLES, 0, DAffine3::IDENTITY));
        }
        let meshes = scene.instances.meshes.iter();
        let meshes = meshes.map(|m| mesh("mesh", m.triangles.clone(), vk::GeometryFlagsKHR::empty()));
        let meshes: Vec<u64> = meshes.collect::<Result<_, _>>()?;
        for (row, place) in (0..).zip(&scene.instances.places) {
            instances.push(instance(meshes[place.mesh as usize], INSTANCE_COPIES + row, 0, place.to_world));
        }
        if !scene.spheres.is_empty() {
            let rows: Vec<[f32; 6]> = scene
                .spheres
                .iter()
                .map(|s| {
                    let (low, high) = (s.center - s.radius, s.center + s.radius);
                    [low.x, low.y, low.z, high.x, high.y, high.z]
                })
                .collect();
            let buffer = boxes.insert(Buffer::with(device, "boxes of spheres", &rows, BUILD_INPUT)?);
            let aabbs = vk::AccelerationStructureGeometryAabbsDataKHR::default()
                .data(vk::DeviceOrHostAddressConstKHR { device_address: buffer.address() })
                .stride(24);
            let geometry = vk::AccelerationStructureGeometryKHR::default()
                .geometry_type(vk::GeometryTypeKHR::AABBS)
                .geometry(vk::AccelerationStructureGeometryDataKHR { aabbs })
                .flags(flags);
            bottom.push(build(device, accel, "spheres", geometry, rows.len() as u32, true)?);
            instances.push(instance(address(accel, &bottom), INSTANCE_SPHERES, 1, DAffine3::IDENTITY));
        }
        let words: Vec<u8> = instances.iter().flat_map(bytes_of_instance).collect();
        let rows = Buffer::with(device, "instances", &words, BUILD_INPUT)?;
        let data = vk::AccelerationStructureGeometryInstancesDataKHR::default()
            .data(vk::DeviceOrHostAddressConstKHR { device_address: rows.address() });
        let geometry = vk::AccelerationStructureGeometryKHR::default()
            .geometry_type(vk::GeometryTypeKHR::INSTANCES)
            .geometry(vk::AccelerationStructureGeometryDataKHR { instances: data });
        let top = build(device, accel, "scene", geometry, instances.len() as u32, false)?;
        let bytes = bottom.iter().chain([&top]).map(|s| s.memory.size).sum::<u64>() + rows.size;
        Ok(Accel { top, _bottom: bottom, _boxes: boxes, build_s: start.elapsed().as_secs_f64(), bytes })
    }

    /// The structure over everything.
    pub fn top(&self) -> vk::AccelerationStructureKHR {
        self.top.raw
    }
}

/// Where the last structure lies on the device.
fn address(accel: &khr::acceleration_structure::Device, bottom: &[Structure]) -> u64 {
    let raw = bottom.last().map_or(vk::AccelerationStructureKHR::null(), |s| s.raw);
    let info = vk::AccelerationStructureDeviceAddressInfoKHR::default().acceleration_structure(raw);
    // SAFETY: the structure was built.
    unsafe { accel.get_acceleration_structure_device_address(&info) }
}

/// An instance of a structure; `custom` is what shaders see of it, `group` its hit group.
fn instance(device_handle: u64, custom: u32, group: u32, to_world: DAffine3) -> vk::AccelerationStructureInstanceKHR {
    let no_culling = vk::GeometryInstanceFlagsKHR::TRIANGLE_FACING_CULL_DISABLE.as_raw() as u8;
    let [x, y, z, t] = [to_world.x_axis, to_world.y_axis, to_world.z_axis, to_world.translation].map(|v| v.as_vec3());
    // Row by row.
    let matrix = [x.x, y.x, z.x, t.x, x.y, y.y, z.y, t.y, x.z, y.z, z.z, t.z];
    vk::AccelerationStructureInstanceKHR {
        transform: vk::TransformMatrixKHR { matrix },
        instance_custom_index_and_mask: vk::Packed24_8::new(custom, 0xff),
        instance_shader_binding_table_record_offset_and_flags: vk::Packed24_8::new(group, no_culling),
        acceleration_structure_reference: vk::AccelerationStructureReferenceKHR { device_handle },
    }
}

fn bytes_of_instance(
    i: &vk::AccelerationStructureInstanceKHR,
) -> [u8; size_of::<vk::AccelerationStructureInstanceKHR>()] {
    // SAFETY: the structure is plain numbers without padding, 64 bytes as Vulkan defines it; of the union, `instance` has
    // set the field that fills it.
    unsafe { std::mem::transmute_copy(i) }
}

fn build(
    device: &Arc<Device>,
    accel: &khr::acceleration_structure::Device,
    name: &str,
    geometry: vk::AccelerationStructureGeometryKHR,
    count: u32,
    bottom: bool,
) -> Result<Structure, VulkanError> {
    let kind = if bottom {
        vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL
    } else {
        vk::AccelerationStructureTypeKHR::TOP_LEVEL
    };
    let mut flags = vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_TRACE;
    if bottom {
        flags |= vk::BuildAccelerationStructureFlagsKHR::ALLOW_COMPACTION;
    }
    let geometries = [geometry];
    let mut info = vk::AccelerationStructureBuildGeometryInfoKHR::default()
        .ty(kind)
        .flags(flags)
        .mode(vk::BuildAccelerationStructureModeKHR::BUILD)
        .geometries(&geometries);
    let mut sizes = vk::AccelerationStructureBuildSizesInfoKHR::default();
    // SAFETY: the device has acceleration structures; here and below everything lives until the commands are done.
    unsafe {
        accel.get_acceleration_structure_build_sizes(
            vk::AccelerationStructureBuildTypeKHR::DEVICE,
            &info,
            &[count],
            &mut sizes,
        );
    }
    let built = storage(device, accel, name, sizes.acceleration_structure_size, kind)?;
    let alignment = device.info.limits.scratch_alignment;
    let scratch = Buffer::by_address(
        device,
        "scratch of a build",
        sizes.build_scratch_size + alignment,
        vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS,
    )?;
    let address = scratch.address().next_multiple_of(alignment);
    info =
        info.dst_acceleration_structure(built.raw).scratch_data(vk::DeviceOrHostAddressKHR { device_address: address });
    let range = [vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(count)];
    let query_info = vk::QueryPoolCreateInfo::default()
        .query_type(vk::QueryType::ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR)
        .query_count(1);
    // SAFETY: as above.
    let queries = unsafe { device.raw.create_query_pool(&query_info, None) }
        .map_err(|r| device.failed("vkCreateQueryPool", r))?;
    device.name(queries, "compacted size");
    let stage = vk::PipelineStageFlags::ACCELERATION_STRUCTURE_BUILD_KHR;
    let done = device.run(&format!("build {name}"), |commands| {
        device.barrier(
            commands,
            (vk::PipelineStageFlags::TRANSFER, vk::AccessFlags::TRANSFER_WRITE),
            (stage, vk::AccessFlags::SHADER_READ | vk::AccessFlags::ACCELERATION_STRUCTURE_READ_KHR),
        );
        // SAFETY: as above.
        unsafe {
            device.raw.cmd_reset_query_pool(commands, queries, 0, 1);
            accel.cmd_build_acceleration_structures(commands, &[info], &[&range]);
            let write = vk::AccessFlags::ACCELERATION_STRUCTURE_WRITE_KHR;
            device.barrier(commands, (stage, write), (stage, vk::AccessFlags::ACCELERATION_STRUCTURE_READ_KHR));
            if bottom {
                accel.cmd_write_acceleration_structures_properties(
                    commands,
                    &[built.raw],
                    vk::QueryType::ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR,
                    queries,
                    0,
                );
            }
        }
    });
    let mut size = [0u64];
    let asked = done.and_then(|()| {
        if !bottom {
            return Ok(());
        }
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: as above; the commands that write the query are done.
        unsafe { device.raw.get_query_pool_results(queries, 0, &mut size, flags) }
            .map_err(|r| device.failed("vkGetQueryPoolResults", r))
    });
    // SAFETY: as above.
    unsafe { device.raw.destroy_query_pool(queries, None) };
    asked?;
    if !bottom || size[0] == 0 || size[0] >= sizes.acceleration_structure_size {
        return Ok(built);
    }
    let compact = storage(device, accel, name, size[0], kind)?;
    device.run(&format!("compact {name}"), |commands| {
        let copy = vk::CopyAccelerationStructureInfoKHR::default()
            .src(built.raw)
            .dst(compact.raw)
            .mode(vk::CopyAccelerationStructureModeKHR::COMPACT);
        // SAFETY: as above.
        unsafe { accel.cmd_copy_acceleration_structure(commands, &copy) };
        let write = vk::AccessFlags::ACCELERATION_STRUCTURE_WRITE_KHR;
        device.barrier(commands, (stage, write), (stage, vk::AccessFlags::ACCELERATION_STRUCTURE_READ_KHR));
    })?;
    Ok(compact)
}

fn storage(
    device: &Arc<Device>,
    accel: &khr::acceleration_structure::Device,
    name: &str,
    size: u64,
    kind: vk::AccelerationStructureTypeKHR,
) -> Result<Structure, VulkanError> {
    let usage = vk::BufferUsageFlags::ACCELERATION_STRUCTURE_STORAGE_KHR | vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS;
    let memory = Buffer::by_address(device, &format!("acceleration structure of {name}"), size.max(256), usage)?;
    let info = vk::AccelerationStructureCreateInfoKHR::default().buffer(memory.raw).size(size).ty(kind);
    // SAFETY: the buffer is as large as the structure.
    let raw = unsafe { accel.create_acceleration_structure(&info, None) }
        .map_err(|r| device.failed("vkCreateAccelerationStructureKHR", r))?;
    device.name(raw, name);
    Ok(Structure { device: Arc::clone(device), raw, memory })
}
