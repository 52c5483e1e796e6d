//! Binary trees by `obvhs`: locally ordered clustering [Meister and Bittner 2018a] with reinsertion
//! [Meister and Bittner 2018b].
//!
//! The clustering takes quadratic time where most boxes are equal, contain each other, or lie in a
//! row at equal distances: each pass over them merges one pair. Equal boxes are therefore clustered
//! as one, and a sample shows whether the others are of that kind.
//!
//! The tree does not depend on the number of threads.

use std::collections::BTreeMap;

use obvhs::aabb::Aabb;
use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::bvh2::{Bvh2, DEFAULT_MAX_STACK_DEPTH};
use obvhs::ploc::PlocBuilder;
use obvhs::{Boundable, BvhBuildParams};

use super::build_primitive::BuildPrimitive;
use super::collapse::{collect_primitives, weights};
use super::simd::LANES;
use crate::hierarchy::Quality;

/// Number of primitives of the sample.
const SAMPLE: usize = 4096;

/// Greatest number of passes over the sample. Meshes need fewer than 100.
const MAX_PASSES: usize = 128;

/// Greatest number of levels of a tree. Deeper ones are too deep for all traversals.
const MAX_LEVELS: usize = 512;

/// Area of the box of a small subtree, as a multiple of that of the scene over the number of
/// primitives.
const SMALL: f32 = 64.0;

/// Greatest number of equal boxes that are clustered one by one.
const MAX_EQUAL: usize = 64;

/// Number of rounds of reinsertion.
const ROUNDS: u32 = 8;

/// Number of counters by which boxes are found that have many equal ones.
const COUNTERS: usize = 1 << 16;

/// Factors of the coordinates of a box in the number of its counter: random and odd.
const FACTORS: [u32; 6] = [
    0x9e37_79b1,
    0x85eb_ca77,
    0xc2b2_ae3d,
    0x27d4_eb2f,
    0x1656_67b1,
    0x7feb_352d,
];

/// Returns the settings of a quality: presets of `obvhs`, of which the slower ones search the whole
/// distance in all passes. Its `medium` takes twice as long to build as the default here, for rays of
/// the same cost.
fn params(quality: Quality) -> BvhBuildParams {
    let whole_distance = |preset| BvhBuildParams {
        search_depth_threshold: 0,
        ..preset
    };
    match quality {
        Quality::Fastest => BvhBuildParams::fastest_build(),
        Quality::VeryFast => BvhBuildParams::very_fast_build(),
        Quality::Fast => BvhBuildParams::fast_build(),
        Quality::Medium => BvhBuildParams {
            reinsertion_batch_ratio: 0.03,
            ..whole_distance(BvhBuildParams::fast_build())
        },
        Quality::Slow => whole_distance(BvhBuildParams::slow_build()),
        Quality::VerySlow => whole_distance(BvhBuildParams::very_slow_build()),
    }
}

/// Builds a tree. `primitives` must not be empty. Leaves have at most `max_leaf` primitives, or more
/// than [`MAX_EQUAL`] with equal boxes. Returns `None` if the clustering would take too long or gives
/// too many levels.
pub(crate) fn build_clusters(
    primitives: &[BuildPrimitive],
    quality: Quality,
    max_leaf: u32,
) -> Option<Bvh2> {
    let params = params(quality);
    let mut tree = cluster_distinct(primitives, &params)?;
    let candidates = tree.nodes.len() as f32 * params.reinsertion_batch_ratio;
    if max_leaf > LANES as u32 {
        collapse(&mut tree, max_leaf, params.collapse_traversal_cost);
    }
    tree = join_leaves(&tree, max_leaf.min(LANES as u32));
    reinsert(&mut tree, candidates);
    tree.parents = Vec::new();
    tree.reorder_in_stack_traversal_order();
    (levels(&tree) <= MAX_LEVELS).then_some(tree)
}

