//! Shapes: meshes from the text or from files, and generated ones.
//!
//! The front of a triangle is the side of its normals or, without normals, the side from which its
//! corners run counter-clockwise in right-handed coordinates: the direction of the cross product of
//! its edges, in the coordinates of the file, whatever their handedness.

mod curve;
mod quadric;
mod subdivision;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use flate2::read::GzDecoder;
use glam::{DAffine3, DVec3, Vec2, Vec3};

use super::params::Params;
use super::token::truncated;
use super::version::Version;
use crate::load::beside;
use crate::load::packed::{budget, expand};
use crate::load::{canonical, ply, read_file};
use lumbre_light::scene::desc::{MeshDesc, ShapeDesc, Transform, mesh_hash};
use lumbre_light::scene::shape::Shape;
use lumbre_light::scene::{Note, SceneError};

/// Greatest number of triangles of all different generated shapes.
const MAX_GENERATED_TRIANGLES: usize = 1 << 20;
/// Greatest number of triangles of all curves.
const MAX_CURVE_TRIANGLES: usize = 1 << 25;
/// Greatest size of a compressed mesh in bytes.
const MAX_GZIP_BYTES: u64 = 1 << 28;

/// A shape in object space, before the transform of the file.
pub(super) struct LoadedShape {
    /// Geometry in object space.
    pub shape: ShapeDesc,
    /// Transform of the shape itself.
    pub own: DAffine3,
    /// Default name of the shape.
    pub stem: String,
}

/// State of the file that changes a shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct ShapeOptions {
    /// Whether `ReverseOrientation` is set.
    pub reversed: bool,
    /// Whether the surface needs texture coordinates, or a direction of anisotropy.
    pub oriented: bool,
    /// Version of the file.
    pub version: Version,
}

