//! Wavefront OBJ meshes, parsed by `tobj` after [`text`] has checked them.
//!
//! Read are `v`, `vt`, `vn`, `f`, `usemtl`, `o` and `g`, and of a mesh that is a scene by itself the `.mtl` files that it
//! names ([`mtl`]). A face belongs to the material that
//! the last `usemtl` named; an `o` or `g` that follows faces goes back to the default material. Polygons are cut as
//! fans from their first corner. Smoothing groups, lines, points and free-form surfaces have no effect.
//!
//! The front of a face with normals is the side to which the mean of its corners' normals points, whatever its
//! winding; the front of a face without normals follows from its winding as the caller says.

mod mtl;
mod reads;
mod text;

pub(super) use self::reads::READS;

use std::collections::{BTreeMap, BTreeSet};
use std::io::Read as _;
use std::path::Path;

use glam::{Vec2, Vec3};

use super::images::Pictures;
use super::{Missing, bare, place, read};
use crate::scene::desc::{DEFAULT_MATERIAL, MaterialDesc, MeshDesc, SceneDesc, mesh_hash};
use crate::scene::{Note, SceneError};

/// Greatest size of an OBJ file in bytes.
const MAX_OBJ_BYTES: u64 = 1 << 30;

/// Where the front of a face without normals is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Front {
    /// Where its corners run counter-clockwise: the usual convention of OBJ.
    CounterClockwise,
    /// Where its corners run clockwise: the convention of `.scn`.
    Clockwise,
}

/// Whether the first bytes of a file look like an OBJ.
pub(super) fn sniff(head: &[u8]) -> bool {
    let text = String::from_utf8_lossy(head);
    let first = text.lines().map(str::trim).find(|l| !l.is_empty() && !l.starts_with('#'));
    first.and_then(|l| l.split_whitespace().next()).is_some_and(|k| ["v", "vn", "vt", "o", "g", "mtllib"].contains(&k))
}

/// A bare OBJ as a scene: the materials of its material files, white for names that they do not have, and a camera in
/// front of it that frames its bounds.
pub(super) fn load(path: &Path, missing: Missing) -> Result<(SceneDesc, Vec<Note>), SceneError> {
    let mut notes = Vec::new();
    let (mesh, libraries) = load_parts(path, DEFAULT_MATERIAL, Front::CounterClockwise, &mut notes)?;
    let mut pictures = Pictures::default();
    // Of two materials with one name the first counts.
    let mut known: BTreeMap<String, MaterialDesc> = BTreeMap::new();
    let mut seen = BTreeSet::new();
    for library in libraries {
        let file = path.parent().unwrap_or(Path::new("")).join(library.replace('\\', "/"));
        if !seen.insert(place(&file)) {
            continue;
        }
        match mtl::load(&file, missing, &mut pictures, &mut notes) {
            Ok(materials) => materials.into_iter().for_each(|m| {
                known.entry(m.name.clone()).or_insert(m);
            }),
            Err(SceneError::Unreadable { reason, .. }) => notes.push(Note {
                file: path.to_owned(),
                place: "mtllib".to_owned(),
                message: format!("cannot read {}: {reason}: its materials are white", file.display()),
            }),
            Err(other) => return Err(other),
        }
    }
    let find = |name: &String| known.get(name).cloned().unwrap_or_else(|| MaterialDesc::new(name));
    let materials: Vec<MaterialDesc> = mesh.slots.iter().map(find).collect();
    Ok((bare::scene(path, mesh, materials, &mut notes), notes))
}

/// Reads one mesh; `default_slot` is the slot of faces that no `usemtl` names a material for.
pub(super) fn load_mesh(
    path: &Path,
    default_slot: &str,
    front: Front,
    notes: &mut Vec<Note>,
) -> Result<MeshDesc, SceneError> {
    load_parts(path, default_slot, front, notes).map(|(mesh, _)| mesh)
}

