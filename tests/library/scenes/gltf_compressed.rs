//! Compressed glTF: buffer views by meshoptimizer, and meshes by Draco. The data were written by the
//! reference encoders, meshoptimizer 1.3 and Draco 1.5.

use glam::{DQuat, DVec3, Vec3};
use lumbre_light::scene::desc::SceneDesc;

use super::gltf_motion::{assert_refused, load};
use super::{Folder, mesh_of};

/// Positions of a grid of 3 x 3 vertices at (x, y, x y / 4), in version 0, version 1, and by the
/// filter `EXPONENTIAL`.
const POSITIONS: [(&str, &str); 3] = [
    (
        "oAAAATzzwAD///////8BO++AAH5/fn9+AAABAwwAAP//AQMIAAB+AAABAPDAAP///wEA7wAAfH1+AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA=",
        "NONE",
    ),
    (
        "oepqagB//4B//4B//wBIAH8BAPABfQN+fgEAAAAAAAAAAAAAAAAAAAAAAAAAAAASARI=",
        "NONE",
    ),
    (
        "oAABM8/AAEA/QD8gIAABOSAAAMoAAQM8AABAHyAAATkgAADKAAEAz8AAEA8QEAABOSAAAMoAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAI4AAACOAAAAjg==",
        "EXPONENTIAL",
    ),
];
/// Indices of its 8 triangles.
const INDICES: [(&str, &str); 2] = [
    ("4f4eEA5OHhIODwYAdodWZ3iphmWJaJgBaQAA", "TRIANGLES"),
    ("0QAECAYMAgYECAYMAgIECAYMAgYECAYMAgAAAAA=", "INDICES"),
];
/// Normals along (x - 1, y - 1, 1) in bytes, by the filter `OCTAHEDRAL`.
const NORMALS: &str =
    "oAE//8AAVFTRfn7RVFQBPw/AACkqVFQqKQAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAANbWfwA=";
/// Colours (i / 8, 1 - i / 8, 1 / 2) in 16 bits, by the filter `COLOR`.
const COLORS: &str =
    "od2tABAAAgAPDw8NDw8PDwAgAAEAICAgIB4gICAAMAACAgAvLy8tLy8vLwAAAAAAAAAAAAAAAAAA/58AwP9f//8AAA==";
/// Rotations by i * 22.5 degrees about z, by the filter `QUATERNION`.
const ROTATIONS: &str =
    "oaWVAPABAduXFp8A8AH+NT1DRQAeAKAVmN4AHgBGRD7HABAAAQAAAAAAAAAAAAAAAAAAAAAAAAAA/38AAA==";
/// The grid with texture coordinates (x / 2, y / 2), by Draco: sequential, and by Edgebreaker.
const DRACO: [&str; 2] = [
    "RFJBQ08CAgEAAAAICQEAAQMBBAMBAgQCBQQDBAYEBwYEBQcFCAcBAwAJAwAAAwkCAAEEAgQAAgICAQABAQAPAx0HL+U4AwTghfj/AQAAwP8HAAAAAeD/BwD+fwAAAPL/AQAASADw//+//x8AAAD9fwAAAAQAAAAA/z8AAAABAQANAx0HJ+U4AwTghfw/APg/AAjA//8/APg/AAiA//8/APg/AAAAAAAA/w8AAAABAQACAwFAAQAQERERAQAAAAABAAAAAAAAAAAAAAAAAAAAAAAAQA4AAAAAAAAAAAAAgD8M",
    "RFJBQ08CAgEBAAAACQgCCAEAA+/TGv8BEf8CiED/AohAA/8AAAAAAAEAAAEACQMAAAIBAwkCAAECAQQCBAACAQEBAQAPAx0HJ1UVOQ5ZFQWaz/lLgP///w8A/f/+//8DAPT/AAAABMD/AwAA4P8BAAAAgAAAAP8PAAAAAAQAAAAA/z8AAAAAAAAAAAAAAAAAAAAAAEAOBQEBAA0DOQ4PHQcdBzkOHQcHPQ4FERO8zpb/////7/9AL1+AHgBg8zsCBwAAACUD9QWBAAAAAP8PAAAAAAAAAAAAAAAAgD8MAQEBAQIC5TgdBwVv0xfQgAAAAAABAAAA",
];

