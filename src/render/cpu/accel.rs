//! The bounding volume hierarchy and the one traversal loop of the CPU backend.
//!
//! `obvhs` builds a binary tree; it is collapsed here into nodes of four children whose boxes are tested at once.

use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::{Vec3, Vec3A, Vec4};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;

use super::intersect::{self, ShearedRay};
use crate::scene::CompiledScene;
use crate::scene::compile::NONE;
use crate::transport::ray::{Hit, Ray, Trace};
use crate::transport::surface::is_masked_out;

/// Entries of the traversal stack. A tree of four-wide nodes needs three for each level; [`Accel::build`] refuses what
/// does not fit, which only a contrived scene reaches.
const STACK: usize = 96;

/// Widens the far end of a slab test so that rounding never loses a box [Ize 2013].
const SLAB_SLACK: f32 = 1.000_000_5;

/// Up to four children; lane `i` of every vector belongs to child `i`.
#[derive(Clone, Debug)]
struct Node {
    min: [Vec4; 3],
    max: [Vec4; 3],
    /// Index of a node, or of the first entry of `Accel::order` of a leaf.
    child: [u32; 4],
    /// Primitives of a leaf; 0 for an inner node.
    count: [u32; 4],
    /// Bit `i` is set where child `i` exists.
    present: u32,
}

impl Node {
    fn empty() -> Node {
        Node { min: [Vec4::ZERO; 3], max: [Vec4::ZERO; 3], child: [0; 4], count: [0; 4], present: 0 }
    }
}

/// A scene's hierarchy.
pub struct Accel {
    scene: Arc<CompiledScene>,
    nodes: Vec<Node>,
    /// Primitive ids in the order of the leaves.
    order: Vec<u32>,
    /// Corners in the order of the leaves; a sphere's entry is never read.
    corners: Vec<[Vec3; 3]>,
    masked: bool,
    /// Seconds spent building.
    pub build_s: f64,
}

/// Why a hierarchy cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the scene's hierarchy is {levels} levels deep, more than the traversal stack holds")]
pub struct TooDeep {
    /// Levels of four-wide nodes.
    pub levels: usize,
}

impl Accel {
    /// Builds the hierarchy of a scene.
    ///
    /// # Errors
    /// When it is too deep to be traversed.
    pub fn build(scene: Arc<CompiledScene>) -> Result<Accel, TooDeep> {
        let start = Instant::now();
        let boxes: Vec<Aabb> = scene
            .triangles
            .iter()
            .map(|t| Aabb::from_points(&t.map(Vec3A::from)))
            .chain(scene.spheres.iter().map(|s| {
                let (c, r) = (Vec3A::from(s.center), Vec3A::splat(s.radius));
                Aabb::new(c - r, c + r)
            }))
            .collect();
        let mut accel = Accel {
            masked: scene.materials.iter().any(|m| m.mask_texture != NONE),
            nodes: Vec::new(),
            order: Vec::new(),
            corners: Vec::new(),
            build_s: 0.0,
            scene,
        };
        if !boxes.is_empty() {
            let bvh = build_bvh2(&boxes, BvhBuildParams::medium_build(), &mut Duration::default());
            accel.order.clone_from(&bvh.primitive_indices);
            let levels = accel.collapse(&bvh);
            if levels * 3 + 1 > STACK {
                return Err(TooDeep { levels });
            }
        }
        let triangles = &accel.scene.triangles;
        accel.corners = accel.order.iter().map(|p| triangles.get(*p as usize).copied().unwrap_or_default()).collect();
        accel.build_s = start.elapsed().as_secs_f64();
        Ok(accel)
    }

    /// Number of four-wide nodes.
    pub fn node_count(&self) -> usize {
        self.nodes.len()
    }

    /// Turns the binary tree into four-wide nodes and returns the number of levels. The root is node 0.
    fn collapse(&mut self, bvh: &Bvh2) -> usize {
        // Work list of (binary node whose children fill it, wide node, level): no recursion, whatever the depth.
        self.nodes.push(Node::empty());
        let mut work = vec![(0usize, 0usize, 1usize)];
        let mut levels = 0;
        while let Some((binary, wide, level)) = work.pop() {
            levels = levels.max(level);
            let mut children = vec![binary];
            while children.len() < 4 {
                // Open the inner child with the largest surface: it is the one most often hit.
                let area = |i: &usize| bvh.nodes[*i].aabb.half_area();
                let inner = (0..children.len()).filter(|c| bvh.nodes[children[*c]].prim_count == 0);
                let Some(largest) = inner.max_by(|a, b| area(&children[*a]).total_cmp(&area(&children[*b]))) else {
                    break;
                };
                let first = bvh.nodes[children[largest]].first_index as usize;
                children[largest] = first;
                children.push(first + 1);
            }
            for (lane, child) in children.into_iter().enumerate() {
                let source = bvh.nodes[child];
                let index = if source.prim_count == 0 {
                    self.nodes.push(Node::empty());
                    work.push((child, self.nodes.len() - 1, level + 1));
                    self.nodes.len() as u32 - 1
                } else {
                    source.first_index
                };
                let node = &mut self.nodes[wide];
                for axis in 0..3 {
                    node.min[axis][lane] = source.aabb.min[axis];
                    node.max[axis][lane] = source.aabb.max[axis];
                }
                node.child[lane] = index;
                node.count[lane] = source.prim_count;
                node.present |= 1 << lane;
            }
        }
        levels
    }

