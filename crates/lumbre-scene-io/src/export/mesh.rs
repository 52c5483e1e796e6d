//! Export of meshes as binary PLY files, one for each material of a mesh.

use std::collections::BTreeMap;

use glam::Vec3;

use super::output_folder::OutputFolder;
use lumbre_light::scene::SceneError;
use lumbre_light::scene::desc::MeshDesc;

/// Identifies a file: the content hash of a mesh, a slot, and whether its triangles are reversed.
type FileKey = ([u8; 32], u32, bool);

/// Writer of meshes: the files written so far.
#[derive(Default)]
pub(super) struct MeshWriter {
    files: BTreeMap<FileKey, String>,
}

impl MeshWriter {
    /// Returns the file with the triangles of one slot, writing it if it is new; `reversed`
    /// reverses the vertex order of every triangle.
    pub fn file(
        &mut self,
        mesh: &MeshDesc,
        slot: u32,
        reversed: bool,
        stem: &str,
        folder: &mut OutputFolder,
    ) -> Result<String, SceneError> {
        let key = (mesh.content_hash, slot, reversed);
        if let Some(file) = self.files.get(&key) {
            return Ok(file.clone());
        }
        let file = folder.write_unique("meshes", stem, "ply", &encode(mesh, slot, reversed))?;
        self.files.insert(key, file.clone());
        Ok(file)
    }
}

/// Encodes a slot's triangles, with the vertices that they use, as PLY. Vertex normals lie on the
/// front side, as in compiled scenes: a vertex whose triangles disagree becomes two.
fn encode(mesh: &MeshDesc, slot: u32, reversed: bool) -> Vec<u8> {
    let mut index: BTreeMap<(u32, bool), u32> = BTreeMap::new();
    let mut vertices: Vec<(u32, bool)> = Vec::new();
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for (corners, _) in mesh
        .triangles
        .iter()
        .zip(&mesh.triangle_slot)
        .filter(|(_, s)| **s == slot)
    {
        let behind = normals_point_behind(mesh, corners);
        let mut t = corners.map(|corner| {
            *index.entry((corner, behind)).or_insert_with(|| {
                vertices.push((corner, behind));
                vertices.len() as u32 - 1
            })
        });
        if reversed {
            t.swap(1, 2);
        }
        triangles.push(t);
    }
    let (normals, uvs) = (!mesh.normals.is_empty(), !mesh.uvs.is_empty());
    let mut header = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\n",
        vertices.len()
    );
    let properties = [(true, "x y z"), (normals, "nx ny nz"), (uvs, "u v")];
    for name in properties
        .iter()
        .filter(|(present, _)| *present)
        .flat_map(|(_, names)| names.split(' '))
    {
        header.push_str(&format!("property float {name}\n"));
    }
    header.push_str(&format!(
        "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        triangles.len()
    ));
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

/// Returns whether the mean of a triangle's vertex normals points behind it.
fn normals_point_behind(mesh: &MeshDesc, corners: &[u32; 3]) -> bool {
    if mesh.normals.is_empty() {
        return false;
    }
    let [a, b, c] = corners.map(|i| mesh.positions[i as usize].as_dvec3());
    let mean: Vec3 = corners.iter().map(|i| mesh.normals[*i as usize]).sum();
    (b - a).cross(c - a).dot(mean.as_dvec3()) < 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a mesh of two triangles that share an edge, the second of which shows its back to
    /// the side of the vertex normals.
    fn mesh() -> MeshDesc {
        MeshDesc {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(1.0, 1.0, 0.0)],
            normals: vec![Vec3::Z; 4],
            triangles: vec![[0, 1, 2], [1, 2, 3]],
            slots: vec!["m".to_owned()],
            triangle_slot: vec![0; 2],
            ..MeshDesc::default()
        }
    }

    #[test]
    fn normals_lie_on_the_front_of_every_triangle() {
        let bytes = encode(&mesh(), 0, false);
        let end = bytes
            .windows(11)
            .position(|w| w == b"end_header\n")
            .unwrap()
            + 11;
        let (header, body) = bytes.split_at(end);
        let header = String::from_utf8(header.to_vec()).unwrap();
        assert!(header.contains("element vertex 6\n"), "{header}");
        let word = |bytes: &[u8], at: usize| <[u8; 4]>::try_from(&bytes[at..at + 4]).unwrap();
        let (vertices, faces) = body.split_at(6 * 24);
        let vector = |v: &[u8], at: usize| {
            Vec3::from([0, 4, 8].map(|k| f32::from_le_bytes(word(v, at + k))))
        };
        let vertices: Vec<[Vec3; 2]> = vertices
            .chunks_exact(24)
            .map(|v| [vector(v, 0), vector(v, 12)])
            .collect();
        assert_eq!(faces.len(), 2 * 13);
        for face in faces.chunks_exact(13) {
            let corners = [1, 5, 9].map(|at| vertices[u32::from_le_bytes(word(face, at)) as usize]);
            let [a, b, c] = corners.map(|[position, _]| position);
            let front = (b - a).cross(c - a);
            for [position, normal] in corners {
                assert!(normal.dot(front) > 0.0, "{position}: {normal}");
            }
        }
    }
}
