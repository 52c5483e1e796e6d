//! Composed materials, each component with its own delay.

use std::collections::BTreeMap;
use std::fs;
use std::sync::Arc;

use glam::Vec3;
use lumbre_light::film::ztest::{Estimate, compare};
use lumbre_light::scene::compile::NONE;
use lumbre_light::scene::desc::SceneDesc;
use lumbre_light::scene::{CompiledScene, compile};
use lumbre_light::transport::arrival::SurfaceClasses;
use lumbre_light::transport::camera::Camera;
use lumbre_light::transport::integrator::oracle::check;
use lumbre_light::transport::integrator::{Context, INTEGRATORS, Settings};
use lumbre_light::transport::light::Lights;
use lumbre_light::transport::ray::{Hit, Ray, Trace};
use lumbre_light::value::Value;
use lumbre_render::{Job, Renderer};
use lumbre_scene_io::{edit, load};

use crate::common::job;
use crate::common::{render_waves, timed_job, timing};
use crate::transient::arrival::{differing, histogram};

/// Returns two balls under an area light; `materials` extends the list of materials, `ball` is the
/// material of the large ball.
pub fn desc(materials: &str, ball: &str) -> SceneDesc {
    let scene = format!(
        r#"{{ "resolution": [12, 12], "maxdepth": 4,
            "camera": {{ "position": [0, 1, 3.5], "lookat": [0, 0, 0], "fov": 45 }},
            "materials": [ {{ "name": "lamp", "emission": [9, 9, 9] }}, {{ "name": "floor", "model": "lambert", "color": [0.7, 0.7, 0.7] }}
                {materials} ],
            "entities": [
                {{ "type": "sphere", "position": [0, 3.2, 1], "radius": 0.6, "material": "lamp" }},
                {{ "type": "sphere", "position": [0, -101, 0], "radius": 100, "material": "floor" }},
                {{ "type": "sphere", "position": [0, 0, 0], "radius": 1, "material": "{ball}" }} ] }}"#
    );
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("balls.scn");
    fs::write(&file, scene).unwrap();
    let (desc, notes) = load::load(&file).unwrap();
    assert!(notes.is_empty(), "{notes:?}");
    desc
}

/// Materials with and without components and delays.
pub const PARTS: &str = r#",
    { "name": "green", "model": "lambert", "color": [0.1, 0.8, 0.1] },
    { "name": "red", "model": "lambert", "color": [0.9, 0.1, 0.2], "delay": "constant", "delay_constant": 2 },
    { "name": "mean", "model": "lambert", "color": [0.66, 0.31, 0.17] },
    { "name": "leaf", "parts": ["green", "red"], "weights": [0.3, 0.7] },
    { "name": "gloss", "roughness": 0.3, "metallic": 1, "delay": "exponential", "delay_rate": 2 },
    { "name": "nested", "parts": ["leaf", "gloss"], "weights": [0.5, 0.5], "delay": "constant", "delay_constant": 1 },
    { "name": "mirror", "model": "lambert", "metallic": 1, "color": [0.9, 0.9, 0.9] },
    { "name": "pane", "parts": ["mirror", "red", "gloss"], "weights": [0.4, 0.4, 0.2] }"#;

fn compiled(ball: &str) -> Arc<CompiledScene> {
    Arc::new(compile(&desc(PARTS, ball)).unwrap().0)
}

#[test]
fn nested_components_are_flattened_and_their_delays_add_up() {
    let scene = compiled("nested");
    let row = desc(PARTS, "nested").material_index("nested").unwrap() as u32;
    let parts = scene.delays.components(row);
    let cumulative: Vec<f32> = parts.iter().map(|p| p.cumulative_weight).collect();
    assert!(
        cumulative
            .iter()
            .zip([0.15, 0.5, 1.0])
            .all(|(a, b)| (a - b).abs() < 1e-6),
        "{cumulative:?}"
    );
    let profiles: Vec<usize> = parts
        .iter()
        .map(|p| scene.delays.profiles(p).len())
        .collect();
    assert_eq!(
        profiles,
        [1, 2, 2],
        "green has the outer delay only, red and gloss their own as well"
    );
    assert!(
        scene.delays.components(0).is_empty(),
        "a plain material has components"
    );
    let mean = scene.materials[row as usize].base_color;
    assert!(
        (mean - (0.5 * Vec3::new(0.66, 0.31, 0.17) + 0.5 * Vec3::ONE)).length() < 1e-5,
        "{mean}"
    );
}

