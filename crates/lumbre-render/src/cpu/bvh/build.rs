//! Builders of binary trees over the boxes of primitives.
//!
//! The builders that split from the root on are in this module, and [`super::clusters`] calls those
//! of `obvhs`. All trees are in its format: node 0 is the root, the children of an inner node are
//! adjacent, and a leaf refers to a range of the indices of the primitives.
//!
//! Invariants: the first child of an inner node has an odd index, and both children follow their
//! parent. Every primitive is in one leaf, or in several if its parts are ([`super::parts`]).

use glam::{Vec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;

use super::build_primitive::{BuildPrimitive, range};
use super::clusters::build_clusters;
use super::parts::{MOST_ADDED, cut_triangles};
use crate::hierarchy::{AccelSpec, Builder, Quality};

/// Returns whether long triangles are cut into parts before the tree is built.
fn cuts(spec: &AccelSpec) -> bool {
    matches!(spec.builder, Builder::Ploc | Builder::Cwbvh) && spec.quality > Quality::Fastest
}

/// Builds the binary tree of triangles and other primitives, whose boxes are `primitives`, triangles
/// first. There must be some. `ploc` and `cwbvh` cut long triangles: these are in several leaves.
pub(crate) fn build_scene(
    spec: &AccelSpec,
    triangles: &[[Vec3; 3]],
    primitives: &[BuildPrimitive],
    max_leaf: u32,
) -> Bvh2 {
    let parts = cuts(spec).then(|| cut_triangles(triangles, primitives, MOST_ADDED));
    let Some(parts) = parts.flatten() else {
        return build_binary(spec, primitives, max_leaf);
    };
    let mut tree = build_binary(spec, &parts.primitives, max_leaf);
    for primitive in &mut tree.primitive_indices {
        *primitive = parts.whole[*primitive as usize];
    }
    tree
}

/// Builds the binary tree of boxes. `primitives` must not be empty.
pub(crate) fn build_binary(spec: &AccelSpec, primitives: &[BuildPrimitive], max_leaf: u32) -> Bvh2 {
    match spec.builder {
        Builder::None => TopDownBuilder::new(primitives, usize::MAX, 0).tree,
        Builder::Plane => {
            TopDownBuilder::new(primitives, max_leaf as usize, spec.max_depth).split_by(plane_split)
        }
        Builder::PlaneZ => {
            TopDownBuilder::new(primitives, 1, spec.max_depth).split_by(|primitives, members| {
                split_middle(primitives, members, bounding_box(primitives, members), 2)
            })
        }
        Builder::Sah => {
            let bins = spec.bins as usize;
            TopDownBuilder::new(primitives, max_leaf as usize, spec.max_depth)
                .split_by(|primitives, members| sah_split(primitives, members, bins))
        }
        Builder::Median => {
            TopDownBuilder::new(primitives, max_leaf as usize, u32::MAX).split_by(median_split)
        }
        Builder::Ploc | Builder::Cwbvh => build_clusters(primitives, spec.quality, max_leaf)
            .unwrap_or_else(|| {
                TopDownBuilder::new(primitives, max_leaf as usize, u32::MAX).split_by(median_split)
            }),
    }
}

/// State of a top-down build, which splits leaves from the root on.
struct TopDownBuilder<'a> {
    primitives: &'a [BuildPrimitive],
    tree: Bvh2,
    max_leaf: usize,
    max_depth: u32,
}

