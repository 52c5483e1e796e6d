//! What can go wrong with a device: every error names what was needed and what was found.

use ash::vk;

use super::spirv::ShaderError;

/// Why something could not be done on a device.
#[derive(Clone, Debug, thiserror::Error)]
pub enum VulkanError {
    /// There is no Vulkan on this machine.
    #[error("no Vulkan loader: {0}")]
    NoLoader(String),
    /// Nothing on this machine fits.
    #[error("no device: {0}")]
    NoDevice(String),
    /// The device lacks something.
    #[error("{device} lacks {needed}")]
    Lacks {
        /// The device.
        device: String,
        /// What is needed.
        needed: String,
    },
    /// Something is larger than the device can hold.
    #[error("{what} takes {needed_mib:.0} MiB, and {device} offers {found_mib:.0} MiB: {remedy}")]
    TooLarge {
        /// The device.
        device: String,
        /// What was to be stored.
        what: String,
        /// Its size.
        needed_mib: f64,
        /// What there is.
        found_mib: f64,
        /// What the user can do.
        remedy: &'static str,
    },
    /// The device is gone, and with it everything that was on it.
    #[error("{device} was lost in the pass `{pass}`")]
    Lost {
        /// The device.
        device: String,
        /// The last pass that was handed to it.
        pass: String,
    },
    /// The device did not finish a pass in time.
    #[error("{device} did not finish the pass `{pass}` within {seconds} s")]
    Stuck {
        /// The device.
        device: String,
        /// The pass.
        pass: String,
        /// How long was waited.
        seconds: u64,
    },
    /// A call failed.
    #[error("{call} failed with {result:?} in the pass `{pass}`")]
    Call {
        /// The function.
        call: &'static str,
        /// Its answer.
        result: vk::Result,
        /// The last pass that was handed to the device.
        pass: String,
    },
    /// Device memory could not be had.
    #[error("no memory on {device} for {what}, {needed_mib:.1} MiB: {problem}")]
    NoMemory {
        /// The device.
        device: String,
        /// What was to be stored.
        what: String,
        /// Its size.
        needed_mib: f64,
        /// What the allocator says.
        problem: String,
    },
    /// A shader does not compile.
    #[error(transparent)]
    Shader(#[from] ShaderError),
}

/// Bytes as MiB.
pub fn mib(bytes: u64) -> f64 {
    bytes as f64 / (1u64 << 20) as f64
}
