//! The BSDF at the ends of its parameters: Dirac lobes, matched indices, and extreme random
//! numbers.

use std::sync::Arc;

use glam::Vec3;
use lumbre_light::math::rng::{pcg4d, unit};
use lumbre_light::math::stats::{normal_two_sided_p, sidak};
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{Material, Model};
use lumbre_light::transport::bsdf::{Bsdf, TransportMode};

use crate::common::{SceneBuilder, WHITE, grey, job, light, mean_and_error, render};
use crate::render::bsdf_grid::{DISNEY, NORMAL, bsdf, outgoing, surface, uniform};

/// Returns a sphere over a floor of two shades, under an area light.
fn scene(material: Option<Material>) -> Arc<CompiledScene> {
    let scene = SceneBuilder::new(Vec3::new(0.0, 1.4, 3.2), Vec3::new(0.0, 0.5, 0.0), 38.0)
        .quad(
            Vec3::new(-3.0, 0.0, 3.0),
            Vec3::X * 3.0,
            Vec3::Z * -6.0,
            grey(0.8),
        )
        .quad(
            Vec3::new(0.0, 0.0, 3.0),
            Vec3::X * 3.0,
            Vec3::Z * -6.0,
            grey(0.3),
        )
        .ceiling(1.5, 2.5, light(2.0));
    match material {
        Some(m) => scene.sphere(Vec3::new(0.0, 0.6, 0.0), 0.5, m),
        None => scene,
    }
    .build()
}

/// Checks that pictures of two scenes, with a depth each, agree in every block.
fn assert_same_picture(
    name: &str,
    first: &Arc<CompiledScene>,
    second: &Arc<CompiledScene>,
    depths: [u32; 2],
) {
    let films = [(first, depths[0], 5), (second, depths[1], 6)]
        .map(|(s, d, seed)| render(s, job([16, 16], d, seed), 1500));
    let level = sidak(0.001, 4 * 4 * 3);
    let n = films[0].samples as f64;
    for block in 0..16 {
        for c in 0..3 {
            let [a, b] = films.each_ref().map(|f| {
                let (mut sum, mut variance) = (0.0, 0.0);
                for i in (0..256).filter(|i| i / 64 * 4 + i % 16 / 4 == block) {
                    let (mean, mean2) = (f.sum[i][c] / n, f.sum2[i][c] / n);
                    sum += mean;
                    variance += (mean2 - mean * mean).max(0.0) / (n - 1.0);
                }
                (sum, variance)
            });
            let sigma = (a.1 + b.1).sqrt().max(1e-5 * a.0 + 1e-12);
            assert!(
                normal_two_sided_p((a.0 - b.0) / sigma) > level,
                "{name}, block {block}: {a:?} {b:?}"
            );
        }
    }
    let [a, b] = films.each_ref().map(|f| mean_and_error(f, 1));
    assert!(
        a.0 > 0.0 && a.1 / a.0 < 0.02,
        "too noisy for this test: {a:?} {b:?}"
    );
}

#[test]
fn lobes_just_above_and_below_the_threshold_of_smoothness_look_alike() {
    let base_color = Vec3::new(0.9, 0.8, 0.6);
    for (name, m) in [
        (
            "glass",
            Material {
                opacity: 0.0,
                ..DISNEY
            },
        ),
        (
            "metal",
            Material {
                metallic: 1.0,
                ..DISNEY
            },
        ),
        ("plastic", Material { ior: 2.0, ..DISNEY }),
        (
            "mixture",
            Material {
                metallic: 0.3,
                opacity: 0.5,
                clearcoat: 1.0,
                ..DISNEY
            },
        ),
    ] {
        let with = |roughness| {
            scene(Some(Material {
                base_color,
                roughness,
                ..m
            }))
        };
        assert_same_picture(name, &with(0.010_001), &with(0.009_999), [6, 6]);
    }
}

#[test]
fn glass_of_index_one_is_invisible() {
    for roughness in [0.0, 0.3, 1.0] {
        let m = Material {
            opacity: 0.0,
            ior: 1.0,
            base_color: Vec3::ONE,
            roughness,
            ..DISNEY
        };
        let b = bsdf(&m);
        for wo in outgoing() {
            for i in 0..100 {
                let u = uniform(i, 31);
                let s = b
                    .sample(wo, u[0], [u[1], u[2]], TransportMode::Radiance)
                    .unwrap();
                assert!(
                    s.delta
                        && (s.wi + wo).length() < 1e-5
                        && (s.weight - Vec3::ONE).length() < 1e-5,
                    "{s:?}"
                );
            }
        }
        // Paths cross two surfaces on the way to the floor and two on the way to the light: four
        // more edges.
        assert_same_picture("glass of index 1", &scene(Some(m)), &scene(None), [6, 2]);
        // An index close to 1 gives a narrow lobe that hardly reflects.
        let nearly = Material { ior: 1.002, ..m };
        for i in 0..1000 {
            let u = uniform(i, 32);
            let Some(s) =
                bsdf(&nearly).sample(outgoing()[1], u[0], [u[1], u[2]], TransportMode::Radiance)
            else {
                continue;
            };
            assert!(
                s.wi.dot(-outgoing()[1]) > 0.99 || u[0] < 1e-3,
                "{s:?} {roughness}"
            );
        }
    }
}

