//! Tests of `lumbre verify`: what passes, which errors it detects, and what it refuses.

use std::sync::Arc;

use lumbre_light::film::Image;
use lumbre_light::scene::compile;
use lumbre_light::transport::integrator::{INTEGRATORS, IntegratorRow};
use lumbre_report::exr;
use lumbre_scene_io::edit::set;
use lumbre_scene_io::load;
use serde_json::{Value as Json, json};

use super::workplace::Workplace;
use crate::common::{named_job, render};

/// A ball under a large light, for little noise.
pub const SCENE: &str = r#"{
    "resolution": [48, 32],
    "maxdepth": 4,
    "camera": { "position": [0, 0, 6], "lookat": [0, 0, 0], "fov": 18 },
    "materials": [ { "name": "grey", "color": [0.5, 0.5, 0.5] }, { "name": "lamp", "emission": [2, 2, 2] } ],
    "entities": [
        { "type": "sphere", "material": "grey", "position": [0, 0, 0], "radius": 1 },
        { "type": "sphere", "material": "lamp", "position": [0, 4, 6], "radius": 2 }
    ]
}"#;

/// Returns whether the bias of an integrator comes from gathering photons, which `verify` can judge.
fn gathers(row: &IntegratorRow) -> bool {
    let mut keys = row.params.fields.iter().map(|field| field.key);
    row.bias.is_some() && keys.any(|key| key == "photons")
}

/// Returns a folder of scenes and one of references, which hold the program's own renders with
/// another seed and many samples, times a factor.
fn with_reference(factor: f32) -> Workplace {
    let place = Workplace::new();
    std::fs::create_dir_all(place.path("given/scenes/deep")).unwrap();
    std::fs::create_dir_all(place.path("given/references")).unwrap();
    place.write("given/scenes/deep/ball.scn", SCENE);
    let (mut desc, _) = load::load(&place.path("given/scenes/deep/ball.scn")).unwrap();
    set(&mut desc, "materials.*.model", &"lambert".into()).unwrap();
    let job = named_job("nee", [24, 16], 4, 12_345);
    let film = render(&Arc::new(compile(&desc).unwrap().0), job, 4096);
    let write = |name: &str, image: &Image| {
        std::fs::write(
            place.path(&format!("given/references/{name}")),
            exr::encode(image, &[]).unwrap(),
        )
        .unwrap();
    };
    let changed = |image: Image, f: &dyn Fn(f32) -> f32| {
        Image::from_fn(image.width, image.height, |x, y| image.at(x, y).map(f))
    };
    write("ball.exr", &changed(film.mean(), &|v| v * factor));
    write(
        "ball.stderr.exr",
        &changed(film.variance_of_mean(), &f32::sqrt),
    );
    place.write("given/references/ball.json", &settings().to_string());
    place
}

fn settings() -> Json {
    json!({
        "scene": "ball.scn", "width": 24, "height": 16, "max_depth_edges": 4, "rr_depth": 1000, "bsdf_mode": "diffuse",
        "pixel_filter": { "type": "box" }, "file": "ball.exr", "stderr_file": "ball.stderr.exr",
    })
}

const GIVEN: [&str; 5] = ["verify", "--quick", "--scenes", "given/scenes", "--json"];

