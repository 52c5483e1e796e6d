//! Invalid input that is refused before any work: status 2, one clear error, nothing written.

use super::workplace::Workplace;

fn refused(place: &Workplace, args: &[&str]) -> String {
    let before = place.files(".");
    let error = place.fail(2, args);
    assert_eq!(place.files("."), before, "{args:?} wrote files");
    error
}

#[test]
fn a_missing_script_is_reported_with_a_similar_name() {
    let place = Workplace::new();
    let error = refused(&place, &["run", "nihgt.lua"]);
    assert!(
        error.contains("there is no script nihgt.lua")
            && error.contains("did you mean `night.lua`?"),
        "{error}"
    );
    let error = refused(&place, &["run", "nowhere/night.lua"]);
    assert!(error.contains("there is no folder nowhere"), "{error}");
}

#[test]
fn a_folder_instead_of_a_script_is_refused() {
    let place = Workplace::new();
    let error = refused(&place, &["run", "."]);
    assert!(
        error.contains("is a folder") && error.contains("night.lua"),
        "{error}"
    );
    assert!(refused(&place, &["check", "."]).contains("is a folder"));
}

#[test]
fn an_unknown_command_is_reported_with_a_similar_one() {
    let place = Workplace::new();
    assert!(refused(&place, &["runn", "night.lua"]).contains("'run'"));
    let help = refused(&place, &[]);
    for expected in ["Usage", "Start with:", "lumbre render", "Clusters:"] {
        assert!(help.contains(expected), "{help}");
    }
    assert!(refused(&place, &["run", "night.lua", "depth"]).contains("AXIS=VALUE"));
}

#[test]
fn scenes_and_scripts_that_are_mistaken_for_each_other_get_the_right_command() {
    let place = Workplace::new();
    let error = refused(&place, &["run", "ball.scn"]);
    assert!(
        error.contains("`lumbre render ball.scn` renders it"),
        "{error}"
    );
    place.write("scene.lua", "local s = scene {}\nreturn s\n");
    let error = refused(&place, &["run", "scene.lua"]);
    assert!(error.contains("`lumbre render` renders a scene"), "{error}");
    assert!(!error.contains("script::"), "{error}");
    let error = refused(&place, &["render", "night.lua"]);
    assert!(error.contains("`lumbre run` runs an experiment"), "{error}");
}

#[test]
fn a_misspelt_key_is_reported_with_the_script_and_a_similar_key() {
    let place = Workplace::new();
    let script = place
        .read("night.lua")
        .replace("max_depth = p.depth", "max_dpeth = p.depth");
    place.write("night.lua", &script);
    for verb in ["run", "plan", "check"] {
        let error = refused(&place, &[verb, "night.lua"]);
        assert!(
            error.contains("max_dpeth") && error.contains("max_depth"),
            "{error}"
        );
        assert!(error.contains("night.lua"), "{error}");
    }
}

#[test]
fn broken_and_hostile_scripts_cause_errors_and_no_crashes() {
    let place = Workplace::new();
    for (name, text, expected) in [
        ("cut.lua", "local x = experiment(\"night\", {", "cut.lua"),
        ("empty.lua", "", "return x"),
        (
            "os.lua",
            "os.execute('touch oops') return experiment('a')",
            "os",
        ),
        ("loop.lua", "while true do end", "loop.lua"),
    ] {
        place.write(name, text);
        let error = refused(&place, &["check", name]);
        assert!(error.contains(expected), "{name}: {error}");
    }
    std::fs::write(place.path("binary.lua"), [0x1b, b'L', b'u', b'a', 0, 1, 2]).unwrap();
    refused(&place, &["run", "binary.lua"]);
}

#[test]
fn unknown_axes_and_values_are_reported_by_name() {
    let place = Workplace::new();
    let error = refused(&place, &["run", "night.lua", "dpeth=3"]);
    assert!(
        error.contains("no axis `dpeth`") && error.contains("`depth`"),
        "{error}"
    );
    let error = refused(&place, &["plan", "night.lua", "--only", "depth=3"]);
    assert!(error.contains("no value `3`"), "{error}");
}

#[test]
fn broken_scenes_are_reported_with_their_file() {
    let place = Workplace::new();
    place.write("cut.scn", "{ \"resolution\": [8, 8], \"camera\": {");
    place.write("what.xyz", "?");
    let error = refused(
        &place,
        &["check", "cut.scn", "ball.scn", "what.xyz", "missing.obj"],
    );
    assert!(
        error.contains("cut.scn") && error.contains("what.xyz") && error.contains("missing.obj"),
        "{error}"
    );
    // Vertices too far away for any camera, which is detected only after the whole file was read.
    let far = r#"{ "asset": { "version": "2.0" }, "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3" }],
        "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
        "buffers": [{ "byteLength": 36, "uri": "data:;base64,5rFhfwAAAAAAAAAA5rFh/wAAAAAAAAAAAAAAAAAAgD8AAAAA" }] }"#;
    place.write("far.gltf", far);
    let error = refused(&place, &["check", "ball.scn", "far.gltf"]);
    assert!(error.contains("far.gltf: camera"), "{error}");
    let script = place.read("night.lua").replace("ball.scn", "cut.scn");
    place.write("night.lua", &script);
    let error = refused(&place, &["run", "night.lua"]);
    assert!(error.contains("cut.scn"), "{error}");
}

