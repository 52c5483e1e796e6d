//! Densities of emission sampling: chi-square tests of where paths from lights start and in which
//! direction.

use std::f64::consts::{PI, TAU};

use glam::{Vec2, Vec3};
use lumbre_light::math::Frame;
use lumbre_light::math::stats::{chi_square_p, sidak};
use lumbre_light::scene::compile::{Material, Texture, Uv};
use lumbre_light::scene::desc::{ConeDesc, ConeEdge};
use lumbre_light::transport::light::{LightId, LightPoint, Lights};

use crate::common::{SceneBuilder, grey, light};
use crate::render::lights_density::{
    Cap, SIGNIFICANCE, map_cell, map_cells, scene, sunny, uniform,
};

/// Corners of the box that bounds a scene made of one triangle.
const BOX: [Vec3; 2] = [Vec3::new(-1.0, 0.0, -2.0), Vec3::new(2.0, 1.0, 1.0)];

fn boxed() -> SceneBuilder {
    let [a, b] = BOX;
    scene().triangle([a, b, Vec3::new(a.x, b.y, b.z)], [Vec2::ZERO; 3], grey(0.5))
}

/// Returns the cell of a point relative to a disk: rings of equal area times sectors, 3 x 4.
fn disk_cell(local: Vec2, radius: f32) -> usize {
    let ring = ((local.length_squared() / (radius * radius) * 3.0) as usize).min(2);
    let sector = (((local.y.atan2(local.x) / std::f32::consts::TAU + 0.5) * 4.0) as usize).min(3);
    ring * 4 + sector
}

#[test]
fn emission_from_environments_and_directional_lights_follows_its_density() {
    let [a, b] = BOX;
    let (center, radius) = ((a + b) * 0.5, 0.5 * (b - a).length());
    let size = [16, 8];
    let n = 400_000u32;
    let dark = boxed().environment(Some(sunny()), Vec3::ONE, 40.0).build();
    let sun = boxed()
        .directional(Vec3::new(1.0, -2.0, 0.5), Vec3::ONE)
        .build();
    let level = sidak(SIGNIFICANCE, 2);
    for surrounded in [dark, sun] {
        let lights = Lights::new(&surrounded);
        let directions = surrounded.environment.is_some();
        let mut observed = vec![0.0; if directions { 12 * 9 * 128 } else { 12 }];
        for i in 0..n {
            let u = uniform(i, 6);
            let e = lights
                .sample_emission(&surrounded, u[0], [u[1], u[2]], [u[3], u[4]])
                .unwrap();
            let own = lights.pdf_emission_at(&e.point, e.dir);
            assert_eq!(own.pdf_a, e.pdf_a);
            assert!(
                (own.pdf_w / e.pdf_w - 1.0).abs() < 1e-4 || directions,
                "{own:?} {e:?}"
            );
            assert_eq!(lights.emitted(&surrounded, &e.point, e.dir), e.radiance);
            let disk = PI * f64::from(radius).powi(2);
            assert!(
                (f64::from(e.pdf_a) * disk - 1.0).abs() < 1e-3,
                "the density is not one over the area of the disk"
            );
            let offset = e.point.position - center;
            assert!(
                (offset.dot(e.dir) + radius).abs() < 1e-3 * radius,
                "the path does not start in front of the scene"
            );
            let local = Frame::from_normal(e.dir).to_local(offset);
            let mut cell = disk_cell(local.truncate(), radius);
            if directions {
                cell += 12 * map_cell(size, 40.0, -e.dir);
            }
            observed[cell] += 1.0;
        }
        let directions = if directions {
            map_cells(size, 40.0, |dir| {
                f64::from(lights.pdf_environment_one_w(dir))
            })
        } else {
            vec![1.0]
        };
        let twelfth = f64::from(n) / 12.0;
        let expected: Vec<f64> = directions
            .iter()
            .flat_map(|d| std::iter::repeat_n(d * twelfth, 12))
            .collect();
        let p = chi_square_p(&observed, &expected, 0);
        assert!(p > level, "p = {p}");
    }
}

