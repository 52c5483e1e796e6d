//! The output of an integrator.

use glam::Vec3;

/// Light of one path that reaches one pixel. The film accumulates it: the steady image is the sum
/// of all values over the number of samples per pixel, regardless of which pixel's sample found
/// them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contribution {
    /// Column and row; may differ from those of the sample that found the path (strategies with one
    /// camera vertex).
    pub pixel: [u32; 2],
    /// Radiance, already divided by the density with which the path was found and multiplied by its
    /// weight.
    pub value: Vec3,
    /// Value without the weight of multiple importance sampling: the estimate of this strategy
    /// alone.
    pub unweighted: Vec3,
    /// Number of vertices generated from the light [Veach 1997, ch. 10]; 0 if the path hit the
    /// light by chance.
    pub s: u32,
    /// Number of vertices generated from the camera, including the one on the lens.
    pub t: u32,
    /// Optical length of the path with all its delays, in scene units; 0 if the film has no time
    /// axis.
    pub length: f64,
}

impl Contribution {
    /// Returns the number of edges of the path.
    #[inline]
    pub fn depth(&self) -> u32 {
        self.s + self.t - 1
    }
}
