//! Tangents in MikkTSpace, for normal maps and anisotropy.

use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};
use glam::{DMat3, Vec3, Vec4};

use super::CompiledScene;
use crate::scene::desc::MeshDesc;

/// Sets the tangents of the triangles from `first` on, which form one mesh, if `needed` by one of
/// their materials: those that are `given` for the corners of each triangle, unless they are zero,
/// and else those in MikkTSpace. `given` may be empty.
///
/// Without texture coordinates there is no direction of increasing u: the tangents are zero then,
/// and shading uses an arbitrary frame.
pub(super) fn add(
    scene: &mut CompiledScene,
    first: usize,
    (needed, has_uvs): (bool, bool),
    given: &[[Vec4; 3]],
) {
    if needed || !scene.tangents.is_empty() {
        scene
            .tangents
            .resize(scene.triangles.len(), [Vec4::ZERO; 3]);
    }
    if needed && has_uvs {
        // Infallible: its error type has no values.
        let _ = generate_tangents(&mut Mesh { scene, first });
    }
    if needed {
        let computed = scene.tangents[first..].as_flattened_mut().iter_mut();
        for (tangent, given) in computed.zip(given.as_flattened()) {
            if *given != Vec4::ZERO {
                *tangent = *given;
            }
        }
    }
}

/// Returns the tangents of a mesh at the corners of a triangle; `None` if it has none. `map` is the
/// map of directions, which may mirror, and `normals` are those at the corners before and after
/// they were moved to the front side.
pub(super) fn given(
    mesh: &MeshDesc,
    corners: [u32; 3],
    (map, mirrors): (&DMat3, bool),
    [before, after]: [[Vec3; 3]; 2],
) -> Option<[Vec4; 3]> {
    let at = |k: usize| {
        let t = mesh.tangents.get(corners[k] as usize)?;
        let along = (*map * t.truncate().as_dvec3())
            .as_vec3()
            .normalize_or_zero();
        // The bitangent keeps its direction.
        let reversed = mirrors != (before[k].dot(after[k]) < 0.0);
        let sign = if reversed { -t.w } else { t.w };
        Some(if along == Vec3::ZERO {
            Vec4::ZERO
        } else {
            along.extend(sign)
        })
    };
    Some([at(0)?, at(1)?, at(2)?])
}

/// The triangles of one mesh as an input of `bevy_mikktspace`.
struct Mesh<'a> {
    scene: &'a mut CompiledScene,
    first: usize,
}

impl Geometry for Mesh<'_> {
    fn num_faces(&self) -> usize {
        self.scene.triangles.len() - self.first
    }

    fn num_vertices_of_face(&self, _face: usize) -> usize {
        3
    }

    fn position(&self, face: usize, vert: usize) -> [f32; 3] {
        self.scene.triangles[self.first + face][vert].to_array()
    }

    fn normal(&self, face: usize, vert: usize) -> [f32; 3] {
        self.scene.normals.at((self.first + face) as u32)[vert].to_array()
    }

    fn tex_coord(&self, face: usize, vert: usize) -> [f32; 2] {
        self.scene.corner_uvs((self.first + face) as u32)[vert].to_array()
    }

    fn set_tangent(&mut self, tangent: Option<TangentSpace>, face: usize, vert: usize) {
        self.scene.tangents[self.first + face][vert] =
            tangent.map_or(Vec4::ZERO, |t| Vec4::from_array(t.tangent_encoded()));
    }
}

#[cfg(test)]
mod tests {
    use glam::{Vec2, Vec3, Vec4};

    use crate::scene::compile;
    use crate::scene::desc::{MaterialDesc, SceneDesc};
    use crate::scene::fixtures::{self, mesh};

    fn scene(uvs: Vec<Vec2>, anisotropic: f32) -> SceneDesc {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y];
        let quad = mesh(&corners, &uvs, &[[0, 1, 2], [0, 2, 3]]);
        let material = MaterialDesc {
            anisotropic,
            ..MaterialDesc::new("m")
        };
        fixtures::scene(&[(quad, Vec3::ZERO)], material)
    }

    #[test]
    fn tangents_follow_increasing_u_and_their_sign_increasing_v() {
        let straight = vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
        let turned = vec![Vec2::ZERO, Vec2::Y, Vec2::ONE, Vec2::X];
        for (uvs, expected) in [
            (straight, Vec4::new(1.0, 0.0, 0.0, 1.0)),
            (turned, Vec4::new(0.0, 1.0, 0.0, -1.0)),
        ] {
            let (compiled, _) = compile(&scene(uvs, 0.5)).unwrap();
            for t in compiled.tangents.as_flattened() {
                assert!((*t - expected).length() < 1e-6, "{t} instead of {expected}");
            }
            assert_eq!(compiled.tangents.len(), 2);
        }
    }

    #[test]
    fn tangents_are_empty_if_unused_and_zero_without_texture_coordinates() {
        let uvs = vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
        assert!(compile(&scene(uvs, 0.0)).unwrap().0.tangents.is_empty());
        let (compiled, _) = compile(&scene(vec![], 0.5)).unwrap();
        assert!(
            compiled
                .tangents
                .as_flattened()
                .iter()
                .all(|t| *t == Vec4::ZERO)
        );
        assert_eq!(compiled.tangents.len(), 2);
    }
}
