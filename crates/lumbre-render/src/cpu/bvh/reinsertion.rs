//! Parallel reinsertion [Meister and Bittner 2018b]: improves a binary tree by moving subtrees to
//! where they enlarge its boxes least.
//!
//! In every round the best place of each candidate is searched in the same tree, in parallel. The
//! moves are then made one after the other, the one with the largest gain first. Each is evaluated
//! again in the tree as it is by then and is undone if it does not reduce the tree's area. So moves
//! may overlap, no locks are needed, and the result does not depend on the number of threads.

use rayon::prelude::*;

use super::aabb::Aabb;
use super::binary::{BinaryNode, BinaryTree};

/// Number of rounds.
const ROUNDS: u32 = 8;

/// Least number of candidates that are searched in parallel.
const PARALLEL: usize = 256;

/// Moves subtrees. `fraction` is the share of all nodes that are candidates in the first round:
/// those with the largest boxes. Round `i` has one `i`-th of it, at most all nodes.
pub(crate) fn reinsert(tree: &mut BinaryTree, fraction: f32) {
    // With three nodes, no move changes the tree.
    if tree.nodes.len() < 5 || fraction <= 0.0 {
        return;
    }
    let mut optimizer = Optimizer::new(&mut tree.nodes);
    for round in 1..=ROUNDS {
        let count = (optimizer.nodes.len() as f32 * fraction / round as f32) as usize;
        optimizer.run_round(count.clamp(1, optimizer.nodes.len() - 1));
    }
    tree.reorder();
}

/// Best place of a subtree.
#[derive(Clone, Copy, Debug)]
struct Move {
    /// Root of the subtree.
    node: u32,
    /// Node that becomes its sibling.
    target: u32,
    /// Reduction of the sum of the areas of all boxes.
    gain: f32,
}

impl Move {
    /// Takes another place if it gains more.
    fn improve(&mut self, target: usize, gain: f32) {
        if gain > self.gain {
            (self.target, self.gain) = (target as u32, gain);
        }
    }
}

/// Subtrees that are still to be searched: the area saved by all places below a node, as
/// [`Optimizer::search_below`] counts it, and the node.
type Pending = Vec<(f32, u32)>;

/// Tree that is improved. Unlike in a finished tree, children may precede their parents.
struct Optimizer<'a> {
    nodes: &'a mut [BinaryNode],
    /// Parent of each pair of siblings.
    parents: Vec<u32>,
}

/// Returns the number of a node's pair of siblings. The node must not be the root.
fn pair(node: usize) -> usize {
    (node - 1) / 2
}

/// Returns the sibling of a node, which must not be the root.
fn sibling(node: usize) -> usize {
    ((node - 1) ^ 1) + 1
}