#[test]
fn an_output_folder_that_cannot_be_written_is_refused_before_rendering() {
    let place = Workplace::new();
    place.write("taken", "a file");
    let error = refused(&place, &["run", "night.lua", "--out", "taken"]);
    assert!(
        error.contains("cannot write to taken") && error.contains("--out"),
        "{error}"
    );
    let error = refused(&place, &["run", "night.lua", "--out", "taken/below"]);
    assert!(error.contains("cannot write to taken/below"), "{error}");
}

#[test]
fn a_missing_texture_is_an_error_unless_lenient() {
    let place = Workplace::new();
    let scene = place.read("ball.scn").replacen(
        "\"name\": \"grey\",",
        "\"name\": \"grey\", \"albedotexture\": \"gone.png\",",
        1,
    );
    place.write("ball.scn", &scene);
    for verb in ["check", "plan", "run"] {
        let file = if verb == "check" {
            "ball.scn"
        } else {
            "night.lua"
        };
        let error = refused(&place, &[verb, file]);
        assert!(
            error.contains("material `grey`") && error.contains("gone.png"),
            "{verb}: {error}"
        );
        let ended = place.run(&[verb, file, "--lenient"]);
        let output = ended.stdout + &ended.stderr;
        assert!(
            ended.status == 0
                && output.contains("gone.png")
                && output.contains("constant value is used"),
            "{verb}: {output}"
        );
    }
}

#[test]
fn a_picture_or_comparison_that_is_asked_for_wrongly_is_answered_with_the_remedy() {
    let place = Workplace::new();
    std::fs::create_dir(place.path("rooms")).unwrap();
    for file in ["rooms/a.glb", "room.fbx", "room.zip", "notes.txt"] {
        place.write(file, "?");
    }
    for (words, expected) in [
        (
            "render bal.scn",
            "no file `bal.scn` (did you mean `ball.scn`?)",
        ),
        (
            "compare bal.scn",
            "no file `bal.scn` (did you mean `ball.scn`?)",
        ),
        ("render romms/a.glb", "there is no folder romms"),
        ("render rooms", "`rooms` is a folder (scenes in it: a.glb)"),
        ("render room.fbx", "export the scene as glTF"),
        ("render room.zip", "unpack this archive"),
        ("render notes.txt", "supported: .lua, .gltf"),
        ("render ball.scn -i path", "path tracing is `nee`"),
        ("render ball.scn bdpt", "a technique follows `-i`"),
        (
            "render ball.scn -i nee -i bdpt",
            "lumbre compare FILE --technique",
        ),
        (
            "render ball.scn -i nee integrator=bdpt",
            "`integrator` is given twice",
        ),
        (
            "render ball.scn --depth 3 max_depth=4",
            "`max_depth` is given twice",
        ),
        ("render ball.scn -o none/a.exr", "no folder none: create it"),
        ("compare ball.scn -t nee,nee", "names `nee` twice"),
        (
            "compare ball.scn integrator=nee",
            "give techniques by --technique",
        ),
        ("compare ball.scn --spp 4", "`lumbre compare --help` lists"),
        ("ball.scn", "`lumbre render ball.scn` renders a scene"),
    ] {
        let words: Vec<&str> = words.split(' ').collect();
        let error = refused(&place, &words);
        assert!(error.contains(expected), "{words:?}: {error}");
    }
    let error = refused(&place, &["render", "ball.scn", "camera.fov=400"]);
    assert!(
        error.starts_with("error: camera.fov: 400 is out of range"),
        "{error}"
    );
}

#[test]
fn errors_of_a_plan_show_the_line_of_the_script_and_the_remedy_beside_it() {
    let place = Workplace::new();
    let script = place.read("night.lua");
    for (from, to, cause, mark) in [
        (
            "max_depth = p.depth",
            "max_dpeth = p.depth",
            "error: render.max_dpeth: unknown key `max_dpeth`",
            "^^^^^^^^^ did you mean `max_depth`?",
        ),
        (
            "backend = \"mock\"",
            "set = { [\"camera.apertur\"] = 1 }",
            "error: set.camera.apertur: unknown key `apertur`",
            "^^^^^^^^^^^^^^^^ did you mean `aperture`?",
        ),
        (
            "stop.samples(16)",
            "stop.when(\"rmse\", \"<\", -1)",
            "error: stop rule at depth = 2: `rmse < -1` can never hold",
            "^^^",
        ),
        (
            "{ 24, 16 }",
            "{ 32768, 32768 }",
            "error: at depth = 2: a picture of 32768x32768 pixels is not possible",
            "^^^^^^^^^^",
        ),
    ] {
        assert!(script.contains(from), "{from}");
        place.write("night.lua", &script.replace(from, to));
        let error = refused(&place, &["plan", "night.lua"]);
        assert!(error.starts_with(cause), "{error}");
        assert!(
            error.contains("--> night.lua:") && error.contains(mark),
            "{error}"
        );
    }
    let error = refused(&place, &["plan", "night.lua", "depth=2"]);
    assert!(error.contains("--> night.lua:4:"), "{error}");
}

