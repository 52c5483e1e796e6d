//! Shapes swept along a curve: surfaces of revolution, tubes and tori.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};

use super::{Shape, ShapeError, check_at_least, check_positive, check_vertex_count};

/// Smallest angle in degrees between two segments of a profile that is shaded as a sharp edge.
const CREASE_DEG: f32 = 40.0;

/// Returns the surface of revolution of a profile about the y axis. The profile is a list of
/// (radius, y); its left side, seen along the profile, is the inside: going up, the solid lies
/// towards the axis. Edges below 40 degrees are smooth. The texture covers the surface once around
/// the axis and once along the profile.
///
/// # Errors
/// Fails for fewer than two points or three segments, a negative radius, points that are not
/// finite, a profile that lies on the axis, and too many vertices.
pub fn lathe(profile: &[Vec2], segments: u32) -> Result<Shape, ShapeError> {
    check_at_least("number of points", profile.len(), 2)?;
    check_at_least("number of segments", segments as usize, 3)?;
    check_vertex_count(2 * profile.len().saturating_mul(segments as usize + 1))?;
    if let Some(i) = profile.iter().position(|p| !p.is_finite() || p.x < 0.0) {
        return Err(ShapeError(format!(
            "point {} is {}; expected a radius of at least 0 and a height",
            i + 1,
            profile[i]
        )));
    }
    let points: Vec<Vec2> = profile.iter().fold(Vec::new(), |mut distinct, p| {
        if distinct.last() != Some(p) {
            distinct.push(*p);
        }
        distinct
    });
    // Outward normal of each segment in the plane of the profile.
    let normals: Vec<Vec2> = points
        .windows(2)
        .map(|w| (w[1] - w[0]).perp().normalize_or(Vec2::X) * -1.0)
        .collect();
    if normals.is_empty() || points.iter().all(|p| p.x == 0.0) {
        return Err(ShapeError::new("the profile spans no surface"));
    }
    let closed = points.first() == points.last();
    let length: f32 = points.windows(2).map(|w| w[0].distance(w[1])).sum();
    let mut shape = Shape::default();
    let mut along = 0.0;
    for (i, normal) in normals.iter().enumerate() {
        let before = if i > 0 {
            Some(normals[i - 1])
        } else {
            closed.then(|| normals[normals.len() - 1])
        };
        let after = normals.get(i + 1).copied().or(closed.then(|| normals[0]));
        let next = along + points[i].distance(points[i + 1]);
        let vertex_normal = |neighbour: Option<Vec2>| {
            neighbour.map_or(*normal, |neighbour| smoothed_normal(*normal, neighbour))
        };
        let ends = [
            (points[i], vertex_normal(before), along / length),
            (points[i + 1], vertex_normal(after), next / length),
        ];
        revolve(&mut shape, ends, segments);
        along = next;
    }
    Ok(shape)
}

/// Returns the mean of the normals of two adjacent segments, or `own` if the edge between them is
/// sharp.
fn smoothed_normal(own: Vec2, neighbour: Vec2) -> Vec2 {
    if own.dot(neighbour) > CREASE_DEG.to_radians().cos() {
        (own + neighbour).normalize_or(own)
    } else {
        own
    }
}

/// Adds the surface of revolution of one segment of a profile. Each end has a position, a normal
/// and the texture coordinate along the profile.
fn revolve(shape: &mut Shape, ends: [(Vec2, Vec2, f32); 2], segments: u32) {
    let first = shape.positions.len() as u32;
    for (point, normal, v) in ends {
        for s in 0..=segments {
            let (sin, cos) = if s == segments {
                (0.0, 1.0)
            } else {
                (TAU * s as f32 / segments as f32).sin_cos()
            };
            let rotate = |p: Vec2| Vec3::new(p.x * cos, p.y, p.x * sin);
            shape.positions.push(rotate(point));
            shape.normals.push(rotate(normal));
            shape
                .uvs
                .push(Vec2::new(1.0 - s as f32 / segments as f32, v));
        }
    }
    let row = segments + 1;
    for s in 0..segments {
        let (a, b, c, d) = (
            first + s,
            first + s + 1,
            first + row + s + 1,
            first + row + s,
        );
        // On the axis one of the two triangles has no area.
        if ends[0].0.x > 0.0 {
            shape.triangles.push([a, c, b]);
        }
        if ends[1].0.x > 0.0 {
            shape.triangles.push([a, d, c]);
        }
    }
}

