//! Whole nights: the files that they write, and the effect of running a script twice.

use lumbre_report::exr;

use super::workplace::Workplace;

#[test]
fn a_night_writes_pictures_figures_tables_and_metrics() {
    let place = Workplace::new();
    let night = place.succeed(&["run", "night.lua"]);
    assert!(night.stdout.contains("| depth"), "{}", night.stdout);
    assert!(
        night.stderr.contains("backend mock: a fake clock"),
        "{}",
        night.stderr
    );
    assert!(
        night.stderr.contains("4 done") || night.stderr.contains("6 done"),
        "{}",
        night.stderr
    );
    for expected in ["out/night-", "/figures", "/tables", "/runs"] {
        assert!(night.stderr.contains(expected), "{}", night.stderr);
    }
    let files = place.files("out");
    let count = |end: &str| files.iter().filter(|f| f.ends_with(end)).count();
    assert_eq!(count("/final.exr"), 4);
    assert_eq!(count("/final.png"), 4);
    assert_eq!(count("/done.json"), 4);
    assert_eq!(count("/metrics.csv"), 4 + 2);
    assert_eq!(count("/ref.exr"), 2);
    assert_eq!(count("/ref.json"), 2);
    assert_eq!(count("/snap-16.exr"), 4);
    assert_eq!(count("/summary.csv"), 1);
    assert_eq!(count(".svg"), 2);
    assert_eq!(
        files
            .iter()
            .filter(|f| f.contains("/figures/") && f.ends_with(".png"))
            .count(),
        2
    );
    assert_eq!(count("/tables/errors.md"), 1);
    assert_eq!(count("/tables/errors.csv"), 1);
    assert_eq!(count(".tmp"), 0);
    for name in ["experiment.lua", "plan.json", "env.json", "journal.jsonl"] {
        assert!(place.path("out/latest").join(name).is_file(), "{name}");
    }
    assert_eq!(
        place.read("out/latest/experiment.lua"),
        place.read("night.lua")
    );
    // The number of files per run is bounded: a night may have ten thousand runs.
    for (done, _) in place.finished() {
        let folder = done.trim_end_matches("done.json");
        let own: Vec<&String> = files
            .iter()
            .filter(|f| f.starts_with(folder) && !f.contains("/snap-"))
            .collect();
        assert!(own.len() <= 8, "{own:?}");
    }
}

#[test]
fn a_run_folder_holds_its_configuration_results_and_log() {
    let place = Workplace::new();
    place.succeed(&["run", "night.lua", "depth=4", "-q"]);
    let (done, _) = place.finished().remove(0);
    let folder = done.trim_end_matches("/done.json");
    let id = folder.rsplit('/').next().unwrap();
    assert_eq!(id.len(), 32);
    assert!(folder.contains("depth=4"), "{folder}");

    let config = place.json(&format!("{folder}/config.json"));
    assert_eq!(config["run"], id);
    assert_eq!(config["point"]["depth"], 4);
    assert_eq!(config["render"]["backend"], "mock");

    let done = place.json(&done);
    assert_eq!(done["run"], id);
    assert_eq!(done["samples"], 16);
    assert_eq!(done["invalid"], 0);
    assert_eq!(done["devices"][0]["kind"], "mock");
    assert_eq!(done["seed"], config["seed"]);
    assert!(done["program"].as_str().unwrap().starts_with("lumbre "));
    assert!(
        done["reason"].as_str().unwrap().contains("16 samples"),
        "{}",
        done["reason"]
    );
    assert_eq!(done["scene_hash"].as_str().unwrap().len(), 64);

    let csv = place.read(&format!("{folder}/metrics.csv"));
    let (header, rows) = csv.split_once('\n').unwrap();
    assert!(
        header.starts_with("wave,samples,render_s,wall_s,measure_s,paths,rays,invalid,"),
        "{header}"
    );
    let last: Vec<&str> = rows.lines().last().unwrap().split(',').collect();
    assert_eq!(last[1], "16");
    let column = header.split(',').position(|c| c == "rmse").unwrap();
    let rmse: f64 = last[column].parse().unwrap();
    assert_eq!(done["metrics"]["rmse"].as_f64().unwrap(), rmse);
    assert!(rmse > 0.0 && rmse < 0.1, "{rmse}");

    let log = place.read(&format!("{folder}/log.txt"));
    assert!(
        log.contains("started on mock") && log.contains("done: "),
        "{log}"
    );

    let bytes = std::fs::read(place.path(&format!("{folder}/final.exr"))).unwrap();
    let (image, metadata) = exr::decode(&bytes).unwrap();
    assert_eq!((image.width, image.height), (24, 16));
    let metadata_value = |name: &str| {
        metadata
            .iter()
            .find(|(n, _)| n.ends_with(name))
            .map(|(_, v)| v.clone())
            .unwrap()
    };
    assert_eq!(metadata_value("run"), id);
    assert_eq!(metadata_value("samples"), "16");
    assert_eq!(
        metadata_value("scene_hash"),
        done["scene_hash"].as_str().unwrap()
    );
}

