//! Shapes of Mitsuba scenes: meshes from files, generated meshes, and spheres.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::f32::consts::TAU;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;

use glam::{DAffine3, DVec3, Vec2, Vec3};

use super::serialized::{SerializedFile, SerializedMesh};
use super::tree::XmlObject;
use super::values;
use crate::load::default_scene;
use crate::load::obj::{Front, Smoothing};
use crate::load::{canonical, obj, ply};
use lumbre_light::scene::desc::place::mesh_origin;
use lumbre_light::scene::desc::{MeshDesc, ShapeDesc, Transform, mesh_hash};
use lumbre_light::scene::shape::Shape;
use lumbre_light::scene::{Note, SceneError};

/// Segments of the outline of a disk or cylinder: the area is too small by a factor of 1e-4.
const SEGMENTS: u32 = 256;
/// Rings of the mesh that replaces spheres that cannot be analytic, each of twice as many fields:
/// 65,024 triangles.
const SPHERE_RINGS: u32 = 128;
/// Greatest number of triangles of all different generated shapes.
const MAX_GENERATED_TRIANGLES: usize = 1 << 20;

/// A shape with its own transform, before that of an instance is applied.
pub(super) struct TransformedShape {
    /// Geometry in object space.
    pub shape: ShapeDesc,
    /// Transform of the shape itself.
    pub transform: DAffine3,
    /// Default name of the shape.
    pub stem: String,
}

/// Materials by the names that a mesh file gives its faces, or by these in snake case.
pub(super) type NamedMaterials = BTreeMap<String, String>;

/// Needs of a surface that the shapes with it have to meet.
#[derive(Clone, Copy, Debug)]
pub(super) struct SurfaceNeeds<'a> {
    /// Texture coordinates, or a direction of anisotropy.
    pub oriented: bool,
    /// Colours of vertices.
    pub colors: bool,
    /// Materials of single faces. The slots of a mesh are their names, and empty for other faces.
    pub named: &'a Rc<NamedMaterials>,
}

/// Identifies a mesh from a file together with the options that change it.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct MeshKey {
    file: PathBuf,
    /// Index of the mesh in a file of several.
    index: u32,
    flat: bool,
    flipped: bool,
    /// Whether texture coordinates start at the bottom left, as in OBJ.
    up: bool,
    /// Whether the shape's transform mirrors it, which reverses the front if the file has no
    /// normals.
    mirrors: bool,
    /// Whether the surface needs the colours of its vertices.
    colored: bool,
    /// Materials of single faces.
    named: Rc<NamedMaterials>,
}

