//! Traversal compared with brute force.

use std::sync::Arc;

use glam::{Vec2, Vec3};
use lumbre_light::math::rng::{pcg4d, unit};
use lumbre_light::math::warp::uniform_sphere;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{Material, Texture};
use lumbre_light::transport::ray::Ray;
use lumbre_render::cpu::bvh::accel::Accel;

use crate::common::{SceneBuilder, WHITE, grey, job, light, render};

/// Returns a generator of random numbers in 0..1.
pub fn numbers(seed: u32) -> impl FnMut() -> f32 {
    let mut i = 0;
    move || {
        i += 1;
        unit(pcg4d([seed, i, 3, 4])[0])
    }
}

/// Returns a random point in the cube from -1 to 1.
pub fn point(next: &mut impl FnMut() -> f32) -> Vec3 {
    Vec3::new(next(), next(), next()) * 2.0 - 1.0
}

/// Returns triangles of all sizes, including slivers, and spheres.
pub fn soup(seed: u32) -> Arc<CompiledScene> {
    let mut next = numbers(seed);
    let mut b = SceneBuilder::new(Vec3::Z * 3.0, Vec3::ZERO, 50.0);
    for i in 0..300 {
        let a = point(&mut next);
        let size = if i % 3 == 0 { 1.0 } else { 0.1 };
        let e1 = point(&mut next) * size;
        let e2 = if i % 7 == 0 {
            e1 * 0.5 + point(&mut next) * 1e-4
        } else {
            point(&mut next) * size
        };
        b = b.triangle([a, a + e1, a + e2], [Vec2::ZERO; 3], WHITE);
    }
    for _ in 0..30 {
        let c = point(&mut next);
        b = b.sphere(c, 0.02 + 0.2 * next(), WHITE);
    }
    b.build()
}

/// Returns the distance to the nearest primitive in double precision, by testing every primitive.
pub fn brute_force(scene: &CompiledScene, ray: &Ray) -> Option<f64> {
    let o = ray.origin.as_dvec3();
    let d = ray.dir.as_dvec3();
    let mut best: Option<f64> = None;
    let mut keep = |t: f64| {
        if t > 0.0 && best.is_none_or(|b| t < b) {
            best = Some(t);
        }
    };
    for [a, b, c] in &scene.triangles {
        let (e1, e2) = ((*b - *a).as_dvec3(), (*c - *a).as_dvec3());
        let p = d.cross(e2);
        let det = e1.dot(p);
        if det == 0.0 {
            continue;
        }
        let s = o - a.as_dvec3();
        let u = s.dot(p) / det;
        let q = s.cross(e1);
        let v = d.dot(q) / det;
        if u >= 0.0 && v >= 0.0 && u + v <= 1.0 {
            keep(e2.dot(q) / det);
        }
    }
    for s in &scene.spheres {
        let f = o - s.center.as_dvec3();
        let (b, c) = (f.dot(d), f.length_squared() - f64::from(s.radius).powi(2));
        let disc = b * b - c;
        if disc >= 0.0 {
            keep(-b - disc.sqrt());
            keep(-b + disc.sqrt());
        }
    }
    best
}

#[test]
fn nearest_hits_agree_with_brute_force_on_random_soups() {
    let mut hits = 0;
    let mut disagreements = 0;
    for seed in 0..4 {
        let scene = soup(seed);
        let accel = Accel::build(Arc::clone(&scene)).unwrap();
        let mut next = numbers(100 + seed);
        for i in 0..5000 {
            let origin = point(&mut next) * 2.0;
            let axis = [Vec3::X, -Vec3::Y, Vec3::Z][i % 3];
            let dir = if i % 10 == 0 {
                axis
            } else {
                uniform_sphere([next(), next()])
            };
            let ray = Ray { origin, dir };
            let ours = accel.closest(&ray, f32::INFINITY).map(|h| f64::from(h.t));
            let truth = brute_force(&scene, &ray);
            hits += usize::from(truth.is_some());
            // A ray that grazes an edge may hit or miss depending on precision.
            let same = match (ours, truth) {
                (Some(a), Some(b)) => (a - b).abs() < 1e-4 * b.max(1.0),
                (a, b) => a.is_none() == b.is_none(),
            };
            disagreements += usize::from(!same);
            assert_eq!(accel.occluded(&ray, f32::INFINITY), ours.is_some());
            if let Some(t) = ours {
                assert!(
                    !accel.occluded(&ray, t as f32),
                    "the ray is occluded before its nearest hit"
                );
                assert!(accel.closest(&ray, t as f32).is_none());
            }
        }
    }
    assert!(hits > 5000, "{hits}");
    assert!(disagreements <= 4, "{disagreements} of 20000 rays");
}

