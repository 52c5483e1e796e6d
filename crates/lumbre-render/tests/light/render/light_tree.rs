//! Choosing lights by a tree: its probabilities, its coverage of all light, and the pictures of
//! techniques that use it.

use std::sync::Arc;

use glam::{Vec2, Vec3};
use lumbre_light::math::stats::{chi_square_p, sidak};
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::desc::{ConeDesc, ConeEdge};
use lumbre_light::transport::light::{LightSelection, Lights};
use lumbre_light::value::Value;

use crate::common::{SceneBuilder, grey, job, job_with, light};
use crate::render::agreement::{Setting, agree, technique};
use crate::render::consistent_fixtures::{
    assert_degenerate_scenes_render, column, mean_and_error, spread,
};
use crate::render::lights_density::uniform;

/// Returns a point in a cube of side 8 about the origin.
fn point_of(i: u32, stream: u32) -> Vec3 {
    let u = uniform(i, stream);
    Vec3::new(u[0], u[1], u[2]) * 8.0 - Vec3::splat(4.0)
}

/// Returns a cone with a soft edge that ends at an angle in degrees.
fn cone(cutoff: f32) -> ConeDesc {
    ConeDesc {
        beam_deg: 0.7 * cutoff,
        cutoff_deg: cutoff,
        edge: ConeEdge::Linear,
    }
}

/// Returns triangles of all directions, spheres, points and spots, of unequal sizes and powers.
fn lamps(count: u32) -> SceneBuilder {
    let lamp = |i: u32| {
        let (at, u) = (point_of(i, 20), uniform(i, 21));
        let facing = Vec3::new(u[0] - 0.5, u[1] - 0.5, u[2] - 0.5).normalize_or_zero();
        (
            at,
            facing,
            0.01 + 0.1 * u[3] * u[3],
            0.1 + 10.0 * u[4].powi(4),
        )
    };
    let builder = SceneBuilder::new(Vec3::Z * 6.0, Vec3::ZERO, 60.0);
    // Spheres come after all triangles.
    let builder = (0..count)
        .filter(|i| i % 4 < 2)
        .fold(builder, |builder, i| {
            let (at, facing, size, power) = lamp(i);
            let side = facing.any_orthonormal_vector() * size;
            let corners = [at, at + side, at + facing.cross(side)];
            builder.triangle(corners, [Vec2::ZERO; 3], light(power))
        });
    (0..count)
        .filter(|i| i % 4 > 1)
        .fold(builder, |builder, i| {
            let (at, facing, size, power) = lamp(i);
            let intensity = Vec3::splat(0.01 * power);
            match i % 8 {
                3 => builder.point(at, intensity),
                7 => builder.spot(at, facing, intensity, cone(10.0 + 800.0 * size)),
                _ => builder.sphere(at, 0.5 * size, light(power)),
            }
        })
}

#[test]
fn probabilities_sum_to_one_and_are_those_of_the_choice() {
    for (count, distant) in [(1, false), (2, true), (9, false), (300, true), (300, false)] {
        let mut builder = lamps(count);
        if distant {
            builder = builder
                .directional(Vec3::NEG_Y, Vec3::ONE)
                .environment(None, Vec3::ONE, 0.0);
        }
        let scene = builder.build();
        let lights = Lights::with_select(&scene, LightSelection::Tree);
        for k in 0..200 {
            let from = point_of(k, 22) * if k % 10 == 0 { 1000.0 } else { 1.0 };
            let own = |i| f64::from(lights.pdf_direct_choice(lights.id(i), from));
            let total: f64 = lights.indices().map(own).sum();
            assert!((total - 1.0).abs() < 1e-5, "{count} from {from}: {total}");
            for i in 0..20 {
                let chosen =
                    lights.select_for::<f32, 1>(from, uniform(i, 23)[k as usize % 6], true);
                let (probability, own) = (f64::from(chosen.chosen), own(chosen.indices[0]));
                assert!(
                    (probability / own - 1.0).abs() < 1e-5,
                    "{probability} and {own}"
                );
            }
        }
        let n = 200_000;
        for k in 0..3 {
            let from = point_of(k, 24);
            let mut observed = vec![0.0; lights.count()];
            for i in 0..n {
                let chosen = lights.select_for::<f32, 1>(from, uniform(i, 25)[0], true);
                observed[chosen.indices[0] as usize] += 1.0;
            }
            let own = |i| f64::from(n) * f64::from(lights.pdf_direct_choice(lights.id(i), from));
            let expected: Vec<f64> = lights.indices().map(own).collect();
            let p = chi_square_p(&observed, &expected, 0);
            assert!(p > sidak(0.001, 15), "{count} from {from}: {p}");
        }
    }
}

