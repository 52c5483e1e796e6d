//! Acceleration structures of the driver: one over the triangles outside instances, one over the
//! boxes of all spheres, and one over each shared mesh, all compacted; and a top-level structure
//! with an instance of the first two and one for every instance of a mesh.
//!
//! The triangles outside instances are divided into geometries that are opaque and geometries that
//! have masks: a ray-tracing device then calls an any-hit shader only where masks are. Spheres apply
//! their masks in their intersection shader and are opaque.
//!
//! Instances are placed in single precision here, which decides only which triangle a ray hits;
//! where on the triangle, and at what distance, shaders compute from the triangle in world space.
//! Hits on instances therefore always invoke an any-hit shader, which rejects those behind the
//! ray's origin.

use std::ops::Range;
use std::sync::Arc;
use std::time::Instant;

use ash::{khr, vk};
use glam::DAffine3;

use super::geometries::{MAX_GEOMETRIES, TriangleRun, triangle_runs};
use crate::context::device::Device;
use crate::error::VulkanError;
use crate::layout::{INSTANCE_MESHES, INSTANCE_SPHERES, INSTANCE_TRIANGLES, Triangle};
use crate::memory::buffer::Buffer;
use crate::memory::upload::SceneBuffers;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::NONE;

/// Usage of buffers that a build reads.
const BUILD_INPUT: vk::BufferUsageFlags = vk::BufferUsageFlags::from_raw(
    vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS.as_raw()
        | vk::BufferUsageFlags::ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_KHR.as_raw(),
);

/// Acceleration structure with its memory.
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

/// Acceleration structures of a scene.
pub struct AccelerationStructures {
    top: Structure,
    _bottom: Vec<Structure>,
    _boxes: Option<Buffer>,
    /// First triangle of every geometry of the structure over the triangles outside instances.
    pub geometry_starts: Buffer,
    /// Build time in seconds.
    pub build_s: f64,
    /// Size of all structures in bytes.
    pub bytes: u64,
}

/// Maximum number of instances, since custom indices have 24 bits.
const MAX_INSTANCES: usize = (1 << 24) - INSTANCE_MESHES as usize;

/// Alignment of the addresses of instances in bytes, as Vulkan requires it.
const INSTANCE_ALIGNMENT: u64 = 16;

impl AccelerationStructures {
    /// Builds the structures of a scene whose buffers are on the device.
    ///
    /// # Errors
    /// Returns an error if the device has no acceleration structures, or they do not fit.
    pub fn new(
        device: &Arc<Device>,
        scene: &CompiledScene,
        buffers: &SceneBuffers,
    ) -> Result<AccelerationStructures, VulkanError> {
        let start = Instant::now();
        let accel = check_limits(device, scene)?;
        let placements = &scene.instances.placements;
        let mut bottom = BottomLevel {
            device,
            accel,
            structures: Vec::new(),
        };
        let mut instances = Vec::new();
        let max_geometries = (device.info.limits.geometries as usize).min(MAX_GEOMETRIES);
        let has_mask = |row: usize| {
            let material = scene.attributes[row].material as usize;
            scene.materials[material].mask_texture != NONE
        };
        let masked: Vec<bool> = (0..scene.world_triangles()).map(has_mask).collect();
        let runs = triangle_runs(&masked, max_geometries);
        if !runs.is_empty() {
            let made = bottom.add_triangles("triangles", buffers, &runs)?;
            instances.push(instance(made, INSTANCE_TRIANGLES, 0, DAffine3::IDENTITY));
        }
        let starts: Vec<u32> = runs.iter().map(|run| run.rows.start).collect();
        let none = vk::BufferUsageFlags::empty();
        let geometry_starts = Buffer::with(device, "geometry starts", &starts, none)?;
        // Every hit on an instance calls the any-hit shader, with masks or without.
        let mesh = |rows: &Range<u32>| TriangleRun {
            rows: rows.clone(),
            opaque: false,
        };
        let meshes: Vec<u64> = (scene.instances.meshes.iter())
            .map(|m| bottom.add_triangles("mesh", buffers, &[mesh(&m.triangles)]))
            .collect::<Result<_, _>>()?;
        for (row, placement) in (0..).zip(placements) {
            instances.push(instance(
                meshes[placement.mesh as usize],
                INSTANCE_MESHES + row,
                0,
                placement.to_world,
            ));
        }
        let boxes = sphere_boxes(device, scene)?;
        if let Some(boxes) = &boxes {
            let made = bottom.add_boxes("spheres", boxes, scene.spheres.len() as u32)?;
            instances.push(instance(made, INSTANCE_SPHERES, 1, DAffine3::IDENTITY));
        }
        let bottom = bottom.structures;
        let (top, rows) = build_top(device, accel, &instances)?;
        let structures = bottom.iter().chain([&top]);
        let bytes = structures.map(|s| s.memory.size).sum::<u64>() + rows.size;
        Ok(AccelerationStructures {
            top,
            _bottom: bottom,
            _boxes: boxes,
            geometry_starts,
            build_s: start.elapsed().as_secs_f64(),
            bytes,
        })
    }

