//! Buffers in device memory.

use std::sync::Arc;

use ash::vk;
use bytemuck::Pod;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};

use super::device::Device;
use super::error::{VulkanError, mib};

/// What all buffers that shaders see may be used for, besides what their maker adds.
const STORAGE: vk::BufferUsageFlags = vk::BufferUsageFlags::from_raw(
    vk::BufferUsageFlags::STORAGE_BUFFER.as_raw()
        | vk::BufferUsageFlags::TRANSFER_DST.as_raw()
        | vk::BufferUsageFlags::TRANSFER_SRC.as_raw(),
);

/// A buffer and its memory.
pub struct Buffer {
    device: Arc<Device>,
    /// The buffer.
    pub raw: vk::Buffer,
    /// Its bytes.
    pub size: u64,
    allocation: Option<Allocation>,
}

impl Buffer {
    /// A buffer that only the device touches, for storage and what `usage` adds.
    ///
    /// # Errors
    /// When it is larger than shaders can see or the device holds, or there is no memory left.
    pub fn new(
        device: &Arc<Device>,
        name: &str,
        size: u64,
        usage: vk::BufferUsageFlags,
    ) -> Result<Buffer, VulkanError> {
        let remedy = "one array of a scene must fit into one storage buffer; make meshes or textures smaller";
        at_most(device, name, size, device.info.limits.storage_range, remedy)?;
        Buffer::by_address(device, name, size, usage)
    }

    /// The same of a buffer that is never bound, so that it may be larger than what shaders see of one that is.
    ///
    /// # Errors
    /// When it is larger than the device holds, or there is no memory left.
    pub fn by_address(
        device: &Arc<Device>,
        name: &str,
        size: u64,
        usage: vk::BufferUsageFlags,
    ) -> Result<Buffer, VulkanError> {
        let remedy = "the scene and its films must fit into the device's memory";
        at_most(device, name, size, device.info.limits.heap, remedy)?;
        Buffer::make(device, name, size, STORAGE | usage, MemoryLocation::GpuOnly)
    }

    /// A buffer with the given rows, on the device.
    ///
    /// # Errors
    /// As [`Buffer::new`], and when copying fails.
    pub fn with<T: Pod>(
        device: &Arc<Device>,
        name: &str,
        rows: &[T],
        usage: vk::BufferUsageFlags,
    ) -> Result<Buffer, VulkanError> {
        let bytes: &[u8] = bytemuck::cast_slice(rows);
        // Arrays without rows still need something to bind.
        let size = bytes.len().max(size_of::<T>()).max(16) as u64;
        let buffer = Buffer::new(device, name, size, usage)?;
        if bytes.len() < size as usize {
            buffer.clear()?;
        }
        buffer.write(bytes)?;
        Ok(buffer)
    }

    /// A buffer of zeros for shaders, of so many bytes or, so that there is something to bind, a few more.
    ///
    /// # Errors
    /// As [`Buffer::with`].
    pub fn zeros(device: &Arc<Device>, name: &str, size: u64) -> Result<Buffer, VulkanError> {
        let buffer = Buffer::new(device, name, size.max(16), vk::BufferUsageFlags::empty())?;
        buffer.clear()?;
        Ok(buffer)
    }

    fn make(
        device: &Arc<Device>,
        name: &str,
        size: u64,
        usage: vk::BufferUsageFlags,
        location: MemoryLocation,
    ) -> Result<Buffer, VulkanError> {
        let info = vk::BufferCreateInfo::default().size(size).usage(usage);
        // SAFETY: the device is open.
        let raw = unsafe { device.raw.create_buffer(&info, None) }.map_err(|r| device.failed("vkCreateBuffer", r))?;
        device.name(raw, name);
        // From here on the buffer is destroyed when it is dropped.
        let mut buffer = Buffer { device: Arc::clone(device), raw, size, allocation: None };
        // SAFETY: the buffer was made by this device.
        let requirements = unsafe { device.raw.get_buffer_memory_requirements(raw) };
        let allocation = device.allocator().allocate(&AllocationCreateDesc {
            name,
            requirements,
            location,
            linear: true,
            allocation_scheme: AllocationScheme::GpuAllocatorManaged,
        });
        let allocation = allocation.map_err(|e| VulkanError::NoMemory {
            device: device.info.line(),
            what: name.to_owned(),
            needed_mib: mib(size),
            problem: e.to_string(),
        })?;
        // SAFETY: the allocation is as large and aligned as the buffer requires, and goes after it.
        let bound = unsafe { device.raw.bind_buffer_memory(raw, allocation.memory(), allocation.offset()) };
        buffer.allocation = Some(allocation);
        bound.map_err(|r| device.failed("vkBindBufferMemory", r))?;
        Ok(buffer)
    }

    /// Makes every byte zero.
    ///
    /// # Errors
    /// When the device fails.
    pub fn clear(&self) -> Result<(), VulkanError> {
        self.device.run("clear", |commands| {
            // SAFETY: the commands are being recorded, and the buffer may be filled.
            unsafe { self.device.raw.cmd_fill_buffer(commands, self.raw, 0, vk::WHOLE_SIZE, 0) };
        })
    }

