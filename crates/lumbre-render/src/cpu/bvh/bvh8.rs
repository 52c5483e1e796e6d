//! Eight-wide nodes and blocks of eight primitives: the memory layout for traversal, collapsed from
//! binary trees so that the area of all nodes together is least ([`super::collapse`]).
//!
//! Invariants: a missing child has an empty box, which no ray hits. A leaf is a range of blocks
//! that ends with a block whose `last` is set, or one instance. Every primitive of the binary tree
//! is in the leaves that hold it there, once in each.

use glam::Vec3;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;

use super::build_primitive::BuildPrimitive;
use super::collapse::{CollapseCosts, collect_primitives, weights};
use super::intersect::TriangleBlock;
use super::simd::{LANES, LaneArray};
use lumbre_light::scene::compile::NONE;

/// Flag of a child that is a leaf; the lower bits are the index of its first block.
pub(crate) const LEAF: u32 = 1 << 31;

/// Flag of a leaf that is an instance of a mesh; the lower bits are the instance's index.
pub(crate) const INSTANCE: u32 = 1 << 30;

/// Node with up to eight children; lane `i` of every array belongs to child `i`.
#[derive(Clone, Debug)]
pub(crate) struct Node {
    /// Least and greatest coordinates, by axis. A missing child has an empty box.
    pub bounds: [[LaneArray; 3]; 2],
    /// Index of a node, of a block with [`LEAF`] set, or of an instance with [`LEAF`] and
    /// [`INSTANCE`] set.
    pub child: [u32; LANES],
}

impl Node {
    fn empty() -> Node {
        Node {
            bounds: [
                [LaneArray([f32::INFINITY; LANES]); 3],
                [LaneArray([f32::NEG_INFINITY; LANES]); 3],
            ],
            child: [0; LANES],
        }
    }

    fn set(&mut self, lane: usize, child: u32, aabb: &Aabb) {
        for axis in 0..3 {
            self.bounds[0][axis].0[lane] = aabb.min[axis];
            self.bounds[1][axis].0[lane] = aabb.max[axis];
        }
        self.child[lane] = child;
    }

    /// Iterates over the boxes of the children, as least and greatest corner.
    pub fn boxes(&self) -> impl Iterator<Item = [Vec3; 2]> {
        let corner = |side: usize, lane: usize| {
            Vec3::from_array([0, 1, 2].map(|axis| self.bounds[side][axis].0[lane]))
        };
        (0..LANES)
            .map(move |lane| [corner(0, lane), corner(1, lane)])
            .filter(|[low, high]| low.x <= high.x)
    }
}

/// Up to eight primitives of a leaf, which are tested at once.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    /// Triangles of the lanes that hold one.
    pub triangles: TriangleBlock,
    /// Primitive index of each lane; [`NONE`] for empty lanes.
    pub primitives: [u32; LANES],
    /// Mask of the lanes that hold a sphere.
    pub spheres: u32,
    /// Mask of the lanes whose primitive may have a material with a mask.
    pub masked: u32,
    /// Whether this is the last block of its leaf.
    pub last: bool,
}

/// Primitive or tree that an index of a binary tree refers to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum BuildItem {
    /// Triangle: its primitive index and corners.
    Triangle(u32, [Vec3; 3]),
    /// Sphere: its primitive index.
    Sphere(u32),
    /// Another tree, or an instance of one: the child of a node that stands for it, and the expected
    /// cost of a ray that meets its box.
    Tree(u32, f64),
}

/// Nodes and blocks of any number of trees.
#[derive(Default)]
pub(crate) struct Bvh8 {
    /// Nodes of all trees.
    pub nodes: Vec<Node>,
    /// Blocks of the leaves of all trees.
    pub blocks: Vec<Block>,
}

/// Root and properties of a tree.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TreeRoot {
    /// Index of a node or leaf, as in [`Node::child`].
    pub index: u32,
    /// Number of levels of nodes.
    pub levels: usize,
    /// Expected cost of a ray that meets the tree's box, by the surface area heuristic: 1 for each
    /// visited node and 1 for each tested primitive.
    pub cost: f64,
    /// Bounding box of the tree.
    pub aabb: Aabb,
}

/// State of the collapse of one binary tree.
struct Collapse<'a> {
    bvh: &'a Bvh2,
    primitives: &'a [BuildPrimitive],
    item: &'a dyn Fn(u32) -> BuildItem,
    /// Sum over nodes and leaves of half the area of their box times the number of tests there.
    weighted_area: f64,
    levels: usize,
}

impl Bvh8 {
    /// Adds a binary tree over `primitives`; `item` returns what an index refers to.
    /// A leaf is a subtree that fits into one block, or a leaf of the binary tree.
    pub fn add_tree(
        &mut self,
        bvh: &Bvh2,
        primitives: &[BuildPrimitive],
        item: &dyn Fn(u32) -> BuildItem,
    ) -> TreeRoot {
        // A tree counts as more primitives than fit into a block.
        let weights = weights(bvh, |i| match item(i) {
            BuildItem::Tree(..) => LANES as u32 + 1,
            _ => 1,
        });
        // Boxes inside a block would save nothing.
        let is_leaf = |i: usize| weights[i] <= LANES as u32 || bvh.nodes[i].is_leaf();
        let costs = CollapseCosts::new(bvh, is_leaf);
        let mut collapse = Collapse {
            bvh,
            primitives,
            item,
            weighted_area: 0.0,
            levels: 0,
        };
        let aabb = *bvh.nodes[0].aabb();
        let index = if costs.is_leaf(0) {
            self.push_leaf(&mut collapse, 0, 0)
        } else {
            self.push_tree(&mut collapse, &costs)
        };
        let root_area = f64::from(aabb.half_area());
        let cost = if root_area > 0.0 {
            collapse.weighted_area / root_area
        } else {
            collapse.weighted_area
        };
        TreeRoot {
            index,
            levels: collapse.levels,
            cost,
            aabb,
        }
    }

