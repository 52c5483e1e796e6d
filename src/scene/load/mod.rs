//! Scene formats: one file and one row of [`FORMATS`] each.
//!
//! Every loader returns a [`SceneDesc`] and [`Note`]s about what it could not honour. Sizes are checked before
//! anything is read, and nothing is allocated that the size of a file does not justify.

mod bare;
pub mod files;
mod folder;
mod gltf;
mod images;
mod mitsuba;
mod obj;
pub mod openexr;
mod ply;
mod scn;

pub use images::load as texture;

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::{Note, SceneDesc, SceneError};

/// One scene format.
#[derive(Debug)]
pub struct FormatRow {
    /// Short name.
    pub name: &'static str,
    /// File extensions in lower case, without the dot.
    pub extensions: &'static [&'static str],
    /// What it is and what is read of it, in a sentence.
    pub doc: &'static str,
    /// Whether the first bytes of a file without a known extension look like this format.
    pub sniff: fn(&[u8]) -> bool,
    /// Reads a file of this format.
    pub load: Loader,
    /// What is read of it, a row for each element or key.
    pub reads: &'static [Reads],
}

/// What becomes of one element or key of a format.
#[derive(Clone, Copy, Debug)]
pub struct Reads {
    /// The words of the format, each between grave accents, or a description of the rest.
    pub name: &'static str,
    /// What it becomes; empty where it is only noted.
    pub read: &'static str,
    /// What is a note instead, or an error.
    pub noted: &'static str,
}

/// Reads one scene file.
pub type Loader = fn(&Path, Missing) -> Result<(SceneDesc, Vec<Note>), SceneError>;

/// What becomes of a material whose texture cannot be read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Missing {
    /// The scene is an error that names the material and the file.
    #[default]
    Refused,
    /// The parameter keeps its scalar value, with a [`Note`] that names the material and the file.
    Noted,
}

/// An error about a texture, with what helps.
fn missing_texture(e: SceneError) -> SceneError {
    match e {
        SceneError::Malformed { file, place, problem } => {
            SceneError::Malformed { file, place, problem: format!("{problem} (`--lenient` goes on without it)") }
        }
        other => other,
    }
}

/// Every scene format, in the order in which files are sniffed.
pub const FORMATS: &[FormatRow] = &[
    FormatRow {
        name: "gltf",
        extensions: &["gltf", "glb"],
        doc: "glTF 2.0: nodes, meshes, cameras, point and directional lights, metallic-roughness materials with extensions.",
        sniff: gltf::sniff,
        load: gltf::load,
        reads: gltf::READS,
    },
    FormatRow {
        name: "folder",
        extensions: &["json"],
        doc: "Scene folders of the second source: scene.json with Objects/, Textures/ and HDRI/.",
        sniff: folder::sniff,
        load: folder::load,
        reads: folder::READS,
    },
    FormatRow {
        name: "scn",
        extensions: &["scn"],
        doc: "JSON scenes of the vkraytracing program: camera, Disney materials, OBJ meshes and spheres.",
        sniff: scn::sniff,
        load: scn::load,
        reads: scn::READS,
    },
    FormatRow {
        name: "obj",
        extensions: &["obj"],
        doc: "A Wavefront OBJ mesh with the materials of its .mtl files, seen by a camera that frames its bounds.",
        sniff: obj::sniff,
        load: obj::load,
        reads: obj::READS,
    },
    FormatRow {
        name: "ply",
        extensions: &["ply"],
        doc: "A PLY mesh, ASCII or binary, seen by a camera that frames its bounds.",
        sniff: ply::sniff,
        load: ply::load,
        reads: ply::READS,
    },
    FormatRow {
        name: "mitsuba",
        extensions: &["xml"],
        doc: "Scenes of Mitsuba 3 in XML, those of Mitsuba 0.5 and 0.6 too: cameras, shapes, surfaces, textures, lights.",
        sniff: mitsuba::sniff,
        load: mitsuba::load,
        reads: mitsuba::READS,
    },
];

/// The note on a file that is only a mesh and brings no light; what takes the mesh in may have its own.
pub const DARK_MESH: &str = "nothing in this mesh shines: `set` the emission of a material (`materials.NAME.emission`), or \
                             name the mesh in a `.scn` or a Lua scene";

/// How much of a file is read to recognise its format.
const SNIFF_BYTES: u64 = 4096;

/// Loads a scene file of any known format: by its extension, or by its first bytes where the extension is unknown.
///
/// # Errors
/// A file that cannot be read, that no format knows, or that is not what its format says; also a mesh or texture
/// that it names and that has one of these faults.
pub fn load(path: &Path) -> Result<(SceneDesc, Vec<Note>), SceneError> {
    load_with(path, Missing::Refused)
}

