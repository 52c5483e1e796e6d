//! Buffers in device memory.

use std::sync::Arc;

use ash::vk;
use bytemuck::Pod;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};

use crate::context::device::Device;
use crate::error::{VulkanError, mib};

/// Usage of all buffers that shaders access, besides the caller's own.
const STORAGE: vk::BufferUsageFlags = vk::BufferUsageFlags::from_raw(
    vk::BufferUsageFlags::STORAGE_BUFFER.as_raw()
        | vk::BufferUsageFlags::TRANSFER_DST.as_raw()
        | vk::BufferUsageFlags::TRANSFER_SRC.as_raw(),
);

/// Buffer with its memory.
pub struct Buffer {
    device: Arc<Device>,
    /// Handle of the buffer.
    pub raw: vk::Buffer,
    /// Size in bytes.
    pub size: u64,
    allocation: Option<Allocation>,
}

impl Buffer {
    /// Creates a buffer in device memory for storage and the additional `usage`.
    ///
    /// # Errors
    /// Returns an error if it exceeds the size of a storage buffer or the device's memory, or no
    /// memory is left.
    pub fn new(
        device: &Arc<Device>,
        name: &str,
        size: u64,
        usage: vk::BufferUsageFlags,
    ) -> Result<Buffer, VulkanError> {
        let remedy = "each array of a scene must fit into one storage buffer; use smaller meshes \
                      or textures";
        check_size(device, name, size, device.info.limits.storage_range, remedy)?;
        Buffer::by_address(device, name, size, usage)
    }

    /// Creates a storage buffer for what shaders write, of `size` bytes or a few more so that it can
    /// be bound. The error advises `remedy` if a storage buffer cannot be that large.
    ///
    /// # Errors
    /// Returns an error in the cases of [`Buffer::new`].
    pub fn written(
        device: &Arc<Device>,
        name: &str,
        size: u64,
        remedy: &'static str,
    ) -> Result<Buffer, VulkanError> {
        check_size(device, name, size, device.info.limits.storage_range, remedy)?;
        Buffer::by_address(device, name, size.max(16), vk::BufferUsageFlags::empty())
    }

    /// Creates a buffer that is never bound and may therefore exceed the size of a storage buffer.
    ///
    /// # Errors
    /// Returns an error if it exceeds the device's memory, or no memory is left.
    pub fn by_address(
        device: &Arc<Device>,
        name: &str,
        size: u64,
        usage: vk::BufferUsageFlags,
    ) -> Result<Buffer, VulkanError> {
        check_memory(device, name, size)?;
        Buffer::make(device, name, size, STORAGE | usage, MemoryLocation::GpuOnly)
    }

    /// Creates a buffer with the given rows in device memory.
    ///
    /// # Errors
    /// Returns an error in the cases of [`Buffer::new`], or if copying fails.
    pub fn with<T: Pod>(
        device: &Arc<Device>,
        name: &str,
        rows: &[T],
        usage: vk::BufferUsageFlags,
    ) -> Result<Buffer, VulkanError> {
        let bytes: &[u8] = bytemuck::cast_slice(rows);
        // Empty arrays still need a buffer to bind.
        let size = bytes.len().max(size_of::<T>()).max(16) as u64;
        let buffer = Buffer::new(device, name, size, usage)?;
        if bytes.len() < size as usize {
            buffer.clear()?;
        }
        buffer.write(bytes)?;
        Ok(buffer)
    }

    /// Creates a buffer of zeros of `size` bytes, or a few more so that it can be bound.
    ///
    /// # Errors
    /// Returns an error in the cases of [`Buffer::with`].
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
        let raw = unsafe { device.raw.create_buffer(&info, None) }
            .map_err(|r| device.failed("vkCreateBuffer", r))?;
        device.name(raw, name);
        // From here on the buffer is destroyed on drop.
        let mut buffer = Buffer {
            device: Arc::clone(device),
            raw,
            size,
            allocation: None,
        };
        // SAFETY: the buffer was created by this device.
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
        // SAFETY: the allocation has the size and alignment that the buffer requires, and is freed
        // after it.
        let bound = unsafe {
            device
                .raw
                .bind_buffer_memory(raw, allocation.memory(), allocation.offset())
        };
        buffer.allocation = Some(allocation);
        bound.map_err(|r| device.failed("vkBindBufferMemory", r))?;
        Ok(buffer)
    }

    /// Fills the buffer with zeros.
    ///
    /// # Errors
    /// Returns an error if the device fails.
    pub fn clear(&self) -> Result<(), VulkanError> {
        self.device.run("clear", |commands| {
            // SAFETY: the commands are being recorded, and the buffer may be filled.
            unsafe {
                self.device
                    .raw
                    .cmd_fill_buffer(commands, self.raw, 0, vk::WHOLE_SIZE, 0)
            };
        })
    }

    /// Copies bytes to the start of the buffer.
    ///
    /// # Errors
    /// Returns an error if the device fails, or there is no memory for the staging buffer.
    pub fn write(&self, bytes: &[u8]) -> Result<(), VulkanError> {
        if bytes.is_empty() {
            return Ok(());
        }
        let usage = vk::BufferUsageFlags::TRANSFER_SRC;
        let mut staging = Buffer::make(
            &self.device,
            "upload",
            bytes.len() as u64,
            usage,
            MemoryLocation::CpuToGpu,
        )?;
        let mapped = staging
            .allocation
            .as_mut()
            .and_then(Allocation::mapped_slice_mut);
        let mapped = mapped.ok_or_else(|| {
            self.device
                .failed("vkMapMemory", vk::Result::ERROR_MEMORY_MAP_FAILED)
        })?;
        mapped[..bytes.len()].copy_from_slice(bytes);
        self.device.run("upload", |commands| {
            let region = [vk::BufferCopy::default().size(bytes.len() as u64)];
            // SAFETY: the commands are being recorded, and both buffers are at least as long as the
            // copied range.
            unsafe {
                self.device
                    .raw
                    .cmd_copy_buffer(commands, staging.raw, self.raw, &region)
            };
        })
    }

    /// Reads the first `rows` rows of the buffer.
    ///
    /// # Errors
    /// Returns an error if the device fails, or there is no memory for the staging buffer.
    pub fn read<T: Pod>(&self, rows: usize) -> Result<Vec<T>, VulkanError> {
        let readback = Readback::new(&self.device, (rows * size_of::<T>()) as u64)?;
        readback.fetch(&[self])?;
        Ok(bytemuck::pod_collect_to_vec(
            &readback.bytes()[..rows * size_of::<T>()],
        ))
    }

    /// Returns its device address; only for buffers created with that usage.
    pub fn address(&self) -> u64 {
        let info = vk::BufferDeviceAddressInfo::default().buffer(self.raw);
        // SAFETY: the buffer has memory.
        unsafe { self.device.raw.get_buffer_device_address(&info) }
    }
}