#[test]
fn a_composed_material_reflects_the_mean_of_its_components_and_keeps_the_delay_of_each() {
    for row in INTEGRATORS {
        let film = |ball: &str, seed: u64, samples: u64| {
            let job = Job {
                integrator: row,
                ..job([12, 12], 4, seed)
            };
            render_waves(&compiled(ball), job, &[samples])
                .film()
                .clone()
        };
        let samples = if row.name == "bpt" { 4000 } else { 400 };
        let (leaf, mean) = (film("leaf", 1, samples), film("mean", 2, samples));
        let [a, b] = [&leaf, &mean].map(|f| (f.mean(), f.variance_of_mean()));
        let test = compare(
            Estimate {
                mean: &a.0,
                variance: &a.1,
            },
            Estimate {
                mean: &b.0,
                variance: &b.1,
            },
            4,
            0.02,
        );
        assert!(
            test.comparisons >= 9 && test.agrees(1e-3, 3),
            "{}: {test:?}",
            row.name
        );
    }
    // Direct light only: delayed light is red, the rest is green, in the ratio of weights (7 to 3)
    // times colours.
    let cube = render_waves(
        &compiled("leaf"),
        timed_job("nee", timing(0.0, 0.05, 400), [12, 12], 2, 3),
        &[6000],
    )
    .times()
    .unwrap();
    let slots = cube.slots(6, 6);
    let lit = slots.iter().position(|s| s[1] > 0.0).unwrap();
    let sum = |range: std::ops::Range<usize>| lumbre_light::film::time::sum_slots(&slots[range]);
    let (early, late) = (sum(0..lit + 39), sum(lit + 39..slots.len()));
    for c in 0..3 {
        let expected = 0.7 * [0.9, 0.1, 0.2][c] / (0.3 * [0.1, 0.8, 0.1][c]);
        assert!(
            (late[c] / early[c] / expected - 1.0).abs() < 0.1,
            "channel {c}: {early:?} {late:?}"
        );
    }
}

#[test]
fn integrators_agree_on_histograms_of_composed_materials() {
    for ball in ["nested", "pane"] {
        let scene = compiled(ball);
        let run = |name: &str, samples: u64| {
            histogram(
                &render_waves(
                    &scene,
                    timed_job(name, timing(4.0, 0.5, 20), [12, 12], 4, 77),
                    &[samples],
                )
                .times()
                .unwrap(),
            )
        };
        let (nee, bdpt, bpt) = (run("nee", 1200), run("bdpt", 500), run("bpt", 6000));
        for other in [bdpt, bpt] {
            let found = differing(&nee, &other, 5e-4);
            assert!(found.is_empty(), "{ball}: {found:?}");
        }
    }
}

/// A traversal that tests every sphere.
struct Brute(Arc<CompiledScene>);

impl Trace for Brute {
    fn closest(&self, ray: &Ray, t_max: f32) -> Option<Hit> {
        let mut nearest: Option<Hit> = None;
        for (i, ball) in self.0.spheres.iter().enumerate() {
            let from = (ray.origin - ball.center).as_dvec3();
            let (b, c) = (
                from.dot(ray.dir.as_dvec3()),
                from.length_squared() - f64::from(ball.radius).powi(2),
            );
            let root = (b * b - c).sqrt();
            for t in [-b - root, -b + root].map(|t| t as f32) {
                if t > 0.0 && t < nearest.map_or(t_max, |h| h.t) {
                    nearest = Some(Hit {
                        t,
                        primitive: (self.0.triangles.len() + i) as u32,
                        instance: NONE,
                        uv: [0.0; 2],
                    });
                }
            }
        }
        nearest
    }

    fn occluded(&self, ray: &Ray, t_max: f32) -> bool {
        self.closest(ray, t_max).is_some()
    }
}

#[test]
fn weights_and_densities_equal_their_definition_with_components_and_delays() {
    for ball in ["leaf", "nested", "pane"] {
        let scene = compiled(ball);
        let camera = Camera::new(&scene.camera, [12, 12], job([1, 1], 1, 0).settings.filter);
        let (lights, settings) = (Lights::new(&scene), Settings::new(&Default::default()));
        let trace = Brute(Arc::clone(&scene));
        let timing = timing(0.0, 0.1, 100);
        let context = Context {
            scene: &scene,
            camera: &camera,
            lights: &lights,
            classes: &SurfaceClasses::new(&scene),
            trace: &trace,
            max_depth: 5,
            rr_start: None,
            settings: &settings,
            params: &BTreeMap::new(),
            timing: Some(&timing),
            shared: None,
        };
        let report = check(&context, 3000, 5);
        assert!(
            report.paths > 1500 && report.is_exact(),
            "{ball}: {report:?}"
        );
    }
}

