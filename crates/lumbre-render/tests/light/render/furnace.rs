//! Scenes whose radiance is known in closed form.

use glam::Vec3;
use lumbre_light::scene::compile::Material;
use lumbre_light::scene::desc::{ConeDesc, ConeEdge};

use crate::common::{SceneBuilder, WHITE, grey, job, job_with, light, mean_and_error, render};
use crate::render::agreement::technique;

const EYE: Vec3 = Vec3::new(0.1, 0.2, 0.3);

/// Returns a closed room whose walls emit `e` and reflect `a`.
fn furnace(a: f32, e: f32) -> SceneBuilder {
    SceneBuilder::new(EYE, Vec3::new(0.7, 0.1, -0.4), 70.0).room(
        1.0,
        Material {
            emission: Vec3::splat(e),
            ..grey(a)
        },
    )
}

#[test]
fn the_radiance_of_a_closed_furnace_is_a_geometric_series_of_depth() {
    // Without Russian roulette every path of k edges carries exactly e (1 + a + .. + a^(k-1)),
    // without noise, so a leaking ray changes its pixel. A ray that starts within rounding of a
    // second wall can be lost: about 5 in 10^8 hits were (measured over 6.7e7), so one pixel of the
    // 300,000 hits here may differ.
    let scene = furnace(0.6, 0.5).build();
    for depth in [1u32, 2, 3, 8] {
        let film = render(&scene, job([48, 48], depth, 1), 16);
        let expected = 0.5 * (1.0 - 0.6f64.powi(depth as i32)) / (1.0 - 0.6);
        let wrong = |p: &&[f32; 3]| p.iter().any(|c| (f64::from(*c) - expected).abs() > 1e-5);
        let image = film.mean();
        let lost: Vec<_> = image.data.iter().filter(wrong).collect();
        assert!(
            lost.len() <= 1,
            "depth {depth}: {lost:?} instead of {expected}"
        );
    }
}

#[test]
fn russian_roulette_keeps_the_mean() {
    let scene = furnace(0.8, 1.0).build();
    let mut j = job([32, 32], 200, 2);
    j.settings.rr_start = Some(1);
    let film = render(&scene, j, 64);
    let (mean, error) = mean_and_error(&film, 0);
    assert!(error > 0.0 && error < 0.02, "{error}");
    assert!(
        (mean - 5.0).abs() < 3.0 * error,
        "{mean} +- {error} instead of 5"
    );
}

#[test]
fn lossless_glass_and_mirrors_are_invisible_in_a_furnace() {
    let glass = Material {
        opacity: 0.0,
        ior: 1.5,
        ..WHITE
    };
    let mirror = Material {
        metallic: 1.0,
        ..WHITE
    };
    for (name, material) in [("glass", glass), ("mirror", mirror)] {
        let scene = SceneBuilder::new(Vec3::new(0.0, 0.0, 0.9), Vec3::ZERO, 60.0)
            .room(1.0, light(1.0))
            .sphere(Vec3::ZERO, 0.4, material)
            .build();
        let film = render(&scene, job([64, 64], 64, 3), 16);
        for (i, pixel) in film.mean().data.iter().enumerate() {
            assert!(
                (pixel[1] - 1.0).abs() < 1e-4,
                "{name}, pixel {i}: {pixel:?}"
            );
        }
    }
}

#[test]
fn a_convex_diffuse_sphere_in_a_furnace_shows_its_albedo() {
    let albedo = Material {
        base_color: Vec3::new(0.9, 0.5, 0.1),
        ..WHITE
    };
    let scene = SceneBuilder::new(Vec3::new(0.0, 0.0, 0.9), Vec3::ZERO, 20.0)
        .room(1.0, light(2.0))
        .sphere(Vec3::ZERO, 0.4, albedo)
        .build();
    let film = render(&scene, job([16, 16], 4, 4), 8);
    for pixel in &film.mean().data {
        assert!(
            (Vec3::from_array(*pixel) - Vec3::new(1.8, 1.0, 0.2)).length() < 1e-4,
            "{pixel:?}"
        );
    }
}

#[test]
fn metal_at_normal_incidence_shows_its_colour() {
    let gold = Material {
        base_color: Vec3::new(1.0, 0.7, 0.3),
        metallic: 1.0,
        ..WHITE
    };
    let scene = SceneBuilder::new(Vec3::new(0.0, 0.0, 0.9), Vec3::ZERO, 0.5)
        .room(1.0, light(1.0))
        .sphere(Vec3::ZERO, 0.4, gold)
        .build();
    let film = render(&scene, job([4, 4], 3, 5), 4);
    assert!((Vec3::from_array(film.mean().at(1, 1)) - Vec3::new(1.0, 0.7, 0.3)).length() < 1e-4);
}

