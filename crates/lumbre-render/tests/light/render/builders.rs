//! Hits and pictures have the same bits with every hierarchy builder.

use std::sync::Arc;

use glam::Vec3;
use lumbre_light::scene::CompiledScene;
use lumbre_render::cpu::bvh::accel::Accel;
use lumbre_render::cpu::bvh::simd::Isa;
use lumbre_render::hierarchy::{AccelSpec, Builder, Quality};

use crate::common::{SceneBuilder, WHITE, grey, light, named_job, render};
use crate::render::instructions::{rays, stack};
use crate::render::intersection::{numbers, point, soup};

/// Returns every builder, with the ends of its parameters.
fn specs() -> Vec<AccelSpec> {
    let plain = AccelSpec::default();
    let mut specs: Vec<AccelSpec> = Builder::ALL
        .map(|builder| AccelSpec { builder, ..plain })
        .into();
    for builder in [Builder::Plane, Builder::Sah] {
        specs.push(AccelSpec {
            builder,
            max_depth: 3,
            ..plain
        });
        specs.push(AccelSpec {
            builder,
            max_leaf: 1,
            ..plain
        });
    }
    for bins in [2, 64] {
        specs.push(AccelSpec {
            builder: Builder::Sah,
            bins,
            ..plain
        });
    }
    for quality in Quality::ALL {
        specs.push(AccelSpec { quality, ..plain });
        specs.push(AccelSpec {
            builder: Builder::Cwbvh,
            quality,
            ..plain
        });
    }
    specs.push(AccelSpec {
        max_leaf: 1,
        ..plain
    });
    specs
}

fn accel(scene: &Arc<CompiledScene>, spec: &AccelSpec) -> Accel {
    Accel::build_as(Arc::clone(scene), spec, Isa::detect()).unwrap()
}

/// Returns small triangles and oblique slats, which `ploc` and `cwbvh` cut into parts.
fn slats() -> Arc<CompiledScene> {
    let mut next = numbers(21);
    let mut b = SceneBuilder::new(Vec3::Z * 3.0, Vec3::ZERO, 50.0);
    for i in 0..600 {
        let at = point(&mut next);
        let small = [
            at,
            at + point(&mut next) * 0.03,
            at + point(&mut next) * 0.03,
        ];
        let at = Vec3::new(1.0, -1.0, 0.2) * (i as f32 / 300.0 - 1.0);
        let along = Vec3::new(1.0, 1.1, 0.9);
        let long = [at - along, at + along, at + Vec3::new(0.02, 0.0, 0.03)];
        for corners in [small, long] {
            b = b.triangle(corners, [glam::Vec2::ZERO; 3], WHITE);
        }
    }
    b.build()
}

#[test]
fn cut_triangles_cost_less() {
    let scene = slats();
    for builder in [Builder::Ploc, Builder::Cwbvh] {
        let [whole, cut] = [Quality::Fastest, Quality::VeryFast].map(|quality| {
            let spec = AccelSpec {
                builder,
                quality,
                ..AccelSpec::default()
            };
            let accel = accel(&scene, &spec);
            (accel.cost(), accel.bytes() as f64)
        });
        assert!(cut.0 < 0.75 * whole.0, "{builder:?} {cut:?} {whole:?}");
        assert!(
            cut.1 > whole.1 && cut.1 < 1.6 * whole.1,
            "{builder:?} {cut:?} {whole:?}"
        );
    }
}

#[test]
fn hits_have_the_same_bits_with_every_builder() {
    let (mut hits, mut missed, mut tested) = (0, 0, 0);
    let scenes = [
        (soup(3), Vec3::ZERO),
        (slats(), Vec3::ZERO),
        (soup(4), Vec3::ZERO),
        (stack(0.0), Vec3::ZERO),
        (stack(3e5), Vec3::new(3e5, 0.0, 3e5)),
    ];
    for (scene, center) in scenes {
        let truth = accel(
            &scene,
            &AccelSpec {
                builder: Builder::None,
                ..AccelSpec::default()
            },
        );
        assert_eq!(truth.node_count(), 0, "a scene without hierarchy has nodes");
        assert_eq!(truth.cost(), scene.primitive_count() as f64);
        for spec in specs() {
            let accel = accel(&scene, &spec);
            for (i, ray) in rays(&scene, center, 8).into_iter().enumerate() {
                let expected = truth.closest(&ray, f32::INFINITY);
                hits += usize::from(expected.is_some());
                // A ray that aims at a corner may pass a box by less than the tolerance of the
                // triangle test.
                if i < 3000 && i % 6 == 2 {
                    tested += 1;
                    missed += usize::from(accel.closest(&ray, f32::INFINITY) != expected);
                    continue;
                }
                assert_eq!(
                    accel.closest(&ray, f32::INFINITY),
                    expected,
                    "{spec:?} {ray:?}"
                );
                for t_max in [f32::INFINITY, 0.7, expected.map_or(1.0, |h| h.t)] {
                    assert_eq!(
                        accel.occluded(&ray, t_max),
                        truth.occluded(&ray, t_max),
                        "{spec:?} {ray:?} {t_max}"
                    );
                }
            }
        }
    }
    assert!(hits > 40_000, "{hits}");
    assert!(
        tested > 20_000 && missed * 200 < tested,
        "{missed} of {tested}"
    );
}

