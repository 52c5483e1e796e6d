//! Scene formats: one loader and one row of [`FORMATS`] each.
//!
//! Every loader returns a [`SceneDesc`] and [`Note`]s about the parts of a file that it cannot
//! represent. Sizes are checked before anything is read, and memory is bounded by the size of the
//! files.

mod beside;
mod composed;
pub(super) mod default_scene;
mod environment;
pub mod files;
mod film;
mod folder;
mod gltf;
mod images;
mod materials;
mod metals;
mod mitsuba;
mod obj;
pub mod openexr;
mod packed;
mod pbrt;
mod ply;
mod polygon;
pub mod primaries;
mod reading;
mod row;
mod scn;
mod sky;
mod spectrum;
mod unknown;

use beside::beside;
pub(crate) use environment::{FINE_ROWS, with_rows_at_poles};
pub use images::load as texture;
pub(crate) use images::mean_texel;
pub(crate) use pbrt::environment_square;
pub(crate) use reading::{
    canonical, open, read_file, text_of_lines, unreadable, with_lenient_hint,
};
pub use row::{FormatRow, Loader, MissingTextures, SupportedElement, Variables, VariablesLoader};

use std::io::Read;
use std::path::Path;

use crate::stage::{self, Stage};
use lumbre_light::scene::desc::{EntityDesc, ShapeDesc};
use lumbre_light::scene::{Note, SceneDesc, SceneError, note};

/// Every scene format, in the order in which they are tried on files without a known extension.
pub const FORMATS: &[FormatRow] = &[
    FormatRow {
        name: "gltf",
        extensions: &["gltf", "glb"],
        doc: "glTF 2.0: nodes, meshes, cameras, point, spot and directional lights, \
              metallic-roughness materials with extensions.",
        sniff: gltf::sniff,
        load: gltf::load,
        load_with_variables: Some(gltf::load_with_variables),
        is_model: true,
        supported: gltf::SUPPORTED,
    },
    FormatRow {
        name: "folder",
        extensions: &["json"],
        doc: "Scene folders of thesis S1 (docs/inside/transport.md): scene.json with Objects/, Textures/ \
              and HDRI/.",
        sniff: folder::sniff,
        load: folder::load,
        load_with_variables: None,
        is_model: false,
        supported: folder::SUPPORTED,
    },
    FormatRow {
        name: "scn",
        extensions: &["scn"],
        doc: "JSON scenes of the vkraytracing program: camera, Disney materials, OBJ meshes and \
              spheres.",
        sniff: scn::sniff,
        load: scn::load,
        load_with_variables: None,
        is_model: false,
        supported: scn::SUPPORTED,
    },
    FormatRow {
        name: "obj",
        extensions: &["obj"],
        doc: "A Wavefront OBJ mesh with the materials of its .mtl files, viewed by a camera that \
              frames it.",
        sniff: obj::sniff,
        load: obj::load,
        load_with_variables: None,
        is_model: true,
        supported: obj::SUPPORTED,
    },
    FormatRow {
        name: "ply",
        extensions: &["ply"],
        doc: "A PLY mesh, ASCII or binary, viewed by a camera that frames it.",
        sniff: ply::sniff,
        load: ply::load,
        load_with_variables: None,
        is_model: true,
        supported: ply::SUPPORTED,
    },
    FormatRow {
        name: "mitsuba",
        extensions: &["xml"],
        doc: "Scenes of Mitsuba 3 in XML, and of Mitsuba 0.5 and 0.6: cameras, shapes, surfaces, \
              textures, lights.",
        sniff: mitsuba::sniff,
        load: mitsuba::load,
        load_with_variables: Some(mitsuba::load_with_variables),
        is_model: false,
        supported: mitsuba::SUPPORTED,
    },
    FormatRow {
        name: "pbrt",
        extensions: &["pbrt"],
        doc: "Scenes of pbrt, versions 4 and 3: cameras, shapes, instances, materials, textures, \
              lights.",
        sniff: pbrt::sniff,
        load: pbrt::load,
        load_with_variables: None,
        is_model: false,
        supported: pbrt::SUPPORTED,
    },
];

