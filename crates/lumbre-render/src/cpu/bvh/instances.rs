//! Instances of meshes in traversal: transforms rays into a mesh's space, and computes distances of
//! hits in world space.
//!
//! Invariant: every distance that traversal returns or compares with the best hit is in world
//! space. Distances in a mesh's space only select candidates.

use glam::Vec3;

use super::build_primitive::BuildPrimitive;
use super::bvh8::{Node, TreeRoot};
use crate::instance_transform;
use crate::instance_transform::InstanceTransform;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::Instance;
use lumbre_light::transport::ray::Ray;

/// Instance of a mesh: how rays enter its tree.
#[derive(Clone, Debug)]
pub(crate) struct MeshInstance {
    transform: InstanceTransform,
    /// Root of the mesh's tree, as in [`Node::child`](super::bvh8::Node::child).
    pub root: u32,
}

impl MeshInstance {
    /// Prepares an instance of a mesh for traversal.
    pub fn new(instance: &Instance, mesh: &TreeRoot) -> MeshInstance {
        let corners = [mesh.aabb.min.into(), mesh.aabb.max.into()];
        MeshInstance {
            transform: InstanceTransform::new(instance, corners),
            root: mesh.index,
        }
    }

    /// Transforms a ray into the mesh's space.
    #[inline(always)]
    pub fn to_mesh_space(&self, ray: &Ray) -> Ray {
        self.transform.apply(ray)
    }
}

/// Returns the box of an instance in world space. If the mesh has a root node, the boxes of its
/// children give tighter bounds than its own box.
pub(crate) fn instance_bounds(
    instance: &Instance,
    mesh: &TreeRoot,
    root: Option<&Node>,
) -> BuildPrimitive {
    let [low, high] = match root {
        Some(node) => instance_transform::world_bounds(instance, node.boxes()),
        None => instance_transform::world_bounds(
            instance,
            [[mesh.aabb.min.into(), mesh.aabb.max.into()]],
        ),
    };
    BuildPrimitive::from_box(low.into(), high.into())
}

/// Returns the distance at which a ray meets the plane of an instance's triangle in world space,
/// computed in double precision; zero or negative if the plane is behind the origin. The distance
/// in the mesh's space is less accurate because of the transform, so that a ray could hit the
/// surface that it leaves.
#[inline]
pub(crate) fn distance(scene: &CompiledScene, ray: &Ray, primitive: u32, instance: u32) -> f32 {
    let [a, b, c] = scene.corners(primitive, instance).map(Vec3::as_dvec3);
    let normal = (b - a).cross(c - a);
    let (origin, dir) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
    (normal.dot(a - origin) / normal.dot(dir)) as f32
}