impl<'a> Optimizer<'a> {
    fn new(nodes: &'a mut [BinaryNode]) -> Optimizer<'a> {
        let mut parents = vec![0; nodes.len() / 2];
        for (i, node) in nodes.iter().enumerate().filter(|(_, node)| !node.is_leaf()) {
            parents[pair(node.first_child())] = i as u32;
        }
        Optimizer { nodes, parents }
    }

    fn parent(&self, node: usize) -> usize {
        self.parents[pair(node)] as usize
    }

    /// Searches better places for the `count` nodes with the largest boxes and moves them.
    fn run_round(&mut self, count: usize) {
        let candidates = self.largest(count);
        let search = |pending: &mut Pending, node: &u32| self.search(*node as usize, pending);
        let mut moves: Vec<Move> = if count < PARALLEL {
            let mut pending = Pending::new();
            let found = candidates.iter().map(|node| search(&mut pending, node));
            found.flatten().collect()
        } else {
            let found = candidates.par_iter().map_init(Pending::new, search);
            found.flatten_iter().collect()
        };
        moves.sort_unstable_by(|a, b| b.gain.total_cmp(&a.gain).then(a.node.cmp(&b.node)));
        for Move { node, target, .. } in moves {
            self.apply(node as usize, target as usize);
        }
    }

    /// Returns the nodes with the largest boxes, without the root.
    fn largest(&self, count: usize) -> Vec<u32> {
        // Areas are not negative, so their bits have the same order.
        let key = |i: usize| u64::from(self.nodes[i].half_area().to_bits()) << 32 | i as u64;
        let mut keys: Vec<u64> = (1..self.nodes.len()).map(key).collect();
        let first = keys.len() - count;
        if first > 0 {
            keys.select_nth_unstable(first);
        }
        keys[first..].iter().map(|key| *key as u32).collect()
    }

    /// Searches the place of a subtree that reduces the sum of areas most, in the subtrees beside
    /// its path to the root and on this path, from bottom to top.
    fn search(&self, node: usize, pending: &mut Pending) -> Option<Move> {
        let moved = self.nodes[node].aabb();
        let mut best = Move {
            node: node as u32,
            target: node as u32,
            gain: 0.0,
        };
        // Area saved by taking the subtree out: the parent is removed, and nodes above it up to the
        // common ancestor with the new place shrink.
        let mut ancestor = self.parent(node);
        let mut saved = self.nodes[ancestor].half_area();
        self.search_below(sibling(node), saved, &moved, &mut best, pending);
        let mut rest = self.nodes[sibling(node)].aabb();
        while ancestor != 0 {
            let beside = sibling(ancestor);
            self.search_below(beside, saved, &moved, &mut best, pending);
            rest = rest.union(&self.nodes[beside].aabb());
            ancestor = self.parent(ancestor);
            let rest_area = rest.half_area();
            best.improve(ancestor, saved - rest_area);
            saved += self.nodes[ancestor].half_area() - rest_area;
        }
        (best.gain > 0.0).then_some(best)
    }

    /// Searches `root` and the nodes below it for the best sibling of a box, if taking it out saved
    /// the area `saved`. Skips subtrees that cannot have a better one.
    fn search_below(
        &self,
        root: usize,
        saved: f32,
        moved: &Aabb,
        best: &mut Move,
        pending: &mut Pending,
    ) {
        // The new parent is at least as large as the box, so no place gains more than this.
        let area = moved.half_area();
        if saved - area <= best.gain {
            return;
        }
        // Tests a place. Returns the area saved at places below it, where its own box grows.
        let visit = |place: usize, saved: f32, best: &mut Move| {
            let aabb = self.nodes[place].aabb();
            let gain = saved - aabb.union(moved).half_area();
            best.improve(place, gain);
            gain + aabb.half_area()
        };
        pending.push((visit(root, saved, best), root as u32));
        while let Some((saved, place)) = pending.pop() {
            let node = &self.nodes[place as usize];
            if saved - area <= best.gain || node.is_leaf() {
                continue;
            }
            let first = node.first_child();
            let a = (visit(first, saved, best), first as u32);
            let b = (visit(first + 1, saved, best), first as u32 + 1);
            // The better one is searched first.
            pending.extend(if a.0 < b.0 { [a, b] } else { [b, a] });
        }
    }

    /// Moves a subtree to a new sibling, unless this would not reduce the sum of areas.
    fn apply(&mut self, node: usize, target: usize) {
        let (old, parent) = (sibling(node), self.parent(node));
        if target == old || target == parent || self.is_below(target, node) {
            return;
        }
        // Take the subtree out: its sibling takes the place of its parent.
        let moved = self.nodes[node];
        let parent_area = self.nodes[parent].half_area();
        self.store(parent, self.nodes[old]);
        let saved = parent_area + self.shrink_above(parent);
        let better = self.growth(target, &moved.aabb()) < saved;
        let target = if better { target } else { parent };
        // Put it back: the pair that became free holds the target and the subtree.
        let first = node.min(old);
        let union = self.nodes[target].aabb().union(&moved.aabb());
        self.store(first, self.nodes[target]);
        self.store(first + 1, moved);
        self.store(target, BinaryNode::inner(union, first as u32));
        self.grow_above(target, &union);
    }

    /// Returns whether `node` is `ancestor` or below it.
    fn is_below(&self, mut node: usize, ancestor: usize) -> bool {
        while node != ancestor {
            if node == 0 {
                return false;
            }
            node = self.parent(node);
        }
        true
    }

    /// Stores a node at an index.
    fn store(&mut self, index: usize, node: BinaryNode) {
        if !node.is_leaf() {
            self.parents[pair(node.first_child())] = index as u32;
        }
        self.nodes[index] = node;
    }

    /// Fits the boxes above a node to their children. Returns the area saved.
    fn shrink_above(&mut self, mut node: usize) -> f32 {
        let mut saved = 0.0;
        while node != 0 {
            let aabb = self.nodes[node]
                .aabb()
                .union(&self.nodes[sibling(node)].aabb());
            node = self.parent(node);
            let before = self.nodes[node];
            if before.aabb() == aabb {
                break;
            }
            saved += before.half_area() - aabb.half_area();
            self.nodes[node] = before.with_aabb(aabb);
        }
        saved
    }

    /// Returns the area added if a box becomes the sibling of `target`.
    fn growth(&self, target: usize, moved: &Aabb) -> f32 {
        let mut added = self.nodes[target].aabb().union(moved).half_area();
        let mut node = target;
        while node != 0 {
            node = self.parent(node);
            let before = self.nodes[node].aabb();
            if before.contains(moved) {
                break;
            }
            added += before.union(moved).half_area() - before.half_area();
        }
        added
    }

    /// Extends the boxes above a node to contain `aabb`.
    fn grow_above(&mut self, mut node: usize, aabb: &Aabb) {
        while node != 0 {
            node = self.parent(node);
            let before = self.nodes[node];
            if before.aabb().contains(aabb) {
                break;
            }
            self.nodes[node] = before.with_aabb(before.aabb().union(aabb));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::bvh::ploc::build_clusters;
    use crate::cpu::bvh::test_primitives::{degenerate_boxes, random_boxes};

    #[test]
    fn trees_stay_valid_and_never_cost_more() {
        let mut inputs = degenerate_boxes();
        inputs.extend([4, 40, 3000].map(|n| ("random", random_boxes(n, n as u32))));
        for (name, primitives) in inputs {
            for fraction in [0.01, 0.2, 8.0] {
                let mut tree = build_clusters(&primitives, 2, 2);
                let before = tree.weighted_area();
                reinsert(&mut tree, fraction);
                tree.validate(&primitives);
                let after = tree.weighted_area();
                assert!(
                    after <= before * (1.0 + 1e-5) || before.is_infinite(),
                    "{name} {fraction}: {before} {after}"
                );
            }
        }
    }

    #[test]
    fn a_tree_in_random_order_improves() {
        // Without a search, neighbours in the order of the primitives are merged.
        let primitives = random_boxes(4000, 5);
        let mut clusters: Vec<BinaryNode> = (primitives.iter().zip(0..))
            .map(|(p, i)| BinaryNode::leaf(p.aabb, i, 1))
            .collect();
        let mut nodes = Vec::new();
        while clusters.len() > 1 {
            let pairs = clusters.chunks(2).map(|pair| match pair {
                [a, b] => {
                    nodes.extend([*a, *b]);
                    BinaryNode::inner(a.aabb().union(&b.aabb()), nodes.len() as u32 - 1)
                }
                _ => pair[0],
            });
            clusters = pairs.collect();
        }
        nodes.insert(0, clusters[0]);
        let primitive_count = primitives.len() as u32;
        let mut tree = BinaryTree {
            nodes,
            primitives: (0..primitive_count).collect(),
        };
        tree.reorder();
        tree.validate(&primitives);
        let before = tree.weighted_area();
        reinsert(&mut tree, 8.0);
        tree.validate(&primitives);
        let best = build_clusters(&primitives, 14, 1).weighted_area();
        let after = tree.weighted_area();
        assert!(
            after < 0.5 * before && after < 1.5 * best,
            "{before} {after} {best}"
        );
    }

    #[test]
    fn the_number_of_threads_does_not_change_the_tree() {
        let primitives = random_boxes(20_000, 6);
        let tree_with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            let mut tree = build_clusters(&primitives, 2, 1);
            pool.unwrap().install(|| reinsert(&mut tree, 0.5));
            let nodes = tree.nodes.iter();
            nodes.map(|n| (n.aabb(), n.range())).collect::<Vec<_>>()
        };
        let expected = tree_with(1);
        assert!(tree_with(2) == expected && tree_with(5) == expected);
    }
}
