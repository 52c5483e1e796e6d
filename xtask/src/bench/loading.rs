//! Cost of loading a large mesh: a million triangles with normals, UVs and eight textures.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use lumbre_light::math::stats::median;
use lumbre_light::scene::desc::{SceneDesc, ShapeDesc, Texels};
use lumbre_light::scene::{CompiledScene, compile};
use lumbre_night::experiment::memory;
use lumbre_render::cpu::bvh::accel::Accel;
use lumbre_scene_io::load;

/// Quads along each side of the mesh: 1,000,000 triangles.
const SIDE: usize = 708;
/// Number of bands of the mesh with a material and a texture each.
const BANDS: usize = 8;
/// Side of a texture in pixels.
const TEXTURE: u32 = 1024;

/// Durations in seconds and sizes in bytes.
pub struct Loading {
    triangles: usize,
    file_bytes: u64,
    load_s: f64,
    compile_s: f64,
    build_s: f64,
    /// Size of all arrays after loading: description, textures, scene and acceleration structure.
    arrays: usize,
    /// Peak memory while loading, compiling and building, minus the memory before; Linux only.
    peak: Option<u64>,
}

impl Loading {
    /// Writes the mesh to a temporary folder and loads it `repeats` times. Times are medians;
    /// memory is that of the first repetition.
    ///
    /// # Errors
    /// A message for the user if files cannot be written or read.
    pub fn measure(repeats: usize) -> Result<Loading, String> {
        let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
        let file_bytes = write(folder.path()).map_err(|e| e.to_string())?;
        let file = folder.path().join("mesh.obj");
        let before = memory::process_bytes("self", "VmRSS:");
        // Reset the peak of resident memory, if the system supports it.
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
                peak = memory::process_bytes("self", "VmHWM:")
                    .zip(before)
                    .filter(|_| marked)
                    .map(|(most, before)| most.saturating_sub(before));
                sizes = (
                    scene.triangles.len(),
                    described(&desc) + compiled(&scene) + accel.bytes(),
                );
            }
        }
        let [load_s, compile_s, build_s] = times.map(median);
        Ok(Loading {
            triangles: sizes.0,
            file_bytes,
            load_s,
            compile_s,
            build_s,
            arrays: sizes.1,
            peak,
        })
    }

    /// Formats the figures as text.
    pub fn table(&self) -> String {
        let mib = |bytes: f64| bytes / f64::from(1 << 20);
        let mut text = format!(
            "OBJ of {} triangles, {:.0} MiB, and {BANDS} textures of {TEXTURE} x {TEXTURE}\n",
            self.triangles,
            mib(self.file_bytes as f64)
        );
        text += &format!(
            "  load                                {:>9.2} s\n",
            self.load_s
        );
        text += &format!(
            "  compile                             {:>9.2} s\n",
            self.compile_s
        );
        text += &format!(
            "  build acceleration structure        {:>9.2} s\n",
            self.build_s
        );
        text += &format!(
            "  size of the arrays                  {:>9.0} MiB\n",
            mib(self.arrays as f64)
        );
        if let Some(peak) = self.peak {
            let ratio = peak as f64 / self.arrays.max(1) as f64;
            text += &format!(
                "  peak memory                         {:>9.0} MiB, {ratio:.2} of the arrays\n",
                mib(peak as f64)
            );
        }
        text
    }
}

/// Writes a wavy grid of triangles, its materials and textures; returns the size of the mesh file.
fn write(folder: &Path) -> std::io::Result<u64> {
    let height = |x: usize, z: usize| {
        (x as f64 * 0.05).sin() * (z as f64 * 0.07).cos() + 1e-3 * ((x * 31 + z * 17) % 13) as f64
    };
    let mut text = String::from("mtllib mesh.mtl\n");
    let mut add = |line: std::fmt::Arguments| {
        // Writing to a string cannot fail.
        let _ = text.write_fmt(line);
    };
    for z in 0..=SIDE {
        for x in 0..=SIDE {
            let slope = [
                height(x + 1, z) - height(x, z),
                height(x, z + 1) - height(x, z),
            ];
            add(format_args!(
                "v {:.6} {:.6} {:.6}\n",
                x as f64 * 0.1,
                height(x, z),
                z as f64 * 0.1
            ));
            add(format_args!(
                "vt {:.6} {:.6}\n",
                x as f64 / SIDE as f64,
                z as f64 / SIDE as f64
            ));
            add(format_args!(
                "vn {:.6} 1.000000 {:.6}\n",
                -10.0 * slope[0],
                -10.0 * slope[1]
            ));
        }
    }
    for z in 0..SIDE {
        if z % SIDE.div_ceil(BANDS) == 0 {
            add(format_args!("usemtl band{}\n", z / SIDE.div_ceil(BANDS)));
        }
        for x in 0..SIDE {
            let a = z * (SIDE + 1) + x + 1;
            let (b, c, d) = (a + 1, a + SIDE + 2, a + SIDE + 1);
            add(format_args!(
                "f {a}/{a}/{a} {d}/{d}/{d} {c}/{c}/{c}\nf {a}/{a}/{a} {c}/{c}/{c} {b}/{b}/{b}\n"
            ));
        }
    }
    fs::write(folder.join("mesh.obj"), &text)?;
    write_materials(folder)?;
    Ok(text.len() as u64)
}

/// Writes the material library of the mesh and one texture per band.
fn write_materials(folder: &Path) -> std::io::Result<()> {
    let mut materials = String::new();
    for band in 0..BANDS {
        materials += &format!("newmtl band{band}\nKd 1 1 1\nmap_Kd band{band}.png\n");
        let grain = |x: u32, y: u32| {
            (x.wrapping_mul(0x9E37_79B1) ^ y.wrapping_mul(0x85EB_CA77)).rotate_left(band as u32)
        };
        let picture = image::RgbImage::from_fn(TEXTURE, TEXTURE, |x, y| {
            let g = (grain(x, y) >> 28) as u8;
            image::Rgb([
                ((x / 4) as u8).saturating_add(g),
                ((y / 4) as u8).saturating_add(g),
                (band * 30) as u8,
            ])
        });
        picture
            .save(folder.join(format!("band{band}.png")))
            .map_err(std::io::Error::other)?;
    }
    fs::write(folder.join("mesh.mtl"), materials)
}

/// Size of the arrays of the description, in bytes.
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
    let textures = desc
        .materials
        .iter()
        .flat_map(|m| &m.textures)
        .map(|(_, t)| match &t.texels {
            Texels::Rgba8(t) => size_of_val(&t[..]),
            Texels::RgbaF32(t) => size_of_val(&t[..]),
        });
    meshes.sum::<usize>() + textures.sum::<usize>()
}

/// Size of the triangle arrays; textures are counted with the description, which shares them.
fn compiled(scene: &CompiledScene) -> usize {
    let memory = scene.memory();
    memory.geometry as usize
}
