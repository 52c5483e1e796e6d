//! Plan snapshots: what a worker needs, and what it refuses.

use super::night::{RUNS, differing, evidence, finished, home, script};
use super::workplace::Workplace;

/// Returns a workplace with a night whose plan is stored and one of whose cells is rendered.
fn frozen() -> (Workplace, String) {
    let place = Workplace::new();
    place.write("crew.lua", &script(0));
    // Without a queue `submit` still writes the job script: the plan snapshot exists, and nothing
    // is lost.
    let said = place.fail(
        2,
        &[
            "submit",
            "slurm",
            "crew.lua",
            "--workers",
            "2",
            "--",
            "--no-such-option-of-sbatch",
        ],
    );
    assert!(
        said.contains("The plan is saved") && said.contains("lumbre work"),
        "{said}"
    );
    let home = home(&place, "out");
    (place, home)
}

#[test]
fn a_worker_makes_the_night_that_one_machine_makes() {
    let (place, home) = frozen();
    // From another folder, and after the script was edited: the stored plan counts.
    place.write("crew.lua", "error('edited')");
    std::fs::create_dir(place.path("elsewhere")).unwrap();
    let mut command = place.command(&["work", &format!("../{home}"), "-q"]);
    let output = command
        .current_dir(place.path("elsewhere"))
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert!(
        String::from_utf8_lossy(&output.stdout).contains("| depth"),
        "the last worker prints the tables"
    );
    place.write("crew.lua", &script(0));
    place.succeed(&["run", "crew.lua", "--out", "alone", "-q"]);
    assert_eq!(
        differing(&evidence(&place, "out"), &evidence(&place, "alone")),
        Vec::<String>::new()
    );
    let counts = finished(&place, &home);
    assert_eq!((counts.len(), counts.values().sum::<usize>()), (RUNS, RUNS));
    assert!(
        !place.path(&format!("{home}/journal.jsonl")).exists()
            || place.read(&format!("{home}/journal.jsonl")).is_empty()
    );
    // A second worker finds nothing to do, and the planner regards all runs as done.
    let again = place.succeed(&["work", &home]);
    assert!(
        again.stderr.contains("all runs are done"),
        "{}",
        again.stderr
    );
    assert!(
        place
            .succeed(&["run", "crew.lua"])
            .stderr
            .contains("nothing to do")
    );
    let status = place.succeed(&["status"]);
    assert!(
        status.stdout.contains("0 active, 0 lost, 2 exited"),
        "{}",
        status.stdout
    );
}

#[test]
fn what_was_edited_or_is_missing_is_named() {
    let (place, home) = frozen();
    let scene = place.read("ball.scn");
    place.write("ball.scn", &scene.replace("0.5, 0.5, 0.5", "0.5, 0.5, 0.6"));
    let said = place.fail(2, &["work", &home]);
    for part in [
        "has changed since it was saved",
        "its hash was",
        "first difference: cell depth=2",
        "ball.scn",
    ] {
        assert!(said.contains(part), "{part} in {said}");
    }
    std::fs::remove_file(place.path("ball.scn")).unwrap();
    let said = place.fail(2, &["work", &home]);
    assert!(
        said.contains("changed or missing files") && said.contains("ball.scn"),
        "{said}"
    );
    place.write("ball.scn", &scene);

    let file = format!("{home}/frozen.json");
    let text = place.read(&file);
    let version = concat!("lumbre ", env!("CARGO_PKG_VERSION"));
    place.write(&file, &text.replace(version, "lumbre 0.0.9"));
    let said = place.fail(2, &["work", &home]);
    assert!(
        said.contains("saved by lumbre 0.0.9") && said.contains(version),
        "{said}"
    );
    let folder = place.json(&file)["folder"].as_str().unwrap().to_owned();
    place.write(
        &file,
        &text.replace(&format!("\"{folder}\""), "\"/no/such/folder\""),
    );
    let said = place.fail(2, &["work", &home]);
    assert!(
        said.contains("cannot open /no/such/folder") && said.contains("shared"),
        "{said}"
    );
    std::fs::remove_file(place.path(&file)).unwrap();
    assert!(place.fail(2, &["work", &home]).contains("no plan snapshot"));
    let said = place.fail(2, &["work", "nowhere"]);
    assert!(
        said.contains("nowhere on ") && said.contains("shared file system"),
        "{said}"
    );
    place.write(&file, &text);
    assert!(
        place
            .fail(2, &["work", &home, "--only", "deep=2"])
            .contains("no axis `deep`")
    );
    assert!(
        place
            .fail(2, &["work", &home, "--backend", "cpu"])
            .contains("--backend cannot be used")
    );
    assert!(
        place
            .fail(2, &["cancel", &home])
            .contains("no job was submitted")
    );
    // None of this changed the night.
    place.succeed(&["work", &home, "-q"]);
    assert_eq!(finished(&place, &home).len(), RUNS);
}

