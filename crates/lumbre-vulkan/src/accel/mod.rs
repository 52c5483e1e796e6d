//! Acceleration structures on a device: `structures` builds those of the driver, from triangles that
//! `geometries` divides, [`bvh`] the compressed wide BVH of `vulkan-compute`.

pub mod bvh;
mod geometries;
pub mod structures;
