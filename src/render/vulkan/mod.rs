//! The Vulkan backends.
//!
//! `layout` and `spirv` need no device. `instance`, `device`, `buffer` and `pipeline` are a thin layer over Vulkan: each
//! object owns what it was made from and goes when it is dropped, and every submission is waited for, so that nothing is
//! destroyed while it is in use.
#![allow(unsafe_code, reason = "Vulkan is a C interface; each block says why it may be called")]

pub mod buffer;
mod cache;
pub mod device;
pub mod error;
pub mod instance;
pub mod kernel;
pub mod layout;
pub mod pipeline;
pub mod spirv;
pub mod upload;
