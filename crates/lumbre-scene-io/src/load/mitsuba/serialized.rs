//! Files of Mitsuba with one or more compressed meshes.
//!
//! A mesh is four bytes, of which two are [`MAGIC`] and two the version, and then a zlib stream:
//! flags, in version 4 a name, numbers of vertices and triangles, positions, normals, texture
//! coordinates, colours, and indices. At the end of the file are the offsets of all meshes and their
//! number. All numbers are in little-endian order.

use std::path::{Path, PathBuf};

use flate2::read::ZlibDecoder;
use glam::{Vec2, Vec3};

use crate::load::packed::{budget, expand};
use crate::load::read_file;
use lumbre_light::scene::SceneError;
use lumbre_light::scene::desc::MeshDesc;

/// Greatest size of a file in bytes.
const MAX_FILE_BYTES: u64 = 1 << 30;
/// First two bytes of a mesh.
const MAGIC: u16 = 0x041c;

const HAS_NORMALS: u32 = 1;
const HAS_UVS: u32 = 2;
const HAS_COLORS: u32 = 8;
const FACE_NORMALS: u32 = 0x10;
const DOUBLE_PRECISION: u32 = 0x2000;

/// A file whose meshes are read one by one.
pub(super) struct SerializedFile {
    path: PathBuf,
    bytes: Vec<u8>,
    /// Bytes to which its meshes may still expand.
    budget: u64,
}

/// A mesh of a file, and whether it has the normals of its faces.
pub(super) struct SerializedMesh {
    pub mesh: MeshDesc,
    pub flat: bool,
}

impl SerializedFile {
    /// Reads a file.
    pub fn read(path: &Path) -> Result<SerializedFile, SceneError> {
        let bytes = read_file(path, MAX_FILE_BYTES)?;
        Ok(SerializedFile {
            path: path.to_owned(),
            budget: budget(bytes.len()),
            bytes,
        })
    }

    /// Decodes the mesh with an index, counted from 0.
    pub fn mesh(&mut self, index: u32) -> Result<SerializedMesh, SceneError> {
        let decoded = self
            .expanded(index)
            .and_then(|(version, bytes)| decode(&self.path, version, &bytes));
        decoded.map_err(|problem| {
            SceneError::malformed(self.path.clone(), format!("mesh {index}"), problem)
        })
    }

    /// Returns the version and the expanded bytes of the mesh with an index.
    fn expanded(&mut self, index: u32) -> Result<(u16, Vec<u8>), String> {
        let mut all = Numbers(&self.bytes);
        let version = header(&mut all)?;
        let end = self.bytes.len();
        let count = Numbers(end.checked_sub(4).map_or(&[], |at| &self.bytes[at..])).u32()?;
        if index >= count {
            return Err(format!(
                "the file has {count} meshes, which are counted from 0"
            ));
        }
        let width = if version == 4 { 8 } else { 4 };
        let table = (width * u64::from(count) + 4) as usize;
        let first = end
            .checked_sub(table)
            .ok_or("the table of meshes is longer than the file")?;
        let mut entry = Numbers(&self.bytes[first + width as usize * index as usize..]);
        let offset = entry.integer(width)?;
        let start = usize::try_from(offset).ok().filter(|start| *start < first);
        let start = start.ok_or_else(|| format!("the offset {offset} is beyond the meshes"))?;
        let mut stream = Numbers(&self.bytes[start..first]);
        let version = header(&mut stream)?;
        let bytes = expand(ZlibDecoder::new(stream.0), self.budget)
            .map_err(|e| format!("invalid compressed data: {e}"))?
            .ok_or("the meshes expand too far for the size of the file")?;
        self.budget -= bytes.len() as u64;
        Ok((version, bytes))
    }
}

/// Returns the version of a mesh.
fn header(numbers: &mut Numbers) -> Result<u16, String> {
    let (magic, version) = (numbers.u16()?, numbers.u16()?);
    match version {
        3 | 4 if magic == MAGIC => Ok(version),
        _ if magic == MAGIC => Err(format!("expected version 3 or 4, found {version}")),
        _ => Err("this is no file of serialized meshes".to_owned()),
    }
}

