//! Compressed eight-wide trees of `obvhs` [Ylitie et al. 2017]. `vulkan-compute` traverses them for
//! every builder, the CPU only for the builder `cwbvh`.
//!
//! A child has at most [`MAX_CHILD_PRIMITIVES`] primitives. Boxes of children contain what is below
//! them, except for rounding errors of 2^-24 of the size of the parent's box, which traversals allow
//! for.

use std::ops::Range;

use glam::Vec3;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;
pub use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
pub use obvhs::cwbvh::node::CwBvhNode;

use super::build::build_scene;
use super::build_primitive::BuildPrimitive;
use super::simd::LANES;
use crate::hierarchy::{AccelSpec, Builder};

/// Maximum number of primitives in a child of a compressed node.
const MAX_CHILD_PRIMITIVES: u32 = 3;

/// Share of its size by which a box is enlarged. `obvhs` computes the size of a node's cells by a
/// logarithm, whose rounding error could make 255 of them shorter than the node.
const ENLARGEMENT: f32 = 1.0 / (1 << 18) as f32;

/// Builds the tree over `primitives`, of which the first are those of `triangles`, with at most
/// `max_leaf` and [`MAX_CHILD_PRIMITIVES`] of them in one child. `ploc` and `cwbvh` give the same
/// tree.
pub fn build_packed(
    spec: &AccelSpec,
    triangles: &[[Vec3; 3]],
    primitives: &[BuildPrimitive],
    max_leaf: u32,
) -> CwBvh {
    if primitives.is_empty() {
        return CwBvh::default();
    }
    // The conversion merges leaves of one primitive where that costs less.
    let max_binary = match spec.builder {
        Builder::Ploc | Builder::Cwbvh => 1,
        _ => max_leaf,
    };
    let mut binary = build_scene(spec, triangles, primitives, max_binary);
    split_leaves(&mut binary);
    for node in &mut binary.nodes {
        let Aabb { min, max } = *node.aabb();
        node.set_aabb(Aabb::new(min, max + (max - min) * ENLARGEMENT));
    }
    bvh2_to_cwbvh(
        &binary,
        max_leaf.clamp(1, MAX_CHILD_PRIMITIVES),
        true,
        false,
    )
}

/// Splits leaves until each has one primitive, as the conversion requires. The new nodes keep the
/// box of the former leaf, so a ray that meets it is still tested with all its primitives.
fn split_leaves(tree: &mut Bvh2) {
    let mut i = 0;
    while i < tree.nodes.len() {
        let leaf = tree.nodes[i];
        if leaf.prim_count > 1 {
            let (first, half, children) = (leaf.first_index, leaf.prim_count / 2, tree.nodes.len());
            let halves = [(first, half), (first + half, leaf.prim_count - half)];
            let halves = halves.map(|(first, count)| Bvh2Node::new(*leaf.aabb(), count, first));
            tree.nodes.extend(halves);
            tree.nodes[i].make_inner(children as u32);
        }
        i += 1;
    }
}

/// Returns the number of levels of nodes. Traversal pushes at most one stack entry per level.
pub fn levels(tree: &CwBvh) -> usize {
    let mut work: Vec<(usize, usize)> = tree.nodes.first().map(|_| (0, 1)).into_iter().collect();
    let mut levels = 0;
    while let Some((node, level)) = work.pop() {
        levels = levels.max(level);
        let node = &tree.nodes[node];
        let children = node.imask.count_ones() as usize;
        work.extend((0..children).map(|i| (node.child_base_idx as usize + i, level + 1)));
    }
    levels
}

/// Returns the size in bytes of nodes and primitive indices.
pub fn bytes(tree: &CwBvh) -> usize {
    size_of_val(tree.nodes.as_slice()) + size_of_val(tree.primitive_indices.as_slice())
}

/// Returns the range of [`CwBvh::primitive_indices`] of a child that is a leaf.
#[inline(always)]
pub(crate) fn child_range(node: &CwBvhNode, child: usize) -> Range<usize> {
    let (first, count) = node.child_primitives(child);
    first as usize..(first + count) as usize
}

