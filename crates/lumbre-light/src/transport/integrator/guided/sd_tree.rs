//! The SD-tree [Müller et al. 2017]: a binary tree over space with a quadtree over directions in
//! each leaf.
//!
//! Levels of the spatial tree divide a cube around the scene in the middle, along x, y and z in
//! turn.

use glam::Vec3;

use super::direction_tree::{Cell, DirectionTree, Node, set_masses};

/// Greatest number of levels of the spatial tree.
const MAX_LEVELS: u32 = 48;

/// Bit that marks the index of a leaf among those of branches.
const LEAF: u32 = 1 << 31;

/// Upper bound of the bytes that a node takes while a tree is refined and trained: in the tree that
/// paths follow, in the one that is trained, in its sums, and in lists that grow.
const NODE_BYTES: u64 = 5 * size_of::<Node>() as u64;

/// Upper bound of the bytes that a leaf takes besides its nodes, likewise.
const LEAF_BYTES: u64 = 192;

/// A region of space.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Leaf {
    /// Index of the root of its quadtree.
    root: u32,
    /// Number of nodes of its quadtree, which are consecutive.
    nodes: u32,
    /// Whether its quadtree was trained by any light.
    guides: bool,
}

/// A density of directions at every point of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct SdTree {
    /// Lowest corner of the cube.
    low: Vec3,
    /// Inverse of the cube's side.
    scale: f32,
    /// A leaf, or the first branch.
    root: u32,
    /// Both halves of each branch: indices of branches, or of leaves with the bit [`LEAF`].
    branches: Vec<[u32; 2]>,
    leaves: Vec<Leaf>,
    nodes: Vec<Node>,
}

/// Sums over the vertices of an iteration in the region of a leaf.
#[derive(Clone, Debug, Default)]
pub struct LeafSums {
    /// Number of vertices.
    pub vertices: u64,
    /// Sum of values in each cell of each node of its quadtree.
    cells: Vec<[f64; 4]>,
}

/// Limits of a refinement.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Number of vertices above which a leaf is divided.
    pub vertices: f64,
    /// Greatest number of bytes: see [`SdTree::bytes`].
    pub bytes: u64,
}

impl SdTree {
    /// Returns the tree of a bounding box that has one leaf, which does not guide.
    pub fn new([low, high]: [Vec3; 2]) -> SdTree {
        let side = (high - low).max_element();
        SdTree {
            low,
            scale: if side > 0.0 { 1.0 / side } else { 0.0 },
            root: LEAF,
            branches: Vec::new(),
            leaves: vec![Leaf {
                root: 0,
                nodes: 1,
                guides: false,
            }],
            nodes: vec![Node::uniform()],
        }
    }

    /// Returns the number of leaves.
    pub fn leaves(&self) -> usize {
        self.leaves.len()
    }

    /// Returns the number of nodes of all quadtrees.
    pub fn nodes(&self) -> usize {
        self.nodes.len()
    }

    /// Returns the index of the leaf whose region contains a point, or the nearest point of the
    /// cube.
    pub fn leaf_at(&self, point: Vec3) -> u32 {
        self.leaf_and_size_at(point).0
    }

    /// Returns a leaf near a point: that of a point chosen by three numbers in `[0, 1)` from a box
    /// around it, as large as the region of its own leaf [Müller 2019].
    pub fn leaf_near(&self, point: Vec3, numbers: [f32; 3]) -> u32 {
        let size = self.leaf_and_size_at(point).1;
        self.leaf_at(point + size * (Vec3::from(numbers) - 0.5))
    }

    /// Returns [`SdTree::leaf_at`] with the size of its region.
    fn leaf_and_size_at(&self, point: Vec3) -> (u32, Vec3) {
        let mut within = ((point - self.low) * self.scale).to_array();
        let mut fractions = [1.0; 3];
        let (mut index, mut axis) = (self.root, 0);
        while index & LEAF == 0 {
            let upper = within[axis] >= 0.5;
            within[axis] = 2.0 * within[axis] - f32::from(u8::from(upper));
            fractions[axis] *= 0.5;
            index = self.branches[index as usize][usize::from(upper)];
            axis = (axis + 1) % 3;
        }
        let side = if self.scale > 0.0 {
            1.0 / self.scale
        } else {
            0.0
        };
        (index & !LEAF, Vec3::from(fractions) * side)
    }

