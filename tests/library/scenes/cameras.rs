//! Orthographic and spherical cameras in every format, in edits, and after an export.

use std::collections::BTreeMap;

use glam::Vec3;
use lumbre_light::scene::compile;
use lumbre_light::scene::desc::{
    CameraDesc, CameraKind, EnvironmentSource, Model, SceneDesc, ViewWindow,
};
use lumbre_light::value::Value;
use lumbre_scene_io::load::load;
use lumbre_scene_io::{edit, export};

use super::export::{PICTURE, different_pixels, gallery, material};
use super::{Folder, lines};

/// Loads a file of this name and text, and returns the notes as well.
fn read(name: &str, text: &str) -> Result<(SceneDesc, String), String> {
    let loaded = Folder::new(&[(name, text)]).load(name);
    let (desc, notes) = loaded.map_err(|e| e.to_string())?;
    Ok((desc, lines(&notes)))
}

/// Returns a Mitsuba scene with an orthographic sensor, whose transform has these steps before the
/// last one.
fn mitsuba(steps: &str) -> String {
    format!(
        r#"<scene version="3.0.0"><sensor type="orthographic"><transform name="to_world">{steps}
<lookat origin="0, 1, 5" target="0, 1, 0" up="0, 1, 0"/></transform>
<film type="hdrfilm"><integer name="width" value="64"/><integer name="height" value="32"/></film></sensor>
<shape type="sphere"/></scene>"#
    )
}

