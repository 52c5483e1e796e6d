//! The bounding volume hierarchy of the CPU backend: how it is built and how it lies in memory. The loop that runs through
//! it is in `traverse`.
//!
//! `obvhs` builds a binary tree; it is collapsed here into nodes of eight children whose boxes are tested at once, and
//! leaves of blocks of eight primitives that are tested at once.

use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;

use super::intersect::TriangleBlock;
use super::lanes::{Isa, LANES, Row};
use crate::scene::CompiledScene;
use crate::scene::compile::NONE;

/// Entries of the traversal stack. A tree of eight-wide nodes needs seven for each level; [`Accel::build`] refuses what
/// does not fit, which only a contrived scene reaches.
pub(super) const STACK: usize = 256;

/// Scenes of no more primitives are one leaf: testing all of them costs less than finding out which.
const ONE_LEAF: usize = 2 * LANES;

/// Marks a child that is a leaf: the rest is the index of its first block.
pub(super) const LEAF: u32 = 1 << 31;

/// Up to eight children; lane `i` of every row belongs to child `i`.
#[derive(Clone, Debug)]
pub(super) struct Node {
    /// Least and greatest coordinates, by axis. A child that is not there has a box that begins behind its end.
    pub bounds: [[Row; 3]; 2],
    /// Index of a node, or of a block with [`LEAF`] set.
    pub child: [u32; LANES],
}

impl Node {
    fn empty() -> Node {
        Node { bounds: [[Row([f32::INFINITY; LANES]); 3], [Row([f32::NEG_INFINITY; LANES]); 3]], child: [0; LANES] }
    }
}

/// Primitives of a leaf that are tested together.
#[derive(Clone, Debug)]
pub(super) struct Block {
    pub triangles: TriangleBlock,
    /// The id of each lane's primitive.
    pub primitives: [u32; LANES],
    /// Bit `i` is set where lane `i` is a sphere.
    pub spheres: u32,
    /// Whether this is the last block of its leaf.
    pub last: bool,
}

/// A scene's hierarchy.
pub struct Accel {
    pub(super) scene: Arc<CompiledScene>,
    /// Where rays begin: a node or a leaf, as in [`Node::child`].
    pub(super) root: u32,
    pub(super) nodes: Vec<Node>,
    pub(super) blocks: Vec<Block>,
    pub(super) masked: bool,
    pub(super) isa: Isa,
    /// Seconds spent building.
    pub build_s: f64,
}

/// Why a hierarchy cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the scene's hierarchy is {levels} levels deep, more than the traversal stack holds")]
pub struct TooDeep {
    /// Levels of eight-wide nodes.
    pub levels: usize,
}

impl Accel {
    /// Builds the hierarchy of a scene, to be traversed with the widest vectors that the processor has.
    ///
    /// # Errors
    /// When it is too deep to be traversed.
    pub fn build(scene: Arc<CompiledScene>) -> Result<Accel, TooDeep> {
        Accel::build_for(scene, Isa::detect())
    }

