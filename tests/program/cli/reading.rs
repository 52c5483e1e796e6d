//! Commands that read results, scripts and scenes, and the benchmark.

use serde_json::Value as Json;

use super::workplace::Workplace;

fn json(text: &str) -> Json {
    serde_json::from_str(text).unwrap_or_else(|e| panic!("{e}: {text}"))
}

#[test]
fn a_plan_marks_cells_as_new_or_cached_and_writes_nothing() {
    let place = Workplace::new();
    let page = place.succeed(&["plan", "night.lua"]).stdout;
    assert!(
        page.contains("4 cells (0 cached), 2 references (0 cached)"),
        "{page}"
    );
    assert!(page.contains("estimate: at most"), "{page}");
    assert!(!place.path("out").exists());
    assert_eq!(
        place.succeed(&["run", "night.lua", "--dry-run"]).stdout,
        page
    );
    assert!(!place.path("out").exists());

    place.succeed(&["run", "night.lua", "-q", "--only", "depth=2"]);
    let plan = json(&place.succeed(&["plan", "night.lua", "--json"]).stdout);
    let states: Vec<&str> = plan["cell_states"]
        .as_array()
        .unwrap()
        .iter()
        .map(|c| c["state"].as_str().unwrap())
        .collect();
    assert_eq!(states, ["cached", "cached", "new", "new"]);
    assert!(
        plan["cell_states"][0]["cached_in"]
            .as_str()
            .unwrap()
            .starts_with("out/night-")
    );
    assert_eq!(plan["cells"][2]["point"]["depth"], 4);
    assert_eq!(
        plan["estimate"]["by_samples"], 3,
        "two cells and a reference"
    );
    assert_eq!(plan["measure"]["metrics"].as_array().unwrap().len(), 2);
}

#[test]
fn skipped_points_are_listed_with_their_reason() {
    let place = Workplace::new();
    let script = place.read("night.lua").replace(
        "x:render",
        "x:skip(\"too shallow\", function(p) return p.depth < 4 end)\nx:render",
    );
    place.write("night.lua", &script);
    let page = place.succeed(&["plan", "night.lua"]).stdout;
    assert!(page.contains("skipped depth=2: too shallow"), "{page}");
    let plan = json(&place.succeed(&["plan", "night.lua", "--json"]).stdout);
    assert_eq!(plan["skipped"][0]["reason"], "too shallow");
    assert_eq!(plan["cells"].as_array().unwrap().len(), 2);
}

#[test]
fn check_reads_scripts_and_scenes_and_writes_nothing() {
    let place = Workplace::new();
    place.write(
        "quad.obj",
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n",
    );
    let before = place.files(".");
    let output = place
        .succeed(&["check", "night.lua", "ball.scn", "quad.obj"])
        .stdout;
    assert!(
        output.contains("ok  night.lua: experiment `night`, 4 cells, 2 references"),
        "{output}"
    );
    assert!(
        output.contains("ok  ball.scn: scene, 0 triangles, 2 spheres"),
        "{output}"
    );
    assert!(
        output.contains("ok  quad.obj: scene, 6 triangles"),
        "the quad in a studio: {output}"
    );
    assert!(
        output.contains("\n    objects   quad, stage_ground, stage_light\n"),
        "{output}"
    );
    let options = ["check", "quad.obj?stage=none", "--json"];
    let alone = json(&place.succeed(&options).stdout);
    assert_eq!(alone["files"][0]["scene"]["triangles"], 2, "{alone}");
    let error = place.fail(2, &["check", "night.lua?depth=3"]);
    assert!(
        error.contains("lumbre plan night.lua depth=VALUE"),
        "{error}"
    );
    let bare = place.succeed(&["check", "ball.scn"]).stdout;
    assert!(
        bare.contains("\n    camera    at (") && bare.contains("\n    box       ("),
        "{bare}"
    );
    assert_eq!(place.files("."), before);
}