#[test]
fn a_white_mixture_of_lobes_conserves_energy() {
    let mixed = Material {
        metallic: 0.3,
        opacity: 0.4,
        ..WHITE
    };
    let scene = SceneBuilder::new(Vec3::new(0.0, 0.0, 0.9), Vec3::ZERO, 40.0)
        .room(1.0, light(1.0))
        .sphere(Vec3::ZERO, 0.4, mixed)
        .build();
    let film = render(&scene, job([32, 32], 256, 6), 64);
    let (mean, error) = mean_and_error(&film, 1);
    // There is noise because paths that refract once and scatter diffusely inside have weights
    // other than one.
    assert!(
        (mean - 1.0).abs() < 3.0 * error.max(1e-5),
        "{mean} +- {error}"
    );
}

#[test]
fn the_radiance_of_a_floor_under_a_sphere_light_has_its_closed_form() {
    // The irradiance under a sphere of radius r at height h is pi L (r / h)^2; the radiance of the
    // floor is a L (r / h)^2.
    let (r, h, a, l) = (0.5f64, 2.0f64, 0.5f64, 3.0f64);
    let scene = SceneBuilder::new(Vec3::new(0.0, 1.0, 4.0), Vec3::ZERO, 0.2)
        .floor(50.0, 0.0, grey(a as f32))
        .sphere(Vec3::Y * h as f32, r as f32, light(l as f32))
        .build();
    let film = render(&scene, job([16, 16], 2, 7), 2048);
    let (mean, error) = mean_and_error(&film, 0);
    let expected = a * l * (r / h) * (r / h);
    assert!(error / expected < 0.01);
    assert!(
        (mean - expected).abs() < 3.0 * error,
        "{mean} +- {error} instead of {expected}"
    );
}

#[test]
fn emission_is_one_sided_and_depth_counts_edges() {
    let panel = |flip: f32| {
        SceneBuilder::new(Vec3::Z * 2.0, Vec3::ZERO, 20.0)
            .quad(
                Vec3::new(-flip, -1.0, 0.0),
                Vec3::X * 2.0 * flip,
                Vec3::Y * 2.0,
                light(4.0),
            )
            .build()
    };
    assert_eq!(
        render(&panel(1.0), job([4, 4], 1, 8), 2).mean().at(2, 2),
        [4.0; 3]
    );
    assert_eq!(
        render(&panel(-1.0), job([4, 4], 8, 8), 2).mean().at(2, 2),
        [0.0; 3]
    );
    // Direct light needs two edges.
    let scene = SceneBuilder::new(Vec3::new(0.0, 0.0, 0.9), Vec3::ZERO, 20.0)
        .room(1.0, light(1.0))
        .sphere(Vec3::ZERO, 0.4, grey(0.5))
        .build();
    assert_eq!(
        render(&scene, job([4, 4], 1, 8), 2).mean().at(2, 2),
        [0.0; 3]
    );
    assert!((render(&scene, job([4, 4], 2, 8), 2).mean().at(2, 2)[0] - 0.5).abs() < 1e-5);
}

#[test]
fn scenes_without_light_or_without_surfaces_are_black() {
    let dark = SceneBuilder::new(EYE, Vec3::X, 60.0)
        .room(1.0, grey(0.5))
        .build();
    let empty = SceneBuilder::new(EYE, Vec3::X, 60.0).build();
    for scene in [dark, empty] {
        assert!(
            render(&scene, job([8, 8], 5, 9), 4)
                .mean()
                .data
                .iter()
                .all(|p| *p == [0.0; 3])
        );
    }
}

/// A convex body in a constant environment shows its albedo. The spot light shines on nothing, but
/// takes half of the choices of a light.
#[test]
fn an_environment_keeps_its_light_beside_others_if_all_lights_are_sampled() {
    let away = ConeDesc {
        beam_deg: 5.0,
        cutoff_deg: 10.0,
        edge: ConeEdge::Linear,
    };
    let scene = SceneBuilder::new(Vec3::Z * 5.0, Vec3::ZERO, 8.0)
        .sphere(Vec3::ZERO, 1.0, grey(0.5))
        .environment(None, Vec3::ONE, 0.0)
        .spot(Vec3::Y * 9.0, Vec3::Y, Vec3::ONE, away)
        .build();
    for name in ["nee", "guided"] {
        for lights in ["one", "all"] {
            let pairs = [("lights", lights.into()), ("select", "uniform".into())];
            let (row, params) = technique(name, &pairs);
            let job = job_with(row, params, job([8, 8], 2, 7));
            let (mean, error) = mean_and_error(&render(&scene, job, 256), 1);
            assert!(error < 0.01, "{name}, {lights}: {error}");
            let off = (mean - 0.5).abs();
            assert!(
                off < 5.0 * error,
                "{name}, {lights}: {mean} +- {error} instead of 0.5"
            );
        }
    }
}
