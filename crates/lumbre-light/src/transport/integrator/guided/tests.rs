//! The tree's densities, their refinement, and the limit of its memory.

use std::f64::consts::PI;

use glam::Vec3;

use super::direction_tree::{Cell, DirectionTree, Node, direction_of, point_of, set_masses};
use super::sd_tree::{LeafSums, Limits, SdTree};
use super::training::schedule;
use crate::math::stats::chi_square_p;

/// Side of the grid of directions over which densities are summed: no cell of [`peaked`] is smaller.
const GRID: usize = 1024;

/// Returns pseudo-random numbers in `[0, 1)`, a different one for each index.
fn number(index: u32) -> f32 {
    let mut x = index.wrapping_mul(0x9e37_79b9) ^ 0x5bd1_e995;
    for _ in 0..3 {
        x = (x ^ x >> 15).wrapping_mul(0x2c1b_3c6d);
    }
    (x >> 8) as f32 / (1 << 24) as f32
}

/// Returns the nodes of a tree whose mass concentrates at a point of the unit square and in a
/// quarter of it, refined several times; its root is the returned index.
fn peaked() -> (Vec<Node>, u32) {
    let (mut nodes, mut root) = (vec![Node::uniform()], 0);
    for _ in 0..6 {
        let mut refined = vec![Node::uniform()];
        root = DirectionTree {
            nodes: &nodes,
            root,
        }
        .append_refined(1.0, &mut refined);
        let mut sums = vec![[0.0; 4]; refined.len()];
        for i in 0..4000 {
            let point = if i % 4 == 0 {
                [0.5 * number(i), 0.5 + 0.5 * number(i + 10_000)]
            } else {
                [0.70 + 0.02 * number(i), 0.30 + 0.01 * number(i + 10_000)]
            };
            let tree = DirectionTree {
                nodes: &refined,
                root,
            };
            tree.distribute(point, 1.0, &mut |Cell { node, quadrant }, share| {
                sums[node as usize][quadrant] += f64::from(share);
            });
        }
        let value = |cell: Cell| sums[cell.node as usize][cell.quadrant];
        set_masses(&mut refined, root, 1.0, &value, |sum, _| sum);
        nodes = refined;
    }
    (nodes, root)
}

#[test]
fn points_and_directions_are_inverse_and_preserve_area() {
    for i in 0..1000 {
        let point = [number(i), number(i + 5000)];
        let back = point_of(direction_of(point));
        let far = (0..2)
            .map(|k| (point[k] - back[k]).abs())
            .fold(0.0, f32::max);
        assert!(far.min(1.0 - far) < 1e-5, "{point:?} {back:?}");
        assert!((direction_of(point).length() - 1.0).abs() < 1e-5);
    }
    // A quarter of the sphere's area lies above 60 degrees from the equator's plane, at z > 1/2.
    let above = |i: u32| direction_of([number(i), number(i + 99)]).z > 0.5;
    let share = (0..100_000).filter(|i| above(*i)).count() as f64 / 1e5;
    assert!((share - 0.25).abs() < 0.01, "{share}");
    for pole in [
        Vec3::Z,
        Vec3::NEG_Z,
        Vec3::X,
        Vec3::NEG_X,
        Vec3::Y,
        Vec3::NEG_Y,
    ] {
        let point = point_of(pole);
        assert!(
            point.iter().all(|x| (0.0..1.0).contains(x)),
            "{pole}: {point:?}"
        );
    }
}

#[test]
fn densities_integrate_to_one_over_the_sphere() {
    let (nodes, root) = peaked();
    assert!(nodes.len() > 20, "the tree was not refined");
    let tree = DirectionTree {
        nodes: &nodes,
        root,
    };
    let at = |i: usize| (i as f32 + 0.5) / GRID as f32;
    let points = (0..GRID).flat_map(|i| (0..GRID).map(move |j| [at(i), at(j)]));
    let sum: f64 = points.map(|p| f64::from(tree.pdf_w(direction_of(p)))).sum();
    let integral = sum * 4.0 * PI / (GRID * GRID) as f64;
    assert!((integral - 1.0).abs() < 1e-4, "{integral}");
}

