//! Builders of binary trees over the boxes of primitives.
//!
//! All builders return a tree in the format of `obvhs`: the children of an inner node are adjacent,
//! a leaf refers to a range of the primitive indices, and every primitive is in exactly one leaf.

use std::time::Duration;

use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::bvh2::node::Bvh2Node;

use crate::hierarchy::{AccelSpec, Builder, Quality};

/// Box and centroid of a primitive: the input of the builders.
#[derive(Clone, Copy, Debug)]
pub struct BuildPrimitive {
    /// Bounding box of the primitive.
    pub aabb: Aabb,
    /// Point that decides on which side of a split the primitive lies: the mean of a triangle's
    /// corners, or the centre of the box of any other primitive.
    pub centroid: Vec3A,
}

impl BuildPrimitive {
    /// Creates the box and centroid of a triangle.
    pub fn triangle(corners: &[glam::Vec3; 3]) -> BuildPrimitive {
        let corners = corners.map(Vec3A::from);
        let centroid = (corners[0] + corners[1] + corners[2]) / 3.0;
        BuildPrimitive {
            aabb: Aabb::from_points(&corners),
            centroid,
        }
    }

    /// Creates the box and centroid of a primitive from the least and greatest corner of its box.
    pub fn from_box(low: Vec3A, high: Vec3A) -> BuildPrimitive {
        BuildPrimitive {
            aabb: Aabb::new(low, high),
            centroid: low + (high - low) * 0.5,
        }
    }
}

/// Returns the `obvhs` preset of a quality, without pre-splitting: every triangle has one box.
pub(crate) fn params(quality: Quality) -> BvhBuildParams {
    let preset = match quality {
        Quality::Fastest => BvhBuildParams::fastest_build(),
        Quality::VeryFast => BvhBuildParams::very_fast_build(),
        Quality::Fast => BvhBuildParams::fast_build(),
        Quality::Medium => BvhBuildParams::medium_build(),
        Quality::Slow => BvhBuildParams::slow_build(),
        Quality::VerySlow => BvhBuildParams::very_slow_build(),
    };
    BvhBuildParams {
        pre_split: false,
        ..preset
    }
}

/// Builds the binary tree. `primitives` must not be empty.
pub(crate) fn build_binary(spec: &AccelSpec, primitives: &[BuildPrimitive], max_leaf: u32) -> Bvh2 {
    match spec.builder {
        Builder::None => TopDownBuilder::new(primitives, usize::MAX, 0).tree,
        Builder::Plane => {
            TopDownBuilder::new(primitives, max_leaf as usize, spec.max_depth).split_by(plane_split)
        }
        Builder::Sah => {
            let bins = spec.bins as usize;
            TopDownBuilder::new(primitives, max_leaf as usize, spec.max_depth)
                .split_by(|primitives, members| sah_split(primitives, members, bins))
        }
        Builder::Ploc | Builder::Cwbvh => {
            let boxes: Vec<Aabb> = primitives.iter().map(|b| b.aabb).collect();
            let params = BvhBuildParams {
                max_prims_per_leaf: max_leaf,
                ..params(spec.quality)
            };
            build_bvh2(&boxes, params, &mut Duration::default())
        }
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
        let mut tree = Bvh2 {
            primitive_indices: (0..primitives.len() as u32).collect(),
            ..Bvh2::default()
        };
        tree.nodes.push(Bvh2Node::new(
            bounding_box(primitives, &tree.primitive_indices),
            primitives.len() as u32,
            0,
        ));
        TopDownBuilder {
            primitives,
            tree,
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
            let Bvh2Node {
                prim_count,
                first_index,
                ..
            } = self.tree.nodes[leaf];
            let (count, first) = (prim_count as usize, first_index as usize);
            if count <= self.max_leaf || depth >= self.max_depth {
                continue;
            }
            let members = &mut self.tree.primitive_indices[first..first + count];
            let Some(middle) =
                split(self.primitives, members).filter(|middle| (1..count).contains(middle))
            else {
                continue;
            };
            let ranges = [(first, middle), (first + middle, count - middle)];
            let children = self.tree.nodes.len();
            for (first, count) in ranges {
                let aabb = bounding_box(
                    self.primitives,
                    &self.tree.primitive_indices[first..first + count],
                );
                self.tree
                    .nodes
                    .push(Bvh2Node::new(aabb, count as u32, first as u32));
            }
            self.tree.nodes[leaf].prim_count = 0;
            self.tree.nodes[leaf].first_index = children as u32;
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
fn partition(members: &mut [u32], first: impl Fn(u32) -> bool) -> usize {
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
///   are the extent of z. Here each axis has its own.
/// - If x and y are equally long and longest, the listing splits z. Here the last of the longest
///   axes is split.
/// - If all centroids lie on one side, the listing keeps splitting until the maximum depth. Here
///   the node becomes a leaf.
fn plane_split(primitives: &[BuildPrimitive], members: &mut [u32]) -> Option<usize> {
    let aabb = bounding_box(primitives, members);
    let size = aabb.max - aabb.min;
    let axis = (0..3)
        .max_by(|a, b| size[*a].total_cmp(&size[*b]))
        .unwrap_or(2);
    let middle = aabb.min[axis] + size[axis] / 2.0;
    Some(partition(members, |i| {
        primitives[i as usize].centroid[axis] > middle
    }))
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
