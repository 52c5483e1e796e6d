//! Wavefront OBJ meshes, parsed by `tobj` after [`text`] has checked them.
//!
//! Supported are `v` with colours, `vt`, `vn`, `f`, `s` and `usemtl`, and, for a mesh that is
//! loaded as a scene, the `.mtl` files that it refers to ([`mtl`]). A face has the material of the
//! last
//! `usemtl`, whatever `o` or `g` say. Polygons are triangulated: convex ones as fans from their first vertex. Faces
//! of a smoothing group that have no normals share those of the group. Lines, points and free-form
//! surfaces have no effect.
//!
//! The front of a face with normals is the side to which the mean of its vertex normals points,
//! whatever its winding; the front of a face without normals follows from its winding by the
//! caller's convention.

mod mtl;
mod supported;
mod text;

pub(super) use self::supported::SUPPORTED;

use std::collections::{BTreeMap, BTreeSet};
use std::io::Read as _;
use std::path::{Path, PathBuf};

use glam::{Vec2, Vec3};

use self::text::FaceGroup;
pub(super) use self::text::Smoothing;
use super::images::ImageCache;
use super::{MissingTextures, canonical, read_file, text_of_lines};
use super::{default_scene, files};
use crate::load::beside::{beside, written};
use lumbre_light::scene::desc::{DEFAULT_MATERIAL, MaterialDesc, MeshDesc, SceneDesc, mesh_hash};
use lumbre_light::scene::{Note, SceneError};

/// Greatest size of an OBJ file in bytes.
const MAX_OBJ_BYTES: u64 = 1 << 30;

/// Greatest number of words in the name of a material file.
const MAX_NAME_WORDS: usize = 16;

/// Greatest number of material files that one statement names.
const MAX_LIBRARIES: usize = 64;

/// Convention for the front of a face without normals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Front {
    /// The vertices run counter-clockwise, seen from the front: the usual convention of OBJ.
    CounterClockwise,
    /// The vertices run clockwise, seen from the front: the convention of `.scn`.
    Clockwise,
}

/// Returns whether the first bytes of a file look like an OBJ.
pub(super) fn sniff(head: &[u8]) -> bool {
    let text = text_of_lines(head);
    let first = text
        .lines()
        .map(str::trim)
        .find(|l| !l.is_empty() && !l.starts_with('#'));
    first
        .and_then(|l| l.split_whitespace().next())
        .is_some_and(|k| ["v", "vn", "vt", "o", "g", "mtllib"].contains(&k))
}

/// Loads an OBJ file as a scene: with the materials of its material files, white ones for unknown
/// names, and a camera that frames it.
pub(super) fn load(
    path: &Path,
    missing: MissingTextures,
) -> Result<(SceneDesc, Vec<Note>), SceneError> {
    let mut notes = Vec::new();
    let conventions = (Front::CounterClockwise, Smoothing::Groups);
    let (mesh, libraries) = load_with_libraries(path, DEFAULT_MATERIAL, conventions, &mut notes)?;
    let materials_by_name = read_libraries(path, &libraries, missing, &mut notes)?;
    let mut find = |name: &String| {
        let known = materials_by_name.get(name);
        let known = known.or_else(|| materials_by_name.get(without_comment(name)));
        if known.is_none() && !materials_by_name.is_empty() && name != DEFAULT_MATERIAL {
            let shown: String = name.chars().take(48).collect();
            let message = format!("no material file has `{shown}`: its faces are white");
            notes.push(Note::new(path, "usemtl", message));
        }
        MaterialDesc {
            name: name.clone(),
            ..known.cloned().unwrap_or_else(|| MaterialDesc::new(name))
        }
    };
    let materials: Vec<MaterialDesc> = mesh.slots.iter().map(&mut find).collect();
    Ok((default_scene::scene(path, mesh, materials), notes))
}

/// Returns the materials by name of the material files that an OBJ file refers to.
pub(super) fn materials(
    path: &Path,
    missing: MissingTextures,
    notes: &mut Vec<Note>,
) -> Result<BTreeMap<String, MaterialDesc>, SceneError> {
    let bytes = read_file(path, MAX_OBJ_BYTES)?;
    let libraries = text::libraries(&text_of_lines(&bytes));
    read_libraries(path, &libraries, missing, notes)
}