#[test]
fn checks_of_every_kind_pass_against_a_correct_reference() {
    let place = with_reference(1.0);
    place.write("given/references/other.json", "{}");
    let before = place.files(".");
    // That techniques agree is tested in `light`, in more scenes: here one has to have its verdicts.
    let selections: [&[&str]; 5] = [
        &["analytic"],
        &["consistent"],
        &["density"],
        &["reference"],
        &["agreement", "cornell_spheres"],
    ];
    let mut checks = Vec::new();
    for selection in selections {
        let only = selection.iter().flat_map(|text| ["--only", *text]);
        let ended = place.run(&GIVEN.into_iter().chain(only).collect::<Vec<_>>());
        let report: Json = serde_json::from_str(&ended.stdout).unwrap();
        assert_eq!(ended.status, 0, "{report:#}");
        assert_eq!((&report["failed"], &report["seed"]), (&json!(0), &json!(1)));
        let skipped = u64::from(selection == ["reference"]);
        assert_eq!(report["skipped"], skipped, "{report:#}");
        checks.extend(report["checks"].as_array().unwrap().iter().cloned());
    }
    assert_eq!(place.files("."), before, "the command must write nothing");
    let of_kind =
        |kind: &str| -> Vec<&Json> { checks.iter().filter(|row| row["kind"] == kind).collect() };
    assert!(
        of_kind("density")
            .iter()
            .all(|row| row["verdict"] == "passed")
    );
    for row in INTEGRATORS {
        let name = row.name;
        let kinds: &[&str] = match row.bias {
            None => &["analytic", "agreement", "reference"],
            Some(_) if gathers(row) => &["consistent"],
            // A technique that estimates no radiance is compared with nothing.
            Some(_) => &[],
        };
        for kind in kinds {
            let judged = |row: &&&Json| {
                row["compared"].as_str().unwrap().starts_with(name) && row["verdict"] == "passed"
            };
            let found = of_kind(kind).iter().filter(judged).count();
            // `bpt` is the technique with which the others are compared.
            assert!(
                found > 0 || (*kind == "agreement" && name == "bpt"),
                "{kind} {name}: {checks:#?}"
            );
        }
    }
    let references = of_kind("reference");
    let other = references.iter().find(|row| row["check"] == "other");
    let other = other.unwrap();
    assert_eq!(other["verdict"], "skipped");
    assert!(
        other["statement"].as_str().unwrap().contains("stderr_file"),
        "{other}"
    );
    let precise = references
        .iter()
        .any(|row| row["figures"]["ratio_error"].as_f64().unwrap_or(1.0) < 0.02);
    assert!(precise, "{references:#?}");
}

#[test]
fn a_reference_that_is_five_per_cent_too_bright_fails() {
    let place = with_reference(1.05);
    let ended = place.run(&[&GIVEN[..4], &["--only", "reference"], &["--only", "ball"]].concat());
    assert_eq!(ended.status, 5, "{}\n{}", ended.stdout, ended.stderr);
    let failed: Vec<&str> = ended
        .stdout
        .lines()
        .filter(|line| line.contains("FAILED"))
        .collect();
    assert!(
        failed.len() >= 2 && failed.iter().all(|line| line.starts_with("reference")),
        "{}",
        ended.stdout
    );
    let tail = ended
        .stdout
        .lines()
        .find(|line| line.contains(" passed, "))
        .unwrap();
    assert!(tail.contains(&format!("{} failed", failed.len())), "{tail}");
    assert!(
        ended.stdout.contains("seed 1, quick, significance 0.001"),
        "{}",
        ended.stdout
    );
    assert!(
        ended
            .stderr
            .contains("reference ball: nee with diffuse surfaces"),
        "progress must be printed: {}",
        ended.stderr
    );
}

#[test]
fn invalid_scenes_and_references_are_refused_before_any_work() {
    let place = with_reference(1.0);
    let refused = |expected: &[&str]| {
        let error = place.fail(2, &GIVEN);
        assert!(
            expected.iter().all(|word| error.contains(word)),
            "{expected:?}: {error}"
        );
    };
    let json = |change: &dyn Fn(&mut Json)| {
        let mut settings = settings();
        change(&mut settings);
        place.write("given/references/ball.json", &settings.to_string());
    };
    json(&|s| s["scene"] = "bowl.scn".into());
    refused(&["ball.json", "bowl.scn was not found below given/scenes"]);
    json(&|s| s["width"] = 25.into());
    refused(&["ball.json", "[24, 16]", "[25, 16]"]);
    json(&|s| s["file"] = "missing.exr".into());
    refused(&["missing.exr"]);
    json(&|s| s["max_depth_edges"] = "many".into());
    refused(&["ball.json", "invalid type: string \"many\", expected i64"]);
    json(&|_| {});
    place.write("given/references/ball.exr", "no picture");
    refused(&["ball.exr"]);
    place.write("given/references/ball.json", "{");
    refused(&["ball.json", "invalid JSON"]);
    assert!(
        place
            .fail(2, &["verify", "--scenes", "nowhere"])
            .contains("the scenes folder nowhere does not exist")
    );
    assert!(
        place
            .fail(2, &["verify", "--only", "zebra"])
            .contains("no check contains `zebra`")
    );
    assert!(
        place
            .fail(2, &["verify", "--references", "given/references"])
            .contains("needs --scenes")
    );
    std::fs::remove_dir_all(place.path("given/references")).unwrap();
    refused(&["cannot read the references in given/scenes/../references"]);
}