    /// Returns the top-level structure.
    pub fn top(&self) -> vk::AccelerationStructureKHR {
        self.top.raw
    }
}

/// Returns the functions of acceleration structures, or an error if the device lacks them or the
/// scene exceeds their limits.
fn check_limits<'a>(
    device: &'a Device,
    scene: &CompiledScene,
) -> Result<&'a khr::acceleration_structure::Device, VulkanError> {
    let lacks = |needed: String| VulkanError::Lacks {
        device: device.info.line(),
        needed,
    };
    let Some(accel) = device.accel.as_ref() else {
        return Err(lacks("acceleration structures".to_owned()));
    };
    let max = device.info.limits.primitives;
    let primitives = scene.primitive_count();
    if primitives as u64 > max {
        return Err(lacks(format!(
            "acceleration structures over {primitives} primitives (at most {max})"
        )));
    }
    let instances = scene.instances.placements.len();
    if instances > MAX_INSTANCES {
        return Err(lacks(format!(
            "{instances} instances of meshes (at most {MAX_INSTANCES})"
        )));
    }
    Ok(accel)
}

/// Builds the top-level structure over instances. Returns it and the buffer of the instances.
fn build_top(
    device: &Arc<Device>,
    accel: &khr::acceleration_structure::Device,
    instances: &[vk::AccelerationStructureInstanceKHR],
) -> Result<(Structure, Buffer), VulkanError> {
    let words: Vec<u8> = instances.iter().flat_map(bytes_of_instance).collect();
    let size = words.len() as u64 + INSTANCE_ALIGNMENT;
    let rows = Buffer::new(device, "instances", size, BUILD_INPUT)?;
    let start = rows.address().next_multiple_of(INSTANCE_ALIGNMENT);
    let padding = vec![0; (start - rows.address()) as usize];
    rows.write(&[padding, words].concat())?;
    let data = vk::AccelerationStructureGeometryInstancesDataKHR::default().data(
        vk::DeviceOrHostAddressConstKHR {
            device_address: start,
        },
    );
    let geometry = vk::AccelerationStructureGeometryKHR::default()
        .geometry_type(vk::GeometryTypeKHR::INSTANCES)
        .geometry(vk::AccelerationStructureGeometryDataKHR { instances: data });
    let count = instances.len() as u32;
    let top = build(device, accel, "scene", &[(geometry, count)], false)?;
    Ok((top, rows))
}

/// Geometry with its number of primitives or instances.
type CountedGeometry<'a> = (vk::AccelerationStructureGeometryKHR<'a>, u32);

/// Builds bottom-level structures one by one.
struct BottomLevel<'a> {
    device: &'a Arc<Device>,
    accel: &'a khr::acceleration_structure::Device,
    structures: Vec<Structure>,
}

