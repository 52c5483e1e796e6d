//! `Material` and `MakeNamedMaterial` directives as they were read.

use std::collections::BTreeMap;
use std::rc::Rc;

use super::params::{Param, Params};
use super::spectrum::Spectra;
use super::texture::{self, Captured};
use super::version::Version;
use crate::load::composed::TextureValue;
use lumbre_light::scene::SceneError;

/// A `Material` or `MakeNamedMaterial` directive, which is converted when a shape uses it.
#[derive(Debug)]
pub(super) struct MaterialSource {
    /// Name in the file; empty for one without a name.
    pub name: String,
    /// Type: `diffuse`, `conductor` and others.
    pub class: String,
    /// Parameters of the directive.
    pub params: Params,
    /// Meaning of its spectra.
    pub spectra: Spectra,
    /// Textures that it refers to, as they were named when the directive was read.
    pub textures: Captured,
    /// Materials that it is a mix of, in version 3, as they were named then.
    pub parts: BTreeMap<String, Rc<MaterialSource>>,
}

impl MaterialSource {
    /// Returns whether it transmits everything.
    pub fn is_interface(&self) -> bool {
        matches!(self.class.as_str(), "interface" | "none" | "")
    }

    /// Returns the texture of a parameter that preceded the directive. In version 4, where every
    /// name has one value, textures may follow.
    pub(super) fn captured(
        &self,
        p: &Param,
        of_color: bool,
    ) -> Option<Result<TextureValue, SceneError>> {
        if p.ty != "texture" {
            return None;
        }
        let [name] = p.texts().ok()? else {
            return None;
        };
        let values = self.textures.get(name)?;
        match &values[usize::from(of_color)] {
            Some(value) => Some(Ok(value.clone())),
            None if self.spectra.version == Version::V4 => None,
            None => Some(Err(texture::unknown(p, name, of_color))),
        }
    }
}
