//! Parts of long triangles: the box of a long triangle that is oblique to the axes is mostly empty and
//! overlaps those of many others. Before a tree is built, such triangles are cut into parts, each
//! with a box of its own [Karras and Aila 2013, section 4].
//!
//! Invariant: the boxes of the parts of a triangle cover it, so a ray that hits it hits one of them.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use glam::{DVec3, Vec3, Vec3A};
use obvhs::aabb::Aabb;

use super::build_primitive::BuildPrimitive;

/// Parts are cut while they waste at least this multiple of the area of the scene's box over the
/// number of primitives (docs/notes/rays.md).
const LEAST_WASTE: f64 = 16.0;

/// Greatest number of primitives that cuts add, as a share of the triangles.
pub(crate) const MOST_ADDED: f32 = 0.5;

/// Boxes of parts are wider than the parts by this share of the triangle's greatest coordinate, since
/// corners of parts and hits of rays are rounded.
const MARGIN: f32 = 1.0 / (1 << 21) as f32;

/// Number of cells of the grid of planes along each axis.
const CELLS: f64 = (1 << 20) as f64;

/// Primitives of which some are parts of triangles.
pub(crate) struct Parts {
    /// All primitives, cut or not.
    pub primitives: Vec<BuildPrimitive>,
    /// Index of the whole primitive of each.
    pub whole: Vec<u32>,
}

/// Cuts long triangles. The first `primitives` are those of `triangles`. The number of primitives
/// grows at most by `share` of that of the triangles. Returns `None` if nothing is cut.
pub(crate) fn cut_triangles(
    triangles: &[[Vec3; 3]],
    primitives: &[BuildPrimitive],
    share: f32,
) -> Option<Parts> {
    let mut left = (share * triangles.len() as f32) as usize;
    let boxes = primitives.iter().map(|p| p.aabb);
    let scene = boxes.fold(Aabb::empty(), |all, aabb| all.union(&aabb));
    let least = LEAST_WASTE * f64::from(scene.half_area()) / primitives.len() as f64;
    let corners = triangles.iter().map(|corners| corners.map(Vec3::as_dvec3));
    let long = corners
        .zip(0..)
        .filter(|(corners, _)| waste(corners) > least);
    let whole = |(corners, triangle): ([DVec3; 3], u32)| Part::new(triangle, corners.to_vec());
    let mut parts: BinaryHeap<Part> = long.map(whole).collect();
    if left == 0 || parts.is_empty() {
        return None;
    }
    let grid = Grid::new(&scene);
    let mut finished = Vec::new();
    while let Some(part) = parts.pop() {
        let halves = match left > 0 && part.waste > least {
            true => grid.halves(&part),
            false => None,
        };
        if let Some(halves) = halves {
            left -= 1;
            parts.extend(halves);
        } else {
            finished.push(part);
        }
    }
    Some(with_parts(triangles, primitives, finished))
}

/// Replaces primitives by their parts: the first takes the place of the whole, the others follow all.
fn with_parts(
    triangles: &[[Vec3; 3]],
    primitives: &[BuildPrimitive],
    mut parts: Vec<Part>,
) -> Parts {
    parts.sort_by_key(|part| part.triangle);
    let mut all = Parts {
        primitives: primitives.to_vec(),
        whole: (0..primitives.len() as u32).collect(),
    };
    for of_one in parts.chunk_by(|a, b| a.triangle == b.triangle) {
        let triangle = of_one[0].triangle;
        let corners = &triangles[triangle as usize];
        all.primitives[triangle as usize] = of_one[0].primitive(corners);
        for part in &of_one[1..] {
            all.primitives.push(part.primitive(corners));
            all.whole.push(triangle);
        }
    }
    all
}

/// Part of a triangle. Parts are ordered by what their boxes waste.
struct Part {
    /// Index of the triangle.
    triangle: u32,
    /// Corners of a convex polygon.
    polygon: Vec<DVec3>,
    /// Area that its box wastes.
    waste: f64,
}

