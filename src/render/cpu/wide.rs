//! Eight-wide nodes and blocks of eight primitives: how a binary tree lies in memory for traversal.

use glam::Vec3;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;

use super::build::Bounded;
use super::intersect::TriangleBlock;
use super::lanes::{LANES, Row};
use crate::scene::compile::NONE;

/// Marks a child that is a leaf: the rest is the index of its first block.
pub(super) const LEAF: u32 = 1 << 31;

/// Marks a leaf that is a copy of a mesh: the rest is its place.
pub(super) const COPY: u32 = 1 << 30;

/// Up to eight children; lane `i` of every row belongs to child `i`.
#[derive(Clone, Debug)]
pub(super) struct Node {
    /// Least and greatest coordinates, by axis. A child that is not there has a box that begins behind its end.
    pub bounds: [[Row; 3]; 2],
    /// Index of a node, of a block with [`LEAF`] set, or of a copy with [`LEAF`] and [`COPY`] set.
    pub child: [u32; LANES],
}

impl Node {
    fn empty() -> Node {
        Node { bounds: [[Row([f32::INFINITY; LANES]); 3], [Row([f32::NEG_INFINITY; LANES]); 3]], child: [0; LANES] }
    }

    fn set(&mut self, lane: usize, child: u32, aabb: &Aabb) {
        for axis in 0..3 {
            self.bounds[0][axis].0[lane] = aabb.min[axis];
            self.bounds[1][axis].0[lane] = aabb.max[axis];
        }
        self.child[lane] = child;
    }

    /// The boxes of the children that are there.
    pub fn boxes(&self) -> impl Iterator<Item = [Vec3; 2]> {
        let corner = |side: usize, lane: usize| Vec3::from_array([0, 1, 2].map(|axis| self.bounds[side][axis].0[lane]));
        (0..LANES).map(move |lane| [corner(0, lane), corner(1, lane)]).filter(|[low, high]| low.x <= high.x)
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

/// What a binary tree's index stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Item {
    /// A triangle with its id.
    Triangle(u32, [Vec3; 3]),
    /// A sphere's id.
    Sphere(u32),
    /// A row of the places where copies stand, and what a ray costs that meets its box.
    Copy(u32, f64),
}

/// The nodes and blocks of any number of trees.
#[derive(Default)]
pub(super) struct Wide {
    pub nodes: Vec<Node>,
    pub blocks: Vec<Block>,
}

/// Where rays enter a tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Root {
    /// A node or a leaf, as in [`Node::child`].
    pub index: u32,
    /// Levels of nodes.
    pub levels: usize,
    /// What a ray costs that meets its box, by the surface area heuristic: one for each node and for each primitive that is
    /// tested.
    pub cost: f64,
    /// The box around all of it.
    pub aabb: Aabb,
}

/// A tree on its way from binary to wide.
struct Growth<'a> {
    bvh: &'a Bvh2,
    of: &'a [Bounded],
    item: &'a dyn Fn(u32) -> Item,
    subtrees: Subtrees,
    /// Sum over nodes and leaves of half the surface of their boxes times what is tested there.
    surface: f64,
    levels: usize,
}

impl Wide {
    /// Adds a binary tree over `of`, whose indices stand for items. Leaves are whatever fits into one block and what the
    /// binary tree does not divide.
    pub fn grow(&mut self, bvh: &Bvh2, of: &[Bounded], item: &dyn Fn(u32) -> Item) -> Root {
        let subtrees = Subtrees::new(bvh, &|i| matches!(item(i), Item::Copy(..)));
        let mut growth = Growth { bvh, of, item, subtrees, surface: 0.0, levels: 0 };
        let aabb = bvh.nodes[0].aabb;
        let index = if growth.is_leaf(0) {
            self.push_leaf(&mut growth, 0, 0)
        } else {
            let root = self.push_node(&mut growth, &aabb, 1);
            // Work list of (binary node whose children fill it, wide node, level): no recursion, whatever the depth.
            let mut work = vec![(0usize, root as usize, 1usize)];
            while let Some((binary, wide, level)) = work.pop() {
                let mut children = [0; LANES];
                let count = growth.open(binary, &mut children);
                for (lane, child) in children[..count].iter().copied().enumerate() {
                    let aabb = bvh.nodes[child].aabb;
                    let index = if growth.is_leaf(child) {
                        self.push_leaf(&mut growth, child, level)
                    } else {
                        let node = self.push_node(&mut growth, &aabb, level + 1);
                        work.push((child, node as usize, level + 1));
                        node
                    };
                    self.nodes[wide].set(lane, index, &aabb);
                }
            }
            root
        };
        let whole = f64::from(aabb.half_area());
        let cost = if whole > 0.0 { growth.surface / whole } else { growth.surface };
        Root { index, levels: growth.levels, cost, aabb }
    }

