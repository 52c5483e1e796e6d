//! `lumbre render`: one picture without a script.

use std::io::{BufRead, BufReader};
use std::process::Stdio;

use lumbre_light::film::Image;
use lumbre_report::exr;

use super::workplace::{ProgramOutput, Workplace};

/// Renders the ball with these further arguments, and returns the output and the EXR file `a.exr`.
fn render(place: &Workplace, more: &[&str]) -> (ProgramOutput, Vec<u8>) {
    let mut args = vec![
        "render",
        "ball.scn",
        "--size",
        "24x16",
        "--backend",
        "cpu",
        "-o",
        "a.exr",
    ];
    args.extend(more);
    let output = place.succeed(&args);
    (output, std::fs::read(place.path("a.exr")).unwrap())
}

fn decode(bytes: &[u8]) -> (Image, Vec<(String, String)>) {
    exr::decode(bytes).unwrap()
}

#[test]
fn a_picture_is_written_with_its_settings_and_has_the_same_bits_again() {
    let place = Workplace::new();
    let settings = ["--spp", "8", "-i", "bdpt", "--depth", "3", "--seed", "5"];
    let (output, bytes) = render(&place, &settings);
    assert_eq!(output.stdout, "a.exr\n");
    assert!(
        output.stderr.contains("24x16 by bdpt: 8 samples per pixel"),
        "{}",
        output.stderr
    );
    let (image, metadata) = decode(&bytes);
    assert_eq!((image.width, image.height), (24, 16));
    for (key, value) in [("integrator", "bdpt"), ("samples", "8"), ("seed", "5")] {
        let found = metadata.iter().find(|(name, _)| name.ends_with(key));
        assert_eq!(found.map(|(_, v)| v.as_str()), Some(value), "{key}");
    }
    let mut as_json = settings.to_vec();
    as_json.extend(["--json", "-q"]);
    let found: serde_json::Value =
        serde_json::from_str(&render(&place, &as_json).0.stdout).unwrap();
    assert_eq!(found["samples"], 8, "{found}");
    assert_eq!(found["files"][0], "a.exr");
    assert!(found["relative_noise"].as_f64().unwrap() > 0.0 && found["version"] == 1);
    // The render time, an attribute of the file, differs.
    let mut threads = settings.to_vec();
    threads.extend(["--threads", "3"]);
    assert_eq!(decode(&render(&place, &threads).1), (image, metadata));
}

#[test]
fn layers_are_channels_of_the_picture() {
    let place = Workplace::new();
    let (_, plain) = render(&place, &["--spp", "4"]);
    let films = "films=[\"albedo\",\"shape_index\",\"variance\"]";
    let (_, bytes) = render(&place, &["--spp", "4", films]);
    assert_eq!(decode(&bytes).0, decode(&plain).0);
    let range = |group: &str| {
        let image = exr::decode_group(&bytes, group).unwrap();
        let values = image.data.as_flattened().iter().copied();
        let least = values.clone().fold(f32::INFINITY, f32::min);
        [least, values.fold(least, f32::max)]
    };
    assert_eq!(range("ShapeIndex"), [-1.0, 0.0]);
    let ([low, high], [least, most]) = (range("Albedo"), range("Variance"));
    assert!(low == 0.0 && high > 0.1 && high <= 1.0 && least == 0.0 && most > 0.0);
    let refused = place.run(&["render", "ball.scn", "films=depth"]);
    assert_eq!(refused.status, 2);
    assert!(
        refused.stderr.contains("several pictures"),
        "{}",
        refused.stderr
    );
}

#[test]
fn settings_are_those_of_render_tables_and_of_the_scene() {
    let place = Workplace::new();
    let picture = |more: &[&str]| {
        let mut args = vec!["--spp", "4", "-q"];
        args.extend(more);
        decode(&render(&place, &args).1).0
    };
    let plain = picture(&[]);
    let direct = picture(&["max_depth=1"]);
    assert!(
        direct.mean()[1] < plain.mean()[1],
        "depth 1 is emission only"
    );
    assert_ne!(picture(&["sampler=sobol"]).data, plain.data);
    assert_ne!(picture(&["camera.fov=20"]).data, plain.data);
    // The default technique gives way to a setting as to an option.
    let by_setting = picture(&["integrator=bpt"]);
    assert_ne!(by_setting.data, plain.data);
    assert_eq!(by_setting.data, picture(&["-i", "bpt"]).data);
}