/// Reads the material files that an OBJ file names in these arguments of `mtllib`.
fn read_libraries(
    path: &Path,
    libraries: &[String],
    missing: MissingTextures,
    notes: &mut Vec<Note>,
) -> Result<BTreeMap<String, MaterialDesc>, SceneError> {
    let mut images = ImageCache::default();
    // Of several materials with one name, the first is used.
    let mut materials_by_name: BTreeMap<String, MaterialDesc> = BTreeMap::new();
    let mut read_libraries = BTreeSet::new();
    let folder = path.parent().unwrap_or(Path::new(""));
    for file in libraries.iter().flat_map(|names| files_of(folder, names)) {
        if !read_libraries.insert(canonical(&file)) {
            continue;
        }
        match mtl::load(&file, missing, &mut images, notes) {
            Ok(materials) => materials.into_iter().for_each(|m| {
                let plain = without_comment(&m.name).to_owned();
                materials_by_name.entry(plain).or_insert_with(|| m.clone());
                materials_by_name.entry(m.name.clone()).or_insert(m);
            }),
            Err(SceneError::Unreadable { reason, .. }) => notes.push(Note::new(
                path,
                "mtllib",
                format!(
                    "cannot read {}: {reason}; its materials are white",
                    file.display()
                ),
            )),
            Err(other) => return Err(other),
        }
    }
    Ok(materials_by_name)
}

/// Returns a name without the comment that may follow it. Names may contain a `#`, as in `Map #1`.
fn without_comment(name: &str) -> &str {
    name.split_once(" # ").map_or(name, |(name, _)| name).trim()
}

/// Returns the material files that the argument of an `mtllib` names: one whose name may contain
/// spaces, or several.
fn files_of(folder: &Path, names: &str) -> Vec<PathBuf> {
    let exists = |name: &str| files::exists(&written(folder, name));
    let is_library = |name: &str| name.to_ascii_lowercase().ends_with(".mtl");
    let mut found = Vec::new();
    let mut rest = names.trim();
    while !rest.is_empty()
        && found.len() < MAX_LIBRARIES
        && (!rest.starts_with('#') || exists(rest))
    {
        let ends = rest.char_indices().filter(|(_, c)| c.is_whitespace());
        let ends = ends.map(|(i, _)| i).chain([rest.len()]);
        let ends: Vec<usize> = ends.take(MAX_NAME_WORDS).collect();
        let mut longest_first = ends.iter().rev();
        let existing = longest_first.find(|end| exists(&rest[..**end]));
        let missing = || ends.iter().find(|end| is_library(&rest[..**end]));
        let end = existing.or_else(missing).copied().unwrap_or(rest.len());
        found.push(beside(folder, &rest[..end]));
        rest = rest[end..].trim_start();
    }
    found
}

/// Loads a mesh; `default_slot` is the slot of faces without a `usemtl`.
pub(super) fn load_mesh(
    path: &Path,
    default_slot: &str,
    conventions: (Front, Smoothing),
    notes: &mut Vec<Note>,
) -> Result<MeshDesc, SceneError> {
    load_with_libraries(path, default_slot, conventions, notes).map(|(mesh, _)| mesh)
}

/// Loads a mesh, and the arguments of its `mtllib` statements.
fn load_with_libraries(
    path: &Path,
    default_slot: &str,
    (front, smoothing): (Front, Smoothing),
    notes: &mut Vec<Note>,
) -> Result<(MeshDesc, Vec<String>), SceneError> {
    let malformed = |place: String, problem: String| SceneError::malformed(path, place, problem);
    let bytes = read_file(path, MAX_OBJ_BYTES)?;
    let checked = text::check(&text_of_lines(&bytes), smoothing)
        .map_err(|error| malformed(format!("line {}", error.line), error.problem))?;
    drop(bytes);
    notes.extend(
        checked
            .notes
            .iter()
            .map(|(place, message)| Note::new(path, place.clone(), message.clone())),
    );
    let models = parse(&checked).map_err(|e| malformed("whole file".to_owned(), e.to_string()))?;
    // Large meshes: release the text before the mesh is built.
    drop((checked.vertices, checked.faces));
    let mut builder = MeshBuilder {
        has_normals: checked.groups.iter().any(|g| g.normals),
        has_uvs: checked.groups.iter().any(|g| g.uvs),
        has_colors: models.iter().any(|m| !m.mesh.vertex_color.is_empty()),
        front,
        slots_by_name: BTreeMap::new(),
        mesh: MeshDesc {
            file: path.to_owned(),
            origin: checked.origin,
            ..MeshDesc::default()
        },
    };
    for model in models {
        // A file without faces has one model, whose name is not a number.
        if let Some(group) = model
            .name
            .parse::<usize>()
            .ok()
            .and_then(|i| checked.groups.get(i))
        {
            let slot = builder.slot(group.material.as_deref().unwrap_or(default_slot));
            builder.add(&model.mesh, group, slot);
        }
    }
    let mut mesh = builder.mesh;
    mesh.content_hash = mesh_hash(&mesh);
    Ok((mesh, checked.libraries))
}

