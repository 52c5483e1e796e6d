//! All integrators agree on textured lights, environments and many lights. Light of point lights
//! and directional lights, which `bpt` cannot find, has the theoretical radiance.

use std::sync::Arc;

use glam::{Vec2, Vec3};
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{Material, Texture, UvMap};
use lumbre_light::scene::desc::{ConeDesc, ConeEdge};
use lumbre_light::transport::integrator::integrator;
use lumbre_light::value::Value;

use crate::common::{SceneBuilder, WHITE, grey, job, light, mean_and_error, render};
use crate::render::agreement::{
    EYE, Setting, Technique, agree, agree_with_bpt, params, room, technique,
};
use crate::render::lights_density::sunny;

/// Returns `nee` and `bdpt` with every light selection.
fn light_selections() -> Vec<Technique> {
    let select = |name: &str, word: &str| technique(name, &[("select", word.into())]);
    let words = ["uniform", "area", "power"];
    ["nee", "bdpt"]
        .into_iter()
        .flat_map(|name| words.map(|word| select(name, word)))
        .collect()
}

/// Compares `nee` and `bdpt` with `bpt` for every light selection.
fn agree_for_every_selection(scene: &Arc<CompiledScene>, depth: u32, samples: u64) {
    let setting = Setting {
        scene,
        depth,
        rr_start: None,
        samples,
        noise: 0.01,
    };
    agree(setting, &technique("bpt", &[]), &light_selections());
}

#[test]
fn integrators_agree_on_textured_emitters_with_a_mask() {
    let mut builder = room(EYE);
    let bright = Texture::new(
        4,
        2,
        (0..8)
            .map(|i| [0.2 * i as f32, 0.9, if i == 5 { 20.0 } else { 0.0 }])
            .collect::<Vec<_>>(),
    );
    let mask = Texture::new(2, 2, vec![[1.0; 3], [0.0; 3], [0.7; 3], [1.0; 3]]);
    let (bright, mask) = (builder.texture(bright), builder.texture(mask));
    let lamp = Material {
        emission_texture: bright,
        mask_texture: mask,
        tiling: UvMap {
            scale: 1.6,
            offset: Vec2::new(0.3, -0.1),
        },
        ..light(2.0)
    };
    let scene = builder
        .quad(
            Vec3::new(-1.9, 0.3, 0.8),
            Vec3::Z * -1.8,
            Vec3::Y * 1.5,
            Material {
                emitter_reflects: true,
                ..lamp
            },
        )
        .sphere(Vec3::new(0.6, 0.6, 0.4), 0.4, lamp)
        .build();
    agree_for_every_selection(&scene, 5, 1200);
}

#[test]
fn integrators_agree_on_many_lights() {
    let mut builder =
        SceneBuilder::new(EYE, Vec3::new(0.0, 0.7, 0.0), 50.0).floor(2.0, 0.0, grey(0.7));
    for i in 0..400u32 {
        let (x, z) = (i % 20, i / 20);
        let at = Vec3::new(
            x as f32 * 0.2 - 2.0,
            1.5 + 0.02 * (i % 7) as f32,
            z as f32 * 0.2 - 2.0,
        );
        let size = 0.02 + 0.01 * (i % 9) as f32;
        let corners = [at, at + Vec3::X * size, at + Vec3::Z * size];
        builder = builder.triangle(corners, [Vec2::ZERO; 3], light(0.5 + (i % 13) as f32));
    }
    agree_for_every_selection(&builder.build(), 4, 1200);
}

#[test]
fn integrators_agree_on_an_environment_with_a_sun() {
    // The sun is large enough for `bpt` to find it.
    let mut sky = sunny();
    sky.texels.floats_mut().unwrap()[2 * 16 + 11] = [60.0, 50.0, 40.0];
    let red = Material {
        base_color: Vec3::new(0.8, 0.3, 0.2),
        ..WHITE
    };
    let mirror = Material {
        metallic: 1.0,
        base_color: Vec3::new(0.9, 0.8, 0.7),
        ..WHITE
    };
    let scene = SceneBuilder::new(EYE, Vec3::new(0.0, 0.7, 0.0), 50.0)
        .floor(2.0, 0.0, grey(0.7))
        .quad(
            Vec3::new(-2.0, 0.0, -1.5),
            Vec3::X * 4.0,
            Vec3::Y * 1.5,
            red,
        )
        .sphere(Vec3::new(-0.6, 0.5, 0.0), 0.5, grey(0.5))
        .sphere(Vec3::new(0.6, 0.45, 0.2), 0.4, mirror)
        .sphere(Vec3::new(0.2, 1.2, 0.2), 0.1, light(9.0))
        .environment(Some(sky), Vec3::splat(0.3), 120.0)
        .build();
    agree_for_every_selection(&scene, 5, 2500);
}

