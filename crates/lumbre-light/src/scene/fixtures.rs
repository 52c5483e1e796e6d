//! Small scene descriptions for unit tests.

use std::sync::Arc;

use glam::{Vec2, Vec3};

use super::SceneDesc;
use super::desc::{
    CameraDesc, EntityDesc, MaterialDesc, MeshDesc, ShapeDesc, Transform, mesh_hash,
};

/// Returns a scene of shapes, each moved by a vector, with one material.
pub fn scene(shapes: &[(ShapeDesc, Vec3)], material: MaterialDesc) -> SceneDesc {
    let entity = |(i, (shape, translate)): (usize, &(ShapeDesc, Vec3))| EntityDesc {
        transform: Transform {
            translate: translate.as_dvec3(),
            ..Transform::default()
        },
        ..EntityDesc::new(format!("e{i}"), shape.clone())
    };
    SceneDesc {
        resolution: [1, 1],
        max_depth: 1,
        camera: CameraDesc {
            position: Vec3::Z * 9.0,
            target: Vec3::ZERO,
            ..CameraDesc::default()
        },
        materials: vec![material].into(),
        entities: shapes.iter().enumerate().map(entity).collect(),
        ..SceneDesc::default()
    }
}

/// Returns a mesh without normals.
pub fn mesh(positions: &[Vec3], uvs: &[Vec2], triangles: &[[u32; 3]]) -> ShapeDesc {
    let mut mesh = MeshDesc {
        positions: positions.to_vec(),
        uvs: uvs.to_vec(),
        triangles: triangles.to_vec(),
        slots: vec!["m".to_owned()],
        triangle_slot: vec![0; triangles.len()],
        ..MeshDesc::default()
    };
    mesh.content_hash = mesh_hash(&mesh);
    ShapeDesc::Mesh(Arc::new(mesh))
}
