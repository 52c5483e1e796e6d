//! Truncated, corrupted and hostile files give an error or a scene, never a panic or an endless
//! loop.

use lumbre_light::scene::compile;
use proptest::prelude::*;

use super::samples::{SCN, picture, scn_mesh};
use super::{Folder, builtin_path, scn};

/// Returns a small scene that uses every part of the format, and its files.
fn folder() -> (Folder, String, String) {
    let (text, obj) = (SCN, scn_mesh());
    let folder = Folder::new(&[("a.scn", text), ("m.obj", &obj)]);
    folder.write("t.png", picture(image::ImageFormat::Png));
    (folder, text.to_owned(), obj)
}

/// Returns whether a scene loads and compiles. Panics if an error is long or names no file of the
/// folder.
fn loads(folder: &Folder, name: &str) -> bool {
    match folder.load(name) {
        Ok((desc, _)) => compile(&desc).is_ok(),
        Err(e) => {
            let text = e.to_string();
            assert!(
                ["a.scn", "m.obj", "t.png"].iter().any(|f| text.contains(f)),
                "{text}"
            );
            assert!(text.len() < 2000, "{text}");
            false
        }
    }
}

#[test]
fn the_undamaged_scene_loads() {
    let (folder, ..) = folder();
    assert!(loads(&folder, "a.scn"));
}

#[test]
fn no_truncation_of_a_scn_or_its_mesh_panics() {
    let (folder, text, obj) = folder();
    for cut in 0..text.len() {
        folder.write("a.scn", &text[..cut]);
        assert!(
            !loads(&folder, "a.scn"),
            "a document cut at byte {cut} must be an error"
        );
    }
    folder.write("a.scn", &text);
    for cut in 0..obj.len() {
        folder.write("m.obj", &obj[..cut]);
        loads(&folder, "a.scn");
    }
}

#[test]
fn no_flipped_byte_panics() {
    let (folder, text, obj) = folder();
    let texture = std::fs::read(folder.path("t.png")).unwrap();
    for (name, bytes) in [
        ("a.scn", text.as_bytes()),
        ("m.obj", obj.as_bytes()),
        ("t.png", &texture),
    ] {
        for i in 0..bytes.len() {
            for flip in [0x01, 0x10, 0x80] {
                let mut damaged = bytes.to_vec();
                damaged[i] ^= flip;
                folder.write(name, &damaged);
                loads(&folder, "a.scn");
            }
        }
        folder.write(name, bytes);
    }
}

#[test]
fn no_truncation_of_a_builtin_mesh_panics() {
    let text = std::fs::read(builtin_path("cornell/room.obj")).unwrap();
    let folder = Folder::new(&[(
        "a.scn",
        r#"{ "entities": [ { "type": "mesh", "file": "m.obj" } ] }"#,
    )]);
    for cut in (0..text.len()).step_by(7) {
        folder.write("m.obj", &text[..cut]);
        loads(&folder, "a.scn");
    }
}

#[test]
fn deep_nesting_and_long_texts_give_short_errors() {
    for open in ["[", "{\"a\":"] {
        let e = scn(&open.repeat(100_000)).unwrap_err().to_string();
        assert!(e.contains("recursion limit") && e.len() < 500, "{e}");
    }
    let long = "x".repeat(1 << 20);
    for text in [
        format!("{{ \"{long}\": 1 }}"),
        format!("{{ \"entities\": [ {{ \"type\": \"{long}\" }} ] }}"),
        format!("{{ \"maxdepth\": \"{long}\" }}"),
    ] {
        match scn(&text) {
            Ok((_, notes)) => assert!(notes[0].to_string().len() < 500),
            Err(e) => assert!(e.to_string().len() < 500),
        }
    }
}

#[test]
fn extreme_numbers_give_valid_scenes_or_errors_and_other_encodings_are_errors() {
    for number in [
        "1e999",
        "-1e999",
        "NaN",
        "Infinity",
        "0x10",
        "1e-400",
        "99999999999999999999999999",
    ] {
        if let Ok((desc, _)) = scn(&format!(
            "{{ \"camera\": {{ \"position\": [{number}, 0, 0] }} }}"
        )) {
            assert!(desc.camera.position.is_finite(), "{number}");
        }
        if let Ok((desc, _)) = scn(&format!("{{ \"maxdepth\": {number} }}")) {
            assert!((1..=65_535).contains(&desc.max_depth), "{number}");
        }
    }
    let folder = Folder::new::<&str>(&[]);
    folder.write("a.scn", b"{ \"maxdepth\": 5, \"\xff\": 1 }");
    assert!(!loads(&folder, "a.scn"));
    folder.write(
        "a.scn",
        "{ }"
            .encode_utf16()
            .flat_map(u16::to_le_bytes)
            .collect::<Vec<u8>>(),
    );
    assert!(!loads(&folder, "a.scn"));
}

#[test]
fn a_scene_that_names_itself_is_an_empty_mesh_and_a_folder_is_an_error() {
    let folder = Folder::new(&[
        (
            "a.scn",
            r#"{ "entities": [ { "type": "mesh", "file": "a.scn" } ] }"#,
        ),
        (
            "b.scn",
            r#"{ "entities": [ { "type": "mesh", "file": "." } ] }"#,
        ),
    ]);
    // Read as an OBJ, no line of the scene is valid.
    let (desc, notes) = folder.load("a.scn").unwrap();
    assert!(notes.iter().any(|n| n.message.contains("no faces")));
    assert!(compile(&desc).is_ok());
    assert!(
        folder
            .load("b.scn")
            .unwrap_err()
            .to_string()
            .contains("not a regular file")
    );
}

#[test]
fn too_many_triangles_are_refused_before_they_are_allocated() {
    let mut obj = String::from("v 0 0 0\nv 1 0 0\nv 0 1 0\n");
    obj.push_str(&"f 1 2 3\n".repeat(20_000));
    let entity = "{ \"type\": \"mesh\", \"file\": \"m.obj\" }";
    let text = format!("{{ \"entities\": [ {} ] }}", vec![entity; 4_000].join(","));
    let folder = Folder::new(&[("a.scn", &text), ("m.obj", &obj)]);
    let (desc, _) = folder.load("a.scn").unwrap();
    let e = compile::compile_sharing(&desc, compile::Sharing::Never)
        .unwrap_err()
        .to_string();
    assert!(e.contains("80000000"), "{e}");
    // As one shared mesh they are only 20,000.
    assert_eq!(compile(&desc).unwrap().0.triangles.len(), 20_000);
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 300,
        failure_persistence: None,
        rng_seed: proptest::test_runner::RngSeed::Fixed(2),
        ..ProptestConfig::default()
    })]

    #[test]
    fn no_sequence_of_obj_words_panics(words in proptest::collection::vec(
        prop_oneof![
            Just("v".to_owned()), Just("vt".to_owned()), Just("vn".to_owned()), Just("f".to_owned()),
            Just("usemtl".to_owned()), Just("o".to_owned()), Just("\n".to_owned()), Just("\\\n".to_owned()),
            "-?[0-9]{1,20}", "-?[0-9]/-?[0-9]?/-?[0-9]", "-?[0-9]\\.[0-9]e[0-9]{1,3}", Just("nan".to_owned()),
        ], 0..60)) {
        let folder = Folder::new(&[
            ("a.scn", r#"{ "entities": [ { "type": "mesh", "file": "m.obj" } ] }"#),
            ("m.obj", &words.join(" ")),
        ]);
        loads(&folder, "a.scn");
    }
}
