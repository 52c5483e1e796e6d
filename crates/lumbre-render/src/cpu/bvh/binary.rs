//! Binary bounding volume hierarchies: the result of all builders, from which eight-wide trees are
//! collapsed.
//!
//! Invariants: node 0 is the root. The children of an inner node are adjacent, the first has an odd
//! index, and both follow their parent. A leaf refers to a range of [`BinaryTree::primitives`]. Every
//! primitive is in one leaf, or in several if its parts are ([`super::parts`]).

use std::ops::Range;

use glam::{Vec3A, Vec4};

use super::aabb::Aabb;

/// Flag of integers below it that are stored as the bits of a number. It makes them normal numbers:
/// arithmetic with subnormal ones takes many times as long on some processors, and operations on
/// boxes include all lanes.
const NORMAL: u32 = 1 << 30;

/// Node of 32 bytes. The box takes three lanes of both vectors, and the fourth lanes hold integers
/// as the bits of a number, with the flag [`NORMAL`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct BinaryNode {
    /// Least coordinates, and the index of the first child or the first primitive.
    low: Vec4,
    /// Greatest coordinates, and the number of primitives; 0 for inner nodes.
    high: Vec4,
}

impl BinaryNode {
    /// Creates a leaf of `count` primitives, which must not be 0.
    #[inline]
    pub fn leaf(aabb: Aabb, first: u32, count: u32) -> BinaryNode {
        BinaryNode {
            low: aabb.min.extend(f32::from_bits(first | NORMAL)),
            high: aabb.max.extend(f32::from_bits(count | NORMAL)),
        }
    }

    /// Creates an inner node whose children are `first` and `first + 1`.
    #[inline]
    pub fn inner(aabb: Aabb, first: u32) -> BinaryNode {
        BinaryNode::leaf(aabb, first, 0)
    }

    /// Returns the same node with another box.
    #[inline]
    pub fn with_aabb(&self, aabb: Aabb) -> BinaryNode {
        BinaryNode {
            low: aabb.min.extend(self.low.w),
            high: aabb.max.extend(self.high.w),
        }
    }

    /// Returns the bounding box.
    #[inline]
    pub fn aabb(&self) -> Aabb {
        Aabb::new(Vec3A::from_vec4(self.low), Vec3A::from_vec4(self.high))
    }

    /// Returns half of the surface area of the box.
    #[inline]
    pub fn half_area(&self) -> f32 {
        self.aabb().half_area()
    }

    /// Returns whether this is a leaf.
    #[inline]
    pub fn is_leaf(&self) -> bool {
        self.high.w.to_bits() != NORMAL
    }

    /// Returns the index of the first child of an inner node.
    #[inline]
    pub fn first_child(&self) -> usize {
        (self.low.w.to_bits() & !NORMAL) as usize
    }

    /// Returns the range of [`BinaryTree::primitives`] of a leaf; empty for inner nodes.
    #[inline]
    pub fn range(&self) -> Range<usize> {
        let first = self.first_child();
        first..first + (self.high.w.to_bits() & !NORMAL) as usize
    }
}

/// Binary tree over primitives.
#[derive(Clone, Debug)]
pub(crate) struct BinaryTree {
    /// Nodes, the root first.
    pub nodes: Vec<BinaryNode>,
    /// Indices of the primitives, in the order in which leaves refer to them.
    pub primitives: Vec<u32>,
}

impl BinaryTree {
    /// Stores the nodes in depth-first order.
    pub fn reorder(&mut self) {
        let mut nodes = Vec::with_capacity(self.nodes.len());
        nodes.extend(self.nodes.first());
        let mut work = vec![0];
        while let Some(i) = work.pop() {
            let node: BinaryNode = nodes[i];
            if !node.is_leaf() {
                let (old, new) = (node.first_child(), nodes.len());
                nodes.extend_from_slice(&self.nodes[old..old + 2]);
                nodes[i] = BinaryNode::inner(node.aabb(), new as u32);
                work.extend([new + 1, new]);
            }
        }
        self.nodes = nodes;
    }

    /// Returns the sum over the primitives below each node of their weights. Sums are limited to
    /// the largest integer.
    pub fn weights(&self, weight: impl Fn(u32) -> u32) -> Vec<u32> {
        let mut weights = vec![0u32; self.nodes.len()];
        for (i, node) in self.nodes.iter().enumerate().rev() {
            weights[i] = if node.is_leaf() {
                let members = &self.primitives[node.range()];
                members
                    .iter()
                    .map(|p| weight(*p))
                    .fold(0, u32::saturating_add)
            } else {
                let first = node.first_child();
                weights[first].saturating_add(weights[first + 1])
            };
        }
        weights
    }

    /// Appends the primitives below a node to `list`, in the order of the tree.
    pub fn collect_primitives(&self, node: usize, list: &mut Vec<u32>) {
        let mut work = vec![node];
        while let Some(i) = work.pop() {
            let node = &self.nodes[i];
            if node.is_leaf() {
                list.extend_from_slice(&self.primitives[node.range()]);
            } else {
                work.extend([node.first_child() + 1, node.first_child()]);
            }
        }
    }
}

#[cfg(test)]
impl BinaryTree {
    /// Panics if the tree violates an invariant of this module, or a box is not the bounding box of
    /// the primitives below it.
    pub fn validate(&self, primitives: &[super::build::BuildPrimitive]) {
        let mut parents = vec![0; self.nodes.len()];
        let mut leaves = vec![0; primitives.len()];
        for (i, node) in self.nodes.iter().enumerate() {
            let boxes: Vec<Aabb> = if node.is_leaf() {
                let members = self.primitives[node.range()].iter().map(|p| *p as usize);
                members.clone().for_each(|p| leaves[p] += 1);
                members.map(|p| primitives[p].aabb).collect()
            } else {
                let first = node.first_child();
                assert!(first > i && first % 2 == 1, "children of {i} at {first}");
                parents[first] += 1;
                parents[first + 1] += 1;
                self.nodes[first..first + 2]
                    .iter()
                    .map(BinaryNode::aabb)
                    .collect()
            };
            let union = boxes.iter().fold(Aabb::empty(), |all, b| all.union(b));
            assert_eq!(node.aabb(), union, "box of {i}");
        }
        assert!(parents[1..].iter().all(|n| *n == 1) && parents[0] == 0);
        assert!(leaves.iter().all(|n| *n == 1));
        assert_eq!(self.primitives.len(), primitives.len());
    }

    /// Returns the sum of the areas of all nodes, those of leaves times their number of primitives.
    pub fn weighted_area(&self) -> f64 {
        let weight = |node: &BinaryNode| node.range().len().max(1) as f64;
        let areas = self
            .nodes
            .iter()
            .map(|n| f64::from(n.half_area()) * weight(n));
        areas.sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_keep_their_integers_and_boxes() {
        let aabb = Aabb::new(Vec3A::splat(-1.0), Vec3A::new(1.0, 2.0, 3.0));
        for first in [0, 1, 0x3f80_0001, NORMAL - 1] {
            let (leaf, inner) = (
                BinaryNode::leaf(aabb, first, 7),
                BinaryNode::inner(aabb, first),
            );
            assert_eq!(leaf.range(), first as usize..first as usize + 7);
            assert!(leaf.is_leaf() && !inner.is_leaf());
            assert_eq!(inner.first_child(), first as usize);
            assert_eq!((leaf.aabb(), inner.with_aabb(aabb).aabb()), (aabb, aabb));
        }
        assert_eq!(size_of::<BinaryNode>(), 32);
    }
}
