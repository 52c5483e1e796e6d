//! Tests of `lumbre trace`: one sample, step by step.

use serde_json::Value as Json;

use super::workplace::Workplace;

const NIGHT: &str = r#"
local x = experiment("steps", { seed = 5 })
x:render(function() return { scene = "ball.scn", integrator = "nee", resolution = { 16, 12 }, backend = "cpu" } end)
x:stop(function() return stop.samples(4) end)
return x
"#;

fn steps(place: &Workplace, args: &[&str]) -> Json {
    let ended = place.succeed(&[&["trace", "--json"], args].concat());
    serde_json::from_str(&ended.stdout).unwrap()
}

/// Returns the red, green and blue light that a sample contributes to its own pixel.
fn light(traced: &Json) -> [f64; 3] {
    let own = |step: &&Json| step["step"] == "light" && step["pixel"] == traced["pixel"];
    let lights: Vec<&Json> = traced["steps"]
        .as_array()
        .unwrap()
        .iter()
        .filter(own)
        .collect();
    [0, 1, 2].map(|c| {
        lights
            .iter()
            .map(|step| step["value"][c].as_f64().unwrap())
            .sum()
    })
}

#[test]
fn the_traced_samples_of_a_pixel_average_to_the_pixel_of_the_picture() {
    let place = Workplace::new();
    place.write("steps.lua", NIGHT);
    place.succeed(&["run", "steps.lua", "-q"]);
    let run = place.finished()[0]
        .0
        .trim_end_matches("/done.json")
        .to_owned();
    let bytes = std::fs::read(place.path(&format!("{run}/final.exr"))).unwrap();
    let picture = lumbre_report::exr::decode(&bytes).unwrap().0;
    for [x, y] in [[8, 6], [7, 5], [2, 9]] {
        let pixel = format!("{x},{y}");
        let samples = (0..4).map(|n| {
            steps(
                &place,
                &[&run, "--pixel", &pixel, "--sample", &n.to_string()],
            )
        });
        let sum = samples.fold([0.0; 3], |sum, traced| {
            assert_eq!(
                (traced["backend"].as_str(), traced["integrator"].as_str()),
                (Some("cpu"), Some("nee"))
            );
            let light = light(&traced);
            [0, 1, 2].map(|c| sum[c] + light[c])
        });
        for (c, found) in picture.at(x, y).into_iter().enumerate() {
            let expected = sum[c] / 4.0;
            assert!(
                (f64::from(found) - expected).abs() <= 1e-5 * (1.0 + expected),
                "{pixel}: {found} {expected}"
            );
        }
    }
}

#[test]
fn the_text_output_lists_vertices_and_shadow_rays() {
    let place = Workplace::new();
    let args = [
        "ball.scn",
        "--pixel",
        "8,2",
        "--size",
        "16x12",
        "--sample",
        "1",
        "-i",
        "bdpt",
        "--backend",
        "cpu",
    ];
    let output = place.succeed(&[&["trace"], &args[..]].concat()).stdout;
    assert!(
        output.starts_with("pixel 8,2 sample 1 of bdpt by cpu, seed 0\n"),
        "{output}"
    );
    for part in [
        "  0 ray    (0, 0, 4) -> vertex (",
        "sphere 0 (disney), t ",
        "shadow (",
        ": free",
        "light  s 1 t 2: (",
    ] {
        assert!(output.contains(part), "{part}: {output}");
    }
    let traced = steps(&place, &args);
    let first = &traced["steps"][0];
    assert_eq!(first["hit"]["what"], "sphere 0 (disney)");
    let distance = first["hit"]["vertex"]
        .as_array()
        .unwrap()
        .iter()
        .map(|x| x.as_f64().unwrap().powi(2))
        .sum::<f64>();
    assert!(
        (distance.sqrt() - 1.0).abs() < 1e-4,
        "the vertex must lie on the ball: {first}"
    );
}

#[test]
fn parameters_of_the_technique_and_options_of_the_scene_change_the_sample() {
    let place = Workplace::new();
    place.write(
        "room.lua",
        r#"local s = scene {}
local radius = s:option("radius", 1)
s:camera { position = { 0, 0, 4 }, target = { 0, 0, 0 } }
s:material("light", { emission = { 1, 1, 1 } })
s:add { name = "light", shape = shape.sphere { radius = radius }, material = "light" }
return s"#,
    );
    let ray = |scene: &str| {
        let args = [
            scene,
            "--pixel",
            "8,6",
            "--size",
            "16x12",
            "--backend",
            "cpu",
        ];
        steps(&place, &args)["steps"][0]["hit"]["t"]
            .as_f64()
            .unwrap()
    };
    assert!(ray("room.lua?radius=2") < 2.1 && ray("room.lua") > 2.9);

    let strategies = |params: &[&str]| {
        let args = [
            "ball.scn", "-i", "bdpt", "--pixel", "8,2", "--size", "16x12",
        ];
        let traced = steps(&place, &[&args, params].concat());
        let all = traced["steps"].as_array().unwrap().clone();
        all.into_iter()
            .filter(|step| step["step"] == "light")
            .map(|step| [&step["s"], &step["t"]].map(|n| n.as_u64().unwrap()))
            .collect::<Vec<_>>()
    };
    assert!(strategies(&[]).iter().any(|pair| *pair != [0, 3]));
    assert!(
        strategies(&["strategies=[0,3]"])
            .iter()
            .all(|pair| *pair == [0, 3])
    );
}

#[test]
fn invalid_trace_requests_are_refused() {
    let place = Workplace::new();
    let fail = |args: &[&str]| place.fail(2, &[&["trace", "ball.scn"], args].concat());
    assert!(
        fail(&["--pixel", "16,0", "--size", "16x12"])
            .contains("pixel 16,0 is outside the picture, which has 16 x 12 pixels")
    );
    assert!(fail(&["--pixel", "1"]).contains("such as 12,7"));
    assert!(fail(&["--pixel", "1,1", "--integrator", "bdp"]).contains("did you mean `bdpt`"));
    assert!(fail(&["strategy=1", "--pixel", "1,1", "-i", "bdpt"]).contains("`strategies`"));
    let words = ["trace", "depth=5", "technique=nee", "--pixel", "1,1"];
    assert!(place.fail(2, &words).contains("quote all words"));
    assert!(fail(&["--pixel", "1,1", "--backend", "mock"]).contains("traces no paths"));
    assert!(
        place
            .fail(2, &["trace", "nothing.scn", "--pixel", "1,1"])
            .contains("nothing.scn")
    );
}
