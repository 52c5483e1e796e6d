//! The compressed eight-wide tree of `obvhs` and its own traversal, to be compared with ours.

use glam::Vec3A;
use obvhs::cwbvh::CwBvh;
use obvhs::ray::{Ray as TheirRay, RayHit};

use super::accel::world;
use super::packed;
use crate::render::hierarchy::AccelSpec;
use crate::scene::CompiledScene;
use crate::transport::ray::Ray;

/// A tree over the triangles and spheres of a scene without copies.
pub(super) struct Compressed {
    bvh: CwBvh,
}

impl Compressed {
    /// Entries of the stack of `obvhs`, one for each level.
    pub const STACK: usize = 32;

    /// Builds it.
    pub fn new(scene: &CompiledScene, spec: &AccelSpec) -> Compressed {
        Compressed { bvh: packed::packed(spec, &world(scene), spec.max_leaf) }
    }

    /// Number of nodes.
    pub fn node_count(&self) -> usize {
        self.bvh.nodes.len()
    }

    /// Bytes of nodes, indices, and the scene's own corners and spheres, which this traversal reads.
    pub fn bytes(&self, scene: &CompiledScene) -> usize {
        size_of_val(self.bvh.nodes.as_slice())
            + size_of_val(self.bvh.primitive_indices.as_slice())
            + size_of_val(scene.triangles.as_slice())
            + size_of_val(scene.spheres.as_slice())
    }

    /// Levels of nodes.
    pub fn levels(&self) -> usize {
        packed::levels(&self.bvh)
    }

    /// What a ray costs that meets the scene's box, by the surface area heuristic: one for each node and each primitive.
    pub fn cost(&self) -> f64 {
        packed::cost(&self.bvh, |_| 1.0)
    }

    /// Calls `test` for the primitives near the ray, until it says that what it found ends the search. `test` gets a
    /// primitive's index and returns the distance beyond which nothing matters any more.
    pub fn traverse(&self, ray: &Ray, t_max: f32, any: bool, mut test: impl FnMut(u32) -> Option<f32>) {
        // A negative zero has a negative inverse there, but counts as going up: adding zero makes it a positive one.
        let dir = Vec3A::from(ray.dir) + Vec3A::ZERO;
        let theirs = TheirRay::new(Vec3A::from(ray.origin), dir, 0.0, t_max);
        let index = |id: usize| self.bvh.primitive_indices[id];
        if any {
            // Any number below the ray's end stops it.
            self.bvh.ray_traverse_miss(theirs, |_, id| test(index(id)).map_or(f32::INFINITY, |_| f32::NEG_INFINITY));
        } else {
            let mut hit = RayHit::none();
            self.bvh.ray_traverse(theirs, &mut hit, |_, id| test(index(id)).unwrap_or(f32::INFINITY));
        }
    }
}
