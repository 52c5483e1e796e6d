//! `.scn` files: keys, defaults, notes and errors.

use std::sync::Arc;

use glam::Vec3;
use lumbre_light::scene::compile;
use lumbre_light::scene::desc::{DEFAULT_MATERIAL, TextureSlot};

use super::{Folder, QUAD, lines, mesh_of, scn};

#[test]
fn an_empty_object_is_the_default_scene() {
    let (desc, notes) = scn("{}").unwrap();
    assert!(notes.is_empty());
    assert_eq!((desc.resolution, desc.max_depth), ([1280, 720], 5));
    assert_eq!(
        (desc.camera.position, desc.camera.target),
        (Vec3::ZERO, Vec3::new(0.0, 0.0, 2.0))
    );
    assert_eq!(desc.camera.view_deg(), 45.0);
    let (_, notes) = compile(&desc).unwrap();
    assert!(lines(&notes).contains("no surfaces"));
}

#[test]
fn keys_ignore_case_and_a_byte_order_mark_is_accepted() {
    let (desc, notes) =
        scn("\u{feff}{ \"MaxDepth\": 7, \"Camera\": { \"LookAt\": [0, 1, 0], \"FOV\": 30 } }")
            .unwrap();
    assert!(notes.is_empty(), "{notes:?}");
    assert_eq!(
        (desc.max_depth, desc.camera.view_deg(), desc.camera.target),
        (7, 30.0, Vec3::Y)
    );
}

#[test]
fn lens_keys_are_read_and_conflicting_ones_are_errors() {
    let camera =
        |text: &str| scn(&format!("{{ \"camera\": {{ {text} }} }}")).map(|(desc, _)| desc.camera);
    let c = camera(r#""aperture": 0.2, "focus_distance": 3"#).unwrap();
    assert_eq!((c.lens_diameter(), c.focus_distance), (0.2, Some(3.0)));
    let c = camera(r#""f_number": 2.8, "focal_length": 0.05, "sensor_height": 0.024"#).unwrap();
    assert!((c.lens_diameter() - 0.05 / 2.8).abs() < 1e-8 && (c.view_deg() - 26.99).abs() < 0.01);
    assert_eq!(c.focus_distance, None);
    for (text, problem) in [
        (
            r#""aperture": 0, "f_number": 2, "focal_length": 0.05"#,
            "camera.aperture: `aperture` and `f_number` exclude each other",
        ),
        (
            r#""FOV": 30, "focal_length": 0.05, "sensor_height": 0.024"#,
            "already determined by `sensor_height` and `focal_length`",
        ),
        (
            r#""f_number": 2"#,
            "camera.f_number: an f-number has no effect without",
        ),
        (
            r#""focus_distance": 0"#,
            "camera.focus_distance: expected a positive number",
        ),
        (
            r#""sensor_height": -1"#,
            "camera.sensor_height: expected a positive number",
        ),
        (
            r#""aperture": -1"#,
            "camera.aperture: expected a diameter of 0 or more",
        ),
        (
            r#""focal_length": "long""#,
            "camera.focal_length: expected a number",
        ),
    ] {
        let e = camera(text).unwrap_err().to_string();
        assert!(e.contains(problem), "{text}: {e}");
    }
}

#[test]
fn radiance_is_emission_times_colour_and_emitters_do_not_reflect() {
    let text = r#"{ "materials": [
        { "name": "a", "emission": [2, 4, 8], "color": [0.5, 0.25, 1] },
        { "name": "b", "emission": [3, 3, 3] },
        { "name": "c", "color": [0.1, 0.2, 0.3] } ] }"#;
    let (desc, _) = scn(text).unwrap();
    assert_eq!(desc.materials[0].emission, Vec3::new(1.0, 1.0, 8.0));
    assert_eq!(desc.materials[1].emission, Vec3::splat(3.0));
    assert_eq!(desc.materials[2].base_color, Vec3::new(0.1, 0.2, 0.3));
    let (scene, _) = compile(&desc).unwrap();
    assert_eq!(
        scene
            .materials
            .iter()
            .map(|m| m.emitter_reflects)
            .collect::<Vec<_>>(),
        [false, false, true]
    );
}