#[test]
fn pictures_have_the_same_bits_with_every_builder() {
    let scene = SceneBuilder::new(Vec3::new(0.0, 0.0, 2.9), Vec3::ZERO, 50.0)
        .room(3.0, grey(0.6))
        .quad(
            Vec3::new(-1.0, 2.9, 1.0),
            Vec3::X * 2.0,
            Vec3::NEG_Z * 2.0,
            light(6.0),
        )
        .with(|s| {
            let mut own = (*soup(11)).clone();
            let first = s.materials.len() as u32;
            s.materials.push(grey(0.7));
            own.attributes.iter_mut().for_each(|a| a.material = first);
            s.triangles.extend(own.triangles);
            s.attributes.extend(own.attributes);
            (0..own.normals.len() as u32).for_each(|i| s.normals.push(own.normals.at(i)));
            s.uvs.extend(own.uvs);
        })
        .build();
    let with = |spec: AccelSpec| {
        let bdpt = named_job("bdpt", [24, 24], 4, 5).with(|settings| settings.accel = spec);
        render(&scene, bdpt, 2)
    };
    let expected = with(AccelSpec::default());
    assert!(expected.sum.iter().flatten().sum::<f64>() > 0.0);
    for builder in Builder::ALL {
        let film = with(AccelSpec {
            builder,
            ..AccelSpec::default()
        });
        assert!(
            film.sum == expected.sum && film.sum2 == expected.sum2,
            "{builder:?}"
        );
    }
}

#[test]
fn costs_order_the_builders_and_their_settings() {
    let scene = soup(12);
    let cost = |spec: AccelSpec| accel(&scene, &spec).cost();
    let plain = AccelSpec::default();
    let by = |builder| cost(AccelSpec { builder, ..plain });
    let (plane, sah, ploc) = (by(Builder::Plane), by(Builder::Sah), by(Builder::Ploc));
    assert!(by(Builder::None) > 3.0 * plane, "{plane}");
    assert!(
        plane > sah && sah < 1.3 * ploc && ploc < 1.3 * sah,
        "{plane} {sah} {ploc}"
    );
    let shallow = cost(AccelSpec {
        builder: Builder::Sah,
        max_depth: 2,
        ..plain
    });
    assert!(shallow > 1.5 * sah, "{shallow} {sah}");
    assert!(
        cost(AccelSpec {
            builder: Builder::Sah,
            bins: 2,
            ..plain
        }) > sah
    );
}

#[test]
fn larger_leaves_give_fewer_nodes_and_a_higher_cost() {
    // A lattice of small triangles, all of different side lengths: every builder can divide it down
    // to single triangles.
    let mut b = SceneBuilder::new(Vec3::Z * 20.0, Vec3::ZERO, 40.0);
    for i in 0..512 {
        let at = Vec3::new(
            (i % 8) as f32,
            (i / 8 % 8) as f32 * 1.07,
            (i / 64) as f32 * 1.13,
        );
        b = b.triangle(
            [at, at + Vec3::X * 0.3, at + Vec3::new(0.0, 0.3, 0.3)],
            [glam::Vec2::ZERO; 3],
            grey(0.5),
        );
    }
    let scene = b.build();
    for builder in [Builder::Plane, Builder::Sah] {
        let of = |max_leaf: u32| {
            accel(
                &scene,
                &AccelSpec {
                    builder,
                    max_leaf,
                    ..AccelSpec::default()
                },
            )
        };
        let (fine, plain, coarse) = (of(1), of(8), of(64));
        let nodes = [&fine, &plain, &coarse].map(Accel::node_count);
        assert!(nodes[0] > nodes[2] && nodes[2] > 0, "{builder:?} {nodes:?}");
        assert!(
            coarse.cost() > 1.2 * plain.cost(),
            "{builder:?} {} {}",
            coarse.cost(),
            plain.cost()
        );
    }
    let of = |max_leaf: u32| {
        let spec = AccelSpec {
            builder: Builder::Cwbvh,
            max_leaf,
            ..AccelSpec::default()
        };
        accel(&scene, &spec).node_count()
    };
    assert!(
        of(1) >= of(3) && of(3) == of(8),
        "{} {} {}",
        of(1),
        of(3),
        of(8)
    );
}