#[test]
fn emission_from_surfaces_and_point_lights_follows_its_density() {
    let corners = [
        Vec3::new(-1.0, 2.0, -1.0),
        Vec3::new(1.5, 2.2, -0.5),
        Vec3::new(-0.5, 1.7, 1.0),
    ];
    let (center, radius) = (Vec3::new(3.0, 1.0, 0.0), 0.6);
    let mut lit = scene();
    // Only textured lights have texture coordinates.
    let emission_texture = lit.texture(Texture::new(1, 1, vec![[1.0; 3]]));
    let textured = Material {
        emission_texture,
        ..light(1.0)
    };
    let lit = lit
        .triangle(corners, [Vec2::ZERO, Vec2::X, Vec2::Y], textured)
        .sphere(center, radius, light(3.0))
        .point(Vec3::Y * 3.0, Vec3::splat(2.0))
        .build();
    let lights = Lights::new(&lit);
    // Four regions of every light, each with 4 x 4 cells of directions of equal probability: with
    // cosine density, or uniform for the point light.
    let mut observed = vec![0.0; 3 * 64];
    let n = 400_000u32;
    for i in 0..n {
        let u = uniform(i, 7);
        let e = lights
            .sample_emission(&lit, u[0], [u[1], u[2]], [u[3], u[4]])
            .unwrap();
        let own = lights.pdf_emission_at(&e.point, e.dir);
        assert_eq!(own.pdf_a, e.pdf_a);
        assert!(
            (own.pdf_w - e.pdf_w).abs() < 1e-5 * (1.0 + e.pdf_w),
            "{own:?} {e:?}"
        );
        let sector = |x: f32, y: f32, n: f32| {
            (((y.atan2(x) / std::f32::consts::TAU + 0.5) * n) as usize).min(n as usize - 1)
        };
        let local = Frame::from_normal(e.point.normal).to_local(e.dir);
        let height = |h: f32| ((h * 4.0) as usize).min(3);
        let (which, at, dir) = match e.point.light() {
            LightId::Emitter(0) => {
                // Four triangles of a quarter of the area each.
                let [x, y] = e.point.uv.first;
                let at = if x > 0.5 {
                    0
                } else if y > 0.5 {
                    1
                } else if x + y < 0.5 {
                    2
                } else {
                    3
                };
                (
                    0,
                    at,
                    height(1.0 - e.cos * e.cos) * 4 + sector(local.x, local.y, 4.0),
                )
            }
            LightId::Emitter(_) => {
                assert!(((e.point.position - center).length() - radius).abs() < 1e-5);
                let at = height((e.point.normal.z + 1.0) * 0.5);
                (
                    1,
                    at,
                    height(1.0 - e.cos * e.cos) * 4 + sector(local.x, local.y, 4.0),
                )
            }
            _ => (
                2,
                sector(e.dir.x, e.dir.y, 4.0),
                height((e.dir.z + 1.0) * 0.5) * 4 + sector(e.dir.x, e.dir.y, 16.0) % 4,
            ),
        };
        observed[which * 64 + at * 16 + dir] += 1.0;
    }
    let choice = [LightId::Emitter(0), LightId::Emitter(1), LightId::Point(0)]
        .map(|l| f64::from(lights.pdf_choice(l)));
    assert!((choice.iter().sum::<f64>() - 1.0).abs() < 1e-6);
    let expected: Vec<f64> = choice
        .iter()
        .flat_map(|c| std::iter::repeat_n(c * f64::from(n) / 64.0, 64))
        .collect();
    let p = chi_square_p(&observed, &expected, 0);
    assert!(p > SIGNIFICANCE, "p = {p}");
    // The expected counts are valid only for these densities.
    for (i, cos) in [(0, 0.3f32), (1, 0.9)] {
        let emitter = lights.with_indices::<f32, 1>([i], true);
        let pdf = emitter.pdf_emission(Vec3::Z, Vec3::Z * cos);
        let area = lit.emitters[i as usize].area;
        assert!((pdf.pdf_a * area - choice[i as usize] as f32).abs() < 1e-6);
        assert!((pdf.pdf_w - cos / std::f32::consts::PI).abs() < 1e-7);
        assert_eq!(emitter.pdf_emission(Vec3::Z, Vec3::Z * -cos).pdf_w, 0.0);
    }
    let at = LightPoint {
        lights: [LightId::Point(0)],
        position: Vec3::Y * 3.0,
        normal: Vec3::Y,
        extent: 0.0,
        uv: Uv::zero(),
    };
    assert!((f64::from(lights.pdf_emission_at(&at, Vec3::X).pdf_w) * 4.0 * PI - 1.0).abs() < 1e-6);
}

