//! The Vulkan instance and devices: [`instance`] loads Vulkan, [`physical_device`] lists and
//! selects devices, whose [`limits`] are queried, [`device`] opens one, `fault` asks for the reason
//! of its loss, and `session` shares it and the last scene among all runs
//! of the process.

pub mod device;
mod fault;
pub mod instance;
pub mod limits;
pub mod physical_device;
pub mod session;