/// Returns the corners of the triangles of a mesh, sorted.
fn triangles(desc: &SceneDesc) -> Vec<[[i32; 3]; 3]> {
    let mesh = mesh_of(desc, 0);
    let corner = |i: u32| {
        (mesh.positions[i as usize] * 400.0)
            .round()
            .as_ivec3()
            .to_array()
    };
    let sorted = |t: &[u32; 3]| {
        let mut corners = t.map(corner);
        corners.sort_unstable();
        corners
    };
    let mut all: Vec<_> = mesh.triangles.iter().map(sorted).collect();
    all.sort_unstable();
    all
}

/// Returns the triangles of the grid like [`triangles`].
fn expected() -> Vec<[[i32; 3]; 3]> {
    let mut all = Vec::new();
    for (x, y) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let at = |dx: i32, dy: i32| [400 * (x + dx), 400 * (y + dy), 100 * (x + dx) * (y + dy)];
        all.extend([
            [at(0, 0), at(0, 1), at(1, 0)],
            [at(0, 1), at(1, 0), at(1, 1)],
        ]);
    }
    all.iter_mut().for_each(|corners| corners.sort_unstable());
    all.sort_unstable();
    all
}

/// Returns the number of bytes of a text in base64.
fn length(text: &str) -> usize {
    text.len() / 4 * 3 - text.matches('=').count()
}

/// Returns a document of the grid with compressed buffer views.
fn meshopt(positions: (&str, &str), indices: (&str, &str)) -> Folder {
    let views = [
        (positions.0, 9, 12, "ATTRIBUTES", positions.1),
        (indices.0, 24, 2, indices.1, "NONE"),
        (NORMALS, 9, 4, "ATTRIBUTES", "OCTAHEDRAL"),
        (COLORS, 9, 8, "ATTRIBUTES", "COLOR"),
        (ROTATIONS, 9, 8, "ATTRIBUTES", "QUATERNION"),
    ];
    let view = |(i, (data, count, stride, mode, filter)): (
        usize,
        &(&str, usize, usize, &str, &str),
    )| {
        let stride_of_vertices = if i == 2 { r#""byteStride": 4, "# } else { "" };
        format!(
            r#"{{ "buffer": 5, "byteLength": {}, {stride_of_vertices}"extensions": {{ "KHR_meshopt_compression": {{ "buffer": {i},
  "byteLength": {}, "count": {count}, "byteStride": {stride}, "mode": "{mode}", "filter": "{filter}" }} }} }}"#,
            count * stride,
            length(data)
        )
    };
    let buffer = |(data, ..): &(&str, usize, usize, &str, &str)| {
        format!(
            r#"{{ "uri": "data:;base64,{data}", "byteLength": {} }}"#,
            length(data)
        )
    };
    let all: Vec<String> = views.iter().enumerate().map(view).collect();
    let buffers: Vec<String> = views.iter().map(buffer).collect();
    let text = format!(
        r#"{{ "asset": {{ "version": "2.0" }}, "extensionsRequired": ["KHR_meshopt_compression", "KHR_mesh_quantization", "EXT_mesh_gpu_instancing"],
"nodes": [ {{ "mesh": 0, "extensions": {{ "EXT_mesh_gpu_instancing": {{ "attributes": {{ "ROTATION": 4 }} }} }} }} ],
"meshes": [ {{ "primitives": [ {{ "attributes": {{ "POSITION": 0, "NORMAL": 2, "COLOR_0": 3 }}, "indices": 1 }} ] }} ],
"accessors": [ {{ "bufferView": 0, "componentType": 5126, "count": 9, "type": "VEC3" }},
  {{ "bufferView": 1, "componentType": 5123, "count": 24, "type": "SCALAR" }},
  {{ "bufferView": 2, "componentType": 5120, "count": 9, "type": "VEC3", "normalized": true }},
  {{ "bufferView": 3, "componentType": 5123, "count": 9, "type": "VEC4", "normalized": true }},
  {{ "bufferView": 4, "componentType": 5122, "count": 9, "type": "VEC4", "normalized": true }} ],
"bufferViews": [ {} ], "buffers": [ {}, {{ "byteLength": 300 }} ] }}"#,
        all.join(",\n"),
        buffers.join(",\n")
    );
    Folder::new(&[("a.gltf", text)])
}