#[test]
fn equal_centroids_give_one_leaf_and_deep_trees_are_traversed() {
    // Forty triangles with the same centroid, so no plane separates them.
    let mut b = SceneBuilder::new(Vec3::Z, Vec3::ZERO, 40.0);
    for i in 0..40 {
        let size = 1.0 + i as f32;
        b = b.triangle(
            [
                Vec3::new(-size, -size, 0.0),
                Vec3::new(size, -size, 0.0),
                Vec3::new(0.0, 2.0 * size, 0.0),
            ],
            [glam::Vec2::ZERO; 3],
            grey(0.5),
        );
    }
    let scene = b.build();
    for builder in [Builder::Plane, Builder::Sah] {
        assert_eq!(
            accel(
                &scene,
                &AccelSpec {
                    builder,
                    ..AccelSpec::default()
                }
            )
            .node_count(),
            0
        );
    }
    assert_eq!(
        accel(
            &scene,
            &AccelSpec {
                builder: Builder::Sah,
                max_depth: 0,
                ..AccelSpec::default()
            }
        )
        .node_count(),
        0
    );
    // Each coordinate is less than half of the previous one: every median cut separates one
    // triangle.
    let mut b = SceneBuilder::new(Vec3::Z, Vec3::ZERO, 40.0);
    for i in 0..100 {
        let x = 0.45f32.powi(i) * 1e10;
        let corners = [
            Vec3::new(x, -1.0, -1.0),
            Vec3::new(x, 1.0, -1.0),
            Vec3::new(x, 0.0, 1.0),
        ];
        b = b.triangle(corners, [glam::Vec2::ZERO; 3], grey(0.5));
    }
    let scene = b.build();
    let chain = AccelSpec {
        builder: Builder::Plane,
        max_leaf: 1,
        max_depth: 200,
        ..AccelSpec::default()
    };
    let deep = accel(&scene, &chain);
    assert!(deep.node_count() >= 4, "{}", deep.node_count());
    for i in 0..99 {
        let origin = Vec3::X * (scene.triangles[i][0].x * 0.9);
        let hit = deep.closest(
            &lumbre_light::transport::ray::Ray {
                origin,
                dir: Vec3::X,
            },
            f32::INFINITY,
        );
        assert_eq!(hit.map(|h| h.primitive), Some(i as u32));
    }
}

#[test]
fn scenes_whose_clustered_tree_is_too_deep_get_a_shallow_one() {
    let mut b = SceneBuilder::new(Vec3::Z, Vec3::ZERO, 40.0);
    for i in 0..20_000 {
        let size = 1.0 + i as f32 * 1e-3;
        let corners = [
            Vec3::new(size, 0.0, 0.0),
            Vec3::new(-0.5 * size, 0.866 * size, 0.0),
            Vec3::new(-0.5 * size, -0.866 * size, 0.0),
        ];
        b = b.triangle(corners, [glam::Vec2::ZERO; 3], grey(0.5));
    }
    let scene = b.build();
    for builder in [Builder::Ploc, Builder::Cwbvh] {
        let spec = AccelSpec {
            builder,
            ..AccelSpec::default()
        };
        let built = accel(&scene, &spec);
        // A chain has at least one node for seven triangles.
        assert!(
            built.node_count() < 2000,
            "{builder:?} {}",
            built.node_count()
        );
        // All triangles lie in one plane. The last 1,000 contain this point, and the tie goes to
        // one of them.
        let ray = lumbre_light::transport::ray::Ray {
            origin: Vec3::new(20.0, 0.0, 1.0),
            dir: Vec3::NEG_Z,
        };
        let hit = built.closest(&ray, f32::INFINITY).map(|hit| hit.primitive);
        assert!(hit.is_some_and(|i| i >= 19_000), "{hit:?}");
    }
}