#[test]
fn the_scale_of_a_mitsuba_sensor_is_half_the_width_of_the_picture() {
    let (desc, notes) = read("a.xml", &mitsuba(r#"<scale value="3"/>"#)).unwrap();
    let camera = &desc.camera;
    assert_eq!(camera.kind, CameraKind::Orthographic);
    assert!((camera.view_height - 3.0).abs() < 1e-5, "{camera:?}");
    assert_eq!(camera.position, Vec3::new(0.0, 1.0, 5.0));
    assert!(((camera.target - camera.position).normalize_or_zero() + Vec3::Z).length() < 1e-6);
    assert!(notes.is_empty(), "{notes}");
    let (desc, notes) = read("a.xml", &mitsuba(r#"<scale x="1" y="4"/>"#)).unwrap();
    assert!((desc.camera.view_height - 4.0).abs() < 1e-5);
    assert!(notes.contains("not square"), "{notes}");
    for (steps, problem) in [
        (r#"<scale value="0"/>"#, "not invertible"),
        (r#"<scale value="1e30"/>"#, "height of the picture"),
        (r#"<scale value="1e-30"/>"#, "height of the picture"),
    ] {
        let e = read("a.xml", &mitsuba(steps)).unwrap_err();
        assert!(e.contains(problem), "{steps}: {e}");
    }
}

#[test]
fn cameras_far_from_the_origin_keep_their_direction() {
    let mitsuba = r#"<scene version="3.0.0"><sensor type="perspective"><transform name="to_world">
<lookat origin="2000000,-3000000,2000000" target="0,0,400000" up="0,1,0"/></transform></sensor></scene>"#;
    // The world is mirrored along x.
    let pbrt =
        "LookAt 2000000 -3000000 2000000  0 0 400000  0 1 0\nCamera \"perspective\"\nWorldBegin\n";
    let gltf = r#"{ "asset": { "version": "2.0" }, "scenes": [ { "nodes": [0] } ],
"nodes": [ { "camera": 0, "translation": [3e6, 1e6, -2e6], "rotation": [0, 0.6, 0, 0.8] } ],
"cameras": [ { "type": "perspective", "perspective": { "yfov": 0.7, "znear": 0.1 } } ] }"#;
    for (name, text, expected) in [
        ("a.xml", mitsuba, Vec3::new(-2.0, 3.0, -1.6)),
        ("a.pbrt", pbrt, Vec3::new(2.0, 3.0, -1.6)),
        // By 2 atan(3 / 4), whose sine and cosine are 24 and 7 over 25.
        ("a.gltf", gltf, Vec3::new(-24.0, 0.0, -7.0)),
    ] {
        let (desc, _) = read(name, text).unwrap();
        let found = (desc.camera.target - desc.camera.position).normalize_or_zero();
        let expected = expected.normalize_or_zero();
        assert!(found.distance(expected) < 1e-6, "{name}: {found}");
    }
}

/// Returns the window and the resolution of a Mitsuba scene with these properties of the sensor and
/// of its film of 64 by 32 pixels.
fn mitsuba_window(sensor: &str, film: &str) -> Result<([f32; 4], [u32; 2]), String> {
    let text = mitsuba("")
        .replace(
            "type=\"orthographic\">",
            &format!("type=\"perspective\">{sensor}"),
        )
        .replace("</film>", &format!("{film}</film>"));
    read("a.xml", &text).map(|(desc, notes)| {
        assert!(notes.is_empty(), "{notes}");
        (desc.camera.window.to_array(), desc.resolution)
    })
}

#[test]
fn the_crop_of_a_mitsuba_film_is_a_window() {
    let integers = |pairs: &[(&str, i32)]| -> String {
        let property = |(name, value): &(&str, i32)| {
            format!("<integer name=\"crop_{name}\" value=\"{value}\"/>")
        };
        pairs.iter().map(property).collect()
    };
    let corner = integers(&[
        ("offset_x", 32),
        ("offset_y", 8),
        ("width", 16),
        ("height", 24),
    ]);
    let offset = "<float name=\"principal_point_offset_x\" value=\"0.25\"/>";
    assert_eq!(
        mitsuba_window("", "").unwrap(),
        ([0.0, 1.0, 0.0, 1.0], [64, 32])
    );
    assert_eq!(
        mitsuba_window("", &corner).unwrap(),
        ([0.5, 0.75, 0.25, 1.0], [16, 24])
    );
    assert_eq!(
        mitsuba_window(offset, &corner).unwrap(),
        ([0.75, 1.0, 0.25, 1.0], [16, 24])
    );
    let (desc, _) = read("a.xml", &mitsuba(r#"<scale x="-1"/>"#)).unwrap();
    assert_eq!(desc.camera.window.to_array(), [1.0, 0.0, 0.0, 1.0]);
    for (film, problem) in [
        (integers(&[("offset_x", 64)]), "crop"),
        (integers(&[("width", 65)]), "crop"),
        (integers(&[("height", 0)]), "crop"),
        (integers(&[("width", -3)]), "crop_width"),
    ] {
        let e = mitsuba_window("", &film).unwrap_err();
        assert!(e.contains(problem), "{film}: {e}");
    }
}

#[test]
fn crops_and_shifted_screens_of_pbrt_are_windows() {
    let view = |film: &str, camera: &str| {
        let film =
            format!("Film \"rgb\" \"integer xresolution\" 200 \"integer yresolution\" 100 {film}");
        let text = format!("Scale -1 1 1\n{film}\nCamera {camera}\nWorldBegin\n");
        read("a.pbrt", &text)
            .map(|(desc, notes)| (desc.camera.window.to_array(), desc.resolution, notes))
    };
    let crop = "\"float cropwindow\" [ 0.5 1 0 0.25 ]";
    let pixels = "\"integer pixelbounds\" [ 0 50 20 100 ]";
    let shifted = "\"perspective\" \"float screenwindow\" [ -1 3 -1 1 ]";
    let found = |film: &str, camera: &str| {
        let (window, resolution, notes) = view(film, camera).unwrap();
        assert!(notes.is_empty(), "{notes}");
        (window, resolution)
    };
    let perspective = "\"perspective\"";
    assert_eq!(found(crop, perspective), ([0.5, 1.0, 0.0, 0.25], [100, 25]));
    assert_eq!(
        found(pixels, "\"orthographic\""),
        ([0.0, 0.25, 0.2, 1.0], [50, 80])
    );
    // The middle of the screen is half its height, a quarter of its width, to the right.
    assert_eq!(found("", shifted), ([0.25, 1.25, 0.0, 1.0], [200, 100]));
    assert_eq!(found(crop, shifted), ([0.75, 1.25, 0.0, 0.25], [100, 25]));
    let spherical = "\"spherical\" \"string mapping\" \"equirectangular\"";
    let (window, resolution, notes) = view(crop, spherical).unwrap();
    assert_eq!((window, resolution), ([0.0, 1.0, 0.0, 1.0], [200, 100]));
    assert!(notes.contains("a crop of a spherical camera"), "{notes}");
    let e = view("\"float cropwindow\" [ 0.5 0.5 0 1 ]", perspective).unwrap_err();
    assert!(e.contains("no pixel"), "{e}");
}

/// Returns a pbrt scene with this camera, after a transform.
fn pbrt(transform: &str, camera: &str) -> Result<(SceneDesc, String), String> {
    let film = "Film \"rgb\" \"integer xresolution\" 200 \"integer yresolution\" 100";
    read(
        "a.pbrt",
        &format!("{transform}\n{film}\nCamera {camera}\nWorldBegin\n"),
    )
}

#[test]
fn the_screen_window_of_pbrt_is_the_picture() {
    let look = "Scale -1 1 1\nLookAt 0 1 5  0 1 0  0 1 0";
    let view = |params: &str| pbrt(look, &format!("\"orthographic\" {params}")).unwrap();
    let (desc, notes) = view("");
    assert_eq!(
        (desc.camera.kind, desc.camera.view_height),
        (CameraKind::Orthographic, 2.0)
    );
    assert_eq!(desc.camera.position, Vec3::new(0.0, 1.0, 5.0));
    assert!(notes.is_empty(), "{notes}");
    let (desc, notes) = view("\"float screenwindow\" [ -6 6 -3 3 ]");
    assert!(
        desc.camera.view_height == 6.0 && notes.is_empty(),
        "{notes}"
    );
    let (desc, notes) = view("\"float frameaspectratio\" 1");
    assert!(
        desc.camera.view_height == 2.0 && notes.contains("not square"),
        "{notes}"
    );
    let (_, notes) = view("\"float lensradius\" 0.1");
    assert!(notes.contains("lens of an orthographic camera"), "{notes}");
    let (desc, _) = pbrt("Scale -0.5 0.5 0.5", "\"orthographic\"").unwrap();
    assert!((desc.camera.view_height - 4.0).abs() < 1e-5);
    let e = pbrt(
        look,
        "\"orthographic\" \"float screenwindow\" [ -1e30 1e30 -1e30 1e30 ]",
    );
    assert!(e.unwrap_err().contains("height of the screen"));
}

#[test]
fn the_middle_of_a_spherical_picture_of_pbrt_is_on_the_left() {
    // Longitudes of pbrt grow to the left. So the scene is mirrored with `Scale -1 1 1`, where that
    // of a perspective camera is not.
    let equirectangular = "\"spherical\" \"string mapping\" \"equirectangular\"";
    let (desc, notes) = pbrt("LookAt 0 1 5  0 1 0  0 1 0", equirectangular).unwrap();
    let camera = &desc.camera;
    assert_eq!(camera.kind, CameraKind::Spherical);
    assert_eq!(camera.position, Vec3::new(0.0, 1.0, 5.0));
    let (forward, back) = (Vec3::NEG_Z, Vec3::X);
    let middle = (camera.target - camera.position).normalize_or_zero();
    // The first x axis of pbrt is up cross forward, here -x; the middle of the picture is opposite.
    assert!((middle - back).length() < 1e-6, "{middle}");
    // A quarter from the left edge is forward: to the left of the middle.
    assert!((camera.up.cross(middle) - forward).length() < 1e-6);
    assert!(notes.is_empty(), "{notes}");
    let (_, notes) = pbrt("LookAt 0 1 5  0 1 0  0 1 0", "\"spherical\"").unwrap();
    assert!(notes.contains("mapping `equalarea`"), "{notes}");
    let (_, notes) = pbrt("Scale -1 1 1\nLookAt 0 1 5  0 1 0  0 1 0", equirectangular).unwrap();
    assert!(notes.contains("x is negated"), "{notes}");
    let (desc, notes) = pbrt("", "\"environment\"").unwrap();
    assert!(
        desc.camera.kind == CameraKind::Spherical && notes.is_empty(),
        "{notes}"
    );
    let (_, notes) = pbrt("", "\"realistic\"").unwrap();
    assert!(
        notes.contains("the camera `realistic` is not supported"),
        "{notes}"
    );
}

/// Returns a glTF document whose only node has this camera.
fn gltf(camera: &str) -> String {
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}],
"nodes": [{{"camera": 0, "translation": [1, 2, 3]}}], "cameras": [{camera}]}}"#
    )
}

#[test]
fn a_gltf_camera_is_twice_as_high_as_its_magnification() {
    let view = |xmag: &str, ymag: &str| {
        let view = format!(r#"{{"xmag": {xmag}, "ymag": {ymag}, "znear": 0.1, "zfar": 9}}"#);
        let camera = format!(r#"{{"type": "orthographic", "orthographic": {view}}}"#);
        read("a.gltf", &gltf(&camera)).unwrap()
    };
    let (desc, _) = view("2.5", "1.5");
    let [width, height] = desc.resolution.map(f64::from);
    let (desc, notes) = view(&(1.5 * width / height).to_string(), "1.5");
    assert_eq!(
        (
            desc.camera.kind,
            desc.camera.view_height,
            desc.camera.position
        ),
        (CameraKind::Orthographic, 3.0, Vec3::new(1.0, 2.0, 3.0))
    );
    assert!(notes.is_empty(), "{notes}");
    assert!(view("9", "1.5").1.contains("`ymag` is used"));
    for bad in ["0", "1e300", "\"x\"", "null"] {
        let (desc, notes) = view("1", bad);
        assert_eq!(desc.camera.kind, CameraKind::Perspective);
        assert!(notes.contains("missing or out of range"), "{notes}");
    }
}

/// Applies changes to the scene of the gallery.
fn edited(changes: &[(&str, Value)]) -> Result<SceneDesc, String> {
    let mut desc = gallery(Vec::new());
    let changes: BTreeMap<String, Value> = changes
        .iter()
        .map(|(path, value)| ((*path).to_owned(), value.clone()))
        .collect();
    edit::apply(&mut desc, &changes).map_err(|e| e.to_string())?;
    Ok(desc)
}

#[test]
fn kind_and_height_are_edited_and_a_lens_is_refused() {
    let desc = edited(&[
        ("camera.kind", "orthographic".into()),
        ("camera.view_height", Value::Num(2.5)),
    ])
    .unwrap();
    assert_eq!(
        (desc.camera.kind, desc.camera.view_height),
        (CameraKind::Orthographic, 2.5)
    );
    let e = edited(&[("camera.kind", "fisheye".into())]).unwrap_err();
    assert!(e.contains("perspective"), "{e}");
    for height in [0.0, -1.0, f64::INFINITY, f64::NAN, 1e300] {
        let e = edited(&[("camera.view_height", Value::Num(height))]).unwrap_err();
        assert!(e.contains("camera.view_height"), "{e}");
    }
    let window = |edges: [f64; 4]| Value::List(edges.map(Value::Num).to_vec());
    for edges in [
        [0.5, 0.5, 0.0, 1.0],
        [0.0, 1.0, 1.0, 0.0],
        [0.0, 1e9, 0.0, 1.0],
    ] {
        let e = edited(&[("camera.window", window(edges))]).unwrap_err();
        assert!(e.contains("camera.window"), "{e}");
    }
    let spherical = ("camera.kind", "spherical".into());
    let e = edited(&[spherical, ("camera.window", window([0.0, 0.5, 0.0, 1.0]))]).unwrap_err();
    assert!(e.contains("show their whole view"), "{e}");
    for kind in ["orthographic", "spherical"] {
        let e = edited(&[
            ("camera.kind", kind.into()),
            ("camera.aperture", Value::Num(0.1)),
        ])
        .unwrap_err();
        assert!(e.contains(&format!("{kind} cameras have no lens")), "{e}");
    }
}

#[test]
fn a_camera_without_extent_or_with_a_lens_does_not_compile() {
    let compiled = |change: fn(&mut CameraDesc)| {
        let mut desc = gallery(Vec::new());
        desc.camera.kind = CameraKind::Orthographic;
        change(&mut desc.camera);
        compile(&desc).map(|_| ()).map_err(|e| e.to_string())
    };
    assert_eq!(compiled(|_| ()), Ok(()));
    let heights: [fn(&mut CameraDesc); 4] = [
        |c| c.view_height = 0.0,
        |c| c.view_height = -1.0,
        |c| c.view_height = f32::INFINITY,
        |c| c.view_height = f32::NAN,
    ];
    for change in heights {
        assert!(compiled(change).unwrap_err().contains("camera.view_height"));
    }
    let e = compiled(|c| c.optics = c.optics.with_aperture(0.1)).unwrap_err();
    assert!(e.contains("no lens") && e.contains("aperture = 0"), "{e}");
    let unused: fn(&mut CameraDesc) = |c| (c.kind, c.view_height) = (CameraKind::Spherical, 0.0);
    assert_eq!(compiled(unused), Ok(()));
}

#[test]
fn exports_show_the_same_picture_after_import() {
    let whole = [0.0, 1.0, 0.0, 1.0];
    for (kind, window) in [
        (CameraKind::Orthographic, whole),
        (CameraKind::Spherical, whole),
        (CameraKind::Perspective, [0.3, 0.9, -0.1, 0.5]),
        (CameraKind::Perspective, [0.9, 0.3, 0.2, 0.8]),
        (CameraKind::Orthographic, [0.9, 0.3, -0.1, 0.5]),
    ] {
        let clay = material("clay", |m| {
            (m.model, m.base_color) = (Model::Lambert, Vec3::new(0.7, 0.4, 0.2));
        });
        let mut desc = gallery(vec![clay]);
        // Maps are resampled, and parallel rays see one of their directions alone.
        if let Some(environment) = &mut desc.environment {
            environment.source = EnvironmentSource::Color(Vec3::new(0.3, 0.4, 0.5));
        }
        (desc.camera.kind, desc.camera.view_height) = (kind, 7.5);
        desc.camera.window = ViewWindow::from_array(window);
        desc.resolution = PICTURE;
        let dir = tempfile::tempdir().unwrap();
        let written = [
            export::pbrt(&desc, &dir.path().join("p")).unwrap(),
            export::mitsuba(&desc, &dir.path().join("m")).unwrap(),
        ];
        for exported in written {
            let (imported, _) = load(&exported.scene).unwrap();
            let notes = lines(&exported.notes);
            let lost = kind == CameraKind::Spherical && exported.scene.ends_with("scene.xml");
            assert_eq!(notes.contains("no spherical sensor"), lost, "{notes}");
            if lost {
                assert_eq!(imported.camera.kind, CameraKind::Perspective);
                continue;
            }
            assert_eq!(imported.camera.kind, kind);
            let differences = different_pixels(&desc, &imported);
            // pbrt gets the mirror image of the scene instead, whose paths have other numbers.
            let limit = if desc.camera.window.mirrors() && exported.scene.ends_with("scene.pbrt") {
                100
            } else {
                20
            };
            assert!(
                differences < limit,
                "{kind:?} {window:?}: {differences} pixels differ"
            );
        }
    }
}
