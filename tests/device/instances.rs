//! Instances of one mesh, shaded as on the CPU.

use std::path::PathBuf;
use std::sync::Arc;

use glam::{Affine3A, Mat3, Quat, Vec2, Vec3};
use lumbre_light::math::warp::uniform_sphere;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{Sharing, compile_sharing};
use lumbre_light::scene::desc::place::double;
use lumbre_light::scene::desc::{
    CameraDesc, EntityDesc, EnvironmentDesc, EnvironmentSource, MaterialDesc, MeshDesc, Optics,
    SceneDesc, ShapeDesc, Transform, mesh_hash,
};
use lumbre_render::{Job, Renderer};
use lumbre_vulkan::pipelines::program::TracingMode;
use lumbre_vulkan::renderer::VulkanRenderer;

use super::harness;
use super::images::{render, supported_modes, technique_job};
use super::twins::RandomInputs;
use super::verdict::compare_loosely;
use crate::common::{self, job};

/// Returns a ball of `rows` times twice as many quads, whose cap at the top emits.
fn ball(rows: u32) -> Arc<MeshDesc> {
    let columns = 2 * rows;
    let point = |row: u32, column: u32| {
        // The ball is open at the poles, so that every triangle has an area.
        let (height, turn) = (
            (row as f32 + 0.2) / (rows as f32 + 0.4),
            (column % columns) as f32 / columns as f32,
        );
        uniform_sphere([height, turn])
    };
    let (mut positions, mut triangles, mut slots) = (Vec::new(), Vec::new(), Vec::new());
    for row in 0..rows {
        for column in 0..columns {
            let corners = [
                (row, column),
                (row + 1, column),
                (row + 1, column + 1),
                (row, column + 1),
            ];
            let first = positions.len() as u32;
            positions.extend(corners.map(|(r, c)| point(r, c)));
            triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
            slots.extend([u32::from(row == 0); 2]);
        }
    }
    let mut mesh = MeshDesc {
        file: PathBuf::from("ball.obj"),
        uvs: positions.iter().map(|p| Vec2::new(p.x, p.y)).collect(),
        normals: positions.clone(),
        colors: positions
            .iter()
            .map(|p| (*p * 0.5 + 0.5).clamp(Vec3::ZERO, Vec3::ONE))
            .collect(),
        positions,
        triangles,
        triangle_slot: slots,
        slots: vec!["body".to_owned(), "cap".to_owned()],
        ..MeshDesc::default()
    };
    mesh.content_hash = mesh_hash(&mesh);
    Arc::new(mesh)
}

