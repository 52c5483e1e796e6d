//! Compiling a scene with instances: which meshes are shared, how much memory they take, and their
//! tangents.

use std::sync::Arc;

use glam::{Affine3A, DVec3, Quat, Vec3};
use lumbre_light::math::warp::uniform_sphere;
use lumbre_light::scene::compile;
use lumbre_light::scene::compile::{Sharing, compile_sharing};
use lumbre_light::scene::desc::place::double;
use lumbre_light::scene::desc::{MaterialDesc, SceneDesc, ShadingNormals, ShapeDesc, Transform};
use lumbre_render::cpu::bvh::accel::Accel;

use crate::render::instances::{
    compile_shared, desc, entity, flattened_scene, random_transform, soup,
};
use crate::render::intersection::numbers;

#[test]
fn ten_thousand_instances_take_less_than_ten_times_the_memory_of_one() {
    let tree = soup(5, 3000, true, &["a"]);
    let forest = |count: u32| {
        let mut next = numbers(6);
        let at = |i| {
            entity(
                format!("tree {i}"),
                ShapeDesc::Mesh(Arc::clone(&tree)),
                random_transform(&mut next, 3 * i + 1, 400.0, 1.0),
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
            + scene.normals.bytes()
            + size_of_val(scene.instances.placements.as_slice())
            + size_of_val(scene.instances.materials.as_slice());
        (of + accel.bytes(), scene.flattened_count())
    };
    let (one, count) = bytes(&forest(1));
    assert_eq!(count, 3000);
    let (many, count) = bytes(&forest(10_000));
    assert_eq!(count, 30_000_000);
    // An instance takes its placement in the scene and in the hierarchy, its table row there, and
    // its share of the nodes.
    assert!(
        many - one <= 10_000 * 400,
        "{} bytes for each instance",
        (many - one) / 10_000
    );
    assert!(many < 10 * one, "{one} {many}");
}

#[test]
fn entities_that_cannot_share_a_mesh_are_not_instances() {
    let blob = soup(9, 12, true, &["a"]);
    let instance_count = |transforms: Vec<Transform>, material: MaterialDesc| {
        let each = |(i, t)| entity(format!("{i}"), ShapeDesc::Mesh(Arc::clone(&blob)), t, None);
        let scene = desc(
            vec![material],
            transforms.into_iter().enumerate().map(each).collect(),
        );
        compile_shared(&scene).instances.placements.len()
    };
    let plain = MaterialDesc::new("a");
    let at = |x: f32| Transform {
        translate: DVec3::X * f64::from(x),
        ..Transform::default()
    };
    let scaled = |x: f32, scale: Vec3| Transform { scale, ..at(x) };
    assert_eq!(instance_count(vec![at(0.0)], plain.clone()), 0, "used once");
    assert_eq!(
        instance_count(vec![at(0.0), at(1.0), at(2.0)], plain.clone()),
        3
    );
    assert_eq!(
        instance_count(
            vec![at(0.0), at(1.0), scaled(2.0, Vec3::new(1.0, 0.0, 1.0))],
            plain.clone()
        ),
        2,
        "scaled to a plane"
    );
    assert_eq!(
        instance_count(
            vec![at(0.0), at(1.0), scaled(2.0, Vec3::new(1.0, 1e-5, 1.0))],
            plain.clone()
        ),
        2,
        "scaled nearly to a plane"
    );
    assert_eq!(
        instance_count(
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
        instance_count(
            vec![at(0.0), scaled(1.0, Vec3::splat(3.0))],
            brushed.clone()
        ),
        2,
        "anisotropic, with uniform scale"
    );
    let non_uniform = Vec3::new(1.0, 2.0, 1.0);
    assert_eq!(
        instance_count(
            vec![scaled(0.0, non_uniform), scaled(1.0, non_uniform)],
            brushed
        ),
        0,
        "anisotropic, with non-uniform scale"
    );
}

#[test]
fn entities_share_a_mesh_only_if_their_normals_are_alike() {
    let blob = soup(9, 12, true, &["a"]);
    let materials = [
        ("smooth", ShadingNormals::Smooth),
        ("flat", ShadingNormals::Flat),
    ];
    let materials = materials.map(|(name, shading_normals)| MaterialDesc {
        shading_normals,
        ..MaterialDesc::new(name)
    });
    let names = ["smooth", "smooth", "flat", "flat"];
    let each = |(i, name): (usize, &str)| {
        let transform = Transform {
            translate: DVec3::X * i as f64,
            ..Transform::default()
        };
        let shape = ShapeDesc::Mesh(Arc::clone(&blob));
        entity(format!("{i}"), shape, transform, Some(name))
    };
    let scene = desc(
        materials.into(),
        names.into_iter().enumerate().map(each).collect(),
    );
    let scene = compile_shared(&scene);
    assert_eq!(scene.instances.placements.len(), 4);
    assert_eq!(scene.instances.meshes.len(), 2);
}

#[test]
fn tangents_of_instances_equal_those_of_separate_meshes() {
    // Normals are flat: with a normal in the plane of its triangle, rounding would determine the
    // tangents.
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
            Transform::framed(double(frame)),
            None,
        )
    };
    let scene = desc(vec![brushed], (0..6).map(&mut turned).collect());
    let (always, unshared) = (
        compile_shared(&scene),
        compile_sharing(&scene, Sharing::Never).unwrap().0,
    );
    assert_eq!(
        always.instances.meshes.len(),
        2,
        "mirrored instances have a mesh of their own"
    );
    let flat = flattened_scene(&always);
    // Instances are ordered by mesh, so the order differs; a triangle is identified by its corners.
    let mut compared = 0;
    for (i, corners) in flat.triangles.iter().enumerate() {
        let other = unshared
            .triangles
            .iter()
            .position(|t| t == corners)
            .unwrap();
        for k in 0..3 {
            let (a, b) = (flat.tangents[i][k], unshared.tangents[other][k]);
            assert!((a - b).length() < 1e-4, "{a} {b}");
            compared += usize::from(b.truncate() != Vec3::ZERO);
        }
    }
    assert!(compared > 300, "{compared}");
}
