//! Hostile files by format: meshes, glTF documents, Mitsuba scenes, paths and textures.

use std::io::Write;

use super::samples::{GLTF, QUAD, glb, gltf_buffer, picture, samples};

/// A hostile file: its name, all files, and text that the error contains. The text is empty if the
/// file is readable, and `*` if the operating system decides.
pub type Case = (&'static str, Vec<(&'static str, Vec<u8>)>, &'static str);

fn xml(inside: &str) -> Vec<u8> {
    format!("<scene version=\"3.0.0\">{inside}</scene>").into_bytes()
}

fn json(inside: &str) -> Vec<u8> {
    format!("{{ \"asset\": {{ \"version\": \"2.0\" }}, {inside} }}").into_bytes()
}

/// Returns `n` numbered items joined by `comma`.
pub(super) fn many(n: usize, comma: &str, one: impl Fn(usize) -> String) -> String {
    (0..n).map(one).collect::<Vec<_>>().join(comma)
}

/// Returns that many zeros, compressed.
fn deflated(zeros: usize) -> Vec<u8> {
    let mut coder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
    coder.write_all(&vec![0; zeros]).unwrap();
    coder.finish().unwrap()
}

/// Returns a chunk of a PNG with its checksum.
fn chunk(kind: &[u8; 4], body: &[u8]) -> Vec<u8> {
    let mut crc = flate2::Crc::new();
    crc.update(kind);
    crc.update(body);
    [
        &(body.len() as u32).to_be_bytes()[..],
        kind,
        body,
        &crc.sum().to_be_bytes(),
    ]
    .concat()
}

/// Returns a PNG of the given size with this pixel data, and a chunk before it.
fn png(size: u32, before: &[u8], pixels: &[u8]) -> Vec<u8> {
    let head = [
        &size.to_be_bytes()[..],
        &size.to_be_bytes(),
        &[8, 0, 0, 0, 0],
    ]
    .concat();
    [
        b"\x89PNG\r\n\x1a\n",
        &chunk(b"IHDR", &head)[..],
        before,
        &chunk(b"IDAT", pixels),
        &chunk(b"IEND", &[]),
    ]
    .concat()
}

/// Returns hostile PLY and OBJ files.
pub fn meshes() -> Vec<Case> {
    let ply = |head: &str, body: &[u8]| {
        [format!("ply\nformat {head}\nend_header\n").as_bytes(), body].concat()
    };
    let far = "18446744073709551615";
    let xyz = "property float x\nproperty float y\nproperty float z";
    let names = many(3000, "", |i| {
        format!("mtllib {}a.mtl\n", "./".repeat(i % 40))
    });
    let materials = many(2000, "", |i| format!("newmtl m{i}\n"));
    let used = many(2000, "", |i| format!("usemtl m{}\nf 1 2 3\n", 1999 - i));
    vec![
        (
            "elements without properties, 2^64 - 1 of them",
            vec![("a.ply", ply(&format!("ascii 1.0\nelement x {far}"), b""))],
            "holds at most",
        ),
        (
            "more vertices than bytes",
            vec![(
                "a.ply",
                ply(
                    &format!("binary_little_endian 1.0\nelement vertex {far}\n{xyz}"),
                    &[0; 64],
                ),
            )],
            "holds at most",
        ),
        (
            "a list longer than the file",
            vec![(
                "a.ply",
                ply(
                    "binary_little_endian 1.0\nelement x 1\nproperty list uint uchar l",
                    &[255; 8],
                ),
            )],
            "x 0 of 1",
        ),
        (
            "a header that never ends",
            vec![("a.ply", [b"ply\n".to_vec(), vec![b' '; 1 << 20]].concat())],
            "end_header",
        ),
        (
            "indices out of range",
            vec![("a.obj", b"v 0 0 0\nf 1 1 9223372036854775807\n".to_vec())],
            "line 2",
        ),
        (
            "a polygon of 100,000 corners",
            vec![(
                "a.obj",
                format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nf{}\n", " 1 2 3".repeat(33_334)).into_bytes(),
            )],
            "",
        ),
        (
            "one line continued 200,000 times",
            vec![(
                "a.obj",
                [b"v 0 0 0".to_vec(), b" \\\n".repeat(200_000)].concat(),
            )],
            "no faces to render",
        ),
        (
            "one library named by 3000 paths, and 2000 materials",
            vec![
                (
                    "a.obj",
                    format!("{names}v 0 0 0\nv 1 0 0\nv 0 1 0\n{used}").into_bytes(),
                ),
                ("a.mtl", materials.into_bytes()),
            ],
            "",
        ),
    ]
}

