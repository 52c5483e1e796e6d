//! The Vulkan instance and devices: [`instance`] loads Vulkan, [`physical_device`] lists and
//! selects devices, [`device`] opens one, and `session` shares it and the last scene among all runs
//! of the process.

pub mod device;
pub mod instance;
pub mod physical_device;
pub mod session;
