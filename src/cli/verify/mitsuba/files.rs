//! Files to which the cases refer: images, a map of the sky, and a mesh.

use std::path::Path;

use lumbre_light::film::Image;
use lumbre_light::math::rng::{pcg4d, unit};

use crate::output::exr;

/// Side of the images in texels.
const SIDE: u32 = 8;

/// Two squares that meet in a ridge, with texture coordinates and without normals.
const TENT: [([f32; 3], [f32; 2]); 6] = [
    ([-1.2, -0.5, -1.0], [0.0, 0.0]),
    ([0.0, 0.8, -1.0], [0.5, 0.0]),
    ([1.2, -0.5, -1.0], [1.0, 0.0]),
    ([-1.2, -0.5, 1.0], [0.0, 1.0]),
    ([0.0, 0.8, 1.0], [0.5, 1.0]),
    ([1.2, -0.5, 1.0], [1.0, 1.0]),
];
const FACES: [[usize; 3]; 4] = [[0, 3, 4], [0, 4, 1], [1, 4, 5], [1, 5, 2]];

/// Returns three numbers from 0 to 1 for a texel.
fn texel(x: u32, y: u32, image: u32) -> [f32; 3] {
    let [r, g, b, _] = pcg4d([x, y, image, 17]).map(unit);
    [r, g, b]
}

/// Writes all files into a folder.
///
/// # Errors
/// Returns a message if a file cannot be written.
pub fn write(folder: &Path) -> Result<(), String> {
    let byte = |x: f32| (255.0 * x).round() as u8;
    let png = |name: &str, color: &dyn Fn(u32, u32) -> [f32; 3]| {
        image::RgbImage::from_fn(SIDE, SIDE, |x, y| image::Rgb(color(x, y).map(byte)))
            .save(folder.join(name))
            .map_err(|e| e.to_string())
    };
    png("color.png", &|x, y| texel(x, y, 0).map(|c| 0.1 + 0.8 * c))?;
    png("gray.png", &|x, y| [0.15 + 0.8 * texel(x, y, 1)[0]; 3])?;
    png("normal.png", &|x, y| {
        let [u, v, _] = texel(x, y, 2).map(|c| 0.6 * (c - 0.5));
        let w = (1.0 - u * u - v * v).sqrt();
        [u, v, w].map(|c| 0.5 + 0.5 * c)
    })?;
    let sky = Image::from_fn(2 * SIDE, SIDE, |x, y| {
        let bright = if [x, y] == [11, 2] { 20.0 } else { 1.0 };
        texel(x, y, 3).map(|c| bright * (0.1 + c))
    });
    let text = |e: std::io::Error| e.to_string();
    let bytes = exr::encode(&sky, &[]).map_err(|e| e.to_string())?;
    std::fs::write(folder.join("sky.exr"), bytes).map_err(text)?;
    std::fs::write(folder.join("tent.obj"), obj()).map_err(text)?;
    std::fs::write(folder.join("tent.ply"), ply()).map_err(text)
}

/// Returns the mesh as OBJ.
fn obj() -> String {
    let positions = TENT.iter().map(|([x, y, z], _)| format!("v {x} {y} {z}\n"));
    let coordinates = TENT.iter().map(|(_, [u, v])| format!("vt {u} {v}\n"));
    let faces = FACES.iter().map(|face| {
        let [a, b, c] = face.map(|i| i + 1);
        format!("f {a}/{a} {b}/{b} {c}/{c}\n")
    });
    positions.chain(coordinates).chain(faces).collect()
}

/// Returns the mesh as PLY.
fn ply() -> String {
    let head = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\n\
         property float z\nproperty float u\nproperty float v\nelement face {}\n\
         property list uchar int vertex_indices\nend_header\n",
        TENT.len(),
        FACES.len()
    );
    let vertices = TENT
        .iter()
        .map(|([x, y, z], [u, v])| format!("{x} {y} {z} {u} {v}\n"));
    let faces = FACES.iter().map(|[a, b, c]| format!("3 {a} {b} {c}\n"));
    head + &vertices.chain(faces).collect::<String>()
}
