//! Copies of meshes in traversal: how a ray enters the space of a mesh, and what a hit there is worth in the world.

use glam::{Mat3, Vec3, Vec3A};

use super::build::Bounded;
use super::wide::{Node, Root};
use crate::scene::CompiledScene;
use crate::scene::compile::Instance;
use crate::transport::ray::Ray;

/// Part of the greatest coordinate by which a copy's box is widened, since rays are taken into its space with rounding.
const MARGIN: f32 = 4e-6;

/// A copy as traversal sees it.
#[derive(Clone, Debug)]
pub(super) struct Place {
    /// From directions of the world to those of the mesh.
    inverse: Mat3,
    /// The middle of the mesh's box, in the world and in the mesh's space: differences to it keep their digits wherever
    /// the copy stands.
    pivot: [Vec3; 2],
    /// Where rays enter the mesh's tree.
    pub root: u32,
}

impl Place {
    pub fn new(instance: &Instance, mesh: &Root) -> Place {
        let middle = Vec3::from(mesh.aabb.min + (mesh.aabb.max - mesh.aabb.min) * 0.5);
        Place {
            inverse: instance.to_world.matrix3.inverse().as_mat3(),
            pivot: [instance.point(middle), middle],
            root: mesh.index,
        }
    }

    /// The ray in the mesh's space. Its direction is no unit vector, so that distances are the same numbers as in the world.
    #[inline(always)]
    pub fn enter(&self, ray: &Ray) -> Ray {
        let [world, own] = self.pivot;
        Ray { origin: self.inverse * (ray.origin - world) + own, dir: self.inverse * ray.dir }
    }
}

/// The box of a copy in the world: around the boxes of its tree's first nodes, which is tighter than around the corners of
/// one box alone.
pub(super) fn bounded(instance: &Instance, mesh: &Root, root: Option<&Node>) -> Bounded {
    let (mut low, mut high) = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
    let mut add = |[least, greatest]: [Vec3; 2]| {
        for i in 0..8u32 {
            let pick = |axis: usize| if i >> axis & 1 == 0 { least[axis] } else { greatest[axis] };
            let p = Vec3A::from(instance.point(Vec3::new(pick(0), pick(1), pick(2))));
            (low, high) = (low.min(p), high.max(p));
        }
    };
    match root {
        Some(node) => node.boxes().for_each(&mut add),
        None => add([mesh.aabb.min.into(), mesh.aabb.max.into()]),
    }
    let margin = Vec3A::splat(low.abs().max(high.abs()).max_element() * MARGIN);
    Bounded::boxed(low - margin, high + margin)
}

/// The distance at which a ray meets the plane of a copy's triangle as it lies in the world, in double precision; not
/// above zero where it starts behind. What the mesh's space says of the distance has lost digits to the way there, which
/// next to a surface would decide whether a ray meets the surface that it leaves.
#[inline]
pub(super) fn distance(scene: &CompiledScene, ray: &Ray, primitive: u32, instance: u32) -> f32 {
    let [a, b, c] = scene.corners(primitive, instance).map(Vec3::as_dvec3);
    let normal = (b - a).cross(c - a);
    let (origin, dir) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
    (normal.dot(a - origin) / normal.dot(dir)) as f32
}
