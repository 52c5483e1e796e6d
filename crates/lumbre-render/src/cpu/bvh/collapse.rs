//! Optimal collapse of a binary tree to nodes of eight children [Ylitie et al. 2017, section 3.2]:
//! dynamic programming over the least cost of each subtree for each number of wide nodes and leaves
//! that together represent it.

use super::binary::BinaryTree;
use super::simd::LANES;

/// Whether a node of a binary tree becomes a leaf of the wide tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum LeafChoice {
    /// It becomes a wide node or is replaced by its children.
    Never,
    /// It becomes a leaf of this cost if no other choice costs less.
    Allowed(f32),
    /// It becomes a leaf of this cost.
    Always(f32),
}

/// Least costs of the subtrees of a binary tree. The cost of a wide tree is the sum of the areas of
/// its nodes and the costs of its leaves.
pub(crate) struct CollapseCosts<'a, F> {
    tree: &'a BinaryTree,
    choice: F,
    /// Costs of each inner node, by the number of its pair of children. Entry `i` is the cost of at
    /// most `i + 1` wide nodes and leaves, except for the last: the cost of the eight children of a
    /// wide node in its place.
    costs: Vec<[f32; LANES]>,
}

impl<'a, F: Fn(usize) -> LeafChoice> CollapseCosts<'a, F> {
    /// Computes the costs. `choice` must return [`LeafChoice::Always`] for leaves of the binary
    /// tree.
    pub fn new(tree: &'a BinaryTree, choice: F) -> CollapseCosts<'a, F> {
        let mut all = CollapseCosts {
            tree,
            choice,
            costs: vec![[0.0; LANES]; tree.nodes.len() / 2],
        };
        // Children follow their parents.
        for i in (0..tree.nodes.len()).rev() {
            let choice = (all.choice)(i);
            if !matches!(choice, LeafChoice::Always(_)) {
                let pair = all.pair(i);
                all.costs[pair] = all.compute(i, choice);
            }
        }
        all
    }

    /// Computes the costs of an inner node from those of its children.
    fn compute(&self, i: usize, choice: LeafChoice) -> [f32; LANES] {
        let node = &self.tree.nodes[i];
        let left = self.costs(node.first_child());
        let right = self.costs(node.first_child() + 1);
        let mut costs = [f32::INFINITY; LANES];
        for count in 2..=LANES {
            for k in 1..count {
                costs[count - 1] = costs[count - 1].min(left[k - 1] + right[count - k - 1]);
            }
        }
        let wide = node.half_area() + costs[LANES - 1];
        costs[0] = match choice {
            LeafChoice::Allowed(leaf) => wide.min(leaf),
            _ => wide,
        };
        for count in 2..LANES {
            costs[count - 1] = costs[count - 1].min(costs[count - 2]);
        }
        costs
    }

    /// Returns the number of the pair of children of an inner node.
    fn pair(&self, i: usize) -> usize {
        self.tree.nodes[i].first_child() / 2
    }

    /// Returns the costs of a node.
    fn costs(&self, i: usize) -> [f32; LANES] {
        match (self.choice)(i) {
            LeafChoice::Always(cost) => [cost; LANES],
            _ => self.costs[self.pair(i)],
        }
    }

    /// Returns whether a node becomes a leaf, if it is not replaced by its children.
    pub fn is_leaf(&self, i: usize) -> bool {
        match (self.choice)(i) {
            LeafChoice::Always(_) => true,
            LeafChoice::Allowed(cost) => self.costs(i)[0] >= cost,
            LeafChoice::Never => false,
        }
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
        let first = self.tree.nodes[i].first_child();
        let (left, right) = (self.costs(first), self.costs(first + 1));
        let cost = |k: usize| left[k - 1] + right[count - k - 1];
        let best = (2..count).fold(1, |best, k| if cost(k) < cost(best) { k } else { best });
        pending[depth] = (first + 1, count - best);
        pending[depth + 1] = (first, best);
        depth + 2
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::bvh::ploc::build_clusters;
    use crate::cpu::bvh::test_primitives::{degenerate_boxes, random_boxes};

    /// Returns all ways to represent the subtree of a node by at most `count` nodes.
    fn fronts(tree: &BinaryTree, i: usize, count: usize) -> Vec<Vec<usize>> {
        let mut all = vec![vec![i]];
        if !tree.nodes[i].is_leaf() {
            all.extend(split_fronts(tree, i, count));
        }
        all
    }

    /// Returns those of [`fronts`] that do not consist of the node itself.
    fn split_fronts(tree: &BinaryTree, i: usize, count: usize) -> Vec<Vec<usize>> {
        let first = tree.nodes[i].first_child();
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
    fn collapsed<F: Fn(usize) -> LeafChoice>(all: &CollapseCosts<F>, i: usize) -> f32 {
        if all.is_leaf(i) {
            return match (all.choice)(i) {
                LeafChoice::Always(cost) | LeafChoice::Allowed(cost) => cost,
                LeafChoice::Never => f32::NAN,
            };
        }
        let mut children = [0; LANES];
        let count = all.select_children(i, &mut children);
        let below: f32 = children[..count].iter().map(|c| collapsed(all, *c)).sum();
        all.tree.nodes[i].half_area() + below
    }

    #[test]
    fn the_cost_is_the_least_of_all_collapses() {
        for seed in 0..12 {
            let tree = build_clusters(&random_boxes(26, seed), 4, 1);
            let counts = tree.weights(|_| 1);
            let choice = |i: usize| {
                let cost = tree.nodes[i].half_area() * counts[i] as f32 * 0.3;
                match counts[i] {
                    1 => LeafChoice::Always(cost),
                    2 | 3 => LeafChoice::Allowed(cost),
                    _ => LeafChoice::Never,
                }
            };
            // Cost of each subtree as one node, by trying everything.
            let mut least = vec![0.0f32; tree.nodes.len()];
            for i in (0..tree.nodes.len()).rev() {
                let leaf = match choice(i) {
                    LeafChoice::Always(cost) => {
                        least[i] = cost;
                        continue;
                    }
                    LeafChoice::Allowed(cost) => cost,
                    LeafChoice::Never => f32::INFINITY,
                };
                let cost = |front: Vec<usize>| front.iter().map(|c| least[*c]).sum::<f32>();
                let below = split_fronts(&tree, i, LANES).into_iter().map(cost);
                let wide = tree.nodes[i].half_area() + below.fold(f32::INFINITY, f32::min);
                least[i] = wide.min(leaf);
            }
            let found = collapsed(&CollapseCosts::new(&tree, choice), 0);
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
            let tree = build_clusters(&primitives, 8, 1);
            let choice = |i: usize| match tree.nodes[i].is_leaf() {
                true => LeafChoice::Always(0.0),
                false => LeafChoice::Never,
            };
            let all = CollapseCosts::new(&tree, choice);
            let (mut work, mut leaves) = (vec![0], 0);
            while let Some(i) = work.pop() {
                if all.is_leaf(i) {
                    leaves += 1;
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
            assert_eq!(leaves, primitives.len(), "{name}");
        }
    }
}
