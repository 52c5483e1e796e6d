//! Invalid input that is refused before any work: status 2, one clear error, nothing written.

use super::workplace::Workplace;

fn refused(place: &Workplace, args: &[&str]) -> String {
    let before = place.files(".");
    let said = place.fail(2, args);
    assert_eq!(place.files("."), before, "{args:?} wrote something");
    said
}

#[test]
fn a_script_that_is_not_there_gets_a_near_name() {
    let place = Workplace::new();
    let said = refused(&place, &["run", "nihgt.lua"]);
    assert!(
        said.contains("there is no script nihgt.lua") && said.contains("did you mean `night.lua`?"),
        "{said}"
    );
    let said = refused(&place, &["run", "nowhere/night.lua"]);
    assert!(said.contains("there is no folder nowhere"), "{said}");
}

#[test]
fn a_folder_is_no_script() {
    let place = Workplace::new();
    let said = refused(&place, &["run", "."]);
    assert!(
        said.contains("is a folder") && said.contains("night.lua"),
        "{said}"
    );
    assert!(refused(&place, &["check", "."]).contains("is a folder"));
}

#[test]
fn an_unknown_verb_gets_a_near_one() {
    let place = Workplace::new();
    assert!(refused(&place, &["runn", "night.lua"]).contains("'run'"));
    assert!(refused(&place, &[]).contains("Usage"));
    assert!(refused(&place, &["run", "night.lua", "depth"]).contains("AXIS=VALUE"));
}

#[test]
fn a_mistake_in_a_script_is_shown_in_its_line() {
    let place = Workplace::new();
    let script = place
        .read("night.lua")
        .replace("max_depth = p.depth", "max_dpeth = p.depth");
    place.write("night.lua", &script);
    for verb in ["run", "plan", "check"] {
        let said = refused(&place, &[verb, "night.lua"]);
        assert!(
            said.contains("max_dpeth") && said.contains("max_depth"),
            "{said}"
        );
        assert!(said.contains("night.lua"), "{said}");
    }
}

#[test]
fn broken_and_hostile_scripts_are_errors_not_crashes() {
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
        let said = refused(&place, &["check", name]);
        assert!(said.contains(expected), "{name}: {said}");
    }
    std::fs::write(place.path("binary.lua"), [0x1b, b'L', b'u', b'a', 0, 1, 2]).unwrap();
    refused(&place, &["run", "binary.lua"]);
}

#[test]
fn unknown_axes_and_values_are_named() {
    let place = Workplace::new();
    let said = refused(&place, &["run", "night.lua", "dpeth=3"]);
    assert!(
        said.contains("no axis `dpeth`") && said.contains("`depth`"),
        "{said}"
    );
    let said = refused(&place, &["plan", "night.lua", "--only", "depth=3"]);
    assert!(said.contains("no value `3`"), "{said}");
}

#[test]
fn broken_scenes_name_file_and_place() {
    let place = Workplace::new();
    place.write("cut.scn", "{ \"resolution\": [8, 8], \"camera\": {");
    place.write("what.xyz", "?");
    let said = refused(
        &place,
        &["check", "cut.scn", "ball.scn", "what.xyz", "missing.obj"],
    );
    assert!(
        said.contains("cut.scn") && said.contains("what.xyz") && said.contains("missing.obj"),
        "{said}"
    );
    // Corners too far away for any camera, which is detected only after everything was read.
    let far = r#"{ "asset": { "version": "2.0" }, "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3" }],
        "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
        "buffers": [{ "byteLength": 36, "uri": "data:;base64,5rFhfwAAAAAAAAAA5rFh/wAAAAAAAAAAAAAAAAAAgD8AAAAA" }] }"#;
    place.write("far.gltf", far);
    let said = refused(&place, &["check", "ball.scn", "far.gltf"]);
    assert!(said.contains("far.gltf: camera"), "{said}");
    let script = place.read("night.lua").replace("ball.scn", "cut.scn");
    place.write("night.lua", &script);
    let said = refused(&place, &["run", "night.lua"]);
    assert!(said.contains("cut.scn"), "{said}");
}

#[test]
fn an_out_that_cannot_be_written_is_found_before_rendering() {
    let place = Workplace::new();
    place.write("taken", "a file");
    let said = refused(&place, &["run", "night.lua", "--out", "taken"]);
    assert!(
        said.contains("cannot write to taken") && said.contains("--out"),
        "{said}"
    );
    let said = refused(&place, &["run", "night.lua", "--out", "taken/below"]);
    assert!(said.contains("cannot write to taken/below"), "{said}");
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
        let said = refused(&place, &[verb, file]);
        assert!(
            said.contains("material `grey`") && said.contains("gone.png"),
            "{verb}: {said}"
        );
        let ended = place.run(&[verb, file, "--lenient"]);
        let said = ended.stdout + &ended.stderr;
        assert!(
            ended.status == 0
                && said.contains("gone.png")
                && said.contains("constant value is used"),
            "{verb}: {said}"
        );
    }
}