/// Parses a checked text, one model for each run of faces.
fn parse(checked: &text::CheckedObj) -> Result<Vec<tobj::Model>, tobj::LoadError> {
    let options = tobj::LoadOptions {
        single_index: true,
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
    };
    let mut text = checked.vertices.as_bytes().chain(checked.faces.as_bytes());
    tobj::load_obj_buf(&mut text, &options, |_| Ok(Default::default())).map(|(models, _)| models)
}

/// Builder of a mesh from models of `tobj`.
struct MeshBuilder {
    has_normals: bool,
    has_uvs: bool,
    has_colors: bool,
    front: Front,
    slots_by_name: BTreeMap<String, u32>,
    mesh: MeshDesc,
}

impl MeshBuilder {
    /// Returns the index of a material slot, which is added if it is new.
    fn slot(&mut self, name: &str) -> u32 {
        *self
            .slots_by_name
            .entry(name.to_owned())
            .or_insert_with(|| {
                self.mesh.slots.push(name.to_owned());
                self.mesh.slots.len() as u32 - 1
            })
    }

    /// Appends a vertex and returns its index.
    fn vertex(&mut self, position: Vec3, normal: Vec3, uv: Vec2, color: Vec3) -> u32 {
        self.mesh.positions.push(position);
        if self.has_normals {
            self.mesh.normals.push(normal);
        }
        if self.has_uvs {
            self.mesh.uvs.push(uv);
        }
        if self.has_colors {
            self.mesh.colors.push(color);
        }
        self.mesh.positions.len() as u32 - 1
    }

