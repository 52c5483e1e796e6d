//! Parallel locally-ordered clustering [Meister and Bittner 2018a]: builds a binary tree from the
//! leaves up.
//!
//! Clusters are kept in the order of the Morton curve. In every pass each cluster searches the one
//! with which it has the bounding box of least area, within a radius in this order, and all pairs
//! of mutual nearest neighbours are merged. As in [Benthin et al. 2022], the area of a pair is
//! computed once for both of its clusters. The tree does not depend on the number of threads.

use rayon::prelude::*;

use super::binary::{BinaryNode, BinaryTree};
use super::build::BuildPrimitive;
use super::morton::morton_order;

/// Number of clusters that one task searches.
const TASK: usize = 512;

/// A pass that merges less than one in this many clusters is followed by one that merges adjacent
/// clusters. It limits the number of passes on degenerate input, such as boxes that contain each
/// other, where few neighbours are mutual. Scenes do not need it.
const LEAST_MERGED: usize = 32;

/// Cost of a visit of a node, in tests of a primitive, by which leaves are merged.
const TRAVERSAL_COST: f32 = 3.0;

/// Builds a tree. `primitives` must not be empty. `radius` is the number of neighbours before and
/// after a cluster that are searched. Two leaves of together at most `max_leaf` primitives become
/// one if that costs less by the surface area heuristic.
pub(crate) fn build_clusters(
    primitives: &[BuildPrimitive],
    radius: usize,
    max_leaf: u32,
) -> BinaryTree {
    let order = morton_order(primitives);
    let leaf = |(i, p): (usize, &u32)| BinaryNode::leaf(primitives[*p as usize].aabb, i as u32, 1);
    let mut clusters: Vec<BinaryNode> = order.iter().enumerate().map(leaf).collect();
    let mut nearest = vec![0; clusters.len()];
    let mut merger = Merger {
        max_leaf,
        pairs: Vec::new(),
        next: (0..clusters.len() as u32).collect(),
    };
    while clusters.len() > 1 {
        let before = clusters.len();
        let nearest = &mut nearest[..before];
        find_nearest(&clusters, radius, nearest);
        merger.merge_mutual(&mut clusters, nearest);
        if (before - clusters.len()) * LEAST_MERGED < before {
            merger.merge_adjacent(&mut clusters, nearest);
        }
    }
    merger.into_tree(clusters[0], &order)
}

/// Finds the nearest neighbour of each cluster within `radius` places.
fn find_nearest(clusters: &[BinaryNode], radius: usize, nearest: &mut [u32]) {
    let task = |(task, nearest): (usize, &mut [u32])| {
        let start = task * TASK;
        let mut keys = [u64::MAX; TASK];
        find_least_keys(clusters, radius, start, &mut keys[..nearest.len()]);
        for (i, (nearest, key)) in nearest.iter_mut().zip(keys).enumerate() {
            let (place, distance) = ((start + i) as u32, key as u32 >> 2);
            *nearest = if key & 1 == 0 {
                place - distance
            } else {
                place + distance
            };
        }
    };
    if clusters.len() <= TASK {
        task((0, nearest));
    } else {
        nearest.par_chunks_mut(TASK).enumerate().for_each(task);
    }
}

/// Computes the least key of the pairs of each cluster, from place `start` on.
///
/// Keys order pairs by the area of their bounding box, then by their distance in places, then those
/// that begin at an even place first, so that of many equal boxes half are merged in every pass.
/// The last bit is set if the other cluster of the pair comes later.
fn find_least_keys(clusters: &[BinaryNode], radius: usize, start: usize, keys: &mut [u64]) {
    let end = start + keys.len();
    for i in start.saturating_sub(radius)..end {
        let (aabb, parity) = (clusters[i].aabb(), ((i & 1) << 1) as u64);
        let key_of = |j: usize, cluster: &BinaryNode| {
            // Areas are not negative, so their bits have the same order.
            let area = aabb.union(&cluster.aabb()).half_area().to_bits();
            u64::from(area) << 32 | ((j - i) << 2) as u64 | parity
        };
        let last = (i + radius).min(clusters.len() - 1);
        let (first, inside) = (start.max(i + 1), end.min(last + 1));
        let mut least = u64::MAX;
        if first < inside {
            let own = clusters[first..inside]
                .iter()
                .zip(&mut keys[first - start..]);
            for (j, (cluster, other)) in (first..).zip(own) {
                let key = key_of(j, cluster);
                least = least.min(key);
                *other = (*other).min(key);
            }
        }
        if i >= start {
            for (j, cluster) in (inside..).zip(&clusters[inside..=last]) {
                least = least.min(key_of(j, cluster));
            }
            keys[i - start] = keys[i - start].min(least | 1);
        }
    }
}

/// Merges clusters. The primitives of a leaf are a circular list of places along the Morton curve,
/// and the leaf's range begins at the place of its last one. So two lists are joined in constant
/// time.
struct Merger {
    max_leaf: u32,
    /// All nodes but the root, in pairs of siblings.
    pairs: Vec<BinaryNode>,
    /// Next place in the list of the primitives of a leaf.
    next: Vec<u32>,
}

impl Merger {
    /// Merges all pairs of clusters that are each other's nearest. The merged cluster takes the
    /// place of the first.
    fn merge_mutual(&mut self, clusters: &mut Vec<BinaryNode>, nearest: &[u32]) {
        let mut count = 0;
        for i in 0..clusters.len() {
            let other = nearest[i] as usize;
            clusters[count] = if other == i || nearest[other] as usize != i {
                clusters[i]
            } else if i < other {
                self.merge(&clusters[i], &clusters[other])
            } else {
                continue;
            };
            count += 1;
        }
        clusters.truncate(count);
    }

