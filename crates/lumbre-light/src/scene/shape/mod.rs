//! Procedural shapes: meshes computed from a few parameters.
//!
//! All are in scene units with +y up, counter-clockwise seen from outside, with texture
//! coordinates, and with normals where they are smooth. A request for more than [`MAX_VERTICES`]
//! vertices, or for something that is not a surface, is a [`ShapeError`].

mod curve;
mod extrusion;
mod flat;
mod solid;

use std::path::PathBuf;

use glam::{Affine3A, DVec3, Vec2, Vec3, Vec4};

pub use curve::{lathe, torus, tube};
pub use extrusion::extrude;
pub use flat::{disk, grid, heightfield, projected};
pub use solid::{cuboid, icosphere};

use super::desc::{MeshDesc, mesh_hash};

/// Greatest number of vertices of one shape.
pub const MAX_VERTICES: usize = 1 << 24;

/// Reason why a shape cannot be created: one sentence without a full stop.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct ShapeError(String);

impl ShapeError {
    fn new(problem: impl Into<String>) -> ShapeError {
        ShapeError(problem.into())
    }
}

/// An indexed triangle mesh. Normals, both sets of texture coordinates, tangents and colours have
/// one element for each position, or are empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shape {
    /// Vertex positions in scene units.
    pub positions: Vec<Vec3>,
    /// Unit vertex normals, or empty for flat shading.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, or empty.
    pub uvs: Vec<Vec2>,
    /// Second set of texture coordinates, or empty.
    pub second_uvs: Vec<Vec2>,
    /// Tangents of normal maps, or empty: see [`MeshDesc::tangents`].
    pub tangents: Vec<Vec4>,
    /// Linear colours that multiply base colours, or empty.
    pub colors: Vec<Vec3>,
    /// Vertex indices of the corners, counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
}

impl Shape {
    /// Checks a mesh that was created elsewhere and returns it.
    ///
    /// # Errors
    /// Fails for lists of unequal length, indices out of range, coordinates that are not finite, or
    /// no triangles.
    pub fn checked(self) -> Result<Shape, ShapeError> {
        let count = self.positions.len();
        let fail = |problem: String| Err(ShapeError(problem));
        if self.triangles.is_empty() {
            return fail("the shape has no triangles".to_owned());
        }
        check_vertex_count(count)?;
        check_vertex_count(self.triangles.len())?;
        let lists = [
            ("normals", self.normals.len()),
            ("uvs", self.uvs.len()),
            ("second_uvs", self.second_uvs.len()),
            ("tangents", self.tangents.len()),
            ("colors", self.colors.len()),
        ];
        for (what, found) in lists {
            if found != 0 && found != count {
                return fail(format!(
                    "the shape has {count} positions but {found} {what}"
                ));
            }
        }
        if let Some((i, t)) = self
            .triangles
            .iter()
            .enumerate()
            .find(|(_, t)| t.iter().any(|c| *c as usize >= count))
        {
            return fail(format!(
                "triangle {} has the indices {t:?}, counted from 0, but there are only {count} \
                 positions",
                i + 1
            ));
        }
        if let Some(i) = self.positions.iter().position(|p| !p.is_finite()) {
            return fail(format!("position {} is not finite", i + 1));
        }
        if let Some(i) = self.normals.iter().position(|n| !n.is_normalized()) {
            return fail(format!(
                "normal {} has the length {}; expected 1",
                i + 1,
                self.normals[i].length()
            ));
        }
        let in_range = |c: &Vec3| c.min_element() >= 0.0 && c.max_element() <= 1.0;
        if let Some(i) = self.colors.iter().position(|c| !in_range(c)) {
            return fail(format!("colour {} is outside the range 0 to 1", i + 1));
        }
        for uvs in [&self.uvs, &self.second_uvs] {
            if let Some(i) = uvs.iter().position(|uv| !uv.is_finite()) {
                return fail(format!("texture coordinate {} is not finite", i + 1));
            }
        }
        Ok(self)
    }

