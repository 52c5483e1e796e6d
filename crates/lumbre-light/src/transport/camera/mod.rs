//! Cameras and pixel filters.

pub mod filter;
pub mod lens;

pub use filter::{FILTER_NAMES, FILTERS, FilterKind, FilterSpec};
pub use lens::{Camera, CameraConnection};
