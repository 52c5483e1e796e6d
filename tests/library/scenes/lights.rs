//! Lights of a `.scn` that are not entities, environments from files, textured emitters, and the
//! notes on lights that cannot emit.

use std::collections::BTreeMap;
use std::f32::consts::PI;
use std::path::Path;

use glam::Vec3;
use lumbre_light::scene::compile::{MapSpace, PointLight};
use lumbre_light::scene::desc::{EnvironmentSource, LightKind, TextureSlot, content_hash};
use lumbre_light::scene::{Note, SceneDesc, compile};
use lumbre_light::transport::light::Lights;
use lumbre_light::value::Value;
use lumbre_scene_io::edit::{paths, set};
use lumbre_scene_io::export;
use lumbre_scene_io::load::load;

use super::{Folder, QUAD, lines, scn};

const LIT: &str = r#"{ "camera": { "position": [0, 0, 5] },
  "lights": [ { "type": "point", "position": [1, 2, 3], "intensity": [4, 5, 6] },
              { "type": "directional", "name": "sun", "direction": [0, -2, 0], "irradiance": [1, 2, 3] },
              { "type": "Point", "position": [0, 0, 0], "intensity": [1, 1, 1] } ],
  "environment": { "color": [0.5, 0.25, 1], "rotation": 450, "scale": 2 } }"#;

/// Returns the scene [`LIT`].
fn lit() -> SceneDesc {
    scn(&LIT.replace("Point", "point")).unwrap().0
}

fn write_hdr(path: &Path, texels: &[[f32; 3]], width: usize) {
    let texels: Vec<image::Rgb<f32>> = texels.iter().map(|t| image::Rgb(*t)).collect();
    let file = std::fs::File::create(path).unwrap();
    image::codecs::hdr::HdrEncoder::new(file)
        .encode(&texels, width, texels.len() / width)
        .unwrap();
}

fn nums(xs: &[f64]) -> Value {
    Value::List(xs.iter().map(|x| Value::number(*x)).collect())
}

#[test]
fn lights_and_a_constant_environment_are_read_and_compiled() {
    let desc = lit();
    let names: Vec<&str> = desc.lights.iter().map(|l| l.name.as_str()).collect();
    assert_eq!(names, ["point", "sun", "point_2"]);
    let point = LightKind::Point {
        position: Vec3::new(1.0, 2.0, 3.0),
        intensity: Vec3::new(4.0, 5.0, 6.0),
    };
    assert_eq!(desc.lights[0].kind, point);
    let (scene, notes) = compile(&desc).unwrap();
    assert_eq!((scene.points.len(), scene.directionals.len()), (2, 1));
    assert_eq!(scene.directionals[0].direction, Vec3::NEG_Y);
    let environment = scene.environment.unwrap();
    assert_eq!(
        (environment.radiance, environment.map),
        (Vec3::new(1.0, 0.5, 2.0), None)
    );
    assert!((environment.rotation_rad - std::f32::consts::FRAC_PI_2).abs() < 1e-6);
    assert!(
        !lines(&notes).contains("nothing emits"),
        "{}",
        lines(&notes)
    );
}

