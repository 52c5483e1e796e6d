//! Cameras and pixel filters.

pub mod filter;
pub mod lens;

pub use filter::{FilterKind, FilterSpec};
pub use lens::Camera;
