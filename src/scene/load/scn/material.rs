//! One entry of `materials`.

use std::sync::Arc;

use serde_json::Value as Json;

use super::reader::{Object, Report, number, numbers, shorten};
use crate::scene::SceneError;
use crate::scene::desc::{MATERIAL_PARAMS, MaterialDesc, TextureDesc, TextureSlot};
use crate::scene::load::images::Pictures;
use crate::scene::load::{Missing, missing_texture};
use crate::value::Value;
use crate::value::schema::Ty;

/// The textures of one scene, each file read once.
#[derive(Default)]
pub(super) struct Textures(Pictures);

impl Textures {
    /// The texture in the file that a key names, if the key is there.
    pub(super) fn load(
        &mut self,
        key: &str,
        object: &mut Object,
        report: &mut Report,
    ) -> Result<Option<Arc<TextureDesc>>, SceneError> {
        let Some((place, name)) = object.string(key, report)? else { return Ok(None) };
        let path = report.resolve(name);
        self.0.load(&path, &mut report.notes).map(Some).map_err(|e| report.named_at(&place, e))
    }

    /// The same for a slot of a material, which is named where the texture cannot be read. Where that is no error, the
    /// slot stays empty.
    fn of_material(
        &mut self,
        key: &str,
        material: &str,
        object: &mut Object,
        report: &mut Report,
    ) -> Result<Option<Arc<TextureDesc>>, SceneError> {
        let whose = || format!("texture of the material `{}`", shorten(material));
        let error = match self.load(key, object, report) {
            Err(SceneError::Malformed { file, place, problem }) => {
                SceneError::Malformed { file, place, problem: format!("{}: {problem}", whose()) }
            }
            other => return other,
        };
        match report.missing {
            Missing::Refused => Err(missing_texture(error)),
            Missing::Noted => {
                report.note(object.at(key), format!("{error}: the scalar value is used"));
                Ok(None)
            }
        }
    }
}

/// Reads a material. Radiance is `emission * color`, so the product is what the description stores; a light without a
/// colour is white. Emitters reflect nothing.
pub(super) fn read(
    path: &str,
    json: &Json,
    textures: &mut Textures,
    report: &mut Report,
) -> Result<MaterialDesc, SceneError> {
    let mut object = Object::new(path, json, report)?;
    let Some((_, name)) = object.string("name", report)? else {
        return Err(report.error(path, "a material needs a `name`"));
    };
    let mut material = MaterialDesc { emitter_reflects: false, ..MaterialDesc::new(name) };
    for row in MATERIAL_PARAMS {
        if let Some((place, json)) = object.take(row.scn_key) {
            let value = clamped(&place, json, &row.ty, report)?;
            row.set(&mut material, &place, &value).map_err(|e| report.error(e.path, e.problem))?;
        }
        if let Some(slot) = row.texture
            && let Some(texture) = textures.of_material(row.scn_texture_key, &material.name, &mut object, report)?
        {
            material.textures.push((slot, texture));
        }
    }
    material.textures.sort_by_key(|(slot, _)| *slot);
    let rows = MATERIAL_PARAMS.iter().flat_map(|r| [r.scn_key, r.scn_texture_key]);
    let known = rows.chain(["name"]).filter(|k| !k.is_empty());
    object.note_unknown(known, report);
    shine(path, &mut material, report);
    Ok(material)
}

/// The colour of a light and its albedo texture both multiply what it emits.
fn shine(path: &str, material: &mut MaterialDesc, report: &mut Report) {
    material.emission *= material.base_color;
    if material.emission == glam::Vec3::ZERO {
        return;
    }
    let Some(albedo) = material.texture(TextureSlot::BaseColor).cloned() else { return };
    if material.texture(TextureSlot::Emission).is_some() {
        report.note(
            format!("{path}.albedotexture"),
            "a light has one texture, and this one has an `emissiontexture` too: ignored",
        );
    } else {
        material.textures.push((TextureSlot::Emission, albedo));
        material.textures.sort_by_key(|(slot, _)| *slot);
    }
}

/// The value of a parameter, moved into its range with a note where it lies outside.
fn clamped(place: &str, json: &Json, ty: &Ty, report: &mut Report) -> Result<Value, SceneError> {
    match ty {
        Ty::Nums { len, min, max } => {
            let xs = match len {
                2 => numbers::<2>(place, json, report)?.to_vec(),
                _ => numbers::<3>(place, json, report)?.to_vec(),
            };
            let item = |(i, x): (usize, &f64)| clamp(&format!("{place}[{i}]"), *x, *min, *max, report);
            Ok(Value::List(xs.iter().enumerate().map(item).collect()))
        }
        Ty::Num { min, max } => {
            let x = number(place, json, report)?;
            Ok(clamp(place, x, *min, *max, report))
        }
        _ => Ok(Value::from_json(json)),
    }
}

fn clamp(place: &str, x: f64, min: f64, max: f64, report: &mut Report) -> Value {
    let inside = x.clamp(min, max);
    if inside != x {
        report.note(place, format!("{x} is outside {min} to {max}: {inside} is used"));
    }
    Value::number(inside)
}
