//! References on disk: their halves, their noise estimates, and sharing between experiments.

use std::time::SystemTime;

use super::workplace::Workplace;

/// Returns the only reference folder of a workplace. Panics unless there is exactly one.
fn reference(place: &Workplace) -> String {
    let found: Vec<String> = place.ending("out", "/ref.json");
    let [one] = found.as_slice() else {
        panic!("{found:?}")
    };
    one.trim_end_matches("/ref.json").to_owned()
}

fn column(csv: &str, name: &str) -> Vec<f64> {
    let at = csv
        .lines()
        .next()
        .unwrap()
        .split(',')
        .position(|c| c == name)
        .unwrap_or_else(|| panic!("{name}: {csv}"));
    csv.lines()
        .skip(1)
        .map(|line| line.split(',').nth(at).unwrap().parse().unwrap())
        .collect()
}

#[test]
fn a_reference_stores_its_halves_and_net_errors_exclude_its_noise() {
    let place = Workplace::new();
    place.succeed(&["run", "night.lua", "depth=4", "-q"]);
    let folder = reference(&place);
    let json = place.json(&format!("{folder}/ref.json"));
    assert_eq!(json["halves"], serde_json::json!([2048, 2048]));
    let image = |name: &str| {
        let bytes = std::fs::read(place.path(&format!("{folder}/{name}.exr"))).unwrap();
        lumbre_report::exr::decode(&bytes).unwrap().0
    };
    let (whole, a, b, noise) = (
        image("ref"),
        image("half-a"),
        image("half-b"),
        image("noise"),
    );
    for i in 0..whole.data.len() {
        assert!((whole.data[i][0] - 0.5 * (a.data[i][0] + b.data[i][0])).abs() < 1e-6);
        // The mock's standard error is a tenth of the true value, divided by the square root of the
        // number of samples.
        assert!((noise.data[i][1] / (whole.data[i][1] * 0.1 / 64.0) - 1.0).abs() < 0.02);
    }
    let (done, _) = place.finished().remove(0);
    let metrics = place.read(&done.replace("done.json", "metrics.csv"));
    let done = place.json(&done);
    let floor = done["floors"]["rmse"].as_f64().unwrap();
    let (gross, net) = (column(&metrics, "rmse"), column(&metrics, "rmse_net"));
    for (gross, net) in gross.iter().zip(&net) {
        assert!(
            (gross * gross - net * net - floor * floor).abs() < 1e-12,
            "{gross} {net} {floor}"
        );
    }
    assert_eq!(done["net"]["rmse_net"].as_f64(), net.last().copied());
    assert!(done["net"]["psnr_net"].as_f64().unwrap() > done["metrics"]["psnr"].as_f64().unwrap());
    let summary = place.read("out/latest/summary.csv");
    assert_eq!(column(&summary, "rmse_floor"), [floor; 2]);
    assert!(
        column(&summary, "rmse_net")
            .iter()
            .zip(column(&summary, "rmse"))
            .all(|(net, gross)| *net < gross)
    );
    // A second night reads all of these values from disk.
    place.succeed(&["run", "night.lua", "depth=4", "-q"]);
    let again = place.read("out/latest/summary.csv");
    let numbers = |text: &str| ["rmse_floor", "rmse_net", "psnr_floor"].map(|c| column(text, c));
    assert_eq!(numbers(&again), numbers(&summary));
}

#[test]
fn experiments_with_other_names_and_seeds_share_a_reference() {
    let place = Workplace::new();
    place.succeed(&["run", "night.lua", "depth=4", "-q"]);
    let script = place
        .read("night.lua")
        .replace("\"night\", { seed = 7", "\"day\", { seed = 8");
    place.write("day.lua", &script);
    let stderr = place.succeed(&["run", "day.lua", "depth=4"]).stderr;
    assert!(stderr.contains("2 done, 1 cached"), "{stderr}");
    reference(&place);
}

#[test]
fn a_threshold_below_the_noise_floor_is_reported_by_run_and_plan() {
    let place = Workplace::new();
    let stop = "stop.any { stop.when('rmse', '<', 1e-5), stop.samples(16) }";
    let script = place.read("night.lua").replace("stop.samples(16)", stop);
    place.write("night.lua", &script);
    let output = place.succeed(&["plan", "night.lua", "depth=4"]).stdout;
    assert!(
        !output.contains("true picture"),
        "no noise floor is known yet: {output}"
    );
    let expected =
        "2 cells stop at `rmse < 0.00001`, but even the true picture would measure 0.000";
    let output = place.succeed(&["run", "night.lua", "depth=4"]).stderr;
    assert!(output.contains(expected), "{output}");
    let output = place.succeed(&["plan", "night.lua", "depth=4"]).stdout;
    assert!(output.contains(&format!("warning: {expected}")), "{output}");
    let json: serde_json::Value = serde_json::from_str(
        &place
            .succeed(&["plan", "night.lua", "depth=4", "--json"])
            .stdout,
    )
    .unwrap();
    assert_eq!(json["unreachable"].as_array().unwrap().len(), 1);
}