#[test]
fn a_second_night_renders_nothing_and_reports_this() {
    let place = Workplace::new();
    let first = place.succeed(&["run", "night.lua"]);
    let before = place.finished();
    let figure = place.first_ending("out", ".svg");
    std::fs::remove_file(place.path(&figure)).unwrap();
    let second = place.succeed(&["run", "night.lua"]);
    assert!(
        second
            .stderr
            .contains("nothing to do: all 4 cells and 2 references are already done in out/night-"),
        "{}",
        second.stderr
    );
    assert_eq!(place.finished(), before);
    assert_eq!(second.stdout, first.stdout);
    assert!(
        place.path(&figure).is_file(),
        "figures are drawn again from the stored results"
    );
}

#[test]
fn overrides_and_selections_reuse_shared_runs() {
    let place = Workplace::new();
    place.succeed(&["run", "night.lua", "--only", "depth=4"]);
    assert_eq!(place.finished().len(), 2);
    place.succeed(&["run", "night.lua", "depth=4,6"]);
    let finished = place.finished();
    assert_eq!(
        finished.len(),
        4,
        "the runs of depth 4 must be reused: {finished:?}"
    );
    let listed: serde_json::Value =
        serde_json::from_str(&place.succeed(&["ls", "--json"]).stdout).unwrap();
    let states: Vec<&str> = listed["experiments"]
        .as_array()
        .unwrap()
        .iter()
        .flat_map(|e| e["runs"].as_array().unwrap())
        .map(|r| r["state"].as_str().unwrap())
        .collect();
    assert_eq!(states.iter().filter(|s| **s == "done").count(), 4);
    assert_eq!(states.iter().filter(|s| **s == "elsewhere").count(), 2);
}

#[test]
fn a_damaged_run_is_rendered_again_and_no_other() {
    let place = Workplace::new();
    place.succeed(&["run", "night.lua", "-q"]);
    let before = place.finished();
    let damaged = before[0].0.replace("done.json", "final.exr");
    std::fs::remove_file(place.path(&damaged)).unwrap();
    place.succeed(&["run", "night.lua", "-q"]);
    assert!(place.path(&damaged).is_file());
    let after = place.finished();
    assert_eq!(after[1..], before[1..]);
    assert_ne!(after[0].1, before[0].1);
}

#[test]
fn a_failed_cell_is_recorded_and_the_night_continues() {
    let place = Workplace::new();
    let script = place.read("night.lua").replace(
        "return stop.samples(16)",
        "return stop.any { stop.samples(16), stop.predicate(function(row) if p.depth == 2 then error('lens fell off') end end) }",
    );
    place.write("night.lua", &script);
    let night = place.run(&["run", "night.lua"]);
    assert_eq!(night.status, 3, "{}", night.stderr);
    assert!(night.stderr.contains("lens fell off"), "{}", night.stderr);
    assert_eq!(
        place.finished().len(),
        2,
        "the cells of the other depth are done"
    );
    let listed = place.succeed(&["ls", "--latest"]).stdout;
    assert!(
        listed.contains("2 done, 2 failed") && listed.contains("lens fell off"),
        "{listed}"
    );
    // Available results are reported nevertheless, and the next night tries again.
    assert!(place.path("out/latest/tables/errors.md").is_file());
    assert_eq!(place.run(&["run", "night.lua", "-q"]).status, 3);
}

#[test]
fn quiet_nights_print_only_tables() {
    let place = Workplace::new();
    let night = place.succeed(&["run", "night.lua", "--quiet"]);
    assert!(night.stdout.contains("| depth"), "{}", night.stdout);
    assert!(!night.stderr.contains("backend"), "{}", night.stderr);
}

#[test]
fn the_backend_of_the_command_line_overrides_that_of_the_script() {
    let place = Workplace::new();
    let script = place
        .read("night.lua")
        .replace("backend = \"mock\"", "backend = \"cpu\"");
    place.write("night.lua", &script);
    let plan: serde_json::Value = serde_json::from_str(
        &place
            .succeed(&["plan", "night.lua", "--backend", "mock", "--json"])
            .stdout,
    )
    .unwrap();
    assert_eq!(plan["cells"][0]["backend"], "mock");
    assert!(
        place
            .fail(2, &["plan", "night.lua", "--backend", "mok"])
            .contains("did you mean `mock`")
    );
}