    /// Returns the density of directions of a leaf; `None` if no light reached its region.
    pub fn directions(&self, leaf: u32) -> Option<DirectionTree<'_>> {
        let leaf = self.leaves[leaf as usize];
        leaf.guides.then_some(DirectionTree {
            nodes: &self.nodes,
            root: leaf.root,
        })
    }

    /// Returns empty sums of all leaves.
    pub fn sums(&self) -> Vec<LeafSums> {
        let empty = |leaf: &Leaf| LeafSums {
            vertices: 0,
            cells: vec![[0.0; 4]; leaf.nodes as usize],
        };
        self.leaves.iter().map(empty).collect()
    }

    /// Adds a vertex to the sums of a leaf, with a value of the direction at a point of the unit
    /// square that is distributed around it.
    pub fn add(&self, leaf: u32, sums: &mut LeafSums, point: [f32; 2], value: f32) {
        sums.vertices += 1;
        if value > 0.0 {
            let root = self.leaves[leaf as usize].root;
            let nodes = &self.nodes;
            let tree = DirectionTree { nodes, root };
            tree.distribute(point, value, &mut |Cell { node, quadrant }, share| {
                sums.cells[(node - root) as usize][quadrant] += f64::from(share);
            });
        }
    }

    /// Sets the densities of all leaves from sums, where `mass_of` maps the sum of a cell and its
    /// area on the unit square to its mass. A leaf whose sums are all zero does not guide.
    pub fn set_densities(&mut self, sums: &[LeafSums], mass_of: fn(f64, f64) -> f64) {
        for (leaf, sums) in self.leaves.iter_mut().zip(sums) {
            let root = leaf.root;
            let value = |cell: Cell| sums.cells[(cell.node - root) as usize][cell.quadrant];
            let mass = set_masses(&mut self.nodes, root, 1.0, &value, mass_of);
            leaf.guides = mass > 0.0 && mass.is_finite();
        }
    }

    /// Returns an upper bound of the bytes that this tree takes while it is refined and trained.
    pub fn bytes(&self) -> u64 {
        self.leaves.len() as u64 * LEAF_BYTES + self.nodes.len() as u64 * NODE_BYTES
    }

    /// Returns the refinement of this tree for the numbers of vertices in its leaves: leaves with
    /// more than the limit are divided, and quadtrees have cells of about equal mass. If it would
    /// take more bytes than the limit, both thresholds are doubled until it fits; at least the
    /// leaves of this tree remain.
    pub fn refined(&self, sums: &[LeafSums], limits: &Limits) -> SdTree {
        let mut relax = 1.0;
        loop {
            let tree = self.refined_by(sums, limits, relax);
            if let Some(tree) = tree {
                return tree;
            }
            relax *= 2.0;
        }
    }

    /// Returns the refinement by thresholds times `relax`; `None` if it takes too many bytes.
    fn refined_by(&self, sums: &[LeafSums], limits: &Limits, relax: f64) -> Option<SdTree> {
        let mut tree = SdTree {
            low: self.low,
            scale: self.scale,
            root: 0,
            branches: Vec::new(),
            leaves: Vec::new(),
            nodes: Vec::new(),
        };
        tree.root = tree.copy(self, self.root, 0, sums, limits, relax)?;
        Some(tree)
    }

    /// Copies and refines a branch or leaf of `old` at a level; `None` if the tree becomes too
    /// large.
    fn copy(
        &mut self,
        old: &SdTree,
        index: u32,
        level: u32,
        sums: &[LeafSums],
        limits: &Limits,
        relax: f64,
    ) -> Option<u32> {
        if index & LEAF != 0 {
            let leaf = index & !LEAF;
            let vertices = sums[leaf as usize].vertices as f64;
            return self.divide(old, leaf, level, vertices, limits, relax);
        }
        let branch = self.push_branch();
        for (side, half) in old.branches[index as usize].into_iter().enumerate() {
            let child = self.copy(old, half, level + 1, sums, limits, relax)?;
            self.branches[branch][side] = child;
        }
        Some(branch as u32)
    }

    /// Appends a leaf of `old` whose region has a number of vertices, divided until every part has
    /// few enough if vertices are distributed uniformly; `None` if the tree becomes too large.
    fn divide(
        &mut self,
        old: &SdTree,
        leaf: u32,
        level: u32,
        vertices: f64,
        limits: &Limits,
        relax: f64,
    ) -> Option<u32> {
        if vertices > limits.vertices * relax && level < MAX_LEVELS {
            let branch = self.push_branch();
            for side in 0..2 {
                let half = self.divide(old, leaf, level + 1, 0.5 * vertices, limits, relax)?;
                self.branches[branch][side] = half;
            }
            return Some(branch as u32);
        }
        let Leaf { root, guides, .. } = old.leaves[leaf as usize];
        let nodes = &old.nodes;
        let first = self.nodes.len();
        let root = DirectionTree { nodes, root }.append_refined(relax, &mut self.nodes);
        self.leaves.push(Leaf {
            root,
            nodes: (self.nodes.len() - first) as u32,
            guides,
        });
        (self.bytes() <= limits.bytes).then_some(LEAF | (self.leaves.len() - 1) as u32)
    }

    /// Appends a branch whose halves are not yet known, and returns its index.
    fn push_branch(&mut self) -> usize {
        self.branches.push([0; 2]);
        self.branches.len() - 1
    }
}