/// Returns hostile glTF documents.
pub fn documents() -> Vec<Case> {
    // Every node refers to the next one twice: 2^60 paths, none of which reaches a mesh.
    let ways = many(60, ",", |i| {
        format!("{{ \"children\": [{0}, {0}] }}", i + 1)
    });
    let primitive = "{ \"attributes\": { \"POSITION\": 0, \"NORMAL\": 0 } }";
    let overlapping = format!(
        "\"meshes\": [ {{ \"primitives\": [ {} ] }} ], \"nodes\": [ {{ \"mesh\": 0 }} ], \"buffers\": [ {{ \"uri\": \"b.bin\" }} ],
         \"accessors\": [ {{ \"bufferView\": 0, \"componentType\": 5121, \"count\": 65530, \"type\": \"VEC3\" }} ],
         \"bufferViews\": [ {{ \"buffer\": 0, \"byteLength\": 65536, \"byteStride\": 1 }} ]",
        many(4000, ",", |_| primitive.to_owned())
    );
    let buffers = format!(
        "\"buffers\": [ {} ]",
        many(2000, ",", |_| "{ \"uri\": \"./b.bin\" }".to_owned())
    );
    let white = png(512, &[], &deflated(512 * 513));
    let views = many(100, ",", |_| {
        format!("{{ \"buffer\": 0, \"byteLength\": {} }}", white.len())
    });
    let images = many(100, ",", |i| format!("{{ \"bufferView\": {i} }}"));
    let textures = many(100, ",", |i| format!("{{ \"source\": {i} }}"));
    let surfaces = many(100, ",", |i| {
        format!("{{ \"pbrMetallicRoughness\": {{ \"baseColorTexture\": {{ \"index\": {i} }} }} }}")
    });
    let pictures = format!(
        "\"buffers\": [ {{ \"uri\": \"b.bin\" }} ], \"bufferViews\": [ {views} ], \"images\": [ {images} ], \"textures\": [ {textures} ],
         \"materials\": [ {surfaces} ]"
    );
    let factors = many(300, ",", |i| {
        format!(
            "{{ \"pbrMetallicRoughness\": {{ \"roughnessFactor\": 0.{:03}, \"metallicRoughnessTexture\": {{ \"index\": 0 }} }} }}",
            i + 1
        )
    });
    let derived = format!(
        "\"images\": [ {{ \"uri\": \"t.png\" }} ], \"textures\": [ {{ \"source\": 0 }} ], \"materials\": [ {factors} ]"
    );
    let ways_to_lie = many(1000, ",", |i| {
        format!(
            "{{ \"pbrMetallicRoughness\": {{ \"baseColorTexture\": {{ \"index\": 0 }} }}, \"normalTexture\": {{ \"index\": 0,
             \"extensions\": {{ \"KHR_texture_transform\": {{ \"offset\": [{i}, 0] }} }} }} }}"
        )
    });
    let laid = format!(
        "\"images\": [ {{ \"uri\": \"t.png\" }} ], \"textures\": [ {{ \"source\": 0 }} ], \"materials\": [ {ways_to_lie} ]"
    );
    let moved = |nodes: String, mesh: &str, rest: &str| {
        let text = format!(
            "\"nodes\": [ {nodes} ], \"meshes\": [ {{ {mesh} }} ], \"buffers\": [ {{ \"uri\": \"b.bin\" }} ],
             \"accessors\": [ {{ \"bufferView\": 0, \"componentType\": 5121, \"count\": 65530, \"type\": \"VEC3\" }},
               {{ \"bufferView\": 0, \"componentType\": 5121, \"count\": 65530, \"type\": \"VEC4\" }},
               {{ \"bufferView\": 0, \"componentType\": 5121, \"count\": 3, \"type\": \"VEC3\" }} ],
             \"bufferViews\": [ {{ \"buffer\": 0, \"byteLength\": 65536, \"byteStride\": 1 }} ] {rest}"
        );
        vec![("a.gltf", json(&text)), ("b.bin", vec![0; 65_536])]
    };
    let placed = "{ \"mesh\": 0, \"extensions\": { \"EXT_mesh_gpu_instancing\": { \"attributes\": { \"TRANSLATION\": 0 } } } }";
    let small = "\"primitives\": [ { \"attributes\": { \"POSITION\": 2 } } ]";
    let joined = "\"primitives\": [ { \"attributes\": { \"POSITION\": 0, \"JOINTS_0\": 1, \"WEIGHTS_0\": 1 } } ]";
    let skins = many(100, ",", |_| "{ \"joints\": [0] }".to_owned());
    let morphed = format!(
        "\"weights\": [ {} ], \"primitives\": [ {{ \"attributes\": {{ \"POSITION\": 0 }}, \"targets\": [ {} ] }} ]",
        many(1000, ",", |_| "1".to_owned()),
        many(1000, ",", |_| "{ \"POSITION\": 0 }".to_owned())
    );
    let mut cut = glb(GLTF, &gltf_buffer());
    cut[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
    vec![
        (
            "nodes that are reached by 2^60 paths",
            vec![("a.gltf", json(&format!("\"nodes\": [ {ways}, {{}} ]")))],
            "two parents",
        ),
        (
            "a node that is its own child",
            vec![(
                "a.gltf",
                json("\"scenes\": [{ \"nodes\": [0] }], \"nodes\": [{ \"children\": [0] }]"),
            )],
            "cycle",
        ),
        (
            "one accessor for 4000 primitives",
            vec![("a.gltf", json(&overlapping)), ("b.bin", vec![0; 65_536])],
            "justifies",
        ),
        (
            "instances of the size of a file",
            moved(placed.to_owned(), small, ""),
            "",
        ),
        (
            "instances of one accessor at 100 nodes",
            moved(many(100, ",", |_| placed.to_owned()), small, ""),
            "entities, too many for the size of the file",
        ),
        (
            "one mesh with 100 skins",
            moved(
                many(100, ",", |i| format!("{{ \"mesh\": 0, \"skin\": {i} }}")),
                joined,
                &format!(", \"skins\": [ {skins} ]"),
            ),
            "justifies",
        ),
        (
            "one accessor as 1000 morph targets",
            moved("{ \"mesh\": 0 }".to_owned(), &morphed, ""),
            "justifies",
        ),
        (
            "one file as 2000 buffers",
            vec![("a.gltf", json(&buffers)), ("b.bin", vec![0; 65_536])],
            "",
        ),
        (
            "one picture as 100",
            vec![("a.gltf", json(&pictures)), ("b.bin", white.clone())],
            "",
        ),
        (
            "one picture with 1000 transforms",
            vec![("a.gltf", json(&laid)), ("t.png", white.clone())],
            "",
        ),
        (
            "300 pictures made from one",
            vec![("a.gltf", json(&derived)), ("t.png", white)],
            "converted textures",
        ),
        (
            "deep lists",
            vec![(
                "a.gltf",
                [b"{\"asset\":".to_vec(), b"[".repeat(200_000)].concat(),
            )],
            "recursion",
        ),
        ("a chunk of 4 GiB", vec![("a.glb", cut)], "truncated"),
        (
            "a picture that is called .glb",
            vec![("a.glb", b"\x89PNG\r\n\x1a\n".to_vec())],
            "neither JSON nor a binary glTF file",
        ),
        (
            "an invalid data URI",
            vec![(
                "a.gltf",
                json("\"buffers\": [{ \"uri\": \"data:;base64,====\" }, { \"uri\": 3 }]"),
            )],
            "the base64 data is damaged",
        ),
    ]
}

/// Returns hostile Mitsuba scenes.
pub fn scenes_in_xml() -> Vec<Case> {
    let doubled = many(40, "", |i| {
        format!(
            "<default name=\"v{}\" value=\"{}\"/>",
            i + 1,
            format!("$v{i}").repeat(8)
        )
    });
    let long = format!(
        "<default name=\"v0\" value=\"{}\"/>{doubled}",
        "x".repeat(100)
    );
    let group = many(1000, "", |_| "<shape type=\"cube\"/>".to_owned());
    let instances = many(1000, "", |_| {
        "<shape type=\"instance\"><ref id=\"g\"/></shape>".to_owned()
    });
    let tubes = many(2100, "", |i| {
        format!(
            "<shape type=\"cylinder\"><float name=\"radius\" value=\"{}\"/></shape>",
            i + 1
        )
    });
    let boards = many(100, "", |i| {
        format!(
            "<bsdf type=\"diffuse\"><texture type=\"checkerboard\" name=\"reflectance\"><rgb name=\"color0\" value=\"0.{:03} 0 0\"/></texture></bsdf>",
            i
        )
    });
    let parts = many(40, "", |i| {
        format!(
            "<bsdf type=\"Composed\" id=\"c{0}\"><ref id=\"c{1}\"/><ref id=\"c{1}\"/></bsdf>",
            i + 1,
            i
        )
    });
    let lines = format!(
        "{}<shape type=\"x\"/>",
        "\n<bsdf type=\"diffuse\"/>".repeat(20_000)
    );
    vec![
        (
            "variables that grow eightfold, 40 times",
            vec![("a.xml", xml(&long))],
            "lengthen",
        ),
        (
            "nested includes, 60 in each file",
            vec![
                ("a.xml", xml(&"<include filename=\"b.xml\"/>".repeat(60))),
                ("b.xml", xml(&"<include filename=\"c.xml\"/>".repeat(60))),
                ("c.xml", xml(&"<include filename=\"d.xml\"/>".repeat(60))),
                ("d.xml", xml(&" ".repeat(500))),
            ],
            "too often",
        ),
        (
            "a million instances",
            vec![(
                "a.xml",
                xml(&format!(
                    "<shape type=\"shapegroup\" id=\"g\">{group}</shape>{instances}"
                )),
            )],
            "entities",
        ),
        (
            "2100 cylinders of triangles",
            vec![("a.xml", xml(&tubes))],
            "triangles in total",
        ),
        ("100 checkerboards", vec![("a.xml", xml(&boards))], ""),
        (
            "nested components that double",
            vec![(
                "a.xml",
                xml(&format!("<bsdf type=\"diffuse\" id=\"c0\"/>{parts}")),
            )],
            "parts",
        ),
        (
            "errors and notes of 20,000 lines",
            vec![("a.xml", xml(&lines))],
            "",
        ),
        (
            "an external entity",
            vec![(
                "a.xml",
                b"<!DOCTYPE s [<!ENTITY a SYSTEM \"file:///etc/passwd\">]><scene>&a;</scene>"
                    .to_vec(),
            )],
            "XML",
        ),
    ]
}

/// Returns scenes that name hostile paths, and hostile JSON.
pub fn places() -> Vec<Case> {
    let named = |file: &str| {
        format!("{{ \"entities\": [ {{ \"type\": \"mesh\", \"file\": \"{file}\" }} ] }}")
            .into_bytes()
    };
    let spelled = many(3000, ",", |i| {
        format!(
            "{{ \"type\": \"mesh\", \"file\": \"{}m.obj\" }}",
            "./".repeat(i % 50)
        )
    });
    let quads = many(2000, "", |_| QUAD.to_owned());
    let up = "../".repeat(40);
    vec![
        (
            "a device",
            vec![("a.scn", named("/dev/zero"))],
            "regular file",
        ),
        ("a folder", vec![("a.scn", named(".."))], "regular file"),
        (
            "a kernel log that is shown as a file",
            vec![("a.scn", named("/proc/kmsg"))],
            "*",
        ),
        (
            "the memory of the machine as a file",
            vec![("a.scn", named("/proc/kcore"))],
            "a.scn",
        ),
        (
            "a path above the root",
            vec![("a.scn", named(&format!("{up}etc/none")))],
            "etc/none",
        ),
        (
            "a name with a zero byte",
            vec![("a.scn", named("m\\u0000.obj"))],
            "a.scn",
        ),
        (
            "a mesh path out of the folder",
            vec![(
                "scene.json",
                b"{ objects: [{ name: '../../../etc/passwd' }] }".to_vec(),
            )],
            "is not the name of a file",
        ),
        (
            "a texture path out of the folder",
            vec![(
                "scene.json",
                b"{ materials: [{ name: '/etc/passwd' }] }".to_vec(),
            )],
            "is not the name of a file",
        ),
        (
            "one mesh named by 3000 paths",
            vec![
                (
                    "a.scn",
                    format!("{{ \"entities\": [ {spelled} ] }}").into_bytes(),
                ),
                ("m.obj", quads.into_bytes()),
            ],
            "",
        ),
        (
            "5000 materials of one name",
            vec![(
                "scene.json",
                format!(
                    "{{ materials: [ {} ] }}",
                    many(5000, ",", |_| "{name:'a'}".to_owned())
                )
                .into_bytes(),
            )],
            "",
        ),
        (
            "deep lists in a folder",
            vec![("scene.json", b"[".repeat(100_000))],
            "deep",
        ),
        (
            "deep objects",
            vec![("a.scn", b"{\"a\":".repeat(100_000))],
            "recursion",
        ),
    ]
}

/// Returns hostile textures.
pub fn textures() -> Vec<Case> {
    let tiny = deflated(2);
    let hidden = |kind: &[u8; 4], body: &[u8]| png(1, &chunk(kind, body), &tiny);
    let text = [&b"a\0\0"[..], &deflated(64 << 20)].concat();
    let mut jpeg = picture(image::ImageFormat::Jpeg);
    let frame = jpeg.windows(2).position(|w| w == [0xff, 0xc0]).unwrap();
    jpeg[frame + 5..frame + 9].copy_from_slice(&[0x3f; 4]);
    let mut tga = picture(image::ImageFormat::Tga);
    tga[12..16].copy_from_slice(&[0, 0x40, 0, 0x40]);
    let mut bmp = picture(image::ImageFormat::Bmp);
    bmp[18..26].copy_from_slice(&[0, 0x40, 0, 0, 0, 0x40, 0, 0]);
    let exr = samples()
        .into_iter()
        .find(|s| s.name == "exr")
        .unwrap()
        .files
        .remove(0)
        .1;
    let window = exr.windows(11).position(|w| w == b"dataWindow\0").unwrap() + 11 + 6 + 4;
    let mut wide = exr.clone();
    wide[window + 8..window + 16]
        .copy_from_slice(&[0xff, 0xff, 0xff, 0x3f, 0xff, 0xff, 0xff, 0x3f]);
    vec![
        (
            "missing pixel data",
            vec![("a.png", png(16_384, &[], &tiny))],
            "a.png",
        ),
        (
            "more pixel data than the header states",
            vec![("a.png", png(1, &[], &deflated(16 << 20)))],
            "",
        ),
        (
            "a text of 64 MiB",
            vec![("a.png", hidden(b"zTXt", &text))],
            "",
        ),
        (
            "a profile of 64 MiB",
            vec![("a.png", hidden(b"iCCP", &text))],
            "",
        ),
        (
            "16,191 pixels a side without data",
            vec![("a.jpg", jpeg)],
            "a.jpg",
        ),
        (
            "16,384 pixels a side without data",
            vec![("a.tga", tga)],
            "a.tga",
        ),
        (
            "16,384 pixels a side in a BMP without data",
            vec![("a.bmp", bmp)],
            "a.bmp",
        ),
        ("a window of 2^60 pixels", vec![("a.exr", wide)], "a.exr"),
        (
            "16,384 pixels a side with one line of data",
            vec![(
                "a.hdr",
                b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 16384 +X 16384\n\x02\x02".to_vec(),
            )],
            "a.hdr",
        ),
    ]
}