/// Identifies a generated shape: its name, the bits of its parameters, and whether it is inside
/// out.
type GeneratedKey = (&'static str, [u32; 7], bool);

/// Loader of meshes: those read or generated so far, which shapes with equal keys share.
#[derive(Default)]
pub(super) struct MeshLoader {
    files: BTreeMap<MeshKey, Arc<MeshDesc>>,
    /// Files of several meshes.
    serialized: BTreeMap<PathBuf, SerializedFile>,
    generated: BTreeMap<GeneratedKey, Arc<MeshDesc>>,
    /// Number of triangles of all generated meshes.
    triangles: usize,
}

impl MeshLoader {
    /// Returns the geometry of a shape; `None`, with a note, if its plugin is not supported.
    pub fn read(
        &mut self,
        o: &XmlObject,
        needs: SurfaceNeeds,
        notes: &mut Vec<Note>,
    ) -> Result<Option<TransformedShape>, SceneError> {
        let transform = o.transform("to_world")?;
        let flipped = o.flag("flip_normals", false)?;
        let none = [0.0; 7];
        match o.plugin.as_str() {
            "obj" | "ply" | "serialized" => {
                let mesh = self.file(o, &transform, flipped, needs, notes)?;
                let stem = mesh
                    .file
                    .file_stem()
                    .map_or_else(|| "mesh".into(), |s| s.to_string_lossy().into_owned());
                Ok(Some(TransformedShape {
                    shape: ShapeDesc::Mesh(mesh),
                    transform,
                    stem,
                }))
            }
            "rectangle" => {
                let key = ("rectangle", none, flipped);
                self.generate(o, key, transform, &|| Ok(rectangle()))
            }
            "cube" => self.generate(o, ("cube", none, flipped), transform, &|| Ok(cube())),
            "disk" => self.generate(o, ("disk", none, flipped), transform, &|| Ok(disk())),
            "cylinder" => {
                let ends = [
                    o.vector("p0")?.unwrap_or(DVec3::ZERO),
                    o.vector("p1")?.unwrap_or(DVec3::Z),
                ];
                let origin = mesh_origin(ends);
                let [p0, p1] = ends.map(|p| (p - origin).as_vec3());
                let transform = transform * DAffine3::from_translation(origin);
                let radius = o.number("radius", 1.0)? as f32;
                if p0 == p1 || radius <= 0.0 {
                    return Err(o.error("a cylinder needs a length and a positive radius"));
                }
                let params = [p0.x, p0.y, p0.z, p1.x, p1.y, p1.z, radius];
                let key = ("cylinder", params, flipped);
                self.generate(o, key, transform, &|| Ok(cylinder(p0, p1, radius)))
            }
            "sphere" => self.sphere(o, transform, [flipped, needs.oriented], notes),
            other => {
                let shown = values::truncated(other);
                notes.push(o.note(format!("the shape `{shown}` is not supported; ignored")));
                Ok(None)
            }
        }
    }

    /// Returns a generated mesh of a name and parameters, inside out if it is `flipped`, computed
    /// unless an equal one exists.
    fn generate(
        &mut self,
        o: &XmlObject,
        (name, params, flipped): (&'static str, [f32; 7], bool),
        transform: DAffine3,
        shape: &dyn Fn() -> Result<Shape, SceneError>,
    ) -> Result<Option<TransformedShape>, SceneError> {
        let key = (name, params.map(f32::to_bits), flipped);
        let mesh = match self.generated.get(&key) {
            Some(mesh) => mesh.clone(),
            None => {
                let mut mesh = shape()?.into_mesh(PathBuf::new(), "");
                self.triangles += mesh.triangles.len();
                if self.triangles > MAX_GENERATED_TRIANGLES {
                    return Err(o.error(format!(
                        "the different generated shapes have more than {MAX_GENERATED_TRIANGLES} \
                         triangles in total"
                    )));
                }
                finish(&mut mesh, flipped);
                self.generated.entry(key).or_insert(Arc::new(mesh)).clone()
            }
        };
        Ok(Some(TransformedShape {
            shape: ShapeDesc::Mesh(mesh),
            transform,
            stem: name.to_owned(),
        }))
    }

    /// Returns an analytic sphere, or a mesh, with a note, if the sphere is stretched, mirrored or
    /// inside out, or needs the coordinates of Mitsuba, which run about its z axis.
    fn sphere(
        &mut self,
        o: &XmlObject,
        transform: DAffine3,
        [flipped, oriented]: [bool; 2],
        notes: &mut Vec<Note>,
    ) -> Result<Option<TransformedShape>, SceneError> {
        let radius = o.number("radius", 1.0)? as f32;
        let center = o.vector("center")?.unwrap_or(DVec3::ZERO);
        if radius <= 0.0 || !radius.is_finite() {
            return Err(o.error(format!("a sphere needs a positive radius, found {radius}")));
        }
        // Mitsuba 3 turns a sphere inside out if its transform mirrors it.
        let flipped = flipped != (transform.matrix3.determinant() < 0.0);
        let transform = transform * DAffine3::from_translation(center);
        let round = Transform::framed(transform).sphere_scale().is_some();
        if round && !flipped && !oriented {
            return Ok(Some(TransformedShape {
                shape: ShapeDesc::Sphere { radius },
                transform,
                stem: "sphere".to_owned(),
            }));
        }
        notes.push(o.note(
            "a sphere that is textured, anisotropic, stretched or inside out becomes a mesh of triangles",
        ));
        if !round {
            notes.push(o.note(
                "stretched spheres are not supported by Mitsuba, which scales them equally along all axes",
            ));
        }
        let scaled = transform * DAffine3::from_scale(DVec3::splat(f64::from(radius)));
        self.generate(o, ("sphere", [0.0; 7], flipped), scaled, &|| Ok(sphere()))
    }

    /// Loads a mesh from a file, once for each set of options.
    fn file(
        &mut self,
        o: &XmlObject,
        transform: &DAffine3,
        flipped: bool,
        needs: SurfaceNeeds,
        notes: &mut Vec<Note>,
    ) -> Result<Arc<MeshDesc>, SceneError> {
        let Some(name) = o.text("filename")? else {
            return Err(o.error(format!("a shape `{}` needs a `filename`", o.plugin)));
        };
        let path = o.find_file(name);
        let is_obj = o.plugin == "obj";
        let mirrors = transform.matrix3.determinant() < 0.0;
        let index = o.number("shape_index", 0.0)?;
        if !(0.0..1e9).contains(&index) || index.fract() != 0.0 {
            return Err(o.error(format!(
                "`shape_index` must be a whole number of 0 or more, found {index}"
            )));
        }
        let mut key = MeshKey {
            file: canonical(&path),
            index: index as u32,
            flat: o.flag("face_normals", false)?,
            flipped,
            up: o.flag("flip_tex_coords", is_obj)?,
            mirrors,
            colored: needs.colors,
            named: Rc::clone(needs.named),
        };
        if let Some(mesh) = self.files.get(&key) {
            return Ok(mesh.clone());
        }
        let known_as = key.clone();
        let read = match o.plugin.as_str() {
            "obj" => obj::load_mesh(
                &path,
                "",
                (Front::CounterClockwise, Smoothing::Ignored),
                notes,
            ),
            "ply" => ply::load_mesh(&path, "", notes),
            _ => self.serialized_mesh(&path, &key).map(|read| {
                key.flat |= read.flat;
                read.mesh
            }),
        };
        let mut mesh = read.map_err(|e| o.error(e.to_string()))?;
        // Mitsuba uses vertex colours only through `mesh_attribute` textures. The surface of the
        // shape replaces all materials of the file.
        if !needs.colors {
            mesh.colors = Vec::new();
        } else if mesh.colors.is_empty() {
            notes.push(o.note("the mesh has no colours of vertices: they are white"));
        }
        let named = |slot: &String| {
            let known = needs.named.get(slot);
            known
                .or_else(|| needs.named.get(&values::snake_case(slot)))
                .cloned()
        };
        if mesh.slots.iter().any(|slot| named(slot).is_some()) {
            mesh.slots = mesh
                .slots
                .iter()
                .map(|slot| named(slot).unwrap_or_default())
                .collect();
        } else {
            mesh.slots = vec![String::new()];
            mesh.triangle_slot.fill(0);
        }
        // The file's normals determine the front. Without them it follows from the winding, which a
        // mirroring transform reverses.
        if mirrors && (key.flat || mesh.normals.is_empty()) {
            mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        if key.flat {
            mesh.normals = Vec::new();
        } else if mesh.normals.is_empty() {
            mesh.normals = default_scene::smooth_normals(&mesh.positions, &mesh.triangles);
        }
        if !key.up {
            mesh.uvs.iter_mut().for_each(|uv| uv.y = 1.0 - uv.y);
        }
        finish(&mut mesh, flipped);
        let mesh = Arc::new(mesh);
        self.files.insert(known_as, mesh.clone());
        Ok(mesh)
    }

    /// Reads a mesh of a file of several, which is read once.
    fn serialized_mesh(
        &mut self,
        path: &Path,
        key: &MeshKey,
    ) -> Result<SerializedMesh, SceneError> {
        let file = match self.serialized.entry(key.file.clone()) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(new) => new.insert(SerializedFile::read(path)?),
        };
        let mut read = file.mesh(key.index)?;
        ply::orient_by_normals(&mut read.mesh);
        Ok(read)
    }
}

/// Reverses a mesh if it is inside out, and computes its hash.
fn finish(mesh: &mut MeshDesc, flipped: bool) {
    if flipped {
        mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        mesh.normals.iter_mut().for_each(|n| *n = -*n);
    }
    mesh.content_hash = mesh_hash(mesh);
}

/// Returns the square from -1 to 1 in x and y, facing +z. In Mitsuba v increases with y, from the
/// top of an image.
fn rectangle() -> Shape {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(Vec2::from);
    Shape {
        positions: corners.map(|c| c.extend(0.0)).to_vec(),
        normals: vec![Vec3::Z; 4],
        uvs: corners
            .map(|c| Vec2::new(0.5 + 0.5 * c.x, 0.5 - 0.5 * c.y))
            .to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Shape::default()
    }
}

/// Corners of the faces of a cube in the order of Mitsuba: positions whose texture coordinates are the
/// lower left, lower right, upper right and upper left corner of the image.
const CUBE: [[[i8; 3]; 4]; 6] = [
    [[1, -1, -1], [1, -1, 1], [-1, -1, 1], [-1, -1, -1]],
    [[1, 1, -1], [-1, 1, -1], [-1, 1, 1], [1, 1, 1]],
    [[1, -1, -1], [1, 1, -1], [1, 1, 1], [1, -1, 1]],
    [[1, -1, 1], [1, 1, 1], [-1, 1, 1], [-1, -1, 1]],
    [[-1, -1, 1], [-1, 1, 1], [-1, 1, -1], [-1, -1, -1]],
    [[1, 1, -1], [1, -1, -1], [-1, -1, -1], [-1, 1, -1]],
];

/// Returns the cube from -1 to 1, with the whole texture on every face.
fn cube() -> Shape {
    let mut cube = Shape::default();
    for face in CUBE {
        let corners = face.map(|corner| Vec3::from_array(corner.map(f32::from)));
        let n = corners.iter().sum::<Vec3>() / 4.0;
        let first = cube.positions.len() as u32;
        cube.positions.extend(corners);
        cube.normals.extend([n; 4]);
        cube.uvs.extend([Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]);
        cube.triangles
            .extend([[0, 1, 2], [3, 0, 2]].map(|t| t.map(|i| first + i)));
    }
    cube
}

/// Returns the sphere of radius 1. Texture coordinates are the angle about z and the angle to it.
fn sphere() -> Shape {
    let (rings, fields) = (SPHERE_RINGS, 2 * SPHERE_RINGS);
    let mut sphere = Shape::default();
    for i in 0..=rings {
        for j in 0..=fields {
            let (down, turn) = (i as f32 / rings as f32, j as f32 / fields as f32);
            let (sin, cos) = (down * 0.5 * TAU).sin_cos();
            let (y, x) = (turn * TAU).sin_cos();
            let n = match i {
                0 => Vec3::Z,
                _ if i == rings => Vec3::NEG_Z,
                _ => Vec3::new(sin * x, sin * y, cos),
            };
            sphere.positions.push(n);
            sphere.normals.push(n);
            sphere.uvs.push(Vec2::new(turn, 1.0 - down));
            if i == rings || j == fields {
                continue;
            }
            let a = i * (fields + 1) + j;
            let (b, c, d) = (a + fields + 1, a + fields + 2, a + 1);
            if i + 1 < rings {
                sphere.triangles.push([a, b, c]);
            }
            if i > 0 {
                sphere.triangles.push([a, c, d]);
            }
        }
    }
    sphere
}

/// Returns the disk of radius 1 in x and y, facing +z. Texture coordinates are radius and angle.
fn disk() -> Shape {
    let mut disk = Shape::default();
    for i in 0..=SEGMENTS {
        let turn = i as f32 / SEGMENTS as f32;
        let (sin, cos) = (turn * TAU).sin_cos();
        disk.positions
            .extend([Vec3::ZERO, Vec3::new(cos, sin, 0.0)]);
        disk.normals.extend([Vec3::Z; 2]);
        disk.uvs
            .extend([Vec2::new(0.0, 1.0 - turn), Vec2::new(1.0, 1.0 - turn)]);
        if i > 0 {
            disk.triangles.push([2 * i - 2, 2 * i - 1, 2 * i + 1]);
        }
    }
    disk
}

/// Returns the side of a cylinder, facing outwards. Texture coordinates are angle and height.
fn cylinder(p0: Vec3, p1: Vec3, radius: f32) -> Shape {
    let axis = (p1 - p0).normalize_or(Vec3::Z);
    let (s, t) = axis.any_orthonormal_pair();
    let mut side = Shape::default();
    for i in 0..=SEGMENTS {
        let turn = i as f32 / SEGMENTS as f32;
        let (sin, cos) = (turn * TAU).sin_cos();
        let n = s * cos + t * sin;
        side.positions.extend([p0 + n * radius, p1 + n * radius]);
        side.normals.extend([n; 2]);
        side.uvs
            .extend([Vec2::new(turn, 1.0), Vec2::new(turn, 0.0)]);
        if i > 0 {
            let (a, b) = (2 * i - 2, 2 * i);
            let quad = [[a, b, b + 1], [a, b + 1, a + 1]];
            // The front is outside, whatever the orientation of the frame.
            let reversed = s.cross(t).dot(axis) < 0.0;
            side.triangles
                .extend(quad.map(|[p, q, r]| if reversed { [p, r, q] } else { [p, q, r] }));
        }
    }
    side
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn generated_shapes_have_their_area_and_face_their_normals() {
        let cylinder = cylinder(Vec3::new(1.0, 0.0, 0.0), Vec3::new(1.0, 3.0, 0.0), 0.5);
        for (shape, area) in [
            (rectangle(), 4.0),
            (cube(), 24.0),
            (disk(), TAU / 2.0),
            (sphere(), 2.0 * TAU),
            (cylinder, 3.0 * TAU / 2.0),
        ] {
            let mut found = 0.0;
            let shape = shape.checked().unwrap();
            for t in &shape.triangles {
                let [a, b, c] = t.map(|i| shape.positions[i as usize]);
                let cross = (b - a).cross(c - a);
                found += 0.5 * cross.length();
                t.iter()
                    .for_each(|i| assert!(cross.dot(shape.normals[*i as usize]) > 0.0));
            }
            assert!(
                (found / area - 1.0).abs() < 2e-4,
                "{found} instead of {area}"
            );
        }
    }
}