#[test]
fn errors_of_lights_name_their_key() {
    let light = |entry: &str| format!("{{ \"lights\": [ {entry} ] }}");
    let environment = |entry: &str| format!("{{ \"environment\": {entry} }}");
    let cases = [
        (
            LIT.to_owned(),
            "lights[2].type: unknown light type `Point` (did you mean `point`?)",
        ),
        (
            light("{}"),
            "lights[0]: a light needs a `type`: point, directional, spot or goniometric",
        ),
        (light("4"), "lights[0]: expected an object"),
        ("{ \"lights\": {} }".to_owned(), "lights: expected a list"),
        (
            light(r#"{ "type": "area" }"#),
            "unknown light type `area` (known: point, directional, spot, goniometric)",
        ),
        (
            light(r#"{ "type": "point", "intensity": [1, 1, 1] }"#),
            "lights[0]: a point light needs `position`",
        ),
        (
            light(r#"{ "type": "point", "position": [1, 1, 1] }"#),
            "lights[0]: a point light needs `intensity`",
        ),
        (
            light(r#"{ "type": "point", "position": [1, 1, 1], "intensity": [1, -1, 1] }"#),
            "lights[0].intensity: expected numbers of 0 or more, found -1",
        ),
        (
            light(r#"{ "type": "directional", "direction": [0, 0, 0], "irradiance": [1, 1, 1] }"#),
            "lights[0].direction: a direction needs a length above zero",
        ),
        (
            light(
                r#"{ "type": "directional", "direction": [0, 1, 0], "irradiance": [1, 1e300, 1] }"#,
            ),
            "lights[0].irradiance: expected numbers of 0 or more",
        ),
        (
            environment("{}"),
            "environment: an environment needs a `file` or a `color`",
        ),
        (
            environment("[]"),
            "environment: expected an object, found a list",
        ),
        (
            environment(r#"{ "color": [1, 1, -1] }"#),
            "environment.color: expected numbers of 0 or more",
        ),
        (
            environment(r#"{ "color": [1, 1, 1], "scale": -2 }"#),
            "environment.scale: expected a number of 0 or more",
        ),
        (
            environment(r#"{ "color": [1, 1, 1], "rotation": "up" }"#),
            "environment.rotation: expected a number",
        ),
        (
            environment(r#"{ "file": "no.hdr" }"#),
            "environment.file: cannot read",
        ),
        (
            environment(r#"{ "file": 3 }"#),
            "environment.file: expected a string",
        ),
    ];
    for (text, part) in cases {
        let e = scn(&text).unwrap_err().to_string();
        assert!(e.contains("a.scn: ") && e.contains(part), "{text}: {e}");
    }
    let extra = r#"{ "lights": [ { "type": "point", "position": [0, 1, 0], "intensity": [1, 1, 1], "radius": 2 } ],
                     "environment": { "color": [1, 1, 1], "rotatoin": 5 } }"#;
    let notes = lines(&scn(extra).unwrap().1);
    assert!(
        notes.contains("lights[0].radius: unknown key, ignored"),
        "{notes}"
    );
    assert!(
        notes.contains("environment.rotatoin: unknown key, ignored (did you mean `rotation`?)"),
        "{notes}"
    );
}

#[test]
fn goniometric_lights_are_read_compiled_and_changed() {
    let text = r#"{ "camera": { "position": [0, 0, 5] }, "lights": [ { "type": "goniometric",
        "name": "lamp", "position": [1, 2, 3], "intensity": [4, 5, 6], "map": "m.hdr",
        "rotation": 450 } ] }"#;
    let folder = Folder::new(&[("a.scn", text)]);
    write_hdr(&folder.path("m.hdr"), &[[1.0; 3], [0.5, 1.0, 2.0]], 2);
    let (mut desc, notes) = folder.load("a.scn").unwrap();
    assert!(notes.is_empty(), "{}", lines(&notes));
    let before = content_hash(&desc);
    let (scene, _) = compile(&desc).unwrap();
    let light = scene.points[0];
    assert_eq!(light.intensity, Vec3::new(4.0, 5.0, 6.0));
    let map = light.map.unwrap();
    let MapSpace::Sphere { rotation_rad } = map.mapping else {
        panic!("a map of all directions expected")
    };
    assert!((rotation_rad - std::f32::consts::FRAC_PI_2).abs() < 1e-6);
    assert_eq!(
        scene.textures[map.texture as usize].texels.at(1),
        [0.5, 1.0, 2.0]
    );

    assert!(paths(&desc).contains(&"lights.lamp.rotation".to_owned()));
    assert!(!paths(&desc).contains(&"lights.lamp.map".to_owned()));
    write_hdr(&folder.path("n.hdr"), &[[0.25; 3]], 1);
    let file = folder.path("n.hdr").to_string_lossy().into_owned();
    for (path, value) in [
        ("lights.lamp.rotation", Value::number(10.0)),
        ("lights.lamp.intensity", nums(&[1.0, 1.0, 1.0])),
        ("lights.lamp.map", Value::from(file.as_str())),
    ] {
        let last = content_hash(&desc);
        set(&mut desc, path, &value).unwrap();
        assert!(![before, last].contains(&content_hash(&desc)), "{path}");
    }
    let (scene, _) = compile(&desc).unwrap();
    assert_eq!(scene.textures[0].texels.at(0), [0.25; 3]);
    let e = set(&mut desc, "lights.lamp.beam", &Value::number(3.0)).unwrap_err();
    assert!(e.to_string().contains("a goniometric light"), "{e}");

    let without = text.replace(r#""map": "m.hdr","#, "");
    let e = scn(&without).unwrap_err().to_string();
    assert!(e.contains("a goniometric light needs `map`"), "{e}");
}

/// Returns the only light of a scene, and the texels of its image.
fn projector(desc: &SceneDesc) -> (PointLight, Vec<[f32; 3]>) {
    let (scene, _) = compile(desc).unwrap();
    let light = scene.points[0];
    let texture = &scene.textures[light.map.unwrap().texture as usize];
    (light, texture.texels.iter().collect())
}

#[test]
fn projectors_of_all_formats_show_their_image_upright() {
    let folder = Folder::new::<&str>(&[]);
    let texels = [
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [1.0, 1.0, 0.0],
    ];
    let texels: Vec<[f32; 3]> = texels.into_iter().flat_map(|t| [t; 2]).collect();
    // Two rows of four, red and green above.
    write_hdr(&folder.path("m.hdr"), &texels, 4);
    let half = 25f32.to_radians().tan();
    let pbrt = |version: &str| {
        let name = if version == "3" {
            "mapname"
        } else {
            "filename"
        };
        let turned = if version == "3" { "Scale 1 -1 1\n" } else { "" };
        let ends = if version == "3" { "WorldEnd\n" } else { "" };
        let short = (2.0 * (half / 2.0).atan()).to_degrees();
        format!(
            "Camera \"perspective\"\nWorldBegin\nTranslate -1 2 3\nScale 3 3 3\n{turned}\
             LightSource \"projection\" \"string {name}\" \"m.hdr\" \"float fov\" {short}\n{ends}"
        )
    };
    let scn = r#"{ "lights": [ { "type": "spot", "position": [1, 2, 3], "intensity": [1, 1, 1],
        "direction": [0, 0, 2], "map": "m.hdr", "angle": 50 } ] }"#;
    let xml = "<scene version=\"3.0.0\"><emitter type=\"projector\"><transform name=\"to_world\">\
        <scale value=\"3\"/><lookat origin=\"1,2,3\" target=\"1,2,5\" up=\"0,1,0\"/></transform><float name=\"fov\" \
        value=\"50\"/><texture name=\"irradiance\" type=\"bitmap\"><string name=\"filename\" \
        value=\"m.hdr\"/><string name=\"wrap_mode\" value=\"clamp\"/></texture></emitter></scene>";
    let files = [
        ("a.scn", scn.to_owned(), true),
        ("a.xml", xml.to_owned(), true),
        ("a.pbrt", pbrt("4"), false),
        ("b.pbrt", pbrt("3"), false),
    ];
    for (name, text, shaped) in files {
        folder.write(name, text);
        let (desc, _) = folder.load(name).unwrap();
        let check = |name: &str, desc: &SceneDesc, is_even: bool| {
            let (light, found) = projector(desc);
            let MapSpace::Plane { right, up, even } = light.map.unwrap().mapping else {
                panic!("{name}: an image across the axis expected")
            };
            // Looking along +z with +y up, -x is on the right.
            let expected = [Vec3::NEG_X / half, Vec3::Y * 2.0 / half];
            for (found, expected) in [right, up].into_iter().zip(expected) {
                assert!(
                    (found - expected).length() < 1e-4,
                    "{name}: {found}, not {expected}"
                );
            }
            assert_eq!(
                (light.position, even),
                (Vec3::new(1.0, 2.0, 3.0), is_even),
                "{name}"
            );
            // Mitsuba multiplies by pi.
            let factor = if name.starts_with("a.xml") { PI } else { 1.0 };
            for (found, expected) in found.iter().zip(&texels) {
                let found = Vec3::from_array(*found) * light.intensity;
                let expected = factor * Vec3::from_array(*expected);
                assert!(
                    (found - expected).abs().max_element() < 1e-5,
                    "{name}: {found}"
                );
            }
            let corner = (half * half * 1.25).sqrt().atan();
            assert!(
                (light.cone.beam / corner - 1.0).abs() < 1e-4,
                "{name}: {}",
                light.cone.beam
            );
        };
        check(name, &desc, shaped);
        // Exports are read back as they were, except that each format has one shape of the intensity.
        for (write, scene, is_even) in [
            (export::mitsuba as fn(&_, &_) -> _, "scene.xml", true),
            (export::pbrt, "scene.pbrt", false),
        ] {
            if is_even == shaped || scene == "scene.pbrt" {
                let out = folder.path(&format!("{name}-{scene}"));
                write(&desc, &out).unwrap();
                check(
                    &format!("{name} as {scene}"),
                    &load(&out.join(scene)).unwrap().0,
                    is_even,
                );
            }
        }
    }
}

#[test]
fn textures_of_spots_are_as_wide_as_their_cone() {
    let folder = Folder::new::<&str>(&[]);
    write_hdr(&folder.path("m.hdr"), &[[1.0; 3], [0.5; 3]], 2);
    let xml = "<scene version=\"3.0.0\"><emitter type=\"spot\"><transform name=\"to_world\">\
        <lookat origin=\"0,0,0\" target=\"0,0,-1\" up=\"0,1,0\"/></transform><float name=\"cutoff_angle\" \
        value=\"40\"/><texture name=\"texture\" type=\"bitmap\"><string name=\"filename\" value=\"m.hdr\"/>\
        <string name=\"wrap_mode\" value=\"clamp\"/></texture></emitter></scene>";
    folder.write("a.xml", xml);
    let (desc, notes) = folder.load("a.xml").unwrap();
    assert!(!lines(&notes).contains("texture"), "{}", lines(&notes));
    let (light, _) = projector(&desc);
    let Some(MapSpace::Plane { right, up, even }) = light.map.map(|map| map.mapping) else {
        panic!("an image across the axis expected")
    };
    // Mitsuba turns the image by half a turn.
    let half = 40f32.to_radians().tan();
    assert!((right - Vec3::NEG_X / half).length() < 1e-4, "{right}");
    assert!((up - Vec3::NEG_Y / half).length() < 1e-4 && !even, "{up}");
    assert!((light.cone.beam - 30f32.to_radians()).abs() < 1e-4);
    let light = &desc.lights[0].name;
    assert!(!paths(&desc).contains(&format!("lights.{light}.map")));
    let mut changed = desc.clone();
    let file = folder.path("m.hdr").to_string_lossy().into_owned();
    set(
        &mut changed,
        &format!("lights.{light}.map"),
        &Value::from(file.as_str()),
    )
    .unwrap();
    assert_eq!(content_hash(&changed), content_hash(&desc));
}

#[test]
fn environments_are_read_from_hdr_exr_and_png_files() {
    let folder = Folder::new::<&str>(&[]);
    let texels = [[4.0, 1.0, 0.25], [0.0; 3], [1.0; 3], [0.5, 0.5, 2.0]];
    write_hdr(&folder.path("sky.hdr"), &texels, 2);
    exr::prelude::write_rgb_file(folder.path("sky.exr"), 2, 2, |x, y| {
        texels[y * 2 + x].into()
    })
    .unwrap();
    image::RgbImage::from_pixel(2, 2, image::Rgb([188, 255, 0]))
        .save(folder.path("sky.png"))
        .unwrap();
    for name in ["sky.hdr", "sky.exr", "sky.png"] {
        folder.write(
            "a.scn",
            format!("{{ \"environment\": {{ \"file\": \"{name}\", \"scale\": 0.5 }} }}"),
        );
        let (desc, notes) = folder.load("a.scn").unwrap();
        assert!(notes.is_empty(), "{name}: {}", lines(&notes));
        let (scene, _) = compile(&desc).unwrap();
        let environment = scene.environment.as_ref().unwrap();
        let map = environment.map.as_ref().unwrap();
        assert_eq!(
            (map.width, map.height, environment.radiance),
            (2, 2, Vec3::splat(0.5))
        );
        if name == "sky.png" {
            assert!(
                (map.texels.at(0)[0] - 0.5029).abs() < 1e-3,
                "eight-bit textures are sRGB"
            );
        } else {
            assert!(map.texels.iter().eq(texels), "{name}");
            // Straight up is the top row, straight down the bottom row.
            let lights = Lights::new(&scene);
            assert!((lights.environment(Vec3::Y).z - 0.5 * 0.125).abs() < 1e-6);
            assert!((lights.environment(-Vec3::Y).z - 0.5 * 1.5).abs() < 1e-6);
        }
    }
}

#[test]
fn damaged_environment_files_are_errors_that_name_the_file() {
    let folder = Folder::new(&[("a.scn", r#"{ "environment": { "file": "sky.hdr" } }"#)]);
    folder.write("b.scn", r#"{ "environment": { "file": "sky.exr" } }"#);
    write_hdr(&folder.path("sky.hdr"), &[[1.0, 2.0, 3.0]; 64], 16);
    exr::prelude::write_rgb_file(folder.path("sky.exr"), 16, 4, |x, y| {
        (x as f32, y as f32, 1.0)
    })
    .unwrap();
    for (scene, name) in [("a.scn", "sky.hdr"), ("b.scn", "sky.exr")] {
        let good = std::fs::read(folder.path(name)).unwrap();
        for cut in 0..good.len() {
            folder.write(name, &good[..cut]);
            let e = folder.load(scene).unwrap_err().to_string();
            assert!(
                e.contains(name) && e.contains("environment.file") && e.len() < 1000,
                "{cut}: {e}"
            );
        }
        for i in 0..good.len() {
            let mut damaged = good.clone();
            damaged[i] ^= [0x01, 0x20, 0x80][i % 3];
            folder.write(name, &damaged);
            match folder.load(scene) {
                Ok((desc, _)) => drop(compile(&desc)),
                Err(e) => assert!(e.to_string().contains(name), "{e}"),
            }
        }
    }
    folder.write("sky.hdr", "hello");
    assert!(
        folder
            .load("a.scn")
            .unwrap_err()
            .to_string()
            .contains("sky.hdr: image: ")
    );
    folder.write(
        "sky.hdr",
        "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 99999999 +X 99999999\n",
    );
    assert!(
        folder
            .load("a.scn")
            .unwrap_err()
            .to_string()
            .contains("sky.hdr: image: ")
    );
    exr::prelude::write_rgb_file(folder.path("sky.exr"), 1, 1, |_, _| {
        (f32::INFINITY, 0.0, 0.0)
    })
    .unwrap();
    assert!(
        folder
            .load("b.scn")
            .unwrap_err()
            .to_string()
            .contains("not finite")
    );
    // Negative values are finite; they become black, with a note.
    exr::prelude::write_rgb_file(folder.path("sky.exr"), 2, 1, |x, _| {
        (x as f32 * 2.0 - 1.0, 0.5, 0.5)
    })
    .unwrap();
    let (scene, notes) = compile(&folder.load("b.scn").unwrap().0).unwrap();
    let map = scene.environment.unwrap().map.unwrap();
    let texels: Vec<[f32; 3]> = map.texels.iter().collect();
    assert_eq!(texels, [[0.0, 0.5, 0.5], [1.0, 0.5, 0.5]]);
    assert!(lines(&notes).contains("negative"), "{}", lines(&notes));
}

#[test]
fn the_hash_depends_on_the_texels_of_a_map_and_not_on_its_name() {
    let folder = Folder::new(&[("a.scn", r#"{ "environment": { "file": "sky.hdr" } }"#)]);
    folder.write("b.scn", r#"{ "environment": { "file": "other.hdr" } }"#);
    write_hdr(&folder.path("sky.hdr"), &[[1.0, 2.0, 3.0]; 8], 4);
    write_hdr(&folder.path("other.hdr"), &[[1.0, 2.0, 3.0]; 8], 4);
    let hash = |name: &str| content_hash(&folder.load(name).unwrap().0);
    assert_eq!(hash("a.scn"), hash("b.scn"));
    write_hdr(&folder.path("other.hdr"), &[[1.0, 2.0, 4.0]; 8], 4);
    assert_ne!(hash("a.scn"), hash("b.scn"));
}

#[test]
fn every_parameter_of_a_light_can_be_set_and_changes_the_hash() {
    let base = lit();
    let mut seen = BTreeMap::from([(content_hash(&base), "nothing".to_owned())]);
    let all: Vec<String> = paths(&base)
        .into_iter()
        .filter(|p| p.starts_with("lights.") || p.starts_with("env"))
        .collect();
    let expected = [
        "lights.point.position",
        "lights.point.intensity",
        "lights.sun.direction",
        "lights.sun.irradiance",
        "lights.point_2.position",
        "lights.point_2.intensity",
        "environment.rotation",
        "environment.scale",
        "environment.color",
        "environment.sampling",
    ];
    assert_eq!(all, expected);
    for path in all {
        let mut s = base.clone();
        let scalar = path.ends_with("rotation") || path.ends_with("scale");
        let value = if scalar {
            Value::Num(7.5)
        } else if path.ends_with("sampling") {
            "uniform".into()
        } else {
            nums(&[0.25, 0.75, 0.125])
        };
        set(&mut s, &path, &value).unwrap();
        if let Some(other) = seen.insert(content_hash(&s), path.clone()) {
            panic!("{path} and {other} have the same hash");
        }
    }
    let mut s = base;
    set(&mut s, "environment.color", &nums(&[1.0, 0.0, 0.0])).unwrap();
    assert_eq!(
        s.environment.unwrap().source,
        EnvironmentSource::Color(Vec3::X)
    );
}

#[test]
fn invalid_edits_of_lights_are_errors_that_list_known_names() {
    let cases = [
        (
            "lights.sum.irradiance",
            nums(&[1.0; 3]),
            "unknown light `sum`",
            "did you mean `sun`?",
        ),
        (
            "lights.sun.irradianc",
            nums(&[1.0; 3]),
            "unknown light parameter",
            "did you mean `irradiance`?",
        ),
        (
            "lights.sun.position",
            nums(&[1.0; 3]),
            "`sun` is a directional light, which has no `position`",
            "irradiance",
        ),
        (
            "lights.point.direction",
            nums(&[1.0; 3]),
            "`point` is a point light, which has no `direction`",
            "intensity",
        ),
        (
            "lights.sun.direction",
            nums(&[0.0; 3]),
            "found a vector of length zero",
            "",
        ),
        (
            "lights.sun.irradiance",
            nums(&[1.0, -1.0, 1.0]),
            "out of range",
            "",
        ),
        (
            "lights.sun",
            nums(&[1.0; 3]),
            "expected `lights.NAME.PARAMETER`",
            "",
        ),
        (
            "environment.rotatoin",
            Value::Num(1.0),
            "unknown key `rotatoin`",
            "did you mean `rotation`?",
        ),
        ("environment.scale", Value::Num(-1.0), "out of range", ""),
        (
            "environment.scale",
            Value::Num(f64::NAN),
            "out of range",
            "",
        ),
    ];
    for (path, value, problem, help) in cases {
        let mut s = lit();
        let e = set(&mut s, path, &value).unwrap_err().to_string();
        assert!(e.contains(problem) && e.contains(help), "{path}: {e}");
        assert_eq!(s, lit(), "{path}");
    }
    let mut dark = scn("{}").unwrap().0;
    let e = set(&mut dark, "environment.scale", &Value::Num(2.0))
        .unwrap_err()
        .to_string();
    assert!(e.contains("the scene has no environment"), "{e}");
}

/// A cube whose normals face inwards.
const INWARD: &str = "v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\n\
    vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\nvn 0 0 -1\nvn 1 0 0\nvn -1 0 0\nvn 0 1 0\nvn 0 -1 0\n\
    f 1/1/1 2/2/1 3/3/1 4/4/1\nf 5/1/2 6/2/2 7/3/2 8/4/2\nf 1/1/3 4/2/3 8/3/3 5/4/3\n\
    f 2/1/4 3/2/4 7/3/4 6/4/4\nf 1/1/5 2/2/5 6/3/5 5/4/5\nf 4/1/6 3/2/6 7/3/6 8/4/6\n";

#[test]
fn a_skybox_emits_inwards_with_its_texture() {
    let text = r#"{ "materials": [ { "name": "sky", "emission": [2, 2, 2], "emissiontexture": "sky.hdr" } ],
        "entities": [ { "type": "mesh", "file": "box.obj", "material": "sky", "scale": [500, 500, 500] } ] }"#;
    let folder = Folder::new(&[("a.scn", text), ("box.obj", INWARD)]);
    write_hdr(&folder.path("sky.hdr"), &[[0.25, 3.0, 1.0]; 4], 2);
    let (desc, notes) = folder.load("a.scn").unwrap();
    assert!(notes.is_empty(), "{}", lines(&notes));
    assert!(desc.materials[0].texture(TextureSlot::Emission).is_some());
    let (scene, _) = compile(&desc).unwrap();
    assert_eq!(scene.emitters.len(), 12);
    let lights = Lights::new(&scene);
    assert!((lights.total_area() / 6e6 - 1.0).abs() < 1e-6);
    for (i, from) in [Vec3::ZERO, Vec3::new(400.0, -300.0, 10.0)]
        .into_iter()
        .enumerate()
    {
        for k in 0..50 {
            let u = (k as f32 + 0.5) / 50.0;
            let d = lights
                .sample_direct(&scene, from, u, [0.3, 0.6])
                .expect("every point inside is lit");
            assert!(
                (d.radiance - Vec3::new(0.5, 6.0, 2.0)).length() < 1e-5,
                "{i}: {}",
                d.radiance
            );
        }
        let outside = Vec3::new(0.0, 0.0, 2000.0);
        assert!(
            lights
                .sample_direct(&scene, outside, 1.5 / 12.0, [0.3, 0.6])
                .is_none_or(|d| d.wi.z < 0.0)
        );
    }
}

/// Returns the notes of loading and compiling. Panics if light can be sampled.
fn noted(text: &str, files: &[(&str, &str)]) -> String {
    let mut all = vec![("a.scn", text)];
    all.extend(files);
    let (desc, notes) = Folder::new(&all).load("a.scn").unwrap();
    let (scene, compiled) = compile(&desc).unwrap();
    let lights = Lights::new(&scene);
    for k in 0..100 {
        let u = (k as f32 + 0.5) / 100.0;
        assert!(
            lights
                .sample_direct(&scene, Vec3::new(0.1, 0.2, 0.3), u, [u, 0.5])
                .is_none(),
            "{text}"
        );
        assert!(
            lights
                .sample_emission(&scene, u, [u, 0.5], [0.5, u])
                .is_none(),
            "{text}"
        );
    }
    notes
        .iter()
        .chain(&compiled)
        .map(Note::to_string)
        .collect::<Vec<_>>()
        .join("\n")
}

#[test]
fn lights_that_cannot_emit_are_noted_and_left_out() {
    let black = noted(r#"{ "environment": { "color": [0, 0, 0] } }"#, &[]);
    assert!(
        black.contains("environment: the environment is black and has been left out")
            && black.contains("will be black"),
        "{black}"
    );
    let dark = noted(
        r#"{ "lights": [ { "type": "point", "name": "dead", "position": [1, 1, 1], "intensity": [0, 0, 0] } ] }"#,
        &[],
    );
    assert!(
        dark.contains("lights.dead: the light is black and has been left out"),
        "{dark}"
    );
    let lamp = r#"{ "materials": [ { "name": "lamp", "emission": [5, 5, 5] } ],
        "entities": [ { "type": "mesh", "file": "m.obj", "material": "lamp" } ] }"#;
    let flat = noted(
        lamp,
        &[("m.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\nf 1 1 2\n")],
    );
    assert!(
        flat.contains("triangles of a light without area: 2 left out"),
        "{flat}"
    );
    let squeezed = lamp.replace("\"lamp\" }", "\"lamp\", \"scale\": [1, 1, 0] }");
    assert_ne!(squeezed, lamp);
    let squeezed = noted(&squeezed, &[("m.obj", QUAD)]);
    assert!(squeezed.contains("of a light without area"), "{squeezed}");
    let tiny = r#"{ "materials": [ { "name": "lamp", "emission": [5, 5, 5] } ],
        "entities": [ { "type": "sphere", "radius": 1e-30, "material": "lamp" } ] }"#;
    let tiny = noted(tiny, &[]);
    assert!(
        tiny.contains("the sphere is too small to emit light"),
        "{tiny}"
    );
}
