//! Damaged and hostile scenes in XML: an error that names the file, never a panic or an endless
//! wait.

use lumbre::scene::compile;
use proptest::prelude::*;

use super::samples::MITSUBA as TEXT;
use super::{Folder, QUAD};

/// Loads and compiles, with any result; an error must be short and name a file of the folder.
fn survive(folder: &Folder) -> bool {
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
fn every_truncation_is_an_error() {
    let folder = Folder::new(&[("a.xml", TEXT), ("m.obj", QUAD)]);
    assert!(survive(&folder));
    for cut in 0..TEXT.len() {
        folder.write("a.xml", &TEXT[..cut]);
        assert!(!survive(&folder), "half a document is an error: {cut}");
    }
}

#[test]
fn flipped_bits_and_exchanged_values_are_survived() {
    let folder = Folder::new(&[("m.obj", QUAD)]);
    for i in 0..TEXT.len() {
        let mut bytes = TEXT.as_bytes().to_vec();
        bytes[i] ^= 1 << (i % 7);
        folder.write("a.xml", &bytes);
        survive(&folder);
    }
    // Every value in turn is replaced.
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
            survive(&folder);
        }
    }
}

#[test]
fn entities_that_grow_deep_nests_and_circles_are_refused_at_once() {
    let bomb = "<!DOCTYPE s [<!ENTITY a \"aaaaaaaaaa\"><!ENTITY b \"&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;\">]><scene>&b;</scene>";
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
        assert!(!survive(&folder), "{}", &text[..60]);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn random_numbers_of_attributes_are_survived(value in "[-+0-9.eE, :#xnaif]{0,12}", which in 0usize..20) {
        let places: Vec<(usize, &str)> = TEXT.match_indices("value=\"").collect();
        let (at, key) = places[which % places.len()];
        let start = at + key.len();
        let end = start + TEXT[start..].find('"').unwrap();
        let folder = Folder::new(&[("m.obj", QUAD)]);
        folder.write("a.xml", format!("{}{value}{}", &TEXT[..start], &TEXT[end..]));
        survive(&folder);
    }
}