/// Returns a number in 0..=1, often at the ends or next to them.
fn extreme(word: u32) -> f32 {
    match word % 12 {
        0 | 1 => 0.0,
        2 | 3 => 1.0,
        4 => 1e-40,
        5 => f32::MIN_POSITIVE,
        6 => 1.0 - f32::EPSILON / 2.0,
        7 => 1e-6,
        _ => unit(word.wrapping_mul(2_654_435_761)),
    }
}

#[test]
fn extreme_parameters_and_random_numbers_give_finite_values_and_densities() {
    let mut sampled = 0;
    for i in 0..100_000u32 {
        let word = |k: u32| pcg4d([i, k, 77, 78]);
        let (a, b, c, d) = (word(0), word(1), word(2), word(3));
        let [e, f] = [word(4), word(5)];
        let iors = [1.0, 1.000_1, 1.001, 1.01, 1.5, 2.5, 100.0, 0.01, 0.5, 0.999];
        let m = Material {
            model: if a[0] % 8 == 0 {
                Model::Lambert
            } else {
                Model::Disney
            },
            base_color: Vec3::new(extreme(a[1]), extreme(a[2]), extreme(a[3])),
            roughness: extreme(b[0]),
            metallic: extreme(b[1]),
            opacity: extreme(b[2]),
            ior: iors[b[3] as usize % iors.len()],
            subsurface: extreme(c[0]),
            specular_tint: extreme(c[1]),
            anisotropic: extreme(c[2]),
            sheen: extreme(c[3]),
            sheen_tint: extreme(d[0]),
            clearcoat: extreme(d[1]),
            clearcoat_gloss: extreme(d[2]),
            smooth_below: if d[3] % 2 == 0 { 0.01 } else { 0.0 },
            ..WHITE
        };
        let mut s = surface(&m);
        let direction = |u: [f32; 2], word: u32| {
            // Four of six directions are grazing or normal.
            let z = match word % 6 {
                0 => 1e-3,
                1 => 1e-7,
                2 => 1e-20,
                3 => 1.0,
                _ => u[0],
            } * if word & 64 == 0 { 1.0 } else { -1.0 };
            let t = NORMAL.any_orthonormal_vector();
            let phi = u[1] * std::f32::consts::TAU;
            let r = (1.0 - z * z).max(0.0).sqrt();
            (NORMAL * z + (t * phi.cos() + NORMAL.cross(t) * phi.sin()) * r).normalize_or(NORMAL)
        };
        if e[0] % 4 == 0 {
            s.n_shading = (NORMAL + direction([0.1, unit(e[1])], 9) * 1.5).normalize_or(NORMAL);
        }
        let wo = direction([unit(e[2]), unit(e[3])], e[0]);
        let wi = direction([unit(f[0]), unit(f[1])], f[2]);
        let bsdf = Bsdf::new(&s, &[]);
        let is_valid =
            |v: Vec3, p: f32| v.is_finite() && v.min_element() >= 0.0 && p.is_finite() && p >= 0.0;
        for mode in [TransportMode::Radiance, TransportMode::Importance] {
            let (f1, p1) = (bsdf.eval(wo, wi, mode), bsdf.pdf_w(wo, wi));
            assert!(is_valid(f1, p1), "{f1} {p1}: {wo} {wi} {m:?}");
            assert!(bsdf.has_density() || (f1 == Vec3::ZERO && p1 == 0.0));
            let u = [extreme(f[3]), extreme(f[0]), extreme(f[1])]
                .map(|u| u.min(1.0 - f32::EPSILON / 2.0));
            if let Some(x) = bsdf.sample(wo, u[0], [u[1], u[2]], mode) {
                assert!(
                    is_valid(x.weight, x.pdf_w) && x.pdf_w > 0.0,
                    "{x:?}: {wo} {m:?}"
                );
                assert!(
                    (x.wi.length() - 1.0).abs() < 1e-4 && x.eta.is_finite() && x.eta > 0.0,
                    "{x:?}: {wo} {m:?}"
                );
                let (f2, p2) = (bsdf.eval(wo, x.wi, mode), bsdf.pdf_w(wo, x.wi));
                assert!(is_valid(f2, p2), "{f2} {p2}: {x:?} {m:?}");
                sampled += 1;
            }
        }
    }
    assert!(sampled > 60_000, "{sampled}");
}
