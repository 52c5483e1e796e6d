//! Traversal returns the same bits with every instruction set of this processor.

use std::sync::Arc;

use glam::{Vec2, Vec3};
use lumbre_light::math::warp::uniform_sphere;
use lumbre_light::scene::CompiledScene;
use lumbre_light::transport::ray::{Hit, Ray, Trace};
use lumbre_render::cpu::bvh::accel::Accel;
use lumbre_render::cpu::bvh::simd::Isa;
use lumbre_render::hierarchy::AccelSpec;

use crate::common::{SceneBuilder, WHITE, grey};
use crate::render::intersection::{brute_force, numbers, point, soup};

/// Returns flat sheets on top of each other, some of them twice, far from the origin.
pub fn stack(offset: f32) -> Arc<CompiledScene> {
    let mut b = SceneBuilder::new(Vec3::Z, Vec3::ZERO, 40.0);
    for i in 0..40 {
        let z = offset + (i / 2) as f32 * 0.125;
        b = b.quad(
            Vec3::new(offset - 1.0, -1.0, z),
            Vec3::X * 2.0,
            Vec3::Y * 2.0,
            grey(0.1),
        );
    }
    b.build()
}

/// Returns random triangles and spheres; up to 40 of them are one leaf.
fn random_primitives(count: u32) -> Arc<CompiledScene> {
    let mut next = numbers(count);
    let mut b = SceneBuilder::new(Vec3::Z, Vec3::ZERO, 40.0);
    for i in 0..count {
        let a = point(&mut next);
        b = if i % 5 == 4 {
            b.sphere(a, 0.3, WHITE)
        } else {
            b.triangle(
                [a, a + point(&mut next), a + point(&mut next)],
                [Vec2::ZERO; 3],
                WHITE,
            )
        };
    }
    b.build()
}

/// Returns rays into a scene about `center`: random, along an axis, within a plane, at corners, and
/// invalid ones.
pub fn rays(scene: &CompiledScene, center: Vec3, seed: u32) -> Vec<Ray> {
    let mut next = numbers(seed);
    let mut rays: Vec<Ray> = (0..3000)
        .map(|i| {
            let origin = center + point(&mut next) * 2.0;
            let any = uniform_sphere([next(), next()]);
            let corner = scene
                .triangles
                .get(i % scene.triangles.len().max(1))
                .map_or(center, |t| t[i % 3]);
            let dir = match i % 6 {
                0 => [Vec3::X, -Vec3::Y, Vec3::Z, -Vec3::Z][i / 6 % 4],
                1 => Vec3::new(any.x, 0.0, any.z).normalize_or(Vec3::X),
                2 => (corner - origin).normalize_or(Vec3::X),
                _ => any,
            };
            Ray { origin, dir }
        })
        .collect();
    for dir in [
        Vec3::ZERO,
        Vec3::NAN,
        Vec3::new(f32::NAN, 1.0, 0.0),
        Vec3::new(1e-30, 1.0, -0.0),
    ] {
        rays.push(Ray {
            origin: center,
            dir,
        });
        rays.push(Ray {
            origin: Vec3::splat(f32::NAN),
            dir,
        });
        rays.push(Ray {
            origin: Vec3::splat(f32::INFINITY),
            dir,
        });
    }
    rays
}

fn bits(hit: Option<Hit>) -> Option<[u32; 4]> {
    hit.map(|h| {
        [
            h.t.to_bits(),
            h.primitive,
            h.uv[0].to_bits(),
            h.uv[1].to_bits(),
        ]
    })
}

#[test]
fn hits_have_the_same_bits_with_every_instruction_set() {
    if Isa::available().len() < 2 {
        crate::common::skipped(format_args!(
            "this processor has only {:?}",
            Isa::available()
        ));
        return;
    }
    let scenes = [
        (soup(7), Vec3::ZERO),
        (stack(0.0), Vec3::ZERO),
        (stack(3e5), Vec3::new(3e5, 0.0, 3e5)),
    ];
    let small = [0, 1, 5, 8, 9, 17, 40, 41].map(|n| (random_primitives(n), Vec3::ZERO));
    let mut hits = 0;
    for (scene, center) in scenes.into_iter().chain(small) {
        let accels = Isa::available()
            .iter()
            .map(|isa| Accel::build_as(Arc::clone(&scene), &AccelSpec::default(), *isa).unwrap());
        let accels: Vec<Accel> = accels.collect();
        for ray in rays(&scene, center, 5) {
            let expected = accels[0].closest(&ray, f32::INFINITY);
            hits += usize::from(expected.is_some());
            for accel in &accels[1..] {
                assert_eq!(
                    bits(accel.closest(&ray, f32::INFINITY)),
                    bits(expected),
                    "{ray:?}"
                );
                for t_max in [f32::INFINITY, 0.7, expected.map_or(1.0, |h| h.t)] {
                    assert_eq!(
                        accel.occluded(&ray, t_max),
                        accels[0].occluded(&ray, t_max),
                        "{ray:?} {t_max}"
                    );
                }
            }
        }
    }
    assert!(hits > 5000, "{hits}");
}

/// Returns scenes with the points that their rays surround.
fn scenes() -> [(Arc<CompiledScene>, Vec3); 4] {
    [
        (soup(7), Vec3::ZERO),
        (stack(3e5), Vec3::new(3e5, 0.0, 3e5)),
        (random_primitives(300), Vec3::ZERO),
        // More than 2 MiB, from which rays are traversed in turn for any hit.
        (random_primitives(40_000), Vec3::ZERO),
    ]
}

