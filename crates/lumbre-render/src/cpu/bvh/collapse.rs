//! Optimal collapse of a binary tree to nodes of eight children [Ylitie et al. 2017, section 3.2]:
//! dynamic programming over the least cost of each subtree for each number of wide nodes and leaves
//! that together represent it.

use obvhs::bvh2::Bvh2;

use super::build_primitive::range;
use super::simd::LANES;

/// Least costs of the subtrees of a binary tree. The cost of a wide tree is the sum of the areas of
/// its nodes.
pub(crate) struct CollapseCosts<'a, F> {
    tree: &'a Bvh2,
    /// Whether a node of the binary tree becomes a leaf, if it is not above one.
    is_leaf: F,
    /// Costs of each inner node, by the number of its pair of children. Entry `i` is the cost of at
    /// most `i + 1` wide nodes and leaves, except for the last: the cost of the eight children of a
    /// wide node in its place.
    costs: Vec<[f32; LANES]>,
}

impl<'a, F: Fn(usize) -> bool> CollapseCosts<'a, F> {
    /// Computes the costs. `is_leaf` must be true for leaves of the binary tree.
    pub fn new(tree: &'a Bvh2, is_leaf: F) -> CollapseCosts<'a, F> {
        let mut all = CollapseCosts {
            tree,
            is_leaf,
            costs: vec![[0.0; LANES]; tree.nodes.len() / 2],
        };
        // Children follow their parents.
        for i in (0..tree.nodes.len()).rev() {
            if !all.is_leaf(i) {
                let pair = all.pair(i);
                all.costs[pair] = all.compute(i);
            }
        }
        all
    }

    /// Computes the costs of an inner node from those of its children.
    fn compute(&self, i: usize) -> [f32; LANES] {
        let node = &self.tree.nodes[i];
        let first = node.first_index as usize;
        let (left, right) = (self.costs(first), self.costs(first + 1));
        let mut costs = [f32::INFINITY; LANES];
        for count in 2..=LANES {
            for k in 1..count {
                costs[count - 1] = costs[count - 1].min(left[k - 1] + right[count - k - 1]);
            }
        }
        costs[0] = node.aabb().half_area() + costs[LANES - 1];
        for count in 2..LANES {
            costs[count - 1] = costs[count - 1].min(costs[count - 2]);
        }
        costs
    }

    /// Returns the number of the pair of children of an inner node.
    fn pair(&self, i: usize) -> usize {
        self.tree.nodes[i].first_index as usize / 2
    }

    /// Returns the costs of a node.
    fn costs(&self, i: usize) -> [f32; LANES] {
        if self.is_leaf(i) {
            [0.0; LANES]
        } else {
            self.costs[self.pair(i)]
        }
    }

    /// Returns whether a node becomes a leaf, if it is not replaced by its children.
    pub fn is_leaf(&self, i: usize) -> bool {
        (self.is_leaf)(i)
    }

    /// Selects the children of the wide node in the place of a node. Returns their number, which is
    /// at least 2.
    pub fn select_children(&self, i: usize, children: &mut [usize; LANES]) -> usize {
        let mut found = 0;
        // Subtrees with the number of children that represent them. Their sum is at most `LANES`.
        let mut pending = [(0, 0); LANES];
        let mut depth = self.distribute(i, LANES, 0, &mut pending);
        while depth > 0 {
            depth -= 1;
            let (node, mut count) = pending[depth];
            let costs = self.costs(node);
            while count > 1 && costs[count - 2] <= costs[count - 1] {
                count -= 1;
            }
            if count == 1 {
                children[found] = node;
                found += 1;
            } else {
                depth = self.distribute(node, count, depth, &mut pending);
            }
        }
        found
    }

    /// Distributes `count` children to both subtrees of a node at the least cost, and stores these
    /// in `pending` from `depth` on. Returns the new depth.
    fn distribute(
        &self,
        i: usize,
        count: usize,
        depth: usize,
        pending: &mut [(usize, usize); LANES],
    ) -> usize {
        let first = self.tree.nodes[i].first_index as usize;
        let (left, right) = (self.costs(first), self.costs(first + 1));
        let cost = |k: usize| left[k - 1] + right[count - k - 1];
        let best = (2..count).fold(1, |best, k| if cost(k) < cost(best) { k } else { best });
        pending[depth] = (first + 1, count - best);
        pending[depth + 1] = (first, best);
        depth + 2
    }
}

/// Returns the sum over the primitives below each node of their weights. Sums are limited to the
/// largest integer.
pub(crate) fn weights(tree: &Bvh2, weight: impl Fn(u32) -> u32) -> Vec<u32> {
    let mut weights = vec![0u32; tree.nodes.len()];
    for (i, node) in tree.nodes.iter().enumerate().rev() {
        weights[i] = if node.is_leaf() {
            let members = tree.primitive_indices[range(node)].iter();
            members.map(|p| weight(*p)).fold(0, u32::saturating_add)
        } else {
            let first = node.first_index as usize;
            weights[first].saturating_add(weights[first + 1])
        };
    }
    weights
}

/// Appends the primitives below a node to `list`, in the order of the tree.
pub(crate) fn collect_primitives(tree: &Bvh2, node: usize, list: &mut Vec<u32>) {
    let mut work = vec![node];
    while let Some(i) = work.pop() {
        let node = &tree.nodes[i];
        if node.is_leaf() {
            list.extend_from_slice(&tree.primitive_indices[range(node)]);
        } else {
            work.extend([node.first_index as usize + 1, node.first_index as usize]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::bvh::build::build_binary;
    use crate::cpu::bvh::test_primitives::{degenerate_boxes, random_boxes};
    use crate::hierarchy::AccelSpec;

    /// Returns all ways to represent the subtree of a node by at most `count` nodes.
    fn fronts(tree: &Bvh2, i: usize, count: usize) -> Vec<Vec<usize>> {
        let mut all = vec![vec![i]];
        if !tree.nodes[i].is_leaf() {
            all.extend(split_fronts(tree, i, count));
        }
        all
    }

    /// Returns those of [`fronts`] that do not consist of the node itself.
    fn split_fronts(tree: &Bvh2, i: usize, count: usize) -> Vec<Vec<usize>> {
        let first = tree.nodes[i].first_index as usize;
        let mut all = Vec::new();
        if count > 1 {
            for left in fronts(tree, first, count - 1) {
                for right in fronts(tree, first + 1, count - left.len()) {
                    all.push([left.clone(), right].concat());
                }
            }
        }
        all
    }

    /// Returns the cost of the wide tree that replaces a subtree.
    fn collapsed<F: Fn(usize) -> bool>(all: &CollapseCosts<F>, i: usize) -> f32 {
        if all.is_leaf(i) {
            return 0.0;
        }
        let mut children = [0; LANES];
        let count = all.select_children(i, &mut children);
        let below: f32 = children[..count].iter().map(|c| collapsed(all, *c)).sum();
        all.tree.nodes[i].aabb().half_area() + below
    }

    #[test]
    fn the_cost_is_the_least_of_all_collapses() {
        for seed in 0..12 {
            let tree = build_binary(&AccelSpec::default(), &random_boxes(26, seed), 1);
            let counts = weights(&tree, |_| 1);
            // Cost of each subtree as one node, by trying everything.
            let mut least = vec![0.0f32; tree.nodes.len()];
            for i in (0..tree.nodes.len()).rev().filter(|i| counts[*i] > 2) {
                let cost = |front: Vec<usize>| front.iter().map(|c| least[*c]).sum::<f32>();
                let below = split_fronts(&tree, i, LANES).into_iter().map(cost);
                let area = tree.nodes[i].aabb().half_area();
                least[i] = area + below.fold(f32::INFINITY, f32::min);
            }
            let found = collapsed(&CollapseCosts::new(&tree, |i| counts[i] <= 2), 0);
            assert!(
                (found / least[0] - 1.0).abs() < 1e-5,
                "{found} {}",
                least[0]
            );
        }
    }

    #[test]
    fn degenerate_trees_are_collapsed_completely() {
        for (name, primitives) in degenerate_boxes() {
            let tree = build_binary(&AccelSpec::default(), &primitives, 1);
            let all = CollapseCosts::new(&tree, |i| tree.nodes[i].is_leaf());
            let (mut work, mut leaves) = (vec![0], Vec::new());
            while let Some(i) = work.pop() {
                if all.is_leaf(i) {
                    collect_primitives(&tree, i, &mut leaves);
                    continue;
                }
                let mut children = [0; LANES];
                let count = all.select_children(i, &mut children);
                assert!(
                    count > 1 && children[..count].iter().all(|c| *c > i),
                    "{name}"
                );
                work.extend(&children[..count]);
            }
            assert_eq!(leaves.len(), primitives.len(), "{name}");
        }
    }
}