/// Simulates a full disk by a limit on file size: pictures do not fit, all small files do.
#[cfg(unix)]
#[test]
fn a_full_disk_fails_cells_and_leaves_no_unfinished_file() {
    let place = Workplace::new();
    let script = place
        .read("night.lua")
        .replace("resolution = { 24, 16 }", "resolution = { 160, 120 }");
    place.write("night.lua", &script);
    let limited = format!(
        "trap '' XFSZ; ulimit -f 60; exec '{}' run night.lua",
        env!("CARGO_BIN_EXE_lumbre")
    );
    let output = std::process::Command::new("sh")
        .args(["-c", &limited])
        .current_dir(place.path("."))
        .output()
        .unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(3), "{stderr}");
    assert!(
        stderr.contains("cannot write") && stderr.contains("half-a.exr"),
        "{stderr}"
    );
    let files = place.files("out");
    let is_unfinished =
        |f: &&String| f.ends_with(".tmp") || f.ends_with(".exr") || f.ends_with("done.json");
    assert_eq!(files.iter().find(is_unfinished), None);
    place.succeed(&["run", "night.lua", "-q"]);
    assert_eq!(place.finished().len(), 4);
}

#[test]
fn layers_are_stored_beside_the_picture() {
    let place = Workplace::new();
    let script = |films: &str| {
        format!(
            r#"
local x = experiment("layers", {{ seed = 7 }})
x:render(function(p)
  return {{ scene = "ball.scn", integrator = "nee", max_depth = 2, resolution = {{ 24, 16 }}, films = {films} }}
end)
x:reference {{ from = function(p) return {{ integrator = "bpt" }} end, stop = stop.samples(4) }}
x:measure {{ rmse = metric.rmse() }}
x:stop(stop.samples(8))
return x
"#
        )
    };
    place.write(
        "layers.lua",
        &script(r#"{ "strategies", "depth", "normal", "depth" }"#),
    );
    let plan = place.succeed(&["plan", "layers.lua"]);
    assert!(
        plan.stdout.contains("of it for layers and time bins"),
        "{}",
        plan.stdout
    );
    place.succeed(&["run", "layers.lua", "-q"]);
    let (done, _) = place.finished().remove(0);
    let folder = done.trim_end_matches("/done.json");
    let films = [
        "depth-1",
        "depth-2",
        "strategies-s0-t2-weighted",
        "strategies-s0-t2-raw",
        "strategies-s1-t1-weighted",
        "strategies-s1-t1-raw",
        "strategies-s0-t3-weighted",
        "strategies-s0-t3-raw",
        "strategies-s1-t2-weighted",
        "strategies-s1-t2-raw",
        "strategies-s2-t1-weighted",
        "strategies-s2-t1-raw",
        "normal",
    ];
    assert_eq!(place.json(&done)["films"], serde_json::json!(films));
    let files = place.files("out");
    let count = |end: &str| {
        files
            .iter()
            .filter(|f| f.contains("/films/") && f.ends_with(end))
            .count()
    };
    assert_eq!(
        (count(".exr"), count(".png")),
        (12, 13 + 3),
        "13 layers, of which normals are in the picture, and 3 sheets; references have no layers"
    );
    let shown = place.succeed(&["show", folder]);
    assert!(
        shown.stdout.contains("films/depth-2.exr")
            && shown.stdout.contains("films/pyramid-raw.png")
    );

    let read = |name: &str| {
        let bytes = std::fs::read(place.path(&format!("{folder}/{name}.exr"))).unwrap();
        exr::decode(&bytes).unwrap()
    };
    let (whole, _) = read("final");
    let ((first, facts), (second, _)) = (read("films/depth-1"), read("films/depth-2"));
    assert!(
        facts.contains(&("film".to_owned(), "depth-1".to_owned())),
        "{facts:?}"
    );
    for ((a, b), sum) in first.data.iter().zip(&second.data).zip(&whole.data) {
        assert!((0..3).all(|c| (a[c] + b[c] - sum[c]).abs() <= 1e-5 * sum[c]));
    }

    let bytes = std::fs::read(place.path(&format!("{folder}/final.exr"))).unwrap();
    assert!(exr::decode_group(&bytes, "Ns").is_ok());

    // The same films in another order give the same run; other films give another run with the same
    // reference.
    place.write(
        "layers.lua",
        &script(r#"{ "normal", "depth", "strategies" }"#),
    );
    assert!(
        place
            .succeed(&["run", "layers.lua"])
            .stderr
            .contains("nothing to do")
    );
    place.write("layers.lua", &script(r#""depth""#));
    place.succeed(&["run", "layers.lua", "-q"]);
    assert_eq!(place.ending("out", "/ref.json").len(), 1);
    assert_eq!(place.finished().len(), 2);
}

#[test]
fn films_in_files_of_their_own_are_those_in_the_picture() {
    let place = Workplace::new();
    let mut found = Vec::new();
    for keep in ["picture", "files"] {
        let script = format!(
            r#"
local x = experiment("films", {{ seed = 7 }})
x:render(function(p)
  return {{ scene = "ball.scn", integrator = "nee", max_depth = 3, resolution = {{ 24, 16 }}, backend = "cpu",
    films = {{ "normal", "bounces" }} }}
end)
x:measure {{ keep = {{ films = "{keep}" }} }}
x:stop(stop.samples(8))
return x
"#
        );
        place.write("films.lua", &script);
        place.succeed(&["run", "films.lua", "-q", "--out", keep]);
        place.succeed(&["report", "--out", keep, "--to", &format!("{keep}/page")]);
        let files = place.files(keep);
        let ending = |end: &str| files.iter().find(|file| file.ends_with(end));
        let bytes = |end: &str| std::fs::read(place.path(ending(end).unwrap())).unwrap();
        let normals = match ending("films/normal.exr") {
            None => exr::decode_group(&bytes("final.exr"), "Ns").unwrap(),
            Some(_) => exr::decode(&bytes("films/normal.exr")).unwrap().0,
        };
        let is_map = |file: &&String| file.contains("/bounces") && file.ends_with(".svg");
        let map = place.read(files.iter().find(is_map).unwrap());
        let map = map.split("base64,").nth(1).unwrap().split('"').next();
        found.push((
            ending("films/normal.exr").is_some(),
            exr::decode(&bytes("final.exr")).unwrap().0,
            normals,
            bytes("films/normal.png").len(),
            map.unwrap().to_owned(),
        ));
    }
    assert!(!found[0].0 && found[1].0);
    found[0].0 = true;
    assert!(
        found[0] == found[1],
        "picture, normals, or the figure of the report differ"
    );
}

#[test]
fn unsupported_layers_are_refused_while_planning() {
    let place = Workplace::new();
    let with = |fields: &str| {
        place.write(
            "t.lua",
            &format!(
                "local x = experiment(\"t\", {{ seed = 1 }})\nx:render(function(p)\n  return {{ scene = \"ball.scn\", \
                 integrator = \"bpt\", {fields} }}\nend)\nx:stop(stop.samples(1))\nreturn x\n"
            ),
        );
        let ended = place.run(&["run", "t.lua"]);
        assert_eq!(ended.status, 2, "{}", ended.stderr);
        // Lines are wrapped at the width of the terminal.
        ended
            .stderr
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(" ")
    };
    let error = with(r#"films = "depths""#);
    assert!(error.contains("did you mean `depth`"), "{error}");
    let error = with(r#"films = "depth", backend = "mock""#);
    assert!(error.contains("not support the layer `depth`"), "{error}");
    let error = with(r#"films = "strategies", max_depth = 50, resolution = { 4096, 4096 }"#);
    assert!(
        error.contains("8 GiB") && error.contains("lower max_depth"),
        "{error}"
    );
}

#[test]
fn every_measurement_is_captured_if_the_script_requests_it() {
    let place = Workplace::new();
    let script = place
        .read("night.lua")
        .replace("exr = \"pow2\"", "png = \"every\"");
    place.write(
        "night.lua",
        &script.replace(
            "rmse = ",
            "display = tonemap.gamma { gamma = 2.2 }, rmse = ",
        ),
    );
    place.succeed(&["run", "night.lua", "-q"]);
    for (done, _) in place.finished() {
        let folder = done.trim_end_matches("/done.json");
        let measured = place.read(&format!("{folder}/metrics.csv")).lines().count() - 1;
        let captures: Vec<String> = place
            .files(folder)
            .into_iter()
            .filter(|f| f.contains("/snap-") && f.ends_with(".png"))
            .collect();
        assert!(measured > 1 && captures.len() == measured, "{captures:?}");
        assert!(
            place
                .files(folder)
                .iter()
                .all(|f| !f.contains("/snap-") || f.ends_with(".png")),
            "no EXR snapshots were requested"
        );
        let capture = captures
            .iter()
            .find(|f| !f.ends_with("snap-16.png"))
            .unwrap();
        // The script's display gamma, that of the theses, applies to both, so the last capture
        // equals the final picture.
        assert_eq!(
            std::fs::read(place.path(&format!("{folder}/snap-16.png"))).unwrap(),
            std::fs::read(place.path(&format!("{folder}/final.png"))).unwrap()
        );
        // A capture identifies its run, whose last picture is compared.
        assert!(
            place
                .succeed(&["reproduce", capture])
                .stdout
                .ends_with("identical\n")
        );
    }
}
