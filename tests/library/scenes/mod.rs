//! Scenes from file to compiled arrays: third-party files, the built-in scenes, damaged files, and
//! edits.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "test helpers may panic and print"
)]

mod builtin;
mod cameras;
mod damaged;
mod edit;
mod export;
mod export_pbrt;
mod folder;
mod gltf;
mod gltf_compressed;
mod gltf_defaults;
mod gltf_instances;
mod gltf_materials;
mod gltf_motion;
mod growth;
mod growth_files;
mod hostile;
mod hostile_cases;
mod hostile_pbrt;
mod lights;
mod meter;
mod mitsuba;
mod mitsuba_damaged;
mod mitsuba_files;
mod mitsuba_legacy;
mod mitsuba_sky;
mod nothing_silent;
mod obj;
mod obj_state;
mod pbrt;
mod pbrt_content;
mod pbrt_names;
mod places;
mod ply;
mod samples;
mod scn;
mod textures;
mod third_party;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use lumbre_light::scene::desc::{MeshDesc, ShapeDesc};
use lumbre_light::scene::{Note, SceneDesc, SceneError};
use lumbre_scene_io::load::load;
use samples::QUAD;

/// A temporary folder of small files.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new<B: AsRef<[u8]>>(files: &[(&str, B)]) -> Folder {
        let folder = Folder(tempfile::tempdir().unwrap());
        files
            .iter()
            .for_each(|(name, bytes)| folder.write(name, bytes));
        folder
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn load(&self, name: &str) -> Result<(SceneDesc, Vec<Note>), SceneError> {
        load(&self.path(name))
    }
}

/// Loads a scene from its text.
fn scn(text: &str) -> Result<(SceneDesc, Vec<Note>), SceneError> {
    Folder::new(&[("a.scn", text)]).load("a.scn")
}

/// Returns the mesh of an entity.
fn mesh_of(desc: &SceneDesc, entity: usize) -> &Arc<MeshDesc> {
    match &desc.entities[entity].shape {
        ShapeDesc::Mesh(mesh) => mesh,
        ShapeDesc::Sphere { .. } => panic!("expected a mesh"),
    }
}

/// Returns the notes as text, one line each.
fn lines(notes: &[Note]) -> String {
    notes
        .iter()
        .map(|n| format!("{}: {}\n", n.place, n.message))
        .collect()
}

/// Returns the path of a file or folder of the built-in scenes.
fn builtin_path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("scenes")
        .join(name)
}

/// Counts the bytes that each thread allocates, to check memory limits.
#[global_allocator]
static METER: meter::Meter = meter::Meter;
