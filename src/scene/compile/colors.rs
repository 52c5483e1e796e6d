//! Colours of vertices.

use glam::Vec3;

use super::CompiledScene;
use crate::scene::desc::MeshDesc;

/// Takes the colours of a triangle's corners, if the mesh has any.
pub(super) fn gather(mesh: &MeshDesc, corners: [u32; 3], to: &mut Vec<[Vec3; 3]>) {
    if !mesh.colors.is_empty() {
        to.push(corners.map(|i| mesh.colors[i as usize]));
    }
}

/// Gives colours to the triangles from `first` on, which are one mesh: its own, one row for each, or white without any,
/// where another mesh has some.
pub(super) fn add(scene: &mut CompiledScene, first: usize, own: &[[Vec3; 3]]) {
    if !own.is_empty() || !scene.colors.is_empty() {
        scene.colors.resize(first, [Vec3::ONE; 3]);
        scene.colors.extend_from_slice(own);
        scene.colors.resize(scene.triangles.len(), [Vec3::ONE; 3]);
    }
}

impl CompiledScene {
    /// What multiplies the base colour at barycentric coordinates of a triangle: see [`CompiledScene::colors`].
    #[inline]
    pub fn tint_at(&self, primitive: u32, [v, w]: [f32; 2]) -> Vec3 {
        match self.colors.get(primitive as usize) {
            Some([a, b, c]) => *a * (1.0 - v - w) + *b * v + *c * w,
            None => Vec3::ONE,
        }
    }
}
