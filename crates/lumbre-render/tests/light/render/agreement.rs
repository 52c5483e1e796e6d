//! All integrators render the same picture: each compared with a long run of `bpt`, in blocks of
//! pixels and as a whole.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{Vec2, Vec3};
use lumbre_light::film::Film;
use lumbre_light::math::stats::{normal_two_sided_p, sidak};
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{
    Cone, DirectionalLight, Environment, IntensityMap, MapSpace, Material, PointLight, Texture,
};
use lumbre_light::scene::desc::{ConeDesc, ConeEdge};
use lumbre_light::transport::contribution::Contribution;
use lumbre_light::transport::integrator::guided::settings::TRAINING;
use lumbre_light::transport::integrator::settings::DIRECTIONS;
use lumbre_light::transport::integrator::{Context, INTEGRATORS, IntegratorRow, integrator};
use lumbre_light::transport::light::SELECT_FIELD;
use lumbre_light::transport::sampler::Sampler;
use lumbre_light::value::Value;
use lumbre_render::{Job, Renderer, cpu::renderer::CpuRenderer};

use crate::common::{SceneBuilder, WHITE, grey, image_map, job, light, render};

/// Side of the film in pixels.
pub const SIDE: usize = 12;
/// Side of a block in pixels.
const BLOCK: usize = 4;

/// Probability that any comparison of one scene fails by chance alone.
const SIGNIFICANCE: f64 = 0.001;

/// Parameters of an integrator.
pub type Params = BTreeMap<String, Value>;

/// Returns parameters by name.
pub fn params(pairs: &[(&str, Value)]) -> Params {
    pairs
        .iter()
        .map(|(k, v)| ((*k).to_owned(), v.clone()))
        .collect()
}

/// An integrator with its parameters.
pub type Technique = (&'static IntegratorRow, Params);

/// Returns a technique by the name of its table row.
pub fn technique(name: &str, pairs: &[(&str, Value)]) -> Technique {
    (integrator(name).unwrap(), params(pairs))
}

/// Returns every configuration that must agree with `bpt`, and with `nee` for light that `bpt`
/// cannot find: all other unbiased integrators with their variants. How a light is chosen, and how
/// directions are, is left out: `agreement_lights` and `studies` compare them, the latter in scenes
/// without narrow lobes, in which a few bright samples of uniform directions carry the mean.
pub fn variants() -> Vec<Technique> {
    let others = INTEGRATORS.iter().skip(1);
    let unbiased = others.filter(|row| row.bias.is_none());
    unbiased
        .flat_map(|row| {
            let variants = row.params.variants().into_iter();
            let compared_elsewhere = [SELECT_FIELD.key, DIRECTIONS.key];
            let variants = variants.filter(move |params| {
                !compared_elsewhere
                    .iter()
                    .any(|key| params.contains_key(*key))
            });
            std::iter::once(Params::new())
                .chain(variants)
                .map(move |params| (row, with_trained_tree(row, params)))
        })
        .collect()
}

/// Returns parameters with which guided paths have a tree with many leaves in small pictures; those
/// of others are returned as they are.
fn with_trained_tree(row: &IntegratorRow, params: Params) -> Params {
    let trained = [("training", Value::Int(100)), ("split", Value::Num(300.0))];
    let is_guided = row.params.fields.iter().any(|f| f.key == TRAINING.key);
    let trained = if is_guided {
        super::agreement::params(&trained)
    } else {
        Params::new()
    };
    trained.into_iter().chain(params).collect()
}

#[test]
fn variants_are_all_ways_of_finding_the_light() {
    let names: Vec<String> = variants()
        .iter()
        .map(|(row, params)| format!("{} {params:?}", row.name))
        .collect();
    assert!(names.len() >= 15, "{names:?}");
    for expected in [
        "nee {}",
        "nee {\"lights\"",
        "bdpt {\"mis\": Str(\"none\")",
        "guided_bdpt {",
    ] {
        assert!(
            names.iter().any(|name| name.starts_with(expected)),
            "{expected}: {names:?}"
        );
    }
}

/// Settings that all techniques of one comparison share.
#[derive(Clone, Copy)]
pub struct Setting<'a> {
    /// Scene to render.
    pub scene: &'a Arc<CompiledScene>,
    /// Greatest number of edges.
    pub depth: u32,
    /// First edge with Russian roulette.
    pub rr_start: Option<u32>,
    /// Samples for each pixel.
    pub samples: u64,
    /// Greatest relative standard error of the reference's mean for which the test is meaningful.
    pub noise: f64,
}

