//! Scenes made in code, and the renders and statistics that several test binaries need.
#![allow(dead_code, reason = "every test binary uses its own part of this")]

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{Vec2, Vec3};
use lumbre_light::film::Film;
use lumbre_light::film::time::TimeAxis;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{
    Cone, DirectionalLight, Emitter, Environment, Formulas, IntensityMap, Interface, MapSpace,
    MaskMode, Material, Model, NONE, PointLight, RoughnessTexels, Sphere, Texture,
    TriangleAttributes, UvMap,
};
use lumbre_light::scene::desc::{CameraDesc, ConeDesc};
use lumbre_light::transport::integrator::{IntegratorRow, integrator};
use lumbre_light::transport::time_settings::Timing;
use lumbre_light::value::Value;
use lumbre_render::{Job, Renderer, cpu::renderer::CpuRenderer};

/// A white, opaque, ideal material that emits nothing.
pub const WHITE: Material = Material {
    model: Model::Lambert,
    formulas: Formulas::Lumbre,
    roughness_texels: RoughnessTexels::Roughness,
    subsurface: 0.0,
    specular_tint: 0.0,
    anisotropic: 0.0,
    anisotropic_direction: Vec3::ZERO,
    sheen: 0.0,
    sheen_tint: 0.0,
    clearcoat: 0.0,
    clearcoat_gloss: 1.0,
    smooth_below: 0.01,
    normal_strength: 1.0,
    bump_height: 1.0,
    mask_threshold: 0.5,
    mask_mode: MaskMode::Threshold,
    one_sided: false,
    shadow_terminator: false,
    flat_normals: false,
    roughness_texture: NONE,
    metallic_texture: NONE,
    opacity_texture: NONE,
    transmittance_texture: NONE,
    anisotropic_texture: NONE,
    normal_texture: NONE,
    bump_texture: NONE,
    base_color: Vec3::ONE,
    emission: Vec3::ZERO,
    roughness: 1.0,
    metallic: 0.0,
    opacity: 1.0,
    transmittance: Vec3::ZERO,
    ior: 1.5,
    base_color_texture: NONE,
    emission_texture: NONE,
    mask_texture: NONE,
    tiling: UvMap::IDENTITY,
    emitter_reflects: true,
    interface: Interface::PLAIN,
};

/// Returns a grey material.
pub fn grey(albedo: f32) -> Material {
    Material {
        base_color: Vec3::splat(albedo),
        ..WHITE
    }
}

/// Returns a black material that emits.
pub fn light(radiance: f32) -> Material {
    Material {
        base_color: Vec3::ZERO,
        emission: Vec3::splat(radiance),
        emitter_reflects: false,
        ..WHITE
    }
}

/// A scene made of quads, triangles and spheres.
pub struct SceneBuilder {
    scene: CompiledScene,
}

/// Returns the map of an image as wide and high as a cone.
pub fn image_map(texture: u32, cone: &Cone, even: bool) -> IntensityMap {
    let right = cone.axis.any_orthonormal_vector() / cone.cutoff.tan();
    let mapping = MapSpace::Plane {
        right,
        up: right.cross(cone.axis),
        even,
    };
    IntensityMap { texture, mapping }
}

impl SceneBuilder {
    /// Returns an empty scene seen from `position` towards `target`.
    pub fn new(position: Vec3, target: Vec3, fov_deg: f32) -> SceneBuilder {
        let camera = CameraDesc::pinhole(position, target, fov_deg);
        SceneBuilder {
            scene: CompiledScene {
                camera,
                resolution: [16, 16],
                max_depth: 5,
                ..CompiledScene::default()
            },
        }
    }

    /// Returns the number of triangles so far.
    pub fn triangle_count(&self) -> usize {
        self.scene.triangles.len()
    }

    /// Adds a texture and returns its index.
    pub fn texture(&mut self, texture: Texture) -> u32 {
        self.scene.textures.push(texture);
        self.scene.textures.len() as u32 - 1
    }

