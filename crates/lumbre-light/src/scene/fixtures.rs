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
        name: format!("e{i}"),
        transform: Transform {
            translate: *translate,
            ..Transform::default()
        },
        material: None,
        anisotropic_direction: None,
        shape: shape.clone(),
    };
    SceneDesc {
        views: Vec::new(),
        resolution: [1, 1],
        max_depth: 1,
        camera: CameraDesc {
            position: Vec3::Z * 9.0,
            target: Vec3::ZERO,
            ..CameraDesc::default()
        },
        materials: vec![material].into(),
        entities: shapes.iter().enumerate().map(entity).collect(),
        lights: Vec::new(),
        environment: None,
    }
}

/// Returns a mesh without normals.
pub fn mesh(positions: &[Vec3], uvs: &[Vec2], triangles: &[[u32; 3]]) -> ShapeDesc {
    let mut mesh = MeshDesc {
        file: Default::default(),
        positions: positions.to_vec(),
        normals: Vec::new(),
        uvs: uvs.to_vec(),
        second_uvs: Vec::new(),
        tangents: Vec::new(),
        colors: Vec::new(),
        triangles: triangles.to_vec(),
        slots: vec!["m".to_owned()],
        triangle_slot: vec![0; triangles.len()],
        content_hash: [0; 32],
    };
    mesh.content_hash = mesh_hash(&mesh);
    ShapeDesc::Mesh(Arc::new(mesh))
}
