//! Shading normals at the vertices of triangles. A scene of flat triangles stores one normal for
//! each, any other scene three.

use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Unit shading normals at the vertices of every triangle, on the front side.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Normals {
    /// The normal of every triangle, while all triangles are flat.
    flat: Vec<Vec3>,
    /// The normals of every triangle as soon as one is not flat.
    smooth: Vec<[Vec3; 3]>,
}

impl Normals {
    /// Makes room for the normals of more triangles.
    pub fn reserve_exact(&mut self, triangles: usize) {
        if self.smooth.is_empty() {
            self.flat.reserve_exact(triangles);
        } else {
            self.smooth.reserve_exact(triangles);
        }
    }

    /// Returns the number of triangles.
    pub fn len(&self) -> usize {
        self.flat.len() + self.smooth.len()
    }

    /// Returns whether there are no triangles.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the normals of a triangle.
    ///
    /// # Panics
    /// Panics if there is no such triangle.
    #[inline]
    pub fn at(&self, triangle: u32) -> [Vec3; 3] {
        match self.flat.get(triangle as usize) {
            Some(n) => [*n; 3],
            None => self.smooth[triangle as usize],
        }
    }

    /// Returns the one normal of every triangle, or `None` unless all triangles are flat.
    #[inline]
    pub fn flat(&self) -> Option<&[Vec3]> {
        self.smooth.is_empty().then_some(&self.flat)
    }

    /// Returns the normals of every triangle; empty if all triangles are flat.
    #[inline]
    pub fn smooth(&self) -> &[[Vec3; 3]] {
        &self.smooth
    }

    /// Appends the normals of a triangle.
    pub fn push(&mut self, normals: [Vec3; 3]) {
        let [a, b, c] = normals;
        if self.smooth.is_empty() && a == b && b == c {
            self.flat.push(a);
        } else {
            self.make_smooth().push(normals);
        }
    }

    /// Keeps the normals of the first triangles.
    pub fn truncate(&mut self, triangles: usize) {
        self.flat.truncate(triangles);
        self.smooth.truncate(triangles);
    }

    /// Returns the normals of every triangle, to change them.
    pub fn make_smooth(&mut self) -> &mut Vec<[Vec3; 3]> {
        let flat = std::mem::take(&mut self.flat);
        if !flat.is_empty() || self.smooth.is_empty() {
            self.smooth = Vec::with_capacity(flat.capacity());
            self.smooth.extend(flat.iter().map(|n| [*n; 3]));
        }
        &mut self.smooth
    }

    /// Returns the memory of the normals in bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.flat.as_slice()) + size_of_val(self.smooth.as_slice())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_smooth_triangle_keeps_the_normals_of_all_others() {
        let mut normals = Normals::default();
        let flat = [Vec3::X, Vec3::Y, Vec3::Z];
        flat.iter().for_each(|n| normals.push([*n; 3]));
        assert_eq!((normals.flat(), normals.bytes()), (Some(&flat[..]), 36));
        let smooth = [Vec3::X, Vec3::X, Vec3::Y];
        normals.push(smooth);
        normals.push([Vec3::Z; 3]);
        assert_eq!((normals.flat(), normals.len()), (None, 5));
        let all = (0..5).map(|i| normals.at(i));
        let expected = flat
            .map(|n| [n; 3])
            .into_iter()
            .chain([smooth, [Vec3::Z; 3]]);
        assert!(all.eq(expected));
        normals.truncate(2);
        assert_eq!((normals.len(), normals.at(1)), (2, [Vec3::Y; 3]));
    }
}