/// Decodes the expanded bytes of a mesh.
fn decode(path: &Path, version: u16, bytes: &[u8]) -> Result<SerializedMesh, String> {
    let mut numbers = Numbers(bytes);
    let flags = numbers.u32()?;
    if version == 4 {
        numbers.text()?;
    }
    let [vertices, triangles] = [numbers.integer(8)?, numbers.integer(8)?];
    let double = flags & DOUBLE_PRECISION != 0;
    let mut floats = |width: u64, present: bool| {
        let count = if present { vertices } else { 0 };
        numbers.floats(count.saturating_mul(width), double)
    };
    let positions = floats(3, true)?;
    let normals = floats(3, flags & HAS_NORMALS != 0)?;
    let uvs = floats(2, flags & HAS_UVS != 0)?;
    floats(3, flags & HAS_COLORS != 0)?;
    let index_bytes = if vertices > u64::from(u32::MAX) { 8 } else { 4 };
    let indices = numbers.indices(triangles.saturating_mul(3), index_bytes)?;
    if let Some(beyond) = indices.iter().find(|i| u64::from(**i) >= vertices) {
        return Err(format!(
            "a triangle refers to vertex {beyond}, counted from 0, but there are only {vertices}"
        ));
    }
    let vectors = |all: Vec<f32>| all.as_chunks().0.iter().map(|v| Vec3::from(*v)).collect();
    let triangles = indices.as_chunks().0.to_vec();
    let mesh = MeshDesc {
        file: path.to_owned(),
        positions: vectors(positions),
        normals: vectors(normals),
        uvs: uvs.as_chunks().0.iter().map(|v| Vec2::from(*v)).collect(),
        slots: vec![String::new()],
        triangle_slot: vec![0; triangles.len()],
        triangles,
        ..MeshDesc::default()
    };
    Ok(SerializedMesh {
        mesh,
        flat: flags & FACE_NORMALS != 0,
    })
}

/// Numbers that are read one after another.
struct Numbers<'a>(&'a [u8]);

impl<'a> Numbers<'a> {
    /// Returns the next bytes.
    fn take(&mut self, count: u64) -> Result<&'a [u8], String> {
        let count = usize::try_from(count)
            .ok()
            .filter(|count| *count <= self.0.len());
        let count = count.ok_or("the data end too early")?;
        let (taken, rest) = self.0.split_at(count);
        self.0 = rest;
        Ok(taken)
    }

    /// Returns an unsigned number of at most eight bytes.
    fn integer(&mut self, width: u64) -> Result<u64, String> {
        let bytes = self.take(width)?.iter().rev();
        Ok(bytes.fold(0, |number, byte| number << 8 | u64::from(*byte)))
    }

    fn u16(&mut self) -> Result<u16, String> {
        Ok(self.integer(2)? as u16)
    }

    fn u32(&mut self) -> Result<u32, String> {
        Ok(self.integer(4)? as u32)
    }

    /// Skips a text that ends with a zero.
    fn text(&mut self) -> Result<(), String> {
        let length = self.0.iter().position(|byte| *byte == 0);
        let length = length.ok_or("the name does not end")?;
        self.take(length as u64 + 1).map(|_| ())
    }

    /// Returns finite numbers.
    fn floats(&mut self, count: u64, double: bool) -> Result<Vec<f32>, String> {
        let width = if double { 8 } else { 4 };
        let bytes = self.take(count.saturating_mul(width))?;
        let all: Vec<f32> = if double {
            let chunks = bytes.as_chunks().0.iter();
            chunks.map(|b| f64::from_le_bytes(*b) as f32).collect()
        } else {
            let chunks = bytes.as_chunks().0.iter();
            chunks.map(|b| f32::from_le_bytes(*b)).collect()
        };
        if all.iter().all(|x| x.is_finite()) {
            Ok(all)
        } else {
            Err("a number of a vertex is not finite".to_owned())
        }
    }

    /// Returns indices of vertices.
    fn indices(&mut self, count: u64, width: u64) -> Result<Vec<u32>, String> {
        let bytes = self.take(count.saturating_mul(width))?;
        let mut all = Numbers(bytes);
        (0..count)
            .map(|_| u32::try_from(all.integer(width)?).map_err(|e| e.to_string()))
            .collect()
    }
}