impl<'a> TopDownBuilder<'a> {
    /// Creates a tree of a single leaf.
    fn new(
        primitives: &'a [BuildPrimitive],
        max_leaf: usize,
        max_depth: u32,
    ) -> TopDownBuilder<'a> {
        let members: Vec<u32> = (0..primitives.len() as u32).collect();
        let aabb = bounding_box(primitives, &members);
        TopDownBuilder {
            primitives,
            tree: Bvh2 {
                nodes: vec![Bvh2Node::new(aabb, primitives.len() as u32, 0)],
                primitive_indices: members,
                ..Bvh2::default()
            },
            max_leaf: max_leaf.max(1),
            max_depth,
        }
    }

    /// Splits leaves with `split` until they have at most `max_leaf` primitives, lie `max_depth`
    /// levels deep, or `split` returns `None`. `split` reorders the members of a leaf and returns
    /// the index at which the second half begins.
    fn split_by(mut self, split: impl Fn(&[BuildPrimitive], &mut [u32]) -> Option<usize>) -> Bvh2 {
        // Uses a work list instead of recursion, so that deep trees do not overflow the call stack.
        let mut work = vec![(0usize, 0u32)];
        while let Some((leaf, depth)) = work.pop() {
            let range = range(&self.tree.nodes[leaf]);
            let (first, count) = (range.start, range.len());
            if count <= self.max_leaf || depth >= self.max_depth {
                continue;
            }
            let members = &mut self.tree.primitive_indices[range];
            let Some(middle) =
                split(self.primitives, members).filter(|middle| (1..count).contains(middle))
            else {
                continue;
            };
            let ranges = [(first, middle), (first + middle, count - middle)];
            let children = self.tree.nodes.len();
            for (first, count) in ranges {
                let members = &self.tree.primitive_indices[first..first + count];
                let aabb = bounding_box(self.primitives, members);
                let child = Bvh2Node::new(aabb, count as u32, first as u32);
                self.tree.nodes.push(child);
            }
            self.tree.nodes[leaf].make_inner(children as u32);
            work.extend([(children + 1, depth + 1), (children, depth + 1)]);
        }
        self.tree
    }
}

/// Returns the bounding box of the given members.
fn bounding_box(primitives: &[BuildPrimitive], members: &[u32]) -> Aabb {
    let boxes = members.iter().map(|i| primitives[*i as usize].aabb);
    boxes.fold(Aabb::empty(), |all, aabb| all.union(&aabb))
}

/// Moves the members that satisfy a predicate to the front and returns their number.
pub(crate) fn partition(members: &mut [u32], first: impl Fn(u32) -> bool) -> usize {
    let mut middle = 0;
    for i in 0..members.len() {
        if first(members[i]) {
            members.swap(i, middle);
            middle += 1;
        }
    }
    middle
}

/// Splits at the middle of the box's longest side, by centroids, as listing 4.6 of thesis S1 does
/// (docs/bibliography.md).
///
/// There are three differences from the listing:
///
/// - The listing computes extents with a comma operator instead of a constructor, so that all three
///   are the extent of z, and z is split. Here each axis has its own; [`Builder::PlaneZ`] always
///   splits z.
/// - If x and y are equally long and longest, the listing splits z. Here the last of the longest
///   axes is split.
/// - If all centroids lie on one side, the listing keeps splitting until the maximum depth. Here
///   the node becomes a leaf.
fn plane_split(primitives: &[BuildPrimitive], members: &mut [u32]) -> Option<usize> {
    let aabb = bounding_box(primitives, members);
    let size = aabb.diagonal();
    let longest = (0..3).max_by(|a, b| size[*a].total_cmp(&size[*b]));
    split_middle(primitives, members, aabb, longest.unwrap_or(2))
}

/// Splits a box in the middle of an axis, by centroids.
fn split_middle(
    primitives: &[BuildPrimitive],
    members: &mut [u32],
    aabb: Aabb,
    axis: usize,
) -> Option<usize> {
    let middle = aabb.min[axis] + aabb.diagonal()[axis] / 2.0;
    Some(partition(members, |i| {
        primitives[i as usize].centroid[axis] > middle
    }))
}

/// Splits into two halves of equal number by the centroids along the longest side of their box.
fn median_split(primitives: &[BuildPrimitive], members: &mut [u32]) -> Option<usize> {
    let centroid = |i: u32| primitives[i as usize].centroid;
    let start = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
    let (low, high) = members.iter().fold(start, |(low, high), i| {
        (low.min(centroid(*i)), high.max(centroid(*i)))
    });
    let size = high - low;
    let axis = (0..3).max_by(|a, b| size[*a].total_cmp(&size[*b]));
    Some(split_at_median(axis.unwrap_or(2), centroid, members))
}

/// Reorders members into two halves of equal number, by their centroids along an axis. Returns the
/// index at which the second half begins.
pub(crate) fn split_at_median(
    axis: usize,
    centroid: impl Fn(u32) -> Vec3A,
    members: &mut [u32],
) -> usize {
    let middle = members.len() / 2;
    // Equal centroids are ordered by index, so that the tree does not depend on the selection.
    members.select_nth_unstable_by(middle, |a, b| {
        let by_place = centroid(*a)[axis].total_cmp(&centroid(*b)[axis]);
        by_place.then(a.cmp(b))
    });
    middle
}

