//! Buffers of the light subpaths that the samples of an iteration share: `shaders/iteration.glsl`.

use std::sync::Arc;

use super::buffer::Buffer;
use super::subpaths::SubpathRoom;
use crate::context::device::Device;
use crate::error::VulkanError;
use crate::layout::{LIST_BLOCK, LightListHead, LightPath};
use crate::pipelines::compute::BoundResource;

/// Advice to users if the subpaths of an iteration exceed the device.
const REMEDY: &str = "the light subpaths of a sample must fit into one storage buffer; lower `photons` \
                      or `max_depth`";

/// Buffers of light subpaths and their list; of a few bytes for jobs whose samples share none.
pub struct LightPathBuffers {
    paths: Buffer,
    list: Buffer,
}

impl LightPathBuffers {
    /// Creates the buffers of a job, without subpaths.
    ///
    /// # Errors
    /// Returns an error if the device has no room for them.
    pub fn new(device: &Arc<Device>, room: &SubpathRoom) -> Result<LightPathBuffers, VulkanError> {
        let paths = room.light_paths;
        let blocks = paths.div_ceil(u64::from(LIST_BLOCK));
        let list = size_of::<LightListHead>() as u64 + 4 * (blocks + room.shared());
        let paths = paths * size_of::<LightPath>() as u64;
        Ok(LightPathBuffers {
            paths: Buffer::written(device, "light paths", paths, REMEDY)?,
            list: Buffer::written(device, "light vertex list", list, REMEDY)?,
        })
    }

    /// Returns the bindings after those of vertices, in the order of `shaders/iteration.glsl`.
    pub fn bindings(&self) -> [BoundResource<'_>; 2] {
        [&self.paths, &self.list].map(BoundResource::Storage)
    }

    /// Writes the expected number of connections with each vertex of a light subpath.
    ///
    /// # Errors
    /// Returns an error if the device fails.
    pub fn set_connecting(&self, connecting: f32) -> Result<(), VulkanError> {
        let head = LightListHead {
            count: 0,
            connecting,
        };
        self.list.write(bytemuck::bytes_of(&head))
    }

    /// Returns the number of listed vertices.
    ///
    /// # Errors
    /// Returns an error if the device fails.
    pub fn listed(&self) -> Result<u32, VulkanError> {
        let head: Vec<LightListHead> = self.list.read(1)?;
        Ok(head.first().map_or(0, |head| head.count))
    }
}
