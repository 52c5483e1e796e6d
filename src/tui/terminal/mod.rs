//! Access to the terminal: capabilities, acquiring and restoring it, graphics and device gauges.

pub mod device_gauges;
pub mod graphics_protocols;
pub mod offscreen;
pub mod terminal_caps;
pub mod terminal_guard;