    /// The nearest hit with `0 < t < t_max`, masks applied.
    pub fn closest(&self, ray: &Ray, t_max: f32) -> Option<Hit> {
        self.traverse::<false>(ray, t_max)
    }

    /// Whether anything is hit with `0 < t < t_max`, masks applied.
    pub fn occluded(&self, ray: &Ray, t_max: f32) -> bool {
        self.traverse::<true>(ray, t_max).is_some()
    }

    /// The traversal loop. With `ANY` it returns at the first hit, otherwise at the nearest.
    fn traverse<const ANY: bool>(&self, ray: &Ray, mut t_max: f32) -> Option<Hit> {
        if self.nodes.is_empty() {
            return None;
        }
        let sheared = ShearedRay::new(ray);
        // A zero component would make 0 * inf = NaN on a box's plane; a tiny one is as good and stays finite.
        let inverse = ray.dir.to_array().map(|d| 1.0 / if d.abs() < 1e-20 { 1e-20f32.copysign(d) } else { d });
        let inverse4 = inverse.map(Vec4::splat);
        let origin4 = ray.origin.to_array().map(Vec4::splat);
        let mut best: Option<Hit> = None;
        // Each entry: a child's index, its primitive count, and the distance at which its box begins.
        let mut stack = [(0u32, 0u32, 0.0f32); STACK];
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let (index, count, begin) = stack[depth];
            if begin >= t_max {
                continue;
            }
            if count > 0 {
                for slot in index as usize..(index + count) as usize {
                    let Some(hit) = self.intersect(slot, ray, &sheared, t_max) else { continue };
                    if self.masked && is_masked_out(&self.scene, ray, &hit) {
                        continue;
                    }
                    if ANY {
                        return Some(hit);
                    }
                    t_max = hit.t;
                    best = Some(hit);
                }
                continue;
            }
            let node = &self.nodes[index as usize];
            let mut near = Vec4::ZERO;
            let mut far = Vec4::splat(t_max);
            for axis in 0..3 {
                let a = (node.min[axis] - origin4[axis]) * inverse4[axis];
                let b = (node.max[axis] - origin4[axis]) * inverse4[axis];
                near = near.max(a.min(b));
                far = far.min(a.max(b) * SLAB_SLACK);
            }
            let near = near.to_array();
            let mut lanes = near.map(|_| 0usize);
            let mut hits = 0;
            let mask = Vec4::from_array(near).cmple(far).bitmask() & node.present;
            for lane in 0..4 {
                if mask & (1 << lane) != 0 {
                    // Farthest first, so that the nearest is on top of the stack.
                    let mut place = hits;
                    while place > 0 && near[lanes[place - 1]] < near[lane] {
                        lanes[place] = lanes[place - 1];
                        place -= 1;
                    }
                    lanes[place] = lane;
                    hits += 1;
                }
            }
            for &lane in &lanes[..hits] {
                stack[depth] = (node.child[lane], node.count[lane], near[lane]);
                depth += 1;
            }
        }
        best
    }

    #[inline(always)]
    fn intersect(&self, slot: usize, ray: &Ray, sheared: &ShearedRay, t_max: f32) -> Option<Hit> {
        let primitive = self.order[slot];
        let triangles = self.scene.triangles.len();
        if (primitive as usize) < triangles {
            let (t, uv) = sheared.triangle(&self.corners[slot], t_max)?;
            Some(Hit { t, primitive, uv })
        } else {
            let t = intersect::sphere(&self.scene.spheres[primitive as usize - triangles], ray, t_max)?;
            Some(Hit { t, primitive, uv: [0.0; 2] })
        }
    }
}

impl Trace for Accel {
    fn closest(&self, ray: &Ray, t_max: f32) -> Option<Hit> {
        Accel::closest(self, ray, t_max)
    }

    fn occluded(&self, ray: &Ray, t_max: f32) -> bool {
        Accel::occluded(self, ray, t_max)
    }
}