/// A ball under a point light and an emissive sphere. `bpt` misses the point light, since it meets
/// lights only by chance.
const POINT: &str = r#"{
    "resolution": [48, 32],
    "camera": { "position": [0, 0, 4], "lookat": [0, 0, 0], "fov": 40 },
    "materials": [{ "name": "grey", "color": [0.5, 0.5, 0.5] }, { "name": "lamp", "emission": [2, 2, 2] }],
    "entities": [
        { "type": "sphere", "material": "grey", "position": [0, 0, 0], "radius": 1 },
        { "type": "sphere", "material": "lamp", "position": [0, 3, 0], "radius": 0.5 }
    ],
    "lights": [{ "type": "point", "position": [2, 2, 3], "intensity": [3, 3, 3] }]
}"#;

#[test]
fn a_failed_bias_check_ends_the_night_with_status_6_and_writes_a_map() {
    let place = Workplace::new();
    place.write("ball.scn", POINT);
    let script = place
        .read("night.lua")
        .replace(
            "resolution = { 24, 16 }, backend = \"mock\"",
            "resolution = { 48, 32 }, backend = \"cpu\"",
        )
        .replace(
            "integrator = \"bpt\" } end, stop = stop.samples(4096)",
            "integrator = \"nee\" } end, \
                  stop = stop.samples(64), agree = { with = \"bdpt\" }",
        );
    place.write("night.lua", &script);
    let stderr = place.succeed(&["run", "night.lua", "depth=4"]).stderr;
    assert!(stderr.contains("agrees with `bdpt`"), "{stderr}");
    place.write("night.lua", &script.replace("bdpt", "bpt"));
    for _ in 0..2 {
        let stderr = place.fail(6, &["run", "night.lua", "depth=4", "-q"]);
        assert!(
            stderr.contains("alarm: reference ") && stderr.contains("DISAGREES with `bpt`"),
            "{stderr}"
        );
    }
    let maps: Vec<String> = place.ending("out", "/bias-check-bpt.png");
    assert_eq!(maps.len(), 1, "{maps:?}");
    let json = place.json(&maps[0].replace(".png", ".json"));
    assert_eq!(
        (json["agrees"].as_bool(), json["technique"].as_str()),
        (Some(false), Some("bpt"))
    );
    assert!(!json["differing"].as_array().unwrap().is_empty());
    place.write("night.lua", &script.replace("bdpt", "bdtp"));
    assert!(
        place
            .fail(2, &["plan", "night.lua"])
            .contains("did you mean `bdpt`")
    );
}

/// Returns the bytes of a reference's pictures.
fn pictures(place: &Workplace, folder: &str) -> Vec<Vec<u8>> {
    let names = [
        "ref.exr",
        "ref.png",
        "half-a.exr",
        "half-b.exr",
        "noise.exr",
    ];
    names
        .map(|name| std::fs::read(place.path(&format!("{folder}/{name}"))).unwrap())
        .into()
}