/// Joins small subtrees of at most `max_leaf` primitives to leaves, so that there are fewer nodes to
/// improve: the CPU tests up to [`LANES`] primitives at once, so boxes between them save nothing. A
/// subtree is small whose box has at most [`SMALL`] times the area of the scene's over the number of
/// primitives.
fn join_leaves(tree: &Bvh2, max_leaf: u32) -> Bvh2 {
    let counts = weights(tree, |_| 1);
    let area = |node: &Bvh2Node| node.aabb().half_area();
    let small = SMALL * area(&tree.nodes[0]) / tree.primitive_indices.len() as f32;
    let mut joined = Bvh2 {
        nodes: vec![tree.nodes[0]],
        primitive_indices: Vec::with_capacity(tree.primitive_indices.len()),
        ..Bvh2::default()
    };
    // Nodes of both trees.
    let mut work = vec![(0, 0)];
    while let Some((old, new)) = work.pop() {
        let node = &tree.nodes[old];
        if node.is_leaf() || counts[old] <= max_leaf && area(node) <= small {
            let first = joined.primitive_indices.len() as u32;
            collect_primitives(tree, old, &mut joined.primitive_indices);
            joined.nodes[new].first_index = first;
            joined.nodes[new].prim_count = counts[old];
        } else {
            // `obvhs` stores that child last that comes first along the Morton curve. Rays that look
            // for any hit visit the first child first.
            let (first, second) = (node.first_index as usize + 1, node.first_index as usize);
            let children = joined.nodes.len();
            joined.nodes[new].make_inner(children as u32);
            joined.nodes.extend([tree.nodes[first], tree.nodes[second]]);
            work.extend([(second, children + 1), (first, children)]);
        }
    }
    joined
}

/// Clusters primitives, those with the same box as many others as one leaf.
fn cluster_distinct(primitives: &[BuildPrimitive], params: &BvhBuildParams) -> Option<Bvh2> {
    let groups = frequent_boxes(primitives);
    if groups.is_empty() {
        return cluster(primitives, params);
    }
    let mut single = vec![true; primitives.len()];
    for i in groups.iter().flatten() {
        single[*i as usize] = false;
    }
    let mut order: Vec<u32> = (0..primitives.len() as u32).collect();
    order.retain(|i| single[*i as usize]);
    let singles = order.len();
    let firsts = groups.iter().map(|group| group[0]);
    let distinct = order.iter().copied().chain(firsts);
    let boxes: Vec<Aabb> = distinct.map(|i| primitives[i as usize].aabb).collect();
    let mut tree = cluster(&boxes, params)?;
    let ranges = groups.iter().map(|group| {
        order.extend(group);
        ((order.len() - group.len()) as u32, group.len() as u32)
    });
    let ranges: Vec<(u32, u32)> = ranges.collect();
    for leaf in tree.nodes.iter_mut().filter(|node| node.is_leaf()) {
        if let Some(group) = (leaf.first_index as usize).checked_sub(singles) {
            (leaf.first_index, leaf.prim_count) = ranges[group];
        }
    }
    tree.primitive_indices = order;
    Some(tree)
}

/// Returns the primitives of each box that more than [`MAX_EQUAL`] of them have.
fn frequent_boxes(primitives: &[BuildPrimitive]) -> Vec<Vec<u32>> {
    // Adding zero makes negative zeros positive.
    let key = |p: &BuildPrimitive| {
        let [low, high] = [p.aabb.min, p.aabb.max].map(|corner| corner + 0.0);
        [low.x, low.y, low.z, high.x, high.y, high.z].map(f32::to_bits)
    };
    let counter = |p: &BuildPrimitive| {
        let products = key(p).into_iter().zip(FACTORS);
        let hash = products.map(|(word, factor)| word.wrapping_mul(factor));
        hash.fold(0, u32::wrapping_add) as usize >> 16
    };
    let mut counts = vec![0u32; COUNTERS];
    primitives.iter().for_each(|p| counts[counter(p)] += 1);
    // Twice the mean, so that few other primitives are compared.
    let many = MAX_EQUAL + 2 * primitives.len() / COUNTERS;
    let mut groups: BTreeMap<_, Vec<u32>> = BTreeMap::new();
    for (i, p) in (0..).zip(primitives) {
        if counts[counter(p)] as usize > many {
            groups.entry(key(p)).or_default().push(i);
        }
    }
    groups.retain(|_, group| group.len() > MAX_EQUAL);
    groups.into_values().collect()
}

/// Clusters boxes, or returns `None` if a sample of them needs too many passes.
fn cluster<T: Boundable>(boxes: &[T], params: &BvhBuildParams) -> Option<Bvh2> {
    if boxes.len() > SAMPLE {
        let sample = boxes.iter().step_by(boxes.len().div_ceil(SAMPLE));
        let sample: Vec<Aabb> = sample.map(Boundable::aabb).collect();
        // `max_depth` is the number of passes.
        if ploc(&sample, params).max_depth > MAX_PASSES {
            return None;
        }
    }
    Some(ploc(boxes, params))
}