#[test]
fn notes_are_taken_listed_and_found() {
    let place = Workplace::new();
    let script = std::fs::read_to_string(place.path("night.lua")).unwrap();
    let noted = script.replace("return x", "x:note(\"first try #draft\")\nreturn x");
    std::fs::write(place.path("night.lua"), noted).unwrap();
    place.succeed(&["run", "night.lua", "-q"]);
    place.succeed(&["note", "latest", "chosen for <figure> 3 #final"]);
    let notes = place.succeed(&["note", "latest"]).stdout;
    let lines: Vec<&str> = notes.lines().collect();
    assert_eq!((lines[0], lines.len()), ("first try #draft", 2));
    assert!(
        lines[1].ends_with(" chosen for <figure> 3 #final"),
        "{notes}"
    );
    let listed = place.succeed(&["ls", "#final"]).stdout;
    assert!(listed.contains("  #draft  #final\n"), "{listed}");
    assert_eq!(place.succeed(&["ls", "#other"]).stdout, "");
    assert!(
        place
            .fail(2, &["note", "latest", "two\nlines"])
            .contains("a line")
    );
    place.succeed(&["report", "latest", "-q"]);
    let page = std::fs::read_to_string(place.path("out/latest/report/index.html")).unwrap();
    assert!(page.contains("chosen for &lt;figure&gt; 3 #final"));
    // A damaged file of notes is named, and never written over.
    let file = place.path("out/latest/notes.json");
    std::fs::write(&file, "{").unwrap();
    assert!(
        place
            .fail(2, &["note", "latest", "more"])
            .contains("notes.json")
    );
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "{");
}

#[test]
fn ls_and_show_print_the_stored_results() {
    let place = Workplace::new();
    let nothing = place.succeed(&["ls"]);
    assert!(
        nothing.stdout.is_empty() && nothing.stderr.contains("no experiments in out"),
        "{}",
        nothing.stderr
    );
    place.succeed(&["run", "night.lua", "-q"]);
    let line = place.succeed(&["ls"]).stdout;
    assert!(
        line.contains("4 cells: 4 done") && line.lines().count() == 1,
        "an experiment is one line:\n{line}"
    );
    let page = place.succeed(&["ls", "--runs"]).stdout;
    assert!(
        page.contains("4 cells: 4 done") && page.contains("16 spp"),
        "{page}"
    );
    let listed = json(&place.succeed(&["ls", "--json"]).stdout);
    let run = &listed["experiments"][0]["runs"][0];
    assert_eq!(run["state"], "done");
    let id = run["run"].as_str().unwrap();

    let page = place.succeed(&["show", &id[..12]]).stdout;
    for expected in [
        "render.integrator",
        "bpt",
        "done: ",
        "rmse",
        "final.exr",
        "16 spp",
    ] {
        assert!(page.contains(expected), "{expected}: {page}");
    }
    let folder = run["folder"].as_str().unwrap();
    let shown = json(&place.succeed(&["show", folder, "--json"]).stdout);
    assert_eq!(shown["config"]["run"], id);
    assert_eq!(shown["done"]["samples"], 16);
    assert_eq!(shown["last"]["samples"], 16);
    assert_eq!(
        shown["columns"],
        serde_json::json!(["psnr", "rmse", "psnr_net", "rmse_net"])
    );
    assert!(place.fail(2, &["show", "zebra"]).contains("lumbre ls"));
    assert!(
        place
            .fail(2, &["show", "0123456789abcdef"])
            .contains("no run matches")
    );
}

