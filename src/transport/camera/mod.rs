//! Cameras and pixel filters.

/// A pixel filter, sampled by importance: every sample has weight one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterSpec {
    /// Its shape.
    pub kind: FilterKind,
    /// Half width in pixels: a box of radius 0.5 is the pixel; a Gaussian is cut off here, at three sigma.
    pub radius: f32,
}

/// The shapes of pixel filters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilterKind {
    /// Constant.
    Box,
    /// Gaussian with sigma a third of the radius, truncated at the radius.
    Gauss,
}
