//! Compressed eight-wide trees [Ylitie et al. 2017]. `vulkan-compute` traverses them for every
//! builder, the CPU only for the builder `cwbvh`.
//!
//! Leaves are those of the binary tree, and a child has at most [`MAX_CHILD_PRIMITIVES`].

use glam::{Vec3, Vec3A};

use super::aabb::Aabb;
use super::binary::{BinaryNode, BinaryTree};
use super::build::{BuildPrimitive, build_scene};
use super::collapse::{CollapseCosts, LeafChoice};
use super::packed_node::{PackedNode, Slot};
use super::simd::LANES;
use crate::hierarchy::{AccelSpec, Builder};

/// Maximum number of primitives in a child of a compressed node.
const MAX_CHILD_PRIMITIVES: u32 = 3;

/// Cost of a test of a primitive, in visits of a node, by which leaves are chosen.
const PRIMITIVE_COST: f32 = 0.3;

/// Compressed tree over primitives.
#[derive(Clone, Debug)]
pub struct PackedTree {
    /// Nodes, the root first; empty without primitives.
    pub nodes: Vec<PackedNode>,
    /// Indices of the primitives, in the order in which leaves refer to them.
    pub primitives: Vec<u32>,
    /// Bounding box of all primitives.
    pub aabb: Aabb,
}

/// Builds the tree over `primitives`, of which the first are those of `triangles`, with at most
/// `max_leaf` and [`MAX_CHILD_PRIMITIVES`] of them in one child. `ploc` and `cwbvh` give the same
/// tree.
pub fn build_packed(
    spec: &AccelSpec,
    triangles: &[[Vec3; 3]],
    primitives: &[BuildPrimitive],
    max_leaf: u32,
) -> PackedTree {
    if primitives.is_empty() {
        return PackedTree {
            nodes: Vec::new(),
            primitives: Vec::new(),
            aabb: Aabb::empty(),
        };
    }
    let max_child = max_leaf.clamp(1, MAX_CHILD_PRIMITIVES);
    let binary = |max_leaf: u32| build_scene(spec, triangles, primitives, max_leaf);
    match spec.builder {
        Builder::Ploc | Builder::Cwbvh => PackedTree::collapse(&binary(max_child), max_child),
        Builder::None | Builder::Plane | Builder::Sah | Builder::Median => {
            let mut binary = binary(max_leaf);
            split_leaves(&mut binary, max_child);
            PackedTree::collapse(&binary, max_child)
        }
    }
}

/// Splits leaves until each has at most `max_child` primitives. The new nodes keep the box of the
/// former leaf, so a ray that meets it is still tested with all its primitives.
fn split_leaves(tree: &mut BinaryTree, max_child: u32) {
    let mut i = 0;
    while i < tree.nodes.len() {
        let (aabb, range) = (tree.nodes[i].aabb(), tree.nodes[i].range());
        if range.len() > max_child as usize {
            let (first, count) = (range.start as u32, range.len() as u32);
            let (half, children) = (count / 2, tree.nodes.len() as u32);
            tree.nodes.push(BinaryNode::leaf(aabb, first, half));
            tree.nodes
                .push(BinaryNode::leaf(aabb, first + half, count - half));
            tree.nodes[i] = BinaryNode::inner(aabb, children);
        }
        i += 1;
    }
}