/// Renders with a technique.
fn picture(
    setting: &Setting,
    (row, params): &Technique,
    seed: u64,
    samples: u64,
) -> Vec<(f64, f64)> {
    let mut j = job([SIDE as u32; 2], setting.depth, seed);
    (j.integrator, j.settings.params, j.settings.rr_start) =
        (row, params.clone(), setting.rr_start);
    if row.has_common_noise() {
        return blocks_by_iteration(setting.scene, j, samples);
    }
    blocks(&render(setting.scene, j, samples))
}

/// Returns the result of [`blocks`] for a technique whose pixels have common noise: errors are those
/// of independent iterations.
fn blocks_by_iteration(scene: &Arc<CompiledScene>, job: Job, samples: u64) -> Vec<(f64, f64)> {
    let mut renderer = CpuRenderer::new(Arc::clone(scene), job).unwrap();
    let (mut sums, mut before) = (Vec::new(), Film::new(SIDE as u32, SIDE as u32));
    for _ in 0..samples {
        assert_eq!(renderer.advance(1).unwrap().invalid, 0);
        let film = renderer.film().clone();
        let mut one = film.clone();
        one.samples = 2;
        for (sum, before) in one.sum.iter_mut().zip(&before.sum) {
            *sum = std::array::from_fn(|c| 2.0 * (sum[c] - before[c]));
        }
        let cells = blocks(&one);
        sums.resize(cells.len(), (0.0, 0.0));
        for (sum, (value, _)) in sums.iter_mut().zip(cells) {
            *sum = (sum.0 + value, sum.1 + value * value);
        }
        before = film;
    }
    let n = samples as f64;
    let moments = sums.iter().map(|(sum, squares)| {
        let mean = sum / n;
        (mean, (squares / n - mean * mean).max(0.0) / (n - 1.0))
    });
    moments.collect()
}

/// Returns the mean and squared standard error of every block and of the whole film, channel by
/// channel.
fn blocks(film: &Film) -> Vec<(f64, f64)> {
    let n = film.samples as f64;
    let cells = SIDE / BLOCK;
    let mut sums = vec![[(0.0, 0.0); 3]; cells * cells + 1];
    for (i, (sum, sum2)) in film.sum.iter().zip(&film.sum2).enumerate() {
        let block = i / SIDE / BLOCK * cells + i % SIDE / BLOCK;
        for c in 0..3 {
            let mean = sum[c] / n;
            let variance = (sum2[c] / n - mean * mean).max(0.0) / (n - 1.0);
            for cell in [block, cells * cells] {
                sums[cell][c].0 += mean;
                sums[cell][c].1 += variance;
            }
        }
    }
    sums.iter()
        .enumerate()
        .flat_map(|(i, cell)| {
            let pixels = if i == cells * cells {
                (SIDE * SIDE) as f64
            } else {
                (BLOCK * BLOCK) as f64
            };
            cell.map(|(mean, variance)| (mean / pixels, variance / (pixels * pixels)))
        })
        .collect()
}

