//! What an integrator hands out.

use glam::Vec3;

/// Light that one path brings to one pixel. A film decides what becomes of it: its steady image is the sum of all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contribution {
    /// Column and row.
    pub pixel: [u32; 2],
    /// Radiance, already divided by the density with which the path was found.
    pub value: Vec3,
    /// Edges of the path.
    pub depth: u32,
}
