use super::*;

const HEAD: &str = "element vertex 4\nproperty float x\nproperty double y\nproperty float \
                    z\nproperty uchar red\nproperty float nx\nproperty float ny\nproperty float \
                    nz\nproperty float s\nproperty float t\nelement edge 1\nproperty list uchar \
                    int which\nelement face 2\nproperty uchar flags\nproperty list uchar int \
                    vertex_indices\nend_header\n";

fn read_bytes(bytes: &[u8]) -> Result<(MeshDesc, Vec<Note>), SceneError> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("m.ply");
    std::fs::write(&path, bytes).unwrap();
    let mut notes = Vec::new();
    load_mesh(&path, "m", &mut notes).map(|mesh| (mesh, notes))
}

/// Returns a quad in an encoding. Its normals point to -z, against its vertex order.
fn quad(format: &str) -> Vec<u8> {
    let mut bytes = format!("ply\nformat {format} 1.0\ncomment ours\n{HEAD}").into_bytes();
    let corners = [[0.0f32, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    if format == "ascii" {
        for [x, y] in corners {
            bytes.extend(format!("{x} {y} 0.5 255 0 0 -2 {x} {y}\r\n").bytes());
        }
        bytes.extend(b"2 0 1\n7 4 0 1 2 3\n7 3 0 1 2\n");
        return bytes;
    }
    let big = format == "binary_big_endian";
    let mut append = |raw: &mut [u8]| {
        if big {
            raw.reverse();
        }
        bytes.extend_from_slice(raw);
    };
    for [x, y] in corners {
        append(&mut x.to_le_bytes());
        append(&mut f64::from(y).to_le_bytes());
        append(&mut 0.5f32.to_le_bytes());
        append(&mut [255]);
        for value in [0.0, 0.0, -2.0, x, y] {
            append(&mut f32::to_le_bytes(value));
        }
    }
    for list in [&[0, 1][..], &[0, 1, 2, 3], &[0, 1, 2]] {
        if list.len() > 2 {
            append(&mut [7]);
        }
        append(&mut [list.len() as u8]);
        list.iter().for_each(|i| append(&mut i32::to_le_bytes(*i)));
    }
    bytes
}

#[test]
fn all_encodings_yield_the_same_mesh() {
    let (ascii, notes) = read_bytes(&quad("ascii")).unwrap();
    assert_eq!(ascii.positions[2], Vec3::new(1.0, 1.0, 0.5));
    assert_eq!(ascii.uvs[2], Vec2::ONE);
    assert_eq!(ascii.normals, [Vec3::NEG_Z; 4]);
    assert_eq!(
        ascii.triangles,
        [[0, 2, 1], [0, 3, 2], [0, 2, 1]],
        "oriented to the side of the normals"
    );
    assert_eq!((ascii.slots.len(), ascii.triangle_slot.len()), (1, 3));
    assert!(ascii.colors.is_empty(), "red alone is not a colour");
    let messages: Vec<&str> = notes.iter().map(|n| n.message.as_str()).collect();
    assert_eq!(messages, ["the element `edge` is not supported; ignored"]);
    for format in ["binary_little_endian", "binary_big_endian"] {
        assert_eq!(
            read_bytes(&quad(format)).unwrap().0.content_hash,
            ascii.content_hash,
            "{format}"
        );
    }
}

#[test]
fn errors_state_the_location() {
    let plain = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float \
                 y\nproperty float z\nelement face 1\nproperty list uchar int \
                 vertex_index\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    assert_eq!(
        read_bytes(plain.as_bytes()).unwrap().0.triangles,
        [[0, 1, 2]]
    );
    for (from, to, expected) in [
        ("1 0 0\n", "1 x 0\n", "vertex 1 of 3"),
        ("1 0 0\n", "1 nan 0\n", "finite"),
        ("3 0 1 2", "3 0 1 3", "vertex 3, counted from 0"),
        ("3 0 1 2", "3 0 1 -1", "expected an index"),
        ("3 0 1 2", "200 0 1 2", "a list has 200"),
        ("3 0 1 2", "3 0", "holds at most"),
        ("0 1 0\n3 0 1 2\n", "0 1", "ends early"),
        ("vertex 3", "vertex 4000000000", "holds at most"),
        ("face 1", "face 99999999999999", "holds at most"),
        ("vertex 3", "vertex many", "line 3"),
        ("float z", "floot z", "an unknown type"),
        ("float z", "float w", "x, y and z"),
        ("vertex_index", "corners", "vertex_indices"),
        ("ascii 1.0", "latin 1.0", "binary_little_endian"),
        ("end_header\n", "", "expected format"),
        ("ply\n", "plx\n", "expected `ply`"),
    ] {
        let e = read_bytes(plain.replacen(from, to, 1).as_bytes())
            .unwrap_err()
            .to_string();
        assert!(e.contains(expected) && e.contains("m.ply"), "{to}: {e}");
    }
}

#[test]
fn no_truncated_or_flipped_file_panics() {
    for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
        let whole = quad(format);
        for cut in 0..whole.len() {
            let _ = read_bytes(&whole[..cut]);
        }
        for i in 0..whole.len() {
            let mut flipped = whole.clone();
            flipped[i] ^= 1 << (i % 8);
            let _ = read_bytes(&flipped);
        }
    }
}

#[test]
fn concave_polygons_are_covered_exactly() {
    let text = "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\n\
                property float z\nelement face 1\nproperty list uchar int vertex_indices\n\
                property list uchar float texcoord\nend_header\n\
                -1 -1 0\n1 -1 0\n1 1 0\n0.8 -0.8 0\n-1 -0.8 0\n5 0 1 2 3 4 0\n";
    let (mesh, notes) = read_bytes(text.as_bytes()).unwrap();
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
        let cross = (b - a).cross(c - a);
        assert!(cross.z > 0.0, "{t:?}");
        0.5 * cross.length()
    };
    let sum: f32 = mesh.triangles.iter().map(area).sum();
    assert!((sum - 0.58).abs() < 1e-6, "{sum}");
    let message = &notes[0].message;
    assert!(
        message.contains("`face`") && message.contains("`texcoord`"),
        "{message}"
    );
}
