use std::path::PathBuf;
use std::sync::Arc;

use glam::{DAffine3, DVec3};

use super::super::mesh::area_and_front;
use super::*;
use crate::scene::desc::{MaterialDesc, MeshDesc, Transform, mesh_hash};

fn mesh(positions: Vec<Vec3>, normals: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Arc<MeshDesc> {
    let mut m = MeshDesc {
        file: PathBuf::from("m.obj"),
        positions,
        normals,
        triangle_slot: vec![0; triangles.len()],
        triangles,
        slots: vec!["m".to_owned()],
        ..MeshDesc::default()
    };
    m.content_hash = mesh_hash(&m);
    Arc::new(m)
}

fn scene(shapes: Vec<(ShapeDesc, Transform)>, material: MaterialDesc) -> SceneDesc {
    SceneDesc {
        resolution: [8, 8],
        max_depth: 5,
        camera: CameraDesc::pinhole(Vec3::Z * 5.0, Vec3::ZERO, 45.0),
        materials: vec![material].into(),
        entities: shapes
            .into_iter()
            .enumerate()
            .map(|(i, (shape, transform))| EntityDesc {
                transform,
                ..EntityDesc::new(format!("e{i}"), shape)
            })
            .collect(),
        ..SceneDesc::default()
    }
}

fn triangle() -> ShapeDesc {
    ShapeDesc::Mesh(mesh(
        vec![Vec3::ZERO, Vec3::X, Vec3::Y],
        vec![Vec3::Z; 3],
        vec![[0, 1, 2]],
    ))
}

fn light() -> MaterialDesc {
    MaterialDesc {
        emission: Vec3::ONE,
        ..MaterialDesc::new("m")
    }
}

fn front(c: &CompiledScene, i: usize) -> Vec3 {
    area_and_front(&c.triangles[i]).unwrap().1
}

#[test]
fn mirrored_and_rotated_meshes_keep_their_front_and_normals() {
    let turn = |scale: [f32; 3], rotate: [f32; 3]| Transform {
        translate: DVec3::ONE,
        rotate_rad: Vec3::from_array(rotate),
        scale: Vec3::from_array(scale),
        ..Transform::default()
    };
    let half = std::f32::consts::FRAC_PI_2;
    let cases = [
        (turn([1.0; 3], [0.0; 3]), Vec3::Z),
        (turn([-1.0, 1.0, 1.0], [0.0; 3]), Vec3::Z),
        (turn([1.0, 1.0, -1.0], [0.0; 3]), Vec3::NEG_Z),
        (turn([-2.0, -2.0, -2.0], [0.0; 3]), Vec3::NEG_Z),
        (turn([1.0; 3], [half, 0.0, 0.0]), Vec3::NEG_Y),
        (turn([1.0; 3], [0.0, half, 0.0]), Vec3::X),
        // Rz first, then Rx, then the scale.
        (turn([1.0, 5.0, 1.0], [half, 0.0, half]), Vec3::NEG_Y),
    ];
    for (transform, expected) in cases {
        let (c, notes) = compile(&scene(vec![(triangle(), transform)], light())).unwrap();
        assert!(notes.is_empty());
        assert!(
            (front(&c, 0) - expected).length() < 1e-6,
            "{transform:?}: {}",
            front(&c, 0)
        );
        for n in c.normals.at(0) {
            assert!((n - expected).length() < 1e-6, "{transform:?}: normal {n}");
        }
    }
}

#[test]
fn a_frame_comes_after_everything_else() {
    let frame = DAffine3::from_rotation_y(std::f64::consts::FRAC_PI_2)
        * DAffine3::from_scale(DVec3::splat(2.0));
    let moved = Transform {
        translate: DVec3::X,
        ..Transform::framed(frame)
    };
    let ball = ShapeDesc::Sphere { radius: 0.5 };
    let (c, _) = compile(&scene(
        vec![(triangle(), moved), (ball.clone(), moved)],
        light(),
    ))
    .unwrap();
    assert!((front(&c, 0) - Vec3::X).length() < 1e-6);
    assert!(
        (c.triangles[0][0] - Vec3::new(0.0, 0.0, -2.0)).length() < 1e-6,
        "{}",
        c.triangles[0][0]
    );
    assert!(
        (c.spheres[0].center - Vec3::new(0.0, 0.0, -2.0)).length() < 1e-6
            && c.spheres[0].radius == 1.0
    );
    let stretched = Transform::framed(DAffine3::from_scale(DVec3::new(1.0, 2.0, 1.0)));
    let e = compile(&scene(vec![(ball, stretched)], light()))
        .unwrap_err()
        .to_string();
    assert!(e.contains("makes the sphere an ellipsoid"), "{e}");
}

#[test]
fn normals_follow_the_inverse_transpose() {
    let n = Vec3::new(1.0, 0.0, 1.0).normalize_or(Vec3::Z);
    let slope = mesh(
        vec![Vec3::ZERO, Vec3::Y, Vec3::new(-1.0, 0.0, 1.0)],
        vec![n; 3],
        vec![[0, 1, 2]],
    );
    let transform = Transform {
        scale: Vec3::new(4.0, 1.0, 1.0),
        ..Transform::default()
    };
    let (c, _) = compile(&scene(vec![(ShapeDesc::Mesh(slope), transform)], light())).unwrap();
    let expected = Vec3::new(0.25, 0.0, 1.0).normalize_or(Vec3::Z);
    assert!((c.normals.at(0)[0] - expected).length() < 1e-6);
    assert!((front(&c, 0) - expected).length() < 1e-6);
}

#[test]
fn corner_normals_never_point_behind_the_triangle() {
    let tilted = Vec3::new(1.0, 0.0, -0.5).normalize_or(Vec3::Z);
    let m = mesh(
        vec![Vec3::ZERO, Vec3::X, Vec3::Y],
        vec![Vec3::Z, Vec3::Z, tilted],
        vec![[0, 1, 2]],
    );
    let (c, _) = compile(&scene(
        vec![(ShapeDesc::Mesh(m), Transform::default())],
        light(),
    ))
    .unwrap();
    let n = c.normals.at(0)[2];
    assert!(
        n.z > 0.0 && n.x > 0.9 && (n.length() - 1.0).abs() < 1e-6,
        "{n}"
    );
    let m = mesh(
        vec![Vec3::ZERO, Vec3::X, Vec3::Y],
        vec![Vec3::NEG_Z; 3],
        vec![[0, 1, 2]],
    );
    let (c, _) = compile(&scene(
        vec![(ShapeDesc::Mesh(m), Transform::default())],
        light(),
    ))
    .unwrap();
    assert_eq!(c.normals.at(0), [Vec3::Z; 3]);
}

#[test]
fn emitters_have_exact_areas_in_order_of_primitive() {
    let scaled = Transform {
        scale: Vec3::new(2.0, 3.0, 1.0),
        ..Transform::default()
    };
    let shapes = vec![
        (ShapeDesc::Sphere { radius: 0.5 }, Transform::default()),
        (triangle(), scaled),
        (triangle(), Transform::default()),
    ];
    let (c, _) = compile(&scene(shapes, light())).unwrap();
    assert_eq!(c.primitive_count(), 3);
    let areas: Vec<(u32, f32)> = c.emitters.iter().map(|e| (e.primitive, e.area)).collect();
    assert_eq!(areas, [(0, 3.0), (1, 0.5), (2, std::f32::consts::PI)]);
    assert_eq!((c.attributes[1].emitter, c.spheres[0].emitter), (1, 2));
    assert_eq!(
        c.bounds,
        [Vec3::new(-0.5, -0.5, -0.5), Vec3::new(2.0, 3.0, 0.5)]
    );
}

#[test]
fn triangles_without_area_are_left_out_and_counted() {
    let m = mesh(
        vec![Vec3::ZERO, Vec3::X, Vec3::X * 2.0, Vec3::Y],
        vec![],
        vec![[0, 1, 2], [0, 0, 1], [0, 1, 3]],
    );
    let (c, notes) = compile(&scene(
        vec![(ShapeDesc::Mesh(m), Transform::default())],
        light(),
    ))
    .unwrap();
    assert_eq!((c.triangles.len(), c.emitters.len()), (1, 1));
    assert_eq!(notes.len(), 1);
    assert!(
        notes[0]
            .to_string()
            .contains("of a light without area: 2 left out"),
        "{}",
        notes[0]
    );
    let flat = Transform {
        scale: Vec3::ZERO,
        ..Transform::default()
    };
    let (c, notes) = compile(&scene(vec![(triangle(), flat)], light())).unwrap();
    assert_eq!(c.primitive_count(), 0);
    assert_eq!(notes.len(), 2);
}

#[test]
fn missing_light_and_unknown_names_are_noted() {
    let metal = MaterialDesc {
        metallic: 0.5,
        roughness: 0.3,
        ..MaterialDesc::new("other")
    };
    let (c, notes) = compile(&scene(vec![(triangle(), Transform::default())], metal)).unwrap();
    let all = notes
        .iter()
        .map(Note::to_string)
        .collect::<Vec<_>>()
        .join("\n");
    assert!(
        all.contains("m.obj: entities.e0: no material is named `m`; the first material is used"),
        "{all}"
    );
    assert!(all.contains("scene: nothing emits light"), "{all}");
    assert_eq!(c.attributes[0].material, 0);
    assert_eq!(notes.len(), 2);
}

#[test]
fn an_entitys_direction_of_anisotropy_is_its_own() {
    let brushed = MaterialDesc {
        anisotropic: 0.8,
        ..MaterialDesc::new("m")
    };
    let mut s = scene(
        vec![
            (ShapeDesc::Sphere { radius: 1.0 }, Transform::default()),
            (ShapeDesc::Sphere { radius: 2.0 }, Transform::default()),
        ],
        brushed,
    );
    s.entities[1].anisotropic_direction = Some(Vec3::Y);
    let (c, _) = compile(&s).unwrap();
    let direction = |i: usize| c.materials[c.spheres[i].material as usize].anisotropic_direction;
    assert_eq!((direction(0), direction(1)), (Vec3::ZERO, Vec3::Y));
}

#[test]
fn emitters_that_do_not_reflect_are_marked_and_everything_else_reflects() {
    let dark = MaterialDesc {
        emitter_reflects: false,
        ..MaterialDesc::new("m")
    };
    assert!(compile(&scene(vec![], dark.clone())).unwrap().0.materials[0].emitter_reflects);
    let emissive = MaterialDesc {
        emission: Vec3::ONE,
        ..dark
    };
    assert!(!compile(&scene(vec![], emissive)).unwrap().0.materials[0].emitter_reflects);
}

#[test]
fn cameras_without_a_view_direction_are_errors_and_parallel_ups_are_replaced() {
    let mut s = scene(vec![(triangle(), Transform::default())], light());
    s.camera.target = s.camera.position;
    assert!(
        compile(&s)
            .unwrap_err()
            .to_string()
            .contains("camera.target")
    );
    s.camera.target = s.camera.position - Vec3::Y;
    let (c, notes) = compile(&s).unwrap();
    assert_eq!(c.camera.up, Vec3::NEG_Z);
    assert!(
        notes[0].to_string().starts_with("camera.up"),
        "{}",
        notes[0]
    );
    s.camera.up = Vec3::ZERO;
    s.camera.target = s.camera.position - Vec3::Z;
    let (c, _) = compile(&s).unwrap();
    assert!(c.camera.up.cross(Vec3::Z).length() > 0.9);
}

#[test]
fn inconsistent_meshes_and_far_points_are_errors() {
    let breaks: [fn(&mut MeshDesc); 5] = [
        |m| m.triangles[0][1] = 3,
        |m| m.triangle_slot[0] = 1,
        |m| m.triangle_slot.clear(),
        |m| m.normals.truncate(1),
        |m| m.positions[0].x = f32::NAN,
    ];
    for change in breaks {
        let ShapeDesc::Mesh(m) = triangle() else {
            unreachable!()
        };
        let mut m = (*m).clone();
        change(&mut m);
        let s = scene(
            vec![(ShapeDesc::Mesh(Arc::new(m)), Transform::default())],
            light(),
        );
        let e = compile(&s).unwrap_err().to_string();
        assert!(e.contains("m.obj: entities.e0"), "{e}");
    }
    let far = Transform {
        translate: DVec3::X * 1e13,
        ..Transform::default()
    };
    assert!(compile(&scene(vec![(triangle(), far)], light())).is_err());
    assert!(
        compile(&scene(
            vec![(ShapeDesc::Sphere { radius: 1.0 }, far)],
            light()
        ))
        .is_err()
    );
    assert!(
        compile(&scene(
            vec![(ShapeDesc::Sphere { radius: -1.0 }, Transform::default())],
            light()
        ))
        .is_err()
    );
}

#[test]
fn scenes_too_small_or_too_far_for_single_precision_are_noted() {
    let notes = |shape: ShapeDesc, scale: f32, offset: f32| {
        let placed = Transform {
            scale: Vec3::splat(scale),
            translate: DVec3::Z * f64::from(offset),
            ..Transform::default()
        };
        let (_, notes) = compile(&scene(vec![(shape, placed)], light())).unwrap();
        let messages: Vec<String> = notes.into_iter().map(|n| n.message).collect();
        messages.join("\n")
    };
    for (scale, offset) in [
        (1.0, 0.0),
        (1.0, 500.0),
        (1e6, 1e6),
        (1e-5, 0.0),
        (1.0, 1e5),
    ] {
        assert_eq!(notes(triangle(), scale, offset), "");
    }
    assert!(notes(triangle(), 1e-8, 0.0).contains("measures only 1.414e-8"));
    let far = [Vec3::ZERO, Vec3::X, Vec3::Y].map(|p| p + Vec3::Z * 1e5);
    let far = ShapeDesc::Mesh(mesh(far.to_vec(), vec![], vec![[0, 1, 2]]));
    assert!(notes(far, 1.0, 0.0).contains("1.000e5 from the origin"));
}
