//! Process-wide choices of device and backend: which device to use, and what `auto` means. A worker
//! of a plan snapshot must resolve `auto` as the plan did, whatever devices its own machine has.

use std::sync::OnceLock;

/// Environment variable that, set to `whole`, makes devices sum splats in fixed point where they
/// could add floats: slower, with identical bits every time.
pub const SPLATS_VARIABLE: &str = "LUMBRE_SPLATS";

/// Environment variable that selects a device by its index or a part of its name, as listed by
/// `lumbre doctor`.
pub const DEVICE_VARIABLE: &str = "LUMBRE_DEVICE";

static DEVICE: OnceLock<String> = OnceLock::new();
static AUTO: OnceLock<&'static str> = OnceLock::new();

/// Sets the device that graphics backends use, an index or a part of its name. Only the first call
/// has an effect. Takes precedence over [`DEVICE_VARIABLE`].
pub fn use_device(name: &str) {
    // The first call wins.
    let _ = DEVICE.set(name.to_owned());
}

/// Returns the device that was set by [`use_device`], or else by [`DEVICE_VARIABLE`].
pub fn device() -> Option<String> {
    DEVICE
        .get()
        .cloned()
        .or_else(|| std::env::var(DEVICE_VARIABLE).ok())
        .filter(|name| !name.is_empty())
}

/// Sets the backend that `auto` means, on the first call.
pub fn set_auto_backend(name: &'static str) {
    // The first call wins.
    let _ = AUTO.set(name);
}

/// Returns the backend that `auto` was set to, if it was.
pub fn auto_backend() -> Option<&'static str> {
    AUTO.get().copied()
}

/// Returns whether splats must be summed in fixed point on every device.
pub fn fixed_point_splats() -> bool {
    std::env::var(SPLATS_VARIABLE).is_ok_and(|word| word == "whole")
}