#[test]
fn ignored_keys_and_values_are_noted_with_their_path() {
    let text = r#"{ "camera": { "position": [0, 0, 1], "antialiasing_radius": 0.3, "lens": 1 }, "wavelength": 550,
        "materials": [ { "name": "a", "sheenTint": 1, "sheen": 0, "clearcoat": 0.5, "displacementtexture": "d.png",
                         "colour": [1, 1, 1], "roughness": 3, "ior": 0, "color": [2, 0.5, -1] },
                       { "name": "a" } ],
        "entities": [ { "type": "sphere", "radius": 1, "material": "a", "inverted_normal": true, "scale": [2, 2, 2],
                        "file": "x.obj", "colour": 1 } ] }"#;
    let (desc, notes) = scn(text).unwrap();
    assert!(notes.iter().all(|n| n.file.ends_with("a.scn")));
    let all = lines(&notes);
    for part in [
        "camera.antialiasing_radius: the pixel filter is set by the script's `aa`",
        "camera.lens, materials[0].displacementtexture, entities[0].colour, wavelength: unknown key",
        "materials[0].colour: unknown key, ignored (did you mean `color`?)",
        "materials[0].roughness: 3 is outside 0 to 1; 1 is used",
        "materials[0].ior: 0 is outside 0.01 to 100",
        "materials[0].color[0]: 2 is outside 0 to 1",
        "materials[0].color[2]: -1 is outside",
        "materials[1].name: a material named `a` is already defined",
        "entities[0].inverted_normal: ",
        "entities[0]: `rotation` and `scale` do not apply to spheres",
        "entities[0].file: a sphere has no `file`",
    ] {
        assert!(all.contains(part), "{part} in\n{all}");
    }
    assert_eq!(
        (desc.materials[0].sheen_tint, desc.materials[0].clearcoat),
        (1.0, 0.5)
    );
    assert_eq!(notes.len(), 11, "{all}");
    assert_eq!(desc.materials[0].base_color, Vec3::new(1.0, 0.5, 0.0));
}

#[test]
fn errors_name_the_file_and_the_key() {
    let cases = [
        (
            "{ \"maxdepth\": 5,\n  \"camera\" }",
            "line 2, column 12: invalid JSON",
        ),
        ("[1]", "document: expected an object, found a list"),
        ("", "invalid JSON"),
        (
            "{ \"resolution\": [0, 4] }",
            "resolution: expected two whole numbers from 1 to 32768, found 0 and 4",
        ),
        (
            "{ \"resolution\": [4] }",
            "resolution: expected 2 numbers, found 1 items",
        ),
        (
            "{ \"resolution\": [1.5, 2] }",
            "resolution: expected two whole",
        ),
        (
            "{ \"maxdepth\": \"deep\" }",
            "maxdepth: expected a number, found the string \"deep\"",
        ),
        (
            "{ \"camera\": { \"fov\": null } }",
            "camera.fov: expected a number, found null",
        ),
        (
            "{ \"camera\": { \"position\": [0, 0, 2] } }",
            "camera: `position` and `lookat` are the same",
        ),
        (
            "{ \"camera\": { \"position\": [0, 1e300, 2] } }",
            "camera.position: (0, ",
        ),
        (
            "{ \"camera\": 4 }",
            "camera: expected an object, found the number 4",
        ),
        (
            "{ \"materials\": {} }",
            "materials: expected a list, found an object",
        ),
        (
            "{ \"materials\": [ { \"color\": [1, 1, 1] } ] }",
            "materials[0]: a material needs a `name`",
        ),
        (
            "{ \"materials\": [ { \"name\": \"m\", \"color\": [1, \"1\", 1] } ] }",
            "materials[0].color[1]: expected a",
        ),
        (
            "{ \"materials\": [ { \"name\": \"m\", \"roughness\": true } ] }",
            "found the boolean true",
        ),
        (
            "{ \"entities\": [ {} ] }",
            "entities[0]: an entity needs a `type`",
        ),
        (
            "{ \"entities\": [ { \"type\": \"shpere\" } ] }",
            "entities[0].type: unknown entity type `shpere` (did",
        ),
        (
            "{ \"entities\": [ { \"type\": \"sphere\" } ] }",
            "entities[0]: a sphere needs a `radius`",
        ),
        (
            "{ \"entities\": [ { \"type\": \"sphere\", \"radius\": -1 } ] }",
            "entities[0].radius: expected a positive",
        ),
        (
            "{ \"entities\": [ { \"type\": \"mesh\" } ] }",
            "entities[0]: a mesh needs a `file`",
        ),
        ("{ \"maxdepth\": 1e999 }", "line 1"),
    ];
    for (text, part) in cases {
        let e = scn(text).unwrap_err().to_string();
        assert!(e.contains("a.scn: ") && e.contains(part), "{text}: {e}");
    }
}

#[test]
fn errors_of_referenced_files_name_the_file_and_the_key() {
    let mesh = r#"{ "entities": [ { "type": "mesh", "file": "sub\\no.obj" } ] }"#;
    let e = scn(mesh).unwrap_err().to_string();
    assert!(
        e.contains("a.scn: entities[0].file: cannot read") && e.contains("no.obj"),
        "{e}"
    );
    let texture = r#"{ "materials": [ { "name": "m", "albedotexture": "no.png" } ] }"#;
    let e = scn(texture).unwrap_err().to_string();
    assert!(
        e.contains("a.scn: materials[0].albedotexture: texture of the material `m`: cannot read")
            && e.contains("no.png"),
        "{e}"
    );
    let folder = Folder::new(&[
        (
            "a.scn",
            r#"{ "entities": [ { "type": "mesh", "file": "m.obj" } ] }"#,
        ),
        (
            "b.scn",
            r#"{ "materials": [ { "name": "m", "masktexture": "m.obj" } ] }"#,
        ),
        ("m.obj", "v 0 0 0\nf 1 2 3\n"),
    ]);
    let e = folder.load("a.scn").unwrap_err().to_string();
    assert!(
        e.contains("m.obj: line 2: ") && e.contains("a.scn: entities[0].file"),
        "{e}"
    );
    let e = folder.load("b.scn").unwrap_err().to_string();
    assert!(
        e.contains("m.obj: image: ") && e.contains("b.scn: materials[0].masktexture"),
        "{e}"
    );
}

