//! The bounding volume hierarchy and the one traversal loop of the CPU backend.
//!
//! `obvhs` builds a binary tree; it is collapsed here into nodes of four children whose boxes are tested at once.

use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::{Vec3A, Vec4};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;

use super::intersect::{self, LANES, ShearedRay, TriangleBlock};
use crate::scene::CompiledScene;
use crate::scene::compile::NONE;
use crate::transport::ray::{Hit, Ray, Trace};
use crate::transport::surface::is_masked_out;

/// Entries of the traversal stack. A tree of four-wide nodes needs three for each level; [`Accel::build`] refuses what
/// does not fit, which only a contrived scene reaches.
const STACK: usize = 64;

/// Widens the far end of a slab test so that rounding never loses a box [Ize 2013].
const SLAB_SLACK: f32 = 1.000_000_5;

/// Marks a child that is a leaf: the rest is the index of its first block.
const LEAF: u32 = 1 << 31;

/// Up to four children; lane `i` of every vector belongs to child `i`.
#[derive(Clone, Debug)]
struct Node {
    /// Least and greatest coordinates, by axis. A child that is not there has a box that begins behind its end.
    bounds: [[Vec4; 3]; 2],
    /// Index of a node, or of a block with [`LEAF`] set.
    child: [u32; 4],
}

impl Node {
    fn empty() -> Node {
        Node { bounds: [[Vec4::INFINITY; 3], [Vec4::NEG_INFINITY; 3]], child: [0; 4] }
    }
}

/// Primitives of a leaf that are tested together.
#[derive(Clone, Debug)]
struct Block {
    triangles: TriangleBlock,
    /// The id of each lane's primitive.
    primitives: [u32; LANES],
    /// Bit `i` is set where lane `i` is a sphere.
    spheres: u32,
    /// Whether this is the last block of its leaf.
    last: bool,
}

/// A scene's hierarchy.
pub struct Accel {
    scene: Arc<CompiledScene>,
    nodes: Vec<Node>,
    blocks: Vec<Block>,
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
            blocks: Vec::new(),
            build_s: 0.0,
            scene,
        };
        if !boxes.is_empty() {
            let params = BvhBuildParams { max_prims_per_leaf: LANES as u32, ..BvhBuildParams::medium_build() };
            let bvh = build_bvh2(&boxes, params, &mut Duration::default());
            let levels = accel.collapse(&bvh);
            if levels * 3 + 1 > STACK {
                return Err(TooDeep { levels });
            }
        }
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
                    let first = source.first_index as usize;
                    self.push_leaf(&bvh.primitive_indices[first..first + source.prim_count as usize])
                };
                let node = &mut self.nodes[wide];
                for axis in 0..3 {
                    node.bounds[0][axis][lane] = source.aabb.min[axis];
                    node.bounds[1][axis][lane] = source.aabb.max[axis];
                }
                node.child[lane] = index;
            }
        }
        levels
    }

    /// Adds the blocks of a leaf and returns what a node says of it.
    fn push_leaf(&mut self, primitives: &[u32]) -> u32 {
        let first = self.blocks.len() as u32;
        for chunk in primitives.chunks(LANES) {
            let at = |lane: usize| chunk.get(lane).copied();
            let triangle = |lane| at(lane).and_then(|p| self.scene.triangles.get(p as usize).copied());
            let is_sphere = |lane: usize| at(lane).is_some_and(|p| p as usize >= self.scene.triangles.len());
            self.blocks.push(Block {
                triangles: TriangleBlock::new([0, 1, 2, 3].map(triangle)),
                primitives: [0, 1, 2, 3].map(|lane| at(lane).unwrap_or(NONE)),
                spheres: (0..LANES).map(|lane| u32::from(is_sphere(lane)) << lane).sum(),
                last: false,
            });
        }
        if let Some(block) = self.blocks.last_mut() {
            block.last = true;
        }
        first | LEAF
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
        let origin4 = ray.origin.to_array().map(Vec4::splat);
        let inverse4 = inverse.map(Vec4::splat);
        // Which bound a ray meets first on each axis.
        let [x, y, z] = inverse.map(|d| usize::from(d < 0.0));
        let mut best: Option<Hit> = None;
        // Each entry: a child, and the distance at which its box begins.
        let mut stack = [(0u32, 0.0f32); STACK];
        let mut depth = 0;
        let mut current = 0;
        loop {
            if current & LEAF != 0 {
                if let Some(hit) = self.leaf::<ANY>(current & !LEAF, ray, &sheared, t_max) {
                    if ANY {
                        return Some(hit);
                    }
                    t_max = hit.t;
                    best = Some(hit);
                }
            } else {
                let node = &self.nodes[current as usize];
                let plane = |bounds: usize, axis: usize| (node.bounds[bounds][axis] - origin4[axis]) * inverse4[axis];
                let near = plane(x, 0).max(plane(y, 1)).max(plane(z, 2)).max(Vec4::ZERO);
                let far = plane(1 - x, 0).min(plane(1 - y, 1)).min(plane(1 - z, 2)) * SLAB_SLACK;
                let mut met = near.cmple(far.min(Vec4::splat(t_max))).bitmask();
                let near = near.to_array();
                // The nearest child is next; the others wait, farthest first.
                if met != 0 && met & (met - 1) == 0 {
                    current = node.child[met.trailing_zeros() as usize & 3];
                    continue;
                }
                if met != 0 {
                    let first = depth;
                    while met != 0 {
                        let lane = met.trailing_zeros() as usize & 3;
                        met &= met - 1;
                        let mut place = depth;
                        while place > first && stack[place - 1].1 < near[lane] {
                            stack[place] = stack[place - 1];
                            place -= 1;
                        }
                        stack[place] = (node.child[lane], near[lane]);
                        depth += 1;
                    }
                    depth -= 1;
                    current = stack[depth].0;
                    continue;
                }
            }
            loop {
                if depth == 0 {
                    return best;
                }
                depth -= 1;
                if stack[depth].1 < t_max {
                    current = stack[depth].0;
                    break;
                }
            }
        }
    }

    /// The nearest hit in the blocks of a leaf, or with `ANY` some hit.
    #[inline(always)]
    fn leaf<const ANY: bool>(&self, first: u32, ray: &Ray, sheared: &ShearedRay, mut t_max: f32) -> Option<Hit> {
        let mut best = None;
        for block in &self.blocks[first as usize..] {
            let found = block.triangles.intersect(sheared, t_max);
            let mut lanes = found.lanes | block.spheres;
            while lanes != 0 {
                let lane = lanes.trailing_zeros() as usize & 3;
                lanes &= lanes - 1;
                let primitive = block.primitives[lane];
                let hit = if block.spheres & (1 << lane) != 0 {
                    let sphere = &self.scene.spheres[primitive as usize - self.scene.triangles.len()];
                    let Some(t) = intersect::sphere(sphere, ray, t_max) else { continue };
                    Hit { t, primitive, uv: [0.0; 2] }
                } else if found.t(lane) < t_max {
                    Hit { t: found.t(lane), primitive, uv: found.uv(lane) }
                } else {
                    continue;
                };
                if self.masked && is_masked_out(&self.scene, ray, &hit) {
                    continue;
                }
                if ANY {
                    return Some(hit);
                }
                t_max = hit.t;
                best = Some(hit);
            }
            if block.last {
                break;
            }
        }
        best
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
