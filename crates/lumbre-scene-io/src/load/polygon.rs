//! Triangulation of planar polygons: fans of convex ones, and ears of concave ones.

use glam::{DVec2, DVec3};

/// Number of tests whether a point is in a triangle that are spent on the concave polygons of one
/// file. Polygons beyond become fans.
const MAX_TESTS: u64 = 1 << 28;

/// Least area of a fan's triangle on the wrong side, relative to that of the polygon, from which a
/// polygon counts as concave.
const TOLERANCE: f64 = 1e-6;

/// Triangulates the polygons of one file.
#[derive(Debug)]
pub(super) struct Triangulator {
    tests_left: u64,
    /// Number of concave polygons that became fans, which cover too much: their edges intersect,
    /// or there were too many.
    pub fans: usize,
}

impl Default for Triangulator {
    fn default() -> Triangulator {
        Triangulator {
            tests_left: MAX_TESTS,
            fans: 0,
        }
    }
}

impl Triangulator {
    /// Returns the triangles of a concave polygon, as indices of its corners in their order; `None`
    /// if a fan from the first corner covers it exactly, or nothing better is found.
    pub fn ears(&mut self, corners: &[DVec3]) -> Option<Vec<[usize; 3]>> {
        let normal = concave_normal(corners)?;
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        let flat = normal.abs();
        let k = (0..3).find(|k| flat[*k] == flat.max_element())?;
        let sign = normal[k].signum();
        let (u, v) = (axes[(k + 1) % 3], axes[(k + 2) % 3] * sign);
        let points: Vec<DVec2> = corners
            .iter()
            .map(|p| DVec2::new(p.dot(u), p.dot(v)))
            .collect();
        let ears = clip(&points, &mut self.tests_left);
        self.fans += usize::from(ears.is_none());
        ears
    }
}

/// Returns the normal of a polygon, with the length of twice its area, if a fan from its first
/// corner covers more than the polygon.
fn concave_normal(corners: &[DVec3]) -> Option<DVec3> {
    let (first, rest) = corners.split_first().filter(|(_, rest)| rest.len() > 2)?;
    let fan = rest.windows(2);
    let crosses = fan.map(|w| (w[0] - first).cross(w[1] - first));
    let sum: DVec3 = crosses.clone().sum();
    let mut reversed = crosses.filter(|c| c.dot(sum) < -TOLERANCE * sum.length_squared());
    reversed.next().map(|_| sum)
}

/// Cuts ears off a counter-clockwise polygon. Returns `None` if its edges intersect, or the tests
/// are used up.
fn clip(points: &[DVec2], tests_left: &mut u64) -> Option<Vec<[usize; 3]>> {
    let mut ring: Vec<usize> = (0..points.len()).collect();
    let mut triangles = Vec::with_capacity(points.len());
    let mut at = 0;
    while ring.len() > 3 {
        let n = ring.len();
        let corner = |k: usize| [ring[(k + n - 1) % n], ring[k % n], ring[(k + 1) % n]];
        let mut ears = (at..at + n).filter(|k| {
            let ear = corner(*k);
            *tests_left = tests_left.saturating_sub(n as u64);
            *tests_left > 0 && is_ear(points, &ring, ear)
        });
        let Some(ear) = ears.next() else {
            // Corners on a straight line are no ears, and can go.
            let straight = (0..n).find(|k| area(points, corner(*k)) == 0.0)?;
            ring.remove(straight);
            continue;
        };
        triangles.push(corner(ear));
        ring.remove(ear % n);
        at = ear % n;
    }
    let last = [ring[0], ring[1], ring[2]];
    triangles.push(last);
    // The signed areas add up to that of the polygon: if its edges intersect, the last is negative.
    (area(points, last) >= 0.0).then_some(triangles)
}

/// Returns twice the signed area of a triangle.
fn area(points: &[DVec2], [a, b, c]: [usize; 3]) -> f64 {
    (points[b] - points[a]).perp_dot(points[c] - points[a])
}

