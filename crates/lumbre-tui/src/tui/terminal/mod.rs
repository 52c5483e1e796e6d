//! Access to the terminal: capabilities, acquiring and restoring it, input, graphics and device
//! gauges.

pub mod device_gauges;
pub mod full_screen;
pub mod graphics_protocols;
pub mod offscreen;
pub mod terminal_caps;
pub mod terminal_guard;
