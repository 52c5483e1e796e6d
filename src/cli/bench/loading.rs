//! What it takes to load a large mesh: a million triangles with normals, texture coordinates and eight textures.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use serde_json::{Value as Json, json};

use crate::experiment::memory;
use crate::math::stats::median;
use crate::render::cpu::accel::Accel;
use crate::scene::desc::{SceneDesc, ShapeDesc, Texels};
use crate::scene::{CompiledScene, compile, load};

/// Squares of the mesh along each side: 1,000,000 triangles.
const SIDE: usize = 708;
/// Bands of the mesh with a material and a texture each.
const BANDS: usize = 8;
/// Side of a texture in pixels.
const TEXTURE: u32 = 1024;

/// Seconds and bytes; bytes of memory only on systems that tell them in a file.
pub struct Loading {
    triangles: usize,
    file_bytes: u64,
    load_s: f64,
    compile_s: f64,
    build_s: f64,
    /// Bytes of all arrays that are there in the end: of description, textures, scene and hierarchy.
    arrays: usize,
    /// Most bytes in memory while loading, compiling and building, over those before.
    peak: Option<u64>,
}

impl Loading {
    /// Writes the mesh into a temporary folder and loads it `repeats` times; medians. Memory is that of the first time.
    ///
    /// # Errors
    /// When files cannot be written or read, with a message for people.
    pub fn measure(repeats: usize) -> Result<Loading, String> {
        let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
        let file_bytes = write(folder.path()).map_err(|e| e.to_string())?;
        let file = folder.path().join("mesh.obj");
        let before = memory::of_process("self", "VmRSS:");
        // The highest mark begins anew where the system has such a switch.
        let marked = fs::write("/proc/self/clear_refs", "5").is_ok();
        let (mut times, mut sizes, mut peak) = ([vec![], vec![], vec![]], (0, 0), None);
        for i in 0..repeats.max(1) {
            let start = Instant::now();
            let (desc, _) = load::load(&file).map_err(|e| e.to_string())?;
            times[0].push(start.elapsed().as_secs_f64());
            let start = Instant::now();
            let scene = Arc::new(compile(&desc).map_err(|e| e.to_string())?.0);
            times[1].push(start.elapsed().as_secs_f64());
            let start = Instant::now();
            let accel = Accel::build(Arc::clone(&scene)).map_err(|e| e.to_string())?;
            times[2].push(start.elapsed().as_secs_f64());
            if i == 0 {
                peak = memory::of_process("self", "VmHWM:")
                    .zip(before)
                    .filter(|_| marked)
                    .map(|(most, before)| most.saturating_sub(before));
                sizes = (scene.triangles.len(), described(&desc) + compiled(&scene) + accel.bytes());
            }
        }
        let [load_s, compile_s, build_s] = times.map(median);
        Ok(Loading { triangles: sizes.0, file_bytes, load_s, compile_s, build_s, arrays: sizes.1, peak })
    }

    /// The figures for people.
    pub fn table(&self) -> String {
        let mib = |bytes: f64| bytes / f64::from(1 << 20);
        let mut text = format!(
            "OBJ of {} triangles, {:.0} MiB, and {BANDS} textures of {TEXTURE} x {TEXTURE}\n",
            self.triangles,
            mib(self.file_bytes as f64)
        );
        text += &format!("  loaded in                           {:>9.2} s\n", self.load_s);
        text += &format!("  compiled in                         {:>9.2} s\n", self.compile_s);
        text += &format!("  hierarchy built in                  {:>9.2} s\n", self.build_s);
        text += &format!("  arrays in the end                   {:>9.0} MiB\n", mib(self.arrays as f64));
        if let Some(peak) = self.peak {
            let ratio = peak as f64 / self.arrays.max(1) as f64;
            text += &format!(
                "  most memory                         {:>9.0} MiB, {ratio:.2} of the arrays\n",
                mib(peak as f64)
            );
        }
        text
    }