#[test]
fn a_longer_reference_continues_a_shorter_one_to_the_same_bytes() {
    // Use the CPU backend and splats, so that the stored state must contain all sums.
    let script = |samples: u32, place: &Workplace| {
        let text = place
            .read("night.lua")
            .replace("backend = \"mock\"", "backend = \"cpu\"");
        let reference = format!(
            "integrator = \"bdpt\" }} end, stop = function(p) return stop.samples({samples} * p.depth) end }}"
        );
        let text = text.replace(
            "integrator = \"bpt\" } end, stop = stop.samples(4096) }",
            &reference,
        );
        place.write("long.lua", &text);
    };
    let whole = Workplace::new();
    script(10, &whole);
    whole.succeed(&["run", "long.lua", "depth=4", "-q"]);
    let expected = pictures(&whole, &reference(&whole));

    let place = Workplace::new();
    script(4, &place);
    place.succeed(&["run", "long.lua", "depth=4", "-q"]);
    let short = reference(&place);
    script(10, &place);
    let plan = place.succeed(&["plan", "long.lua", "depth=4"]).stdout;
    assert!(
        plan.contains("new, resumes from 16 samples per pixel"),
        "{plan}"
    );
    let stderr = place.succeed(&["run", "long.lua", "depth=4"]).stderr;
    assert!(
        stderr.contains("continues a shorter reference after 16 samples per pixel"),
        "{stderr}"
    );
    let refs: Vec<String> = place.ending("out", "/ref.json");
    let long = refs
        .iter()
        .map(|f| f.trim_end_matches("/ref.json"))
        .find(|f| *f != short)
        .unwrap();
    assert_eq!(pictures(&place, long), expected);
    let metrics = place.read(&format!("{long}/metrics.csv"));
    assert_eq!(column(&metrics, "samples").last(), Some(&40.0));
    assert!(
        column(&metrics, "render_s").is_sorted(),
        "render time must include the shorter reference: {metrics}"
    );

    // Only the sums of the longest reference are stored, so a reference of a length in between
    // starts from its first sample.
    script(6, &place);
    let stderr = place.succeed(&["run", "long.lua", "depth=4"]).stderr;
    assert!(
        !stderr.contains("continues a shorter reference") && !stderr.contains("resumes from"),
        "{stderr}"
    );
    let sums: Vec<String> = place
        .files("out")
        .into_iter()
        .filter(|f| f.contains("/sums/"))
        .collect();
    assert!(
        sums.len() == 1 && sums[0].ends_with(".40"),
        "only the sums of the longest reference are stored: {sums:?}"
    );
    std::fs::write(place.path(&sums[0]), "damaged").unwrap();
    script(12, &place);
    let stderr = place.succeed(&["run", "long.lua", "depth=4"]).stderr;
    assert!(
        stderr.contains("is damaged and has been removed"),
        "{stderr}"
    );
}

#[test]
fn an_imported_reference_is_copied_with_its_provenance_and_unknown_noise() {
    let place = Workplace::new();
    place.succeed(&["run", "night.lua", "depth=4", "-q"]);
    let made = format!("{}/ref.exr", reference(&place));
    let bytes = std::fs::read(place.path(&made)).unwrap();
    std::fs::write(place.path("truth.exr"), &bytes).unwrap();
    let text = place.read("night.lua").replace(
        "from = function(p) return { integrator = \"bpt\" } end, stop = stop.samples(4096)",
        "image = \"truth.exr\", source = \"Mitsuba 3.5, 65536 spp\"",
    );
    place.write("imported.lua", &text);
    let plan = place.succeed(&["plan", "imported.lua", "depth=4"]).stdout;
    let hash = blake3::hash(&bytes).to_hex().to_string();
    let expected = format!(
        "file, blake3 {}, Mitsuba 3.5, 65536 spp; its noise is unknown",
        &hash[..8]
    );
    assert!(plan.contains(&expected), "{plan}");
    let before = place.finished();
    place.succeed(&["run", "imported.lua", "depth=4", "-q"]);
    let all: Vec<String> = place.ending("out", "/ref.json");
    let copies: Vec<_> = all
        .iter()
        .map(|f| (f, place.json(f)))
        .filter(|(_, json)| json["kind"] == "imported")
        .collect();
    let [(file, json)] = copies.as_slice() else {
        panic!("{all:?}")
    };
    assert_eq!(
        (json["made_by"].as_str(), json["noise"].as_str()),
        (Some("Mitsuba 3.5, 65536 spp"), Some("unknown"))
    );
    assert_eq!(json["blake3"].as_str(), Some(hash.as_str()));
    assert!(
        json["imported_from"]
            .as_str()
            .unwrap()
            .ends_with("truth.exr")
    );
    assert_eq!(
        std::fs::read(place.path(&file.replace("ref.json", "ref.exr"))).unwrap(),
        bytes
    );
    let own = |(done, _): &(String, SystemTime)| !before.iter().any(|(old, _)| old == done);
    let (done, _) = place.finished().into_iter().find(own).unwrap();
    assert!(
        place.json(&done)["floors"].is_null(),
        "an imported reference has no noise floors"
    );
    assert!(
        place
            .fail(2, &["plan", "imported.lua", "depth=4", "--nonsense"])
            .contains("nonsense")
    );
    place.write(
        "imported.lua",
        &text.replace("image = \"truth.exr\", ", "stop = stop.samples(4), "),
    );
    assert!(
        place
            .fail(2, &["plan", "imported.lua"])
            .contains("no `image` is given")
    );
}