#[test]
fn sampled_directions_have_their_density() {
    const BINS: usize = 32;
    let (nodes, root) = peaked();
    let tree = DirectionTree {
        nodes: &nodes,
        root,
    };
    let bin = |dir: Vec3| {
        let [x, y] = point_of(dir).map(|x| (x * BINS as f32) as usize);
        x * BINS + y
    };
    let samples = 200_000;
    let mut observed = vec![0.0; BINS * BINS];
    for i in 0..samples {
        let dir = tree.sample([number(2 * i), number(2 * i + 1)]);
        assert!(tree.pdf_w(dir) > 0.0, "{dir} was sampled with density zero");
        observed[bin(dir)] += 1.0;
    }
    let mut expected = vec![0.0; BINS * BINS];
    let at = |i: usize| (i as f32 + 0.5) / GRID as f32;
    for p in (0..GRID).flat_map(|i| (0..GRID).map(move |j| [at(i), at(j)])) {
        let dir = direction_of(p);
        let cells = (GRID * GRID) as f64;
        expected[bin(dir)] += f64::from(tree.pdf_w(dir)) * 4.0 * PI * f64::from(samples) / cells;
    }
    let p = chi_square_p(&observed, &expected, 0);
    assert!(p > 1e-3, "p = {p}");
}

#[test]
fn values_are_distributed_over_the_cells_around_a_point() {
    let (nodes, root) = peaked();
    let tree = DirectionTree {
        nodes: &nodes,
        root,
    };
    for i in 0..500 {
        // Points at both poles, and on both sides of the azimuth zero.
        let point = match i % 4 {
            0 => [0.0, number(i)],
            1 => [number(i), 0.0],
            2 => [0.999_999, 0.999_999],
            _ => [number(i), number(i + 1000)],
        };
        let (mut sum, mut cells) = (0.0, 0);
        tree.distribute(point, 3.0, &mut |_, share| {
            sum += share;
            cells += 1;
        });
        assert!((sum - 3.0).abs() < 1e-4, "{point:?}: {sum}");
        assert!(cells > 1 || i % 4 == 0, "{point:?}: {cells}");
    }
}

/// Returns sums of `vertices` vertices in each leaf of a tree.
fn filled(tree: &SdTree, vertices: u64) -> Vec<LeafSums> {
    let mut sums = tree.sums();
    for (leaf, sums) in sums.iter_mut().enumerate() {
        for i in 0..100 {
            let point = [number(i), 0.1 * number(i + 777)];
            tree.add(leaf as u32, sums, point, 1.0);
        }
        sums.vertices = vertices;
    }
    sums
}

#[test]
fn leaves_with_many_vertices_are_divided_in_the_middle() {
    let limits = Limits {
        vertices: 100.0,
        bytes: u64::MAX,
    };
    let one = SdTree::new([Vec3::splat(-1.0), Vec3::new(1.0, 0.0, 0.0)]);
    assert_eq!(one.leaves(), 1);
    let eight = one.refined(&filled(&one, 800), &limits);
    assert_eq!(eight.leaves(), 8);
    let corner = |i: u32| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2 & 1) as f32);
    // The cube is as wide as the longest side of the box.
    let mut leaves: Vec<u32> = (0..8)
        .map(|i| eight.leaf_at(corner(i) * 1.8 - 0.9))
        .collect();
    leaves.sort_unstable();
    assert_eq!(leaves, [0, 1, 2, 3, 4, 5, 6, 7]);
    let same = eight.refined(&filled(&eight, 100), &limits);
    assert_eq!(same.leaves(), 8);
    for outside in [Vec3::splat(-9.0), Vec3::splat(9.0), Vec3::splat(f32::NAN)] {
        assert!(eight.leaf_at(outside) < 8);
    }
}