#[test]
fn ls_filters_by_words_states_and_the_latest_night() {
    let place = Workplace::new();
    place.succeed(&["run", "night.lua", "-q", "--only", "depth=2"]);
    place.write(
        "other.lua",
        &place.read("night.lua").replace("\"night\"", "\"other\""),
    );
    place.succeed(&["run", "other.lua", "-q"]);
    let runs = |args: &[&str]| -> Vec<String> {
        let all: Vec<&str> = ["ls", "--json"].iter().chain(args).copied().collect();
        let listed = json(&place.succeed(&all).stdout);
        let runs = listed["experiments"]
            .as_array()
            .unwrap()
            .iter()
            .flat_map(|e| {
                let name = e["name"].as_str().unwrap().to_owned();
                let runs = e["runs"].as_array().unwrap().iter();
                runs.map(move |r| {
                    format!(
                        "{name} {} {}",
                        r["path"].as_str().unwrap(),
                        r["state"].as_str().unwrap()
                    )
                })
            });
        runs.collect()
    };
    assert_eq!(runs(&[]).len(), 6);
    assert_eq!(runs(&["depth=4", "REP=1"]), ["other depth=4/rep=1 done"]);
    assert_eq!(runs(&["night", "--state", "done"]).len(), 2);
    assert_eq!(
        runs(&["--state", "failed", "--state", "pending"]),
        Vec::<String>::new()
    );
    assert_eq!(runs(&["--latest"]).len(), 4);
    let page = place.succeed(&["ls", "depth=4"]).stdout;
    assert!(
        page.contains("2 matching cells: 2 done") && !page.contains("depth=2"),
        "{page}"
    );
    assert!(
        place
            .succeed(&["ls", "zebra"])
            .stderr
            .contains("no runs like that")
    );
    assert!(place.path("out/index.jsonl").exists());
    std::fs::remove_file(place.path("out/index.jsonl")).unwrap();
    assert_eq!(
        runs(&["depth=4", "REP=1"]),
        ["other depth=4/rep=1 done"],
        "the result is the same without the index"
    );
    let latest = json(&place.succeed(&["show", "latest", "--json"]).stdout);
    assert_eq!(latest["config"]["experiment"], "other");
    assert_eq!(latest["config"]["path"], "depth=4/rep=1");
    assert_eq!(latest["version"], 1);
    // Words select a run of any night, and of the latest one where several nights have it.
    let path = |what: &str| {
        let shown = json(&place.succeed(&["show", what, "--json"]).stdout);
        let config = &shown["config"];
        format!("{} {}", config["experiment"], config["path"])
    };
    assert_eq!(path("depth=2 rep=1"), "\"other\" \"depth=2/rep=1\"");
    assert_eq!(path("night depth=2 rep=1"), "\"night\" \"depth=2/rep=1\"");
    let several = place.fail(2, &["show", "depth=2"]);
    assert!(
        several.contains("2 runs") && several.contains("depth=2/rep=0"),
        "{several}"
    );
    assert!(
        place
            .fail(2, &["show", "depth=20 rep=0"])
            .contains("no run matches")
    );
    let report = json(&place.succeed(&["report", "night-", "-q", "--json"]).stdout);
    assert_eq!(report["version"], 1);
    let folder = report["folder"].as_str().unwrap();
    assert!(folder.contains("night-"), "{folder}");
    let first = report["items"][0]["files"][0].as_str().unwrap();
    assert!(place.path(first).exists(), "{first}");
    assert!(
        place
            .fail(2, &["report", "zebra"])
            .contains("no night `zebra`")
    );
    let noted = place.succeed(&["ls", "--threads", "2"]).stderr;
    assert!(
        noted.contains("`--threads` has no effect on `lumbre ls`"),
        "{noted}"
    );
    assert!(
        !place
            .succeed(&["ls", "--help"])
            .stdout
            .contains("--threads")
    );
    assert!(
        place
            .succeed(&["run", "--help"])
            .stdout
            .contains("--threads")
    );
    let checked = json(&place.succeed(&["check", "night.lua", "--json"]).stdout);
    assert_eq!(checked["files"][0]["ok"], true);
    assert_eq!(checked["files"][0]["experiment"]["cells"], 4);
    let checked = json(&place.succeed(&["check", "ball.scn", "--json"]).stdout);
    let scene = &checked["files"][0]["scene"];
    assert_eq!(scene["camera"]["position"][2], 4.0, "{scene}");
    assert_eq!(scene["spheres"], 2);
}

#[test]
fn status_reports_the_progress_of_a_night_from_its_files() {
    let place = Workplace::new();
    assert!(place.fail(2, &["status"]).contains("no night in out"));
    place.succeed(&["run", "night.lua", "-q"]);
    let page = place.succeed(&["status"]).stdout;
    assert!(
        page.contains("finished") && page.contains("4: 4 done") && page.contains("2 of 2"),
        "{page}"
    );
    let facts = json(&place.succeed(&["status", "--json"]).stdout);
    assert_eq!(
        (facts["state"].as_str(), facts["cells"]["done"].as_u64()),
        (Some("finished"), Some(4))
    );
    assert_eq!(facts["current"], Json::Null);
    // A run whose last file is missing is not done, whatever the journal records.
    let done = place.first_ending("out", "done.json");
    std::fs::remove_file(place.path(&done)).unwrap();
    let facts = json(&place.succeed(&["status", "out/latest", "--json"]).stdout);
    assert_eq!(
        (
            facts["cells"]["done"].as_u64(),
            facts["cells"]["waiting"].as_u64()
        ),
        (Some(3), Some(1))
    );
    // A copy of the folder without any other file, as from another machine.
    let night = place.first_ending("out", "plan.json");
    let night = night.trim_end_matches("/plan.json");
    std::fs::rename(place.path(night), place.path("copy")).unwrap();
    let facts = json(&place.succeed(&["status", "copy", "--json"]).stdout);
    assert_eq!(facts["cells"]["done"], 3);
    // Without a terminal `watch` prints the same, and a damaged journal is read up to the damage.
    assert!(
        place
            .succeed(&["watch", "copy"])
            .stdout
            .contains("4: 3 done, 1 to go")
    );
    place.write("copy/journal.jsonl", "{\"event\": \"night_sta");
    let facts = json(&place.succeed(&["status", "copy", "--json"]).stdout);
    assert_eq!(
        (facts["state"].as_str(), facts["cells"]["done"].as_u64()),
        (Some("not started"), Some(3))
    );
}

