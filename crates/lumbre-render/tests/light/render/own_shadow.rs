//! Surfaces do not shadow themselves: walls through the origin of large scenes, and planes that are
//! large beside what stands on them, upright and turned. Each picture is compared with that of a
//! scene where rounding cannot do this, made with the same random numbers.

use std::sync::Arc;

use glam::{Quat, Vec2, Vec3};
use lumbre_light::film::Film;
use lumbre_light::scene::CompiledScene;
use lumbre_light::transport::integrator::{INTEGRATORS, IntegratorRow};
use lumbre_render::Job;

use crate::common::{SceneBuilder, grey, job, light, mean_and_error, render};

/// Side of the film in pixels.
const SIDE: u32 = 16;

/// A turn for which no wall is parallel to an axis.
fn turned() -> Quat {
    Quat::from_axis_angle(Vec3::new(1.0, 2.0, -0.5).normalize_or(Vec3::X), 0.7)
}

/// Returns a corner of a room, at the origin, with walls of the given size in scene units and a
/// lamp in front of them. With `tree`, there are too many triangles for a scene without a tree.
fn corner(size: f32, turn: Quat, tree: bool) -> Arc<CompiledScene> {
    let at = |x: f32, y: f32, z: f32| turn * (Vec3::new(x, y, z) * size);
    let [x, y, z] = [at(1.0, 0.0, 0.0), at(0.0, 1.0, 0.0), at(0.0, 0.0, 1.0)];
    let mut b = SceneBuilder::new(at(0.5, 0.5, 0.5), at(0.0, 0.02, 0.01), 70.0)
        .quad(Vec3::ZERO, y, z, grey(0.6))
        .quad(Vec3::ZERO, z, x, grey(0.7))
        .quad(Vec3::ZERO, x, y, grey(0.5))
        .quad(
            at(0.5, 0.9, 0.3),
            at(0.2, 0.0, 0.0),
            at(0.0, 0.0, 0.3),
            light(9.0),
        );
    if tree {
        for i in 0..200 {
            let z = 2.0 + 0.01 * i as f32;
            let small = [at(2.0, 2.0, z), at(2.01, 2.0, z), at(2.0, 2.01, z)];
            b = b.triangle(small, [Vec2::ZERO; 3], grey(0.5));
        }
    }
    b.build()
}

/// Returns a ball on a plane through the origin that reaches `size` units in all directions, under a
/// lamp.
fn plane(size: f32, turn: Quat) -> Arc<CompiledScene> {
    let at = |x: f32, y: f32, z: f32| turn * Vec3::new(x, y, z);
    SceneBuilder::new(at(0.0, 1.5, 4.0), Vec3::ZERO, 30.0)
        .quad(
            at(-size, 0.0, -size),
            at(0.0, 0.0, 2.0 * size),
            at(2.0 * size, 0.0, 0.0),
            grey(0.7),
        )
        .sphere(at(0.2, 0.4, 0.0), 0.4, grey(0.5))
        .quad(
            at(-0.5, 2.0, -0.5),
            at(1.0, 0.0, 0.0),
            at(0.0, 0.0, 1.0),
            light(9.0),
        )
        .build()
}

fn picture(scene: &Arc<CompiledScene>, row: &'static IntegratorRow, depth: u32) -> Film {
    let job = Job {
        integrator: row,
        ..job([SIDE, SIDE], depth, 5)
    };
    render(scene, job, 32)
}

/// Fails if the means of two pictures differ by more than a flipped decision here and there.
fn assert_equal_means(name: &str, pictures: [Film; 2]) {
    let [(a, error), (b, _)] = pictures.each_ref().map(|film| mean_and_error(film, 1));
    let loss = 1.0 - a / b;
    println!(
        "{name}: {a} of {b}, loss {loss:.2e}, error {:.2e}",
        error / b
    );
    assert!(loss.abs() < 1e-3, "{name}: {a} instead of {b}");
}

#[test]
fn walls_through_the_origin_of_a_large_room_keep_their_light() {
    for row in INTEGRATORS {
        for (turn, name) in [(Quat::IDENTITY, "upright"), (turned(), "turned")] {
            for tree in [false, true] {
                let pictures = [550.0, 1.0].map(|size| picture(&corner(size, turn, tree), row, 3));
                assert_equal_means(&format!("{}, {name}, tree {tree}", row.name), pictures);
            }
        }
    }
}

#[test]
fn planes_that_are_large_beside_what_stands_on_them_keep_their_light() {
    for name in ["bpt", "nee", "bdpt"] {
        let row = INTEGRATORS.iter().find(|row| row.name == name).unwrap();
        for (turn, name) in [(Quat::IDENTITY, "upright"), (turned(), "turned")] {
            // Direct light alone: the smaller plane reflects less.
            let pictures = [1000.0, 8.0].map(|size| picture(&plane(size, turn), row, 2));
            assert_equal_means(&format!("{}, {name}", row.name), pictures);
        }
    }
}
