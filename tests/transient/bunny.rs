//! The Stanford bunny in the box of this project's hare.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use lumbre::film::time::TimeCube;
use lumbre::render::Renderer;
use lumbre::scene::load::MissingTextures;
use lumbre::scene::{compile, edit};
use lumbre::script::scene;
use lumbre::value::Value;

use crate::arrival::{rendered, timing, with};
use crate::common::shared;

const SIZE: u32 = 100;

/// Returns direct light by way of one surface, with this delay where the pattern is white.
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
    rendered(
        &Arc::new(scene),
        with("nee", timing(3.0, 0.05, 160), [SIZE, SIZE], 2, 9),
        &[12],
    )
    .times()
    .unwrap()
}

#[test]
fn patches_on_the_bunny_give_light_back_at_their_time() {
    let Some(shared) = shared() else {
        println!("SKIPPED: no shared scenes beside this folder, and LUMBRE_SHARED names none");
        return;
    };
    let bunny = shared
        .join("scenes/models/stanford-bunny.obj")
        .display()
        .to_string();
    let (early, late) = (cube(&bunny, 0.0), cube(&bunny, 1.0));
    assert_eq!(early.steady(), late.steady(), "delays change no picture");
    let (mut at_once, mut later, mut between) = (0, 0, 0);
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
        // Bins are 0.05 wide and the delay is twenty of them, so every path moves by whole bins
        // where the pattern is plain.
        match b - a {
            shift if shift.abs() < 1e-3 => at_once += 1,
            shift if (shift - 1.0).abs() < 1e-3 => later += 1,
            shift => {
                assert!(
                    (0.0..1.0).contains(&shift),
                    "pixel {pixel} moved by {shift}"
                );
                between += 1;
            }
        }
    }
    // Walls, and patches of both kinds, with little between them.
    assert!(
        at_once > 4000 && later > 100 && between < 600,
        "{at_once} {later} {between}"
    );
}