impl PackedTree {
    /// Collapses a binary tree whose leaves have at most `max_child` primitives, so that the cost
    /// by the surface area heuristic is least.
    fn collapse(binary: &BinaryTree, max_child: u32) -> PackedTree {
        let counts = binary.weights(|_| 1);
        let costs = CollapseCosts::new(binary, |i| {
            let node = &binary.nodes[i];
            let cost = node.half_area() * counts[i] as f32 * PRIMITIVE_COST;
            if node.is_leaf() {
                LeafChoice::Always(cost)
            } else if counts[i] <= max_child {
                LeafChoice::Allowed(cost)
            } else {
                LeafChoice::Never
            }
        });
        let aabb = binary.nodes[0].aabb();
        let mut tree = PackedTree {
            nodes: vec![PackedNode::new(&aabb, 0, 0)],
            primitives: Vec::with_capacity(binary.primitives.len()),
            aabb,
        };
        // Work list of binary nodes and the packed nodes in their place.
        let mut work = vec![(0, 0)];
        while let Some((binary_node, packed_node)) = work.pop() {
            let mut children = [0; LANES];
            // The root has a node even if it becomes a leaf.
            let count = if costs.is_leaf(binary_node) {
                children[0] = binary_node;
                1
            } else {
                costs.select_children(binary_node, &mut children)
            };
            let mut node = PackedNode::new(
                &binary.nodes[binary_node].aabb(),
                tree.nodes.len(),
                tree.primitives.len(),
            );
            let slots = assign_slots(binary, binary_node, &children[..count]);
            for (slot, child) in slots.into_iter().enumerate() {
                let Some(child) = child else { continue };
                let aabb = binary.nodes[child].aabb();
                if costs.is_leaf(child) {
                    let offset = tree.primitives.len() - node.first_primitive as usize;
                    binary.collect_primitives(child, &mut tree.primitives);
                    node.set_leaf(slot, &aabb, offset, counts[child] as usize);
                } else {
                    node.set_inner(slot, &aabb);
                    work.push((child, tree.nodes.len()));
                    tree.nodes.push(node);
                }
            }
            tree.nodes[packed_node] = node;
        }
        tree
    }

    /// Returns the number of levels of nodes. Traversal pushes at most one stack entry per level.
    pub fn levels(&self) -> usize {
        let mut work: Vec<(usize, usize)> =
            self.nodes.first().map(|_| (0, 1)).into_iter().collect();
        let mut levels = 0;
        while let Some((node, level)) = work.pop() {
            levels = levels.max(level);
            let node = &self.nodes[node];
            let children = node.inner.count_ones() as usize;
            work.extend((0..children).map(|i| (node.first_child as usize + i, level + 1)));
        }
        levels
    }

    /// Returns the size in bytes of nodes and primitive indices.
    pub fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice()) + size_of_val(self.primitives.as_slice())
    }

    /// Returns the expected cost of a ray that meets the tree's box, by the surface area heuristic:
    /// 1 for each visited node, and `primitive_cost` of its index for each tested primitive.
    pub fn cost(&self, primitive_cost: impl Fn(u32) -> f64) -> f64 {
        let sum_of = |indices: &[u32]| indices.iter().map(|i| primitive_cost(*i)).sum::<f64>();
        let root_area = f64::from(self.aabb.half_area());
        if self.nodes.is_empty() || root_area <= 0.0 {
            return sum_of(&self.primitives);
        }
        let mut sum = root_area;
        for node in &self.nodes {
            for slot in 0..LANES {
                let cost = match node.slot(slot) {
                    Slot::Empty => continue,
                    Slot::Inner(_) => 1.0,
                    Slot::Leaf(first, count) => sum_of(&self.primitives[first..first + count]),
                };
                sum += f64::from(node.child_aabb(slot).half_area()) * cost;
            }
        }
        sum / root_area
    }
}