/// Renders the reference with `truth` and eight times the samples, and compares every other
/// technique with it.
pub fn agree(setting: Setting, truth: &Technique, others: &[Technique]) {
    let expected = picture(&setting, truth, 1, 8 * setting.samples);
    let whole = expected[expected.len() - 2];
    assert!(
        whole.0 > 0.0 && whole.1.sqrt() / whole.0 < setting.noise,
        "the reference is too noisy for this test: {whole:?}"
    );
    let level = sidak(SIGNIFICANCE, others.len() * expected.len());
    let mut failures = Vec::new();
    for (i, other) in others.iter().enumerate() {
        let image = picture(&setting, other, 2 + i as u64, setting.samples);
        failures.extend(differences(other, &image, &expected, level));
    }
    assert!(
        failures.is_empty(),
        "level {level:e}:\n{}",
        failures.join("\n")
    );
}

/// Returns the places where two pictures differ by more than their noise.
fn differences(
    other: &Technique,
    image: &[(f64, f64)],
    expected: &[(f64, f64)],
    level: f64,
) -> Vec<String> {
    let mut failures = Vec::new();
    for (place, (a, b)) in image.iter().zip(expected).enumerate() {
        // Images without any noise still differ by rounding.
        let sigma = (a.1 + b.1).sqrt().max(1e-5 * b.0.abs());
        let z = (a.0 - b.0) / sigma;
        if a.0 != b.0 && normal_two_sided_p(z) < level {
            let (row, params) = other;
            failures.push(format!(
                "{} {params:?}, cell {place}: {} instead of {}, z = {z:.1}",
                row.name, a.0, b.0
            ));
        }
    }
    failures
}

/// Compares every technique with `bpt`.
pub fn agree_with_bpt(scene: &Arc<CompiledScene>, depth: u32, rr_start: Option<u32>, samples: u64) {
    agree(
        Setting {
            scene,
            depth,
            rr_start,
            samples,
            noise: 0.01,
        },
        &technique("bpt", &[]),
        &variants(),
    );
}

/// Returns `bpt` restricted to paths of the greatest depth.
fn bpt_at_depth() -> Technique {
    fn sample(
        context: &Context,
        pixel: [u32; 2],
        sampler: &mut Sampler,
        sink: &mut dyn FnMut(Contribution),
    ) {
        let mut keep = |c: Contribution| {
            if c.depth() == context.max_depth {
                sink(c);
            }
        };
        (integrator("bpt").unwrap().sample)(context, pixel, sampler, &mut keep);
    }
    let row = IntegratorRow {
        name: "bpt of one depth",
        sample,
        ..*integrator("bpt").unwrap()
    };
    (Box::leak(Box::new(row)), Params::new())
}

/// Returns the unweighted strategy of `s` light vertices and `t` camera vertices.
fn unweighted(s: u32, t: u32) -> Technique {
    let pair = Value::List(vec![Value::Int(i64::from(s)), Value::Int(i64::from(t))]);
    technique("bdpt", &[("mis", "none".into()), ("strategies", pair)])
}

/// Returns a room with a floor, a wall, and lights of very unequal areas: two triangles and a
/// sphere.
pub fn room(eye: Vec3) -> SceneBuilder {
    let big = [
        Vec3::new(-1.0, 2.0, -1.0),
        Vec3::new(1.0, 2.0, -1.0),
        Vec3::new(-1.0, 2.0, 1.0),
    ];
    let small = [
        Vec3::new(0.5, 1.6, 0.5),
        Vec3::new(0.9, 1.6, 0.5),
        Vec3::new(0.5, 1.6, 1.0),
    ];
    let red = Material {
        base_color: Vec3::new(0.8, 0.3, 0.2),
        ..WHITE
    };
    SceneBuilder::new(eye, Vec3::new(0.0, 0.7, 0.0), 50.0)
        .floor(2.0, 0.0, grey(0.7))
        .quad(
            Vec3::new(-2.0, 0.0, -1.5),
            Vec3::X * 4.0,
            Vec3::Y * 2.5,
            red,
        )
        .triangle(big, [Vec2::ZERO; 3], light(2.0))
        .triangle(small, [Vec2::ZERO; 3], light(9.0))
}