/// A scene whose mesh, material and texture are separate files, and whose cell is chosen by a
/// module.
const NAMING: &str = r#"{
    "resolution": [8, 8],
    "camera": { "position": [0, 0, 4], "lookat": [0, 0, 0], "fov": 40 },
    "materials": [{ "name": "grey", "color": [0.5, 0.5, 0.5], "albedotexture": "paint.png" }],
    "entities": [{ "type": "mesh", "material": "grey", "file": "tri.obj", "position": [0, 0, 0] }]
}"#;

#[test]
fn every_file_that_makes_a_plan_is_named_when_it_changed() {
    let place = Workplace::new();
    let paint = |shade: u8| {
        let bytes = lumbre::output::png::encode(
            &lumbre::film::Image::from_fn(2, 2, |_, _| [f32::from(shade) / 255.0; 3]),
            lumbre::metrics::tonemap::Tonemap::Srgb { exposure: 0.0 },
            &[],
        );
        std::fs::write(place.path("paint.png"), bytes.unwrap()).unwrap();
    };
    paint(40);
    place.write(
        "tri.obj",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n",
    );
    place.write("ball.scn", NAMING);
    place.write("depths.lua", "return { 2 }");
    let text = script(0).replace(
        "x:axis(\"depth\", { 2, 4 })",
        "x:axis(\"depth\", require(\"depths\"))",
    );
    place.write("crew.lua", &text);
    place.fail(
        2,
        &[
            "submit",
            "slurm",
            "crew.lua",
            "--",
            "--no-such-option-of-sbatch",
        ],
    );
    let home = home(&place, "out");
    let refused = |names: &[&str]| {
        let said = place.fail(2, &["work", &home]);
        let (_, listed) = said
            .split_once("changed or missing files: ")
            .unwrap_or_else(|| panic!("{said}"));
        for name in ["paint.png", "tri.obj", "depths.lua", "ball.scn"] {
            assert_eq!(
                listed.contains(name),
                names.contains(&name),
                "{name} in {listed}"
            );
        }
    };
    paint(50);
    refused(&["paint.png"]);
    place.write(
        "tri.obj",
        "v 0 0 0\nv 1 0 0\nv 0 2 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n",
    );
    place.write("depths.lua", "return { 3 }");
    refused(&["paint.png", "tri.obj", "depths.lua"]);
}

#[test]
fn part_of_a_plan_leaves_the_rest_to_others() {
    let (place, home) = frozen();
    let part = place.run(&[
        "work",
        &home,
        "--only",
        "depth=2",
        "--only",
        "technique=nee",
    ]);
    assert_eq!(part.status, 4, "{}", part.stderr);
    assert_eq!(
        finished(&place, &home).len(),
        3,
        "two repeats and their reference"
    );
    assert!(!place.path(&format!("{home}/tables/errors.csv")).exists());
    // A worker with another device model skips the comparison group and reports that.
    let bond = std::fs::read_dir(place.path(&format!("{home}/bonds")))
        .unwrap()
        .next()
        .unwrap()
        .unwrap()
        .path();
    let text = std::fs::read_to_string(&bond).unwrap();
    std::fs::write(
        &bond,
        r#"{"device":"far, device 0","model":"a better device"}"#,
    )
    .unwrap();
    let other = place.run(&["work", &home]);
    assert_eq!(other.status, 4, "{}", other.stderr);
    assert!(
        other
            .stderr
            .contains("4 cells left to workers with other devices")
            && other.stderr.contains("a better device"),
        "{}",
        other.stderr
    );
    std::fs::write(&bond, text).unwrap();
    place.succeed(&["work", &home, "-q"]);
    assert_eq!(
        finished(&place, &home)
            .values()
            .filter(|n| **n != 1)
            .count(),
        0
    );
    assert!(place.path(&format!("{home}/tables/errors.csv")).exists());
}