/// Size in bytes from which the free memory of a device is asked before it is allocated; smaller
/// buffers usually fit into memory that the allocator holds already.
const LARGE: u64 = 16 << 20;

/// Returns an error if a buffer exceeds the memory of the device, what its driver allocates at
/// once, or what is left of the memory.
pub(crate) fn check_memory(device: &Device, what: &str, size: u64) -> Result<(), VulkanError> {
    let limits = &device.info.limits;
    let remedy = "the scene and its films must fit into the device's memory";
    check_size(device, what, size, limits.heap, remedy)?;
    let remedy = "the driver allocates no larger buffer; use smaller meshes, textures or films";
    check_size(device, what, size, limits.allocation, remedy)?;
    if size < LARGE {
        return Ok(());
    }
    let remedy = "the rest of its memory is in use, by this program or by others; close those, or \
                  use smaller meshes, textures or films";
    check_size(device, what, size, device.info.memory_left(), remedy)
}

/// Returns an error if a size exceeds a limit.
pub(crate) fn check_size(
    device: &Device,
    what: &str,
    size: u64,
    found: u64,
    remedy: &'static str,
) -> Result<(), VulkanError> {
    if size <= found {
        return Ok(());
    }
    let (device, what) = (device.info.line(), format!("the buffer `{what}`"));
    Err(VulkanError::TooLarge {
        device,
        what,
        needed_mib: mib(size),
        found_mib: mib(found),
        remedy,
    })
}

impl Drop for Buffer {
    fn drop(&mut self) {
        if self.device.is_stuck() {
            return;
        }
        // SAFETY: every submission that uses the buffer was waited for.
        unsafe { self.device.raw.destroy_buffer(self.raw, None) };
        if let Some(allocation) = self.allocation.take() {
            // Freeing fails only for an allocation of another allocator.
            let _ = self.device.allocator().free(allocation);
        }
    }
}

/// Host memory into which buffers are copied, one after the other.
pub struct Readback {
    buffer: Buffer,
}

impl Readback {
    /// Allocates `size` bytes.
    ///
    /// # Errors
    /// Returns an error if there is no memory.
    pub fn new(device: &Arc<Device>, size: u64) -> Result<Readback, VulkanError> {
        let usage = vk::BufferUsageFlags::TRANSFER_DST;
        Ok(Readback {
            buffer: Buffer::make(
                device,
                "readback",
                size.max(16),
                usage,
                MemoryLocation::GpuToCpu,
            )?,
        })
    }

    /// Copies buffers to the host, one after the other, as far as there is room, and waits for it.
    ///
    /// # Errors
    /// Returns an error if the device fails.
    pub fn fetch(&self, sources: &[&Buffer]) -> Result<(), VulkanError> {
        self.buffer
            .device
            .run("readback", |commands| self.record(commands, sources))
    }

    /// Records the commands of [`fetch`](Self::fetch).
    pub fn record(&self, commands: vk::CommandBuffer, sources: &[&Buffer]) {
        let device = &self.buffer.device;
        let mut at = 0;
        for source in sources {
            let size = source.size.min(self.buffer.size - at);
            let region = [vk::BufferCopy::default().dst_offset(at).size(size)];
            // SAFETY: the commands are being recorded, and what is copied lies inside both buffers.
            unsafe {
                device
                    .raw
                    .cmd_copy_buffer(commands, source.raw, self.buffer.raw, &region)
            };
            at += size;
        }
        self.barrier_to_host(commands);
    }

    /// Records a copy of the first two timestamps of a query pool, as two 64-bit words.
    pub fn record_ticks(&self, commands: vk::CommandBuffer, pool: vk::QueryPool) {
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: the commands are being recorded, and every buffer of this type has room for 16
        // bytes.
        unsafe {
            self.buffer.device.raw.cmd_copy_query_pool_results(
                commands,
                pool,
                0,
                2,
                self.buffer.raw,
                0,
                8,
                flags,
            )
        };
        self.barrier_to_host(commands);
    }

    fn barrier_to_host(&self, commands: vk::CommandBuffer) {
        self.buffer.device.barrier(
            commands,
            (
                vk::PipelineStageFlags::TRANSFER,
                vk::AccessFlags::TRANSFER_WRITE,
            ),
            (vk::PipelineStageFlags::HOST, vk::AccessFlags::HOST_READ),
        );
    }

    /// Returns the copied bytes.
    pub fn bytes(&self) -> &[u8] {
        self.buffer
            .allocation
            .as_ref()
            .and_then(Allocation::mapped_slice)
            .unwrap_or_default()
    }
}
