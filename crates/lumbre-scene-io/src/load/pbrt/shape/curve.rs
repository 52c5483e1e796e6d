//! Curves: hair, fur and grass, as tubes and strips of triangles.

use std::array::from_fn;

use glam::{DVec3, Vec2, Vec3};

use super::super::params::Params;
use super::super::token::truncated;
use super::{positive, vectors};
use lumbre_light::scene::shape::{Shape, tube};
use lumbre_light::scene::{Note, SceneError};

/// Straight pieces of each segment of a curve.
const PIECES: usize = 6;
/// Sides of a tube.
const SIDES: u32 = 6;

/// Reads a `curve`: a tube for `flat` and `cylinder`, a strip across its normals for `ribbon`.
pub(super) fn read(params: &Params, notes: &mut Vec<Note>) -> Result<Shape, SceneError> {
    let segments = segments(params)?;
    let width = params.number("width", 1.0)?;
    let ends = [
        positive(params, "width0", width)?,
        positive(params, "width1", width)?,
    ];
    let kind = params.text("type")?.unwrap_or("flat");
    params.mark_read(&["splitdepth"]);
    let count = segments.len() * PIECES;
    let shares: Vec<f32> = (0..=count).map(|i| i as f32 / count as f32).collect();
    let points: Vec<Vec3> = (0..=count).map(|i| point(&segments, i)).collect();
    let radii: Vec<f32> = shares
        .iter()
        .map(|t| (0.5 * (ends[0] + (ends[1] - ends[0]) * f64::from(*t))) as f32)
        .collect();
    if kind == "ribbon" {
        return ribbon(params, segments.len(), &points, &radii);
    }
    match kind {
        "flat" => {
            notes.push(params.note(
                "a flat curve, which turns to the viewer in pbrt, becomes a tube of its width",
            ))
        }
        "cylinder" => {}
        other => {
            return Err(params.error(format!(
                "unknown type of curve `{}`; expected flat, cylinder or ribbon",
                truncated(other)
            )));
        }
    }
    let mut shape = tube(&points, &radii, SIDES, false).map_err(|e| params.error(e.to_string()))?;
    // u runs along a curve of pbrt, v around it.
    let row = SIDES as usize + 1;
    for (i, uv) in shape.uvs.iter_mut().enumerate().take(row * points.len()) {
        *uv = Vec2::new(shares[i / row], (i % row) as f32 / SIDES as f32);
    }
    Ok(shape)
}

/// Returns the cubic Bézier segments of the control points.
fn segments(params: &Params) -> Result<Vec<[DVec3; 4]>, SceneError> {
    let points: Vec<[f32; 3]> = vectors(params, "P")?;
    let points: Vec<DVec3> = points
        .into_iter()
        .map(|p| Vec3::from(p).as_dvec3())
        .collect();
    let degree = params.integer("degree", 3, 3)? as usize;
    let is_spline = match params.text("basis")?.unwrap_or("bezier") {
        "bezier" => false,
        "bspline" => true,
        other => {
            return Err(params.error(format!(
                "unknown basis of a curve `{}`; expected bezier or bspline",
                truncated(other)
            )));
        }
    };
    let step = if is_spline { 1 } else { degree };
    if degree < 2 || points.len() <= degree || !(points.len() - 1 - degree).is_multiple_of(step) {
        return Err(params.error(format!(
            "{} points are no curve of degree {degree}",
            points.len()
        )));
    }
    let starts = (0..points.len() - degree).step_by(step);
    Ok(starts
        .map(|start| {
            let p = |i: usize| points[start + i];
            match (degree, is_spline) {
                (3, false) => from_fn(p),
                (3, true) => [
                    (p(0) + p(1) * 4.0 + p(2)) / 6.0,
                    (p(1) * 2.0 + p(2)) / 3.0,
                    (p(1) + p(2) * 2.0) / 3.0,
                    (p(1) + p(2) * 4.0 + p(3)) / 6.0,
                ],
                (_, false) => elevated([p(0), p(1), p(2)]),
                (_, true) => elevated([(p(0) + p(1)) / 2.0, p(1), (p(1) + p(2)) / 2.0]),
            }
        })
        .collect())
}

/// Returns the cubic segment of a quadratic one.
fn elevated([a, b, c]: [DVec3; 3]) -> [DVec3; 4] {
    [a, (a + b * 2.0) / 3.0, (b * 2.0 + c) / 3.0, c]
}

/// Returns the point at the end of a piece, counted over all segments.
fn point(segments: &[[DVec3; 4]], piece: usize) -> Vec3 {
    let index = (piece / PIECES).min(segments.len() - 1);
    let t = (piece - index * PIECES) as f64 / PIECES as f64;
    let mut p = segments[index];
    for left in (1..4).rev() {
        for i in 0..left {
            p[i] = p[i].lerp(p[i + 1], t);
        }
    }
    p[0].as_vec3()
}

/// Returns a strip whose normals go from each of the parameter `N` to the next.
fn ribbon(
    params: &Params,
    segments: usize,
    points: &[Vec3],
    radii: &[f32],
) -> Result<Shape, SceneError> {
    let normals: Vec<[f32; 3]> = vectors(params, "N")?;
    let normals: Vec<Vec3> = normals.into_iter().map(Vec3::from).collect();
    if normals.len() != segments + 1 {
        return Err(params.error(format!(
            "a ribbon of {segments} segments needs {} normals, found {}",
            segments + 1,
            normals.len()
        )));
    }
    let mut shape = Shape::default();
    for (i, (at, radius)) in points.iter().zip(radii).enumerate() {
        let before = normals[(i / PIECES).min(segments)];
        let after = normals[(i / PIECES + 1).min(segments)];
        let normal = before.lerp(after, (i % PIECES) as f32 / PIECES as f32);
        let along = points[(i + 1).min(points.len() - 1)] - points[i.max(1) - 1];
        let across = normal.cross(along).normalize_or_zero() * *radius;
        let normal = along.cross(across).normalize_or_zero();
        for (side, v) in [(-1.0, 0.0), (1.0, 1.0)] {
            shape.positions.push(*at + across * side);
            shape.normals.push(normal);
            shape
                .uvs
                .push(Vec2::new(i as f32 / (points.len() - 1) as f32, v));
        }
        if i > 0 {
            let [a, b, c, d] = [2 * i - 2, 2 * i - 1, 2 * i, 2 * i + 1].map(|k| k as u32);
            shape.triangles.extend([[a, c, b], [b, c, d]]);
        }
    }
    Ok(shape)
}