    fn material(&mut self, material: Material) -> u32 {
        self.scene.materials.push(material);
        self.scene.materials.len() as u32 - 1
    }

    /// Adds a triangle. Its corners run counter-clockwise seen from the front. Spheres that emit follow
    /// all triangles.
    pub fn triangle(
        mut self,
        corners: [Vec3; 3],
        uvs: [Vec2; 3],
        material: Material,
    ) -> SceneBuilder {
        let is_dark = |s: &Sphere| s.emitter == NONE;
        assert!(
            self.scene.spheres.iter().all(is_dark),
            "spheres that emit follow all triangles, since the ids of primitives do"
        );
        let row = self.material(material);
        let cross = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let primitive = self.scene.triangles.len() as u32;
        let mut emitter = NONE;
        if material.emission != Vec3::ZERO {
            emitter = self.scene.emitters.len() as u32;
            self.scene.emitters.push(Emitter {
                primitive,
                instance: NONE,
                area: 0.5 * cross.length(),
            });
        }
        self.scene.triangles.push(corners);
        self.scene.normals.push([cross.normalize_or_zero(); 3]);
        self.scene.uvs.push(uvs);
        self.scene.attributes.push(TriangleAttributes {
            material: row,
            emitter,
        });
        self
    }

    /// Adds a parallelogram from `corner` along `a` and `b`; its front is `a x b`.
    pub fn quad(self, corner: Vec3, a: Vec3, b: Vec3, material: Material) -> SceneBuilder {
        let uv = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
        self.triangle(
            [corner, corner + a, corner + a + b],
            [uv[0], uv[1], uv[2]],
            material,
        )
        .triangle(
            [corner, corner + a + b, corner + b],
            [uv[0], uv[2], uv[3]],
            material,
        )
    }

    /// Adds a horizontal square about the y axis, `2 * half` wide, whose front faces upwards.
    pub fn floor(self, half: f32, y: f32, material: Material) -> SceneBuilder {
        let (a, b) = (Vec3::X * (2.0 * half), Vec3::Z * (-2.0 * half));
        self.quad(Vec3::new(-half, y, half), a, b, material)
    }

    /// Adds a horizontal square as [`SceneBuilder::floor`] does, whose front faces downwards.
    pub fn ceiling(self, half: f32, y: f32, material: Material) -> SceneBuilder {
        let (a, b) = (Vec3::X * (2.0 * half), Vec3::Z * (2.0 * half));
        self.quad(Vec3::new(-half, y, -half), a, b, material)
    }

    /// Adds an axis-aligned cube about the origin whose fronts face inwards.
    pub fn room(mut self, half: f32, material: Material) -> SceneBuilder {
        for (n, a) in [(Vec3::X, Vec3::Y), (Vec3::Y, Vec3::Z), (Vec3::Z, Vec3::X)] {
            for side in [-1.0, 1.0] {
                let inward = -n * side;
                let b = inward.cross(a);
                self = self.quad(
                    n * side * half - (a + b) * half,
                    a * 2.0 * half,
                    b * 2.0 * half,
                    material,
                );
            }
        }
        self
    }

    /// Adds a sphere; spheres must be added after all triangles.
    pub fn sphere(mut self, center: Vec3, radius: f32, material: Material) -> SceneBuilder {
        let row = self.material(material);
        let mut emitter = NONE;
        if material.emission != Vec3::ZERO {
            emitter = self.scene.emitters.len() as u32;
            let primitive = self.scene.primitive_count() as u32;
            self.scene.emitters.push(Emitter {
                primitive,
                instance: NONE,
                area: 4.0 * std::f32::consts::PI * radius * radius,
            });
        }
        self.scene.spheres.push(Sphere {
            center,
            radius,
            material: row,
            emitter,
        });
        self
    }