#[test]
fn two_pictures_given_to_compare_are_compared() {
    let place = Workplace::new();
    for (file, seed) in [("a.exr", "1"), ("b.exr", "2")] {
        place.succeed(&[
            "render",
            "ball.scn",
            "--size",
            "24x16",
            "--backend",
            "cpu",
            "--spp",
            "4",
            "--seed",
            seed,
            "-q",
            "-o",
            file,
        ]);
    }
    let output = place.succeed(&["compare", "a.exr", "b.exr", "--json", "--metric", "rmse"]);
    let found: serde_json::Value = serde_json::from_str(&output.stdout).unwrap();
    assert_eq!(found["measured"]["metric"], "rmse", "{found}");
    place.fail(5, &["compare", "a.exr", "b.exr", "--fail", "rmse=1e-9"]);
}

#[test]
fn experiments_that_can_tell_little_are_said_to() {
    let place = Workplace::new();
    let compared = |repeats: u32| {
        let script = place
            .read("night.lua")
            .replace("repeats = 2", &format!("repeats = {repeats}"))
            .replace("\"depth\"", "\"technique\"")
            .replace("{ 2, 4 }", "{ \"bpt\", \"nee\" }")
            .replace(
                "integrator = \"bpt\", max_depth = p.depth",
                "integrator = p.technique",
            )
            .replace("stop.samples(4096)", "stop.samples(64)")
            .replace(
                "return stop.samples(16)",
                "return stop.any { stop.samples(16), stop.time(\"9s\") }",
            );
        place.write("compared.lua", &script);
        place.succeed(&["plan", "compared.lua"]).stdout
    };
    assert!(compared(1).contains("2 techniques are compared at equal time with 1 repeat, which"));
    assert!(!compared(3).contains("techniques are compared"));
    let easy = place.read("night.lua").replace(
        "stop.samples(16)",
        "stop.any { stop.when(\"psnr\", \">\", 1), stop.time(\"9s\") }",
    );
    place.write("easy.lua", &easy);
    let passed = place.succeed(&["run", "easy.lua"]).stderr;
    let noted = "`psnr > 1` held at the first measurement (";
    assert_eq!(passed.matches(noted).count(), 1, "{passed}");
    // The ball covers a quarter of the picture, and nothing else can be seen.
    let night = place.succeed(&["run", "compared.lua", "--backend", "cpu"]);
    let noted = " % of the reference has no noise (black: background, or";
    assert_eq!(night.stderr.matches(noted).count(), 1, "{}", night.stderr);
}

#[test]
fn the_help_of_a_verb_has_its_own_options_first() {
    let place = Workplace::new();
    let picture = [
        "render", "ball.scn", "--out", "a.exr", "--spp", "1", "--size", "8x8",
    ];
    let noted = place.succeed(&picture).stderr;
    assert!(
        noted.contains("the file of the picture follows `-o`"),
        "{noted}"
    );
    let help = place.succeed(&["render", "--help"]).stdout;
    let (own, every) = help.split_once("Options of every verb:").unwrap();
    assert!(
        own.contains("--spp") && !own.contains("--threads"),
        "{help}"
    );
    assert!(
        every.contains("--threads") && !every.contains("--out "),
        "{help}"
    );
}

#[test]
#[cfg(target_os = "linux")]
fn a_night_is_rendered_in_folders_whose_names_are_not_utf8() {
    use std::os::unix::ffi::OsStrExt;

    let place = Workplace::new();
    let name = std::ffi::OsStr::from_bytes(b"night\xff");
    let folder = place.path(".").join(name);
    std::fs::create_dir(&folder).unwrap();
    std::fs::copy(place.path("night.lua"), folder.join("night.lua")).unwrap();
    let mut command = place.command(&["run", "-q"]);
    command.arg(std::path::Path::new(name).join("night.lua"));
    command
        .arg("--out")
        .arg(std::path::Path::new(name).join("out"));
    let ended = command.output().unwrap();
    let error = String::from_utf8_lossy(&ended.stderr);
    assert!(ended.status.success(), "{error}");
    assert!(folder.join("out/latest/summary.csv").is_file());
}

#[test]
fn settings_of_the_command_line_are_refused_by_name() {
    let place = Workplace::new();
    let error = refused(&place, &["plan", "night.lua", "maxdepth=3"]);
    assert!(
        error.contains("no axis or setting `maxdepth` (did you mean `max_depth`?)"),
        "{error}"
    );
    let error = refused(&place, &["plan", "night.lua", "max_depth=0"]);
    assert!(
        error.contains("0 is out of range") && error.contains("max_depth = 0"),
        "{error}"
    );
}