/// Reads one mesh, and the names of its material files.
fn load_parts(
    path: &Path,
    default_slot: &str,
    front: Front,
    notes: &mut Vec<Note>,
) -> Result<(MeshDesc, Vec<String>), SceneError> {
    let malformed = |place: String, problem: String| SceneError::Malformed { file: path.to_owned(), place, problem };
    let bytes = read(path, MAX_OBJ_BYTES)?;
    // Names and comments in other encodings are common and harmless; numbers are ASCII in all of them.
    let checked = text::check(&String::from_utf8_lossy(&bytes))
        .map_err(|fault| malformed(format!("line {}", fault.line), fault.problem))?;
    drop(bytes);
    notes.extend(checked.notes.iter().map(|(place, message)| Note {
        file: path.to_owned(),
        place: place.clone(),
        message: message.clone(),
    }));
    let options = tobj::LoadOptions { single_index: true, triangulate: true, ignore_points: true, ignore_lines: true };
    let mut text = checked.vertices.as_bytes().chain(checked.faces.as_bytes());
    let (models, _) = tobj::load_obj_buf(&mut text, &options, |_| Ok(Default::default()))
        .map_err(|e| malformed("whole file".to_owned(), e.to_string()))?;
    // Meshes of a million triangles: nothing is kept that is not needed any more.
    drop((checked.vertices, checked.faces));
    let mut builder = Builder {
        has_normals: checked.groups.iter().any(|g| g.normals),
        has_uvs: checked.groups.iter().any(|g| g.uvs),
        front,
        slot_of: BTreeMap::new(),
        mesh: MeshDesc {
            file: path.to_owned(),
            positions: Vec::new(),
            normals: Vec::new(),
            uvs: Vec::new(),
            colors: Vec::new(),
            second_uvs: Vec::new(),
            triangles: Vec::new(),
            slots: Vec::new(),
            triangle_slot: Vec::new(),
            content_hash: [0; 32],
        },
    };
    for model in models {
        // The one model without faces is that of a file without any.
        if let Some(group) = model.name.parse::<usize>().ok().and_then(|i| checked.groups.get(i)) {
            let slot = builder.slot(group.material.as_deref().unwrap_or(default_slot));
            builder.add(&model.mesh, group.normals, slot);
        }
    }
    let mut mesh = builder.mesh;
    mesh.content_hash = mesh_hash(&mesh);
    Ok((mesh, checked.libraries))
}

struct Builder {
    has_normals: bool,
    has_uvs: bool,
    front: Front,
    slot_of: BTreeMap<String, u32>,
    mesh: MeshDesc,
}

impl Builder {
    fn slot(&mut self, name: &str) -> u32 {
        *self.slot_of.entry(name.to_owned()).or_insert_with(|| {
            self.mesh.slots.push(name.to_owned());
            self.mesh.slots.len() as u32 - 1
        })
    }

    fn vertex(&mut self, position: Vec3, normal: Vec3, uv: Vec2) -> u32 {
        self.mesh.positions.push(position);
        if self.has_normals {
            self.mesh.normals.push(normal);
        }
        if self.has_uvs {
            self.mesh.uvs.push(uv);
        }
        self.mesh.positions.len() as u32 - 1
    }