/// Note on a model without lights.
const STUDIO: &str = "this model has no lights (textures that glow do not count): it stands in a studio \
                      with a ground, an area light and a dim environment. The scene option `stage` selects `studio`, \
                      `white` (radiance 1 from everywhere) or `none`";

/// Number of entities that a file of any size may create by instances; each byte of the file allows
/// one more.
const SMALL_ENTITIES: usize = 4096;

/// Number of bytes that are read to recognise the format of a file.
const SNIFF_BYTES: u64 = 4096;

/// Loads a scene file of any supported format, selected by its extension or, if that is unknown, by
/// its first bytes.
///
/// # Errors
/// Fails for a file that cannot be read, has no supported format, or violates its format, and for a
/// mesh or texture that it refers to and that has one of these faults.
pub fn load(path: &Path) -> Result<(SceneDesc, Vec<Note>), SceneError> {
    load_with(path, MissingTextures::Fail)
}

/// Loads a scene file like [`load`], with a policy for textures that cannot be read. Notes with
/// equal messages beyond the first few are counted, not listed.
///
/// # Errors
/// Fails like [`load`]; `missing` may exempt textures of materials.
pub fn load_with(
    path: &Path,
    missing: MissingTextures,
) -> Result<(SceneDesc, Vec<Note>), SceneError> {
    let (_, desc, notes) = load_any(path, missing, &Variables::new())?;
    Ok((desc, notes))
}

/// Loads a scene file like [`load_with`] with values for its variables; also returns its format.
fn load_any(
    path: &Path,
    missing: MissingTextures,
    variables: &Variables,
) -> Result<(&'static FormatRow, SceneDesc, Vec<Note>), SceneError> {
    let inside = path.join(folder::SCENE_FILE);
    let file = if is_folder(path) { &inside } else { path };
    let format = format_of(file)?;
    let read = match (variables.keys().next(), format.load_with_variables) {
        (None, _) => (format.load)(file, missing),
        (Some(_), Some(load)) => load(file, missing, variables),
        (Some(unknown), None) => {
            return Err(SceneError::malformed(
                path,
                "scene_options",
                format!(
                    "unknown option `{unknown}`: files of this format have the option `stage` only"
                ),
            ));
        }
    };
    // Those of a file that cannot be read are not of the next one.
    let found_elsewhere = beside::notes();
    let (desc, mut notes) = read?;
    notes.extend(found_elsewhere);
    Ok((format, desc, note::summed_up(notes)))
}

/// Loads a scene file like [`load_with`] with values for its variables, and puts a stage around it.
/// Without one, a model in which nothing emits light gets a studio, with a note.
///
/// # Errors
/// Fails like [`load_with`], for a variable that the file does not name, and for a model without
/// faces.
pub fn load_on_stage(
    path: &Path,
    missing: MissingTextures,
    stage: Option<Stage>,
    variables: &Variables,
) -> Result<(SceneDesc, Vec<Note>), SceneError> {
    let (format, mut desc, mut notes) = load_any(path, missing, variables)?;
    // A scene without entities may be meant; a mesh without faces is no mesh.
    let is_empty = |entity: &EntityDesc| matches!(&entity.shape, ShapeDesc::Mesh(mesh) if mesh.triangles.is_empty());
    if format.is_model && !desc.entities.is_empty() && desc.entities.iter().all(is_empty) {
        let first = notes.first();
        let first = first.map(|note| format!(" ({}: {})", note.place, note.message));
        let problem = format!("it has no faces to render{}", first.unwrap_or_default());
        return Err(SceneError::malformed(path, "whole file", problem));
    }
    match stage {
        Some(stage) => stage::set_up(&mut desc, stage),
        None if format.is_model && stage::is_unlit(&desc) => {
            stage::set_up(&mut desc, Stage::Studio);
            notes.push(Note::new(path, "lights", STUDIO));
        }
        None => {}
    }
    Ok((desc, notes))
}

