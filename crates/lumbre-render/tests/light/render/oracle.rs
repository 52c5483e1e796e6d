//! The weights of `bdpt`, `guided_bdpt`, `vcm` and `lvc` compared with their definition, over their
//! paths in scenes of every kind.

use std::sync::Arc;

use glam::{Vec2, Vec3};
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{
    Cone, DirectionalLight, Environment, IntensityMap, MapSpace, Material, Model, PointLight,
    Texture,
};
use lumbre_light::scene::desc::{CameraKind, ConeDesc, ConeEdge};
use lumbre_light::transport::arrival::SurfaceClasses;
use lumbre_light::transport::camera::{Camera, FilterKind, FilterSpec};
use lumbre_light::transport::integrator::oracle::{self, OracleReport};
use lumbre_light::transport::integrator::{Context, Settings};
use lumbre_light::transport::light::{LightSelection, Lights};
use lumbre_light::value::Value;
use lumbre_render::cpu::bvh::accel::Accel;

use crate::common::{SceneBuilder, WHITE, grey, image_map, light};
use crate::render::agreement::{Params, params};
use crate::render::guided::behind_a_wall;

/// Compares the weights of a scene with their definition for every heuristic, and returns the last
/// report.
fn assert_weights_are_exact(scene: &Arc<CompiledScene>, depth: u32) -> OracleReport {
    let mut last = OracleReport::default();
    for (seed, mis) in ["power", "balance", "none"].into_iter().enumerate() {
        let samples = 8000;
        let report = check(scene, FilterSpec::PIXEL, mis, depth, samples, seed as u64);
        assert!(
            report.paths > samples,
            "too few paths for this test: {report:?}"
        );
        assert!(
            report.is_exact() && report.worst_weight < 1e-4,
            "{mis}: {report:?}"
        );
        last = report;
        let tree = params(&[("mis", mis.into()), ("select", "tree".into())]);
        let report = with_context(scene, FilterSpec::PIXEL, &tree, depth, |context| {
            oracle::check(context, samples, seed as u64)
        });
        assert!(report.is_exact(), "{mis} with a tree: {report:?}");
        assert_merging_is_exact(scene, mis, depth, seed as u64);
        assert_cache_is_exact(scene, mis, depth, seed as u64);
        assert_guided_is_exact(scene, mis, depth, seed as u64);
    }
    last
}

/// Compares the weights of `lvc` with their definition, with fewer and more light subpaths than
/// pixels, and with several connections.
fn assert_cache_is_exact(scene: &Arc<CompiledScene>, mis: &str, depth: u32, seed: u64) {
    for (connections, candidates, photons) in [(1, 8, 500), (3, 1, 2000)] {
        let given = params(&[
            ("mis", mis.into()),
            ("connections", Value::Int(connections)),
            ("candidates", Value::Int(candidates)),
            ("photons", Value::Int(photons)),
        ]);
        let samples = 4000;
        let lend = |run: &mut dyn FnMut(&Context)| {
            with_context(scene, FilterSpec::PIXEL, &given, depth, |context| {
                run(context)
            });
        };
        let report = oracle::check_lvc(lend, samples, seed);
        assert!(
            report.paths > samples
                && report.worst_weight < oracle::TOLERANCE
                && report.worst_sum < oracle::TOLERANCE
                && report.rough_densities * 100 <= report.paths
                && report.coarse_densities * 1000 <= report.paths,
            "{mis} {connections} {candidates} {photons}: {report:?}"
        );
    }
}

/// Compares 4000 samples of `guided_bdpt` with their definition, for trees with many leaves and
/// different fractions.
fn guided_reports(
    scene: &Arc<CompiledScene>,
    mis: &str,
    depth: u32,
    seed: u64,
) -> [OracleReport; 2] {
    [(0.5, "variance"), (0.2, "mean")].map(|(fraction, target)| {
        let given = params(&[
            ("mis", mis.into()),
            ("bsdf_fraction", Value::Num(fraction)),
            ("target", target.into()),
            ("training", Value::Int(30)),
            ("split", Value::Num(200.0)),
        ]);
        let lend = |run: &mut dyn FnMut(&Context)| {
            with_context(scene, FilterSpec::PIXEL, &given, depth, |context| {
                run(context)
            });
        };
        oracle::check_guided_bdpt(lend, 4000, seed)
    })
}

/// Compares the weights of `guided_bdpt` with their definition.
fn assert_guided_is_exact(scene: &Arc<CompiledScene>, mis: &str, depth: u32, seed: u64) {
    for report in guided_reports(scene, mis, depth, seed) {
        assert!(
            report.paths > 4000 && report.is_exact() && report.worst_weight < 1e-4,
            "{mis}: {report:?}"
        );
    }
}