#[test]
fn integrators_agree_on_a_constant_environment_through_glass() {
    let glass = Material {
        opacity: 0.0,
        base_color: Vec3::new(0.9, 1.0, 0.9),
        ..WHITE
    };
    let scene = SceneBuilder::new(EYE, Vec3::new(0.0, 0.5, 0.0), 50.0)
        .floor(2.0, 0.0, grey(0.7))
        .sphere(Vec3::new(-0.3, 0.6, 0.2), 0.55, glass)
        .environment(None, Vec3::new(0.5, 0.7, 1.0), 0.0)
        .build();
    agree_with_bpt(&scene, 7, Some(3), 1200);
}

/// Returns the radiance of the origin on a floor of albedo 0.6, and its standard error. The field
/// of view is 0.05 degrees.
fn floor(lit: impl FnOnce(SceneBuilder) -> SceneBuilder, params: &[(&str, Value)]) -> (f64, f64) {
    let floor =
        SceneBuilder::new(Vec3::new(1.0, 2.0, 3.0), Vec3::ZERO, 0.05).floor(5.0, 0.0, grey(0.6));
    let mut j = job([4, 4], 3, 9);
    (j.integrator, j.settings.params) = (integrator("nee").unwrap(), self::params(params));
    mean_and_error(&render(&lit(floor).build(), j, 4000), 1)
}

#[test]
fn point_and_directional_lights_give_a_floor_the_theoretical_radiance() {
    let (place, way) = (Vec3::new(1.0, 1.5, -0.7), Vec3::new(0.4, -0.8, 0.1));
    let point = |b: SceneBuilder| b.point(place, Vec3::new(1.0, 4.0, 9.0));
    let direction = |b: SceneBuilder| b.directional(way, Vec3::new(1.0, 3.0, 9.0));
    let albedo = 0.6 / std::f64::consts::PI;
    let of_point = albedo * 4.0 * f64::from(place.y / place.length().powi(3));
    let of_direction = albedo * 3.0 * f64::from(-way.y / way.length());
    // With one light every sample has the same value.
    for mis in ["power", "balance", "none"] {
        for (found, exact) in [
            (floor(point, &[("mis", mis.into())]), of_point),
            (floor(direction, &[("mis", mis.into())]), of_direction),
        ] {
            assert!(
                (found.0 / exact - 1.0).abs() < 1e-3,
                "{mis}: {found:?} instead of {exact}"
            );
        }
    }
    // The axis of the spot light misses the point by 20 degrees, between beam and cutoff.
    let aim = -place.normalize_or_zero();
    let aside = aim.any_orthonormal_vector();
    for (edge, left) in [(ConeEdge::Linear, 0.5), (ConeEdge::Smooth, 0.384631)] {
        let desc = ConeDesc {
            beam_deg: 10.0,
            cutoff_deg: 30.0,
            edge,
        };
        let (sin, cos) = 20f32.to_radians().sin_cos();
        let spot = |b: SceneBuilder| {
            b.spot(
                place,
                3.0 * (aim * cos + aside * sin),
                Vec3::new(1.0, 4.0, 9.0),
                desc,
            )
        };
        let found = floor(spot, &[]).0;
        assert!(
            (found / (left * of_point) - 1.0).abs() < 2e-3,
            "{edge:?}: {found} instead of {}",
            left * of_point
        );
        let behind = |b: SceneBuilder| b.spot(place, -aim, Vec3::ONE, desc);
        assert_eq!(floor(behind, &[]).0, 0.0);
    }
    // Both lights and a sky, with every light selection.
    for select in ["uniform", "area", "power"] {
        let all = |b: SceneBuilder| direction(point(b)).environment(None, Vec3::splat(0.5), 0.0);
        let exact = of_point + of_direction + 0.6 * 0.5;
        let (found, error) = floor(all, &[("select", select.into())]);
        assert!(error < 0.02 * exact, "{select}: {error} of {exact}");
        assert!(
            (found - exact).abs() < 4.0 * error + 1e-3 * exact,
            "{select}: {found} +- {error}, not {exact}"
        );
    }
    // A plate shadows the point.
    let corner = place * 0.5 - Vec3::new(0.1, 0.0, 0.1);
    let hidden = |b: SceneBuilder| point(b).quad(corner, Vec3::X * 0.2, Vec3::Z * 0.2, grey(0.5));
    assert!(floor(hidden, &[]).0 < 0.01 * of_point);
}