#[test]
fn buffer_views_of_all_modes_and_filters_are_decoded() {
    for positions in POSITIONS {
        for indices in INDICES {
            let desc = load(&meshopt(positions, indices), &[]).unwrap().0;
            assert_eq!(triangles(&desc), expected(), "{positions:?} {indices:?}");
            let mesh = mesh_of(&desc, 0);
            for (i, (n, c)) in mesh.normals.iter().zip(&mesh.colors).enumerate() {
                let [x, y] = [i % 3, i / 3].map(|at| at as f32 - 1.0);
                assert!(
                    n.distance(Vec3::new(x, y, 1.0).normalize_or(Vec3::Z)) < 0.02,
                    "{i}: {n}"
                );
                let t = i as f32 / 8.0;
                assert!(c.distance(Vec3::new(t, 1.0 - t, 0.5)) < 1e-4, "{i}: {c}");
            }
            assert_eq!(desc.entities.len(), 9);
            for (i, e) in desc.entities.iter().enumerate() {
                let turn = DQuat::from_rotation_z(i as f64 * std::f64::consts::FRAC_PI_8);
                let found = e.transform.to_world().transform_vector3(DVec3::X);
                assert!(found.distance(turn * DVec3::X) < 1e-4, "{i}: {found}");
            }
        }
    }
}

#[test]
fn damaged_buffer_views_are_errors_with_their_place() {
    let folder = meshopt(POSITIONS[1], INDICES[0]);
    let edits = [
        (
            r#""mode": "TRIANGLES""#,
            r#""mode": "INDICES""#,
            "bufferViews[1].KHR_meshopt_compression: the compressed data are too short, or of another mode",
        ),
        (
            r#""mode": "TRIANGLES""#,
            r#""mode": "LINES""#,
            "cannot have the mode `LINES`",
        ),
        (
            r#""count": 24, "byteStride""#,
            r#""count": 27, "byteStride""#,
            "bufferViews[1].KHR_meshopt_compression: the compressed data end early",
        ),
        (
            r#""count": 24, "byteStride""#,
            r#""count": 21, "byteStride""#,
            "left after the compressed data",
        ),
        (
            r#""count": 9, "byteStride": 12"#,
            r#""count": 9, "byteStride": 13"#,
            "9 elements of 13 bytes cannot have the mode",
        ),
        (
            r#""count": 9, "byteStride": 12"#,
            r#""count": 1000000000, "byteStride": 12"#,
            "expand to more than the size of the file justifies",
        ),
        (
            r#""filter": "OCTAHEDRAL""#,
            r#""filter": "SPIRAL""#,
            "the filter `SPIRAL`",
        ),
        (
            "data:;base64,oepqagB//4B//4B//wBI",
            "data:;base64,oepqagB//4B//4B//w9I",
            "bufferViews[0]",
        ),
        (
            r#""buffer": 0"#,
            r#""buffer": 5"#,
            "exceed the buffer of 0 bytes",
        ),
        (
            r#""KHR_meshopt_compression", "KHR_mesh_q"#,
            r#""KHR_mesh_q"#,
            "buffers[5]: the buffer has neither",
        ),
    ];
    assert_refused(&folder, "a.gltf", &edits);
}

