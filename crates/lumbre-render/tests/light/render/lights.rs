//! Light sampling: exact areas, and agreement with paths that find the light by chance.

use std::sync::Arc;

use glam::{Vec2, Vec3};
use lumbre_light::math::rng::{pcg4d, unit};
use lumbre_light::math::stats::chi_square_p;
use lumbre_light::scene::CompiledScene;
use lumbre_light::transport::light::{LightId, LightSelection, Lights};
use lumbre_light::transport::ray::Ray;
use lumbre_render::cpu::bvh::accel::Accel;

use crate::common::{SceneBuilder, grey, job, light, mean_and_error, render};

/// Returns a floor under lights of very different areas: two triangles and a sphere.
fn scene() -> Arc<CompiledScene> {
    let big = [
        Vec3::new(-1.0, 2.0, -1.0),
        Vec3::new(1.0, 2.0, -1.0),
        Vec3::new(-1.0, 2.0, 1.0),
    ];
    let small = [
        Vec3::new(0.5, 1.0, 0.5),
        Vec3::new(0.8, 1.0, 0.5),
        Vec3::new(0.5, 1.0, 0.9),
    ];
    SceneBuilder::new(Vec3::new(0.0, 0.8, 2.5), Vec3::ZERO, 0.5)
        .floor(20.0, 0.0, grey(0.8))
        .triangle(big, [Vec2::ZERO; 3], light(2.0))
        .triangle(small, [Vec2::ZERO; 3], light(9.0))
        .sphere(Vec3::new(-0.9, 0.9, 0.4), 0.25, light(5.0))
        .build()
}

fn uniform(i: u32) -> [f32; 4] {
    pcg4d([i, 21, 22, 23]).map(unit)
}

#[test]
fn emitters_are_selected_in_proportion_to_their_area() {
    let scene = scene();
    let lights = Lights::with_select(&scene, LightSelection::Area);
    let areas: Vec<f64> = scene.emitters.iter().map(|e| f64::from(e.area)).collect();
    let total: f64 = areas.iter().sum();
    assert!((lights.total_area() / total - 1.0).abs() < 1e-6);
    let n = 100_000;
    let mut observed = vec![0.0; areas.len()];
    for i in 0..n {
        let u = uniform(i);
        let e = lights
            .sample_emission(&scene, u[0], [u[1], u[2]], [u[3], 0.5])
            .unwrap();
        assert!(
            (f64::from(e.pdf_a) * total - 1.0).abs() < 1e-4,
            "the density is not 1 / total area"
        );
        let LightId::Emitter(which) = e.point.light() else {
            panic!("{:?}", e.point)
        };
        let emitter = lights.with_indices::<f32, 1>([which], true);
        let again = emitter.pdf_emission(Vec3::Z, Vec3::Z * e.cos);
        assert_eq!([again.pdf_a, again.pdf_w], [e.pdf_a, e.pdf_w]);
        observed[which as usize] += 1.0;
    }
    let expected: Vec<f64> = areas.iter().map(|a| a / total * f64::from(n)).collect();
    assert!(chi_square_p(&observed, &expected, 0) > 0.001);
}

#[test]
fn light_sampling_agrees_with_paths_that_hit_lights_by_chance() {
    let scene = scene();
    let film = render(&scene, job([8, 8], 2, 31), 40_000);
    let (found, found_error) = mean_and_error(&film, 0);

    // The same radiance by connecting the point at the centre of the picture to points on the
    // lights.
    let accel = Accel::build(Arc::clone(&scene)).unwrap();
    let lights = Lights::new(&scene);
    let origin = Vec3::Y * 1e-4;
    let n = 200_000u32;
    let (mut sum, mut sum2) = (0.0f64, 0.0f64);
    for i in 0..n {
        let u = uniform(i);
        let value = match lights.sample_direct(&scene, origin, u[0], [u[1], u[2]]) {
            Some(d)
                if d.wi.y > 0.0
                    && !accel.occluded(&Ray { origin, dir: d.wi }, d.distance * 0.999) =>
            {
                let at = d.point;
                let LightId::Emitter(i) = at.light() else {
                    panic!("{at:?}")
                };
                let again = lights.pdf_direct_w(origin, i, at.position, at.normal);
                assert!((again / d.pdf_w - 1.0).abs() < 0.01, "{again} {}", d.pdf_w);
                f64::from(0.8 / std::f32::consts::PI * d.radiance.x * d.wi.y / d.pdf_w)
            }
            _ => 0.0,
        };
        sum += value;
        sum2 += value * value;
    }
    let mean = sum / f64::from(n);
    let error = ((sum2 / f64::from(n) - mean * mean) / f64::from(n)).sqrt();
    let sigma = (error * error + found_error * found_error).sqrt();
    assert!(sigma / mean < 0.01);
    assert!(
        (mean - found).abs() < 3.0 * sigma,
        "{mean} and {found} +- {sigma}"
    );
}