#[test]
fn a_finished_run_has_at_most_eight_files_apart_from_snapshots_and_films() {
    let place = Workplace::new();
    place.succeed(&["run", "night.lua", "-q"]);
    for done in place
        .files("out")
        .iter()
        .filter(|f| f.ends_with("done.json") || f.ends_with("ref.json"))
    {
        let folder = done.rsplit_once('/').unwrap().0;
        let files = place.files(folder);
        // The halves of a reference count as snapshots.
        let is_counted = |f: &&String| {
            !["/snap-", "/films/", "/half-"]
                .iter()
                .any(|part| f.contains(part))
        };
        let counted: Vec<&String> = files.iter().filter(is_counted).collect();
        assert!(counted.len() <= 8, "{counted:?}");
    }
}

#[test]
fn the_schema_is_printed_for_editors_and_for_programs() {
    let place = Workplace::new();
    let lua = place.succeed(&["schema", "--lua"]).stdout;
    assert!(
        lua.contains("---@meta") && lua.contains("experiment"),
        "{lua}"
    );
    let tables = json(&place.succeed(&["schema", "--json"]).stdout);
    for table in [
        "integrators",
        "metrics",
        "tonemaps",
        "backends",
        "material_params",
        "formats",
    ] {
        assert!(!tables[table].as_array().unwrap().is_empty(), "{table}");
    }
    assert_eq!(tables["integrators"][0]["name"], "bpt");
    for row in tables["integrators"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|row| row["name"] != "bpt")
    {
        let fields = row["params"]["fields"].as_array().unwrap();
        let select = fields.iter().find(|f| f["key"] == "select").unwrap();
        assert_eq!(
            select["default"], "power",
            "{}: the default light selection",
            row["name"]
        );
    }
}

#[test]
fn doctor_reports_backends_cores_and_terminal() {
    let place = Workplace::new();
    let page = place.succeed(&["doctor"]).stdout;
    for expected in [
        "backend cpu",
        "backend mock",
        "cores",
        "results in out",
        "standard output",
    ] {
        assert!(page.contains(expected), "{expected}: {page}");
    }
    let facts = json(&place.succeed(&["doctor", "--json"]).stdout);
    assert!(facts["cores"].as_u64().unwrap() >= 1);
    assert_eq!(facts["out"]["writable"], true);
    assert_eq!(facts["terminal"]["stdout"], false);
    assert!(!place.path("out").exists());
}

#[test]
fn bench_measures_every_integrator_and_stores_the_figures() {
    let place = Workplace::new();
    place.write("ball.scn", super::verify::SCENE);
    let ended = place.succeed(&["bench", "ball.scn", "--only", "--repeats", "3"]);
    let stored = place.json("out/bench.json");
    assert_eq!(
        (&stored["repeats"], &stored["relative_rmse"]),
        (&3.into(), &0.05.into())
    );
    let [scene] = &stored["scenes"].as_array().unwrap()[..] else {
        panic!("{stored}")
    };
    assert_eq!(scene["scene"], "ball.scn");
    for name in lumbre_light::transport::integrator::INTEGRATORS
        .iter()
        .map(|row| row.name)
    {
        let figures = &scene["integrators"][name];
        assert!(figures["mpaths_per_s_in_lanes"].as_f64().unwrap() > 0.0);
        assert!(
            figures["mpaths_per_s"].as_f64().unwrap() > 0.0
                && figures["spread"].as_f64().unwrap() >= 0.0
        );
        let variance = figures["variance"].as_f64();
        assert_eq!(
            figures["efficiency"].is_number(),
            variance.is_some(),
            "{figures}"
        );
        let row = ended
            .stdout
            .lines()
            .find(|line| line.starts_with("ball") && line.contains(name))
            .unwrap();
        assert_eq!(row.ends_with(" -"), variance.is_none(), "{row}");
    }
    assert!(
        scene["integrators"]["nee"]["variance"].is_number(),
        "{scene}"
    );
    assert!(place.fail(2, &["bench", "--only"]).contains("SCENE"));
    assert!(
        place
            .fail(2, &["bench", "none.scn", "--only"])
            .contains("none.scn")
    );
}

