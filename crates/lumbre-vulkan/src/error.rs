//! Errors of devices. Each states what was needed and what was found.

use ash::vk;

use super::pipelines::sources::ShaderError;

/// Reason why an operation on a device failed.
#[derive(Clone, Debug, thiserror::Error)]
pub enum VulkanError {
    /// The Vulkan loader is not installed, or is no such library.
    #[error("the Vulkan loader cannot be loaded: {0}")]
    NoLoader(String),
    /// The loader or a driver crashed, hung or refused when a worker process opened a device.
    #[error("the Vulkan loader or a driver fails: {0}")]
    Broken(String),
    /// No device of this machine is suitable.
    #[error("no usable graphics device: {0}")]
    NoDevice(String),
    /// The device lacks a required feature.
    #[error("{device} does not support {needed}")]
    Lacks {
        /// Name of the device.
        device: String,
        /// Feature that is required.
        needed: String,
    },
    /// The job exceeds a limit of the program, whatever the device.
    #[error("{0}")]
    OverLimit(String),
    /// Data is larger than the device can hold.
    #[error("{what} needs {needed_mib:.0} MiB, but {device} offers {found_mib:.0} MiB: {remedy}")]
    TooLarge {
        /// Name of the device.
        device: String,
        /// Description of the data.
        what: String,
        /// Required size in MiB.
        needed_mib: f64,
        /// Available size in MiB.
        found_mib: f64,
        /// Advice for the user.
        remedy: &'static str,
    },
    /// The device was lost with all data on it.
    #[error("{device} was lost during the pass `{pass}`{}", suffix(.fault))]
    Lost {
        /// Name of the device.
        device: String,
        /// Name of the last submitted pass.
        pass: String,
        /// Reason that the driver reports, if it does.
        fault: Option<String>,
    },
    /// The driver cannot create a pipeline. Some drivers lose the device with it.
    #[error(
        "{device} cannot create the pipeline `{pipeline}` ({result:?}): update the driver, or use \
         another backend or integrator"
    )]
    PipelineRefused {
        /// Name of the device.
        device: String,
        /// Name of the pipeline.
        pipeline: String,
        /// Result code of the driver.
        result: vk::Result,
    },
    /// The device did not finish a pass in time.
    #[error("{device} did not finish the pass `{pass}` within {seconds} s")]
    Stuck {
        /// Name of the device.
        device: String,
        /// Name of the pass.
        pass: String,
        /// Timeout in seconds.
        seconds: u64,
    },
    /// A Vulkan call failed.
    #[error("{call} failed with {result:?} during the pass `{pass}`")]
    Call {
        /// Name of the function.
        call: &'static str,
        /// Result code of the call.
        result: vk::Result,
        /// Name of the last submitted pass.
        pass: String,
    },
    /// Device memory could not be allocated.
    #[error("cannot allocate {needed_mib:.1} MiB for {what} on {device}: {problem}")]
    NoMemory {
        /// Name of the device.
        device: String,
        /// Description of the data.
        what: String,
        /// Required size in MiB.
        needed_mib: f64,
        /// Message of the allocator.
        problem: String,
    },
    /// A shader does not compile.
    #[error(transparent)]
    Shader(#[from] ShaderError),
}

/// Returns a reason as the end of a message.
fn suffix(reason: &Option<String>) -> String {
    reason
        .as_ref()
        .map_or_else(String::new, |r| format!(": {r}"))
}

/// Converts bytes to MiB.
pub fn mib(bytes: u64) -> f64 {
    bytes as f64 / (1u64 << 20) as f64
}
