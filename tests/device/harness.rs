//! The device that tests share, and what they do without one.

use std::sync::{Arc, OnceLock};

use lumbre::render::vulkan::device::{self, Device};
use lumbre::render::vulkan::instance;

/// The device of this process, or `None` after a line `SKIPPED` where there is none.
pub fn device() -> Option<Arc<Device>> {
    static SHARED: OnceLock<Result<Arc<Device>, String>> = OnceLock::new();
    let shared = SHARED.get_or_init(|| {
        instance::validate();
        let info = device::choose().map_err(|e| e.to_string())?;
        let caps = info.caps;
        Device::open(info, caps).map_err(|e| e.to_string())
    });
    match shared {
        Ok(device) => Some(Arc::clone(device)),
        Err(reason) if required() => panic!("REQUIRE_DEVICE is set, but: {reason}"),
        Err(reason) => {
            println!("SKIPPED: needs a Vulkan device: {reason}");
            None
        }
    }
}

/// Whether a missing device is a failure.
pub fn required() -> bool {
    std::env::var("REQUIRE_DEVICE").is_ok_and(|v| v == "1")
}

/// Fails if the validation layer has said anything so far.
pub fn silent() {
    let messages = instance::messages();
    assert!(messages.is_empty(), "the validation layer says:\n{}", messages.join("\n"));
    if required() {
        assert!(instance::shared().unwrap().validated, "the validation layer is not installed");
    }
}