/// Returns a smooth tube along a polyline, with flat ends unless it is `closed`. `radii` has one
/// radius for each point. The texture covers it once around, and along it once for each
/// `TAU * radius` of length.
///
/// # Errors
/// Fails for fewer than two points (three if closed) or three segments, points that coincide or are
/// not finite, radii that are not positive, and too many vertices.
pub fn tube(
    points: &[Vec3],
    radii: &[f32],
    segments: u32,
    closed: bool,
) -> Result<Shape, ShapeError> {
    check_at_least("number of points", points.len(), if closed { 3 } else { 2 })?;
    check_at_least("number of segments", segments as usize, 3)?;
    check_positive("the radius", radii)?;
    if radii.len() != points.len() {
        return Err(ShapeError(format!(
            "found {} radii for {} points",
            radii.len(),
            points.len()
        )));
    }
    check_vertex_count((points.len() + 3).saturating_mul(segments as usize + 1))?;
    let count = points.len();
    let at = |i: usize| points[i % count];
    let rings = if closed { count + 1 } else { count };
    let tangents = tube_tangents(points, rings, closed)?;
    let sides = rotation_minimizing_sides(points, &tangents);
    // A closed curve distributes the remaining rotation between its ends evenly.
    let twist = if closed {
        let (first, last) = (sides[0], sides[rings - 1]);
        last.cross(first).dot(tangents[0]).atan2(last.dot(first))
    } else {
        0.0
    };
    let mut shape = Shape::default();
    let mut along = 0.0;
    for i in 0..rings {
        if i > 0 {
            along += at(i).distance(at(i - 1)) / (TAU * radii[i % count]);
        }
        let side = sides[i];
        let up = tangents[i].cross(side);
        for s in 0..=segments {
            let angle = TAU * (s % segments) as f32 / segments as f32
                + twist * i as f32 / (rings - 1) as f32;
            let (sin, cos) = angle.sin_cos();
            let normal = side * cos + up * sin;
            shape.positions.push(at(i) + normal * radii[i % count]);
            shape.normals.push(normal);
            shape.uvs.push(Vec2::new(s as f32 / segments as f32, along));
        }
    }
    shape.lattice(0, segments + 1, rings as u32, false);
    if !closed {
        for (ring, outward) in [(0, -tangents[0]), (rings - 1, tangents[rings - 1])] {
            let first = ring as u32 * (segments + 1);
            cap(&mut shape, first, segments, at(ring), outward);
        }
    }
    Ok(shape)
}

/// Returns the unit tangent of a polyline at each ring: the mean direction of the adjacent
/// segments.
///
/// # Errors
/// Fails if adjacent points coincide or are not finite.
fn tube_tangents(points: &[Vec3], rings: usize, closed: bool) -> Result<Vec<Vec3>, ShapeError> {
    let count = points.len();
    let at = |i: usize| points[i % count];
    let step = |i: usize| (at(i + 1) - at(i)).try_normalize();
    let mut tangents = Vec::with_capacity(rings);
    for i in 0..rings {
        let before = if i > 0 {
            step(i - 1)
        } else if closed {
            step(count - 1)
        } else {
            step(0)
        };
        let after = if i + 1 < rings {
            step(i)
        } else if closed {
            step(0)
        } else {
            step(i - 1)
        };
        let tangent = before
            .zip(after)
            .and_then(|(a, b)| (a + b).try_normalize().or(Some(a)));
        let Some(tangent) = tangent.filter(|t| t.is_finite()) else {
            return Err(ShapeError(format!(
                "points {} and {} coincide or are not finite",
                i % count + 1,
                (i + 1) % count + 1
            )));
        };
        tangents.push(tangent);
    }
    Ok(tangents)
}

/// Returns a unit vector orthogonal to each tangent, rotating as little as possible from ring to
/// ring [Wang et al. 2008, double reflection].
fn rotation_minimizing_sides(points: &[Vec3], tangents: &[Vec3]) -> Vec<Vec3> {
    let at = |i: usize| points[i % points.len()];
    let mut sides = vec![tangents[0].any_orthonormal_vector()];
    for i in 1..tangents.len() {
        let (from, to) = (at(i - 1), at(i));
        let mirror = to - from;
        let c1 = mirror.length_squared();
        let reflect = |v: Vec3| v - mirror * (2.0 / c1 * mirror.dot(v));
        let (side, tangent) = (reflect(sides[i - 1]), reflect(tangents[i - 1]));
        let second = tangents[i] - tangent;
        let c2 = second.length_squared();
        let rotated = if c2 > 1e-12 {
            side - second * (2.0 / c2 * second.dot(side))
        } else {
            side
        };
        sides.push(
            (rotated - tangents[i] * rotated.dot(tangents[i]))
                .normalize_or(tangents[i].any_orthonormal_vector()),
        );
    }
    sides
}

/// Adds a flat end cap over one ring of vertices.
fn cap(shape: &mut Shape, ring: u32, segments: u32, centre: Vec3, outward: Vec3) {
    let first = shape.positions.len() as u32;
    shape.positions.push(centre);
    shape.normals.push(outward);
    shape.uvs.push(Vec2::splat(0.5));
    for s in 0..segments {
        let (sin, cos) = (TAU * s as f32 / segments as f32).sin_cos();
        shape.positions.push(shape.positions[(ring + s) as usize]);
        shape.normals.push(outward);
        shape.uvs.push(Vec2::new(0.5 + 0.5 * cos, 0.5 + 0.5 * sin));
    }
    for s in 0..segments {
        let [a, b] = [first + 1 + s, first + 1 + (s + 1) % segments];
        let [p, q] = [a, b].map(|i| shape.positions[i as usize] - centre);
        shape.triangles.push(if p.cross(q).dot(outward) > 0.0 {
            [first, a, b]
        } else {
            [first, b, a]
        });
    }
}

/// Returns a torus about the y axis: a circle of radius `minor` swept along one of radius `major`.
///
/// # Errors
/// Fails like [`tube`], and for a minor radius above the major one.
pub fn torus(major: f32, minor: f32, segments: [u32; 2]) -> Result<Shape, ShapeError> {
    check_positive("the radius", &[major, minor])?;
    if minor > major {
        return Err(ShapeError(format!(
            "the minor radius {minor} is greater than the major radius {major}"
        )));
    }
    check_at_least("number of segments", segments[0] as usize, 3)?;
    check_vertex_count((segments[0] as usize).saturating_mul(segments[1] as usize))?;
    let around = |i: u32| {
        let (sin, cos) = (TAU * i as f32 / segments[0] as f32).sin_cos();
        Vec3::new(major * cos, 0.0, major * sin)
    };
    let points: Vec<Vec3> = (0..segments[0]).map(around).collect();
    tube(&points, &vec![minor; points.len()], segments[1], true)
}