/// Splits at the bin border of least cost by the surface area heuristic: the sum over both sides of
/// the area of their box times their number of members.
///
/// There are three differences from listing 4.7 of thesis S1:
///
/// - Bins lie between the outermost centroids, as in [Wald 2007]. In the listing they cover the
///   whole box, so that the outer ones may stay empty.
/// - Empty bins have no box. In the listing they have a box at the origin.
/// - Both sums are computed in two sweeps over the bins. The listing computes them anew for every
///   border.
fn sah_split(primitives: &[BuildPrimitive], members: &mut [u32], bins: usize) -> Option<usize> {
    let centroids = members.iter().map(|i| primitives[*i as usize].centroid);
    let start = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
    let (low, high) = centroids.fold(start, |(low, high), c| (low.min(c), high.max(c)));
    let mut best: Option<(f32, usize, usize)> = None;
    let bin_of = |axis: usize, c: Vec3A| {
        let bin = (c[axis] - low[axis]) / (high[axis] - low[axis]) * bins as f32;
        (bin as usize).min(bins - 1)
    };
    let mut bin_sums = vec![(0u32, Aabb::empty()); bins];
    let mut before = vec![0.0f32; bins];
    for axis in 0..3 {
        if high[axis] <= low[axis] {
            continue;
        }
        bin_sums.fill((0, Aabb::empty()));
        for i in members.iter() {
            let BuildPrimitive { aabb, centroid } = primitives[*i as usize];
            let bin = &mut bin_sums[bin_of(axis, centroid)];
            *bin = (bin.0 + 1, bin.1.union(&aabb));
        }
        let cost = |(count, aabb): &(u32, Aabb)| {
            if *count > 0 {
                aabb.half_area() * *count as f32
            } else {
                0.0
            }
        };
        let add =
            |sum: &mut (u32, Aabb), bin: &(u32, Aabb)| *sum = (sum.0 + bin.0, sum.1.union(&bin.1));
        let mut sum = (0, Aabb::empty());
        for (bin, before) in bin_sums.iter().zip(&mut before) {
            *before = cost(&sum);
            add(&mut sum, bin);
        }
        let mut sum = (0, Aabb::empty());
        for border in (1..bins).rev() {
            add(&mut sum, &bin_sums[border]);
            let total = before[border] + cost(&sum);
            let is_split = sum.0 > 0 && (sum.0 as usize) < members.len();
            if is_split && best.is_none_or(|(least, ..)| total < least) {
                best = Some((total, axis, border));
            }
        }
    }
    let (_, axis, border) = best?;
    Some(partition(members, |i| {
        bin_of(axis, primitives[i as usize].centroid) < border
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::bvh::test_primitives::{
        degenerate_boxes, random_boxes, validate, weighted_area,
    };

    #[test]
    fn all_builders_and_qualities_build_valid_trees() {
        let mut inputs = degenerate_boxes();
        inputs.push(("random", random_boxes(2000, 1)));
        let with = |builder: Builder, quality: Quality| AccelSpec {
            builder,
            quality,
            ..AccelSpec::default()
        };
        let mut specs = Builder::ALL.map(|b| with(b, Quality::Medium)).to_vec();
        specs.extend(Quality::ALL.map(|q| with(Builder::Ploc, q)));
        for (name, primitives) in inputs {
            for spec in &specs {
                for max_leaf in [1, 8] {
                    let tree = build_binary(spec, &primitives, max_leaf);
                    assert!(!tree.nodes.is_empty(), "{name} {spec:?}");
                    validate(&tree, &primitives);
                }
            }
        }
    }

    #[test]
    fn slower_qualities_cost_less() {
        let primitives = random_boxes(5000, 2);
        let costs = Quality::ALL.map(|quality| {
            let spec = AccelSpec {
                quality,
                ..AccelSpec::default()
            };
            weighted_area(&build_binary(&spec, &primitives, 1))
        });
        for (fast, slow) in costs.iter().zip(&costs[1..]) {
            assert!(slow < &(fast * 1.01), "{costs:?}");
        }
        assert!(costs[5] < 0.95 * costs[0], "{costs:?}");
    }
}