    /// Adds the root of a tree that is not a leaf and everything below it. Returns its index.
    fn push_tree<F: Fn(usize) -> bool>(
        &mut self,
        collapse: &mut Collapse,
        costs: &CollapseCosts<F>,
    ) -> u32 {
        let nodes = &collapse.bvh.nodes;
        let root = self.push_node(collapse, nodes[0].aabb(), 1);
        // Work list of binary node, its eight-wide node, and its level. There is no recursion, so
        // that deep trees do not overflow the call stack.
        let mut work = vec![(0usize, root as usize, 1usize)];
        while let Some((binary, parent, level)) = work.pop() {
            let mut children = [0; LANES];
            let count = costs.select_children(binary, &mut children);
            for (lane, child) in children[..count].iter().copied().enumerate() {
                let aabb = nodes[child].aabb();
                let index = if costs.is_leaf(child) {
                    self.push_leaf(collapse, child, level)
                } else {
                    let node = self.push_node(collapse, aabb, level + 1);
                    work.push((child, node as usize, level + 1));
                    node
                };
                self.nodes[parent].set(lane, index, aabb);
            }
        }
        root
    }

    fn push_node(&mut self, collapse: &mut Collapse, aabb: &Aabb, level: usize) -> u32 {
        collapse.weighted_area += f64::from(aabb.half_area());
        collapse.levels = collapse.levels.max(level);
        self.nodes.push(Node::empty());
        self.nodes.len() as u32 - 1
    }

    /// Adds all primitives below a binary node as one leaf; `level` is that of its parent. Every
    /// tree is a child of its own. If there are several children, they are joined by nodes.
    fn push_leaf(&mut self, collapse: &mut Collapse, binary: usize, level: usize) -> u32 {
        let mut members = Vec::new();
        collect_primitives(collapse.bvh, binary, &mut members);
        members.sort_unstable();
        members.dedup();
        let items: Vec<BuildItem> = members.iter().map(|i| (collapse.item)(*i)).collect();
        let aabb = *collapse.bvh.nodes[binary].aabb();
        let mut leaves: Vec<(u32, Aabb)> = Vec::new();
        for (i, item) in members.iter().zip(&items) {
            if let BuildItem::Tree(child, cost) = item {
                let aabb = collapse.primitives[*i as usize].aabb;
                collapse.weighted_area += f64::from(aabb.half_area()) * cost;
                leaves.push((*child, aabb));
            }
        }
        let primitives: Vec<BuildItem> = items
            .into_iter()
            .filter(|item| !matches!(item, BuildItem::Tree(..)))
            .collect();
        if !primitives.is_empty() {
            collapse.weighted_area += f64::from(aabb.half_area()) * primitives.len() as f64;
            leaves.push((self.push_blocks(&primitives), aabb));
        }
        let mut level = level;
        while leaves.len() > 1 {
            level += 1;
            let chunks = leaves.chunks(LANES).map(|chunk| {
                let aabb = chunk
                    .iter()
                    .fold(Aabb::empty(), |all, (_, aabb)| all.union(aabb));
                let node = self.push_node(collapse, &aabb, level);
                for (lane, (child, aabb)) in chunk.iter().enumerate() {
                    self.nodes[node as usize].set(lane, *child, aabb);
                }
                (node, aabb)
            });
            leaves = chunks.collect();
        }
        leaves.first().map_or(LEAF, |(index, _)| *index)
    }

    /// Adds the blocks of a leaf of triangles and spheres and returns its child index.
    fn push_blocks(&mut self, items: &[BuildItem]) -> u32 {
        let first = self.blocks.len() as u32;
        for chunk in items.chunks(LANES) {
            let triangle = |lane: usize| match chunk.get(lane) {
                Some(BuildItem::Triangle(_, corners)) => Some(*corners),
                _ => None,
            };
            let id = |lane: usize| match chunk.get(lane) {
                Some(BuildItem::Triangle(id, _) | BuildItem::Sphere(id)) => *id,
                _ => NONE,
            };
            let is_sphere = |lane: usize| matches!(chunk.get(lane), Some(BuildItem::Sphere(_)));
            self.blocks.push(Block {
                triangles: TriangleBlock::new(std::array::from_fn(triangle)),
                primitives: std::array::from_fn(id),
                spheres: (0..LANES)
                    .map(|lane| u32::from(is_sphere(lane)) << lane)
                    .sum(),
                masked: 0,
                last: false,
            });
        }
        if let Some(block) = self.blocks.last_mut() {
            block.last = true;
        }
        first | LEAF
    }
}
