//! Resources of shaders.

use ash::vk;

use crate::memory::buffer::Buffer;

/// Resource that is bound to a descriptor set.
pub enum BoundResource<'a> {
    /// A buffer of constants, which all invocations read at the same place.
    Uniform(&'a Buffer),
    /// A storage buffer.
    Storage(&'a Buffer),
    /// An acceleration structure.
    Acceleration(vk::AccelerationStructureKHR),
}
