//! Pieces of small scenes: diffuse materials, balls and quadrilaterals.

use std::sync::Arc;

use glam::Vec3;

use super::desc::{EntityDesc, MaterialDesc, MeshDesc, Model, ShapeDesc, Transform, mesh_hash};

/// Returns a diffuse material.
pub fn lambert(name: &str, base_color: Vec3) -> MaterialDesc {
    MaterialDesc {
        base_color,
        model: Model::Lambert,
        ..MaterialDesc::new(name)
    }
}

/// Returns a ball with the name of its material.
pub fn ball(material: &str, center: Vec3, radius: f32) -> EntityDesc {
    EntityDesc {
        transform: Transform {
            translate: center.as_dvec3(),
            ..Transform::default()
        },
        material: Some(material.to_owned()),
        ..EntityDesc::new(material, ShapeDesc::Sphere { radius })
    }
}

/// Returns the corners of a parallelogram, counter-clockwise seen from its front `a x b`.
pub fn quad(corner: Vec3, a: Vec3, b: Vec3) -> [Vec3; 4] {
    [corner, corner + a, corner + a + b, corner + b]
}

/// Returns a mesh of quadrilaterals with the name of its material.
pub fn quads(material: &str, quads: &[[Vec3; 4]]) -> EntityDesc {
    let mut mesh = MeshDesc {
        positions: quads.concat(),
        triangles: (0..quads.len() as u32)
            .flat_map(|q| [[0, 1, 2], [0, 2, 3]].map(|t| t.map(|i| 4 * q + i)))
            .collect(),
        slots: vec![material.to_owned()],
        triangle_slot: vec![0; 2 * quads.len()],
        ..MeshDesc::default()
    };
    mesh.content_hash = mesh_hash(&mesh);
    EntityDesc {
        material: Some(material.to_owned()),
        ..EntityDesc::new(material, ShapeDesc::Mesh(Arc::new(mesh)))
    }
}

/// Returns a cube around the origin, of half this width, whose fronts face inwards. Its material is
/// `walls`.
pub fn room(half: f32) -> EntityDesc {
    let axes = [(Vec3::X, Vec3::Y), (Vec3::Y, Vec3::Z), (Vec3::Z, Vec3::X)];
    let walls = axes.iter().flat_map(|(n, a)| {
        [-1.0, 1.0].map(|side| {
            let b = (-*n * side).cross(*a);
            quad(
                *n * side * half - (*a + b) * half,
                *a * 2.0 * half,
                b * 2.0 * half,
            )
        })
    });
    quads("walls", &walls.collect::<Vec<_>>())
}