#[test]
fn emission_from_spot_lights_is_uniform_in_the_cone_and_weighted_by_the_falloff() {
    let axis = Vec3::new(0.4, -1.0, 0.3);
    let mut p = Vec::new();
    for (key, beam_deg, cutoff_deg) in [
        (0u32, 0.5f32, 1.0f32),
        (1, 20.0, 45.0),
        (2, 60.0, 60.0),
        (3, 0.0, 150.0),
    ] {
        for edge in [ConeEdge::Linear, ConeEdge::Smooth] {
            let desc = ConeDesc {
                beam_deg,
                cutoff_deg,
                edge,
            };
            let scene = scene()
                .spot(Vec3::ONE, axis, Vec3::splat(2.0), desc)
                .build();
            let lights = Lights::new(&scene);
            let height = 2.0 * (f64::from(cutoff_deg).to_radians() / 2.0).sin().powi(2);
            let cap = Cap::new(axis, height);
            let (mut observed, mut power) = (vec![0.0; cap.side * cap.side], 0.0);
            let n = 60_000;
            for i in 0..n {
                let u = uniform(i, 90 + key);
                let Some(e) = lights.sample_emission(&scene, u[0], [u[1], u[2]], [u[3], u[4]])
                else {
                    continue;
                };
                assert!(
                    (f64::from(e.pdf_w) * TAU * height - 1.0).abs() < 1e-5,
                    "{desc:?}: {}",
                    e.pdf_w
                );
                let again = lights.pdf_emission_at(&e.point, e.dir);
                assert_eq!(
                    (again.pdf_w, lights.emitted(&scene, &e.point, e.dir)),
                    (e.pdf_w, e.radiance),
                    "{desc:?}"
                );
                // The radiance that arrives from a sampled direction is the radiance emitted there.
                let from = e.point.position + e.dir * 3.0;
                let arrives = lights
                    .sample_direct_from(&scene, 0, from, [0.5; 2])
                    .map_or(Vec3::ZERO, |d| d.radiance);
                assert!(
                    (arrives * 9.0 - e.radiance).abs().max_element() < 2e-2,
                    "{desc:?}: {arrives} {}",
                    e.radiance
                );
                if let Some(cell) = cap.cell(e.dir) {
                    observed[cell] += 1.0;
                }
                power += f64::from(e.radiance.x / e.pdf_w) / f64::from(n);
            }
            let expected = vec![f64::from(n) / observed.len() as f64; observed.len()];
            p.push(chi_square_p(&observed, &expected, 0));
            // The power has the closed form by which spot lights are selected.
            let share = scene.points[0].cone.mean_falloff();
            assert!(
                (power / (4.0 * PI * 2.0 * share) - 1.0).abs() < 0.015,
                "{desc:?}: {power}, share {share}"
            );
            let outside = lights.pdf_emission_at(
                &LightPoint {
                    normal: -axis,
                    ..point(&lights)
                },
                -axis,
            );
            assert_eq!(outside.pdf_w, 0.0);
        }
    }
    let limit = sidak(SIGNIFICANCE, p.len());
    assert!(p.iter().all(|p| *p > limit), "{p:?}");
}

#[test]
fn emission_from_goniometric_lights_is_uniform_and_weighted_by_the_map() {
    let texel = |i: u32| [if i % 16 < 8 { 0.0 } else { 1.0 }; 3];
    let half = || Texture::new(16, 8, (0..16 * 8).map(texel).collect());
    let scene = scene()
        .point(Vec3::Y, Vec3::splat(2.0))
        .goniometric(Vec3::ONE, Vec3::splat(2.0), half(), 40.0)
        .goniometric(
            Vec3::ONE,
            Vec3::splat(2.0),
            Texture::new(1, 1, vec![[0.5; 3]]),
            0.0,
        )
        .build();
    // Powers of 1, 1/2 and 1/2 of a point light's.
    let lights = Lights::new(&scene);
    let choice = [0, 1, 2].map(|i| lights.pdf_choice(LightId::Point(i)));
    for (found, expected) in choice.iter().zip([0.5, 0.25, 0.25]) {
        assert!((found - expected).abs() < 1e-5, "{choice:?}");
    }
    let (mut power, mut lit) = ([0.0; 3], 0);
    let n = 60_000;
    for i in 0..n {
        let u = uniform(i, 31);
        let Some(e) = lights.sample_emission(&scene, u[0], [u[1], u[2]], [u[3], u[4]]) else {
            continue;
        };
        let LightId::Point(own) = e.point.light() else {
            panic!("{:?}", e.point)
        };
        assert!((f64::from(e.pdf_w) * 4.0 * PI - 1.0).abs() < 1e-5);
        let again = lights.pdf_emission_at(&e.point, e.dir);
        assert_eq!((again.pdf_a, again.pdf_w), (e.pdf_a, e.pdf_w));
        assert_eq!(lights.emitted(&scene, &e.point, e.dir), e.radiance);
        lit += u32::from(own == 1 && e.radiance != Vec3::ZERO);
        let from = e.point.position + e.dir * 3.0;
        let arrives = lights
            .sample_direct_from(&scene, own, from, [0.5; 2])
            .map_or(Vec3::ZERO, |d| d.radiance);
        assert!((arrives * 9.0 - e.radiance).abs().max_element() < 2e-2);
        power[own as usize] += f64::from(e.radiance.x / (e.pdf_w * e.pdf_a)) / f64::from(n);
    }
    for (power, share) in power.iter().zip([1.0, 0.5, 0.5]) {
        assert!(
            (power / (8.0 * PI * share) - 1.0).abs() < 0.03,
            "{power}, share {share}"
        );
    }
    // Half of the directions, and two of sixteen columns that are half lit by interpolation.
    let share = f64::from(lit) / f64::from(n) / 0.25;
    assert!((share - 9.0 / 16.0).abs() < 0.02, "{share}");
}

fn point(lights: &Lights) -> LightPoint {
    LightPoint {
        lights: [lights.id(0)],
        position: Vec3::ONE,
        normal: Vec3::Y,
        extent: 0.0,
        uv: Uv::zero(),
    }
}