    /// Returns the shape transformed by an affine map. A map that mirrors reverses the triangles,
    /// so that the front stays outside.
    ///
    /// # Errors
    /// Fails for a map that flattens the shape.
    pub fn transformed(mut self, map: &Affine3A) -> Result<Shape, ShapeError> {
        let determinant = map.matrix3.determinant();
        if !determinant.is_finite() || determinant == 0.0 {
            return Err(ShapeError::new(
                "its transform flattens the shape: the scale along some direction is zero",
            ));
        }
        let normal = map.matrix3.inverse().transpose();
        self.positions
            .iter_mut()
            .for_each(|p| *p = map.transform_point3(*p));
        self.normals
            .iter_mut()
            .for_each(|n| *n = (normal * *n).normalize_or(*n));
        let sign = determinant.signum();
        self.tangents.iter_mut().for_each(|t| {
            let along = (map.matrix3 * t.truncate()).normalize_or_zero();
            *t = along.extend(sign * t.w);
        });
        if determinant < 0.0 {
            self.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        Ok(self)
    }

    /// Appends another shape. If only one of the two is smooth, the flat one gets face normals.
    ///
    /// # Errors
    /// Fails if the result has more than [`MAX_VERTICES`] vertices.
    pub fn append(&mut self, other: Shape) -> Result<(), ShapeError> {
        check_vertex_count(self.positions.len() + other.positions.len())?;
        self.merge(other);
        Ok(())
    }

    /// Appends another shape without a limit on the number of vertices: for files, whose size
    /// bounds it.
    pub fn merge(&mut self, mut other: Shape) {
        if self.positions.is_empty() {
            *self = other;
            return;
        }
        match (self.normals.is_empty(), other.normals.is_empty()) {
            (true, false) => self.facet(),
            (false, true) => other.facet(),
            _ => {}
        }
        if self.uvs.is_empty() != other.uvs.is_empty() {
            [&mut *self, &mut other]
                .into_iter()
                .for_each(|shape| shape.uvs.resize(shape.positions.len(), Vec2::ZERO));
        }
        if self.second_uvs.is_empty() != other.second_uvs.is_empty() {
            // A shape without a second set of texture coordinates uses its first set.
            for lacking in [&mut *self, &mut other]
                .into_iter()
                .filter(|shape| shape.second_uvs.is_empty())
            {
                lacking.second_uvs = lacking.uvs.clone();
                lacking
                    .second_uvs
                    .resize(lacking.positions.len(), Vec2::ZERO);
            }
        }
        if self.tangents.is_empty() != other.tangents.is_empty() {
            // Zero stands for a tangent that is computed.
            [&mut *self, &mut other]
                .into_iter()
                .for_each(|shape| shape.tangents.resize(shape.positions.len(), Vec4::ZERO));
        }
        if self.colors.is_empty() != other.colors.is_empty() {
            [&mut *self, &mut other]
                .into_iter()
                .for_each(|shape| shape.colors.resize(shape.positions.len(), Vec3::ONE));
        }
        let first = self.positions.len() as u32;
        self.positions.append(&mut other.positions);
        self.normals.append(&mut other.normals);
        self.uvs.append(&mut other.uvs);
        self.second_uvs.append(&mut other.second_uvs);
        self.tangents.append(&mut other.tangents);
        self.colors.append(&mut other.colors);
        self.triangles
            .extend(other.triangles.iter().map(|t| t.map(|c| c + first)));
    }

    /// Gives every triangle its own three vertices with the normal of its face.
    pub fn facet(&mut self) {
        let corners: Vec<usize> = self
            .triangles
            .iter()
            .flatten()
            .map(|c| *c as usize)
            .collect();
        self.positions = at_corners(&self.positions, &corners);
        self.uvs = at_corners(&self.uvs, &corners);
        self.second_uvs = at_corners(&self.second_uvs, &corners);
        self.tangents = at_corners(&self.tangents, &corners);
        self.colors = at_corners(&self.colors, &corners);
        self.normals = self
            .positions
            .chunks_exact(3)
            .flat_map(|t| [(t[1] - t[0]).cross(t[2] - t[0]).normalize_or(Vec3::Y); 3])
            .collect();
        self.triangles = (0..self.triangles.len() as u32)
            .map(|t| [3 * t, 3 * t + 1, 3 * t + 2])
            .collect();
    }

    /// Returns the mesh of this shape with the single material `slot`.
    pub fn into_mesh(self, file: PathBuf, slot: &str) -> MeshDesc {
        let triangle_slot = vec![0; self.triangles.len()];
        let mut mesh = MeshDesc {
            file,
            positions: self.positions,
            origin: DVec3::ZERO,
            normals: self.normals,
            uvs: self.uvs,
            second_uvs: self.second_uvs,
            tangents: self.tangents,
            colors: self.colors,
            triangles: self.triangles,
            slots: vec![slot.to_owned()],
            triangle_slot,
            content_hash: [0; 32],
        };
        mesh.content_hash = mesh_hash(&mesh);
        mesh
    }

    /// Adds the quads of a vertex lattice with `rows` by `columns` vertices, stored in rows.
    /// `reversed` makes the other side the front.
    fn lattice(&mut self, first: u32, columns: u32, rows: u32, reversed: bool) {
        for row in 0..rows.saturating_sub(1) {
            for column in 0..columns.saturating_sub(1) {
                let a = first + row * columns + column;
                let (b, c, d) = (a + 1, a + columns + 1, a + columns);
                let quad = [[a, b, c], [a, c, d]];
                self.triangles
                    .extend(quad.map(|[p, q, r]| if reversed { [p, r, q] } else { [p, q, r] }));
            }
        }
    }
}

/// Gathers the values at the given corners; returns an empty list if there are no values.
fn at_corners<T: Copy>(values: &[T], corners: &[usize]) -> Vec<T> {
    if values.is_empty() {
        Vec::new()
    } else {
        corners.iter().map(|c| values[*c]).collect()
    }
}

/// Fails if there are more vertices than allowed.
fn check_vertex_count(vertices: usize) -> Result<(), ShapeError> {
    if vertices > MAX_VERTICES {
        return Err(ShapeError(format!(
            "the shape would have {vertices} vertices; at most {MAX_VERTICES} are allowed"
        )));
    }
    Ok(())
}

/// Fails unless all lengths are positive and finite.
fn check_positive(what: &str, lengths: &[f32]) -> Result<(), ShapeError> {
    match lengths.iter().find(|x| !(x.is_finite() && **x > 0.0)) {
        Some(x) => Err(ShapeError(format!(
            "{what} is {x}; expected a length above 0"
        ))),
        None => Ok(()),
    }
}

/// Fails if there are fewer than `least` elements.
fn check_at_least(what: &str, found: usize, least: usize) -> Result<(), ShapeError> {
    if found < least {
        return Err(ShapeError(format!(
            "the {what} is {found}; expected at least {least}"
        )));
    }
    Ok(())
}

#[cfg(test)]
mod tests;
