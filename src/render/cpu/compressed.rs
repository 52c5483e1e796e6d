//! The compressed eight-wide tree of `obvhs` and its own traversal, to be compared with ours.

use std::time::Duration;

use glam::Vec3A;
use obvhs::aabb::Aabb;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh;
use obvhs::ray::{Ray as TheirRay, RayHit};

use super::accel::world;
use super::build::{Bounded, params};
use crate::render::hierarchy::AccelSpec;
use crate::scene::CompiledScene;
use crate::transport::ray::Ray;

/// Most primitives of a leaf that the compressed form can say.
const MOST: u32 = 3;

/// A tree over the triangles and spheres of a scene without copies.
pub(super) struct Compressed {
    bvh: CwBvh,
    of: usize,
}

impl Compressed {
    /// Entries of the stack of `obvhs`, one for each level.
    pub const STACK: usize = 32;

    /// Builds it.
    pub fn new(scene: &CompiledScene, spec: &AccelSpec) -> Compressed {
        let boxes: Vec<Aabb> = world(scene).iter().map(|b: &Bounded| b.aabb).collect();
        let params = obvhs::BvhBuildParams { max_prims_per_leaf: spec.max_leaf.min(MOST), ..params(spec.quality) };
        let bvh =
            if boxes.is_empty() { CwBvh::default() } else { build_cwbvh(&boxes, params, &mut Duration::default()) };
        Compressed { bvh, of: boxes.len() }
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
        let mut open: Vec<(usize, usize)> = self.bvh.nodes.first().map(|_| (0, 1)).into_iter().collect();
        let mut deepest = 0;
        while let Some((node, level)) = open.pop() {
            deepest = deepest.max(level);
            let node = &self.bvh.nodes[node];
            let children = node.imask.count_ones() as usize;
            open.extend((0..children).map(|i| (node.child_base_idx as usize + i, level + 1)));
        }
        deepest
    }

    /// What a ray costs that meets the scene's box, by the surface area heuristic: one for each node and each primitive.
    pub fn cost(&self) -> f64 {
        let whole = f64::from(self.bvh.total_aabb.half_area());
        if self.bvh.nodes.is_empty() || whole <= 0.0 {
            return self.of as f64;
        }
        let mut sum = whole;
        for node in &self.bvh.nodes {
            for child in (0..8).filter(|child| !node.is_child_empty(*child)) {
                let area = f64::from(node.child_aabb(child).half_area());
                sum += area * if node.is_leaf(child) { f64::from(node.child_primitives(child).1) } else { 1.0 };
            }
        }
        sum / whole
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
