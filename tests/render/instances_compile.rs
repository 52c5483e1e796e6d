//! Compiling a scene with instances: which meshes are shared, how much memory they take, and their
//! tangents.

use std::sync::Arc;

use glam::{Affine3A, Quat, Vec3};
use lumbre::math::warp::uniform_sphere;
use lumbre::render::cpu::bvh::accel::Accel;
use lumbre::scene::compile;
use lumbre::scene::compile::{Sharing, compile_sharing};
use lumbre::scene::desc::{MaterialDesc, SceneDesc, ShapeDesc, Transform};

use crate::instances::{desc, entity, place, shared, soup, unfolded};
use crate::intersection::numbers;

#[test]
fn ten_thousand_trees_take_the_memory_of_one() {
    let tree = soup(5, 3000, true, &["a"]);
    let forest = |count: u32| {
        let mut next = numbers(6);
        let at = |i| {
            entity(
                format!("tree {i}"),
                ShapeDesc::Mesh(Arc::clone(&tree)),
                place(&mut next, 3 * i + 1, 400.0, 1.0),
                None,
            )
        };
        desc(vec![MaterialDesc::new("a")], (0..count).map(at).collect())
    };
    let bytes = |desc: &SceneDesc| {
        let (scene, _) = compile(desc).unwrap();
        let scene = Arc::new(scene);
        let accel = Accel::build(Arc::clone(&scene)).unwrap();
        let of = size_of_val(scene.triangles.as_slice())
            + size_of_val(scene.attributes.as_slice())
            + size_of_val(scene.instances.placements.as_slice())
            + size_of_val(scene.instances.materials.as_slice());
        (of + accel.bytes(), scene.flattened_count())
    };
    let (one, count) = bytes(&forest(1));
    assert_eq!(count, 3000);
    let (many, count) = bytes(&forest(10_000));
    assert_eq!(count, 30_000_000);
    // Bytes of an instance: its placement in the scene and in the hierarchy, its table row there,
    // and its share of the nodes.
    assert!(
        many - one <= 10_000 * 400,
        "{} bytes for each copy",
        (many - one) / 10_000
    );
    assert!(many < 10 * one, "{one} {many}");
}

#[test]
fn what_cannot_be_a_copy_has_triangles_of_its_own() {
    let blob = soup(9, 12, true, &["a"]);
    let copies = |transforms: Vec<Transform>, material: MaterialDesc| {
        let each = |(i, t)| entity(format!("{i}"), ShapeDesc::Mesh(Arc::clone(&blob)), t, None);
        let scene = desc(
            vec![material],
            transforms.into_iter().enumerate().map(each).collect(),
        );
        shared(&scene).instances.placements.len()
    };
    let plain = MaterialDesc::new("a");
    let at = |x: f32| Transform {
        translate: Vec3::X * x,
        ..Transform::default()
    };
    let scaled = |x: f32, scale: Vec3| Transform { scale, ..at(x) };
    assert_eq!(copies(vec![at(0.0)], plain.clone()), 0, "alone");
    assert_eq!(copies(vec![at(0.0), at(1.0), at(2.0)], plain.clone()), 3);
    assert_eq!(
        copies(
            vec![at(0.0), at(1.0), scaled(2.0, Vec3::new(1.0, 0.0, 1.0))],
            plain.clone()
        ),
        2,
        "flat"
    );
    assert_eq!(
        copies(
            vec![at(0.0), at(1.0), scaled(2.0, Vec3::new(1.0, 1e-5, 1.0))],
            plain.clone()
        ),
        2,
        "nearly flat"
    );
    assert_eq!(
        copies(
            vec![at(0.0), at(1.0), scaled(2.0, Vec3::splat(-1.0))],
            plain.clone()
        ),
        2,
        "the only mirrored one"
    );
    let brushed = MaterialDesc {
        anisotropic: 0.5,
        ..plain
    };
    assert_eq!(
        copies(
            vec![at(0.0), scaled(1.0, Vec3::splat(3.0))],
            brushed.clone()
        ),
        2,
        "tangents scale evenly"
    );
    let uneven = Vec3::new(1.0, 2.0, 1.0);
    assert_eq!(
        copies(vec![scaled(0.0, uneven), scaled(1.0, uneven)], brushed),
        0,
        "but not unevenly"
    );
}

#[test]
fn tangents_of_copies_are_those_of_the_unfolded_scene() {
    // Flat normals: a normal in a triangle's plane would leave its tangents to rounding.
    let blob = soup(9, 30, false, &["a"]);
    let brushed = MaterialDesc {
        anisotropic: 0.5,
        ..MaterialDesc::new("a")
    };
    let mut next = numbers(3);
    let mut turned = |i: u32| {
        let turn = Quat::from_axis_angle(uniform_sphere([next(), next()]), 6.0 * next());
        let scale = Vec3::splat(2.0) * if i.is_multiple_of(2) { 1.0 } else { -1.0 };
        let frame = Affine3A::from_scale_rotation_translation(scale, turn, Vec3::X * i as f32);
        entity(
            format!("{i}"),
            ShapeDesc::Mesh(Arc::clone(&blob)),
            Transform::framed(frame),
            None,
        )
    };
    let scene = desc(vec![brushed], (0..6).map(&mut turned).collect());
    let (always, apart) = (
        shared(&scene),
        compile_sharing(&scene, Sharing::Never).unwrap().0,
    );
    assert_eq!(always.instances.meshes.len(), 2, "mirrored ones apart");
    let flat = unfolded(&always);
    // Instances are ordered by mesh, so the order differs; a triangle is identified by its corners.
    let mut compared = 0;
    for (i, corners) in flat.triangles.iter().enumerate() {
        let other = apart.triangles.iter().position(|t| t == corners).unwrap();
        for k in 0..3 {
            let (a, b) = (flat.tangents[i][k], apart.tangents[other][k]);
            assert!((a - b).length() < 1e-4, "{a} {b}");
            compared += usize::from(b.truncate() != Vec3::ZERO);
        }
    }
    assert!(compared > 300, "{compared}");
}
