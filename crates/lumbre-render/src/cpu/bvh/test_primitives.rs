//! Primitives for the tests of the builders.

use glam::{Vec3, Vec3A};
use lumbre_light::math::rng::{pcg4d, unit};
use lumbre_light::scene::desc::MAX_COORDINATE;

use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;

use super::build_primitive::{BuildPrimitive, range};

/// Returns three uniform numbers below 1 for a key.
fn uniform(key: [u32; 4]) -> Vec3 {
    let [x, y, z, _] = pcg4d(key).map(unit::<u32>);
    Vec3::new(x, y, z)
}

/// Returns triangles in the unit cube. Some are large, most are small, and some have no area.
pub(crate) fn random_triangles(count: usize, seed: u32) -> Vec<[Vec3; 3]> {
    let triangle = |i: u32| {
        let corner = |c: u32| uniform([i, c, seed, 1]);
        let size = if i.is_multiple_of(50) { 0.5 } else { 0.05 };
        let a = corner(0);
        let b = a + corner(1) * size;
        let c = if i.is_multiple_of(17) {
            b
        } else {
            a + corner(2) * size
        };
        [a, b, c]
    };
    (0..count as u32).map(triangle).collect()
}

/// Returns the boxes of [`random_triangles`].
pub(crate) fn random_boxes(count: usize, seed: u32) -> Vec<BuildPrimitive> {
    let triangles = random_triangles(count, seed);
    triangles.iter().map(BuildPrimitive::triangle).collect()
}

/// Returns inputs on which builders could fail, each with a name.
pub(crate) fn degenerate_boxes() -> Vec<(&'static str, Vec<BuildPrimitive>)> {
    let cube = |center: f32, half: f32| {
        BuildPrimitive::from_box(Vec3A::splat(center - half), Vec3A::splat(center + half))
    };
    let huge = |i: i32| {
        let x = MAX_COORDINATE * (i as f32 / 50.0 - 1.0);
        BuildPrimitive::from_box(
            Vec3A::new(x, -MAX_COORDINATE, 0.0),
            Vec3A::new(x, MAX_COORDINATE, x.abs()),
        )
    };
    let line = |i: i32| {
        let x = 0.45f32.powi(i) * 1e10;
        BuildPrimitive::from_box(Vec3A::new(x, -1.0, -1.0), Vec3A::new(x, 1.0, 1.0))
    };
    vec![
        ("one", vec![cube(1.0, 1.0)]),
        ("two", vec![cube(1.0, 1.0), cube(-1.0, 1.0)]),
        ("points", vec![cube(0.0, 0.0); 300]),
        (
            "negative zero",
            vec![cube(0.0, 0.0), cube(-0.0, 0.0), cube(0.0, -0.0)],
        ),
        ("equal", vec![cube(3.0, 2.0); 3000]),
        (
            "nested",
            (0..3000).map(|i| cube(0.0, 1.0 + i as f32)).collect(),
        ),
        ("huge", (0..=100).map(huge).collect()),
        ("geometric line", (0..100).map(line).collect()),
    ]
}

/// Panics if a tree violates an invariant of [`super::build`], or a box is not the bounding box of
/// what is below it.
pub(crate) fn validate(tree: &Bvh2, primitives: &[BuildPrimitive]) {
    let ordered = Bvh2 {
        children_are_ordered_after_parents: true,
        max_depth: usize::MAX,
        ..tree.clone()
    };
    ordered.validate(primitives, false, true);
    let inner = tree.nodes.iter().filter(|node| !node.is_leaf());
    assert!(
        inner
            .map(|node| node.first_index)
            .all(|first| first % 2 == 1)
    );
}

/// Returns the sum of the areas of all nodes, those of leaves times their number of primitives.
pub(crate) fn weighted_area(tree: &Bvh2) -> f64 {
    let area =
        |node: &Bvh2Node| f64::from(node.aabb().half_area()) * range(node).len().max(1) as f64;
    tree.nodes.iter().map(area).sum()
}