    /// The figures by name.
    pub fn to_json(&self) -> Json {
        json!({
            "triangles": self.triangles,
            "file_bytes": self.file_bytes,
            "load_s": self.load_s,
            "compile_s": self.compile_s,
            "bvh_build_s": self.build_s,
            "array_bytes": self.arrays,
            "peak_bytes": self.peak,
        })
    }
}

/// A hilly square of triangles, its materials and their textures; returns the size of the mesh's file.
fn write(folder: &Path) -> std::io::Result<u64> {
    let height =
        |x: usize, z: usize| (x as f64 * 0.05).sin() * (z as f64 * 0.07).cos() + 1e-3 * ((x * 31 + z * 17) % 13) as f64;
    let mut text = String::from("mtllib mesh.mtl\n");
    let mut add = |line: std::fmt::Arguments| {
        // Writing to a string cannot fail.
        let _ = text.write_fmt(line);
    };
    for z in 0..=SIDE {
        for x in 0..=SIDE {
            let slope = [height(x + 1, z) - height(x, z), height(x, z + 1) - height(x, z)];
            add(format_args!("v {:.6} {:.6} {:.6}\n", x as f64 * 0.1, height(x, z), z as f64 * 0.1));
            add(format_args!("vt {:.6} {:.6}\n", x as f64 / SIDE as f64, z as f64 / SIDE as f64));
            add(format_args!("vn {:.6} 1.000000 {:.6}\n", -10.0 * slope[0], -10.0 * slope[1]));
        }
    }
    for z in 0..SIDE {
        if z % SIDE.div_ceil(BANDS) == 0 {
            add(format_args!("usemtl band{}\n", z / SIDE.div_ceil(BANDS)));
        }
        for x in 0..SIDE {
            let a = z * (SIDE + 1) + x + 1;
            let (b, c, d) = (a + 1, a + SIDE + 2, a + SIDE + 1);
            add(format_args!("f {a}/{a}/{a} {d}/{d}/{d} {c}/{c}/{c}\nf {a}/{a}/{a} {c}/{c}/{c} {b}/{b}/{b}\n"));
        }
    }
    fs::write(folder.join("mesh.obj"), &text)?;
    let mut materials = String::new();
    for band in 0..BANDS {
        materials += &format!("newmtl band{band}\nKd 1 1 1\nmap_Kd band{band}.png\n");
        let grain =
            |x: u32, y: u32| (x.wrapping_mul(0x9E37_79B1) ^ y.wrapping_mul(0x85EB_CA77)).rotate_left(band as u32);
        let picture = image::RgbImage::from_fn(TEXTURE, TEXTURE, |x, y| {
            let g = (grain(x, y) >> 28) as u8;
            image::Rgb([((x / 4) as u8).saturating_add(g), ((y / 4) as u8).saturating_add(g), (band * 30) as u8])
        });
        picture.save(folder.join(format!("band{band}.png"))).map_err(std::io::Error::other)?;
    }
    fs::write(folder.join("mesh.mtl"), materials)?;
    Ok(text.len() as u64)
}

fn described(desc: &SceneDesc) -> usize {
    let meshes = desc.entities.iter().map(|e| match &e.shape {
        ShapeDesc::Mesh(m) => {
            size_of_val(&m.positions[..])
                + size_of_val(&m.normals[..])
                + size_of_val(&m.uvs[..])
                + size_of_val(&m.triangles[..])
                + size_of_val(&m.triangle_slot[..])
        }
        ShapeDesc::Sphere { .. } => 0,
    });
    let textures = desc.materials.iter().flat_map(|m| &m.textures).map(|(_, t)| match &t.texels {
        Texels::Rgba8(t) => size_of_val(&t[..]),
        Texels::RgbaF32(t) => size_of_val(&t[..]),
    });
    meshes.sum::<usize>() + textures.sum::<usize>()
}

/// Arrays of triangles; textures are shared with the description or as large again, and counted there.
fn compiled(scene: &CompiledScene) -> usize {
    size_of_val(&scene.triangles[..]) + size_of_val(&scene.attributes[..])
}