impl Part {
    fn new(triangle: u32, polygon: Vec<DVec3>) -> Part {
        Part {
            waste: waste(&polygon),
            triangle,
            polygon,
        }
    }

    /// Returns its box, which lies in that of the triangle with these corners.
    fn primitive(&self, corners: &[Vec3; 3]) -> BuildPrimitive {
        let whole = Aabb::from_points(&corners.map(Vec3A::from));
        let margin = whole.min.abs().max(whole.max.abs()).max_element() * MARGIN;
        let [low, high] = bounds(&self.polygon).map(|corner| Vec3A::from(corner.as_vec3()));
        BuildPrimitive::from_box(
            (low - margin).max(whole.min),
            (high + margin).min(whole.max),
        )
    }

    /// Returns the part of it where `sign` times the distance from a plane is positive.
    fn side(&self, (axis, at): (usize, f64), sign: f64) -> Part {
        let distance = |corner: &DVec3| sign * (corner[axis] - at);
        let mut inside = Vec::with_capacity(self.polygon.len() + 1);
        let next = self.polygon.iter().cycle().skip(1);
        for (corner, next) in self.polygon.iter().zip(next) {
            let (here, there) = (distance(corner), distance(next));
            if here >= 0.0 {
                inside.push(*corner);
            }
            if here.min(there) < 0.0 && here.max(there) > 0.0 {
                let mut crossing = corner.lerp(*next, here / (here - there));
                crossing[axis] = at;
                inside.push(crossing);
            }
        }
        Part::new(self.triangle, inside)
    }
}

impl Ord for Part {
    fn cmp(&self, other: &Part) -> Ordering {
        let by_waste = self.waste.total_cmp(&other.waste);
        by_waste.then(other.triangle.cmp(&self.triangle))
    }
}

