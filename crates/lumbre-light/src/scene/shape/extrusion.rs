//! Extrusion: a planar outline extended along z to a solid.

use glam::{Vec2, Vec3};

use super::{Shape, ShapeError, check_at_least, check_positive, check_vertex_count};

/// Greatest number of points of an outline: triangulation takes time quadratic in it.
const MAX_POINTS: usize = 10_000;

/// Returns a solid with the given outline in the xy plane, from z = -depth / 2 to depth / 2, flat
/// shaded. The outline is closed implicitly, in either direction; it may be concave but must not
/// intersect itself. Texture coordinates of faces and rim are in scene units.
///
/// # Errors
/// Fails for fewer than three points, points that coincide, an outline that intersects itself or
/// has no area, and a depth that is not positive.
pub fn extrude(outline: &[Vec2], depth: f32) -> Result<Shape, ShapeError> {
    check_at_least("number of points", outline.len(), 3)?;
    check_positive("the depth", &[depth])?;
    check_vertex_count(6 * outline.len())?;
    if outline.len() > MAX_POINTS {
        return Err(ShapeError(format!(
            "the outline has {} points; expected at most {MAX_POINTS}",
            outline.len()
        )));
    }
    if let Some(i) = outline.iter().position(|p| !p.is_finite()) {
        return Err(ShapeError(format!("point {} is not finite", i + 1)));
    }
    let mut points = outline.to_vec();
    if twice_area(&points) < 0.0 {
        points.reverse();
    }
    let faces = triangulate(&points)?;
    let mut shape = Shape::default();
    let half = 0.5 * depth;
    for (z, front) in [(half, true), (-half, false)] {
        let first = shape.positions.len() as u32;
        shape.positions.extend(points.iter().map(|p| p.extend(z)));
        shape.uvs.extend(
            points
                .iter()
                .map(|p| if front { *p } else { Vec2::new(-p.x, p.y) }),
        );
        shape.triangles.extend(faces.iter().map(|[a, b, c]| {
            if front {
                [first + a, first + b, first + c]
            } else {
                [first + a, first + c, first + b]
            }
        }));
    }
    let mut along = 0.0;
    for (i, p) in points.iter().enumerate() {
        let q = points[(i + 1) % points.len()];
        let next = along + p.distance(q);
        let a = shape.positions.len() as u32;
        let corner = |p: Vec2, z: f32| Vec3::new(p.x, p.y, z);
        shape.positions.extend([
            corner(*p, half),
            corner(*p, -half),
            corner(q, -half),
            corner(q, half),
        ]);
        shape
            .uvs
            .extend([(along, half), (along, -half), (next, -half), (next, half)].map(Vec2::from));
        shape
            .triangles
            .extend([[a, a + 1, a + 2], [a, a + 2, a + 3]]);
        along = next;
    }
    Ok(shape)
}

/// Returns twice the signed area of the triangle `a`, `b`, `c`.
fn cross(a: Vec2, b: Vec2, c: Vec2) -> f64 {
    let (p, q) = ((b - a).as_dvec2(), (c - a).as_dvec2());
    p.perp_dot(q)
}

/// Returns twice the signed area of a polygon, positive if it runs counter-clockwise.
fn twice_area(points: &[Vec2]) -> f64 {
    let next = points.iter().cycle().skip(1);
    points
        .iter()
        .zip(next)
        .map(|(a, b)| a.as_dvec2().perp_dot(b.as_dvec2()))
        .sum()
}

/// Triangulates a counter-clockwise outline by ear clipping: convex corners whose triangle contains
/// no other point are cut off one by one.
fn triangulate(points: &[Vec2]) -> Result<Vec<[u32; 3]>, ShapeError> {
    let mut left: Vec<u32> = (0..points.len() as u32).collect();
    let mut triangles = Vec::with_capacity(points.len().saturating_sub(2));
    let at = |i: u32| points[i as usize];
    while left.len() > 3 {
        let n = left.len();
        let ear = (0..n).find(|i| {
            let [a, b, c] = [left[(i + n - 1) % n], left[*i], left[(i + 1) % n]];
            let inside = |p: u32| {
                let p = at(p);
                ![a, b, c].into_iter().any(|v| at(v) == p)
                    && cross(at(a), at(b), p) >= 0.0
                    && cross(at(b), at(c), p) >= 0.0
                    && cross(at(c), at(a), p) >= 0.0
            };
            cross(at(a), at(b), at(c)) > 0.0 && !left.iter().any(|p| inside(*p))
        });
        // A polygon without an ear has collinear points, which may be removed, or intersects
        // itself.
        let on_line = || {
            (0..n).find(|i| {
                cross(
                    at(left[(i + n - 1) % n]),
                    at(left[*i]),
                    at(left[(i + 1) % n]),
                ) == 0.0
            })
        };
        if let Some(i) = ear {
            triangles.push([left[(i + n - 1) % n], left[i], left[(i + 1) % n]]);
            left.remove(i);
        } else if let Some(i) = on_line() {
            left.remove(i);
        } else {
            return Err(ShapeError::new("the outline intersects itself"));
        }
    }
    if cross(at(left[0]), at(left[1]), at(left[2])) > 0.0 {
        triangles.push([left[0], left[1], left[2]]);
    }
    let covered: f64 = triangles
        .iter()
        .map(|[a, b, c]| cross(at(*a), at(*b), at(*c)))
        .sum();
    let area = twice_area(points);
    if triangles.is_empty() || (covered - area).abs() > 1e-4 * area.abs() {
        return Err(ShapeError::new(
            "the outline intersects itself, or has no area",
        ));
    }
    Ok(triangles)
}