#[test]
fn invalid_delays_and_weights_are_errors_that_name_the_parameter() {
    let plain = desc(PARTS, "leaf");
    let list = |xs: &[f64]| Value::List(xs.iter().map(|x| Value::number(*x)).collect());
    let cases = [
        (
            "red",
            vec![("delay_constant", Value::Num(-0.5))],
            "materials.red.delay_constant",
            "0 or more",
        ),
        (
            "gloss",
            vec![("delay_rate", Value::Int(0))],
            "materials.gloss.delay_rate",
            "positive",
        ),
        (
            "gloss",
            vec![("delay_rate", Value::Num(-2.0))],
            "materials.gloss.delay_rate",
            "positive",
        ),
        (
            "red",
            vec![
                ("delay", "epanechnikov".into()),
                ("delay_mean", Value::Num(0.4)),
                ("delay_width", Value::Num(0.5)),
            ],
            "materials.red.delay_mean",
            "below the width",
        ),
        (
            "red",
            vec![
                ("delay", "epanechnikov".into()),
                ("delay_width", Value::Int(0)),
            ],
            "materials.red.delay_width",
            "positive",
        ),
        (
            "red",
            vec![("delay", "table".into())],
            "materials.red.delay_table",
            "two pairs",
        ),
        (
            "red",
            vec![
                ("delay", "table".into()),
                ("delay_table", list(&[1.0, 1.0, 0.5, 1.0])),
            ],
            "materials.red.delay_table",
            "must not decrease",
        ),
        (
            "red",
            vec![
                ("delay", "table".into()),
                ("delay_table", list(&[1.0, 0.0, 2.0, 0.0])),
            ],
            "materials.red.delay_table",
            "zero everywhere",
        ),
        (
            "leaf",
            vec![("weights", list(&[0.3, 0.6]))],
            "materials.leaf.weights",
            "their sum is 0.9",
        ),
        (
            "leaf",
            vec![("weights", list(&[1.0]))],
            "materials.leaf.weights",
            "1 weights for 2 parts",
        ),
        (
            "leaf",
            vec![("parts", Value::List(vec!["green".into(), "nested".into()]))],
            "parts",
            "contains itself",
        ),
        (
            "leaf",
            vec![("parts", Value::List(vec!["green".into(), "rad".into()]))],
            "materials.leaf.parts",
            "`red`",
        ),
        (
            "leaf",
            vec![("parts", Value::List(vec!["green".into(), "lamp".into()]))],
            "materials.leaf.parts",
            "emits light",
        ),
        (
            "leaf",
            vec![("emission", list(&[1.0, 0.0, 0.0]))],
            "materials.leaf.emission",
            "cannot emit light",
        ),
    ];
    for (material, changes, place, word) in cases {
        let mut changed = plain.clone();
        for (param, value) in &changes {
            edit::set(
                &mut changed,
                &format!("materials.{material}.{param}"),
                value,
            )
            .unwrap();
        }
        let error = compile(&changed).unwrap_err().to_string();
        assert!(
            error.contains(place) && error.contains(word),
            "{changes:?}: {error}"
        );
    }
}

#[test]
fn unused_delay_parameters_are_not_checked_and_every_change_changes_the_hash() {
    let hash = |change: &str, value: Value| {
        let mut scene = desc(PARTS, "leaf");
        edit::set(&mut scene, change, &value).unwrap();
        compile(&scene).unwrap();
        lumbre_light::scene::desc::content_hash(&scene)
    };
    let plain = lumbre_light::scene::desc::content_hash(&desc(PARTS, "leaf"));
    let numbers = Value::List(vec![Value::Num(0.4), Value::Num(0.6)]);
    let others = [
        hash("materials.leaf.weights", numbers),
        hash("materials.red.delay_constant", Value::Num(1.0)),
        hash("materials.red.delay_constant_offset", Value::Num(1.0)),
        hash("materials.red.delay", "none".into()),
        hash(
            "materials.leaf.parts",
            Value::List(vec!["green".into(), "mean".into()]),
        ),
        hash("materials.green.delay_rate", Value::Num(-1.0)),
    ];
    let mut seen = std::collections::BTreeSet::from([plain]);
    assert!(others.into_iter().all(|h| seen.insert(h)));
}