impl PartialOrd for Part {
    fn partial_cmp(&self, other: &Part) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Part {
    fn eq(&self, other: &Part) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Part {}

/// Returns half of the area of a convex polygon's box, less twice the areas that it covers as seen
/// along the three axes: 0 for half of a rectangle that is parallel to two axes, whose other half has
/// the same box.
fn waste(polygon: &[DVec3]) -> f64 {
    let [low, high] = bounds(polygon);
    let size = high - low;
    let half_area = size.x * size.y + size.y * size.z + size.z * size.x;
    let from_first = |corner: &DVec3| *corner - polygon[0];
    let fans = polygon[1..].windows(2);
    let normal: DVec3 = fans
        .map(|fan| from_first(&fan[0]).cross(from_first(&fan[1])))
        .sum();
    half_area - normal.abs().element_sum()
}

/// Returns the least and greatest coordinates of a polygon.
fn bounds(polygon: &[DVec3]) -> [DVec3; 2] {
    let start = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    let extend = |[low, high]: [DVec3; 2], corner: &DVec3| [low.min(*corner), high.max(*corner)];
    polygon.iter().fold(start, extend)
}

/// Planes at which parts are cut: they halve the scene's box, its halves, and so on. Parts of
/// neighbouring triangles are cut at the same planes.
struct Grid {
    origin: DVec3,
    /// Size of a cell.
    cell: DVec3,
}

impl Grid {
    fn new(scene: &Aabb) -> Grid {
        let [low, high] = [scene.min, scene.max].map(|corner| corner.as_dvec3());
        Grid {
            origin: low,
            cell: (high - low) / CELLS,
        }
    }

    /// Cuts a part at the plane through it that divides the largest part of the grid. Returns `None`
    /// if no plane meets it.
    fn halves(&self, part: &Part) -> Option<[Part; 2]> {
        let [low, high] = bounds(&part.polygon);
        let largest = |axis: usize| {
            let cells = |x: f64| ((x - self.origin[axis]) / self.cell[axis]).clamp(0.0, CELLS);
            let (before, last) = (cells(low[axis]).floor(), cells(high[axis]).ceil() - 1.0);
            // Planes after `before` up to `last`: the one whose number has the most zeros at its end.
            let (before, last) = (before as u32, last as u32);
            let bit = (before ^ last).checked_ilog2().filter(|_| before < last)?;
            let at = self.origin[axis] + f64::from(last >> bit << bit) * self.cell[axis];
            let size = f64::from(1u32 << bit) * self.cell[axis];
            (low[axis] < at && at < high[axis]).then_some((size, (axis, at)))
        };
        let planes = (0..3).filter_map(largest);
        let (_, plane) = planes.max_by(|a, b| a.0.total_cmp(&b.0))?;
        Some([-1.0, 1.0].map(|sign| part.side(plane, sign)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::bvh::test_primitives::random_triangles;

    fn boxes(triangles: &[[Vec3; 3]]) -> Vec<BuildPrimitive> {
        triangles.iter().map(BuildPrimitive::triangle).collect()
    }

    /// Asserts that the boxes of the parts cover their triangle and lie in its box, and returns the
    /// area of all boxes beside that of uncut triangles.
    fn check(triangles: &[[Vec3; 3]], parts: &Parts) -> f64 {
        let uncut = boxes(triangles);
        for (i, [a, b, c]) in triangles.iter().enumerate() {
            let of_triangle = |(_, whole): &(_, &u32)| **whole as usize == i;
            let of_triangle = parts
                .primitives
                .iter()
                .zip(&parts.whole)
                .filter(of_triangle);
            let own: Vec<Aabb> = of_triangle.map(|(part, _)| part.aabb).collect();
            assert!(
                own.iter()
                    .all(|aabb| uncut[i].aabb.union(aabb) == uncut[i].aabb),
                "{i}"
            );
            for (u, v) in (0..40).flat_map(|u| (0..=40 - u).map(move |v| (u, v))) {
                let [u, v] = [u, v].map(|n| n as f32 / 40.0);
                let point = Vec3A::from(*a * (1.0 - u - v) + *b * u + *c * v);
                let point = point.clamp(uncut[i].aabb.min, uncut[i].aabb.max);
                assert!(
                    own.iter().any(|aabb| aabb.contains_point(point)),
                    "{i} {u} {v}"
                );
            }
        }
        let area = |of: &[BuildPrimitive]| -> f64 {
            of.iter().map(|p| f64::from(p.aabb.half_area())).sum()
        };
        area(&parts.primitives) / area(&uncut)
    }

    #[test]
    fn parts_of_oblique_triangles_cover_them_with_less_area() {
        let mut triangles = random_triangles(300, 4);
        for i in 0..100 {
            let at = Vec3::new(1.0, -1.0, 0.0) * i as f32 * 0.01;
            triangles.push([at, at + Vec3::ONE, at + Vec3::new(0.5, 0.52, 0.48)]);
        }
        let parts = cut_triangles(&triangles, &boxes(&triangles), 0.5).unwrap();
        let added = parts.primitives.len() - triangles.len();
        assert!((100..=200).contains(&added), "{added}");
        assert!((0..triangles.len()).all(|i| parts.whole[i] as usize == i));
        let ratio = check(&triangles, &parts);
        assert!(ratio < 0.6, "{ratio}");
        let few = cut_triangles(&triangles, &boxes(&triangles), 0.1).unwrap();
        assert_eq!(few.primitives.len() - triangles.len(), 40);
        let ratio_of_few = check(&triangles, &few);
        assert!(ratio < ratio_of_few && ratio_of_few < 0.9, "{ratio_of_few}");
    }

    #[test]
    fn walls_and_even_meshes_stay_whole() {
        let square =
            |at: Vec3, u: Vec3, v: Vec3| [[at, at + u, at + v], [at + u, at + u + v, at + v]];
        let mut room: Vec<[Vec3; 3]> = square(Vec3::ZERO, Vec3::X * 9.0, Vec3::Y * 7.0).to_vec();
        room.extend(square(Vec3::ZERO, Vec3::X * 9.0, Vec3::Z * 7.0));
        room.extend(random_triangles(300, 5).iter().map(|t| t.map(|c| c * 0.1)));
        assert!(cut_triangles(&room, &boxes(&room), 0.3).is_none());
        let oblique = Vec3::new(0.3, 0.4, 0.5);
        let even: Vec<[Vec3; 3]> = (0..300)
            .flat_map(|i| square(oblique * i as f32, Vec3::X + Vec3::Y, Vec3::Z - Vec3::X))
            .collect();
        assert!(cut_triangles(&even, &boxes(&even), 0.3).is_none());
        assert!(cut_triangles(&[], &boxes(&even), 0.3).is_none());
        assert!(cut_triangles(&room, &boxes(&room), 0.0).is_none());
    }

    #[test]
    fn extreme_coordinates_are_covered() {
        for scale in [1e-38, 1e-30, 1e15, 1e18] {
            let mut triangles: Vec<[Vec3; 3]> = random_triangles(200, 6);
            triangles.push([Vec3::ZERO, Vec3::ONE, Vec3::new(0.5, 0.6, 0.4)].map(|c| c * 9.0));
            triangles.push([Vec3::ONE, Vec3::ONE, Vec3::ONE]);
            let triangles: Vec<_> = triangles.iter().map(|t| t.map(|c| c * scale)).collect();
            if let Some(parts) = cut_triangles(&triangles, &boxes(&triangles), 0.3) {
                check(&triangles, &parts);
            }
        }
        let far = f32::MAX;
        let huge = [[
            Vec3::splat(-far),
            Vec3::splat(far),
            Vec3::new(far, -far, 0.0),
        ]; 3];
        let parts = cut_triangles(&huge, &boxes(&huge), 1.0);
        assert!(parts.is_none_or(|parts| check(&huge, &parts) > 0.0));
    }

    /// Returns where the edges of a triangle meet a plane across an axis.
    fn crossings(triangle: &[Vec3; 3], axis: usize, at: f64) -> Vec<DVec3> {
        let corners = triangle.map(Vec3::as_dvec3);
        let edges = (0..3).map(|i| (corners[i], corners[(i + 1) % 3]));
        edges
            .filter(|(a, b)| (a[axis] - at) * (b[axis] - at) < 0.0)
            .map(|(a, b)| a.lerp(b, (at - a[axis]) / (b[axis] - a[axis])))
            .collect()
    }

    #[test]
    fn hits_beside_the_cuts_lie_in_a_part_however_they_are_rounded() {
        let mut triangles = random_triangles(300, 4);
        for i in 0..100 {
            let at = Vec3::new(1.0, -1.0, 0.3) * i as f32 * 0.01;
            triangles.push([at, at + Vec3::ONE, at + Vec3::new(0.5, 0.52, 0.48)]);
        }
        let parts = cut_triangles(&triangles, &boxes(&triangles), 0.5).unwrap();
        let mut tested = 0;
        for (i, triangle) in triangles.iter().enumerate() {
            let whole = BuildPrimitive::triangle(triangle).aabb;
            let greatest = whole.min.abs().max(whole.max.abs()).max_element();
            let unit = greatest * f32::EPSILON;
            let all = parts.primitives.iter().zip(&parts.whole);
            let own: Vec<Aabb> = all
                .filter(|(_, whole)| **whole as usize == i)
                .map(|(part, _)| part.aabb)
                .collect();
            let bounds = own.iter().flat_map(|aabb| [aabb.min, aabb.max]);
            for (bound, axis) in bounds.flat_map(|bound| (0..3).map(move |axis| (bound, axis))) {
                for p in crossings(triangle, axis, f64::from(bound[axis])) {
                    for signs in 0..8 {
                        let sign = |axis: usize| if signs >> axis & 1 == 0 { -1.0 } else { 1.0 };
                        let off = Vec3A::new(sign(0), sign(1), sign(2)) * unit;
                        let hit = (Vec3A::from(p.as_vec3()) + off).clamp(whole.min, whole.max);
                        let found = own.iter().any(|aabb| aabb.contains_point(hit));
                        assert!(found, "triangle {i}: {hit} is in none of {own:?}");
                        tested += 1;
                    }
                }
            }
        }
        assert!(tested > 1000, "{tested}");
    }
}
