//! Materials of `.scn`: one entry of `materials`.

use std::sync::Arc;

use serde_json::Value as Json;

use super::reader::{Diagnostics, JsonObject, number, numbers, truncated};
use crate::load::images::ImageCache;
use crate::load::{MissingTextures, with_lenient_hint};
use lumbre_light::scene::SceneError;
use lumbre_light::scene::desc::{MATERIAL_PARAMS, MaterialDesc, TextureDesc, TextureSlot};
use lumbre_light::value::Value;
use lumbre_light::value::schema::Ty;

/// The texture files of one scene, each read once.
#[derive(Default)]
pub(super) struct TextureFiles(ImageCache);

impl TextureFiles {
    /// Loads the texture that a key refers to, if the key is present.
    pub(super) fn load(
        &mut self,
        key: &str,
        object: &mut JsonObject,
        diagnostics: &mut Diagnostics,
    ) -> Result<Option<Arc<TextureDesc>>, SceneError> {
        let Some((place, name)) = object.string(key, diagnostics)? else {
            return Ok(None);
        };
        let path = diagnostics.resolve(name);
        self.0
            .load(&path, &mut diagnostics.notes)
            .map(Some)
            .map_err(|e| diagnostics.at_reference(&place, e))
    }

    /// Loads a texture of a material like [`TextureFiles::load`]; errors name the material. If the
    /// policy allows unreadable textures, returns `None` with a note instead.
    fn load_for_material(
        &mut self,
        key: &str,
        material: &str,
        object: &mut JsonObject,
        diagnostics: &mut Diagnostics,
    ) -> Result<Option<Arc<TextureDesc>>, SceneError> {
        let subject = || format!("texture of the material `{}`", truncated(material));
        let error = match self.load(key, object, diagnostics) {
            Err(SceneError::Malformed {
                file,
                place,
                problem,
            }) => SceneError::malformed(file, place, format!("{}: {problem}", subject())),
            other => return other,
        };
        match diagnostics.missing {
            MissingTextures::Fail => Err(with_lenient_hint(error)),
            MissingTextures::Note => {
                diagnostics.note(
                    object.key_path(key),
                    format!("{error}; the material's constant value is used"),
                );
                Ok(None)
            }
        }
    }
}

/// Reads a material. The emitted radiance is `emission * color`, which is stored as the emission; a
/// light without a colour is white. Emitters do not reflect.
pub(super) fn read(
    path: &str,
    json: &Json,
    textures: &mut TextureFiles,
    diagnostics: &mut Diagnostics,
) -> Result<MaterialDesc, SceneError> {
    let mut object = JsonObject::new(path, json, diagnostics)?;
    let Some((_, name)) = object.string("name", diagnostics)? else {
        return Err(diagnostics.error(path, "a material needs a `name`"));
    };
    let mut material = MaterialDesc {
        emitter_reflects: false,
        ..MaterialDesc::new(name)
    };
    for row in MATERIAL_PARAMS {
        if let Some((place, json)) = object.get(row.scn_key) {
            let value = clamped(&place, json, &row.ty, diagnostics)?;
            row.set(&mut material, &place, &value)
                .map_err(|e| diagnostics.error(e.path, e.problem))?;
        }
        if let Some(slot) = row.texture
            && let Some(texture) = textures.load_for_material(
                row.scn_texture_key,
                &material.name,
                &mut object,
                diagnostics,
            )?
        {
            material.textures.push((slot, texture));
        }
    }
    material.textures.sort_by_key(|(slot, _)| *slot);
    let known = MATERIAL_PARAMS
        .iter()
        .flat_map(|row| [row.scn_key, row.scn_texture_key])
        .chain(["name"])
        .filter(|key| !key.is_empty());
    object.note_unknown(known, diagnostics);
    multiply_emission(path, &mut material, diagnostics);
    Ok(material)
}

/// Multiplies the emission by the colour, and uses the albedo texture as emission texture.
fn multiply_emission(path: &str, material: &mut MaterialDesc, diagnostics: &mut Diagnostics) {
    material.emission *= material.base_color;
    if material.emission == glam::Vec3::ZERO {
        return;
    }
    let Some(albedo) = material.texture(TextureSlot::BaseColor).cloned() else {
        return;
    };
    if material.texture(TextureSlot::Emission).is_some() {
        diagnostics.note(
            format!("{path}.albedotexture"),
            "the texture of a light multiplies its emission, but this one has an `emissiontexture` \
             too; ignored",
        );
    } else {
        material.textures.push((TextureSlot::Emission, albedo));
        material.textures.sort_by_key(|(slot, _)| *slot);
    }
}

/// Returns the value of a parameter, clamped to its range with a note.
fn clamped(
    place: &str,
    json: &Json,
    ty: &Ty,
    diagnostics: &mut Diagnostics,
) -> Result<Value, SceneError> {
    match ty {
        Ty::Nums { len, min, max } => {
            let xs = match len {
                2 => numbers::<2>(place, json, diagnostics)?.to_vec(),
                _ => numbers::<3>(place, json, diagnostics)?.to_vec(),
            };
            let item = |(i, x): (usize, &f64)| {
                clamp(&format!("{place}[{i}]"), *x, *min, *max, diagnostics)
            };
            Ok(Value::List(xs.iter().enumerate().map(item).collect()))
        }
        Ty::Num { min, max } => {
            let x = number(place, json, diagnostics)?;
            Ok(clamp(place, x, *min, *max, diagnostics))
        }
        _ => Ok(Value::from_json(json)),
    }
}

/// Returns a number clamped to a range, with a note if it was outside.
fn clamp(place: &str, x: f64, min: f64, max: f64, diagnostics: &mut Diagnostics) -> Value {
    let inside = x.clamp(min, max);
    if inside != x {
        diagnostics.note(
            place,
            format!("{x} is outside {min} to {max}; {inside} is used"),
        );
    }
    Value::number(inside)
}
