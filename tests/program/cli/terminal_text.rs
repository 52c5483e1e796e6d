//! Text from scripts, scenes and names of files, which may try to control the terminal.

use super::workplace::Workplace;

/// Sequences that set the title, clear the screen, and reorder text.
const HOSTILE: &str = "\u{1b}]0;owned\u{7}\u{1b}[2J\u{9b}31m\u{7f}\u{202e}";

/// Whether a character controls a terminal.
fn controls(c: char) -> bool {
    (c.is_control() && c != '\n' && c != '\t') || c == '\u{202e}'
}

/// Panics if a text has a character that controls a terminal.
fn check(what: &str, text: &str) {
    assert!(!text.contains(controls), "{what}: {text:?}");
    assert!(text.contains("owned"), "{what}: {text:?}");
}

#[test]
fn no_control_characters_reach_the_terminal_the_log_or_the_page() {
    let place = Workplace::new();
    let night = place.read("night.lua");
    let ended = place.run(&["plan", HOSTILE]);
    check("name of a script", &ended.stderr);
    // As bytes, since the parser of Lua has escapes of its own.
    place.write(
        "error.lua",
        &format!("error(\"{HOSTILE}\")\n-- {HOSTILE}\n"),
    );
    check(
        "error of a script",
        &place.run(&["plan", "error.lua"]).stderr,
    );
    let key = serde_json::to_string(HOSTILE).unwrap();
    let scene = place.read("ball.scn");
    place.write(
        "scene.scn",
        &scene.replacen('{', &format!("{{ {key}: 1,"), 1),
    );
    check("scene", &place.succeed(&["check", "scene.scn"]).stderr);
    let ended = place.run(&["ls", "--state", HOSTILE]);
    assert!(!ended.stderr.contains(controls), "{:?}", ended.stderr);
    let printing = night.replace(
        "x:stop(function(p) return",
        &format!("x:stop(function(p) print(\"{HOSTILE}\") return"),
    );
    place.write("print.lua", &printing);
    let ended = place.succeed(&["run", "print.lua"]);
    assert!(!ended.stderr.contains(controls), "{:?}", ended.stderr);
    for log in place.ending("out", "log.txt") {
        let text = place.read(&log);
        assert!(
            !text.contains('\u{1b}') && !text.contains('\u{202e}'),
            "{text:?}"
        );
    }
    // A copy of the scene whose name is hostile: it is in plans, configurations and the page.
    let name = format!("ball{HOSTILE}.scn");
    std::fs::copy(place.path("ball.scn"), place.path(&name)).unwrap();
    let named = night
        .replace("ball.scn", &name)
        .replace("\"night\"", "\"named\"");
    place.write("named.lua", &named);
    let ended = place.run(&["run", "named.lua"]);
    assert!(!ended.stderr.contains('\u{1b}'), "{:?}", ended.stderr);
    check("show", &place.succeed(&["show", "latest"]).stdout);
    let json = place.succeed(&["show", "latest", "--json"]).stdout;
    check("show --json", &json);
    let read: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert!(
        read["config"]["render"]["scene"]
            .as_str()
            .unwrap()
            .ends_with(&name)
    );
    place.succeed(&["report", "out/latest", "-q"]);
    let page = place.read("out/latest/report/index.html");
    assert!(!page.contains(controls));
}

#[test]
fn errors_quote_nothing_of_a_file_of_another_kind() {
    let place = Workplace::new();
    let secret = "root:x:0:0:hidden:/root:/bin/sh\nhidden token 12345\n";
    for name in [
        "x.obj", "x.ply", "x.gltf", "x.xml", "x.json", "x.mtl", "x.scn",
    ] {
        place.write(name, secret);
    }
    let mesh = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    place.write("with.obj", &format!("mtllib x.mtl\n{mesh}"));
    let commented = format!("newmtl a\n{secret}");
    place.write("y.mtl", &commented);
    place.write("other.obj", &format!("mtllib y.mtl\n{mesh}"));
    for name in [
        "x.obj",
        "x.ply",
        "x.gltf",
        "x.xml",
        "x.json",
        "x.scn",
        "with.obj",
        "other.obj",
    ] {
        let ended = place.run(&["check", name]);
        let text = ended.stdout + &ended.stderr;
        assert!(
            !text.contains("hidden") && !text.contains("root"),
            "{name}: {text}"
        );
    }
}

#[test]
fn confined_scenes_name_no_file_outside_their_folder() {
    let place = Workplace::new();
    std::fs::create_dir_all(place.path("inside")).unwrap();
    let mesh = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    place.write("outside.obj", mesh);
    place.write("inside/inside.obj", mesh);
    let scene = |mesh: &str| {
        let entity =
            format!("{{ \"type\": \"mesh\", \"file\": \"{mesh}\", \"material\": \"grey\" }},");
        let ball = place.read("ball.scn");
        ball.replacen("\"entities\": [", &format!("\"entities\": [ {entity}"), 1)
    };
    place.write("inside/good.scn", &scene("inside.obj"));
    place.write("inside/bad.scn", &scene("../outside.obj"));
    place.succeed(&["check", "inside/good.scn", "--confine", "inside"]);
    place.succeed(&["check", "inside/bad.scn"]);
    for scene in ["inside/bad.scn", "ball.scn"] {
        let error = place.fail(2, &["check", scene, "--confine", "inside"]);
        assert!(error.contains("it is outside"), "{error}");
    }
    let error = place.fail(2, &["check", "ball.scn", "--confine", "nowhere"]);
    assert!(error.contains("--confine nowhere"), "{error}");
}

#[test]
fn values_made_of_addresses_are_refused() {
    let place = Workplace::new();
    let night = place.read("night.lua");
    for (value, said) in [
        ("tostring(print)", "an address in memory"),
        ("\"a\" .. tostring({}):sub(8)", "an address in memory"),
        ("string.format(\"%p\", {})", "differs in every process"),
        ("(\"%-20p\"):format(print)", "differs in every process"),
    ] {
        let script = night.replace("{ 2, 4 }", &format!("{{ {value} }}"));
        place.write("address.lua", &script);
        let error = place.fail(2, &["plan", "address.lua"]);
        assert!(error.contains(said), "{value}: {error}");
    }
    let script = night.replace("{ 2, 4 }", "{ string.format(\"100%%p %x\", 48879) }");
    place.write("address.lua", &script.replace("p.depth", "2"));
    place.succeed(&["plan", "address.lua"]);
}
