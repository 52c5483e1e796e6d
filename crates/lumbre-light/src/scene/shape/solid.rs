//! Solids: boxes with sharp or rounded edges, and geodesic spheres.

use std::collections::BTreeMap;
use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3};

use super::{Shape, ShapeError, check_at_least, check_positive, check_vertex_count};

/// Returns a box about the origin. A `bevel` above 0 rounds edges and corners with that radius in
/// `segments` steps, shaded smoothly; 0 makes the box flat shaded. The texture covers every side
/// once.
///
/// # Errors
/// Fails for sizes that are not positive, a bevel above half the smallest side, and no segments or
/// too many.
pub fn cuboid(size: Vec3, bevel: f32, segments: u32) -> Result<Shape, ShapeError> {
    check_positive("the size", &size.to_array())?;
    if !(0.0..=0.5 * size.min_element()).contains(&bevel) {
        return Err(ShapeError(format!(
            "the bevel is {bevel}; expected 0 to half of the smallest side"
        )));
    }
    let round = bevel > 0.0;
    if round {
        check_at_least("number of segments", segments as usize, 1)?;
    }
    // Lattice lines of a side from one edge to the other, as positions on the cube [-1, 1].
    let lines: Vec<(f32, f32)> = if round {
        let bend = |i: u32| (0.25 * PI * i as f32 / segments as f32).tan();
        let low = (0..=segments).rev().map(|i| (-1.0, -bend(i)));
        low.chain((0..=segments).map(|i| (1.0, bend(i)))).collect()
    } else {
        vec![(-1.0, -1.0), (1.0, 1.0)]
    };
    check_vertex_count(6 * lines.len() * lines.len())?;
    let inner = 0.5 * size - bevel;
    let mut shape = Shape::default();
    for (normal, right) in [
        (Vec3::X, Vec3::NEG_Z),
        (Vec3::NEG_X, Vec3::Z),
        (Vec3::Y, Vec3::X),
        (Vec3::NEG_Y, Vec3::X),
        (Vec3::Z, Vec3::X),
        (Vec3::NEG_Z, Vec3::NEG_X),
    ] {
        let up = normal.cross(right);
        let first = shape.positions.len() as u32;
        for (v_side, v) in &lines {
            for (u_side, u) in &lines {
                let corner = inner * (normal + right * *u_side + up * *v_side);
                let outward = (normal + right * *u + up * *v).normalize_or(normal);
                let position = if round {
                    corner + bevel * outward
                } else {
                    corner
                };
                shape.positions.push(position);
                if round {
                    shape.normals.push(outward);
                }
                let along = |axis: Vec3| 0.5 + position.dot(axis) / size.dot(axis.abs());
                shape.uvs.push(Vec2::new(along(right), along(up)));
            }
        }
        shape.lattice(first, lines.len() as u32, lines.len() as u32, false);
    }
    Ok(shape)
}

/// Returns a geodesic sphere about the origin: an icosahedron whose triangles are split into four
/// `splits` times, shaded smoothly. The texture covers it once, equirectangular.
///
/// # Errors
/// Fails for a radius that is not positive, and for too many vertices.
pub fn icosphere(radius: f32, splits: u32) -> Result<Shape, ShapeError> {
    check_positive("the radius", &[radius])?;
    check_vertex_count(20usize.saturating_mul(4usize.saturating_pow(splits)))?;
    let (mut directions, mut triangles) = icosahedron();
    directions
        .iter_mut()
        .for_each(|d| *d = d.normalize_or(Vec3::Y));
    for _ in 0..splits {
        let mut middles: BTreeMap<[u32; 2], u32> = BTreeMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                let sum = directions[a as usize] + directions[b as usize];
                directions.push(sum.normalize_or(Vec3::Y));
                directions.len() as u32 - 1
            })
        };
        let split = |[a, b, c]: [u32; 3]| {
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        triangles = triangles.into_iter().flat_map(split).collect();
    }
    let uv = |d: &Vec3| {
        Vec2::new(
            0.5 + d.x.atan2(d.z) / TAU,
            0.5 + d.y.clamp(-1.0, 1.0).asin() / PI,
        )
    };
    let mut shape = Shape {
        positions: directions.iter().map(|d| *d * radius).collect(),
        uvs: directions.iter().map(uv).collect(),
        normals: directions,
        triangles,
        ..Shape::default()
    };
    unwrap_seam(&mut shape);
    Ok(shape)
}

/// Returns the vertices of an icosahedron, not normalised, and its triangles, counter-clockwise
/// seen from outside.
fn icosahedron() -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let golden = 0.5 * (1.0 + 5f32.sqrt());
    let mut directions: Vec<Vec3> = Vec::new();
    for (a, b) in [
        (-1.0, golden),
        (1.0, golden),
        (-1.0, -golden),
        (1.0, -golden),
    ] {
        directions.extend([
            Vec3::new(a, b, 0.0),
            Vec3::new(0.0, a, b),
            Vec3::new(b, 0.0, a),
        ]);
    }
    let near = |a: usize, b: usize| (directions[a] - directions[b]).length_squared() < 4.1;
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(a, c) {
                    let [p, q, r] = [a, b, c].map(|i| directions[i]);
                    let out = (q - p).cross(r - p).dot(p) > 0.0;
                    triangles.push(if out { [a, b, c] } else { [a, c, b] }.map(|i| i as u32));
                }
            }
        }
    }
    (directions, triangles)
}

/// Duplicates vertices of triangles across the texture's seam and at its poles, so that texture
/// coordinates do not jump within a triangle.
fn unwrap_seam(shape: &mut Shape) {
    for t in 0..shape.triangles.len() {
        let corners = shape.triangles[t].map(|c| c as usize);
        let us = corners.map(|c| shape.uvs[c].x);
        let pole = |c: usize| shape.normals[c].y.abs() > 1.0 - 1e-6;
        let most = us.iter().fold(f32::MIN, |a, b| a.max(*b));
        let low = |u: f32| most - u > 0.5;
        let placed = corners.map(|c| !pole(c));
        let unrolled: Vec<f32> = us
            .iter()
            .map(|u| if low(*u) { u + 1.0 } else { *u })
            .collect();
        let others: f32 = unrolled
            .iter()
            .zip(placed)
            .filter(|(_, p)| *p)
            .map(|(u, _)| u)
            .sum();
        let count = placed.iter().filter(|p| **p).count().max(1);
        for i in 0..3 {
            let u = if placed[i] {
                unrolled[i]
            } else {
                others / count as f32
            };
            if u == us[i] {
                continue;
            }
            let c = corners[i];
            shape.triangles[t][i] = shape.positions.len() as u32;
            shape.positions.push(shape.positions[c]);
            shape.normals.push(shape.normals[c]);
            shape.uvs.push(Vec2::new(u, shape.uvs[c].y));
        }
    }
}