impl BottomLevel<'_> {
    /// Builds a structure over runs of the scene's triangles, with a geometry for each, and returns
    /// its device address.
    fn add_triangles(
        &mut self,
        name: &str,
        buffers: &SceneBuffers,
        runs: &[TriangleRun],
    ) -> Result<u64, VulkanError> {
        let address = buffers.triangles.address();
        let geometry = |run: &TriangleRun| {
            let count = run.rows.len() as u32;
            let first = address + u64::from(run.rows.start) * size_of::<Triangle>() as u64;
            let triangles = vk::AccelerationStructureGeometryTrianglesDataKHR::default()
                .vertex_format(vk::Format::R32G32B32_SFLOAT)
                .vertex_data(vk::DeviceOrHostAddressConstKHR {
                    device_address: first,
                })
                .vertex_stride(size_of::<Triangle>() as u64 / 3)
                .max_vertex(3 * count - 1)
                .index_type(vk::IndexType::NONE_KHR);
            let flags = match run.opaque {
                true => vk::GeometryFlagsKHR::OPAQUE,
                false => vk::GeometryFlagsKHR::empty(),
            };
            let geometry = vk::AccelerationStructureGeometryKHR::default()
                .geometry_type(vk::GeometryTypeKHR::TRIANGLES)
                .geometry(vk::AccelerationStructureGeometryDataKHR { triangles })
                .flags(flags);
            (geometry, count)
        };
        let geometries: Vec<_> = runs.iter().map(geometry).collect();
        self.add(name, &geometries)
    }

    /// Builds a structure over boxes and returns its device address.
    fn add_boxes(&mut self, name: &str, boxes: &Buffer, count: u32) -> Result<u64, VulkanError> {
        let aabbs = vk::AccelerationStructureGeometryAabbsDataKHR::default()
            .data(vk::DeviceOrHostAddressConstKHR {
                device_address: boxes.address(),
            })
            .stride(24);
        let geometry = vk::AccelerationStructureGeometryKHR::default()
            .geometry_type(vk::GeometryTypeKHR::AABBS)
            .geometry(vk::AccelerationStructureGeometryDataKHR { aabbs })
            .flags(vk::GeometryFlagsKHR::OPAQUE);
        self.add(name, &[(geometry, count)])
    }

    fn add(&mut self, name: &str, geometries: &[CountedGeometry]) -> Result<u64, VulkanError> {
        let structure = build(self.device, self.accel, name, geometries, true)?;
        let info = vk::AccelerationStructureDeviceAddressInfoKHR::default()
            .acceleration_structure(structure.raw);
        // SAFETY: the structure was built.
        let address = unsafe { self.accel.get_acceleration_structure_device_address(&info) };
        self.structures.push(structure);
        Ok(address)
    }
}

/// Copies the boxes of all spheres to the device, if there are any.
fn sphere_boxes(
    device: &Arc<Device>,
    scene: &CompiledScene,
) -> Result<Option<Buffer>, VulkanError> {
    if scene.spheres.is_empty() {
        return Ok(None);
    }
    let rows: Vec<[f32; 6]> = scene
        .spheres
        .iter()
        .map(|s| {
            let (low, high) = (s.center - s.radius, s.center + s.radius);
            [low.x, low.y, low.z, high.x, high.y, high.z]
        })
        .collect();
    Buffer::with(device, "boxes of spheres", &rows, BUILD_INPUT).map(Some)
}

