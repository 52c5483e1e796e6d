//! The compressed eight-wide tree of `obvhs`, traversed by `obvhs`, for comparison with the default
//! tree. It does not support instances; the scene must be flattened.

use glam::Vec3A;
use obvhs::cwbvh::CwBvh;
use obvhs::ray::{Ray as ObvhsRay, RayHit};

use super::accel::world_primitives;
use super::packed;
use crate::hierarchy::AccelSpec;
use lumbre_light::scene::CompiledScene;
use lumbre_light::transport::ray::Ray;

/// Tree over the triangles and spheres of a scene without instances.
pub(crate) struct Compressed {
    bvh: CwBvh,
}

impl Compressed {
    /// Number of levels for which the traversal stack of `obvhs` has space.
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

    /// Returns the size in bytes of nodes, primitive indices, and the scene's triangles and
    /// spheres, which this traversal reads.
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
    /// heuristic: 1 for each visited node and 1 for each tested primitive.
    pub fn cost(&self) -> f64 {
        packed::cost(&self.bvh, |_| 1.0)
    }

    /// Calls `test` with the index of each primitive whose box the ray may hit. `test` returns
    /// `None` without a hit, and otherwise the distance beyond which primitives need not be tested.
    /// With `any` the first hit ends the search.
    pub fn traverse(
        &self,
        ray: &Ray,
        t_max: f32,
        any: bool,
        mut test: impl FnMut(u32) -> Option<f32>,
    ) {
        // `obvhs` uses the negative inverse of a negative zero, but treats the component as
        // increasing. Adding zero makes it positive.
        let dir = Vec3A::from(ray.dir) + Vec3A::ZERO;
        let query = ObvhsRay::new(Vec3A::from(ray.origin), dir, 0.0, t_max);
        let index = |id: usize| self.bvh.primitive_indices[id];
        if any {
            // A distance below `t_max` ends the search.
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
