//! Tests that need a Vulkan device; a software driver is enough. Without one each test prints
//! `SKIPPED` with the reason and passes, unless the variable `REQUIRE_DEVICE` is `1`. Any message
//! of the validation layer fails the next test that checks for messages.
#![cfg(feature = "vulkan")]
#![allow(clippy::unwrap_used, clippy::print_stdout)]

#[path = "../common/mod.rs"]
mod common;

/// Returns the content of an option; ends the test, which was skipped, if there is none.
macro_rules! or_return {
    ($option:expr) => {
        match $option {
            Some(content) => content,
            None => return,
        }
    };
}

/// Returns the committed module of a test kernel, by the name of its file without `.spv`.
macro_rules! kernel {
    ($stage:ident $name:literal) => {
        (
            lumbre_vulkan::pipelines::test_kernel::KernelStage::$stage,
            include_bytes!(concat!(
                env!("CARGO_MANIFEST_DIR"),
                "/tests/device/parity/spirv/",
                $name,
                ".spv"
            ))
            .as_slice(),
        )
    };
}

mod accel;
mod ahead;
mod corners;
mod devices;
mod faults;
pub mod harness;
mod images;
mod instances;
mod light_paths;
mod night;
mod parallel;
mod parity;
mod paths;
mod reports;
mod rounding;
mod shader_folder;
mod subpaths;
mod texels;
mod times;
mod twins;
mod validation;
mod verdict;
mod weights;
mod worker;
