//! Cameras and pixel filters.

pub mod filter;
pub mod lens;
mod orthographic;
mod spherical;

pub use filter::{FILTER_NAMES, FILTERS, FilterKind, FilterSpec};
pub use lens::{Camera, CameraConnection};
