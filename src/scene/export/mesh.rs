//! Meshes as binary PLY files, one for each material of a mesh.

use std::collections::BTreeMap;

use glam::Vec3;

use super::Folder;
use crate::scene::SceneError;
use crate::scene::desc::MeshDesc;

/// What one file holds: a mesh by its hash, one of its slots, and whether its triangles are turned round.
type Part = ([u8; 32], u32, bool);

/// The meshes that were written.
#[derive(Default)]
pub(super) struct Meshes {
    files: BTreeMap<Part, String>,
}

impl Meshes {
    /// The file of the triangles of one slot; `turned` has the corners of every triangle run the other way round.
    pub fn file(
        &mut self,
        mesh: &MeshDesc,
        slot: u32,
        turned: bool,
        stem: &str,
        folder: &mut Folder,
    ) -> Result<String, SceneError> {
        let key = (mesh.content_hash, slot, turned);
        if let Some(file) = self.files.get(&key) {
            return Ok(file.clone());
        }
        let file = folder.write("meshes", stem, "ply", &encode(mesh, slot, turned))?;
        self.files.insert(key, file.clone());
        Ok(file)
    }
}

/// The PLY of a slot's triangles with the vertices that they use. Corner normals lie on the front side, as those of
/// compiled scenes do: a vertex whose triangles do not agree becomes two.
fn encode(mesh: &MeshDesc, slot: u32, turned: bool) -> Vec<u8> {
    let mut index: BTreeMap<(u32, bool), u32> = BTreeMap::new();
    let mut vertices: Vec<(u32, bool)> = Vec::new();
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for (corners, _) in mesh.triangles.iter().zip(&mesh.triangle_slot).filter(|(_, s)| **s == slot) {
        let behind = normals_lie_behind(mesh, corners);
        let mut t = corners.map(|corner| {
            *index.entry((corner, behind)).or_insert_with(|| {
                vertices.push((corner, behind));
                vertices.len() as u32 - 1
            })
        });
        if turned {
            t.swap(1, 2);
        }
        triangles.push(t);
    }
    let (normals, uvs) = (!mesh.normals.is_empty(), !mesh.uvs.is_empty());
    let mut header = format!("ply\nformat binary_little_endian 1.0\nelement vertex {}\n", vertices.len());
    let properties = [(true, "x y z"), (normals, "nx ny nz"), (uvs, "u v")];
    for name in properties.iter().filter(|(there, _)| *there).flat_map(|(_, names)| names.split(' ')) {
        header.push_str(&format!("property float {name}\n"));
    }
    header.push_str(&format!("element face {}\nproperty list uchar int vertex_indices\nend_header\n", triangles.len()));
    let mut out = header.into_bytes();
    let mut floats = |v: &[f32]| v.iter().for_each(|x| out.extend(x.to_le_bytes()));
    for (corner, behind) in &vertices {
        let i = *corner as usize;
        floats(&mesh.positions[i].to_array());
        if normals {
            floats(&(mesh.normals[i] * if *behind { -1.0 } else { 1.0 }).to_array());
        }
        if uvs {
            floats(&mesh.uvs[i].to_array());
        }
    }
    for t in triangles {
        out.push(3);
        t.iter().for_each(|i| out.extend(i.to_le_bytes()));
    }
    out
}

fn normals_lie_behind(mesh: &MeshDesc, corners: &[u32; 3]) -> bool {
    if mesh.normals.is_empty() {
        return false;
    }
    let [a, b, c] = corners.map(|i| mesh.positions[i as usize].as_dvec3());
    let mean: Vec3 = corners.iter().map(|i| mesh.normals[*i as usize]).sum();
    (b - a).cross(c - a).dot(mean.as_dvec3()) < 0.0
}