#[test]
fn meshes_and_textures_named_twice_are_read_once() {
    let folder = Folder::new(&[
        (
            "a.scn",
            r#"{ "materials": [ { "name": "m", "albedotexture": "t.png", "masktexture": "t.png" },
                                { "name": "n", "albedotexture": "t.png", "emission": [1, 1, 1] } ],
                 "entities": [ { "type": "mesh", "file": "m.obj" },
                               { "type": "mesh", "file": "m.obj", "material": "n", "scale": [2, 2, 2] },
                               { "type": "sphere", "radius": 1 },
                               { "type": "sphere", "radius": 2, "name": "sphere_2" },
                               { "type": "sphere", "radius": 3 },
                               { "type": "mesh", "file": "m.obj", "name": "sphere" } ] }"#,
        ),
        ("m.obj", QUAD),
    ]);
    image::RgbImage::from_pixel(1, 1, image::Rgb([128, 128, 128]))
        .save(folder.path("t.png"))
        .unwrap();
    let (desc, notes) = folder.load("a.scn").unwrap();
    assert!(Arc::ptr_eq(mesh_of(&desc, 0), mesh_of(&desc, 1)));
    let first = desc.materials[0].texture(TextureSlot::BaseColor).unwrap();
    assert!(Arc::ptr_eq(
        first,
        desc.materials[0].texture(TextureSlot::Mask).unwrap()
    ));
    assert!(Arc::ptr_eq(
        first,
        desc.materials[1].texture(TextureSlot::Emission).unwrap()
    ));
    let names: Vec<&str> = desc.entities.iter().map(|e| e.name.as_str()).collect();
    assert_eq!(
        names,
        ["m", "m_2", "sphere", "sphere_2", "sphere_3", "sphere_4"]
    );
    assert!(
        lines(&notes)
            .contains("entities[5].name: the name is taken; this one is called `sphere_4`")
    );
    assert_eq!(
        desc.materials.last().unwrap().name,
        DEFAULT_MATERIAL,
        "the quad and the spheres need the default material"
    );
}

#[test]
fn faces_get_the_material_of_the_entity_or_the_mesh_or_the_default() {
    let obj = format!(
        "{QUAD}usemtl unknown\nf 1//1 2//1 3//1\nusemtl b\nf 1//1 2//1 3//1\no next\nf 1//1 2//1 3//1\n"
    );
    let scene = |entity: &str, extra: &str| {
        let text = format!(
            r#"{{ "materials": [ {{ "name": "a" }}, {{ "name": "b" }} {extra} ],
                  "entities": [ {{ "type": "mesh", "file": "m.obj" {entity} }} ] }}"#
        );
        let (desc, _) = Folder::new(&[("a.scn", &text), ("m.obj", &obj)])
            .load("a.scn")
            .unwrap();
        let (compiled, notes) = compile(&desc).unwrap();
        let names: Vec<String> = compiled
            .attributes
            .iter()
            .map(|t| desc.materials[t.material as usize].name.clone())
            .collect();
        (names.join(" "), lines(&notes))
    };
    let (names, notes) = scene("", "");
    assert_eq!(names, "default_material default_material a b b");
    assert!(
        notes.contains("entities.m: no material is named `unknown`; the first material is used"),
        "{notes}"
    );
    assert_eq!(scene(r#", "default_material": "b""#, "").0, "b b a b b");
    assert_eq!(scene(r#", "material": "b""#, "").0, "b b b b b");
    let (names, notes) = scene(r#", "material": "unknown""#, "");
    assert_eq!(names, "a a a a a");
    assert!(notes.contains("`unknown`"));
    assert_eq!(
        scene("", r#", { "name": "default_material" }"#).0,
        "default_material default_material a b b"
    );
}

#[test]
fn transforms_rotate_about_z_then_y_then_x_and_scale_last() {
    let text = r#"{ "materials": [ { "name": "m" } ], "entities": [ { "type": "mesh", "file": "m.obj",
        "position": [10, 0, 0], "rotation": [1.5707963267948966, 0, 1.5707963267948966], "scale": [1, 1, 3] } ] }"#;
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1\n";
    let (desc, _) = Folder::new(&[("a.scn", text), ("m.obj", obj)])
        .load("a.scn")
        .unwrap();
    let (scene, _) = compile(&desc).unwrap();
    // The x axis becomes y, then z, then is scaled by three; y becomes -x.
    let expected = [
        Vec3::new(10.0, 0.0, 0.0),
        Vec3::new(10.0, 0.0, 3.0),
        Vec3::new(9.0, 0.0, 0.0),
    ];
    for (p, e) in scene.triangles[0].iter().zip(expected) {
        assert!((*p - e).length() < 1e-6, "{p} is not {e}");
    }
}