#[test]
fn bench_measures_scenes_with_options_and_views() {
    let place = Workplace::new();
    place.write(
        "lit.lua",
        "local s = scene { resolution = { 16, 9 }, max_depth = 2 }\n\
         local on = s:option('lamp', { 'on', 'off' })\n\
         s:add { shape = shape.sphere { radius = 1 }, material = 'white' }\n\
         s:material('white', {})\n\
         s:environment { color = on == 'on' and { 1, 1, 1 } or { 0.1, 0.1, 0.1 } }\n\
         s:camera { position = { 0, 0, 5 }, target = { 0, 0, 0 }, fov = 40 }\n\
         s:view('aside', { position = { 5, 0, 0 }, target = { 20, 0, 0 }, fov = 40 })\n\
         return s\n",
    );
    let bench =
        |scene: &str| ["bench", scene, "--only", "--mpaths", "--repeats", "1"].map(str::to_owned);
    let mut variances = Vec::new();
    for (scene, label) in [
        ("lit.lua", "lit "),
        ("lit.lua?lamp=off", "lit off "),
        ("lit.lua?lamp=off,camera=aside", "lit off aside "),
    ] {
        let ended = place.succeed(&bench(scene).each_ref().map(String::as_str));
        assert!(
            ended.stdout.lines().any(|line| line.starts_with(label)),
            "{}",
            ended.stdout
        );
        let stored = place.json("out/bench.json");
        assert_eq!(stored["scenes"][0]["scene"], scene);
        variances.push(stored["scenes"][0]["integrators"]["bpt"]["variance"].as_f64());
    }
    // `off` has a tenth of the radiance, and the view `aside` shows only the uniform environment.
    let [Some(on), Some(off), even] = variances[..] else {
        panic!("{variances:?}")
    };
    assert!(
        on > 50.0 * off && off > 0.0 && even.is_none_or(|v| v < 1e-9),
        "{variances:?}"
    );
    for (scene, expected) in [
        ("lit.lua?lamp=dim", "dim"),
        ("lit.lua?camera=asid", "aside"),
        ("lit.lua?lamp", "NAME=VALUE"),
    ] {
        assert!(
            place
                .fail(2, &bench(scene).each_ref().map(String::as_str))
                .contains(expected),
            "{scene}"
        );
    }
}

#[test]
fn every_command_describes_its_arguments() {
    let place = Workplace::new();
    let whole = place.succeed(&["--help"]).stdout;
    assert!(
        whole.contains("Exit codes") && whole.contains("NO_COLOR"),
        "{whole}"
    );
    let verbs = [
        "run", "plan", "check", "ls", "show", "schema", "doctor", "verify", "bench",
    ];
    for verb in verbs {
        assert!(
            whole.contains(&format!("\n  {verb} ")),
            "{verb} is not listed: {whole}"
        );
        let help = place.succeed(&[verb, "--help"]).stdout;
        assert!(help.contains(&format!("Usage: lumbre {verb}")), "{help}");
        // Every argument and option has a description beside or below it.
        let lines: Vec<&str> = help.lines().collect();
        for (i, line) in lines.iter().enumerate() {
            let name = line.trim_start();
            let names_one = line.starts_with(' ')
                && (name.starts_with(['-', '<', '[']) && !name.contains(": "));
            let beside = line
                .trim_start()
                .split("  ")
                .filter(|part| !part.trim().is_empty())
                .count()
                > 1;
            let below = lines
                .get(i + 1)
                .is_some_and(|next| next.starts_with("          "));
            assert!(
                !names_one || beside || below,
                "{verb}: `{line}` has no description"
            );
        }
    }
    let version = place.succeed(&["--version"]).stdout;
    let rest = version
        .trim()
        .strip_prefix(concat!("lumbre ", env!("CARGO_PKG_VERSION")));
    // A checkout states its commit, an unpacked archive none.
    let commit = rest
        .unwrap_or_else(|| panic!("{version}"))
        .trim_start_matches(" (commit ")
        .trim_end_matches(')')
        .trim_end_matches(" with changes");
    assert!(
        commit.is_empty() || (commit.len() == 12 && commit.bytes().all(|b| b.is_ascii_hexdigit())),
        "{version}"
    );
}

#[test]
fn a_closed_output_pipe_is_not_an_error() {
    let place = Workplace::new();
    let mut child = place
        .command(&["schema", "--lua"])
        .stdout(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    assert_eq!(child.wait().unwrap().code(), Some(0));
}