/// Returns a document of the grid, compressed by Draco.
fn draco(data: &str) -> Folder {
    let length = length(data);
    let text = format!(
        r#"{{ "asset": {{ "version": "2.0" }}, "extensionsRequired": ["KHR_draco_mesh_compression"], "nodes": [ {{ "mesh": 0 }} ],
"materials": [ {{ "pbrMetallicRoughness": {{ "baseColorTexture": {{ "index": 0 }} }} }} ],
"textures": [ {{ "source": 0 }} ], "images": [ {{ "uri": "t.png" }} ],
"meshes": [ {{ "primitives": [ {{ "material": 0, "attributes": {{ "POSITION": 0, "TEXCOORD_0": 1, "COLOR_0": 2 }}, "indices": 3,
  "extensions": {{ "KHR_draco_mesh_compression": {{ "bufferView": 0, "attributes": {{ "POSITION": 0, "TEXCOORD_0": 1, "COLOR_0": 2 }} }} }} }} ] }} ],
"accessors": [ {{ "componentType": 5126, "count": 9, "type": "VEC3" }}, {{ "componentType": 5126, "count": 9, "type": "VEC2" }},
  {{ "componentType": 5121, "count": 9, "type": "VEC4", "normalized": true }}, {{ "componentType": 5123, "count": 24, "type": "SCALAR" }} ],
"bufferViews": [ {{ "buffer": 0, "byteLength": {length} }} ], "buffers": [ {{ "uri": "data:;base64,{data}", "byteLength": {length} }} ] }}"#
    );
    let folder = Folder::new(&[("a.gltf", text)]);
    image::RgbImage::new(1, 1)
        .save(folder.path("t.png"))
        .unwrap();
    folder
}

#[test]
fn meshes_by_draco_are_decoded() {
    for data in DRACO {
        let desc = load(&draco(data), &[]).unwrap().0;
        assert_eq!(triangles(&desc), expected());
        let mesh = mesh_of(&desc, 0);
        for (p, uv) in mesh.positions.iter().zip(&mesh.uvs) {
            // Texture coordinates have 12 bits, and start at the bottom here.
            assert!(
                (uv.x - p.x / 2.0).abs() + (1.0 - uv.y - p.y / 2.0).abs() < 1e-3,
                "{p} {uv}"
            );
        }
        // Vertices of odd indices have a red of 1 of 255.
        for (p, color) in mesh.positions.iter().zip(&mesh.colors) {
            let red = (p.x + p.y).round() % 2.0 / 255.0;
            assert!((color.x - red).abs() < 1e-6, "{p}: {color}");
        }
    }
}

#[test]
fn damaged_meshes_by_draco_are_errors_with_their_place() {
    let folder = draco(DRACO[1]);
    let text = std::fs::read_to_string(folder.path("a.gltf")).unwrap();
    let place = "meshes[0].primitives[0].KHR_draco_mesh_compression";
    let edits = [
        (
            r#""attributes": { "POSITION": 0, "TEXCOORD_0": 1, "COLOR_0": 2 } }"#,
            r#""attributes": { "POSITION": 7 } }"#,
            "has no attribute 7",
        ),
        (
            r#""bufferView": 0"#,
            r#""bufferView": 1"#,
            "expected an index below 1",
        ),
        (
            r#""byteLength": 246 } ], "buffers""#,
            r#""byteLength": 146 } ], "buffers""#,
            "Draco: ",
        ),
        ("data:;base64,RFJBQ", "data:;base64,RFJBR", "Draco"),
    ];
    assert_refused(&folder, place, &edits);
    // No damage is a panic, and no number of a header is memory.
    let start = text.find("base64,").unwrap() + 7;
    for i in 0..DRACO[1].len() {
        for to in ["A", "/", "9"] {
            let mut bad = text.clone();
            bad.replace_range(start + i..=start + i, to);
            folder.write("a.gltf", bad);
            let (_, most) = super::meter::peak(|| load(&folder, &[]).is_ok());
            assert!(most < 384 << 20, "{i}: {most} bytes");
        }
    }
}