/// Returns an instance of a structure; `custom` is the index that shaders see, `group` its hit
/// group.
fn instance(
    device_handle: u64,
    custom: u32,
    group: u32,
    to_world: DAffine3,
) -> vk::AccelerationStructureInstanceKHR {
    let no_culling = vk::GeometryInstanceFlagsKHR::TRIANGLE_FACING_CULL_DISABLE.as_raw() as u8;
    let [x, y, z, t] = [
        to_world.x_axis,
        to_world.y_axis,
        to_world.z_axis,
        to_world.translation,
    ]
    .map(|v| v.as_vec3());
    // Row-major matrix.
    let matrix = [x.x, y.x, z.x, t.x, x.y, y.y, z.y, t.y, x.z, y.z, z.z, t.z];
    vk::AccelerationStructureInstanceKHR {
        transform: vk::TransformMatrixKHR { matrix },
        instance_custom_index_and_mask: vk::Packed24_8::new(custom, 0xff),
        instance_shader_binding_table_record_offset_and_flags: vk::Packed24_8::new(
            group, no_culling,
        ),
        acceleration_structure_reference: vk::AccelerationStructureReferenceKHR { device_handle },
    }
}

fn bytes_of_instance(
    i: &vk::AccelerationStructureInstanceKHR,
) -> [u8; size_of::<vk::AccelerationStructureInstanceKHR>()] {
    // SAFETY: the structure consists of plain numbers without padding, 64 bytes as Vulkan defines
    // it; `instance` has set the union's field that fills it.
    unsafe { std::mem::transmute_copy(i) }
}

/// Builds a structure over geometries; bottom-level ones are compacted.
fn build(
    device: &Arc<Device>,
    accel: &khr::acceleration_structure::Device,
    name: &str,
    counted: &[CountedGeometry],
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
    let (geometries, counts): (Vec<_>, Vec<u32>) = counted.iter().copied().unzip();
    let info = vk::AccelerationStructureBuildGeometryInfoKHR::default()
        .ty(kind)
        .flags(flags)
        .mode(vk::BuildAccelerationStructureModeKHR::BUILD)
        .geometries(&geometries);
    let mut sizes = vk::AccelerationStructureBuildSizesInfoKHR::default();
    // SAFETY: the device has acceleration structures, and everything lives through the call.
    unsafe {
        accel.get_acceleration_structure_build_sizes(
            vk::AccelerationStructureBuildTypeKHR::DEVICE,
            &info,
            &counts,
            &mut sizes,
        );
    }
    let built = storage(device, accel, name, sizes.acceleration_structure_size, kind)?;
    let alignment = device.info.limits.scratch_alignment;
    let scratch = Buffer::by_address(
        device,
        "build scratch memory",
        sizes.build_scratch_size + alignment,
        vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS,
    )?;
    let info =
        info.dst_acceleration_structure(built.raw)
            .scratch_data(vk::DeviceOrHostAddressKHR {
                device_address: scratch.address().next_multiple_of(alignment),
            });
    let compacted = run_build(device, accel, name, info, &counts, &built, bottom)?;
    if !bottom || compacted == 0 || compacted >= sizes.acceleration_structure_size {
        return Ok(built);
    }
    compact(device, accel, name, &built, compacted, kind)
}