/// Returns whether three successive corners of a polygon form a triangle that contains no other.
fn is_ear(points: &[DVec2], ring: &[usize], ear: [usize; 3]) -> bool {
    let [a, b, c] = ear;
    let is_corner = |p: DVec2| ear.iter().any(|i| points[*i] == p);
    let inside = |i: &usize| {
        let sides = [[a, b, *i], [b, c, *i], [c, a, *i]];
        !is_corner(points[*i]) && sides.iter().all(|side| area(points, *side) >= 0.0)
    };
    area(points, ear) > 0.0 && !ring.iter().any(inside)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polygon(corners: &[[f64; 2]]) -> Vec<DVec3> {
        // On a slanted plane.
        let on_plane = |[x, y]: &[f64; 2]| DVec3::new(*x, *y, 0.5 * x - 2.0 * y);
        corners.iter().map(on_plane).collect()
    }

    /// Returns the sum of the areas of the triangles, and their signed sum along the normal of the
    /// plane.
    fn areas(points: &[DVec3], triangles: &[[usize; 3]]) -> [f64; 2] {
        let normal = DVec3::new(-0.5, 2.0, 1.0).normalize();
        let cross =
            |[a, b, c]: &[usize; 3]| 0.5 * (points[*b] - points[*a]).cross(points[*c] - points[*a]);
        let sum = triangles.iter().map(|t| cross(t).length()).sum();
        [sum, triangles.iter().map(|t| cross(t).dot(normal)).sum()]
    }

    #[test]
    fn concave_polygons_are_covered_exactly_in_either_orientation() {
        let l = [
            [0.0, 0.0],
            [2.0, 0.0],
            [2.0, 1.0],
            [1.0, 1.0],
            [1.0, 2.0],
            [0.0, 2.0],
        ];
        let comb: Vec<[f64; 2]> = (0..40)
            .map(|i| [f64::from(i), if i % 2 == 0 { 1.0 } else { 9.0 }])
            .chain([[39.0, -1.0], [0.0, -1.0]])
            .rev()
            .collect();
        // A corner lies on the diagonal that would cut off an ear, in some of the turns.
        let touching = [
            [0.0, 2.0],
            [0.0, 0.0],
            [3.0, 0.0],
            [4.0, 3.0],
            [1.0, 2.0],
            [2.0, 4.0],
        ];
        for corners in [&l[..], &comb, &touching] {
            for turn in 0..corners.len() {
                for reversed in [false, true] {
                    let mut corners = corners.to_vec();
                    corners.rotate_left(turn);
                    if reversed {
                        corners.reverse();
                    }
                    let points = polygon(&corners);
                    let mut triangulator = Triangulator::default();
                    // A fan from some corners is exact.
                    let Some(triangles) = triangulator.ears(&points) else {
                        assert_eq!(triangulator.fans, 0);
                        continue;
                    };
                    let [sum, signed] = areas(&points, &triangles);
                    let fan: Vec<[usize; 3]> = (2..points.len()).map(|i| [0, i - 1, i]).collect();
                    let exact = areas(&points, &fan)[1];
                    assert!((sum - exact.abs()).abs() < 1e-9, "{sum} is not {exact}");
                    assert!((signed - exact).abs() < 1e-9, "{signed} is not {exact}");
                }
            }
        }
    }

    #[test]
    fn convex_polygons_and_those_without_ears_are_fans() {
        let mut triangulator = Triangulator::default();
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        assert!(triangulator.ears(&polygon(&square)).is_none());
        assert!(triangulator.ears(&polygon(&square[..3])).is_none());
        assert_eq!(triangulator.fans, 0);
        let mut used_up = Triangulator {
            tests_left: 3,
            fans: 0,
        };
        let dart = polygon(&[[0.0, 0.0], [2.0, 1.0], [0.0, 2.0], [0.5, 1.0]]);
        assert!(used_up.ears(&dart).is_none());
        assert_eq!(used_up.fans, 1);
        assert_eq!(triangulator.ears(&dart).map(|t| t.len()), Some(2));
    }
}
