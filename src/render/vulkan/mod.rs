//! The Vulkan backends.
//!
//! `layout` and `spirv` need no device.

pub mod layout;
pub mod spirv;