    /// Appends the faces of a model, which are those of `group`, with the material of `slot`.
    fn add(&mut self, model: &tobj::Mesh, group: &FaceGroup, slot: u32) {
        let normals = group.normals;
        // Normals of smoothing groups are on the side from which faces run counter-clockwise.
        let sign = if group.smoothed && self.front == Front::Clockwise {
            -1.0
        } else {
            1.0
        };
        let position = |i: usize| Vec3::from_slice(&model.positions[3 * i..3 * i + 3]);
        let uv = |i: usize| {
            model
                .texcoords
                .get(2 * i..2 * i + 2)
                .map_or(Vec2::ZERO, Vec2::from_slice)
        };
        let color = |i: usize| {
            model
                .vertex_color
                .get(3 * i..3 * i + 3)
                .map_or(Vec3::ONE, Vec3::from_slice)
        };
        // Faces without normals in a mesh with normals get their own vertices, with the normal of
        // the face.
        let flat = self.has_normals && !normals;
        let base = self.mesh.positions.len() as u32;
        if !flat {
            for i in 0..model.positions.len() / 3 {
                let normal = model
                    .normals
                    .get(3 * i..3 * i + 3)
                    .map_or(Vec3::ZERO, |n| sign * Vec3::from_slice(n));
                self.vertex(position(i), normal, uv(i), color(i));
            }
        }
        for corners in model.indices.chunks_exact(3) {
            let [a, b, c] = [corners[0], corners[1], corners[2]];
            let [pa, pb, pc] = [a, b, c].map(|i| position(i as usize).as_dvec3());
            let winding = (pb - pa).cross(pc - pa);
            let reversed = if normals && !group.smoothed {
                let mean: Vec3 = [a, b, c]
                    .iter()
                    .map(|i| self.mesh.normals[(base + i) as usize])
                    .sum();
                winding.dot(mean.as_dvec3()) < 0.0
            } else {
                self.front == Front::Clockwise
            };
            let order = if reversed { [a, c, b] } else { [a, b, c] };
            let face_normal = winding.try_normalize().unwrap_or(glam::DVec3::Y).as_vec3()
                * if reversed { -1.0 } else { 1.0 };
            let triangle = if flat {
                order.map(|i| {
                    let i = i as usize;
                    self.vertex(position(i), face_normal, uv(i), color(i))
                })
            } else {
                order.map(|i| base + i)
            };
            if normals {
                for i in triangle {
                    let n = &mut self.mesh.normals[i as usize];
                    if *n == Vec3::ZERO {
                        *n = face_normal;
                    }
                }
            }
            self.mesh.triangles.push(triangle);
            self.mesh.triangle_slot.push(slot);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(text: &str, front: Front) -> (MeshDesc, Vec<Note>) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("m.obj");
        std::fs::write(&path, text).unwrap();
        let mut notes = Vec::new();
        let conventions = (front, Smoothing::Groups);
        let mesh = load_mesh(&path, DEFAULT_MATERIAL, conventions, &mut notes).unwrap();
        (mesh, notes)
    }

    fn normal_of(m: &MeshDesc, t: usize) -> Vec3 {
        let [a, b, c] = m.triangles[t].map(|i| m.positions[i as usize]);
        (b - a).cross(c - a).normalize_or(Vec3::ZERO)
    }

    const CORNERS: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    #[test]
    fn without_normals_the_front_follows_the_convention() {
        let text = format!("{CORNERS}f 1 2 3\n");
        assert_eq!(
            normal_of(&mesh(&text, Front::CounterClockwise).0, 0),
            Vec3::Z
        );
        assert_eq!(normal_of(&mesh(&text, Front::Clockwise).0, 0), Vec3::NEG_Z);
    }

    #[test]
    fn with_normals_the_front_is_their_side_whatever_the_winding() {
        for front in [Front::CounterClockwise, Front::Clockwise] {
            for face in ["f 1//1 2//1 3//1", "f 3//1 2//1 1//1"] {
                let (m, _) = mesh(&format!("{CORNERS}vn 0 0 -2\n{face}\n"), front);
                assert_eq!(normal_of(&m, 0), Vec3::NEG_Z);
                assert!(m.normals.iter().all(|n| *n == Vec3::NEG_Z));
            }
        }
    }

    #[test]
    fn faces_with_and_without_normals_and_uvs_can_be_mixed() {
        let text = format!(
            "{CORNERS}vn 0 0 1\nvt 0.25 0.75\nf 1/1/1 2/1/1 3/1/1\nf 1 3 4\nf 1/1 2/1 3/1\n"
        );
        let (m, notes) = mesh(&text, Front::Clockwise);
        assert_eq!(m.triangles.len(), 3);
        assert_eq!(m.normals.len(), m.positions.len());
        assert_eq!(m.uvs.len(), m.positions.len());
        for (t, (n, uv)) in [
            (Vec3::Z, [0.25, 0.75]),
            (Vec3::NEG_Z, [0.0, 0.0]),
            (Vec3::NEG_Z, [0.25, 0.75]),
        ]
        .iter()
        .enumerate()
        {
            assert_eq!(normal_of(&m, t), *n);
            for i in m.triangles[t] {
                assert_eq!(m.normals[i as usize], *n);
                assert_eq!(m.uvs[i as usize].to_array(), *uv);
            }
        }
        assert!(notes.is_empty(), "{notes:?}");
    }

    #[test]
    fn polygons_are_triangulated_and_slots_named() {
        let text = format!("{CORNERS}v 0.5 2 0\nf 1 2 3 5 4\nusemtl red\nf 1 2 3 4\n");
        let (m, _) = mesh(&text.replace('\n', "\r\n"), Front::CounterClockwise);
        assert_eq!(m.triangles.len(), 5);
        assert_eq!(m.slots, [DEFAULT_MATERIAL, "red"]);
        assert_eq!(m.triangle_slot, [0, 0, 0, 1, 1]);
        assert!((0..5).all(|t| normal_of(&m, t) == Vec3::Z));
    }

    #[test]
    fn normals_without_a_direction_become_the_faces_own() {
        let (m, notes) = mesh(
            &format!("{CORNERS}vn 0 0 0\nf 1//1 2//1 3//1\n"),
            Front::CounterClockwise,
        );
        assert!(m.normals.iter().all(|n| *n == Vec3::Z), "{:?}", m.normals);
        assert_eq!(notes.len(), 1);
    }

    #[test]
    fn an_empty_mesh_is_noted_and_a_bare_mesh_is_a_scene() {
        let (m, notes) = mesh("# nothing\n", Front::CounterClockwise);
        assert!(m.triangles.is_empty() && notes[0].message.contains("no faces"));
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("quad.obj");
        std::fs::write(
            &path,
            format!("mtllib none.mtl\n{CORNERS}usemtl a\nf 1 2 3 4\n"),
        )
        .unwrap();
        let (desc, notes) = load(&path, MissingTextures::Fail).unwrap();
        assert_eq!(desc.entities[0].name, "quad");
        assert_eq!(desc.materials[0].name, "a");
        assert_eq!(desc.camera.target, Vec3::new(0.5, 0.5, 0.0));
        assert!(notes.len() == 1 && notes[0].message.contains("none.mtl"));
    }
}