#[test]
fn every_light_that_reaches_a_point_can_be_chosen_there() {
    let scene = lamps(2000).build();
    let lights = Lights::with_select(&scene, LightSelection::Tree);
    let mut reached = 0;
    for k in 0..200 {
        // Far points, ordinary ones, and points next to lamps.
        let from = match k % 4 {
            0 => point_of(k, 26) * 100.0,
            1 => point_of(k % 2000, 20) + Vec3::splat(1e-3),
            _ => point_of(k, 26),
        };
        for i in lights.indices() {
            let [a, b, ..] = uniform(i, 27);
            let found = lights.sample_direct_from(&scene, i, from, [a, b]);
            if found.is_some_and(|d| d.radiance.max_element() > 0.0) {
                reached += 1;
                let own = lights.pdf_direct_choice(lights.id(i), from);
                assert!(own > 0.0, "{:?} from {from}", lights.id(i));
            }
        }
    }
    assert!(reached > 50_000, "{reached}");
}

/// Returns a box with a ball, lit by many small lamps.
fn lit_box() -> Arc<CompiledScene> {
    let side = |i| {
        let u = uniform(i, 29);
        Vec3::new(u[0] - 0.5, u[1] - 0.5, u[2] - 0.5).normalize_or_zero() * 0.04
    };
    let power = |i| light(20.0 * uniform(i, 29)[3]);
    let place = |i| point_of(i, 28) * 0.22;
    let ball = SceneBuilder::new(Vec3::new(0.0, 0.1, 0.95), Vec3::new(0.0, -0.2, 0.0), 60.0)
        .room(1.0, grey(0.6));
    // Spheres come after all triangles.
    let triangles = (0..50).fold(ball, |builder, i| {
        let (at, side) = (place(i), side(i));
        let corners = [at, at + side, at + side.any_orthogonal_vector()];
        builder.triangle(corners, [Vec2::ZERO; 3], power(i))
    });
    let balls = triangles.sphere(Vec3::new(0.1, -0.5, -0.2), 0.4, grey(0.7));
    let spheres = (50..100).fold(balls, |builder, i| builder.sphere(place(i), 0.01, power(i)));
    (100..150)
        .fold(spheres, |builder, i| {
            builder.spot(place(i), side(i), Vec3::splat(0.02), cone(50.0))
        })
        .build()
}

#[test]
fn techniques_render_the_same_picture_with_the_tree() {
    let scene = lit_box();
    let with_tree = |name, more: Option<(&'static str, &str)>| {
        let mut pairs = vec![("select", Value::from("tree"))];
        pairs.extend(more.map(|(key, word)| (key, word.into())));
        technique(name, &pairs)
    };
    let others = [
        with_tree("nee", None),
        with_tree("nee", Some(("mis", "balance"))),
        with_tree("nee", Some(("mis", "none"))),
        with_tree("bdpt", None),
        with_tree("lvc", None),
    ];
    let setting = Setting {
        scene: &scene,
        depth: 4,
        rr_start: None,
        samples: 400,
        noise: 0.01,
    };
    agree(setting, &technique("nee", &[]), &others);
}

/// Renders a floor below a long row of lamps, of which few matter at a point. No lamp is in view.
#[test]
fn the_tree_has_less_noise_than_power_where_lamps_are_many() {
    let floor = SceneBuilder::new(Vec3::new(0.0, 1.0, 2.0), Vec3::ZERO, 60.0).quad(
        Vec3::new(-50.0, 0.0, 2.0),
        Vec3::X * 100.0,
        Vec3::Z * -4.0,
        grey(0.6),
    );
    let scene = (0..400)
        .fold(floor, |builder, i| {
            let at = Vec3::new(i as f32 * 0.25 - 50.0, 1.5, 0.5);
            builder.sphere(at, 0.02, light(50.0))
        })
        .build();
    let variance = |select: &str| {
        let (row, params) = technique("nee", &[("select", select.into())]);
        let job = job_with(row, params, job([16; 2], 2, 1));
        let (mean, error) = mean_and_error(&column(&spread(&scene, &job, 16, 16), 0));
        (error / mean).powi(2)
    };
    let (power, tree) = (variance("power"), variance("tree"));
    println!("power {power:e} tree {tree:e}: {}", power / tree);
    assert!(tree < 0.1 * power, "{tree} and {power}");
}

#[test]
fn scenes_without_light_and_with_one_triangle_render() {
    for name in ["nee", "bdpt", "vcm", "lvc"] {
        let dark = [grey(0.5), light(0.0)];
        assert_degenerate_scenes_render(name, (&dark, 3), &[3], |depth| {
            let (row, params) = technique(name, &[("select", "tree".into())]);
            job_with(row, params, job([8; 2], depth, 1))
        });
    }
}

#[test]
fn a_tree_over_a_hundred_thousand_lights_is_small_and_built_quickly() {
    let scene = lamps(100_000).build();
    let start = std::time::Instant::now();
    let lights = Lights::with_select(&scene, LightSelection::Tree);
    let seconds = start.elapsed().as_secs_f64();
    let bytes = lights.tree.as_ref().unwrap().bytes() / lights.count();
    println!("{seconds} s, {bytes} bytes for each light");
    assert!(bytes <= 256, "{bytes} bytes for each light");
    assert!(seconds < 30.0, "{seconds} s");
}
