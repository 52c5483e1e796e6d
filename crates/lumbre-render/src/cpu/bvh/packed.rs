//! Compressed eight-wide trees [Ylitie et al. 2017]. `vulkan-compute` traverses them for every
//! builder, the CPU only for the builder `cwbvh`.
//!
//! Every primitive is in exactly one leaf, and a child has at most [`MAX_CHILD_PRIMITIVES`].

use std::time::Duration;

use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh;
use obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;

use super::build::{BuildPrimitive, build_binary, params};
use crate::hierarchy::{AccelSpec, Builder};

/// Maximum number of primitives in a child of a compressed node.
const MAX_CHILD_PRIMITIVES: u32 = 3;

/// Builds the tree over `primitives`, with at most `max_leaf` and [`MAX_CHILD_PRIMITIVES`] of them
/// in one child. `ploc` and `cwbvh` give the same tree. The binary trees of the other builders are
/// collapsed by `obvhs`.
pub fn build_packed(spec: &AccelSpec, primitives: &[BuildPrimitive], max_leaf: u32) -> CwBvh {
    if primitives.is_empty() {
        return CwBvh::default();
    }
    let max_prims = max_leaf.clamp(1, MAX_CHILD_PRIMITIVES);
    match spec.builder {
        Builder::Ploc | Builder::Cwbvh => {
            let boxes: Vec<Aabb> = primitives.iter().map(|b| b.aabb).collect();
            let params = BvhBuildParams {
                max_prims_per_leaf: max_prims,
                ..params(spec.quality)
            };
            build_cwbvh(&boxes, params, &mut Duration::default())
        }
        Builder::None | Builder::Plane | Builder::Sah => bvh2_to_cwbvh(
            &with_single_primitive_leaves(build_binary(spec, primitives, max_leaf)),
            max_prims,
            true,
            false,
        ),
    }
}

/// Splits leaves until each has one primitive, as the conversion to the compressed form requires.
/// The new nodes keep the box of the former leaf, so a ray that meets it is still tested with all
/// its primitives.
fn with_single_primitive_leaves(mut tree: Bvh2) -> Bvh2 {
    let mut work: Vec<usize> = (0..tree.nodes.len()).collect();
    while let Some(leaf) = work.pop() {
        let Bvh2Node {
            prim_count: count,
            first_index: first,
            ..
        } = tree.nodes[leaf];
        if count < 2 {
            continue;
        }
        let (aabb, children) = (*tree.nodes[leaf].aabb(), tree.nodes.len());
        tree.nodes.push(Bvh2Node::new(aabb, count / 2, first));
        tree.nodes
            .push(Bvh2Node::new(aabb, count - count / 2, first + count / 2));
        (tree.nodes[leaf].prim_count, tree.nodes[leaf].first_index) = (0, children as u32);
        work.extend([children, children + 1]);
    }
    tree
}

/// Returns the number of levels of nodes. Traversal pushes at most one stack entry per level.
pub fn levels(tree: &CwBvh) -> usize {
    let mut pending: Vec<(usize, usize)> = tree.nodes.first().map(|_| (0, 1)).into_iter().collect();
    let mut levels = 0;
    while let Some((node, level)) = pending.pop() {
        levels = levels.max(level);
        let node = &tree.nodes[node];
        let children = node.imask.count_ones() as usize;
        pending.extend((0..children).map(|i| (node.child_base_idx as usize + i, level + 1)));
    }
    levels
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
        for child in (0..8).filter(|child| !node.is_child_empty(*child)) {
            let area = f64::from(node.child_aabb(child).half_area());
            let cost = if node.is_leaf(child) {
                let (first, count) = node.child_primitives(child);
                sum_of(&tree.primitive_indices[first as usize..(first + count) as usize])
            } else {
                1.0
            };
            sum += area * cost;
        }
    }
    sum / root_area
}

#[cfg(test)]
mod tests {
    use glam::Vec3A;

    use crate::cpu::bvh::packed::*;

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
                let tree = build_packed(&spec, &row(count), max_leaf);
                let mut indices = tree.primitive_indices.clone();
                indices.sort_unstable();
                assert_eq!(
                    indices,
                    (0..count).collect::<Vec<_>>(),
                    "{builder:?} {count} {max_leaf}"
                );
                let leaves = tree
                    .nodes
                    .iter()
                    .flat_map(|node| (0..8).map(move |child| (node, child)));
                let leaves = leaves
                    .filter(|(node, child)| !node.is_child_empty(*child) && node.is_leaf(*child));
                let max_prims = leaves
                    .map(|(node, child)| node.child_primitives(child).1)
                    .max()
                    .unwrap_or(0);
                assert!(
                    max_prims <= max_leaf.min(MAX_CHILD_PRIMITIVES),
                    "{builder:?} has {max_prims} of at most {max_leaf}"
                );
            }
        }
        assert!(build_packed(&AccelSpec::default(), &[], 8).nodes.is_empty());
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
            cost(&build_packed(&spec, &primitives, max_leaf), |_| 1.0)
        };
        // A ray that meets the box of the scene is tested with all 64.
        let none = AccelSpec {
            builder: Builder::None,
            ..AccelSpec::default()
        };
        let whole = cost(&build_packed(&none, &primitives, 8), |_| 1.0);
        assert!(whole > 64.0, "{whole}");
        assert_eq!(cost_with(8, 0), whole);
        let (fine, coarse) = (cost_with(1, 48), cost_with(16, 48));
        assert!(fine < coarse && coarse < whole, "{fine} {coarse} {whole}");
        // An instance in a leaf costs as much as its mesh.
        assert!(cost(&build_packed(&none, &primitives, 8), |_| 3.0) > 2.0 * whole);
    }
}