    fn push_node(&mut self, growth: &mut Growth, aabb: &Aabb, level: usize) -> u32 {
        growth.surface += f64::from(aabb.half_area());
        growth.levels = growth.levels.max(level);
        self.nodes.push(Node::empty());
        self.nodes.len() as u32 - 1
    }

    /// Adds all primitives below a binary node, whose parent is on the given level, as one leaf. Copies are leaves of their
    /// own; where there are several, or others beside them, they become nodes of leaves.
    fn push_leaf(&mut self, growth: &mut Growth, binary: usize, level: usize) -> u32 {
        let members = growth.subtrees.primitives(growth.bvh, binary);
        let items: Vec<Item> = members.iter().map(|i| (growth.item)(*i)).collect();
        let aabb = growth.bvh.nodes[binary].aabb;
        let mut leaves: Vec<(u32, Aabb)> = Vec::new();
        for (i, item) in members.iter().zip(&items) {
            if let Item::Copy(place, cost) = item {
                let aabb = growth.of[*i as usize].aabb;
                growth.surface += f64::from(aabb.half_area()) * cost;
                leaves.push((LEAF | COPY | place, aabb));
            }
        }
        let rest: Vec<Item> = items.into_iter().filter(|item| !matches!(item, Item::Copy(..))).collect();
        if !rest.is_empty() {
            growth.surface += f64::from(aabb.half_area()) * rest.len() as f64;
            leaves.push((self.push_blocks(&rest), aabb));
        }
        let mut level = level;
        while leaves.len() > 1 {
            level += 1;
            let chunks = leaves.chunks(LANES).map(|chunk| {
                let aabb = chunk.iter().fold(Aabb::empty(), |all, (_, aabb)| all.union(aabb));
                let node = self.push_node(growth, &aabb, level);
                for (lane, (child, aabb)) in chunk.iter().enumerate() {
                    self.nodes[node as usize].set(lane, *child, aabb);
                }
                (node, aabb)
            });
            leaves = chunks.collect();
        }
        leaves.first().map_or(LEAF, |(index, _)| *index)
    }

    /// Adds the blocks of a leaf of triangles and spheres and returns what a node says of it.
    fn push_blocks(&mut self, items: &[Item]) -> u32 {
        let first = self.blocks.len() as u32;
        for chunk in items.chunks(LANES) {
            let triangle = |lane: usize| match chunk.get(lane) {
                Some(Item::Triangle(_, corners)) => Some(*corners),
                _ => None,
            };
            let id = |lane: usize| match chunk.get(lane) {
                Some(Item::Triangle(id, _) | Item::Sphere(id)) => *id,
                _ => NONE,
            };
            let is_sphere = |lane: usize| matches!(chunk.get(lane), Some(Item::Sphere(_)));
            self.blocks.push(Block {
                triangles: TriangleBlock::new(std::array::from_fn(triangle)),
                primitives: std::array::from_fn(id),
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

impl Growth<'_> {
    /// Whether a binary node is divided no further.
    fn is_leaf(&self, node: usize) -> bool {
        self.subtrees.fits_a_block(node) || self.bvh.nodes[node].prim_count > 0
    }

    /// Fills a wide node: opens the node with the largest surface, the one most often hit, until there are eight.
    fn open(&self, node: usize, children: &mut [usize; LANES]) -> usize {
        children[0] = node;
        let mut count = 1;
        while count < LANES {
            let mut largest = None;
            let mut area = f32::NEG_INFINITY;
            for (i, child) in children[..count].iter().enumerate() {
                let node = &self.bvh.nodes[*child];
                if !self.is_leaf(*child) && node.aabb.half_area() > area {
                    (largest, area) = (Some(i), node.aabb.half_area());
                }
            }
            let Some(i) = largest else { break };
            let first = self.bvh.nodes[children[i]].first_index as usize;
            children[i] = first;
            children[count] = first + 1;
            count += 1;
        }
        count
    }
}

/// How many primitives lie below each node of a binary tree; a copy counts as more than fit into a block.
struct Subtrees(Vec<u32>);

impl Subtrees {
    fn new(bvh: &Bvh2, is_copy: &dyn Fn(u32) -> bool) -> Subtrees {
        let mut counts = vec![0u32; bvh.nodes.len()];
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
            counts[i] = if node.prim_count > 0 {
                let members = &bvh.primitive_indices[first..first + node.prim_count as usize];
                let weight = |i: &u32| if is_copy(*i) { LANES as u32 + 1 } else { 1 };
                members.iter().map(weight).fold(0, u32::saturating_add)
            } else {
                counts[first].saturating_add(counts[first + 1])
            };
        }
        Subtrees(counts)
    }

    /// Whether all primitives of a node are tested at once: then nothing is gained by looking at boxes below it.
    fn fits_a_block(&self, node: usize) -> bool {
        self.0[node] as usize <= LANES
    }

    /// The primitives below a node, in the order of the tree.
    fn primitives(&self, bvh: &Bvh2, node: usize) -> Vec<u32> {
        let mut all = Vec::new();
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
}