/// Returns whether files of this name are models, which usually bring no light.
pub fn is_named_as_model(path: &Path) -> bool {
    let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
    let mut rows = FORMATS.iter().filter(|row| row.is_model);
    rows.any(|row| row.extensions.iter().any(|known| extension == *known))
}

/// Returns the format of a file, by its extension or its first bytes.
fn format_of(path: &Path) -> Result<&'static FormatRow, SceneError> {
    let extension = path
        .extension()
        .and_then(|e| e.to_str())
        .unwrap_or_default()
        .to_ascii_lowercase();
    if let Some(row) = FORMATS
        .iter()
        .find(|row| row.extensions.contains(&extension.as_str()))
    {
        return Ok(row);
    }
    let mut head = Vec::new();
    let (file, length) = open(path)?;
    file.take(SNIFF_BYTES.min(length))
        .read_to_end(&mut head)
        .map_err(|e| unreadable(path, e))?;
    FORMATS
        .iter()
        .find(|row| (row.sniff)(&head))
        .ok_or_else(|| unknown::unknown_format(path))
}

/// Returns whether a path is a folder that contains a scene.
pub fn is_folder(path: &Path) -> bool {
    path.is_dir() && path.join(folder::SCENE_FILE).is_file()
}

#[cfg(test)]
mod format_values;
#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_extensions_of_formats_are_unique() {
        let mut seen = std::collections::BTreeSet::new();
        for row in FORMATS {
            assert!(
                seen.insert(row.name) || row.extensions.contains(&row.name),
                "{}",
                row.name
            );
            assert!(!row.doc.is_empty() && !row.extensions.is_empty());
            for e in row.extensions {
                assert!(seen.insert(e) || *e == row.name);
                assert_eq!(*e, e.to_ascii_lowercase());
            }
        }
    }

    #[test]
    fn notes_on_files_found_elsewhere_are_of_the_scene_that_names_them() {
        let dir = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
        let mesh = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
        write("A.mtl", "newmtl m\nKd 1 0 0\n");
        write("cased.obj", &format!("mtllib a.mtl\nusemtl m\n{mesh}"));
        write(
            "damaged.obj",
            &format!("mtllib a.mtl\nusemtl m\n{mesh}f 1 2 9\n"),
        );
        write("plain.obj", mesh);
        let elsewhere = |name: &str| {
            let (_, notes) = load(&dir.path().join(name)).unwrap();
            notes
                .iter()
                .filter(|n| n.message.contains("is used"))
                .count()
        };
        assert_eq!(elsewhere("cased.obj"), 1);
        assert!(load(&dir.path().join("damaged.obj")).is_err());
        assert_eq!(elsewhere("plain.obj"), 0);
    }

    #[test]
    fn directories_and_missing_files_are_errors() {
        let dir = tempfile::tempdir().unwrap();
        let e = load(&dir.path().join("none.scn")).unwrap_err().to_string();
        assert!(e.contains("none.scn"), "{e}");
        std::fs::create_dir(dir.path().join("folder.obj")).unwrap();
        let e = load(&dir.path().join("folder.obj"))
            .unwrap_err()
            .to_string();
        assert!(e.contains("not a regular file"), "{e}");
        let text = dir.path().join("text.txt");
        std::fs::write(&text, "hello").unwrap();
        let e = load(&text).unwrap_err().to_string();
        assert!(e.contains(".json, .scn, .obj, .ply, .xml, .pbrt"), "{e}");
    }

    #[test]
    fn a_model_without_faces_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let text = dir.path().join("text.obj");
        std::fs::write(&text, "hello world\nv 0 0 0\n").unwrap();
        let stage = |text| load_on_stage(text, MissingTextures::Fail, None, &Variables::new());
        let e = stage(&text).unwrap_err().to_string();
        assert!(
            e.contains("no faces to render (line 1: not a statement of OBJ"),
            "{e}"
        );
        std::fs::write(&text, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
        assert!(stage(&text).is_ok());
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
    fn a_file_over_the_limit_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("big");
        std::fs::write(&path, vec![b' '; 100]).unwrap();
        assert_eq!(read_file(&path, 100).unwrap().len(), 100);
        assert!(read_file(&path, 99).is_err());
    }
}
