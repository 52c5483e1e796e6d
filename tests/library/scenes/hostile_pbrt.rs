//! Hostile scenes of pbrt.

use std::io::Write;

use super::hostile_cases::{Case, many};

/// Returns hostile scenes of pbrt.
pub fn scenes_of_pbrt() -> Vec<Case> {
    let world = |inside: &str| format!("WorldBegin\n{inside}").into_bytes();
    let sphere = "Shape \"sphere\"\n";
    let group = format!("ObjectBegin \"o\"\n{}ObjectEnd\n", sphere.repeat(1000));
    let instances = "ObjectInstance \"o\"\n".repeat(1000);
    let disks = many(2100, "", |i| {
        format!("Shape \"disk\" \"float innerradius\" 0.0{:04}\n", i + 1)
    });
    let boards = many(100, "", |i| {
        format!("Texture \"t{i}\" \"spectrum\" \"checkerboard\" \"rgb tex1\" [0.{i:03} 0 0]\n")
    });
    let mixes = many(9, "", |i| {
        format!(
            "MakeNamedMaterial \"m{0}\" \"string type\" \"mix\" \"string materials\" [\"m{1}\" \
            \"m{1}\"]\n",
            i + 1,
            i
        )
    });
    let mixes = format!(
        "MakeNamedMaterial \"m0\" \"string type\" \"diffuse\"\n{mixes}NamedMaterial \
        \"m9\"\n{sphere}"
    );
    let sixty = |name: &str| format!("Include \"{name}\"\n").repeat(60).into_bytes();
    let zeros = {
        let mut coder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
        coder.write_all(&vec![b' '; 64 << 20]).unwrap();
        coder.finish().unwrap()
    };
    let levels = "Shape \"loopsubdiv\" \"integer levels\" 32 \"integer indices\" [0 1 2] \
    \"point3 P\" [0 0 0 1 0 0 0 1 0]\n";
    vec![
        (
            "nested includes of pbrt, 60 in each file",
            vec![
                (
                    "a.pbrt",
                    world(&String::from_utf8(sixty("b.pbrt")).unwrap()),
                ),
                ("b.pbrt", sixty("c.pbrt")),
                ("c.pbrt", sixty("d.pbrt")),
                ("d.pbrt", vec![b' '; 500]),
            ],
            "too often",
        ),
        (
            "a file that includes itself",
            vec![("a.pbrt", world("Include \"./a.pbrt\""))],
            "includes itself",
        ),
        (
            "a million instances of pbrt",
            vec![("a.pbrt", world(&format!("{group}{instances}")))],
            "entities",
        ),
        (
            "2100 disks of triangles",
            vec![("a.pbrt", world(&disks))],
            "triangles in total",
        ),
        (
            "100 checkerboards of pbrt",
            vec![("a.pbrt", world(&boards))],
            "",
        ),
        (
            "mixes that double nine times",
            vec![("a.pbrt", world(&mixes))],
            "levels deep",
        ),
        (
            "subdivision by 32 levels",
            vec![("a.pbrt", world(&levels.repeat(2)))],
            "",
        ),
        (
            "a compressed mesh of 64 MiB of spaces",
            vec![
                (
                    "a.pbrt",
                    world("Shape \"plymesh\" \"string filename\" \"m.ply.gz\""),
                ),
                ("m.ply.gz", zeros),
            ],
            "expands to more than",
        ),
        (
            "100,000 open blocks",
            vec![("a.pbrt", world(&"AttributeBegin\n".repeat(100_000)))],
            "",
        ),
        (
            "10,000 attributes",
            vec![(
                "a.pbrt",
                world(&"Attribute \"shape\" \"float radius\" 1\n".repeat(10_000)),
            )],
            "attributes of a kind",
        ),
        (
            "a transform of 1e76",
            vec![(
                "a.pbrt",
                world(&format!("{}{sphere}", "Scale 1e38 1e38 1e38\n".repeat(2))),
            )],
            "not finite",
        ),
        (
            "a device as an include",
            vec![("a.pbrt", world("Include \"/dev/zero\""))],
            "regular file",
        ),
        (
            "one string without an end",
            vec![("a.pbrt", [b"\"".to_vec(), vec![b'x'; 1 << 20]].concat())],
            "does not end",
        ),
        (
            "an include that is no scene",
            vec![
                ("a.pbrt", world("Include \"secret\"")),
                ("secret", b"root:x:0:0".to_vec()),
            ],
            "secret: line 1: expected a directive, found other text",
        ),
    ]
}
