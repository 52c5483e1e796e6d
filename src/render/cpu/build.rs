//! Builders of binary trees over boxes.
//!
//! All of them leave a tree of `obvhs`: the children of an inner node are neighbours, leaves name a run of the indices.

use std::time::Duration;

use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::bvh2::node::Bvh2Node;

use crate::render::hierarchy::{AccelSpec, Builder, Quality};

/// A primitive as builders see it.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) struct Bounded {
    pub aabb: Aabb,
    /// What decides on which side of a cut it lies: the mean of a triangle's corners, or the middle of anything else.
    pub centroid: Vec3A,
}

impl Bounded {
    pub fn triangle(corners: &[glam::Vec3; 3]) -> Bounded {
        let corners = corners.map(Vec3A::from);
        let centroid = (corners[0] + corners[1] + corners[2]) / 3.0;
        Bounded { aabb: Aabb::from_points(&corners), centroid }
    }

    pub fn boxed(low: Vec3A, high: Vec3A) -> Bounded {
        Bounded { aabb: Aabb::new(low, high), centroid: low + (high - low) * 0.5 }
    }
}

/// The presets of `obvhs`, without cutting triangles into several boxes.
pub(in crate::render) fn params(quality: Quality) -> BvhBuildParams {
    let preset = match quality {
        Quality::Fastest => BvhBuildParams::fastest_build(),
        Quality::VeryFast => BvhBuildParams::very_fast_build(),
        Quality::Fast => BvhBuildParams::fast_build(),
        Quality::Medium => BvhBuildParams::medium_build(),
        Quality::Slow => BvhBuildParams::slow_build(),
        Quality::VerySlow => BvhBuildParams::very_slow_build(),
    };
    BvhBuildParams { pre_split: false, ..preset }
}

/// The binary tree over at least one primitive.
pub(in crate::render) fn binary(spec: &AccelSpec, of: &[Bounded], max_leaf: u32) -> Bvh2 {
    match spec.builder {
        Builder::None => Divided::new(of, usize::MAX, 0).tree,
        Builder::Plane => Divided::new(of, max_leaf as usize, spec.max_depth).by(plane),
        Builder::Sah => {
            let bins = spec.bins as usize;
            Divided::new(of, max_leaf as usize, spec.max_depth).by(|of, members| surface_area(of, members, bins))
        }
        Builder::Ploc | Builder::Cwbvh => {
            let boxes: Vec<Aabb> = of.iter().map(|b| b.aabb).collect();
            let params = BvhBuildParams { max_prims_per_leaf: max_leaf, ..params(spec.quality) };
            build_bvh2(&boxes, params, &mut Duration::default())
        }
    }
}

/// A tree that is divided from its root.
struct Divided<'a> {
    of: &'a [Bounded],
    tree: Bvh2,
    max_leaf: usize,
    max_depth: u32,
}