fn ploc<T: Boundable>(boxes: &[T], params: &BvhBuildParams) -> Bvh2 {
    PlocBuilder::new().build(
        params.ploc_search_distance,
        boxes,
        (0..boxes.len() as u32).collect(),
        params.sort_precision,
        params.search_depth_threshold,
    )
}

/// Moves subtrees to where they enlarge boxes least, in rounds of fewer and fewer `candidates`, as
/// [`ReinsertionOptimizer::run`] does. There the order of candidates of equal area could depend on
/// the number of threads.
fn reinsert(tree: &mut Bvh2, candidates: f32) {
    // With three nodes, no move changes the tree.
    if tree.nodes.len() < 5 || candidates <= 0.0 {
        return;
    }
    // With the default, the search has a stack that ignores what exceeds it.
    tree.max_depth = DEFAULT_MAX_STACK_DEPTH;
    let mut optimizer = ReinsertionOptimizer::default();
    for round in 1..=ROUNDS {
        let round = round as f32;
        let count = (candidates / (round * round.sqrt())) as usize;
        let candidates = largest(tree, count.clamp(1, tree.nodes.len() - 1));
        optimizer.run_with_candidates(tree, &candidates, 1);
    }
}

/// Returns the `count` largest nodes, without the root.
fn largest(tree: &Bvh2, count: usize) -> Vec<u32> {
    // Areas are not negative, so their bits have the same order.
    let key = |(i, area): (u64, f32)| u64::from(!area.to_bits()) << 32 | i;
    let areas = tree.nodes.iter().map(|node| node.aabb().half_area());
    let mut keys: Vec<u64> = (0..).zip(areas).skip(1).map(key).collect();
    keys.select_nth_unstable(count - 1);
    keys[..count].iter().map(|key| *key as u32).collect()
}

/// Returns the number of levels of a tree.
fn levels(tree: &Bvh2) -> usize {
    let mut levels = vec![1u32; tree.nodes.len()];
    // Children follow their parents.
    for (i, node) in tree.nodes.iter().enumerate() {
        if !node.is_leaf() {
            let (first, level) = (node.first_index as usize, levels[i] + 1);
            levels[first..first + 2].fill(level);
        }
    }
    levels.into_iter().max().unwrap_or(0) as usize
}

#[cfg(test)]
mod tests {
    use glam::Vec3A;

    use super::*;
    use crate::cpu::bvh::test_primitives::{random_boxes, validate};

    #[test]
    fn the_number_of_threads_does_not_change_the_tree() {
        let mut primitives = random_boxes(20_000, 3);
        primitives.extend_from_within(..50);
        let tree_with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            let build = || build_clusters(&primitives, Quality::Slow, 4).unwrap();
            let tree = pool.unwrap().install(build);
            (
                bytemuck::cast_slice::<_, u32>(&tree.nodes).to_vec(),
                tree.primitive_indices,
            )
        };
        let expected = tree_with(1);
        assert!(tree_with(2) == expected && tree_with(5) == expected);
    }

    #[test]
    fn thousands_of_equal_boxes_do_not_deepen_the_tree() {
        let mut primitives = random_boxes(5000, 4);
        for i in 0..20_000 {
            primitives.push(primitives[i % 2]);
        }
        for max_leaf in [1, 8] {
            let tree = build_clusters(&primitives, Quality::Medium, max_leaf).unwrap();
            validate(&tree, &primitives);
            assert!(levels(&tree) < 64, "{}", levels(&tree));
        }
    }

    #[test]
    fn nested_boxes_and_rows_at_equal_distances_are_not_clustered() {
        let nested = |i: u16| (Vec3A::splat(-f32::from(i)), Vec3A::splat(f32::from(i)));
        let row = |i: u16| (Vec3A::X * f32::from(i), Vec3A::X * f32::from(i) + 0.5);
        for place in [nested as fn(u16) -> _, row] {
            let boxes = (0..30_000).map(place);
            let boxes: Vec<_> = boxes
                .map(|(low, high)| BuildPrimitive::from_box(low, high))
                .collect();
            assert!(build_clusters(&boxes, Quality::Medium, 8).is_none());
        }
    }
}