/// Compares the weights of `vcm` with their definition, with fewer and more light subpaths than
/// pixels, and with merging alone.
fn assert_merging_is_exact(scene: &Arc<CompiledScene>, mis: &str, depth: u32, seed: u64) {
    // The vertices of merged paths differ by the radius, and so do weights and densities.
    for (join, photons, radius) in [
        ("both", 500, 0.06),
        ("both", 20_000, 0.02),
        ("merge", 768, 0.06),
    ] {
        let given = params(&[
            ("mis", mis.into()),
            ("join", join.into()),
            ("photons", Value::Int(photons)),
            ("radius", Value::Num(radius)),
        ]);
        let samples = 4000;
        let lend = |run: &mut dyn FnMut(&Context)| {
            with_context(scene, FilterSpec::PIXEL, &given, depth, |context| {
                run(context)
            });
        };
        let report = oracle::check_vcm(lend, samples, seed);
        let what = format!("{mis} {join} {photons}");
        // Two vertices of a merged path are taken for one, so that a direction may be below the
        // horizon of either. Without densities that changes the number of strategies.
        assert!(
            report.worst_weight.max(report.worst_merge_weight) < oracle::TOLERANCE
                && report.worst_sum < oracle::TOLERANCE
                && (mis == "none" || report.rough_merged_sums == 0),
            "{what}: {report:?}"
        );
        // There are ten times as many paths as for `bdpt`, and more of them graze surfaces.
        assert!(
            report.rough_densities * 100 <= report.paths
                && report.coarse_densities * 1000 <= report.paths,
            "{what}: {report:?}"
        );
        let merges = report.merges.iter().sum::<u64>();
        assert!(merges > 100, "{what}: too few merges: {:?}", report.merges);
        let [weights, densities] = report.median_merge_errors();
        assert!(
            weights < 2.0 * radius && densities < 2.0 * radius,
            "{what}: {weights} {densities}"
        );
    }
}

fn check(
    scene: &Arc<CompiledScene>,
    filter: FilterSpec,
    mis: &str,
    max_depth: u32,
    samples: u64,
    seed: u64,
) -> OracleReport {
    let given = params(&[("mis", mis.into())]);
    with_context(scene, filter, &given, max_depth, |context| {
        oracle::check(context, samples, seed)
    })
}

/// Calls a function with a context for these parameters.
fn with_context<T>(
    scene: &Arc<CompiledScene>,
    filter: FilterSpec,
    given: &Params,
    max_depth: u32,
    run: impl FnOnce(&Context) -> T,
) -> T {
    let accel = Accel::build(Arc::clone(scene)).unwrap();
    let camera = Camera::new(&scene.camera, [32, 24], filter);
    let lights = Lights::with_select(scene, LightSelection::from_params(given));
    let settings = Settings::new(given);
    let context = Context {
        scene,
        camera: &camera,
        lights: &lights,
        classes: &SurfaceClasses::new(scene),
        trace: &accel,
        max_depth,
        rr_start: None,
        settings: &settings,
        params: given,
        timing: None,
        shared: None,
    };
    run(&context)
}

/// Returns a floor, a wall, an emitting triangle and a textured emitting quad.
fn stage() -> SceneBuilder {
    let corners = [
        Vec3::new(-1.0, 2.0, -1.0),
        Vec3::new(1.0, 2.0, -1.0),
        Vec3::new(-1.0, 2.0, 1.0),
    ];
    let red = Material {
        base_color: Vec3::new(0.8, 0.3, 0.2),
        ..WHITE
    };
    let mut stage = SceneBuilder::new(Vec3::new(0.2, 1.2, 3.5), Vec3::new(0.0, 0.7, 0.0), 50.0)
        .floor(2.0, 0.0, grey(0.7))
        .quad(
            Vec3::new(-2.0, 0.0, -1.5),
            Vec3::X * 4.0,
            Vec3::Y * 2.5,
            red,
        )
        .triangle(corners, [Vec2::ZERO; 3], light(2.0));
    let texels: Vec<[f32; 3]> = (0..64)
        .map(|i| [0.1 + (i % 7) as f32, 1.0, 0.3 * (i % 5) as f32])
        .collect();
    let emission_texture = stage.texture(Texture::new(8, 8, texels));
    let poster = Material {
        emission: Vec3::ONE,
        emission_texture,
        ..grey(0.3)
    };
    stage.quad(
        Vec3::new(-1.9, 0.2, -1.0),
        Vec3::Z * 1.5,
        Vec3::Y * 1.5,
        poster,
    )
}

