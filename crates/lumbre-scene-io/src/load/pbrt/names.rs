//! Names of textures and materials: one meaning for the whole file in version 4; in version 3 that
//! of the last directive, up to the end of its block.

use std::collections::BTreeMap;
use std::rc::Rc;

use super::material::MaterialSource;
use super::params::Params;
use super::state::MaterialRef;
use super::{Loader, Version, token};
use lumbre_light::scene::SceneError;

/// Marks of the names of textures and materials.
#[derive(Clone, Copy, Debug)]
pub(super) struct NameMarks {
    textures: [usize; 2],
    materials: usize,
}

/// Values by name, of which those since a mark can be taken back.
#[derive(Debug)]
pub(super) struct Scoped<T> {
    values: BTreeMap<String, T>,
    /// Names that were set, each with its value before.
    changes: Vec<(String, Option<T>)>,
}

impl<T> Default for Scoped<T> {
    fn default() -> Scoped<T> {
        Scoped {
            values: BTreeMap::new(),
            changes: Vec::new(),
        }
    }
}

impl<T> Scoped<T> {
    /// Returns the value of a name.
    pub fn get(&self, name: &str) -> Option<&T> {
        self.values.get(name)
    }

    /// Sets the value of a name.
    pub fn insert(&mut self, name: String, value: T) {
        let before = self.values.insert(name.clone(), value);
        self.changes.push((name, before));
    }

    /// Returns a mark for [`Scoped::restore`].
    pub fn mark(&self) -> usize {
        self.changes.len()
    }

    /// Restores the values of all names to those at a mark.
    pub fn restore(&mut self, mark: usize) {
        for (name, before) in self.changes.drain(mark.min(self.changes.len())..).rev() {
            match before {
                Some(value) => self.values.insert(name, value),
                None => self.values.remove(&name),
            };
        }
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_set_since_a_mark_are_taken_back() {
        let mut names = Scoped::default();
        names.insert("a".to_owned(), 1);
        let outer = names.mark();
        names.insert("a".to_owned(), 2);
        let inner = names.mark();
        names.insert("b".to_owned(), 3);
        names.insert("a".to_owned(), 4);
        names.restore(inner);
        assert_eq!((names.get("a"), names.get("b")), (Some(&2), None));
        names.restore(outer);
        assert_eq!(names.get("a"), Some(&1));
        names.restore(0);
        assert_eq!(names.get("a"), None);
    }
}
