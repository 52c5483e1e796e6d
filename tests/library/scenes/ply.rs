//! Vertex colours of PLY files.

use glam::Vec3;

use super::{Folder, mesh_of};

/// Returns the loaded vertex colours of a triangle with these colours of type `ty` in an ASCII PLY.
fn colors(ty: &str, rows: [&str; 3]) -> Vec<Vec3> {
    let [a, b, c] = rows;
    let text = format!(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty {ty} red\n\
         property {ty} green\nproperty {ty} blue\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
         0 0 0 {a}\n1 0 0 {b}\n0 1 0 {c}\n3 0 1 2\n"
    );
    let (desc, _) = Folder::new(&[("a.ply", &text)]).load("a.ply").unwrap();
    let mesh = mesh_of(&desc, 0);
    mesh.colors.clone()
}

#[test]
fn byte_colours_are_srgb_and_float_colours_are_linear() {
    let bytes = colors("uchar", ["255 0 0", "0 188 0", "10 10 255"]);
    let close = |found: Vec3, expected: Vec3| {
        assert!(
            (found - expected).length() < 1e-5,
            "{found} is not {expected}"
        )
    };
    close(bytes[0], Vec3::X);
    close(bytes[1], Vec3::Y * 0.502_886_5);
    close(
        bytes[2],
        Vec3::new(10.0 / 255.0 / 12.92, 10.0 / 255.0 / 12.92, 1.0),
    );
    assert_eq!(
        colors("float", ["1 0.5 0", "0.25 0 0", "0 0 3"]),
        [Vec3::new(1.0, 0.5, 0.0), Vec3::X * 0.25, Vec3::Z]
    );
}