    /// The same for a set of instructions, one of [`Isa::available`]; for another the portable ones are used. Whatever
    /// it is, hits have the same bits.
    ///
    /// # Errors
    /// When it is too deep to be traversed.
    pub fn build_for(scene: Arc<CompiledScene>, isa: Isa) -> Result<Accel, TooDeep> {
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
            root: LEAF,
            nodes: Vec::new(),
            blocks: Vec::new(),
            isa: if Isa::available().contains(&isa) { isa } else { Isa::Portable },
            build_s: 0.0,
            scene,
        };
        if boxes.len() <= ONE_LEAF {
            let all: Vec<u32> = (0..boxes.len() as u32).collect();
            accel.root = accel.push_leaf(&all);
        } else {
            let params = BvhBuildParams { max_prims_per_leaf: LANES as u32, ..BvhBuildParams::medium_build() };
            let bvh = build_bvh2(&boxes, params, &mut Duration::default());
            let levels = accel.collapse(&bvh);
            if levels * (LANES - 1) + 1 > STACK {
                return Err(TooDeep { levels });
            }
        }
        accel.build_s = start.elapsed().as_secs_f64();
        Ok(accel)
    }

    /// Number of eight-wide nodes.
    pub fn node_count(&self) -> usize {
        self.nodes.len()
    }

    /// Bytes of nodes and primitives as traversal reads them.
    pub fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice()) + size_of_val(self.blocks.as_slice())
    }

    /// The instructions that traverse it.
    pub fn isa(&self) -> Isa {
        self.isa
    }

    /// Turns the binary tree into eight-wide nodes and returns the number of levels.
    fn collapse(&mut self, bvh: &Bvh2) -> usize {
        let counts = Subtrees::new(bvh);
        if counts.fits_a_block(0) {
            self.root = self.push_leaf(&counts.primitives(bvh, 0));
            return 0;
        }
        self.root = 0;
        // Work list of (binary node whose children fill it, wide node, level): no recursion, whatever the depth.
        self.nodes.push(Node::empty());
        let mut work = vec![(0usize, 0usize, 1usize)];
        let mut levels = 0;
        while let Some((binary, wide, level)) = work.pop() {
            levels = levels.max(level);
            let mut children = [0; LANES];
            let count = counts.open(bvh, binary, &mut children);
            for (lane, child) in children[..count].iter().copied().enumerate() {
                let index = if counts.fits_a_block(child) || bvh.nodes[child].prim_count > 0 {
                    self.push_leaf(&counts.primitives(bvh, child))
                } else {
                    self.nodes.push(Node::empty());
                    work.push((child, self.nodes.len() - 1, level + 1));
                    self.nodes.len() as u32 - 1
                };
                let aabb = bvh.nodes[child].aabb;
                let node = &mut self.nodes[wide];
                for axis in 0..3 {
                    node.bounds[0][axis].0[lane] = aabb.min[axis];
                    node.bounds[1][axis].0[lane] = aabb.max[axis];
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
                triangles: TriangleBlock::new(std::array::from_fn(triangle)),
                primitives: std::array::from_fn(|lane| at(lane).unwrap_or(NONE)),
                spheres: (0..LANES).map(|lane| u32::from(is_sphere(lane)) << lane).sum(),
                last: false,
            });
        }
        if let Some(block) = self.blocks.last_mut() {
            block.last = true;
        }
        first | LEAF
    }
}

/// How many primitives lie below each node of a binary tree.
struct Subtrees(Vec<u32>);

impl Subtrees {
    fn new(bvh: &Bvh2) -> Subtrees {
        let mut counts = vec![0; bvh.nodes.len()];
        let mut order = vec![0usize];
        let mut next = 0;
        while next < order.len() {
            let node = &bvh.nodes[order[next]];
            if node.prim_count == 0 {
                order.extend([node.first_index as usize, node.first_index as usize + 1]);
            }
            next += 1;
        }
        for i in order.into_iter().rev() {
            let node = &bvh.nodes[i];
            let first = node.first_index as usize;
            counts[i] = if node.prim_count > 0 { node.prim_count } else { counts[first] + counts[first + 1] };
        }
        Subtrees(counts)
    }

    /// Whether all primitives of a node are tested at once: then nothing is gained by looking at boxes below it.
    fn fits_a_block(&self, node: usize) -> bool {
        self.0[node] as usize <= LANES
    }

    /// The primitives below a node, in the order of the tree.
    fn primitives(&self, bvh: &Bvh2, node: usize) -> Vec<u32> {
        let mut all = Vec::with_capacity(self.0[node] as usize);
        let mut work = vec![node];
        while let Some(i) = work.pop() {
            let node = &bvh.nodes[i];
            let first = node.first_index as usize;
            if node.prim_count > 0 {
                all.extend_from_slice(&bvh.primitive_indices[first..first + node.prim_count as usize]);
            } else {
                work.extend([first + 1, first]);
            }
        }
        all
    }

    /// Fills a wide node: opens the node with the largest surface, the one most often hit, until there are eight.
    fn open(&self, bvh: &Bvh2, node: usize, children: &mut [usize; LANES]) -> usize {
        children[0] = node;
        let mut count = 1;
        while count < LANES {
            let mut largest = None;
            let mut area = f32::NEG_INFINITY;
            for (i, child) in children[..count].iter().enumerate() {
                let node = &bvh.nodes[*child];
                let opens = node.prim_count == 0 && !self.fits_a_block(*child);
                if opens && node.aabb.half_area() > area {
                    (largest, area) = (Some(i), node.aabb.half_area());
                }
            }
            let Some(i) = largest else { break };
            let first = bvh.nodes[children[i]].first_index as usize;
            children[i] = first;
            children[count] = first + 1;
            count += 1;
        }
        count
    }
}
