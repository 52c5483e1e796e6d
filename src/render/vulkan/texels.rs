//! Texels on a device: in one buffer, or in blocks by address where one would be larger than shaders can see.

use std::sync::Arc;

use ash::vk;

use super::buffer::{Buffer, at_most};
use super::device::Device;
use super::error::VulkanError;

/// Bytes of a texel: three floats.
const BYTES: u64 = size_of::<[f32; 3]>() as u64;

/// Most bytes of a block: what every device gives at once (`maxMemoryAllocationSize` is 1 GiB at least).
const MOST_OF_A_BLOCK: u64 = 1 << 30;

/// Most texels: they are counted in words of 32 bits.
const MOST: u64 = 1 << 32;

/// The texels of a scene on a device.
pub struct Texels {
    /// What is bound: the texels, or the addresses of their blocks.
    pub bound: Buffer,
    _blocks: Vec<Buffer>,
    /// Blocks have 2 to the power of this many texels; `None` where there is one buffer. Shaders know it as `TEXEL_SHIFT`.
    pub shift: Option<u32>,
}

impl Texels {
    /// Copies texels to a device.
    ///
    /// # Errors
    /// When they are larger than the device holds, or than shaders see where buffers have no addresses.
    pub fn new(device: &Arc<Device>, texels: &[[f32; 3]]) -> Result<Texels, VulkanError> {
        let (needed, limits) = (texels.len() as u64 * BYTES, &device.info.limits);
        if needed <= limits.texels || !device.info.caps.addresses {
            let bound = Buffer::with(device, "texels", texels, vk::BufferUsageFlags::empty())?;
            return Ok(Texels { bound, _blocks: Vec::new(), shift: None });
        }
        at_most(device, "texels", needed, limits.heap, "the scene and its films must fit into the device's memory")?;
        let shift = (limits.texels.min(MOST_OF_A_BLOCK) / BYTES).max(1).ilog2();
        let block = |rows| Buffer::with(device, "block of texels", rows, vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS);
        let blocks: Vec<Buffer> = texels.chunks(1 << shift).map(block).collect::<Result<_, _>>()?;
        let addresses: Vec<u64> = blocks.iter().map(Buffer::address).collect();
        let bound = Buffer::with(device, "addresses of texels", &addresses, vk::BufferUsageFlags::empty())?;
        Ok(Texels { bound, _blocks: blocks, shift: Some(shift) })
    }

    /// Refuses more texels than can be counted on a device.
    ///
    /// # Errors
    /// When there are more than 2^32.
    pub fn countable(device: &Device, count: u64) -> Result<(), VulkanError> {
        let remedy = "shaders count texels in 32 bits; make textures smaller";
        at_most(device, "texels", count.saturating_mul(BYTES), MOST * BYTES, remedy)
    }
}
