//! What an integrator hands out.

use glam::Vec3;

/// Light that one path brings to one pixel. A film decides what becomes of it: its steady image is the sum of all values
/// over the number of samples per pixel, whichever pixel's sample found them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contribution {
    /// Column and row; not always those of the sample that found the path (strategies with one camera vertex).
    pub pixel: [u32; 2],
    /// Radiance, already divided by the density with which the path was found and multiplied by its weight.
    pub value: Vec3,
    /// The same without the weight of multiple importance sampling: what this strategy alone would say.
    pub unweighted: Vec3,
    /// Vertices found from the light [Veach 1997, ch. 10]; 0 where the path hit the light by chance.
    pub s: u32,
    /// Vertices found from the camera, the one on the lens included.
    pub t: u32,
    /// Optical length of the path with all its delays, in scene units; 0 where the film has no time axis.
    pub length: f64,
}

impl Contribution {
    /// Edges of the path.
    #[inline]
    pub fn depth(&self) -> u32 {
        self.s + self.t - 1
    }
}
