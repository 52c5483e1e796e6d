//! Materials by name, and errors that name a place in a file.

use std::path::Path;

use crate::scene::Note;
use crate::scene::desc::{MaterialNames, SceneDesc};

/// Finds materials by name, and notes each unknown name.
pub(super) struct MaterialResolver<'a> {
    pub desc: &'a SceneDesc,
    names: MaterialNames<'a>,
    pub notes: Vec<Note>,
}

impl<'a> MaterialResolver<'a> {
    /// Finds materials of a scene, and adds to these notes.
    pub fn new(desc: &'a SceneDesc, notes: Vec<Note>) -> MaterialResolver<'a> {
        MaterialResolver {
            names: desc.material_names(),
            desc,
            notes,
        }
    }

    /// Returns the index of the material, or 0 with a note if the name is unknown.
    pub fn index(&mut self, name: &str, file: &Path, place: &str) -> u32 {
        if let Some(i) = self.names.index(name) {
            return i as u32;
        }
        self.notes.push(Note::new(
            file,
            place,
            format!("no material is named `{name}`; the first material is used"),
        ));
        0
    }
}
