//! All integrators render the same picture of a scene in any unit and at any place. Vectors of every width have the
//! bits of one lane (`lanes`, `wavefront`), so that one width is enough here.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use lumbre_light::film::Film;
use lumbre_light::scene::compile::{Material, NONE};
use lumbre_light::scene::desc::{
    CameraDesc, EntityDesc, LightDesc, LightKind, MaterialDesc, MeshDesc, ShapeDesc, Transform,
    mesh_hash,
};
use lumbre_light::scene::{CompiledScene, SceneDesc, compile};
use lumbre_light::transport::integrator::{INTEGRATORS, IntegratorRow};

use crate::common::{job, light, render};
use crate::render::agreement::{EYE, room};
use crate::render::wavefront_fixtures::DISNEY;

/// Returns the scene in units that are `1 / unit` of its own.
fn in_unit(scene: &CompiledScene, unit: f32) -> Arc<CompiledScene> {
    let mut s = scene.clone();
    s.triangles.iter_mut().flatten().for_each(|p| *p *= unit);
    for sphere in &mut s.spheres {
        sphere.center *= unit;
        sphere.radius *= unit;
    }
    s.emitters.iter_mut().for_each(|e| e.area *= unit * unit);
    for point in &mut s.points {
        point.position *= unit;
        point.intensity *= unit * unit;
    }
    s.camera.position *= unit;
    s.camera.target *= unit;
    s.bounds = s.bounds.map(|corner| corner * unit);
    Arc::new(s)
}

/// Returns a room with lights of every kind that has a place, a ball of glass and a painted one.
fn scene() -> Arc<CompiledScene> {
    let glass = Material {
        opacity: 0.0,
        roughness: 0.3,
        ..DISNEY
    };
    room(EYE)
        .sphere(Vec3::new(0.6, 0.4, 0.6), 0.4, glass)
        .sphere(Vec3::new(-0.5, 0.3, 0.8), 0.3, DISNEY)
        .sphere(Vec3::new(-0.9, 1.1, 0.4), 0.1, light(5.0))
        .point(Vec3::new(0.0, 1.0, 1.4), Vec3::splat(0.4))
        .with(|s| s.bounds = [Vec3::new(-2.0, 0.0, -2.0), Vec3::new(2.0, 2.5, 2.0)])
        .build()
}

/// Renders the scene in a unit.
fn picture(scene: &CompiledScene, row: &'static IntegratorRow, unit: f32) -> Film {
    let mut job = job([24, 24], 5, 3);
    job.integrator = row;
    render(&in_unit(scene, unit), job, 16)
}

/// The units are powers of two, by which numbers are multiplied without rounding, so that the same
/// random numbers lead to the same paths but where a ray starts closer to an edge. Pictures differ by
/// a few paths in thousands; those change what all later guided paths learn, and what all pixels share.
#[test]
fn pictures_are_the_same_in_any_unit() {
    let scene = scene();
    assert!(scene.spheres[0].emitter == NONE);
    for row in INTEGRATORS {
        let expected = picture(&scene, row, 1.0);
        let mean = |film: &Film| film.sum.iter().map(|s| s[1]).sum::<f64>();
        // 1e-5, 1e-3, 0.03, 1e3, and 1e6.
        for exponent in [-17, -10, -5, 10, 20] {
            let found = picture(&scene, row, 2f32.powi(exponent));
            let ratio = mean(&found) / mean(&expected);
            assert!(
                (ratio - 1.0).abs() < 0.003,
                "{} at 2^{exponent}: {ratio}",
                row.name
            );
            let same = found.sum.iter().zip(&expected.sum);
            let same = same.filter(|(a, b)| (a[1] - b[1]).abs() <= 1e-3 * b[1]);
            let share = same.count() as f64 / expected.sum.len() as f64;
            assert!(
                row.has_common_noise() || share > 0.5,
                "{} at 2^{exponent}: {share}",
                row.name
            );
        }
    }
}

/// Returns a room of quads and balls at a place, in double precision as loaders read it.
fn room_at(place: DVec3) -> SceneDesc {
    let at = |p: [f32; 3]| Vec3::from_array(p).as_dvec3() + place;
    let quad = |corners: [[f32; 3]; 4], slot: &str| {
        let mut mesh = MeshDesc {
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            slots: vec![slot.to_owned()],
            triangle_slot: vec![0; 2],
            ..MeshDesc::default()
        };
        mesh.place(&corners.map(at));
        mesh.content_hash = mesh_hash(&mesh);
        EntityDesc::new(slot, ShapeDesc::Mesh(Arc::new(mesh)))
    };
    let floor = [
        [-2.0, 0.0, 2.0],
        [2.0, 0.0, 2.0],
        [2.0, 0.0, -2.0],
        [-2.0, 0.0, -2.0],
    ];
    let wall = [
        [-2.0, 0.0, -1.5],
        [2.0, 0.0, -1.5],
        [2.0, 2.5, -1.5],
        [-2.0, 2.5, -1.5],
    ];
    let lamp = [
        [-0.5, 2.0, -0.5],
        [0.5, 2.0, -0.5],
        [0.5, 2.0, 0.5],
        [-0.5, 2.0, 0.5],
    ];
    let ball = EntityDesc {
        transform: Transform {
            translate: at([0.5, 0.5, 0.5]),
            ..Transform::default()
        },
        material: Some("floor".to_owned()),
        ..EntityDesc::new("ball", ShapeDesc::Sphere { radius: 0.5 })
    };
    let material = |name: &str, emission: f32| MaterialDesc {
        emission: Vec3::splat(emission),
        ..MaterialDesc::new(name)
    };
    let kind = LightKind::Point {
        position: Vec3::ZERO,
        intensity: Vec3::splat(0.4),
    };
    let mut point = LightDesc::new("point", kind);
    point.place(at([1.25, 1.0, 1.5]));
    SceneDesc {
        resolution: [24, 24],
        max_depth: 5,
        camera: CameraDesc::pinhole(Vec3::ZERO, Vec3::Z, 50.0)
            .placed(at([0.25, 1.25, 3.5]), at([0.0, 0.75, 0.0])),
        materials: vec![
            material("floor", 0.0),
            material("wall", 0.0),
            material("lamp", 4.0),
        ]
        .into(),
        entities: vec![
            quad(floor, "floor"),
            quad(wall, "wall"),
            quad(lamp, "lamp"),
            ball,
        ]
        .into_iter()
        .collect(),
        lights: vec![point],
        ..SceneDesc::default()
    }
}

/// Places where single precision holds all coordinates of the room, and places where it holds none.
#[test]
fn pictures_are_the_same_at_any_place() {
    let render_at = |row: &'static IntegratorRow, place: DVec3| {
        let (scene, notes) = compile(&room_at(place)).unwrap();
        assert!(notes.is_empty(), "{notes:?}");
        let mut job = job([24, 24], 5, 3);
        job.integrator = row;
        render(&Arc::new(scene), job, 16)
    };
    for row in INTEGRATORS {
        let mean = |film: &Film| film.sum.iter().map(|s| s[1]).sum::<f64>();
        let expected = mean(&render_at(row, DVec3::ZERO));
        for place in [
            DVec3::X * 32.0,
            DVec3::X * 64.0,
            DVec3::new(1024.0, -512.0, 2048.0),
            DVec3::new(1234567.89, -765432.1, 4321098.7),
        ] {
            let ratio = mean(&render_at(row, place)) / expected;
            assert!(
                (ratio - 1.0).abs() < 0.005,
                "{} at {place}: {ratio}",
                row.name
            );
        }
    }
}
