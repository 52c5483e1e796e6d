//! Names of textures and materials: one meaning for the whole file in version 4; in version 3 that
//! of the last directive, up to the end of its block.

use std::collections::BTreeMap;
use std::rc::Rc;

use super::material_source::MaterialSource;
use super::params::Params;
use super::state::MaterialRef;
use super::version::Version;
use super::{Loader, token};
use lumbre_light::scene::SceneError;

/// Marks of the names of textures and materials.
#[derive(Clone, Copy, Debug)]
pub(super) struct NameMarks {
    textures: [usize; 2],
    materials: usize,
}

impl Loader {
    /// Returns a material by its name in the file.
    pub(super) fn named_material(
        &self,
        name: &str,
        params: &Params,
    ) -> Result<Rc<MaterialSource>, SceneError> {
        self.named.get(name).cloned().ok_or_else(|| {
            let shown = token::truncated(name);
            params.error(format!("no material with the name `{shown}` precedes"))
        })
    }

    /// Returns marks of the names of textures and materials.
    pub(super) fn name_marks(&self) -> NameMarks {
        NameMarks {
            textures: self.textures.marks(),
            materials: self.named.mark(),
        }
    }

    /// Restores the names of textures and materials to those at marks.
    pub(super) fn restore_names(&mut self, marks: NameMarks) {
        self.textures.restore(marks.textures);
        self.named.restore(marks.materials);
    }

    /// Returns the material that a `NamedMaterial` selects: in version 3 what the name means there,
    /// in version 4, where names have one meaning, one that may follow.
    pub(super) fn material_ref(&self, name: String) -> MaterialRef {
        let known = self
            .named
            .get(&name)
            .filter(|_| self.version == Version::V3);
        known.map_or(MaterialRef::Named(name), |source| {
            MaterialRef::Own(source.clone())
        })
    }

    /// Returns the materials that a mix of version 3 names, as far as they precede.
    pub(super) fn parts_of(&self, params: &Params) -> BTreeMap<String, Rc<MaterialSource>> {
        let names = ["namedmaterial1", "namedmaterial2"]
            .into_iter()
            .filter(|_| self.version == Version::V3)
            .filter_map(|key| params.text(key).ok().flatten());
        names
            .filter_map(|name| Some((name.to_owned(), self.named.get(name)?.clone())))
            .collect()
    }
}