    /// Changes the scene built so far.
    pub fn with(mut self, change: impl FnOnce(&mut CompiledScene)) -> SceneBuilder {
        change(&mut self.scene);
        self
    }

    /// Adds a point light.
    pub fn point(self, position: Vec3, intensity: Vec3) -> SceneBuilder {
        self.with(|s| {
            s.points.push(PointLight {
                position,
                intensity,
                cone: Cone::WHOLE,
                map: None,
            })
        })
    }

    /// Adds a spot light that falls off between two angles in degrees.
    pub fn spot(self, position: Vec3, axis: Vec3, intensity: Vec3, cone: ConeDesc) -> SceneBuilder {
        self.with(|s| {
            s.points.push(PointLight {
                position,
                intensity,
                cone: Cone::new(axis, &cone),
                map: None,
            })
        })
    }

    /// Adds a goniometric light, whose map is turned by an angle.
    pub fn goniometric(
        mut self,
        position: Vec3,
        intensity: Vec3,
        map: Texture,
        rotation_deg: f32,
    ) -> SceneBuilder {
        let map = IntensityMap {
            texture: self.texture(map),
            mapping: MapSpace::Sphere {
                rotation_rad: rotation_deg.to_radians(),
            },
        };
        self.with(|s| {
            s.points.push(PointLight {
                position,
                intensity,
                cone: Cone::WHOLE,
                map: Some(map),
            })
        })
    }

    /// Adds a spot light that projects an image as wide and high as its cone.
    pub fn projector(
        mut self,
        [position, axis, intensity]: [Vec3; 3],
        cone: ConeDesc,
        image: Texture,
        even: bool,
    ) -> SceneBuilder {
        let cone = Cone::new(axis, &cone);
        let map = image_map(self.texture(image), &cone, even);
        self.with(|s| {
            s.points.push(PointLight {
                position,
                intensity,
                cone,
                map: Some(map),
            })
        })
    }

    /// Adds parallel light that travels in `direction`.
    pub fn directional(self, direction: Vec3, irradiance: Vec3) -> SceneBuilder {
        let direction = direction.try_normalize().expect("the direction is zero");
        self.with(|s| {
            s.directionals.push(DirectionalLight {
                direction,
                irradiance,
            })
        })
    }

    /// Adds an environment: a map turned by an angle, or a constant colour.
    pub fn environment(
        self,
        map: Option<Texture>,
        radiance: Vec3,
        rotation_deg: f32,
    ) -> SceneBuilder {
        let rotation_rad = rotation_deg.to_radians();
        self.with(|s| {
            s.environment = Some(Environment {
                map: map.map(Arc::new),
                radiance,
                rotation_rad,
                sampling: Default::default(),
            })
        })
    }

    /// Returns the finished scene.
    pub fn build(self) -> Arc<CompiledScene> {
        Arc::new(self.scene)
    }
}

/// Returns a job for `bpt` without Russian roulette, with a box filter of one pixel.
pub fn job(resolution: [u32; 2], max_depth: u32, seed: u64) -> Job {
    named_job("bpt", resolution, max_depth, seed)
}

/// Returns a job as [`job`] does, for the technique of this name.
pub fn named_job(name: &str, resolution: [u32; 2], max_depth: u32, seed: u64) -> Job {
    Job::plain(integrator(name).unwrap(), resolution, max_depth, seed)
}

/// Returns the job with another technique and its parameters.
pub fn job_with(row: &'static IntegratorRow, params: BTreeMap<String, Value>, job: Job) -> Job {
    Job {
        integrator: row,
        ..job
    }
    .with(|settings| settings.params = params)
}

/// Renders `samples` samples on the CPU.
pub fn render(scene: &Arc<CompiledScene>, job: Job, samples: u64) -> Film {
    let mut renderer = CpuRenderer::new(Arc::clone(scene), job).unwrap();
    let stats = renderer.advance(samples).unwrap();
    assert_eq!(
        stats.invalid, 0,
        "invalid samples, first at {:?}",
        stats.first_invalid
    );
    renderer.film().clone()
}

