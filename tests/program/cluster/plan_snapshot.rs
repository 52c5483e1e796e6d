//! Plan snapshots: the files that a worker needs, and the snapshots that it refuses.

use super::night::{OTHER_DEVICE, RUNS, differing, finished, home, results, script};
use super::workplace::Workplace;

/// Returns a workplace with a stored plan, and the folder of its night.
fn saved_plan() -> (Workplace, String) {
    let place = Workplace::new();
    place.write("grid.lua", &script(0));
    // `submit` fails, since `sbatch` is absent or refuses the option, but it saves the plan first.
    let error = place.fail(
        2,
        &[
            "submit",
            "slurm",
            "grid.lua",
            "--workers",
            "2",
            "--",
            "--no-such-option-of-sbatch",
        ],
    );
    assert!(
        error.contains("The plan is saved") && error.contains("lumbre work"),
        "{error}"
    );
    let home = home(&place, "out");
    (place, home)
}

#[test]
fn a_worker_renders_the_same_night_as_a_single_process() {
    let (place, home) = saved_plan();
    // Start the worker in another folder and after the script was edited: it uses the stored plan.
    place.write("grid.lua", "error('edited')");
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
    place.write("grid.lua", &script(0));
    place.succeed(&["run", "grid.lua", "--out", "alone", "-q"]);
    assert_eq!(
        differing(&results(&place, "out"), &results(&place, "alone")),
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
            .succeed(&["run", "grid.lua"])
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
fn plan_snapshots_that_do_not_match_their_files_or_program_are_refused() {
    let (place, home) = saved_plan();
    let scene = place.read("ball.scn");
    place.write("ball.scn", &scene.replace("0.5, 0.5, 0.5", "0.5, 0.5, 0.6"));
    let error = place.fail(2, &["work", &home]);
    for part in [
        "has changed since it was saved",
        "its hash was",
        "first difference: cell depth=2",
        "ball.scn",
    ] {
        assert!(error.contains(part), "{part} in {error}");
    }
    std::fs::remove_file(place.path("ball.scn")).unwrap();
    let error = place.fail(2, &["work", &home]);
    assert!(
        error.contains("changed or missing files") && error.contains("ball.scn"),
        "{error}"
    );
    place.write("ball.scn", &scene);

    let file = format!("{home}/snapshot.json");
    let text = place.read(&file);
    let version = concat!("lumbre ", env!("CARGO_PKG_VERSION"));
    place.write(&file, &text.replace(version, "lumbre 0.0.9"));
    let error = place.fail(2, &["work", &home]);
    assert!(
        error.contains("saved by lumbre 0.0.9") && error.contains(version),
        "{error}"
    );
    let folder = place.json(&file)["folder"].as_str().unwrap().to_owned();
    place.write(
        &file,
        &text.replace(&format!("\"{folder}\""), "\"/no/such/folder\""),
    );
    let error = place.fail(2, &["work", &home]);
    assert!(
        error.contains("cannot open /no/such/folder") && error.contains("shared"),
        "{error}"
    );
    std::fs::remove_file(place.path(&file)).unwrap();
    assert!(
        place
            .fail(2, &["work", &home])
            .contains("snapshot.json: it is missing")
    );
    let error = place.fail(2, &["work", "nowhere"]);
    assert!(
        error.contains("nowhere on ") && error.contains("shared file system"),
        "{error}"
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

/// A scene whose mesh and texture are separate files.
const SCENE_WITH_FILES: &str = r#"{
    "resolution": [8, 8],
    "camera": { "position": [0, 0, 4], "lookat": [0, 0, 0], "fov": 40 },
    "materials": [{ "name": "grey", "color": [0.5, 0.5, 0.5], "albedotexture": "paint.png" }],
    "entities": [{ "type": "mesh", "material": "grey", "file": "tri.obj", "position": [0, 0, 0] }]
}"#;

#[test]
fn every_changed_file_of_a_plan_is_reported_by_name() {
    let place = Workplace::new();
    let write_texture = |shade: u8| {
        let bytes = lumbre_report::png::encode(
            &lumbre_light::film::Image::from_fn(2, 2, |_, _| [f32::from(shade) / 255.0; 3]),
            lumbre_metrics::tonemap::Tonemap::Srgb { exposure: 0.0 },
            &[],
        );
        std::fs::write(place.path("paint.png"), bytes.unwrap()).unwrap();
    };
    write_texture(40);
    place.write(
        "tri.obj",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n",
    );
    place.write("ball.scn", SCENE_WITH_FILES);
    place.write("depths.lua", "return { 2 }");
    let text = script(0).replace(
        "x:axis(\"depth\", { 2, 4 })",
        "x:axis(\"depth\", require(\"depths\"))",
    );
    place.write("grid.lua", &text);
    place.fail(
        2,
        &[
            "submit",
            "slurm",
            "grid.lua",
            "--",
            "--no-such-option-of-sbatch",
        ],
    );
    let home = home(&place, "out");
    let refused = |names: &[&str]| {
        let error = place.fail(2, &["work", &home]);
        let (_, listed) = error
            .split_once("changed or missing files: ")
            .unwrap_or_else(|| panic!("{error}"));
        for name in ["paint.png", "tri.obj", "depths.lua", "ball.scn"] {
            assert_eq!(
                listed.contains(name),
                names.contains(&name),
                "{name} in {listed}"
            );
        }
    };
    write_texture(50);
    refused(&["paint.png"]);
    place.write(
        "tri.obj",
        "v 0 0 0\nv 1 0 0\nv 0 2 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n",
    );
    place.write("depths.lua", "return { 3 }");
    refused(&["paint.png", "tri.obj", "depths.lua"]);
}

#[test]
fn a_worker_with_a_selection_leaves_the_other_cells_to_other_workers() {
    let (place, home) = saved_plan();
    let part = place.run(&[
        "work",
        &home,
        "--only",
        "depth=3,2",
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
    let affinity_file = std::fs::read_dir(place.path(&format!("{home}/affinity")))
        .unwrap()
        .next()
        .unwrap()
        .unwrap()
        .path();
    let text = std::fs::read_to_string(&affinity_file).unwrap();
    std::fs::write(&affinity_file, OTHER_DEVICE).unwrap();
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
    std::fs::write(&affinity_file, text).unwrap();
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
