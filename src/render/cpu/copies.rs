//! Copies of meshes in traversal: where a ray enters the tree of a mesh, and what a hit there is worth in the world.

use glam::Vec3;

use super::build::Bounded;
use super::wide::{Node, Root};
use crate::render::entrance::{self, Entrance};
use crate::scene::CompiledScene;
use crate::scene::compile::Instance;
use crate::transport::ray::Ray;

/// A copy as traversal sees it.
#[derive(Clone, Debug)]
pub(super) struct Place {
    entrance: Entrance,
    /// Where rays enter the mesh's tree.
    pub root: u32,
}

impl Place {
    pub fn new(instance: &Instance, mesh: &Root) -> Place {
        let corners = [mesh.aabb.min.into(), mesh.aabb.max.into()];
        Place { entrance: Entrance::new(instance, corners), root: mesh.index }
    }

    /// The ray in the mesh's space.
    #[inline(always)]
    pub fn enter(&self, ray: &Ray) -> Ray {
        self.entrance.enter(ray)
    }
}

/// The box of a copy in the world.
pub(super) fn bounded(instance: &Instance, mesh: &Root, root: Option<&Node>) -> Bounded {
    let [low, high] = match root {
        Some(node) => entrance::bounds(instance, node.boxes()),
        None => entrance::bounds(instance, [[mesh.aabb.min.into(), mesh.aabb.max.into()]]),
    };
    Bounded::boxed(low.into(), high.into())
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