/// Position from which the room is seen.
pub const EYE: Vec3 = Vec3::new(0.2, 1.2, 3.5);

#[test]
fn integrators_agree_on_diffuse_surfaces_under_unequal_lights() {
    let scene = room(EYE)
        .sphere(Vec3::new(-0.9, 0.9, 0.4), 0.25, light(5.0))
        .build();
    agree_with_bpt(&scene, 5, None, 500);
}

/// Uses panels that do not touch: where surfaces meet, the geometry term of a connection is
/// unbounded, and the estimated error of its mean is unreliable.
#[test]
fn every_unweighted_strategy_finds_all_light_of_its_depth() {
    let red = Material {
        base_color: Vec3::new(0.8, 0.3, 0.2),
        ..WHITE
    };
    let mut stage = SceneBuilder::new(Vec3::new(0.1, 0.2, 3.6), Vec3::ZERO, 40.0);
    for (corner, a, b, material) in [
        ([-1.0, 0.0, 1.0], Vec3::X, Vec3::NEG_Z, grey(0.8)),
        ([-1.0, 0.0, -1.0], Vec3::X, Vec3::Z, grey(0.9)),
        ([-1.0, -1.0, 0.0], Vec3::X, Vec3::Y, red),
        ([0.0, -1.0, 1.0], Vec3::NEG_Z, Vec3::Y, grey(0.8)),
        ([0.0, -1.0, -1.0], Vec3::Z, Vec3::Y, grey(0.9)),
    ] {
        let corner = Vec3::from(corner) * 0.8 + a.cross(b) * -1.0;
        stage = stage.quad(corner, a * 1.6, b * 1.6, material);
    }
    let scene = stage
        .quad(
            Vec3::new(-0.4, 0.65, -0.4),
            Vec3::X,
            Vec3::Z * 0.8,
            light(4.0),
        )
        .sphere(Vec3::new(-0.3, -0.4, 0.0), 0.3, light(3.0))
        .build();
    for depth in 1..=4 {
        let strategies: Vec<Technique> =
            (0..=depth).map(|s| unweighted(s, depth + 1 - s)).collect();
        // Few paths of four edges hit a light among so few panels: the error of the reference is
        // 3 %.
        let setting = Setting {
            scene: &scene,
            depth,
            rr_start: None,
            samples: 700,
            noise: 0.03,
        };
        agree(setting, &bpt_at_depth(), &strategies);
    }
}

#[test]
fn integrators_agree_on_caustics_of_mirror_and_glass() {
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
    let scene = room(EYE)
        .sphere(Vec3::new(-0.6, 0.5, 0.0), 0.45, glass)
        .sphere(Vec3::new(0.6, 0.45, 0.2), 0.4, mirror)
        .sphere(Vec3::new(-0.3, 1.4, -0.4), 0.25, light(6.0))
        .build();
    agree_with_bpt(&scene, 7, None, 700);
}

#[test]
fn integrators_agree_on_mixed_lobes_with_russian_roulette() {
    let mixed = Material {
        metallic: 0.3,
        opacity: 0.4,
        base_color: Vec3::new(0.9, 0.7, 0.5),
        ..WHITE
    };
    let scene = room(EYE)
        .sphere(Vec3::new(-0.5, 0.5, 0.0), 0.5, mixed)
        .sphere(Vec3::new(0.6, 1.0, 0.2), 0.25, light(5.0))
        .build();
    agree_with_bpt(&scene, 8, Some(2), 700);
}

#[test]
fn integrators_agree_with_a_thin_lens() {
    let mut scene = Arc::unwrap_or_clone(
        room(EYE)
            .sphere(Vec3::new(-0.9, 0.9, 0.4), 0.25, light(5.0))
            .build(),
    );
    scene.camera.optics = scene.camera.optics.with_aperture(0.4);
    scene.camera.focus_distance = Some(2.5);
    agree_with_bpt(&Arc::new(scene), 4, None, 500);
}

