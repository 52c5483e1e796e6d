//! Shapes that a curve makes: turned about an axis, or followed by a circle.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};

use super::{Shape, ShapeError, at_least, positive, room};

/// Corners sharper than this many degrees stay sharp.
const CREASE_DEG: f32 = 40.0;

/// The surface that a profile makes when it is turned about the y axis. The profile is a list of (radius, y); going up
/// with the solid on its left, towards the axis, the front is outside. Corners below 40 degrees are smooth. The texture
/// goes round it once, and once along the profile.
///
/// # Errors
/// Fewer than two points or three segments, a negative radius, points that are not finite, a profile that stays on the
/// axis, too many vertices.
pub fn lathe(profile: &[Vec2], segments: u32) -> Result<Shape, ShapeError> {
    at_least("its number of points", profile.len(), 2)?;
    at_least("its number of segments", segments as usize, 3)?;
    room(2 * profile.len().saturating_mul(segments as usize + 1))?;
    if let Some(i) = profile.iter().position(|p| !p.is_finite() || p.x < 0.0) {
        return Err(ShapeError(format!(
            "point {} is {}: expected a radius of at least 0 and a height",
            i + 1,
            profile[i]
        )));
    }
    // The outward normal of each piece in the plane of the profile, without those of no length.
    let points: Vec<Vec2> = profile.iter().fold(Vec::new(), |mut kept, p| {
        if kept.last() != Some(p) {
            kept.push(*p);
        }
        kept
    });
    let pieces: Vec<Vec2> = points.windows(2).map(|w| (w[1] - w[0]).perp().normalize_or(Vec2::X) * -1.0).collect();
    if pieces.is_empty() || points.iter().all(|p| p.x == 0.0) {
        return Err(ShapeError::new("its profile makes no surface"));
    }
    let closed = points.first() == points.last();
    let smooth = |a: Vec2, b: Vec2| a.dot(b) > CREASE_DEG.to_radians().cos();
    let blend = |a: Vec2, b: Vec2| if smooth(a, b) { (a + b).normalize_or(a) } else { a };
    let length: f32 = points.windows(2).map(|w| w[0].distance(w[1])).sum();
    let mut shape = Shape::default();
    let mut run = 0.0;
    for (i, piece) in pieces.iter().enumerate() {
        let before = if i > 0 { Some(pieces[i - 1]) } else { closed.then(|| pieces[pieces.len() - 1]) };
        let after = pieces.get(i + 1).copied().or(closed.then(|| pieces[0]));
        let ends = [(points[i], before, run), (points[i + 1], after, run + points[i].distance(points[i + 1]))];
        run = ends[1].2;
        let first = shape.positions.len() as u32;
        for (point, neighbour, along) in ends {
            let normal = neighbour.map_or(*piece, |n| blend(*piece, n));
            for s in 0..=segments {
                let (sin, cos) = if s == segments { (0.0, 1.0) } else { (TAU * s as f32 / segments as f32).sin_cos() };
                let turn = |p: Vec2| Vec3::new(p.x * cos, p.y, p.x * sin);
                shape.positions.push(turn(point));
                shape.normals.push(turn(normal));
                shape.uvs.push(Vec2::new(1.0 - s as f32 / segments as f32, along / length));
            }
        }
        let row = segments + 1;
        for s in 0..segments {
            let (a, b, c, d) = (first + s, first + s + 1, first + row + s + 1, first + row + s);
            // On the axis one of the two triangles has no area.
            if points[i].x > 0.0 {
                shape.triangles.push([a, c, b]);
            }
            if points[i + 1].x > 0.0 {
                shape.triangles.push([a, d, c]);
            }
        }
    }
    Ok(shape)
}

/// A tube of a given radius along a line of points, smooth, with flat ends unless it is `closed`. `radii` holds one
/// radius for each point. The texture goes round it once, and along it once for each `TAU * radius` of length.
///
/// # Errors
/// Fewer than two points (three if closed) or three segments, points that coincide or are not finite, radii that are
/// not positive, too many vertices.
pub fn tube(points: &[Vec3], radii: &[f32], segments: u32, closed: bool) -> Result<Shape, ShapeError> {
    at_least("its number of points", points.len(), if closed { 3 } else { 2 })?;
    at_least("its number of segments", segments as usize, 3)?;
    positive("its radius", radii)?;
    if radii.len() != points.len() {
        return Err(ShapeError(format!("{} radii for {} points", radii.len(), points.len())));
    }
    room((points.len() + 3).saturating_mul(segments as usize + 1))?;
    let count = points.len();
    let at = |i: usize| points[i % count];
    let rings = if closed { count + 1 } else { count };
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
        let tangent = before.zip(after).and_then(|(a, b)| (a + b).try_normalize().or(Some(a)));
        let Some(tangent) = tangent.filter(|t| t.is_finite()) else {
            return Err(ShapeError(format!(
                "points {} and {} coincide, or are not finite",
                i % count + 1,
                (i + 1) % count + 1
            )));
        };
        tangents.push(tangent);
    }
    // Frames that turn as little as possible [Wang et al. 2008, double reflection]; what a closed curve has turned by in
    // the end is taken back evenly.
    let mut sides = vec![tangents[0].any_orthonormal_vector()];
    for i in 1..rings {
        let (from, to) = (at(i - 1), at(i));
        let mirror = to - from;
        let c1 = mirror.length_squared();
        let reflect = |v: Vec3| v - mirror * (2.0 / c1 * mirror.dot(v));
        let (side, tangent) = (reflect(sides[i - 1]), reflect(tangents[i - 1]));
        let second = tangents[i] - tangent;
        let c2 = second.length_squared();
        let turned = if c2 > 1e-12 { side - second * (2.0 / c2 * second.dot(side)) } else { side };
        sides.push((turned - tangents[i] * turned.dot(tangents[i])).normalize_or(tangents[i].any_orthonormal_vector()));
    }
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
            let angle = TAU * (s % segments) as f32 / segments as f32 + twist * i as f32 / (rings - 1) as f32;
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
            cap(&mut shape, ring as u32 * (segments + 1), segments, at(ring), outward);
        }
    }
    Ok(shape)
}

/// A flat end over one ring of vertices.
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
        shape.triangles.push(if p.cross(q).dot(outward) > 0.0 { [first, a, b] } else { [first, b, a] });
    }
}

/// A ring about the y axis: a circle of radius `minor` that goes round one of radius `major`.
///
/// # Errors
/// As for [`tube`]; a minor radius above the major one.
pub fn torus(major: f32, minor: f32, segments: [u32; 2]) -> Result<Shape, ShapeError> {
    positive("its radii", &[major, minor])?;
    if minor > major {
        return Err(ShapeError(format!("its inner radius {minor} is above its outer one {major}")));
    }
    at_least("its number of segments", segments[0] as usize, 3)?;
    room((segments[0] as usize).saturating_mul(segments[1] as usize))?;
    let around = |i: u32| {
        let (sin, cos) = (TAU * i as f32 / segments[0] as f32).sin_cos();
        Vec3::new(major * cos, 0.0, major * sin)
    };
    let points: Vec<Vec3> = (0..segments[0]).map(around).collect();
    tube(&points, &vec![minor; points.len()], segments[1], true)
}