    /// Copies bytes to the start of the buffer.
    ///
    /// # Errors
    /// When the device fails, or there is no memory for the copy.
    pub fn write(&self, bytes: &[u8]) -> Result<(), VulkanError> {
        if bytes.is_empty() {
            return Ok(());
        }
        let usage = vk::BufferUsageFlags::TRANSFER_SRC;
        let mut staging = Buffer::make(&self.device, "upload", bytes.len() as u64, usage, MemoryLocation::CpuToGpu)?;
        let mapped = staging.allocation.as_mut().and_then(Allocation::mapped_slice_mut);
        let mapped = mapped.ok_or_else(|| self.device.failed("vkMapMemory", vk::Result::ERROR_MEMORY_MAP_FAILED))?;
        mapped[..bytes.len()].copy_from_slice(bytes);
        self.device.run("upload", |commands| {
            let region = [vk::BufferCopy::default().size(bytes.len() as u64)];
            // SAFETY: the commands are being recorded, and both buffers are at least as long as what is copied.
            unsafe { self.device.raw.cmd_copy_buffer(commands, staging.raw, self.raw, &region) };
        })
    }

    /// The first rows of the buffer, copied back.
    ///
    /// # Errors
    /// When the device fails, or there is no memory for the copy.
    pub fn read<T: Pod>(&self, rows: usize) -> Result<Vec<T>, VulkanError> {
        let readback = Readback::new(&self.device, (rows * size_of::<T>()) as u64)?;
        readback.fetch(&[self])?;
        Ok(bytemuck::pod_collect_to_vec(&readback.bytes()[..rows * size_of::<T>()]))
    }

    /// Its address on the device; only for buffers made with that usage.
    pub fn address(&self) -> u64 {
        let info = vk::BufferDeviceAddressInfo::default().buffer(self.raw);
        // SAFETY: the buffer has memory.
        unsafe { self.device.raw.get_buffer_device_address(&info) }
    }
}

/// Refuses what is larger than a limit.
pub(super) fn at_most(
    device: &Device,
    what: &str,
    size: u64,
    found: u64,
    remedy: &'static str,
) -> Result<(), VulkanError> {
    if size <= found {
        return Ok(());
    }
    let (device, what) = (device.info.line(), what.to_owned());
    Err(VulkanError::TooLarge { device, what, needed_mib: mib(size), found_mib: mib(found), remedy })
}

impl Drop for Buffer {
    fn drop(&mut self) {
        if self.device.is_stuck() {
            return;
        }
        // SAFETY: every submission that uses the buffer was waited for.
        unsafe { self.device.raw.destroy_buffer(self.raw, None) };
        if let Some(allocation) = self.allocation.take() {
            // The allocator's only complaint would be an allocation that is not its own.
            let _ = self.device.allocator().free(allocation);
        }
    }
}

/// Memory of the host into which buffers are copied, one behind the other.
pub struct Readback {
    buffer: Buffer,
}

impl Readback {
    /// Room for so many bytes.
    ///
    /// # Errors
    /// When there is no memory.
    pub fn new(device: &Arc<Device>, size: u64) -> Result<Readback, VulkanError> {
        let usage = vk::BufferUsageFlags::TRANSFER_DST;
        Ok(Readback { buffer: Buffer::make(device, "readback", size.max(16), usage, MemoryLocation::GpuToCpu)? })
    }

    /// Copies buffers here, one after the other, as far as there is room, and waits for it.
    ///
    /// # Errors
    /// When the device fails.
    pub fn fetch(&self, sources: &[&Buffer]) -> Result<(), VulkanError> {
        self.buffer.device.run("readback", |commands| self.record(commands, sources))
    }

    /// Records the same.
    pub fn record(&self, commands: vk::CommandBuffer, sources: &[&Buffer]) {
        let device = &self.buffer.device;
        let mut at = 0;
        for source in sources {
            let size = source.size.min(self.buffer.size - at);
            let region = [vk::BufferCopy::default().dst_offset(at).size(size)];
            // SAFETY: the commands are being recorded, and what is copied lies inside both buffers.
            unsafe { device.raw.cmd_copy_buffer(commands, source.raw, self.buffer.raw, &region) };
            at += size;
        }
        self.barrier_to_host(commands);
    }

    /// Records that the first two readings of a pool of clocks are copied here, as two words of 64 bits.
    pub fn record_ticks(&self, commands: vk::CommandBuffer, pool: vk::QueryPool) {
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: the commands are being recorded, and there is room for sixteen bytes in every buffer of this kind.
        unsafe {
            self.buffer.device.raw.cmd_copy_query_pool_results(commands, pool, 0, 2, self.buffer.raw, 0, 8, flags)
        };
        self.barrier_to_host(commands);
    }

    fn barrier_to_host(&self, commands: vk::CommandBuffer) {
        self.buffer.device.barrier(
            commands,
            (vk::PipelineStageFlags::TRANSFER, vk::AccessFlags::TRANSFER_WRITE),
            (vk::PipelineStageFlags::HOST, vk::AccessFlags::HOST_READ),
        );
    }

    /// What was copied.
    pub fn bytes(&self) -> &[u8] {
        self.buffer.allocation.as_ref().and_then(Allocation::mapped_slice).unwrap_or_default()
    }
}