/// The same, with a choice of what becomes of textures that cannot be read.
///
/// # Errors
/// As for [`load`], textures of materials left out where `missing` says so.
pub fn load_with(path: &Path, missing: Missing) -> Result<(SceneDesc, Vec<Note>), SceneError> {
    let inside = path.join(folder::SCENE_FILE);
    let path = if is_folder(path) { inside.as_path() } else { path };
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    if let Some(row) = FORMATS.iter().find(|row| row.extensions.contains(&extension.as_str())) {
        return (row.load)(path, missing);
    }
    let mut head = Vec::new();
    let (file, length) = open(path)?;
    file.take(SNIFF_BYTES.min(length)).read_to_end(&mut head).map_err(|e| unreadable(path, e))?;
    match FORMATS.iter().find(|row| (row.sniff)(&head)) {
        Some(row) => (row.load)(path, missing),
        None => Err(SceneError::UnknownFormat {
            file: path.to_owned(),
            known: FORMATS
                .iter()
                .flat_map(|row| row.extensions)
                .map(|e| format!(".{e}"))
                .collect::<Vec<_>>()
                .join(", "),
        }),
    }
}

/// Whether a path is a folder that is a scene.
pub fn is_folder(path: &Path) -> bool {
    path.is_dir() && path.join(folder::SCENE_FILE).is_file()
}

fn unreadable(path: &Path, reason: impl std::fmt::Display) -> SceneError {
    SceneError::Unreadable { file: path.to_owned(), reason: reason.to_string() }
}

/// The one path that a file has, whatever it is called; the path itself where there is no such file.
fn place(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}

/// Opens a regular file, with its length in bytes: pipes and devices would block or never end.
fn open(path: &Path) -> Result<(File, u64), SceneError> {
    let meta = std::fs::metadata(path).map_err(|e| unreadable(path, e))?;
    if !meta.is_file() {
        return Err(unreadable(path, "it is not a regular file"));
    }
    files::note(path);
    Ok((File::open(path).map_err(|e| unreadable(path, e))?, meta.len()))
}

/// The bytes of a file of at most `limit` bytes. No more is read than its length says: what the system shows as files of no
/// length can block, or never end.
fn read(path: &Path, limit: u64) -> Result<Vec<u8>, SceneError> {
    let (file, length) = open(path)?;
    if length > limit {
        return Err(unreadable(path, format!("it is larger than the limit of {} MiB for such files", limit >> 20)));
    }
    let mut bytes = Vec::new();
    file.take(length).read_to_end(&mut bytes).map_err(|e| unreadable(path, e))?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_has_no_two_rows_for_one_name_or_extension() {
        let mut seen = std::collections::BTreeSet::new();
        for row in FORMATS {
            assert!(seen.insert(row.name) || row.extensions.contains(&row.name), "{}", row.name);
            assert!(!row.doc.is_empty() && !row.extensions.is_empty());
            for e in row.extensions {
                assert!(seen.insert(e) || *e == row.name);
                assert_eq!(*e, e.to_ascii_lowercase());
            }
        }
    }

    #[test]
    fn directories_and_missing_files_are_one_error_each() {
        let dir = tempfile::tempdir().unwrap();
        let e = load(&dir.path().join("none.scn")).unwrap_err().to_string();
        assert!(e.contains("none.scn"), "{e}");
        std::fs::create_dir(dir.path().join("folder.obj")).unwrap();
        let e = load(&dir.path().join("folder.obj")).unwrap_err().to_string();
        assert!(e.contains("not a regular file"), "{e}");
        let text = dir.path().join("text.txt");
        std::fs::write(&text, "hello").unwrap();
        let e = load(&text).unwrap_err().to_string();
        assert!(e.contains(".json, .scn, .obj, .ply, .xml"), "{e}");
    }

    #[test]
    fn a_file_without_a_known_extension_is_sniffed() {
        let dir = tempfile::tempdir().unwrap();
        let scene = dir.path().join("scene");
        std::fs::write(&scene, "  { \"maxdepth\": 3 }").unwrap();
        assert_eq!(load(&scene).unwrap().0.max_depth, 3);
        let mesh = dir.path().join("mesh.txt");
        std::fs::write(&mesh, "# a mesh\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
        assert_eq!(load(&mesh).unwrap().0.entities.len(), 1);
    }

    #[test]
    fn a_file_over_its_limit_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("big");
        std::fs::write(&path, vec![b' '; 100]).unwrap();
        assert_eq!(read(&path, 100).unwrap().len(), 100);
        assert!(read(&path, 99).is_err());
    }
}