#[test]
fn rays_through_shared_edges_and_corners_never_leak() {
    // A tessellated wall; rays aim exactly at its vertices and at the middles of its edges.
    let n = 8;
    let mut b = SceneBuilder::new(Vec3::Z, Vec3::ZERO, 60.0);
    let at = |i: i32, j: i32| {
        Vec3::new(
            i as f32 * 0.37 - 1.3,
            j as f32 * 0.29 - 0.9,
            ((i * 7 + j * 3) % 5) as f32 * 0.05,
        )
    };
    for i in 0..n {
        for j in 0..n {
            b = b.triangle(
                [at(i, j), at(i + 1, j), at(i + 1, j + 1)],
                [Vec2::ZERO; 3],
                WHITE,
            );
            b = b.triangle(
                [at(i, j), at(i + 1, j + 1), at(i, j + 1)],
                [Vec2::ZERO; 3],
                WHITE,
            );
        }
    }
    let accel = Accel::build(b.build()).unwrap();
    for i in 1..n {
        for j in 1..n {
            for (di, dj) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                let target = (at(i, j) + at(i + di, j + dj)) * 0.5;
                let inside = i + di < n && j + dj < n;
                for eye in [
                    Vec3::new(0.1, 0.2, 3.0),
                    Vec3::new(-2.0, 1.0, 5.0),
                    Vec3::new(0.3, 0.1, -4.0),
                ] {
                    let ray = Ray {
                        origin: eye,
                        dir: (target - eye).normalize_or_zero(),
                    };
                    assert!(
                        !inside || accel.closest(&ray, f32::INFINITY).is_some(),
                        "{i} {j} {di} {dj} {eye}"
                    );
                }
            }
        }
    }
}

#[test]
fn mask_textures_make_holes() {
    let mut b = SceneBuilder::new(Vec3::Z * 2.0, Vec3::ZERO, 30.0);
    // The left half is opaque and the right half masked out, with an emitting panel behind.
    let mask = b.texture(Texture::new(2, 1, vec![[1.0; 3], [0.0; 3]]));
    let leaf = Material {
        mask_texture: mask,
        ..grey(0.0)
    };
    let scene = b
        .quad(
            Vec3::new(-1.0, -1.0, 0.0),
            Vec3::X * 2.0,
            Vec3::Y * 2.0,
            leaf,
        )
        .quad(
            Vec3::new(-1.0, -1.0, -0.5),
            Vec3::X * 2.0,
            Vec3::Y * 2.0,
            light(1.0),
        )
        .build();
    let image = render(&scene, job([32, 32], 1, 15), 4).mean();
    assert_eq!(image.at(4, 16), [0.0; 3]);
    assert_eq!(image.at(27, 16), [1.0; 3]);
}

#[test]
fn tiny_distant_and_enclosing_spheres_are_hit_at_their_distance() {
    for (center, radius, origin) in [
        (Vec3::new(1000.0, 0.0, 0.0), 0.01f32, Vec3::ZERO),
        (Vec3::ZERO, 100.0, Vec3::new(0.0, 99.9, 0.0)),
        (Vec3::new(0.0, 0.0, -1e4), 9e3, Vec3::ZERO),
    ] {
        let scene = SceneBuilder::new(origin, center, 1.0)
            .sphere(center, radius, WHITE)
            .build();
        let accel = Accel::build(Arc::clone(&scene)).unwrap();
        let dir = (center - origin).normalize_or(Vec3::X);
        let ours = accel
            .closest(&Ray { origin, dir }, f32::INFINITY)
            .unwrap()
            .t;
        let truth = brute_force(&scene, &Ray { origin, dir }).unwrap();
        assert!(
            (f64::from(ours) - truth).abs() < 2e-5 * truth.max(f64::from(radius)),
            "{ours} {truth}"
        );
    }
}