/// Runs a build on the device. Returns the compacted size in bytes of a bottom-level structure, 0
/// for others.
fn run_build(
    device: &Arc<Device>,
    accel: &khr::acceleration_structure::Device,
    name: &str,
    info: vk::AccelerationStructureBuildGeometryInfoKHR,
    counts: &[u32],
    built: &Structure,
    bottom: bool,
) -> Result<u64, VulkanError> {
    let query_info = vk::QueryPoolCreateInfo::default()
        .query_type(vk::QueryType::ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR)
        .query_count(1);
    // SAFETY: the device is open; here and below everything lives until the commands are done.
    let queries = unsafe { device.raw.create_query_pool(&query_info, None) }
        .map_err(|r| device.failed("vkCreateQueryPool", r))?;
    device.name(queries, "compacted size");
    let done = device.run(&format!("build {name}"), |commands| {
        // SAFETY: as above.
        unsafe { device.raw.cmd_reset_query_pool(commands, queries, 0, 1) };
        record_build(device, accel, commands, info, counts);
        if bottom {
            // SAFETY: as above.
            unsafe {
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
    let read = done.and_then(|()| {
        if !bottom {
            return Ok(());
        }
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: as above; the commands that write the query are done.
        unsafe {
            device
                .raw
                .get_query_pool_results(queries, 0, &mut size, flags)
        }
        .map_err(|r| device.failed("vkGetQueryPoolResults", r))
    });
    // SAFETY: as above.
    unsafe { device.raw.destroy_query_pool(queries, None) };
    read.map(|()| size[0])
}

/// Records a build that waits for copies and that later reads wait for.
fn record_build(
    device: &Device,
    accel: &khr::acceleration_structure::Device,
    commands: vk::CommandBuffer,
    info: vk::AccelerationStructureBuildGeometryInfoKHR,
    counts: &[u32],
) {
    let range =
        |count: &u32| vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(*count);
    let ranges: Vec<_> = counts.iter().map(range).collect();
    device.barrier(
        commands,
        (
            vk::PipelineStageFlags::TRANSFER,
            vk::AccessFlags::TRANSFER_WRITE,
        ),
        (
            vk::PipelineStageFlags::ACCELERATION_STRUCTURE_BUILD_KHR,
            vk::AccessFlags::SHADER_READ | vk::AccessFlags::ACCELERATION_STRUCTURE_READ_KHR,
        ),
    );
    // SAFETY: the commands are being recorded, and everything lives until they are done.
    unsafe { accel.cmd_build_acceleration_structures(commands, &[info], &[&ranges]) };
    record_visibility(device, commands);
}

/// Records a barrier: later builds, copies of structures and rays wait for the structures that are
/// built or copied so far.
fn record_visibility(device: &Device, commands: vk::CommandBuffer) {
    let build = vk::PipelineStageFlags::ACCELERATION_STRUCTURE_BUILD_KHR;
    device.barrier(
        commands,
        (build, vk::AccessFlags::ACCELERATION_STRUCTURE_WRITE_KHR),
        (
            build | device.info.caps.tracing_stages(),
            vk::AccessFlags::ACCELERATION_STRUCTURE_READ_KHR,
        ),
    );
}

/// Copies a structure to a compacted one of `size` bytes.
fn compact(
    device: &Arc<Device>,
    accel: &khr::acceleration_structure::Device,
    name: &str,
    built: &Structure,
    size: u64,
    kind: vk::AccelerationStructureTypeKHR,
) -> Result<Structure, VulkanError> {
    let compact = storage(device, accel, name, size, kind)?;
    device.run(&format!("compact {name}"), |commands| {
        let copy = vk::CopyAccelerationStructureInfoKHR::default()
            .src(built.raw)
            .dst(compact.raw)
            .mode(vk::CopyAccelerationStructureModeKHR::COMPACT);
        // SAFETY: both structures live until the commands are done.
        unsafe { accel.cmd_copy_acceleration_structure(commands, &copy) };
        record_visibility(device, commands);
    })?;
    Ok(compact)
}

/// Creates an unbuilt structure of `size` bytes.
fn storage(
    device: &Arc<Device>,
    accel: &khr::acceleration_structure::Device,
    name: &str,
    size: u64,
    kind: vk::AccelerationStructureTypeKHR,
) -> Result<Structure, VulkanError> {
    let usage = vk::BufferUsageFlags::ACCELERATION_STRUCTURE_STORAGE_KHR
        | vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS;
    let memory = Buffer::by_address(
        device,
        &format!("acceleration structure of {name}"),
        size.max(256),
        usage,
    )?;
    let info = vk::AccelerationStructureCreateInfoKHR::default()
        .buffer(memory.raw)
        .size(size)
        .ty(kind);
    // SAFETY: the buffer is as large as the structure.
    let raw = unsafe { accel.create_acceleration_structure(&info, None) }
        .map_err(|r| device.failed("vkCreateAccelerationStructureKHR", r))?;
    device.name(raw, name);
    Ok(Structure {
        device: Arc::clone(device),
        raw,
        memory,
    })
}
