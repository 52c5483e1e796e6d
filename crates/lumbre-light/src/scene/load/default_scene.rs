//! Default scene of a mesh file: a framing camera, and smooth normals for meshes without any.

use std::path::Path;
use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::{DARK_MESH, scn};
use crate::scene::Note;
use crate::scene::desc::{
    CameraDesc, EntityDesc, MaterialDesc, MeshDesc, SceneDesc, ShapeDesc, Transform,
};

/// Returns a scene of one mesh with its materials, viewed by a camera that frames it.
pub(super) fn scene(
    path: &Path,
    mesh: MeshDesc,
    materials: Vec<MaterialDesc>,
    notes: &mut Vec<Note>,
) -> SceneDesc {
    if materials.iter().all(|m| m.emission == Vec3::ZERO) {
        notes.push(Note {
            file: path.to_owned(),
            place: "materials".to_owned(),
            message: DARK_MESH.to_owned(),
        });
    }
    let bounds = mesh
        .positions
        .iter()
        .fold(None, |bounds, p| Some(extended(bounds, *p, *p)));
    let name = path
        .file_stem()
        .map_or_else(|| "mesh".to_owned(), |s| s.to_string_lossy().into_owned());
    SceneDesc {
        views: Vec::new(),
        resolution: scn::DEFAULT_RESOLUTION,
        max_depth: scn::DEFAULT_MAX_DEPTH,
        camera: framing_camera(bounds),
        materials,
        entities: vec![EntityDesc {
            name,
            transform: Transform::default(),
            material: None,
            anisotropic_direction: None,
            shape: ShapeDesc::Mesh(Arc::new(mesh)),
        }],
        lights: Vec::new(),
        environment: None,
    }
}

/// Returns the bounding box extended to contain another box.
pub(super) fn extended(bounds: Option<[Vec3; 2]>, low: Vec3, high: Vec3) -> [Vec3; 2] {
    bounds.map_or([low, high], |[l, h]| [l.min(low), h.max(high)])
}

/// Returns a camera on the +z side of a box that sees all of it, or of the unit sphere if there is
/// no box.
pub(super) fn framing_camera(bounds: Option<[Vec3; 2]>) -> CameraDesc {
    let fov_deg: f32 = 45.0;
    let (center, radius) = match bounds {
        None => (Vec3::ZERO, 1.0),
        Some([low, high]) => ((low + high) / 2.0, ((high - low).length() / 2.0).max(1e-6)),
    };
    let distance = 1.1 * radius / (fov_deg.to_radians() / 2.0).sin();
    CameraDesc {
        position: center + Vec3::Z * distance,
        target: center,
        fov_deg,
        ..CameraDesc::default()
    }
}

/// Returns smooth vertex normals: the mean of the normals of adjacent triangles, weighted by their
/// angles at the vertex [Thürmer & Wüthrich 1998]. Vertices without a triangle of non-zero area get
/// +y.
pub(super) fn smooth_normals(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    let mut sums = vec![DVec3::ZERO; positions.len()];
    for corners in triangles {
        let p = corners.map(|i| positions[i as usize].as_dvec3());
        let Some(n) = (p[1] - p[0]).cross(p[2] - p[0]).try_normalize() else {
            continue;
        };
        for k in 0..3 {
            let (a, b) = (p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
            sums[corners[k] as usize] += n * a.angle_between(b);
        }
    }
    sums.into_iter()
        .map(|n| n.try_normalize().unwrap_or(DVec3::Y).as_vec3())
        .collect()
}
