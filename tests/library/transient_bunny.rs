//! The Stanford bunny in `scenes/hare_box.lua`, with a material whose pattern delays light.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use lumbre_light::film::time::TimeCube;
use lumbre_light::scene::compile;
use lumbre_light::value::Value;
use lumbre_lua::scene;
use lumbre_render::Renderer;
use lumbre_scene_io::edit;
use lumbre_scene_io::load::MissingTextures;

use crate::common::shared;
use crate::common::{render_waves, timed_job, timing};

const SIZE: u32 = 100;

/// Renders paths with one reflection. White parts of the bunny's pattern delay light by `delay`.
fn cube(bunny: &str, delay: f64) -> TimeCube {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/hare_box.lua");
    let options: BTreeMap<String, Value> = [("hare", "patches"), ("bunny", bunny)]
        .map(|(key, value)| (key.to_owned(), Value::from(value)))
        .into();
    let (mut desc, _) = scene::read(&file, &options, MissingTextures::Fail).unwrap();
    edit::set(
        &mut desc,
        "materials.hare.delay_constant",
        &Value::from(delay),
    )
    .unwrap();
    let (scene, notes) = compile(&desc).unwrap();
    assert_eq!(
        (scene.triangles.len() > 69_000, notes.len()),
        (true, 0),
        "{notes:?}"
    );
    render_waves(
        &Arc::new(scene),
        timed_job("nee", timing(3.0, 0.05, 160), [SIZE, SIZE], 2, 9),
        &[12],
    )
    .times()
    .unwrap()
}

#[test]
fn light_from_delayed_patches_arrives_later_by_their_delay() {
    let Some(shared) = shared() else {
        crate::common::skipped(
            "no shared scenes beside this checkout, and LUMBRE_SHARED names no folder",
        );
        return;
    };
    let bunny = shared
        .join("scenes/models/stanford-bunny.obj")
        .display()
        .to_string();
    let (early, late) = (cube(&bunny, 0.0), cube(&bunny, 1.0));
    assert_eq!(
        early.steady(),
        late.steady(),
        "delays must not change the steady-state picture"
    );
    let (mut undelayed, mut delayed, mut mixed) = (0, 0, 0);
    for pixel in 0..SIZE * SIZE {
        let mean = |cube: &TimeCube| {
            let slots = cube.slots(pixel % SIZE, pixel / SIZE);
            let all: f64 = slots.iter().map(|slot| slot[0]).sum();
            let moment: f64 = slots
                .iter()
                .enumerate()
                .map(|(i, slot)| slot[0] * i as f64)
                .sum();
            (all > 0.0).then(|| 0.05 * moment / all)
        };
        let (Some(a), Some(b)) = (mean(&early), mean(&late)) else {
            continue;
        };
        // The delay is 20 bins of 0.05. In a pixel that shows one colour of the pattern, all light
        // moves by 0 or by 20 bins.
        match b - a {
            shift if shift.abs() < 1e-3 => undelayed += 1,
            shift if (shift - 1.0).abs() < 1e-3 => delayed += 1,
            shift => {
                assert!(
                    (0.0..1.0).contains(&shift),
                    "pixel {pixel} moved by {shift}"
                );
                mixed += 1;
            }
        }
    }
    // Most pixels show a wall or one colour of the pattern; few show an edge between colours.
    assert!(
        undelayed > 4000 && delayed > 100 && mixed < 600,
        "{undelayed} {delayed} {mixed}"
    );
}