/// Returns instances of a ball, rotated and scaled, some mirrored and sheared, about a sphere.
fn balls(count: u32, rows: u32) -> CompiledScene {
    let materials = vec![
        MaterialDesc {
            base_color: Vec3::new(0.7, 0.5, 0.3),
            roughness: 0.4,
            ..MaterialDesc::new("body")
        },
        MaterialDesc {
            emission: Vec3::new(4.0, 5.0, 6.0),
            ..MaterialDesc::new("cap")
        },
        MaterialDesc {
            base_color: Vec3::new(0.3, 0.5, 0.7),
            roughness: 0.6,
            ..MaterialDesc::new("other")
        },
    ];
    let mesh = ball(rows);
    let spread = f32::max(1.0, (count as f32).sqrt() * 0.5);
    let mut entities = Vec::new();
    RandomInputs::rows(count, |d, i| {
        let turn = Quat::from_axis_angle(d.direction(), d.between(-3.0, 3.0));
        let mut scale = Vec3::new(
            d.between(0.2, 0.6),
            d.between(0.2, 0.6),
            d.between(0.2, 0.6),
        );
        let mut shear = Mat3::IDENTITY;
        if i % 3 == 1 {
            scale.x = -scale.x;
            shear = Mat3::from_cols(Vec3::X, Vec3::new(0.3, 1.0, 0.0), Vec3::Z);
        }
        let linear = Mat3::from_quat(turn) * shear * Mat3::from_diagonal(scale);
        let place = Affine3A::from_mat3_translation(linear, d.vector(spread));
        entities.push(EntityDesc {
            name: format!("ball {i}"),
            transform: Transform::framed(double(place)),
            material: (i % 4 == 2).then(|| "other".to_owned()),
            anisotropic_direction: None,
            shape: ShapeDesc::Mesh(Arc::clone(&mesh)),
        });
    });
    entities.push(EntityDesc {
        name: "true ball".to_owned(),
        transform: Transform::framed(double(Affine3A::from_translation(
            Vec3::new(0.3, -0.2, 0.4) * spread,
        ))),
        material: Some("other".to_owned()),
        anisotropic_direction: None,
        shape: ShapeDesc::Sphere {
            radius: 0.3 * spread,
        },
    });
    let camera = CameraDesc {
        position: Vec3::new(0.0, 0.5, 2.0 + 2.0 * spread),
        optics: Optics::pinhole(50.0),
        ..CameraDesc::default()
    };
    let desc = SceneDesc {
        resolution: [32, 24],
        max_depth: 4,
        camera,
        materials: materials.into(),
        entities: entities.into(),
        environment: Some(EnvironmentDesc::new(EnvironmentSource::Color(Vec3::splat(
            0.2,
        )))),
        ..SceneDesc::default()
    };
    compile_sharing(&desc, Sharing::Always).unwrap().0
}

#[test]
fn instances_give_the_picture_of_the_cpu() {
    let device = or_return!(harness::device());
    let scene = Arc::new(balls(24, 6));
    assert!(
        scene.instances.placements.len() == 24 && scene.instances.meshes.len() >= 3,
        "expected meshes: plain, mirrored, without emission"
    );
    for (name, kind) in [
        ("nee", TracingMode::Pipeline),
        ("bpt", TracingMode::Query),
        ("bpt", TracingMode::Compute),
    ] {
        let job = Job {
            resolution: [48, 32],
            ..technique_job(name, 60)
        };
        let expected = common::render(&scene, job.clone(), 8);
        // The emitting caps are visible in addition to the environment.
        assert!(
            expected.mean().data.iter().any(|p| p[2] > 1.0),
            "no cap is visible"
        );
        if supported_modes(&device).contains(&kind) {
            compare_loosely(
                &format!("{name} by {}", kind.backend()),
                &render(&device, kind, &scene, &job, 8),
                &expected,
            );
        }
    }
    harness::assert_no_validation_messages();
}

#[test]
fn ten_thousand_instances_take_few_bytes_each() {
    let device = or_return!(harness::device());
    let bytes = |kind: TracingMode, scene: &CompiledScene| {
        let job = job([8, 8], 2, 1);
        let mut renderer =
            VulkanRenderer::new(&device, kind, &harness::sources(), scene, &job).unwrap();
        renderer.advance(1).unwrap();
        renderer.open_stats().accel_bytes
    };
    // Both scenes have two meshes, plain and mirrored.
    let (few, many) = (balls(2, 24), balls(10_000, 24));
    assert!(
        many.flattened(1 << 24).is_err(),
        "the scene must be too large to be flattened"
    );
    let meshes = 2 * 4 * 24 * 24;
    for kind in [TracingMode::Query, TracingMode::Compute]
        .into_iter()
        .filter(|kind| supported_modes(&device).contains(kind))
    {
        let (least, most) = (bytes(kind, &few), bytes(kind, &many));
        let name = kind.backend();
        println!(
            "{name}: {meshes} triangles in {least} bytes; ten thousand instances of them in {most}"
        );
        // An instance takes its record and its share of the top-level tree, which hardware stores
        // in formats of its own.
        let own = kind == TracingMode::Compute || device.info.software;
        assert!(
            most - least < 10_000 * if own { 512 } else { 1024 },
            "{name}: {} bytes for each instance",
            (most - least) / 10_000
        );
    }
    harness::assert_no_validation_messages();
}
