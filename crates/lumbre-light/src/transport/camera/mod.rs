//! Cameras and pixel filters.

pub mod filter;
pub mod lens;
mod orthographic;
mod spherical;

pub use filter::{FilterKind, FilterSpec};
pub use lens::{Camera, CameraConnection};
