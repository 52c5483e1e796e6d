//! Acceleration structures on a device: `structures` builds those of the driver, [`bvh`] the
//! compressed wide BVH of `vulkan-compute`.

pub mod bvh;
pub mod structures;
