//! Files to which the cases refer: images, a map of the sky, and meshes.

use std::io::Write;
use std::path::Path;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use lumbre_light::film::Image;
use lumbre_light::math::rng::{pcg4d, unit};

use lumbre_report::exr;

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
    std::fs::write(folder.join("tent.ply"), ply()).map_err(text)?;
    let meshes = serialized().map_err(text)?;
    std::fs::write(folder.join("tents.serialized"), meshes).map_err(text)
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

/// Returns a file of two serialized meshes: the tent upside down with normals, and the tent.
fn serialized() -> std::io::Result<Vec<u8>> {
    let mut file = Vec::new();
    let mut offsets = Vec::new();
    for [flags, up] in [[0x1001, -1], [0x1002, 1]] {
        offsets.push(file.len() as u64);
        file.extend([0x1c, 0x04, 4, 0]);
        let mut mesh = (flags as u32).to_le_bytes().to_vec();
        mesh.extend(b"tent\0");
        mesh.extend((TENT.len() as u64).to_le_bytes());
        mesh.extend((FACES.len() as u64).to_le_bytes());
        let positions = TENT.iter().map(|([x, y, z], _)| [*x, up as f32 * y, *z]);
        mesh.extend(positions.flatten().flat_map(f32::to_le_bytes));
        if up < 0 {
            let normals = TENT.iter().map(|([x, ..], _)| [-0.4 * x, -0.8, 0.0]);
            mesh.extend(normals.flatten().flat_map(f32::to_le_bytes));
        } else {
            let coordinates = TENT.iter().flat_map(|(_, uv)| uv);
            mesh.extend(coordinates.flat_map(|x| x.to_le_bytes()));
        }
        let corners = FACES.iter().flatten().map(|i| *i as u32);
        mesh.extend(corners.flat_map(u32::to_le_bytes));
        let mut packer = ZlibEncoder::new(&mut file, Compression::default());
        packer.write_all(&mesh)?;
        packer.finish()?;
    }
    file.extend(offsets.iter().flat_map(|offset| offset.to_le_bytes()));
    file.extend((offsets.len() as u32).to_le_bytes());
    Ok(file)
}

/// Returns the mesh as PLY, with colours of its vertices.
fn ply() -> String {
    let head = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\n\
         property float z\nproperty float u\nproperty float v\nproperty float r\n\
         property float g\nproperty float b\nelement face {}\n\
         property list uchar int vertex_indices\nend_header\n",
        TENT.len(),
        FACES.len()
    );
    let vertices = TENT.iter().map(|([x, y, z], [u, v])| {
        let color = format!("{} {} 0.3", 0.2 + 0.6 * u, 0.9 - 0.5 * v);
        format!("{x} {y} {z} {u} {v} {color}\n")
    });
    let faces = FACES.iter().map(|[a, b, c]| format!("3 {a} {b} {c}\n"));
    head + &vertices.chain(faces).collect::<String>()
}