impl<'a> Divided<'a> {
    /// One leaf.
    fn new(of: &'a [Bounded], max_leaf: usize, max_depth: u32) -> Divided<'a> {
        let mut tree = Bvh2 { primitive_indices: (0..of.len() as u32).collect(), ..Bvh2::default() };
        tree.nodes.push(Bvh2Node::new(around(of, &tree.primitive_indices), of.len() as u32, 0));
        Divided { of, tree, max_leaf: max_leaf.max(1), max_depth }
    }

    /// Divides leaves as `cut` says, until they are small or deep enough or it does not want to. `cut` reorders the members
    /// of a leaf and says where the second half begins.
    fn by(mut self, cut: impl Fn(&[Bounded], &mut [u32]) -> Option<usize>) -> Bvh2 {
        // A list of work instead of recursion, whatever the depth.
        let mut work = vec![(0usize, 0u32)];
        while let Some((leaf, depth)) = work.pop() {
            let Bvh2Node { prim_count, first_index, .. } = self.tree.nodes[leaf];
            let (count, first) = (prim_count as usize, first_index as usize);
            if count <= self.max_leaf || depth >= self.max_depth {
                continue;
            }
            let members = &mut self.tree.primitive_indices[first..first + count];
            let Some(middle) = cut(self.of, members).filter(|middle| (1..count).contains(middle)) else { continue };
            let halves = [(first, middle), (first + middle, count - middle)];
            let children = self.tree.nodes.len();
            for (first, count) in halves {
                let aabb = around(self.of, &self.tree.primitive_indices[first..first + count]);
                self.tree.nodes.push(Bvh2Node::new(aabb, count as u32, first as u32));
            }
            self.tree.nodes[leaf].prim_count = 0;
            self.tree.nodes[leaf].first_index = children as u32;
            work.extend([(children + 1, depth + 1), (children, depth + 1)]);
        }
        self.tree
    }
}

/// The box around some primitives.
fn around(of: &[Bounded], members: &[u32]) -> Aabb {
    let boxes = members.iter().map(|i| of[*i as usize].aabb);
    boxes.fold(Aabb::empty(), |all, aabb| all.union(&aabb))
}

/// Orders members by a predicate and says how many it holds for.
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

/// The second source's split by plane (listing 4.6): by centroids, in the middle of the box's longest side.
///
/// Its extents are written with a comma instead of a constructor, so that all three are that of z; here each is its own. Its
/// comparisons take z where x and y are the longest alike; here it is the last of the longest.
/// And where all centroids lie on one side it goes on dividing nothing until its depth is used up; here that is a leaf.
fn plane(of: &[Bounded], members: &mut [u32]) -> Option<usize> {
    let aabb = around(of, members);
    let size = aabb.max - aabb.min;
    let axis = (0..3).max_by(|a, b| size[*a].total_cmp(&size[*b])).unwrap_or(2);
    let middle = aabb.min[axis] + size[axis] / 2.0;
    Some(partition(members, |i| of[i as usize].centroid[axis] > middle))
}

/// The cheapest cut by the surface area heuristic among the borders of bins: the sum over both halves of the surface of
/// their box times their members.
///
/// As the second source's listing 4.7 but for three things. Bins lie between the outermost centroids, as in [Wald 2007],
/// where the source's reach over the whole box and stay partly empty; empty bins have no box, where the source's is the
/// origin; and both sums are taken in two sweeps over the bins, not anew for every border.
fn surface_area(of: &[Bounded], members: &mut [u32], bins: usize) -> Option<usize> {
    let centroids = members.iter().map(|i| of[*i as usize].centroid);
    let start = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
    let (low, high) = centroids.fold(start, |(low, high), c| (low.min(c), high.max(c)));
    let mut best: Option<(f32, usize, usize)> = None;
    let bin_of = |axis: usize, c: Vec3A| {
        let place = (c[axis] - low[axis]) / (high[axis] - low[axis]) * bins as f32;
        (place as usize).min(bins - 1)
    };
    let mut filled = vec![(0u32, Aabb::empty()); bins];
    let mut before = vec![0.0f32; bins];
    for axis in 0..3 {
        if high[axis] <= low[axis] {
            continue;
        }
        filled.fill((0, Aabb::empty()));
        for i in members.iter() {
            let Bounded { aabb, centroid } = of[*i as usize];
            let bin = &mut filled[bin_of(axis, centroid)];
            *bin = (bin.0 + 1, bin.1.union(&aabb));
        }
        let cost = |(count, aabb): &(u32, Aabb)| if *count > 0 { aabb.half_area() * *count as f32 } else { 0.0 };
        let join = |sum: &mut (u32, Aabb), bin: &(u32, Aabb)| *sum = (sum.0 + bin.0, sum.1.union(&bin.1));
        let mut sum = (0, Aabb::empty());
        for (bin, before) in filled.iter().zip(&mut before) {
            *before = cost(&sum);
            join(&mut sum, bin);
        }
        let mut sum = (0, Aabb::empty());
        for border in (1..bins).rev() {
            join(&mut sum, &filled[border]);
            let both = before[border] + cost(&sum);
            let divides = sum.0 > 0 && (sum.0 as usize) < members.len();
            if divides && best.is_none_or(|(least, ..)| both < least) {
                best = Some((both, axis, border));
            }
        }
    }
    let (_, axis, border) = best?;
    Some(partition(members, |i| bin_of(axis, of[i as usize].centroid) < border))
}