/// Returns the mean of one channel over the whole film, and its standard error from the spread of
/// all samples within pixels.
pub fn mean_and_error(film: &Film, channel: usize) -> (f64, f64) {
    let n = film.samples as f64;
    let pixels = film.sum.len() as f64;
    let mean = film.sum.iter().map(|s| s[channel]).sum::<f64>() / (n * pixels);
    let variance_of_sum: f64 = film
        .sum
        .iter()
        .zip(&film.sum2)
        .map(|(s, q)| n / (n - 1.0) * (q[channel] - s[channel] * s[channel] / n).max(0.0))
        .sum();
    (mean, variance_of_sum.sqrt() / (n * pixels))
}

/// Returns the root of the repository: the nearest folder above the package that has a lock file.
pub fn repository() -> PathBuf {
    let mut folders = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors();
    let root = folders.find(|folder| folder.join("Cargo.lock").is_file());
    root.unwrap().to_owned()
}

/// Returns the files below a folder, sorted. The folder may be a link; links below are not followed.
pub fn files_below(folder: &Path) -> Vec<PathBuf> {
    let (mut open, mut found) = (vec![folder.to_owned()], Vec::new());
    while let Some(next) = open.pop() {
        for entry in std::fs::read_dir(next).into_iter().flatten().flatten() {
            if entry.file_type().unwrap().is_dir() {
                open.push(entry.path());
            } else {
                found.push(entry.path());
            }
        }
    }
    found.sort();
    found
}

/// Returns the folder of shared third-party scenes and references, if there is one:
/// `LUMBRE_SHARED`, or `shared` beside this checkout.
pub fn shared() -> Option<PathBuf> {
    let root = std::env::var_os("LUMBRE_SHARED")
        .map_or_else(|| repository().join("../shared"), PathBuf::from);
    root.join("scenes").is_dir().then_some(root)
}

/// Prints that a test or a part of it is skipped, and the reason. Written past the test harness, which
/// keeps what tests that pass print with `println!`.
pub fn skipped(reason: impl std::fmt::Display) {
    let line = format!("SKIPPED: {reason}\n");
    std::io::stderr().write_all(line.as_bytes()).unwrap();
}

/// Returns the command `kill` of the shell, since systems may lack a program of that name. Arguments are a
/// signal and a process.
pub fn kill() -> std::process::Command {
    let mut shell = std::process::Command::new("sh");
    shell.args(["-c", "kill \"$@\"", "sh"]);
    shell
}

/// Returns whether there is no `python3`, in which other renderers of tests are written, after printing
/// a line `SKIPPED`.
pub fn lacks_python() -> bool {
    let found = std::process::Command::new("python3")
        .arg("--version")
        .output();
    let lacks = !found.is_ok_and(|output| output.status.success());
    if lacks {
        skipped("python3 is not installed");
    }
    lacks
}

/// Returns a time axis with default settings.
pub fn timing(start: f64, bin: f64, bins: u32) -> Timing {
    Timing::plain(TimeAxis { start, bin, bins })
}

/// Returns a job with a time axis.
pub fn timed_job(name: &str, timing: Timing, size: [u32; 2], depth: u32, seed: u64) -> Job {
    named_job(name, size, depth, seed).with(|settings| settings.timing = Some(timing))
}

/// Renders waves of these numbers of samples. Panics if a sample is invalid.
pub fn render_waves(scene: &Arc<CompiledScene>, job: Job, waves: &[u64]) -> CpuRenderer {
    let mut renderer = CpuRenderer::new(Arc::clone(scene), job).unwrap();
    for n in waves {
        assert_eq!(renderer.advance(*n).unwrap().invalid, 0);
    }
    renderer
}
