//! Damaged and hostile scenes in XML give a scene or an error that names the file, never a panic or
//! an endless loop.

use lumbre_light::scene::compile;
use proptest::prelude::*;

use super::samples::MITSUBA as TEXT;
use super::{Folder, QUAD};

/// Returns whether a scene loads and compiles. Panics if an error is long or names no file of the
/// folder.
fn loads(folder: &Folder) -> bool {
    match folder.load("a.xml") {
        Ok((desc, _)) => compile(&desc).is_ok(),
        Err(e) => {
            let text = e.to_string();
            assert!(
                (text.contains("a.xml") || text.contains("m.obj")) && text.len() < 2000,
                "{text}"
            );
            false
        }
    }
}

#[test]
fn every_truncation_of_a_scene_is_an_error() {
    let folder = Folder::new(&[("a.xml", TEXT), ("m.obj", QUAD)]);
    assert!(loads(&folder));
    for cut in 0..TEXT.len() {
        folder.write("a.xml", &TEXT[..cut]);
        assert!(
            !loads(&folder),
            "a document cut at byte {cut} must be an error"
        );
    }
}

#[test]
fn no_flipped_bit_or_replaced_value_panics() {
    let folder = Folder::new(&[("m.obj", QUAD)]);
    for i in 0..TEXT.len() {
        let mut bytes = TEXT.as_bytes().to_vec();
        bytes[i] ^= 1 << (i % 7);
        folder.write("a.xml", &bytes);
        loads(&folder);
    }
    // Replaces every value in turn.
    let values: Vec<(usize, &str)> = TEXT.match_indices("value=\"").collect();
    for (at, key) in values {
        let start = at + key.len();
        let end = start + TEXT[start..].find('"').unwrap();
        for other in [
            "",
            "x",
            "-1",
            "1e300",
            "nan",
            "inf",
            "0",
            "99999999999",
            "1,2,3",
            "$spp",
            "$$",
            "true",
        ] {
            folder.write(
                "a.xml",
                format!("{}{other}{}", &TEXT[..start], &TEXT[end..]),
            );
            loads(&folder);
        }
    }
}

#[test]
fn expanding_entities_deep_nesting_and_cycles_are_errors() {
    let bomb = "<!DOCTYPE s [<!ENTITY a \"aaaaaaaaaa\">\
                <!ENTITY b \"&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;\">]><scene>&b;</scene>";
    let deep = format!(
        "{}{}",
        "<bsdf type=\"twosided\">".repeat(100_000),
        "</bsdf>".repeat(100_000)
    );
    let deep_values = format!(
        "<scene version=\"3\">{}",
        "<transform name=\"x\">".repeat(100_000)
    );
    let wrapped = format!(
        "<scene version=\"3.0.0\"><shape type=\"cube\">{}{}</shape></scene>",
        "<bsdf type=\"mask\">".repeat(20),
        "</bsdf>".repeat(20)
    );
    let circle = "<scene version=\"3.0.0\"><include filename=\"./a.xml\"/></scene>".to_owned();
    for text in [bomb.to_owned(), deep, deep_values, wrapped, circle] {
        let folder = Folder::new(&[("a.xml", &text)]);
        assert!(!loads(&folder), "{}", &text[..60]);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn no_random_attribute_value_panics(value in "[-+0-9.eE, :#xnaif]{0,12}", which in 0usize..20) {
        let places: Vec<(usize, &str)> = TEXT.match_indices("value=\"").collect();
        let (at, key) = places[which % places.len()];
        let start = at + key.len();
        let end = start + TEXT[start..].find('"').unwrap();
        let folder = Folder::new(&[("m.obj", QUAD)]);
        folder.write("a.xml", format!("{}{value}{}", &TEXT[..start], &TEXT[end..]));
        loads(&folder);
    }
}