/// Returns the expected cost of a ray that meets the tree's box, by the surface area heuristic: 1
/// for each visited node, and `primitive_cost` of its index for each tested primitive.
pub fn cost(tree: &CwBvh, primitive_cost: impl Fn(u32) -> f64) -> f64 {
    let sum_of = |indices: &[u32]| indices.iter().map(|i| primitive_cost(*i)).sum::<f64>();
    let root_area = f64::from(tree.total_aabb.half_area());
    if tree.nodes.is_empty() || root_area <= 0.0 {
        return sum_of(&tree.primitive_indices);
    }
    let mut sum = root_area;
    for node in &tree.nodes {
        for child in (0..LANES).filter(|child| !node.is_child_empty(*child)) {
            let cost = if node.is_leaf(child) {
                sum_of(&tree.primitive_indices[child_range(node, child)])
            } else {
                1.0
            };
            sum += f64::from(node.child_aabb(child).half_area()) * cost;
        }
    }
    sum / root_area
}

#[cfg(test)]
mod tests {
    use glam::Vec3A;

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
                let mut indices = tree.primitive_indices.clone();
                indices.sort_unstable();
                assert_eq!(
                    indices,
                    (0..count).collect::<Vec<_>>(),
                    "{builder:?} {count} {max_leaf}"
                );
                let children = tree
                    .nodes
                    .iter()
                    .flat_map(|n| (0..LANES).map(move |i| (n, i)));
                let leaves = children.filter(|(node, child)| node.is_leaf(*child));
                let counts = leaves.map(|(node, child)| node.child_primitives(child).1);
                let max_prims = counts.max().unwrap_or(0);
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
            cost(&build_packed(&spec, &[], &primitives, max_leaf), |_| 1.0)
        };
        // A ray that meets the box of the scene is tested with all 64.
        let none = AccelSpec {
            builder: Builder::None,
            ..AccelSpec::default()
        };
        let whole = cost(&build_packed(&none, &[], &primitives, 8), |_| 1.0);
        assert!(whole > 64.0, "{whole}");
        assert_eq!(cost_with(8, 0), whole);
        let (fine, coarse) = (cost_with(1, 48), cost_with(16, 48));
        assert!(fine < coarse && coarse < whole, "{fine} {coarse} {whole}");
        // An instance in a leaf costs as much as its mesh.
        assert!(cost(&build_packed(&none, &[], &primitives, 8), |_| 3.0) > 2.0 * whole);
    }

    /// Asserts that the boxes of a node's children contain all primitives below them, except for
    /// rounding errors, and returns the number of these.
    fn check_node(tree: &CwBvh, primitives: &[BuildPrimitive], node: usize, all: &[Aabb]) -> usize {
        let node = &tree.nodes[node];
        let mut count = 0;
        for child in (0..LANES).filter(|child| !node.is_child_empty(*child)) {
            let Aabb { min, max } = node.child_aabb(child);
            let rounding = node.aabb().diagonal() + min.abs().max(max.abs());
            let rounding = rounding * f32::EPSILON;
            let inside = [all, &[Aabb::new(min - rounding, max + rounding)]].concat();
            if !node.is_leaf(child) {
                let next = node.child_node_index(child) as usize;
                count += check_node(tree, primitives, next, &inside);
                continue;
            }
            for i in &tree.primitive_indices[child_range(node, child)] {
                let own = primitives[*i as usize].aabb;
                assert!(inside.iter().all(|aabb| aabb.union(&own) == *aabb), "{i}");
                count += 1;
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
                let found = check_node(&tree, &primitives, 0, &[tree.total_aabb]);
                assert_eq!(found, primitives.len(), "{name} {builder:?}");
                assert!(
                    levels(&tree) > 0 && bytes(&tree) >= 84,
                    "{name} {builder:?}"
                );
            }
        }
    }

    #[test]
    fn nodes_whose_size_is_near_a_power_of_two_contain_their_children() {
        for exponent in -60..60 {
            for ulps in 0..40 {
                let size = 255.0 * f32::powi(2.0, exponent);
                let high = Vec3A::splat(f32::from_bits(size.to_bits() + ulps));
                let ends = [(Vec3A::ZERO, Vec3A::ZERO), (high, high)];
                let boxes = ends.map(|(low, high)| BuildPrimitive::from_box(low, high));
                let tree = build_packed(&AccelSpec::default(), &[], &boxes, 1);
                assert_eq!(check_node(&tree, &boxes, 0, &[]), 2);
            }
        }
    }
}
