//! Meshes of spheres, disks, cylinders and bilinear patches, with the texture coordinates of pbrt.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};

use super::super::params::Params;
use super::{indices, vertices};
use lumbre_light::scene::SceneError;
use lumbre_light::scene::shape::Shape;

/// Segments of the outline of a disk or cylinder: the area is too small by a factor of 1e-4.
const SEGMENTS: u32 = 256;
/// Rings of a sphere, each of twice as many fields: 65,024 triangles.
const SPHERE_RINGS: u32 = 128;
/// Fields of a bilinear patch along each side.
const PATCH_FIELDS: u32 = 8;

/// Returns a grid of `rows` by `columns` fields; `at` maps u and v to a position and a normal. The
/// front is the side of the cross product of the directions of increasing u and v.
fn grid(columns: u32, rows: u32, at: impl Fn(f32, f32) -> (Vec3, Vec3)) -> Shape {
    let mut shape = Shape::default();
    for i in 0..=rows {
        for j in 0..=columns {
            let (u, v) = (j as f32 / columns as f32, i as f32 / rows as f32);
            let (position, normal) = at(u, v);
            shape.positions.push(position);
            shape.normals.push(normal);
            shape.uvs.push(Vec2::new(u, v));
            if i == rows || j == columns {
                continue;
            }
            let a = i * (columns + 1) + j;
            let (b, c, d) = (a + 1, a + columns + 2, a + columns + 1);
            shape.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    let positions = &shape.positions;
    shape.triangles.retain(|t| {
        let [a, b, c] = t.map(|i| positions[i as usize]);
        (b - a).cross(c - a).length_squared() > 1e-20
    });
    shape
}

/// Returns the sphere of radius 1 between two heights, up to an angle in degrees.
pub(super) fn sphere([low, high, degrees, _]: [f32; 4]) -> Shape {
    let (bottom, top) = (low.acos(), high.acos());
    grid(2 * SPHERE_RINGS, SPHERE_RINGS, |u, v| {
        let (sin, cos) = (bottom + (top - bottom) * v).sin_cos();
        // The poles are one point.
        let sin = if sin.abs() < 1e-6 { 0.0 } else { sin };
        let (y, x) = (u * degrees.to_radians()).sin_cos();
        let n = Vec3::new(sin * x, sin * y, cos);
        (n, n)
    })
}

/// Returns the disk of radius 1 with a hole, up to an angle in degrees, facing +z.
pub(super) fn disk([inner, degrees, ..]: [f32; 4]) -> Shape {
    grid(SEGMENTS, 1, |u, v| {
        let (y, x) = (u * degrees.to_radians()).sin_cos();
        let radius = 1.0 + (inner - 1.0) * v;
        (Vec3::new(radius * x, radius * y, 0.0), Vec3::Z)
    })
}

/// Returns the side of the cylinder of radius 1 from 0 to 1, up to an angle in degrees.
pub(super) fn cylinder([degrees, ..]: [f32; 4]) -> Shape {
    grid(SEGMENTS, 1, |u, v| {
        let (y, x) = (u * degrees / 360.0 * TAU).sin_cos();
        (Vec3::new(x, y, v), Vec3::new(x, y, 0.0))
    })
}

/// Bilinear patches: their vertices, and four corners of each.
pub(super) struct Patches {
    vertices: Shape,
    corners: Vec<[u32; 4]>,
}

impl Patches {
    /// Reads the parameters of a `bilinearmesh`.
    pub fn read(params: &Params) -> Result<Patches, SceneError> {
        let vertices = vertices(params)?;
        let corners = indices(params, vertices.positions.len())?;
        Ok(Patches { vertices, corners })
    }

    /// Returns whether a patch is a parallelogram, which two triangles represent exactly.
    fn is_flat(&self, corners: &[u32; 4]) -> bool {
        let [a, b, c, d] = corners.map(|i| self.vertices.positions[i as usize]);
        let size = (b - a).length().max((c - a).length());
        (a - b - c + d).length() <= 1e-5 * size
    }

    /// Returns the number of triangles of patches that are no parallelograms.
    pub fn extra_triangles(&self) -> usize {
        let bent = self.corners.iter().filter(|c| !self.is_flat(c)).count();
        bent * 2 * (PATCH_FIELDS * PATCH_FIELDS) as usize
    }

    /// Returns the triangles of all patches. Patches without normals are shaded by those of their
    /// surface.
    pub fn into_shape(self) -> Shape {
        let mut out = Shape::default();
        for corners in &self.corners {
            let fields = if self.is_flat(corners) {
                1
            } else {
                PATCH_FIELDS
            };
            let mut patch = self.patch(corners, fields);
            let first = out.positions.len() as u32;
            out.positions.append(&mut patch.positions);
            out.normals.append(&mut patch.normals);
            out.uvs.append(&mut patch.uvs);
            let triangles = patch.triangles.into_iter();
            out.triangles
                .extend(triangles.map(|t| t.map(|i| i + first)));
        }
        out
    }

    /// Returns one patch. Its corners are at (0, 0), (1, 0), (0, 1) and (1, 1).
    fn patch(&self, corners: &[u32; 4], fields: u32) -> Shape {
        let at = corners.map(|i| i as usize);
        let mix = |values: [Vec3; 4], u: f32, v: f32| {
            let [a, b, c, d] = values;
            (a * (1.0 - u) + b * u) * (1.0 - v) + (c * (1.0 - u) + d * u) * v
        };
        let p = at.map(|i| self.vertices.positions[i]);
        let n = (!self.vertices.normals.is_empty()).then(|| at.map(|i| self.vertices.normals[i]));
        let mut patch = grid(fields, fields, |u, v| {
            let along_u = (p[1] - p[0]) * (1.0 - v) + (p[3] - p[2]) * v;
            let along_v = (p[2] - p[0]) * (1.0 - u) + (p[3] - p[1]) * u;
            let normal = match n {
                Some(n) => mix(n, u, v),
                None => along_u.cross(along_v),
            };
            (mix(p, u, v), normal.normalize_or(Vec3::Z))
        });
        if !self.vertices.uvs.is_empty() {
            let own = at.map(|i| self.vertices.uvs[i].extend(0.0));
            patch
                .uvs
                .iter_mut()
                .for_each(|uv| *uv = mix(own, uv.x, uv.y).truncate());
        }
        patch
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quadrics_have_their_area_their_front_and_their_coordinates() {
        for (shape, area) in [
            (sphere([-1.0, 1.0, 360.0, 0.0]), 2.0 * TAU),
            (sphere([0.0, 0.5, 90.0, 0.0]), 0.125 * TAU),
            (disk([0.0, 360.0, 0.0, 0.0]), 0.5 * TAU),
            (disk([0.5, 180.0, 0.0, 0.0]), 0.75 * 0.25 * TAU),
            (cylinder([360.0, 0.0, 0.0, 0.0]), TAU),
        ] {
            let mut found = 0.0;
            for t in &shape.triangles {
                let [a, b, c] = t.map(|i| shape.positions[i as usize]);
                let cross = (b - a).cross(c - a);
                found += 0.5 * cross.length();
                t.iter()
                    .for_each(|i| assert!(cross.dot(shape.normals[*i as usize]) > 0.0));
            }
            assert!(
                (found / area - 1.0).abs() < 3e-4,
                "{found} instead of {area}"
            );
        }
        // The book's sphere: u is the angle about z from +x towards +y, v rises from the bottom.
        let ball = sphere([-1.0, 1.0, 360.0, 0.0]);
        let towards_y = ball
            .positions
            .iter()
            .position(|p| p.distance(Vec3::Y) < 1e-5);
        assert_eq!(ball.uvs[towards_y.unwrap()], Vec2::new(0.25, 0.5));
        assert_eq!(ball.positions[0], Vec3::NEG_Z);
        // The book's disk: v is 0 at the outline.
        let flat = disk([0.0, 360.0, 0.0, 0.0]);
        assert_eq!((flat.positions[0], flat.uvs[0]), (Vec3::X, Vec2::ZERO));
    }
}