    fn add(&mut self, part: &tobj::Mesh, normals: bool, slot: u32) {
        let position = |i: usize| Vec3::from_slice(&part.positions[3 * i..3 * i + 3]);
        let uv = |i: usize| part.texcoords.get(2 * i..2 * i + 2).map_or(Vec2::ZERO, Vec2::from_slice);
        // Faces without normals in a mesh with some get vertices of their own, which carry the face's normal.
        let flat = self.has_normals && !normals;
        let base = self.mesh.positions.len() as u32;
        if !flat {
            for i in 0..part.positions.len() / 3 {
                let normal = part.normals.get(3 * i..3 * i + 3).map_or(Vec3::ZERO, Vec3::from_slice);
                self.vertex(position(i), normal, uv(i));
            }
        }
        for corners in part.indices.chunks_exact(3) {
            let [a, b, c] = [corners[0], corners[1], corners[2]];
            let [pa, pb, pc] = [a, b, c].map(|i| position(i as usize).as_dvec3());
            let winding = (pb - pa).cross(pc - pa);
            let reversed = if normals {
                let mean: Vec3 = [a, b, c].iter().map(|i| self.mesh.normals[(base + i) as usize]).sum();
                winding.dot(mean.as_dvec3()) < 0.0
            } else {
                self.front == Front::Clockwise
            };
            let order = if reversed { [a, c, b] } else { [a, b, c] };
            let own = winding.try_normalize().unwrap_or(glam::DVec3::Y).as_vec3() * if reversed { -1.0 } else { 1.0 };
            let triangle = if flat {
                order.map(|i| self.vertex(position(i as usize), own, uv(i as usize)))
            } else {
                order.map(|i| base + i)
            };
            if normals {
                for i in triangle {
                    let n = &mut self.mesh.normals[i as usize];
                    if *n == Vec3::ZERO {
                        *n = own;
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
        let mesh = load_mesh(&path, DEFAULT_MATERIAL, front, &mut notes).unwrap();
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
        assert_eq!(normal_of(&mesh(&text, Front::CounterClockwise).0, 0), Vec3::Z);
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
    fn faces_with_and_without_normals_and_uvs_mix() {
        let text = format!("{CORNERS}vn 0 0 1\nvt 0.25 0.75\nf 1/1/1 2/1/1 3/1/1\nf 1 3 4\nf 1/1 2/1 3/1\n");
        let (m, notes) = mesh(&text, Front::Clockwise);
        assert_eq!(m.triangles.len(), 3);
        assert_eq!(m.normals.len(), m.positions.len());
        assert_eq!(m.uvs.len(), m.positions.len());
        for (t, (n, uv)) in
            [(Vec3::Z, [0.25, 0.75]), (Vec3::NEG_Z, [0.0, 0.0]), (Vec3::NEG_Z, [0.25, 0.75])].iter().enumerate()
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
    fn polygons_are_cut_and_slots_named() {
        let text = format!("{CORNERS}v 0.5 2 0\nf 1 2 3 5 4\nusemtl red\nf 1 2 3 4\n");
        let (m, _) = mesh(&text.replace('\n', "\r\n"), Front::CounterClockwise);
        assert_eq!(m.triangles.len(), 5);
        assert_eq!(m.slots, [DEFAULT_MATERIAL, "red"]);
        assert_eq!(m.triangle_slot, [0, 0, 0, 1, 1]);
        assert!((0..5).all(|t| normal_of(&m, t) == Vec3::Z));
    }

    #[test]
    fn normals_without_a_direction_become_the_faces_own() {
        let (m, notes) = mesh(&format!("{CORNERS}vn 0 0 0\nf 1//1 2//1 3//1\n"), Front::CounterClockwise);
        assert!(m.normals.iter().all(|n| *n == Vec3::Z), "{:?}", m.normals);
        assert_eq!(notes.len(), 1);
    }

    #[test]
    fn an_empty_mesh_is_a_note_and_a_bare_mesh_a_scene() {
        let (m, notes) = mesh("# nothing\n", Front::CounterClockwise);
        assert!(m.triangles.is_empty() && notes[0].message.contains("no faces"));
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("quad.obj");
        std::fs::write(&path, format!("mtllib none.mtl\n{CORNERS}usemtl a\nf 1 2 3 4\n")).unwrap();
        let (desc, notes) = load(&path, Missing::Refused).unwrap();
        assert_eq!(desc.entities[0].name, "quad");
        assert_eq!(desc.materials[0].name, "a");
        assert_eq!(desc.camera.target, Vec3::new(0.5, 0.5, 0.0));
        assert!(notes[0].message.contains("none.mtl") && notes[1].message.contains("nothing in this mesh shines"));
    }
}
