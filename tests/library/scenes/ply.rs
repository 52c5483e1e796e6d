//! Colours of vertices, textures and ends of lines of PLY files.

use glam::Vec3;

use lumbre_light::scene::desc::TextureSlot;

use super::{Folder, lines, mesh_of};

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
        colors("float", ["1 0.5 0", "0.25 0 0", "0 0 1"]),
        [Vec3::new(1.0, 0.5, 0.0), Vec3::X * 0.25, Vec3::Z]
    );
}

#[test]
fn float_colours_as_large_as_bytes_are_like_bytes() {
    let rows = ["255 0 0", "0 188 0", "10 10 255"];
    assert_eq!(colors("float", rows), colors("uchar", rows));
    // One that is rounded up is not.
    assert_eq!(
        colors("float", ["1.000001 0 0", "0 0.5 0", "0 0 1"])[1],
        Vec3::Y * 0.5
    );
}

/// Returns a triangle with texture coordinates, and more lines in its header.
fn textured(header: &str) -> String {
    format!(
        "ply\nformat ascii 1.0\n{header}element vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
         property float texture_u\nproperty float texture_v\nelement face 1\nproperty list uchar int vertex_indices\n\
         end_header\n0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2\n"
    )
}

#[test]
fn a_comment_names_the_texture() {
    let folder = Folder::new(&[("a.ply", textured("comment TextureFile my grey.png\n"))]);
    let grey = image::GrayImage::from_pixel(2, 1, image::Luma([51]));
    grey.save(folder.path("my grey.png")).unwrap();
    let (desc, notes) = folder.load("a.ply").unwrap();
    assert!(
        desc.materials[0].texture(TextureSlot::BaseColor).is_some(),
        "{notes:?}"
    );
    let missing = Folder::new(&[("a.ply", textured("comment TextureFile b.png\n"))]);
    let error = missing.load("a.ply").unwrap_err().to_string();
    assert!(
        error.contains("b.png") && error.contains("--lenient"),
        "{error}"
    );
    let plain = textured("comment TextureFile b.png\n").replace("texture_u", "weight_u");
    let (_, notes) = Folder::new(&[("a.ply", plain)]).load("a.ply").unwrap();
    assert!(
        lines(&notes).contains("needs texture coordinates"),
        "{notes:?}"
    );
}

#[test]
fn carriage_returns_end_lines() {
    for end in ["\r", "\r\n"] {
        let text = textured("comment any\n").replace('\n', end);
        let (desc, _) = Folder::new(&[("a.ply", text)]).load("a.ply").unwrap();
        assert_eq!(mesh_of(&desc, 0).positions[1], Vec3::X);
    }
}