fn glossy(roughness: f32) -> Material {
    Material {
        model: Model::Disney,
        roughness,
        ..WHITE
    }
}

#[test]
fn weights_are_exact_on_diffuse_surfaces_and_every_strategy_finds_paths() {
    let scene = stage()
        .sphere(Vec3::new(-0.9, 0.9, 0.4), 0.25, light(5.0))
        .sphere(
            Vec3::new(0.6, 0.4, 0.2),
            0.4,
            Material {
                emission: Vec3::ONE,
                ..grey(0.6)
            },
        )
        .build();
    let report = assert_weights_are_exact(&scene, 6);
    assert_eq!(report.dirac_paths, 0);
    for s in 0..=6 {
        for t in 1.max(2 - s.min(1))..=7 - s {
            assert!(
                report.strategies[s][t] > 0,
                "strategy ({s}, {t}) found no path: {:?}",
                report.strategies
            );
        }
    }
}

#[test]
fn weights_are_exact_on_mirror_and_glass() {
    let mirror = Material {
        metallic: 1.0,
        base_color: Vec3::new(0.9, 0.8, 0.7),
        ..WHITE
    };
    let glass = Material {
        opacity: 0.0,
        base_color: Vec3::new(0.9, 1.0, 0.9),
        ..WHITE
    };
    let mixed = Material {
        metallic: 0.3,
        opacity: 0.4,
        base_color: Vec3::new(0.9, 0.7, 0.5),
        ..WHITE
    };
    let scene = stage()
        .sphere(Vec3::new(-0.6, 0.5, 0.0), 0.45, glass)
        .sphere(Vec3::new(0.6, 0.45, 0.2), 0.4, mirror)
        .sphere(Vec3::new(0.0, 0.3, 0.8), 0.3, mixed)
        .sphere(Vec3::new(-0.3, 1.4, -0.4), 0.25, light(6.0))
        .build();
    assert!(assert_weights_are_exact(&scene, 8).dirac_paths > 1000);
}

#[test]
fn weights_are_exact_on_rough_glass_metal_and_coat() {
    let glass = Material {
        opacity: 0.0,
        ..glossy(0.3)
    };
    let metal = Material {
        metallic: 1.0,
        anisotropic: 0.7,
        base_color: Vec3::new(0.9, 0.8, 0.7),
        ..glossy(0.25)
    };
    let coat = Material {
        clearcoat: 1.0,
        clearcoat_gloss: 0.9,
        base_color: Vec3::new(0.2, 0.3, 0.7),
        ..glossy(0.6)
    };
    let scene = stage()
        .sphere(Vec3::new(-0.6, 0.5, 0.0), 0.45, glass)
        .sphere(Vec3::new(0.6, 0.45, 0.2), 0.4, metal)
        .sphere(Vec3::new(0.0, 0.3, 0.8), 0.3, coat)
        .sphere(Vec3::new(-0.3, 1.4, -0.4), 0.25, light(6.0))
        .build();
    assert_weights_are_exact(&scene, 7);
}

/// Returns a picture of a sky with a sun.
fn sky() -> Environment {
    let texels: Vec<[f32; 3]> = (0..32 * 16)
        .map(|i| {
            if i == 32 * 4 + 9 {
                [300.0, 280.0, 200.0]
            } else {
                [0.3, 0.4, 0.6]
            }
        })
        .collect();
    let map = Some(Arc::new(Texture::new(32, 16, texels)));
    Environment {
        radiance: Vec3::ONE,
        map,
        rotation_rad: 0.7,
        sampling: Default::default(),
    }
}

