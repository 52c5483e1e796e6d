//! What one process was told of devices for all its time: which to use, and what `auto` means. A worker of a frozen plan
//! must mean by `auto` what the plan meant, whatever it finds on its own machine.

use std::sync::OnceLock;

/// Set to `whole`, it lets devices sum splats in whole numbers where they could add floats: slower, and the same bits every
/// time.
pub const SPLATS_VARIABLE: &str = "LUMBRE_SPLATS";

static DEVICE: OnceLock<String> = OnceLock::new();
static AUTO: OnceLock<&'static str> = OnceLock::new();

/// Says which device graphics backends use: an index or a part of its name. Said once; it goes before the variable
/// `LUMBRE_DEVICE`.
pub fn use_device(name: &str) {
    // Said twice, the first word counts.
    let _ = DEVICE.set(name.to_owned());
}

/// The device that was said, or that the variable names.
pub fn device(variable: &str) -> Option<String> {
    DEVICE.get().cloned().or_else(|| std::env::var(variable).ok()).filter(|name| !name.is_empty())
}

/// Says what `auto` means; names that no backend has are passed over.
pub fn settle_auto(name: &str) {
    if let Some(row) = super::BACKENDS.iter().find(|row| row.name == name) {
        // Said twice, the first word counts.
        let _ = AUTO.set(row.name);
    }
}

/// What `auto` was said to mean.
pub fn auto() -> Option<&'static str> {
    AUTO.get().copied()
}

/// Whether splats are to be whole numbers on every device.
pub fn whole_splats() -> bool {
    std::env::var(SPLATS_VARIABLE).is_ok_and(|word| word == "whole")
}