#[test]
fn many_rays_have_the_hits_of_single_rays() {
    let mut found = [0; 2];
    for (scene, center) in scenes() {
        for isa in Isa::available() {
            let accel = Accel::build_as(Arc::clone(&scene), &AccelSpec::default(), *isa).unwrap();
            let limits = [f32::INFINITY, 0.7, 0.0, -1.0, 2.0];
            let rays = rays(&scene, center, 9);
            let queries: Vec<(Ray, f32)> =
                rays.into_iter().zip(limits.into_iter().cycle()).collect();
            // Fewer rays than are traversed in turn, as many, more, and all.
            let mut rest = queries.as_slice();
            for count in [0, 1, 2, 3, 4, 5, 6, 9, usize::MAX] {
                let (some, others) = rest.split_at(count.min(rest.len()));
                rest = others;
                // The results are appended.
                let (mut hits, mut hidden) = (vec![None; 2], vec![true; 2]);
                accel.closest_each(some, &mut hits);
                accel.occluded_each(some, &mut hidden);
                assert_eq!([hits.len(), hidden.len()], [some.len() + 2; 2]);
                assert!(hidden[0] && hits[0].is_none());
                for (i, (ray, t_max)) in some.iter().enumerate() {
                    assert_eq!(
                        bits(hits[i + 2]),
                        bits(accel.closest(ray, *t_max)),
                        "{i} {ray:?}"
                    );
                    assert_eq!(hidden[i + 2], accel.occluded(ray, *t_max), "{i} {ray:?}");
                    found[usize::from(hidden[i + 2])] += 1;
                }
            }
            assert!(rest.is_empty());
        }
    }
    assert!(found[0] > 1000 && found[1] > 1000, "{found:?}");
}

/// Bundles of rays from one place, from places near each other, and towards one point, of which some
/// pass a primitive on different sides and some end at once.
#[test]
fn rays_that_travel_together_have_the_hits_of_single_rays() {
    let mut found = [0; 2];
    for (scene, center) in scenes() {
        let mut numbers = numbers(5);
        let mut next = || numbers() - 0.5;
        let mut bundles: Vec<(Ray, f32)> = Vec::new();
        for (i, base) in rays(&scene, center, 5).into_iter().enumerate() {
            let spread = [1e-4, 0.02, 0.3][i % 3];
            let to = base.origin + base.dir * 3.0;
            // More than a vector, and no multiple of one.
            for lane in 0..35 {
                let mut jitter = || Vec3::new(next(), next(), next()) * spread;
                let (a, b) = (jitter(), jitter());
                let (origin, to) = match i % 4 {
                    0 => (base.origin, to + a),
                    1 => (base.origin + a, to),
                    2 => (base.origin + a, to + b),
                    _ => (base.origin, to),
                };
                let dir = (to - origin).normalize_or(base.dir);
                let t_max = match (i % 5, lane % 7) {
                    (0, 0) => 0.0,
                    (1, _) => 2.0 + next(),
                    _ => f32::INFINITY,
                };
                bundles.push((Ray { origin, dir }, t_max));
            }
        }
        for isa in Isa::available() {
            let accel = Accel::build_as(Arc::clone(&scene), &AccelSpec::default(), *isa).unwrap();
            let (mut hits, mut hidden) = (Vec::new(), Vec::new());
            // As tiles arrive.
            for some in bundles.chunks(350) {
                accel.closest_each(some, &mut hits);
                accel.occluded_each(some, &mut hidden);
            }
            for (i, (ray, t_max)) in bundles.iter().enumerate() {
                let expected = accel.closest(ray, *t_max);
                assert_eq!(bits(hits[i]), bits(expected), "{i} {ray:?}");
                assert_eq!(hidden[i], expected.is_some(), "{i} {ray:?}");
                found[usize::from(hidden[i])] += 1;
            }
        }
    }
    assert!(found[0] > 10_000 && found[1] > 10_000, "{found:?}");
}

#[test]
fn scenes_of_one_leaf_agree_with_brute_force() {
    let mut disagreements = 0;
    for count in [1, 7, 8, 9, 16, 17, 30, 39, 40, 41, 64, 65] {
        let scene = random_primitives(count);
        let accel = Accel::build(Arc::clone(&scene)).unwrap();
        let one_leaf = count as usize <= accel.isa().one_leaf();
        assert_eq!(accel.node_count() == 0, one_leaf, "{count}");
        // A ray aimed at a corner may hit or miss depending on precision.
        let usual = rays(&scene, Vec3::ZERO, count)
            .into_iter()
            .take(3000)
            .enumerate()
            .filter(|(i, _)| i % 6 != 2);
        for (_, ray) in usual {
            let ours = accel.closest(&ray, f32::INFINITY).map(|h| f64::from(h.t));
            let same = match (ours, brute_force(&scene, &ray)) {
                (Some(a), Some(b)) => (a - b).abs() < 1e-4 * b.max(1.0),
                (a, b) => a.is_none() == b.is_none(),
            };
            disagreements += usize::from(!same);
        }
    }
    assert!(disagreements <= 4, "{disagreements} of 30000 rays");
}