/// Identifies a generated shape by its name, the bits of its parameters, and its options.
type GeneratedKey = (&'static str, [u32; 4], ShapeOptions);

/// Loader of shapes: the meshes read or generated so far, which shapes with equal keys share.
#[derive(Default)]
pub(super) struct ShapeLoader {
    files: BTreeMap<(PathBuf, ShapeOptions), Arc<MeshDesc>>,
    generated: BTreeMap<GeneratedKey, Arc<MeshDesc>>,
    /// Number of triangles of all generated meshes.
    triangles: usize,
    /// Number of triangles of all curves.
    curve_triangles: usize,
}

impl ShapeLoader {
    /// Returns the geometry of a shape; `None`, with a note, if it is not supported. `to_world` is
    /// the transform of the file, and `folder` that of the names of files.
    pub fn read(
        &mut self,
        class: &str,
        params: &Params,
        options: ShapeOptions,
        (folder, to_world): (&Path, &DAffine3),
        notes: &mut Vec<Note>,
    ) -> Result<Option<LoadedShape>, SceneError> {
        let mesh = match class {
            "trianglemesh" => finished(triangle_mesh(params)?, options),
            "loopsubdiv" => self.subdivided(params, options, notes)?,
            "bilinearmesh" => self.bilinear(params, options)?,
            "curve" => {
                let shape = curve::read(params, notes)?;
                self.curve_triangles = self.curve_triangles.saturating_add(shape.triangles.len());
                if self.curve_triangles > MAX_CURVE_TRIANGLES {
                    return Err(params.error(format!(
                        "all curves together have more than {MAX_CURVE_TRIANGLES} triangles"
                    )));
                }
                finished(shape.into_mesh(PathBuf::new(), ""), options)
            }
            "plymesh" => {
                let (mesh, stem) = self.file(params, options, folder, notes)?;
                return Ok(Some(LoadedShape {
                    shape: ShapeDesc::Mesh(mesh),
                    own: DAffine3::IDENTITY,
                    stem,
                }));
            }
            "sphere" => return self.sphere(params, options, to_world, notes).map(Some),
            "disk" => return self.disk(params, options).map(Some),
            "cylinder" => return self.cylinder(params, options).map(Some),
            other => {
                notes.push(params.note(format!(
                    "the shape `{}` is not supported; ignored",
                    truncated(other)
                )));
                return Ok(None);
            }
        };
        Ok(Some(LoadedShape {
            shape: ShapeDesc::Mesh(Arc::new(mesh)),
            own: DAffine3::IDENTITY,
            stem: "mesh".to_owned(),
        }))
    }

    /// Adds to the number of generated triangles, which is limited.
    fn charge(&mut self, params: &Params, triangles: usize) -> Result<(), SceneError> {
        self.triangles = self.triangles.saturating_add(triangles);
        if self.triangles > MAX_GENERATED_TRIANGLES {
            return Err(params.error(format!(
                "the different generated shapes have more than {MAX_GENERATED_TRIANGLES} triangles \
                 in total"
            )));
        }
        Ok(())
    }

    /// Returns a generated mesh, computed unless an equal one exists.
    fn generate(
        &mut self,
        params: &Params,
        (name, numbers): (&'static str, [f32; 4]),
        options: ShapeOptions,
        shape: impl Fn() -> Shape,
    ) -> Result<ShapeDesc, SceneError> {
        let key = (name, numbers.map(f32::to_bits), options);
        if let Some(known) = self.generated.get(&key) {
            return Ok(ShapeDesc::Mesh(known.clone()));
        }
        let shape = shape();
        self.charge(params, shape.triangles.len())?;
        let reversed = ShapeOptions {
            version: Version::V4,
            ..options
        };
        let mesh = Arc::new(finished(shape.into_mesh(PathBuf::new(), ""), reversed));
        self.generated.insert(key, mesh.clone());
        Ok(ShapeDesc::Mesh(mesh))
    }

    /// Returns an analytic sphere, or a mesh, with a note, if it is partial, stretched or inside
    /// out, or needs the coordinates of pbrt, which run about its z axis.
    fn sphere(
        &mut self,
        params: &Params,
        options: ShapeOptions,
        to_world: &DAffine3,
        notes: &mut Vec<Note>,
    ) -> Result<LoadedShape, SceneError> {
        let radius = positive(params, "radius", 1.0)?;
        let [low, high] = [("zmin", -radius), ("zmax", radius)]
            .map(|(name, default)| params.number(name, default));
        let (low, high) = (low?.clamp(-radius, radius), high?.clamp(-radius, radius));
        let (low, high) = (low.min(high) / radius, low.max(high) / radius);
        let turn = params.number("phimax", 360.0)?.clamp(0.0, 360.0);
        let whole = low == -1.0 && high == 1.0 && turn == 360.0;
        if low == high || turn == 0.0 {
            return Err(params.error("the sphere is cut away as a whole"));
        }
        let round = Transform::framed(*to_world).sphere_scale().is_some();
        let stem = "sphere".to_owned();
        if whole && round && !options.reversed && !options.oriented {
            let radius = radius as f32;
            return Ok(LoadedShape {
                shape: ShapeDesc::Sphere { radius },
                own: DAffine3::IDENTITY,
                stem,
            });
        }
        notes.push(params.note(
            "a sphere that is partial, textured, anisotropic, stretched or inside out, or emits on \
             both sides, becomes a mesh of triangles",
        ));
        let numbers = [low as f32, high as f32, turn as f32, 0.0];
        let shape = self.generate(params, ("sphere", numbers), options, || {
            quadric::sphere(numbers)
        })?;
        Ok(LoadedShape {
            shape,
            own: DAffine3::from_scale(DVec3::splat(radius)),
            stem,
        })
    }

    /// Returns a disk as a mesh.
    fn disk(&mut self, params: &Params, options: ShapeOptions) -> Result<LoadedShape, SceneError> {
        let radius = positive(params, "radius", 1.0)?;
        let height = params.number("height", 0.0)?;
        let inner = params.number("innerradius", 0.0)?.clamp(0.0, radius) / radius;
        let turn = params.number("phimax", 360.0)?.clamp(0.0, 360.0);
        if inner == 1.0 || turn == 0.0 {
            return Err(params.error("the disk is cut away as a whole"));
        }
        let numbers = [inner as f32, turn as f32, 0.0, 0.0];
        let shape = self.generate(params, ("disk", numbers), options, || {
            quadric::disk(numbers)
        })?;
        let scale = DVec3::new(radius, radius, 1.0);
        Ok(LoadedShape {
            shape,
            own: DAffine3::from_translation(DVec3::Z * height) * DAffine3::from_scale(scale),
            stem: "disk".to_owned(),
        })
    }

    /// Returns a cylinder as a mesh.
    fn cylinder(
        &mut self,
        params: &Params,
        options: ShapeOptions,
    ) -> Result<LoadedShape, SceneError> {
        let radius = positive(params, "radius", 1.0)?;
        let (a, b) = (params.number("zmin", -1.0)?, params.number("zmax", 1.0)?);
        let (low, high) = (a.min(b), a.max(b));
        let turn = params.number("phimax", 360.0)?.clamp(0.0, 360.0);
        if low == high || turn == 0.0 {
            return Err(params.error("the cylinder has no extent"));
        }
        let numbers = [turn as f32, 0.0, 0.0, 0.0];
        let shape = self.generate(params, ("cylinder", numbers), options, || {
            quadric::cylinder(numbers)
        })?;
        let scale = DVec3::new(radius, radius, high - low);
        Ok(LoadedShape {
            shape,
            own: DAffine3::from_translation(DVec3::Z * low) * DAffine3::from_scale(scale),
            stem: "cylinder".to_owned(),
        })
    }

    /// Reads a `loopsubdiv`: fewer levels, with a note, where the mesh would have too many
    /// triangles.
    fn subdivided(
        &mut self,
        params: &Params,
        options: ShapeOptions,
        notes: &mut Vec<Note>,
    ) -> Result<MeshDesc, SceneError> {
        let name = if params.get("levels").is_some() {
            "levels"
        } else {
            "nlevels"
        };
        let wanted = params.integer(name, 3, 32)?;
        params.mark_read(&["scheme"]);
        let control = triangle_mesh(params)?;
        let mut levels = 0;
        let room = MAX_GENERATED_TRIANGLES.saturating_sub(self.triangles);
        let split = |levels: u32| {
            let factor = 4usize.saturating_pow(levels);
            control.triangles.len().saturating_mul(factor)
        };
        while levels < wanted && split(levels + 1) <= room {
            levels += 1;
        }
        if levels < wanted {
            notes.push(params.note(format!(
                "{levels} levels of subdivision are used instead of {wanted}, which would create \
                 too many triangles"
            )));
        }
        if levels > 0 {
            self.charge(params, split(levels))?;
        }
        let shape = subdivision::subdivide(control.positions, control.triangles, levels);
        Ok(finished(shape.into_mesh(PathBuf::new(), ""), options))
    }

    /// Reads a `bilinearmesh`: two triangles for a parallelogram, and a grid for other patches.
    fn bilinear(&mut self, params: &Params, options: ShapeOptions) -> Result<MeshDesc, SceneError> {
        let patches = quadric::Patches::read(params)?;
        self.charge(params, patches.extra_triangles())?;
        Ok(finished(
            patches.into_shape().into_mesh(PathBuf::new(), ""),
            options,
        ))
    }

    /// Loads a mesh from a file, once for each set of options.
    fn file(
        &mut self,
        params: &Params,
        options: ShapeOptions,
        folder: &Path,
        notes: &mut Vec<Note>,
    ) -> Result<(Arc<MeshDesc>, String), SceneError> {
        let Some(name) = params.text("filename")? else {
            return Err(params.error("a mesh needs a `filename`"));
        };
        let path = beside(folder, name);
        let stem = Path::new(name).file_name().map(|s| s.to_string_lossy());
        let stem = stem.as_deref().and_then(|s| s.split('.').next());
        let stem = stem.unwrap_or("mesh").to_owned();
        let key = (canonical(&path), options);
        if let Some(mesh) = self.files.get(&key) {
            return Ok((mesh.clone(), stem));
        }
        let is_gzip = path
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("gz"));
        let read = if is_gzip {
            decompressed(&path).and_then(|bytes| ply::decode_mesh(&path, &bytes, "", notes))
        } else {
            ply::load_mesh(&path, "", notes)
        };
        let mut mesh = read.map_err(|e| params.error(e))?;
        mesh.colors = Vec::new();
        let mesh = Arc::new(finished(mesh, options));
        self.files.insert(key, mesh.clone());
        Ok((mesh, stem))
    }
}

/// Reads and decompresses a file.
fn decompressed(path: &Path) -> Result<Vec<u8>, SceneError> {
    let packed = read_file(path, MAX_GZIP_BYTES)?;
    let most = budget(packed.len());
    let malformed = |problem: String| SceneError::malformed(path, "gzip", problem);
    let expanded = expand(GzDecoder::new(packed.as_slice()), most);
    expanded
        .map_err(|e| malformed(e.to_string()))?
        .ok_or_else(|| {
            malformed(format!(
                "the file expands to more than {} MiB, too much for its size",
                most >> 20
            ))
        })
}

/// Returns a length above 0.
fn positive(params: &Params, name: &str, default: f64) -> Result<f64, SceneError> {
    let x = params.number(name, default)?;
    if x as f32 > 0.0 {
        Ok(x)
    } else {
        Err(params.error(format!("`{name}` must be above 0, found {x}")))
    }
}

/// Returns the points or vectors of a parameter.
fn vectors<const N: usize>(params: &Params, name: &str) -> Result<Vec<[f32; N]>, SceneError> {
    let Some(numbers) = params.numbers(name)? else {
        return Ok(Vec::new());
    };
    if !numbers.len().is_multiple_of(N) {
        return Err(params.error(format!(
            "`{name}` has {} numbers, not a multiple of {N}",
            numbers.len()
        )));
    }
    let rows = numbers.chunks_exact(N);
    Ok(rows
        .map(|row| std::array::from_fn(|i| row[i] as f32))
        .collect())
}

/// Returns vertices with their normals and texture coordinates, without triangles.
fn vertices(params: &Params) -> Result<Shape, SceneError> {
    let positions: Vec<Vec3> = vectors(params, "P")?.into_iter().map(Vec3::from).collect();
    let normals: Vec<Vec3> = vectors(params, "N")?.into_iter().map(Vec3::from).collect();
    let name = if params.get("uv").is_some() {
        "uv"
    } else {
        "st"
    };
    let uvs: Vec<Vec2> = vectors(params, name)?.into_iter().map(Vec2::from).collect();
    params.mark_read(&["S", "faceIndices"]);
    let count = positions.len();
    for (name, found) in [("N", normals.len()), (name, uvs.len())] {
        if found != 0 && found != count {
            return Err(params.error(format!("{count} positions but {found} of `{name}`")));
        }
    }
    Ok(Shape {
        positions,
        normals,
        uvs,
        ..Shape::default()
    })
}

/// Returns the indices of vertices, in groups of `N`; by default one group in order.
fn indices<const N: usize>(params: &Params, vertices: usize) -> Result<Vec<[u32; N]>, SceneError> {
    let Some(numbers) = params.numbers("indices")? else {
        if vertices == N {
            return Ok(vec![std::array::from_fn(|i| i as u32)]);
        }
        return Err(params.error(format!("{vertices} positions without `indices`")));
    };
    if !numbers.len().is_multiple_of(N) {
        return Err(params.error(format!(
            "`indices` has {} numbers, not a multiple of {N}",
            numbers.len()
        )));
    }
    let valid = |x: &f64| x.fract() == 0.0 && *x >= 0.0 && *x < vertices as f64;
    if let Some(bad) = numbers.iter().find(|x| !valid(x)) {
        return Err(params.error(format!(
            "`indices` names vertex {bad}, counted from 0, but there are only {vertices}"
        )));
    }
    let rows = numbers.chunks_exact(N);
    Ok(rows
        .map(|row| std::array::from_fn(|i| row[i] as u32))
        .collect())
}

/// Reads the parameters of a triangle mesh.
fn triangle_mesh(params: &Params) -> Result<MeshDesc, SceneError> {
    let mut shape = vertices(params)?;
    shape.triangles = indices(params, shape.positions.len())?;
    let mut mesh = shape.into_mesh(PathBuf::new(), "");
    let numbers = params.numbers("P")?.unwrap_or_default();
    let points: Vec<DVec3> = numbers.chunks_exact(3).map(DVec3::from_slice).collect();
    mesh.place(&points);
    Ok(mesh)
}

/// Orients a mesh by its normals, reverses it, adds default texture coordinates if they are needed,
/// and computes its hash.
fn finished(mut mesh: MeshDesc, options: ShapeOptions) -> MeshDesc {
    ply::orient_by_normals(&mut mesh);
    // In version 3 the normals of a file are not reversed, and they determine the front.
    let fixed = options.version == Version::V3 && !mesh.normals.is_empty();
    if options.reversed && !fixed {
        mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        mesh.normals.iter_mut().for_each(|n| *n = -*n);
    }
    if options.oriented && mesh.uvs.is_empty() {
        separate_corners(&mut mesh);
    }
    mesh.slots = vec![String::new()];
    mesh.triangle_slot = vec![0; mesh.triangles.len()];
    mesh.content_hash = mesh_hash(&mesh);
    mesh
}

/// Gives every triangle its own vertices with the texture coordinates (0, 0), (1, 0) and (1, 1),
/// pbrt's default.
fn separate_corners(mesh: &mut MeshDesc) {
    let corners: Vec<usize> = mesh
        .triangles
        .iter()
        .flatten()
        .map(|i| *i as usize)
        .collect();
    let at = |values: &[Vec3]| -> Vec<Vec3> {
        if values.is_empty() {
            return Vec::new();
        }
        corners.iter().map(|i| values[*i]).collect()
    };
    (mesh.positions, mesh.normals) = (at(&mesh.positions), at(&mesh.normals));
    mesh.uvs = (0..corners.len())
        .map(|i| [Vec2::ZERO, Vec2::X, Vec2::ONE][i % 3])
        .collect();
    mesh.triangles = (0..corners.len() as u32 / 3)
        .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
        .collect();
}