#[test]
fn files_are_named_after_the_scene_and_have_the_format_of_their_extension() {
    let place = Workplace::new();
    let plain = place.succeed(&["render", "ball.scn", "--spp", "1", "--size", "8x8", "-q"]);
    assert_eq!(plain.stdout, "ball.exr\nball.png\n");
    assert_eq!(plain.stderr, "");
    let named = [
        "render", "ball.scn", "--spp", "1", "--size", "8x8", "-o", "b.hdr", "-o", "b.png",
    ];
    place.succeed(&named);
    for (file, magic) in [
        ("ball.exr", &b"\x76\x2f\x31\x01"[..]),
        ("ball.png", b"\x89PNG"),
        ("b.hdr", b"#?RADIANCE"),
        ("b.png", b"\x89PNG"),
    ] {
        let bytes = std::fs::read(place.path(file)).unwrap();
        assert!(bytes.starts_with(magic), "{file}");
    }
}

#[test]
fn mistakes_are_reported_before_anything_renders() {
    let place = Workplace::new();
    for (args, message) in [
        (&["ball.scn", "max_dept=3"][..], "did you mean `max_depth`"),
        (&["ball.scn", "-i", "nees"], "did you mean `nee`"),
        (&["bal.scn"], "there is no file `bal.scn`"),
        (&["ball.scn", "materials.x.ior=2"], "unknown material `x`"),
        (&["ball.scn", "-o", "a.jpg"], ".exr, .hdr, .png or .bmp"),
        (&["ball.scn", "--time", "soon"], "such as 30s"),
        (&["ball.scn", "--spp", "0"], "at least 1, found `0`"),
        (&["ball.scn", "-o", "/proc/a.exr"], "cannot write to /proc"),
    ] {
        let mut all = vec!["render"];
        all.extend(args);
        let output = place.run(&all);
        assert_eq!(output.status, 2, "{args:?}");
        let text = output.stderr.split_whitespace().collect::<Vec<_>>();
        assert!(text.join(" ").contains(message), "{}", output.stderr);
    }
    assert!(place.files(".").iter().all(|file| !file.ends_with(".exr")));
}

#[cfg(unix)]
#[test]
fn an_interrupted_picture_is_written_with_the_samples_so_far() {
    let place = Workplace::new();
    let args = [
        "render", "ball.scn", "--size", "24x16", "--time", "1h", "-o", "a.exr",
    ];
    let mut command = place.command(&args);
    let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
    // Signals are handled before the first line on the progress.
    let mut messages = BufReader::new(child.stderr.take().unwrap());
    messages.read_line(&mut String::new()).unwrap();
    let kill = crate::common::kill()
        .args(["-INT", &child.id().to_string()])
        .status();
    assert!(kill.unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let (image, _) = decode(&std::fs::read(place.path("a.exr")).unwrap());
    assert!(image.mean()[1] > 0.0);
}

#[test]
fn a_model_stands_in_the_environment_of_the_command_line() {
    let place = Workplace::new();
    let quad = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3 4\n";
    place.write("quad.obj", quad);
    let (_, sky) = render(&place, &["--spp", "4"]);
    std::fs::write(place.path("sky.exr"), sky).unwrap();
    let picture = |more: &[&str]| -> Image {
        let mut args = vec!["render", "--size", "8x8", "--spp", "16", "-o", "b.exr"];
        args.extend(["--backend", "cpu"]);
        args.extend(more);
        place.succeed(&args);
        decode(&std::fs::read(place.path("b.exr")).unwrap()).0
    };
    let lit = picture(&["quad.obj", "--environment", "sky.exr"]);
    let by_path = picture(&["quad.obj", "environment.map=sky.exr"]);
    assert!(lit == by_path && lit.mean() != [0.0; 3]);
    assert!(lit != picture(&["quad.obj"]), "that is the studio");
    let both = picture(&["quad.obj?stage=studio", "--hdri", "sky.exr"]);
    assert!(lit != both, "a stage that is named stays");
    // A scene that has no environment gets one.
    let ball = picture(&["ball.scn", "--environment", "sky.exr"]);
    assert!(ball != picture(&["ball.scn"]));
    let error = place.fail(2, &["render", "ball.scn", "--environment", "none.exr"]);
    assert!(
        error.contains("environment.map") && error.contains("none.exr"),
        "{error}"
    );
    let error = place.fail(2, &["render", "ball.scn", "--environment", "skj.exr"]);
    assert!(error.contains("did you mean `sky.exr`?"), "{error}");
    let error = place.fail(2, &["render", "ball.scn", "environment.rotate=9"]);
    assert!(error.contains("did you mean `rotation`?"), "{error}");
}
