//! The compressed eight-wide tree of `obvhs` with its own traversal, for comparison with the
//! default one.

use glam::Vec3A;
use obvhs::cwbvh::CwBvh;
use obvhs::ray::{Ray as ObvhsRay, RayHit};

use super::accel::world_primitives;
use super::packed;
use crate::render::hierarchy::AccelSpec;
use crate::scene::CompiledScene;
use crate::transport::ray::Ray;

/// Tree over the triangles and spheres of a scene without instances.
pub(crate) struct Compressed {
    bvh: CwBvh,
}

impl Compressed {
    /// Size of the traversal stack of `obvhs`, in levels.
    pub const STACK: usize = 32;

    /// Builds the tree of a scene.
    pub fn new(scene: &CompiledScene, spec: &AccelSpec) -> Compressed {
        Compressed {
            bvh: packed::build_packed(spec, &world_primitives(scene), spec.max_leaf),
        }
    }

    /// Returns the number of nodes.
    pub fn node_count(&self) -> usize {
        self.bvh.nodes.len()
    }

    /// Returns the size in bytes of nodes, indices, and the scene's triangles and spheres, which
    /// this traversal reads directly.
    pub fn bytes(&self, scene: &CompiledScene) -> usize {
        size_of_val(self.bvh.nodes.as_slice())
            + size_of_val(self.bvh.primitive_indices.as_slice())
            + size_of_val(scene.triangles.as_slice())
            + size_of_val(scene.spheres.as_slice())
    }

    /// Returns the number of levels of nodes.
    pub fn levels(&self) -> usize {
        packed::levels(&self.bvh)
    }

    /// Returns the expected cost of a ray that meets the scene's box, by the surface area
    /// heuristic: one for each node and each primitive.
    pub fn cost(&self) -> f64 {
        packed::cost(&self.bvh, |_| 1.0)
    }

    /// Calls `test` with the index of each primitive near the ray; `test` returns the new distance
    /// beyond which nothing matters if it found a hit. With `any` the first hit ends the search.
    pub fn traverse(
        &self,
        ray: &Ray,
        t_max: f32,
        any: bool,
        mut test: impl FnMut(u32) -> Option<f32>,
    ) {
        // `obvhs` takes the inverse of a negative zero as negative but treats it as increasing;
        // adding zero makes it positive.
        let dir = Vec3A::from(ray.dir) + Vec3A::ZERO;
        let query = ObvhsRay::new(Vec3A::from(ray.origin), dir, 0.0, t_max);
        let index = |id: usize| self.bvh.primitive_indices[id];
        if any {
            // Any number below the ray's end ends the search.
            self.bvh.ray_traverse_miss(query, |_, id| {
                test(index(id)).map_or(f32::INFINITY, |_| f32::NEG_INFINITY)
            });
        } else {
            let mut hit = RayHit::none();
            self.bvh.ray_traverse(query, &mut hit, |_, id| {
                test(index(id)).unwrap_or(f32::INFINITY)
            });
        }
    }
}