#[test]
fn weights_are_exact_for_environments_directional_lights_and_points() {
    let glass = Material {
        opacity: 0.0,
        ..WHITE
    };
    let mut scene = Arc::unwrap_or_clone(
        stage()
            .sphere(Vec3::new(-0.6, 0.5, 0.0), 0.45, glass)
            .sphere(Vec3::new(0.6, 0.45, 0.2), 0.4, grey(0.5))
            .build(),
    );
    let (position, intensity) = (Vec3::new(0.3, 1.5, 0.5), Vec3::splat(3.0));
    scene.textures.push(Texture::new(
        3,
        1,
        vec![[0.5, 1.0, 2.0], [3.0; 3], [1.0, 0.2, 0.0]],
    ));
    let map = IntensityMap {
        texture: scene.textures.len() as u32 - 1,
        mapping: MapSpace::Sphere { rotation_rad: 0.7 },
    };
    for (offset, map) in [(Vec3::ZERO, None), (Vec3::Z, Some(map))] {
        scene.points.push(PointLight {
            position: position + offset,
            intensity,
            cone: Cone::WHOLE,
            map,
        });
    }
    let desc = ConeDesc {
        beam_deg: 20.0,
        cutoff_deg: 55.0,
        edge: ConeEdge::Linear,
    };
    let cone = Cone::new(Vec3::new(0.3, -1.0, -0.2), &desc);
    scene.points.push(PointLight {
        position: position - Vec3::X,
        intensity,
        cone,
        map: None,
    });
    scene.points.push(PointLight {
        position: Vec3::new(0.1, 1.45, 0.4),
        intensity,
        cone,
        map: Some(image_map(map.texture, &cone, true)),
    });
    let direction = Vec3::new(-0.3, -1.0, -0.4).normalize_or_zero();
    scene.directionals.push(DirectionalLight {
        direction,
        irradiance: Vec3::splat(2.0),
    });
    scene.environment = Some(sky());
    assert_weights_are_exact(&Arc::new(scene), 6);
}

#[test]
fn weights_are_exact_with_a_thin_lens() {
    let mut scene = Arc::unwrap_or_clone(
        stage()
            .sphere(Vec3::new(-0.9, 0.9, 0.4), 0.25, light(5.0))
            .build(),
    );
    scene.camera.optics = scene.camera.optics.with_aperture(0.4);
    scene.camera.focus_distance = Some(2.5);
    scene.environment = Some(sky());
    assert_weights_are_exact(&Arc::new(scene), 5);
}

#[test]
fn weights_are_exact_with_orthographic_and_spherical_cameras() {
    let glass = Material {
        opacity: 0.0,
        ..WHITE
    };
    for kind in [CameraKind::Orthographic, CameraKind::Spherical] {
        let mut scene = Arc::unwrap_or_clone(
            stage()
                .sphere(Vec3::new(-0.9, 0.9, 0.4), 0.25, light(5.0))
                .sphere(Vec3::new(0.6, 0.45, 0.2), 0.4, glass)
                .build(),
        );
        (scene.camera.kind, scene.camera.view_height) = (kind, 3.0);
        if kind == CameraKind::Spherical {
            // Between the floor, the wall and the lights.
            scene.camera.position = Vec3::new(0.2, 1.0, 0.9);
        }
        scene.environment = Some(sky());
        let scene = Arc::new(scene);
        let report = assert_weights_are_exact(&scene, 5);
        for s in 1..=5 {
            let paths = report.strategies[s][1];
            assert!(paths > 0, "{kind:?}: no splats with {s} light vertices");
        }
    }
}

/// A room whose lamp is behind a wall with a gap, and one without the gap, where a lamp on the
/// camera's side is all that trains the tree.
#[test]
fn weights_are_exact_where_light_comes_through_a_gap_or_none() {
    for height in [1.85, 2.0] {
        let scene = behind_a_wall(height)
            .sphere(Vec3::new(-0.5, 0.0, -0.5), 0.1, light(0.5))
            .build();
        for mis in ["power", "balance", "none"] {
            for report in guided_reports(&scene, mis, 6, 3) {
                // Densities of short edges in the corners of the room are rough.
                assert!(
                    report.worst_weight < 1e-4
                        && report.worst_sum < 1e-4
                        && report.rough_densities * 20 <= report.paths
                        && report.coarse_densities * 1000 <= report.paths,
                    "{mis}: {report:?}"
                );
                for s in 0..=4 {
                    for t in 1.max(2 - s.min(1))..=7 - s {
                        let paths = report.strategies[s][t];
                        assert!(paths > 0, "strategy ({s}, {t}) found no path at {height}");
                    }
                }
            }
        }
    }
}

#[test]
fn weights_do_not_depend_on_the_filter() {
    let scene = stage()
        .sphere(Vec3::new(-0.9, 0.9, 0.4), 0.25, light(5.0))
        .build();
    for (kind, radius) in [(FilterKind::Gauss, 1.5), (FilterKind::Box, 0.0)] {
        let report = check(&scene, FilterSpec { kind, radius }, "power", 5, 3000, 7);
        assert!(
            report.worst_weight < oracle::TOLERANCE && report.worst_sum < oracle::TOLERANCE,
            "{report:?}"
        );
        assert!(report.paths > 3000);
        // Pixels without extent have no strategy with one camera vertex.
        let splats: u64 = report
            .strategies
            .iter()
            .filter_map(|by_t| by_t.get(1))
            .sum();
        assert_eq!(splats > 0, radius > 0.0, "{report:?}");
    }
}
