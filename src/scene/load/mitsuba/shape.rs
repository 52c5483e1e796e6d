//! Shapes: meshes from files, and those that are made here.

use std::collections::BTreeMap;
use std::f32::consts::TAU;
use std::path::PathBuf;
use std::sync::Arc;

use glam::{DAffine3, Vec2, Vec3};

use super::tree::Object;
use crate::scene::desc::{MeshDesc, ShapeDesc, Transform, mesh_hash};
use crate::scene::load::obj::Front;
use crate::scene::load::{bare, obj, place, ply};
use crate::scene::shape::{Shape, icosphere};
use crate::scene::{Note, SceneError};

/// Corners of a disk's or cylinder's outline: the area is 1e-4 too small.
const SEGMENTS: u32 = 256;
/// Splittings of the icosahedron that stands for spheres that are none to Lumbre: 81,920 triangles.
const SPHERE_SPLITS: u32 = 6;
/// How many triangles all different shapes that are made here may have.
const MAX_MADE: usize = 1 << 20;

/// A shape with its place, before anything of the scene is put around it.
pub(super) struct Placed {
    /// What it is.
    pub shape: ShapeDesc,
    /// Its own place.
    pub transform: DAffine3,
    /// After what it may be called.
    pub stem: String,
}

/// How a mesh from a file is taken.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Taken {
    file: PathBuf,
    flat: bool,
    flipped: bool,
    /// Whether texture coordinates start at the bottom left, as OBJ has them.
    up: bool,
    /// Whether its own place mirrors it, which turns the front round where the file has no normals.
    mirrors: bool,
}