#[test]
fn leaves_guide_to_where_light_was_found() {
    let mut tree = SdTree::new([Vec3::ZERO, Vec3::ONE]);
    assert!(tree.directions(0).is_none());
    let none = tree.sums();
    tree.set_densities(&none, |sum, _| sum);
    assert!(tree.directions(0).is_none());
    // The first cells are so large that their filter spreads light over all directions.
    let limits = Limits {
        vertices: f64::MAX,
        bytes: u64::MAX,
    };
    for _ in 0..5 {
        tree = tree.refined(&filled(&tree, 10), &limits);
        let some = filled(&tree, 10);
        tree.set_densities(&some, |sum, _| sum);
    }
    assert_eq!(tree.leaves(), 1);
    let found = tree.directions(0).expect("light was found");
    let [lit, dark] = [[0.3, 0.05], [0.3, 0.6]].map(|p| found.pdf_w(direction_of(p)));
    // The filter moves a little light across the seam of azimuths into large cells.
    assert!(lit > 0.1 && dark < 0.01 * lit, "{lit} {dark}");
}

#[test]
fn memory_stays_below_its_limit() {
    let mut tree = SdTree::new([Vec3::ZERO, Vec3::ONE]);
    let limits = Limits {
        vertices: 10.0,
        bytes: 1 << 20,
    };
    for _ in 0..4 {
        let sums = filled(&tree, 1_000_000);
        tree = tree.refined(&sums, &limits);
        let sums = filled(&tree, 0);
        tree.set_densities(&sums, |sum, _| sum);
        assert!(tree.bytes() <= limits.bytes, "{}", tree.bytes());
    }
    assert!(tree.leaves() > 100, "{}", tree.leaves());
}

#[test]
fn the_memory_of_a_tree_includes_its_cells_of_directions() {
    let one = SdTree::new([Vec3::ZERO, Vec3::ONE]);
    let unlimited = Limits {
        vertices: f64::INFINITY,
        bytes: u64::MAX,
    };
    let refined = one.refined(&filled(&one, 1_000), &unlimited);
    assert_eq!(refined.leaves(), one.leaves());
    assert!(refined.bytes() > one.bytes());
}

#[test]
fn training_iterations_double_and_use_all_paths() {
    assert_eq!(schedule(1), [1]);
    assert_eq!(schedule(2), [2]);
    assert_eq!(schedule(3), [1, 2]);
    assert_eq!(schedule(32), [1, 2, 4, 8, 17]);
    for training in 1..200 {
        assert_eq!(schedule(training).iter().sum::<u64>(), training);
    }
}

#[test]
fn vertices_train_the_leaves_on_all_sides_of_them() {
    let limits = Limits {
        vertices: 100.0,
        bytes: u64::MAX,
    };
    let one = SdTree::new([Vec3::ZERO, Vec3::ONE]);
    let eight = one.refined(&filled(&one, 800), &limits);
    // The middle of the cube is a corner of all eight leaves; a leaf's own middle is in it alone.
    for (point, expected) in [(Vec3::splat(0.5), 500.0), (Vec3::splat(0.25), 0.0)] {
        let mut counts = [0.0; 8];
        for i in 0..4000 {
            let numbers = [number(3 * i), number(3 * i + 1), number(3 * i + 2)];
            counts[eight.leaf_near(point, numbers) as usize] += 1.0;
        }
        let own = eight.leaf_at(point) as usize;
        for (leaf, count) in counts.into_iter().enumerate() {
            let expected = if expected == 0.0 && leaf == own {
                4000.0
            } else {
                expected
            };
            // Five standard deviations of a binomial distribution.
            let margin = 5.0 * (expected * (1.0 - expected / 4000.0) + 1e-9f64).sqrt();
            let off: f64 = count - expected;
            assert!(
                off.abs() <= margin,
                "{point}, leaf {leaf}: {count}, expected {expected}"
            );
        }
    }
}
