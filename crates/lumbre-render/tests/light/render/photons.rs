//! Light that is gathered over disks: on surfaces with tilted shading normals, and after mirrors.

use std::sync::Arc;

use glam::Vec3;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::Material;
use lumbre_light::scene::desc::{ConeDesc, ConeEdge};

use crate::common::{SceneBuilder, WHITE, grey, mean_and_error, named_job, render};
use crate::render::agreement::technique;
use crate::render::consistent_fixtures::{constant_job, label, merging_alone, polished};

/// Returns the unit vector in the plane of x and z with an angle to z in degrees.
fn tilted(deg: f32) -> Vec3 {
    let (sin, cos) = deg.to_radians().sin_cos();
    Vec3::new(sin, 0.0, cos)
}

/// A Lambertian floor of albedo a under parallel light of irradiance E has the radiance
/// `a E cos / pi`, where the angle is that to the shading normal.
#[test]
fn photons_count_by_the_cosine_with_the_shading_normal() {
    let (albedo, irradiance) = (0.5f32, 2.0f32);
    let wi = tilted(50.0);
    for deg in [20.0f32, -20.0] {
        let scene = SceneBuilder::new(Vec3::Z * 3.0, Vec3::ZERO, 5.0)
            .quad(
                Vec3::new(-1.0, -1.0, 0.0),
                Vec3::X * 2.0,
                Vec3::Y * 2.0,
                grey(albedo),
            )
            .directional(-wi, Vec3::splat(irradiance))
            .with(|scene| {
                scene.normals.make_smooth().fill([tilted(deg); 3]);
            })
            .build();
        let cos = wi.dot(tilted(deg));
        let expected = f64::from(albedo * irradiance * cos) / std::f64::consts::PI;
        for technique in merging_alone() {
            let job = constant_job(&technique, 4, 2, 0.1, 8000);
            let (mean, _) = mean_and_error(&render(&scene, job, 24), 1);
            let what = format!("{}, tilted by {deg}", label(&technique));
            // Some 4000 photons are gathered.
            assert!(
                (mean / expected - 1.0).abs() < 0.08,
                "{what}: {mean}, expected {expected}"
            );
        }
    }
}

/// Returns a metal plate that shows the camera a mirror, in which a ceiling is seen that a spot light
/// below it illuminates. The light shines on nothing else.
fn plate_mirror_and_ceiling() -> Arc<CompiledScene> {
    let mirror = Material {
        metallic: 1.0,
        ..WHITE
    };
    let up = ConeDesc {
        beam_deg: 50.0,
        cutoff_deg: 60.0,
        edge: ConeEdge::Linear,
    };
    SceneBuilder::new(Vec3::new(1.5, 0.0, 1.5), Vec3::ZERO, 6.0)
        .quad(
            Vec3::new(-0.6, -0.6, 0.0),
            Vec3::X * 1.2,
            Vec3::Y * 1.2,
            polished(),
        )
        .quad(
            Vec3::new(-1.0, -1.5, 0.2),
            Vec3::Y * 3.0,
            Vec3::Z * 1.8,
            mirror,
        )
        .quad(
            Vec3::new(-1.0, -2.0, 3.0),
            Vec3::Y * 4.0,
            Vec3::X * 4.0,
            grey(0.8),
        )
        .spot(Vec3::new(1.0, 0.0, 2.0), Vec3::Z, Vec3::splat(3.0), up)
        .build()
}

/// Photons that a mirror sends to glossy metal are found by its camera paths, unless they come from
/// a point light by mirrors alone: no camera path hits that.
#[test]
fn photons_from_a_diffuse_surface_by_a_mirror_are_not_counted_twice() {
    let scene = plate_mirror_and_ceiling();
    let truth = named_job("nee", [8; 2], 4, 9);
    let (expected, error) = mean_and_error(&render(&scene, truth, 256), 1);
    assert!(error < 0.02 * expected, "{expected} +- {error}");
    let job = constant_job(&technique("sppm", &[]), 8, 4, 0.08, 4000);
    let (mean, _) = mean_and_error(&render(&scene, job, 48), 1);
    assert!(
        (mean / expected - 1.0).abs() < 0.15,
        "{mean}, expected {expected}"
    );
}
