//! Sheets: grids, height fields and disks, facing +y.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};

use super::{
    MeshDesc, Shape, ShapeError, check_at_least, check_positive, check_vertex_count, mesh_hash,
};

/// Returns a rectangle about the origin in the plane y = 0 with extent `size` along x and z, made
/// of `cells` quads along each. Texture coordinates cover it once: u along x, v against z.
///
/// # Errors
/// Fails for sizes that are not positive, and for no cells or too many.
pub fn grid(size: Vec2, cells: [u32; 2]) -> Result<Shape, ShapeError> {
    sheet(size, cells, |_, _| 0.0, false)
}

/// Returns a smooth sheet like [`grid`] with heights: `heights` has one value for each vertex,
/// `cells[0] + 1` per row along x, rows ordered along z.
///
/// # Errors
/// Fails like [`grid`], and for heights that are not finite or the wrong number of them.
pub fn heightfield(size: Vec2, cells: [u32; 2], heights: &[f32]) -> Result<Shape, ShapeError> {
    let columns = cells[0] as usize + 1;
    let expected = columns * (cells[1] as usize + 1);
    if heights.len() != expected {
        let found = heights.len();
        return Err(ShapeError(format!(
            "found {found} heights for {} x {} cells; expected {expected}",
            cells[0], cells[1]
        )));
    }
    if let Some(i) = heights.iter().position(|h| !h.is_finite()) {
        return Err(ShapeError(format!("height {} is not finite", i + 1)));
    }
    sheet(size, cells, |x, z| heights[z * columns + x], true)
}

/// Returns a grid of `cells` quads displaced along y by `height` of column and row; with normals if
/// `smooth`.
fn sheet(
    size: Vec2,
    cells: [u32; 2],
    height: impl Fn(usize, usize) -> f32,
    smooth: bool,
) -> Result<Shape, ShapeError> {
    check_positive("the size", &size.to_array())?;
    check_at_least("number of cells", cells[0].min(cells[1]) as usize, 1)?;
    let [columns, rows] = cells.map(|n| n as usize + 1);
    check_vertex_count(columns.saturating_mul(rows))?;
    let mut shape = Shape::default();
    let fraction = |i: usize, n: u32| i as f32 / n as f32;
    for z in 0..rows {
        for x in 0..columns {
            let at = Vec2::new(fraction(x, cells[0]), fraction(z, cells[1]));
            let position = (at - 0.5) * size;
            shape
                .positions
                .push(Vec3::new(position.x, height(x, z), position.y));
            shape.uvs.push(Vec2::new(at.x, 1.0 - at.y));
        }
    }
    if smooth {
        // Central differences, one-sided at the border.
        let step = size / Vec2::new(cells[0] as f32, cells[1] as f32);
        for z in 0..rows {
            for x in 0..columns {
                let (left, right) = (x.saturating_sub(1), (x + 1).min(columns - 1));
                let (back, front) = (z.saturating_sub(1), (z + 1).min(rows - 1));
                let along_x =
                    (height(right, z) - height(left, z)) / ((right - left) as f32 * step.x);
                let along_z =
                    (height(x, front) - height(x, back)) / ((front - back) as f32 * step.y);
                shape
                    .normals
                    .push(Vec3::new(-along_x, 1.0, -along_z).normalize_or(Vec3::Y));
            }
        }
    }
    shape.lattice(0, columns as u32, rows as u32, true);
    Ok(shape)
}

/// Returns a disk about the origin in the plane y = 0. Texture coordinates are those of the
/// bounding square.
///
/// # Errors
/// Fails for a radius that is not positive, and for fewer than three segments or too many.
pub fn disk(radius: f32, segments: u32) -> Result<Shape, ShapeError> {
    check_positive("the radius", &[radius])?;
    check_at_least("number of segments", segments as usize, 3)?;
    check_vertex_count(segments as usize + 1)?;
    let mut shape = Shape {
        positions: vec![Vec3::ZERO],
        uvs: vec![Vec2::splat(0.5)],
        ..Shape::default()
    };
    for i in 0..segments {
        let (sin, cos) = (TAU * i as f32 / segments as f32).sin_cos();
        shape
            .positions
            .push(Vec3::new(radius * cos, 0.0, radius * sin));
        shape.uvs.push(Vec2::new(0.5 + 0.5 * cos, 0.5 - 0.5 * sin));
        shape.triangles.push([0, 1 + (i + 1) % segments, 1 + i]);
    }
    Ok(shape)
}

/// Returns a mesh with texture coordinates projected along z: x and y relative to the lower corner
/// of its bounding box, divided by the greater of the box's two sides, so that they lie in 0..=1
/// without distortion.
pub fn projected(mesh: &MeshDesc) -> MeshDesc {
    let flat = mesh.positions.iter().map(|p| Vec2::new(p.x, p.y));
    let low = flat.clone().fold(Vec2::INFINITY, Vec2::min);
    let size = (flat.clone().fold(Vec2::NEG_INFINITY, Vec2::max) - low).max_element();
    let scale = if size > 0.0 { size.recip() } else { 0.0 };
    let mut mesh = MeshDesc {
        uvs: flat.map(|p| (p - low) * scale).collect(),
        ..mesh.clone()
    };
    mesh.content_hash = mesh_hash(&mesh);
    mesh
}