/// A made shape: its name and the bits of its numbers, and whether it is turned inside out.
type Made = (&'static str, [u32; 7], bool);

/// Meshes that were read or made, shared by all shapes that take them alike.
#[derive(Default)]
pub(super) struct Meshes {
    files: BTreeMap<Taken, Arc<MeshDesc>>,
    made: BTreeMap<Made, Arc<MeshDesc>>,
    /// Triangles of all that were made.
    triangles: usize,
}

impl Meshes {
    /// Reads or makes a shape; `None`, with a note, for kinds that are not known.
    pub fn read(&mut self, o: &Object, notes: &mut Vec<Note>) -> Result<Option<Placed>, SceneError> {
        let transform = o.map("to_world")?;
        let flipped = o.flag("flip_normals", false)?;
        let mut made = |kind: &'static str, numbers: [f32; 7], shape: &dyn Fn() -> Result<Shape, SceneError>| {
            let key = (kind, numbers.map(f32::to_bits), flipped);
            let mesh = match self.made.get(&key) {
                Some(mesh) => mesh.clone(),
                None => {
                    let mut mesh = shape()?.into_mesh(PathBuf::new(), "");
                    self.triangles += mesh.triangles.len();
                    if self.triangles > MAX_MADE {
                        return Err(o.error(format!("different shapes of more than {MAX_MADE} triangles in all")));
                    }
                    finish(&mut mesh, flipped);
                    self.made.entry(key).or_insert(Arc::new(mesh)).clone()
                }
            };
            Ok(Some(Placed { shape: ShapeDesc::Mesh(mesh), transform, stem: kind.to_owned() }))
        };
        match o.kind.as_str() {
            "obj" | "ply" => {
                let mesh = self.file(o, &transform, flipped, notes)?;
                let stem = mesh.file.file_stem().map_or_else(|| "mesh".into(), |s| s.to_string_lossy().into_owned());
                Ok(Some(Placed { shape: ShapeDesc::Mesh(mesh), transform, stem }))
            }
            "rectangle" => made("rectangle", [0.0; 7], &|| Ok(rectangle())),
            "cube" => made("cube", [0.0; 7], &|| Ok(cube())),
            "disk" => made("disk", [0.0; 7], &|| Ok(disk())),
            "cylinder" => {
                let (p0, p1) = (o.vector("p0")?.unwrap_or(Vec3::ZERO), o.vector("p1")?.unwrap_or(Vec3::Z));
                let radius = o.number("radius", 1.0)? as f32;
                if p0 == p1 || radius <= 0.0 {
                    return Err(o.error("a cylinder needs a length and a positive radius"));
                }
                made("cylinder", [p0.x, p0.y, p0.z, p1.x, p1.y, p1.z, radius], &|| Ok(cylinder(p0, p1, radius)))
            }
            "sphere" => {
                let radius = o.number("radius", 1.0)? as f32;
                let center = o.vector("center")?.unwrap_or(Vec3::ZERO);
                if radius <= 0.0 || !radius.is_finite() {
                    return Err(o.error(format!("a sphere needs a positive radius, found {radius}")));
                }
                let transform = transform * DAffine3::from_translation(center.as_dvec3());
                let frame = super::affine(&transform);
                let round = Transform::framed(frame).sphere_scale().is_some();
                if round && !flipped {
                    return Ok(Some(Placed {
                        shape: ShapeDesc::Sphere { radius },
                        transform,
                        stem: "sphere".to_owned(),
                    }));
                }
                notes.push(o.note("a sphere that is stretched or turned inside out becomes a mesh of triangles"));
                let numbers = [radius, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
                let ball = || icosphere(radius, SPHERE_SPLITS).map_err(|e| o.error(e.to_string()));
                Ok(made("sphere", numbers, &ball)?.map(|ball| Placed { transform, ..ball }))
            }
            other => {
                let shown = super::values::shorten(other);
                notes.push(o.note(format!("the shape `{shown}` is not known: it is left out")));
                Ok(None)
            }
        }
    }

    fn file(
        &mut self,
        o: &Object,
        transform: &DAffine3,
        flipped: bool,
        notes: &mut Vec<Note>,
    ) -> Result<Arc<MeshDesc>, SceneError> {
        let Some(name) = o.text("filename")? else {
            return Err(o.error(format!("a shape `{}` needs a `filename`", o.kind)));
        };
        let path = super::beside(o, name);
        let is_obj = o.kind == "obj";
        let mirrors = transform.matrix3.determinant() < 0.0;
        let taken = Taken {
            file: place(&path),
            flat: o.flag("face_normals", false)?,
            flipped,
            up: o.flag("flip_tex_coords", is_obj)?,
            mirrors,
        };
        if let Some(mesh) = self.files.get(&taken) {
            return Ok(mesh.clone());
        }
        let read = match is_obj {
            true => obj::load_mesh(&path, "", Front::CounterClockwise, notes),
            false => ply::load_mesh(&path, "", notes),
        };
        let mut mesh = read.map_err(|e| o.error(e.to_string()))?;
        // Colours of vertices are textures there, `mesh_attribute`, and the shape's surface is the only one.
        mesh.colors = Vec::new();
        mesh.slots = vec![String::new()];
        mesh.triangle_slot.fill(0);
        // Normals, which are in a file or not made before its shape stands in its place, decide which side is the front.
        if mirrors && (taken.flat || mesh.normals.is_empty()) {
            mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        if taken.flat {
            mesh.normals = Vec::new();
        } else if mesh.normals.is_empty() {
            mesh.normals = bare::smooth_normals(&mesh.positions, &mesh.triangles);
        }
        if !taken.up {
            mesh.uvs.iter_mut().for_each(|uv| uv.y = 1.0 - uv.y);
        }
        finish(&mut mesh, flipped);
        let mesh = Arc::new(mesh);
        self.files.insert(taken, mesh.clone());
        Ok(mesh)
    }
}

/// Turns a mesh inside out, and hashes it.
fn finish(mesh: &mut MeshDesc, flipped: bool) {
    if flipped {
        mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        mesh.normals.iter_mut().for_each(|n| *n = -*n);
    }
    mesh.content_hash = mesh_hash(mesh);
}

/// The square from -1 to 1 in x and y; it faces +z. Mitsuba's v grows with y from the top of a picture.
fn rectangle() -> Shape {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(Vec2::from);
    Shape {
        positions: corners.map(|c| c.extend(0.0)).to_vec(),
        normals: vec![Vec3::Z; 4],
        uvs: corners.map(|c| Vec2::new(0.5 + 0.5 * c.x, 0.5 - 0.5 * c.y)).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Shape::default()
    }
}

/// The cube from -1 to 1, with a picture on every face.
fn cube() -> Shape {
    let mut cube = Shape::default();
    for n in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z] {
        let across = if n.y == 0.0 { Vec3::Y } else { Vec3::Z };
        let (a, b) = (across.cross(n), across);
        let first = cube.positions.len() as u32;
        let face = rectangle();
        cube.positions.extend(face.positions.iter().map(|p| n + a * p.x + b * p.y));
        cube.normals.extend([n; 4]);
        cube.uvs.extend(face.uvs);
        cube.triangles.extend(face.triangles.iter().map(|t| t.map(|i| i + first)));
    }
    cube
}

/// The disk of radius 1 in x and y; it faces +z. Texture coordinates are radius and angle.
fn disk() -> Shape {
    let mut disk = Shape::default();
    for i in 0..=SEGMENTS {
        let turn = i as f32 / SEGMENTS as f32;
        let (sin, cos) = (turn * TAU).sin_cos();
        disk.positions.extend([Vec3::ZERO, Vec3::new(cos, sin, 0.0)]);
        disk.normals.extend([Vec3::Z; 2]);
        disk.uvs.extend([Vec2::new(0.0, 1.0 - turn), Vec2::new(1.0, 1.0 - turn)]);
        if i > 0 {
            disk.triangles.push([2 * i - 2, 2 * i - 1, 2 * i + 1]);
        }
    }
    disk
}

/// The side of a cylinder, which faces outwards. Texture coordinates are angle and height.
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
        side.uvs.extend([Vec2::new(turn, 1.0), Vec2::new(turn, 0.0)]);
        if i > 0 {
            let (a, b) = (2 * i - 2, 2 * i);
            let quad = [[a, b, b + 1], [a, b + 1, a + 1]];
            // Whichever way round the frame is, the front is outside.
            let turned = s.cross(t).dot(axis) < 0.0;
            side.triangles.extend(quad.map(|[p, q, r]| if turned { [p, r, q] } else { [p, q, r] }));
        }
    }
    side
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn made_shapes_have_their_area_and_face_their_normals() {
        let cylinder = cylinder(Vec3::new(1.0, 0.0, 0.0), Vec3::new(1.0, 3.0, 0.0), 0.5);
        for (shape, area) in [(rectangle(), 4.0), (cube(), 24.0), (disk(), TAU / 2.0), (cylinder, 3.0 * TAU / 2.0)] {
            let mut found = 0.0;
            let shape = shape.checked().unwrap();
            for t in &shape.triangles {
                let [a, b, c] = t.map(|i| shape.positions[i as usize]);
                let cross = (b - a).cross(c - a);
                found += 0.5 * cross.length();
                t.iter().for_each(|i| assert!(cross.dot(shape.normals[*i as usize]) > 0.0));
            }
            assert!((found / area - 1.0).abs() < 2e-4, "{found} instead of {area}");
        }
    }
}
