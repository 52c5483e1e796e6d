//! Pictures, layers and filters of other programs, and the protocol of servers.
#![cfg(unix)]

use std::path::Path;
use std::process::Command;

use lumbre_light::film::Image;
use lumbre_render::Device;

use super::external_commands::{no_temporary_files, place, run, succeed};
use super::workplace::Workplace;

#[test]
fn servers_of_both_reference_clients_render_a_night() {
    if crate::common::lacks_python() {
        return;
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/external");
    let place = Workplace::new();
    std::fs::create_dir(place.path("tmp")).unwrap();
    let python = format!("\"python3\", \"{}\"", root.join("server.py").display());
    let mut servers = vec![("python", python)];
    let compiled = Command::new("c++")
        .args(["-O1", "-Wall", "-Wextra", "-Werror", "-o"])
        .arg(place.path("server"))
        .arg(root.join("server.cpp"))
        .output();
    match compiled {
        Err(_) => crate::common::skipped("no C++ compiler; the client in C++ was not tested"),
        Ok(done) => {
            assert!(
                done.status.success(),
                "{}",
                String::from_utf8_lossy(&done.stderr)
            );
            servers.push(("cpp", format!("\"{}\"", place.path("server").display())));
        }
    }
    for (name, words) in servers {
        let text = format!(
            r#"
local x = experiment("served_{name}", {{ seed = 3 }})
local noise = external {{ name = "noise", serve = true, picture = "pfm", scene = "raw:ball.scn",
  command = {{ {words}, "{{width}}", "{{height}}" }} }}
x:render(function() return {{ scene = "ball.scn", integrator = noise, resolution = {{ 24, 16 }} }} end)
x:measure {{ every = "1s", keep = {{ exr = "pow2" }} }}
x:stop(stop.samples(256))
return x
"#
        );
        place.write("served.lua", &text);
        succeed(&place, &["run", "served.lua", "--allow-commands", "-q"]);
        let folder = format!("/served_{name}-");
        let is_own = |file: &String| file.contains(&folder) && file.ends_with("/done.json");
        let done = place.files("out").into_iter().find(is_own).unwrap();
        let record = place.json(&done);
        let device: Device = serde_json::from_value(record["devices"][0].clone()).unwrap();
        assert_eq!(device.to_string(), "cpu, 1 threads, noise 1.0");
        let bytes = std::fs::read(place.path(&done.replace("done.json", "final.exr"))).unwrap();
        let (image, _) = lumbre_report::exr::decode(&bytes).unwrap();
        // 1152 means of 256 uniform numbers each.
        assert!(
            image.mean().iter().all(|mean| (mean - 0.5).abs() < 0.005),
            "{:?}",
            image.mean()
        );
        no_temporary_files(&place);
    }
}

#[test]
fn a_server_that_breaks_the_protocol_fails_its_cell() {
    for (server, expected) in [
        ("echo ready 2 x", "speaks version `2` of the protocol"),
        ("echo nonsense", "expected `ready 1`, got `nonsense`"),
        (
            "echo oops >&2; exit 3",
            "it exited (exit status: 3); its last output: oops",
        ),
        (
            "echo ready 1; read x; echo fast",
            "expected the render time in seconds, got `fast`",
        ),
        (
            "echo ready 1; read x; echo failed out of memory",
            "it failed: out of memory",
        ),
        (
            "echo ready 1; read x; echo 5000",
            "reported a render time of 5000.000 s",
        ),
        (
            "echo ready 1; read x; echo 0",
            "it wrote no picture to {out}",
        ),
        ("echo ready 1; read x", "it exited (exit status: 0)"),
        ("echo ready 1; sleep 600", "longer than 3 s"),
    ] {
        let place = Workplace::new();
        std::fs::create_dir(place.path("tmp")).unwrap();
        let text = format!(
            r#"
local x = experiment("served", {{ seed = 3 }})
local broken = external {{ name = "broken", serve = true, timeout = 3, command = {{ "sh", "-c", {server:?}, "{{scene}}" }} }}
x:render(function() return {{ scene = "ball.scn", integrator = broken, resolution = {{ 24, 16 }} }} end)
x:stop(stop.samples(4))
return x
"#
        );
        place.write("served.lua", &text);
        let ended = run(
            &place,
            &["run", "served.lua", "--allow-commands", "--no-smoke", "-q"],
        );
        assert_eq!(ended.status, 3, "{server}: {}", ended.stderr);
        let failed = place.first_ending("out", "failed.json");
        let found = place.json(&failed)["reason"].as_str().unwrap().to_owned();
        assert!(found.contains(expected), "{server}: {found}");
        no_temporary_files(&place);
    }
}

#[test]
fn declared_filters_and_layers_go_through_and_others_are_refused() {
    let image = |value: f32| Image::from_fn(24, 16, |_, _| [value, value, value]);
    let layers = [("picture", 0.5), ("albedo", 0.25), ("Z", 3.0)];
    let layers = layers.map(|(name, value)| (name.to_owned(), image(value)));
    let place = place(
        r#"
local x = experiment("layers", { seed = 3 })
local copy = external { name = "copy", scene = "raw:ball.scn", layers = { albedo = "albedo", distance = "Z" },
  filters = { gauss = "gaussian" },
  command = { "sh", "-c", 'cp prepared.exr "$1"; echo "$2 $3" > filter', "sh", "{out}", "{filter}", "{radius}", "{spp}", "{seed}" } }
x:axis("layer", { "albedo", "distance" })
x:axis("filter", { "gauss" })
x:render(function(p) return { scene = "ball.scn", integrator = copy, resolution = { 24, 16 }, films = p.layer,
  aa = { filter = p.filter, radius = 1.5 } } end)
x:stop(stop.samples(3))
return x
"#,
    );
    std::fs::write(
        place.path("prepared.exr"),
        lumbre_report::exr::encode_layers(layers.into()).unwrap(),
    )
    .unwrap();
    succeed(&place, &["run", "peers.lua", "--allow-commands", "-q"]);
    assert_eq!(place.read("filter"), "gaussian 1.5\n");
    for (layer, group, expected) in [
        ("albedo", "Albedo", [0.25; 3]),
        ("distance", "Distance.Z", [3.0; 3]),
        ("distance", "Distance.A", [1.0; 3]),
    ] {
        let files = place.files("out").into_iter();
        let path = format!("layer={layer}/");
        let mut files = files.filter(|file| file.contains(&path) && file.ends_with("final.exr"));
        let bytes = std::fs::read(place.path(&files.next().unwrap())).unwrap();
        let image = lumbre_report::exr::decode_group(&bytes, group).unwrap();
        assert_eq!(image.at(3, 4), expected, "{group}");
    }
    for (change, expected) in [
        ("layer=normal", "declares no layer `normal`"),
        ("filter=tent", "it declares no filter `tent`"),
    ] {
        let refused = run(&place, &["plan", "peers.lua", change]);
        assert_eq!(refused.status, 2, "{}", refused.stdout);
        assert!(
            refused.stderr.replace('\n', " ").contains(expected),
            "{}",
            refused.stderr
        );
    }
}