    /// Merges each cluster at an even place with the next one.
    fn merge_adjacent(&mut self, clusters: &mut Vec<BinaryNode>, nearest: &mut [u32]) {
        let last = clusters.len() as u32 - 1;
        for (i, nearest) in (0..=last).zip(nearest.iter_mut()) {
            *nearest = (i ^ 1).min(last);
        }
        self.merge_mutual(clusters, nearest);
    }

    /// Returns the leaf or the inner node of two clusters.
    fn merge(&mut self, a: &BinaryNode, b: &BinaryNode) -> BinaryNode {
        let aabb = a.aabb().union(&b.aabb());
        if a.is_leaf() && b.is_leaf() {
            let [count_a, count_b] = [a, b].map(|node| node.range().len() as u32);
            let (area, count) = (aabb.half_area(), count_a + count_b);
            let split = a.half_area() * count_a as f32 + b.half_area() * count_b as f32;
            if count <= self.max_leaf && area * count as f32 <= area * TRAVERSAL_COST + split {
                let [last_a, last_b] = [a, b].map(|node| node.range().start);
                self.next.swap(last_a, last_b);
                return BinaryNode::leaf(aabb, last_b as u32, count);
            }
        }
        self.pairs.extend([*a, *b]);
        BinaryNode::inner(aabb, self.pairs.len() as u32 - 2)
    }

    /// Returns the tree below a node, in depth-first order. `order` has the primitive of each
    /// place.
    fn into_tree(self, root: BinaryNode, order: &[u32]) -> BinaryTree {
        let mut nodes = Vec::with_capacity(self.pairs.len() + 1);
        let mut primitives = Vec::with_capacity(order.len());
        nodes.push(root);
        let mut work = vec![0];
        while let Some(i) = work.pop() {
            let node: BinaryNode = nodes[i];
            if node.is_leaf() {
                let (range, first) = (node.range(), primitives.len() as u32);
                let mut place = range.start;
                for _ in range.clone() {
                    place = self.next[place] as usize;
                    primitives.push(order[place]);
                }
                nodes[i] = BinaryNode::leaf(node.aabb(), first, range.len() as u32);
            } else {
                let (old, new) = (node.first_child(), nodes.len());
                nodes.extend_from_slice(&self.pairs[old..old + 2]);
                nodes[i] = BinaryNode::inner(node.aabb(), new as u32);
                work.extend([new + 1, new]);
            }
        }
        BinaryTree { nodes, primitives }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3A;

    use super::*;
    use crate::cpu::bvh::test_primitives::{degenerate_boxes, random_boxes};

    #[test]
    fn trees_of_random_and_degenerate_input_are_valid() {
        let mut inputs = degenerate_boxes();
        inputs.extend([3, 40, 5000].map(|n| ("random", random_boxes(n, n as u32))));
        for (name, primitives) in inputs {
            for (radius, max_leaf) in [(1, 1), (2, 8), (14, 3), (32, 255)] {
                let tree = build_clusters(&primitives, radius, max_leaf);
                tree.validate(&primitives);
                let largest = tree.nodes.iter().map(|n| n.range().len()).max();
                assert!(
                    largest <= Some(max_leaf as usize),
                    "{name} {radius} {largest:?}"
                );
            }
        }
    }

    #[test]
    fn the_number_of_threads_does_not_change_the_tree() {
        let primitives = random_boxes(20_000, 3);
        let tree_with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            let tree = pool.unwrap().install(|| build_clusters(&primitives, 14, 4));
            let boxes: Vec<_> = tree.nodes.iter().map(|n| (n.aabb(), n.range())).collect();
            (boxes, tree.primitives)
        };
        let expected = tree_with(1);
        assert!(tree_with(2) == expected && tree_with(5) == expected);
    }

    #[test]
    fn every_cluster_finds_the_neighbour_of_least_area() {
        let clusters: Vec<BinaryNode> = (random_boxes(3 * TASK + 5, 9).iter().zip(0..))
            .map(|(p, i)| BinaryNode::leaf(p.aabb, i, 1))
            .collect();
        for radius in [1, 3, 24] {
            let mut nearest = vec![0; clusters.len()];
            find_nearest(&clusters, radius, &mut nearest);
            for (i, found) in nearest.into_iter().enumerate() {
                let area = |j: usize| clusters[i].aabb().union(&clusters[j].aabb()).half_area();
                let window = i.saturating_sub(radius)..(i + radius + 1).min(clusters.len());
                let least = window
                    .clone()
                    .filter(|j| *j != i)
                    .map(area)
                    .fold(f32::MAX, f32::min);
                assert!(window.contains(&(found as usize)) && found as usize != i);
                assert_eq!(area(found as usize), least, "{i}");
            }
        }
    }

    #[test]
    fn equal_boxes_give_a_balanced_tree_and_nested_ones_a_shallow_one() {
        let depth = |primitives: &[BuildPrimitive]| {
            let tree = build_clusters(primitives, 8, 1);
            let mut depths = vec![0; tree.nodes.len()];
            for (i, node) in tree.nodes.iter().enumerate().filter(|(_, n)| !n.is_leaf()) {
                let (first, depth) = (node.first_child(), depths[i] + 1);
                depths[first..first + 2].fill(depth);
            }
            depths.into_iter().max()
        };
        let cube = |half: f32| BuildPrimitive::from_box(Vec3A::splat(-half), Vec3A::splat(half));
        assert_eq!(depth(&[cube(1.0); 4096]), Some(12));
        let nested: Vec<_> = (0..4096).map(|i| cube(1.0 + i as f32)).collect();
        assert!(depth(&nested) < Some(200), "{:?}", depth(&nested));
    }
}