#[test]
fn goniometric_lights_are_point_lights_times_their_map() {
    let (place, intensity) = (Vec3::new(1.0, 1.5, -0.7), Vec3::new(1.0, 4.0, 9.0));
    let point = floor(|b| b.point(place, 0.5 * intensity), &[]).0;
    // Grey everywhere; white only in the lower half, towards the floor; black there; white on the
    // side of the floor, turned from and to the other side.
    let rows = |upper: f32, lower: f32| {
        let texel = |i: u32| [if i < 32 { upper } else { lower }; 3];
        Texture::new(1, 64, (0..64).map(texel).collect())
    };
    let columns = |degrees: f32| {
        // Columns right of the middle, which is +z, are directions towards -x.
        let texel = |i: u32| [f32::from(u8::from(i >= 32)); 3];
        (Texture::new(64, 1, (0..64).map(texel).collect()), degrees)
    };
    for ((map, degrees), factor) in [
        ((rows(0.5, 0.5), 25.0), 1.0),
        ((rows(0.0, 1.0), 0.0), 2.0),
        ((rows(1.0, 0.0), 0.0), 0.0),
        (columns(0.0), 2.0),
        (columns(180.0), 0.0),
    ] {
        let found = floor(|b| b.goniometric(place, intensity, map, degrees), &[]).0;
        assert!(
            (found - factor * point).abs() < 1e-6 * point,
            "{degrees} degrees: {found} instead of {}",
            factor * point
        );
    }
}

#[test]
fn a_distant_point_light_equals_a_directional_light() {
    // The point light is so far away that its light is parallel.
    let way = Vec3::new(0.4, -0.8, 0.1).try_normalize().unwrap();
    let far = 1e5f32;
    let near = |b: SceneBuilder| b.sphere(Vec3::new(0.3, 0.5, 0.0), 0.3, grey(0.4));
    let sun = floor(|b| near(b.directional(way, Vec3::ONE)), &[]);
    let star = floor(|b| near(b.point(-way * far, Vec3::splat(far * far))), &[]);
    assert!(
        (sun.0 / star.0 - 1.0).abs() < 1e-3 && sun.0 > 0.0,
        "{sun:?} {star:?}"
    );
}

#[test]
fn the_caustic_of_a_point_light_equals_that_of_a_small_sphere() {
    // The picture shows only the caustic of a glass ball on the floor. Camera paths can hit the
    // sphere but not the point light. Other tests compare `bdpt` with `bpt` for spheres.
    let glass = Material {
        opacity: 0.0,
        ..WHITE
    };
    let (place, radius, intensity) = (Vec3::new(0.2, 2.5, 0.0), 0.04f32, 3.0);
    let below = |lit: fn(SceneBuilder, Vec3, f32, f32) -> SceneBuilder| {
        let floor = SceneBuilder::new(Vec3::new(1.5, 0.5, 1.5), Vec3::ZERO, 15.0)
            .floor(3.0, 0.0, grey(0.6))
            .sphere(Vec3::Y, 0.3, glass);
        let mut j = job([12, 12], 5, 4);
        j.integrator = integrator("bdpt").unwrap();
        mean_and_error(
            &render(&lit(floor, place, radius, intensity).build(), j, 12_000),
            1,
        )
    };
    let point = below(|b, place, _, intensity| b.point(place, Vec3::splat(intensity)));
    let sphere = below(|b, place, radius, intensity| {
        b.sphere(
            place,
            radius,
            light(intensity / (std::f32::consts::PI * radius * radius)),
        )
    });
    let error = point.1.hypot(sphere.1);
    assert!(
        error < 0.01 * sphere.0,
        "too noisy for this test: {point:?} {sphere:?}"
    );
    // The extent of the sphere blurs the caustic a little.
    assert!(
        (point.0 - sphere.0).abs() < 4.0 * error + 0.01 * sphere.0,
        "{point:?} {sphere:?}"
    );
}
