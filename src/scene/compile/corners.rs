//! What some meshes have at the corners of their triangles, and others lack: colours, and a second set of texture
//! coordinates.

use glam::Vec3;

use super::{CompiledScene, Uv};
use crate::scene::desc::MeshDesc;

/// Appends what the newest triangle of a scene has at its corners. Lists stay empty while no mesh has any; triangles without
/// are white, and have their first coordinates again.
pub(super) fn push(scene: &mut CompiledScene, mesh: &MeshDesc, corners: [u32; 3]) {
    let triangle = scene.triangles.len() - 1;
    append(&mut scene.colors, triangle, &mesh.colors, corners, |_| [Vec3::ONE; 3]);
    append(&mut scene.second_uvs, triangle, &mesh.second_uvs, corners, |i| scene.attributes[i].uvs);
}

#[inline]
fn append<T: Copy>(
    list: &mut Vec<[T; 3]>,
    triangle: usize,
    values: &[T],
    corners: [u32; 3],
    lacking: impl Fn(usize) -> [T; 3],
) {
    if values.is_empty() && list.is_empty() {
        return;
    }
    list.extend((list.len()..triangle).map(&lacking));
    list.push(if values.is_empty() { lacking(triangle) } else { corners.map(|i| values[i as usize]) });
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

    /// Texture coordinates at barycentric coordinates of a triangle.
    #[inline]
    pub fn uv_at(&self, primitive: u32, [v, w]: [f32; 2]) -> Uv {
        let first = self.attributes[primitive as usize].uv([v, w]);
        let second = match self.second_uvs.get(primitive as usize) {
            Some([a, b, c]) => *a * (1.0 - v - w) + *b * v + *c * w,
            None => first,
        };
        Uv { first, second }
    }
}
