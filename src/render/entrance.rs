//! How rays enter the space of a mesh that is kept once: the same for whoever traverses its tree.

use glam::{Mat3, Vec3};

use crate::scene::compile::Instance;
use crate::transport::ray::Ray;

/// Part of the greatest coordinate by which a copy's box is widened, since rays are taken into its space with rounding.
const MARGIN: f32 = 4e-6;

/// The way into the space of a copy's mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entrance {
    /// From directions of the world to those of the mesh.
    pub inverse: Mat3,
    /// The middle of the mesh's box, in the world and in the mesh's space: differences to it keep their digits wherever
    /// the copy stands.
    pub pivot: [Vec3; 2],
}

impl Entrance {
    /// Into a copy of a mesh whose box has these corners.
    pub fn new(instance: &Instance, [low, high]: [Vec3; 2]) -> Entrance {
        let middle = low + (high - low) * 0.5;
        Entrance { inverse: instance.to_world.matrix3.inverse().as_mat3(), pivot: [instance.point(middle), middle] }
    }

    /// The ray in the mesh's space. Its direction is no unit vector, so that distances are the same numbers as in the world.
    #[inline(always)]
    pub fn enter(&self, ray: &Ray) -> Ray {
        let [world, own] = self.pivot;
        Ray { origin: self.inverse * (ray.origin - world) + own, dir: self.inverse * ray.dir }
    }
}

/// Least and greatest corner of the box of a copy in the world, around boxes that hold its mesh: those of its tree's first
/// nodes make it tighter than one alone.
pub fn bounds(instance: &Instance, boxes: impl IntoIterator<Item = [Vec3; 2]>) -> [Vec3; 2] {
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for [least, greatest] in boxes {
        for i in 0..8u32 {
            let pick = |axis: usize| if i >> axis & 1 == 0 { least[axis] } else { greatest[axis] };
            let p = instance.point(Vec3::new(pick(0), pick(1), pick(2)));
            (low, high) = (low.min(p), high.max(p));
        }
    }
    let margin = Vec3::splat(low.abs().max(high.abs()).max_element() * MARGIN);
    [low - margin, high + margin]
}
