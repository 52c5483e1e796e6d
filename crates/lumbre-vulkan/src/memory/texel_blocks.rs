//! Texels on a device: in one buffer, or in blocks accessed by address if one buffer would exceed
//! what shaders can access.

use std::sync::Arc;

use ash::vk;

use super::buffer::{Buffer, check_size};
use crate::context::device::Device;
use crate::error::VulkanError;

/// Size of a word in bytes.
const BYTES: u64 = size_of::<u32>() as u64;

/// Maximum size of a block in bytes, which every device can allocate at once
/// (`maxMemoryAllocationSize` is at least 1 GiB).
const MAX_BLOCK_BYTES: u64 = 1 << 30;

/// Maximum number of words, which are counted in 32 bits.
const MAX_WORDS: u64 = 1 << 32;

/// Words of the texels of a scene on a device.
pub struct Texels {
    /// Buffer to bind: the words, or the addresses of their blocks.
    pub bound: Buffer,
    _blocks: Vec<Buffer>,
    /// Binary logarithm of the number of words of a block; `None` if there is one buffer. Shaders
    /// know it as `TEXEL_SHIFT`.
    pub shift: Option<u32>,
}

impl Texels {
    /// Copies the words of texels to a device.
    ///
    /// # Errors
    /// Returns an error if they exceed the device's memory, or the size of a storage buffer on
    /// devices without what blocks need.
    pub fn new(device: &Arc<Device>, words: &[u32]) -> Result<Texels, VulkanError> {
        let (needed, limits) = (words.len() as u64 * BYTES, &device.info.limits);
        if needed <= limits.texels || !device.info.caps.extended() {
            let bound = Buffer::with(device, "texels", words, vk::BufferUsageFlags::empty())?;
            return Ok(Texels {
                bound,
                _blocks: Vec::new(),
                shift: None,
            });
        }
        check_size(
            device,
            "texels",
            needed,
            limits.heap,
            "the scene and its films must fit into the device's memory",
        )?;
        let shift = (limits.texels.min(MAX_BLOCK_BYTES) / BYTES).max(1).ilog2();
        let create_block = |rows| {
            Buffer::with(
                device,
                "block of texels",
                rows,
                vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS,
            )
        };
        let blocks: Vec<Buffer> = words
            .chunks(1 << shift)
            .map(create_block)
            .collect::<Result<_, _>>()?;
        let addresses: Vec<u64> = blocks.iter().map(Buffer::address).collect();
        let bound = Buffer::with(
            device,
            "addresses of texels",
            &addresses,
            vk::BufferUsageFlags::empty(),
        )?;
        Ok(Texels {
            bound,
            _blocks: blocks,
            shift: Some(shift),
        })
    }

    /// Returns an error if there are more words of texels than a device can index.
    ///
    /// # Errors
    /// Returns an error if there are more than 2^32.
    pub fn check_count(device: &Device, count: u64) -> Result<(), VulkanError> {
        let remedy = "shaders index the words of texels with 32 bits; use smaller textures";
        check_size(
            device,
            "texels",
            count.saturating_mul(BYTES),
            MAX_WORDS * BYTES,
            remedy,
        )
    }
}
