//! Optional vertex attributes of triangles: texture coordinates and colours.

use glam::{DMat3, Vec2, Vec3};

use super::{CompiledScene, Uv};
use crate::scene::desc::MeshDesc;

/// Appends the optional attributes of the newest triangle. The arrays stay empty while no mesh has
/// such attributes; triangles without them are white, have texture coordinates of zero, and repeat
/// these in the second set.
pub(super) fn push(scene: &mut CompiledScene, mesh: &MeshDesc, corners: [u32; 3]) {
    let triangle = scene.triangles.len() - 1;
    append(&mut scene.colors, triangle, &mesh.colors, corners, |_| {
        [Vec3::ONE; 3]
    });
    append(&mut scene.uvs, triangle, &mesh.uvs, corners, |_| {
        [Vec2::ZERO; 3]
    });
    let first = &scene.uvs;
    append(
        &mut scene.second_uvs,
        triangle,
        &mesh.second_uvs,
        corners,
        |i| uvs_of(first, i),
    );
}

#[inline]
fn append<T: Copy>(
    list: &mut Vec<[T; 3]>,
    triangle: usize,
    values: &[T],
    corners: [u32; 3],
    default: impl Fn(usize) -> [T; 3],
) {
    if values.is_empty() && list.is_empty() {
        return;
    }
    list.extend((list.len()..triangle).map(&default));
    list.push(if values.is_empty() {
        default(triangle)
    } else {
        corners.map(|i| values[i as usize])
    });
}

#[inline]
fn uvs_of(uvs: &[[Vec2; 3]], triangle: usize) -> [Vec2; 3] {
    uvs.get(triangle).copied().unwrap_or_default()
}

impl CompiledScene {
    /// Returns the texture coordinates at the vertices of a triangle; zero if it has none.
    #[inline]
    pub fn corner_uvs(&self, primitive: u32) -> [Vec2; 3] {
        uvs_of(&self.uvs, primitive as usize)
    }

    /// Returns the colour that multiplies the base colour at barycentric coordinates of a triangle;
    /// see [`CompiledScene::colors`].
    #[inline]
    pub fn tint_at(&self, primitive: u32, [v, w]: [f32; 2]) -> Vec3 {
        match self.colors.get(primitive as usize) {
            Some([a, b, c]) => *a * (1.0 - v - w) + *b * v + *c * w,
            None => Vec3::ONE,
        }
    }

    /// Returns the texture coordinates at barycentric coordinates of a triangle.
    #[inline]
    pub fn uv_at(&self, primitive: u32, [v, w]: [f32; 2]) -> Uv {
        let [a, b, c] = self.corner_uvs(primitive);
        let first = a * (1.0 - v - w) + b * v + c * w;
        let second = match self.second_uvs.get(primitive as usize) {
            Some([a, b, c]) => *a * (1.0 - v - w) + *b * v + *c * w,
            None => first,
        };
        Uv {
            first: first.to_array(),
            second: second.to_array(),
        }
    }
}

/// Returns det(L) L^-T, which also exists if L is singular.
pub fn cofactor(linear: DMat3) -> DMat3 {
    DMat3::from_cols(
        linear.y_axis.cross(linear.z_axis),
        linear.z_axis.cross(linear.x_axis),
        linear.x_axis.cross(linear.y_axis),
    )
}