#[test]
fn integrators_agree_on_emitters_that_reflect() {
    let lamp = Material {
        emission: Vec3::new(3.0, 2.0, 1.0),
        ..grey(0.6)
    };
    let scene = room(EYE)
        .quad(
            Vec3::new(-1.9, 0.2, -1.0),
            Vec3::Z * 1.5,
            Vec3::Y * 1.5,
            Material {
                emission: Vec3::ONE,
                ..grey(0.5)
            },
        )
        .sphere(Vec3::new(0.5, 0.5, 0.3), 0.4, lamp)
        .build();
    agree_with_bpt(&scene, 6, None, 500);
}

/// Renders a glass ball and a diffuse ball under a sky with a bright spot, through a thin lens.
#[test]
fn integrators_agree_on_caustics_of_an_environment_map() {
    let texels: Vec<[f32; 3]> = (0..16 * 8)
        .map(|i| {
            if (36..39).contains(&i) {
                [9.0, 8.0, 6.0]
            } else {
                [0.3, 0.4, 0.6]
            }
        })
        .collect();
    let map = Some(Arc::new(Texture::new(16, 8, texels)));
    let glass = Material {
        opacity: 0.0,
        ..WHITE
    };
    let mut scene = Arc::unwrap_or_clone(
        room(EYE)
            .sphere(Vec3::new(-0.6, 0.5, 0.0), 0.45, glass)
            .sphere(Vec3::new(0.6, 0.45, 0.2), 0.4, grey(0.5))
            .build(),
    );
    scene.environment = Some(Environment {
        radiance: Vec3::ONE,
        map,
        rotation_rad: 2.5,
        sampling: Default::default(),
    });
    scene.camera.optics = scene.camera.optics.with_aperture(0.2);
    scene.camera.focus_distance = Some(2.5);
    agree_with_bpt(&Arc::new(scene), 6, None, 400);
}

/// `bpt` cannot find these lights, so `nee` is the reference. It finds them wherever no glass lies
/// between.
#[test]
fn integrators_agree_on_point_and_directional_lights() {
    let mut scene = Arc::unwrap_or_clone(
        room(EYE)
            .sphere(Vec3::new(0.6, 0.45, 0.2), 0.4, grey(0.5))
            .build(),
    );
    let (position, intensity) = (Vec3::new(0.3, 1.5, 0.5), Vec3::splat(1.5));
    // Brighter on one side than on the other, and coloured.
    let side = |i: u32| [0.2 + i as f32, 1.0, 2.0 - 0.4 * i as f32];
    scene
        .textures
        .push(Texture::new(5, 3, (0..15).map(|i| side(i % 5)).collect()));
    let map = IntensityMap {
        texture: scene.textures.len() as u32 - 1,
        mapping: MapSpace::Sphere { rotation_rad: 0.4 },
    };
    for (offset, map) in [(Vec3::ZERO, None), (Vec3::NEG_X, Some(map))] {
        scene.points.push(PointLight {
            position: position + offset,
            intensity,
            cone: Cone::WHOLE,
            map,
        });
    }
    let desc = ConeDesc {
        beam_deg: 30.0,
        cutoff_deg: 60.0,
        edge: ConeEdge::Smooth,
    };
    let cone = Cone::new(Vec3::new(-0.2, -1.0, 0.1), &desc);
    scene.points.push(PointLight {
        position: Vec3::new(-0.6, 1.4, 0.2),
        intensity: 3.0 * intensity,
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
    let setting = Setting {
        scene: &Arc::new(scene),
        depth: 4,
        rr_start: None,
        samples: 500,
        noise: 0.01,
    };
    agree(setting, &technique("nee", &[]), &variants());
}
