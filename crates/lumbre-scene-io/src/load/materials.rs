//! Materials of a scene while it is loaded, found by name.

use std::collections::BTreeMap;

use lumbre_light::scene::desc::MaterialDesc;

/// Materials in the order in which they were added.
#[derive(Default)]
pub(super) struct Materials {
    list: Vec<MaterialDesc>,
    /// Index of the first material with a name.
    indices: BTreeMap<String, usize>,
}

impl Materials {
    /// Adds a material.
    pub(super) fn push(&mut self, material: MaterialDesc) {
        let index = self.list.len();
        self.indices.entry(material.name.clone()).or_insert(index);
        self.list.push(material);
    }

    /// Returns the first material with a name.
    pub(super) fn get(&self, name: &str) -> Option<&MaterialDesc> {
        self.indices.get(name).map(|index| &self.list[*index])
    }

    /// Returns whether a material, or a part of it, has textures of more than one texel, or is
    /// anisotropic. Unknown materials are not.
    pub(super) fn is_oriented(&self, name: &str) -> bool {
        self.any_part(name, &|m| {
            m.anisotropic > 0.0 || m.textures.iter().any(|(_, t)| t.width * t.height > 1)
        })
    }

    /// Returns whether a material, or a part of it, passes a test. Unknown materials do not.
    pub(super) fn any_part(&self, name: &str, test: &dyn Fn(&MaterialDesc) -> bool) -> bool {
        self.get(name)
            .is_some_and(|m| test(m) || m.parts.iter().any(|part| self.any_part(part, test)))
    }

    /// Returns all materials.
    pub(super) fn into_vec(self) -> Vec<MaterialDesc> {
        self.list
    }
}