/// Assigns children to slots, so that a child with a set bit in its slot lies at greater
/// coordinates than others [Ylitie et al. 2017, section 3.3]. The sum over the children of the
/// distance of their centre along the diagonal of their slot is increased by exchanges of two
/// slots, until no exchange increases it.
fn assign_slots(binary: &BinaryTree, node: usize, children: &[usize]) -> [Option<usize>; LANES] {
    let center = binary.nodes[node].aabb().center();
    let mut slots = [None; LANES];
    let mut offsets = [Vec3A::ZERO; LANES];
    for (slot, child) in children.iter().enumerate() {
        slots[slot] = Some(*child);
        offsets[slot] = binary.nodes[*child].aabb().center() - center;
    }
    // Rounding could repeat exchanges; a few rounds suffice.
    for _ in 0..LANES {
        let mut exchanged = false;
        for a in 0..LANES {
            for b in a + 1..LANES {
                let step = |bit: usize| (b >> bit & 1) as f32 - (a >> bit & 1) as f32;
                let from_a_to_b = Vec3A::new(step(2), step(1), step(0));
                if (offsets[a] - offsets[b]).dot(from_a_to_b) > 0.0 {
                    slots.swap(a, b);
                    offsets.swap(a, b);
                    exchanged = true;
                }
            }
        }
        if !exchanged {
            break;
        }
    }
    slots
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::bvh::test_primitives::{degenerate_boxes, random_boxes};

    /// Returns `count` unit cubes in a row.
    fn row(count: u32) -> Vec<BuildPrimitive> {
        let corner = |i: u32| Vec3A::new(2.0 * i as f32, 0.0, 0.0);
        (0..count)
            .map(|i| BuildPrimitive::from_box(corner(i), corner(i) + 1.0))
            .collect()
    }

    #[test]
    fn every_builder_packs_every_primitive_once() {
        for builder in Builder::ALL {
            for (count, max_leaf) in [(1, 8), (2, 1), (77, 8), (300, 1)] {
                let spec = AccelSpec {
                    builder,
                    ..AccelSpec::default()
                };
                let tree = build_packed(&spec, &[], &row(count), max_leaf);
                let mut indices = tree.primitives.clone();
                indices.sort_unstable();
                assert_eq!(
                    indices,
                    (0..count).collect::<Vec<_>>(),
                    "{builder:?} {count} {max_leaf}"
                );
                let slots = tree
                    .nodes
                    .iter()
                    .flat_map(|n| (0..LANES).map(|s| n.slot(s)));
                let largest = slots.map(|slot| match slot {
                    Slot::Leaf(_, count) => count as u32,
                    _ => 0,
                });
                let max_prims = largest.max().unwrap_or(0);
                assert!(
                    max_prims <= max_leaf.min(MAX_CHILD_PRIMITIVES),
                    "{builder:?} has {max_prims} of at most {max_leaf}"
                );
            }
        }
        assert!(
            build_packed(&AccelSpec::default(), &[], &[], 8)
                .nodes
                .is_empty()
        );
    }

    #[test]
    fn an_undivided_leaf_is_tested_completely() {
        let primitives = row(64);
        let cost_with = |max_leaf: u32, max_depth: u32| {
            let spec = AccelSpec {
                builder: Builder::Sah,
                max_depth,
                ..AccelSpec::default()
            };
            build_packed(&spec, &[], &primitives, max_leaf).cost(|_| 1.0)
        };
        // A ray that meets the box of the scene is tested with all 64.
        let none = AccelSpec {
            builder: Builder::None,
            ..AccelSpec::default()
        };
        let whole = build_packed(&none, &[], &primitives, 8).cost(|_| 1.0);
        assert!(whole > 64.0, "{whole}");
        assert_eq!(cost_with(8, 0), whole);
        let (fine, coarse) = (cost_with(1, 48), cost_with(16, 48));
        assert!(fine < coarse && coarse < whole, "{fine} {coarse} {whole}");
        // An instance in a leaf costs as much as its mesh.
        assert!(build_packed(&none, &[], &primitives, 8).cost(|_| 3.0) > 2.0 * whole);
    }

    /// Asserts that the boxes of a node's children contain all primitives below them, and returns
    /// the number of these.
    fn check_node(
        tree: &PackedTree,
        primitives: &[BuildPrimitive],
        node: usize,
        all: &[Aabb],
    ) -> usize {
        let mut count = 0;
        for slot in 0..LANES {
            let inside = |aabb: Aabb| [all, &[aabb]].concat();
            match tree.nodes[node].slot(slot) {
                Slot::Empty => {}
                Slot::Inner(child) => {
                    let aabb = tree.nodes[node].child_aabb(slot);
                    count += check_node(tree, primitives, child, &inside(aabb));
                }
                Slot::Leaf(first, members) => {
                    let boxes = inside(tree.nodes[node].child_aabb(slot));
                    for i in &tree.primitives[first..first + members] {
                        let own = primitives[*i as usize].aabb;
                        assert!(boxes.iter().all(|aabb| aabb.contains(&own)), "{i}");
                    }
                    count += members;
                }
            }
        }
        count
    }

    #[test]
    fn compressed_boxes_contain_their_primitives() {
        let mut inputs = degenerate_boxes();
        inputs.extend([3, 50, 5000].map(|n| ("random", random_boxes(n, n as u32))));
        for (name, primitives) in inputs {
            for builder in Builder::ALL {
                let spec = AccelSpec {
                    builder,
                    ..AccelSpec::default()
                };
                let tree = build_packed(&spec, &[], &primitives, 8);
                let found = check_node(&tree, &primitives, 0, &[tree.aabb]);
                assert_eq!(found, primitives.len(), "{name} {builder:?}");
                assert!(
                    tree.levels() > 0 && tree.bytes() >= 84,
                    "{name} {builder:?}"
                );
            }
        }
    }
}
