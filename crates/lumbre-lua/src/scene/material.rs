//! `s:material`: declares a material from the parameters of [`MATERIAL_PARAMS`] and the texture
//! slots, optionally based on another material.

use mlua::Value as LuaValue;

use super::texture;
use crate::api::Args;
use crate::error::ScriptError;
use crate::kind::kind;
use crate::strict;
use lumbre_light::scene::desc::{MATERIAL_PARAMS, MaterialDesc, TextureSlot};
use lumbre_light::value::Value;
use lumbre_light::value::schema::{SchemaError, Ty, unknown_name};

lumbre_light::table! {
    /// Options of `s:material` besides parameters and textures.
    pub const MATERIAL_OPTIONS = "MaterialOptions", "Options of a material besides its parameters.";
    from = "white and rough": Ty::Str,
        "name of a material of the scene whose values are the defaults";
    emitter_reflects = "true": Ty::Bool, "whether an emitting surface also reflects light";
}

/// Implements `s:material`: adds a material to the scene.
///
/// # Errors
/// Returns an error for a duplicate name, an unknown parameter or base, or an invalid value.
pub fn material(args: &Args) -> Result<LuaValue, ScriptError> {
    let name = args.text(0, "name")?;
    let table = args.table(1, "options")?;
    let known = args.shared.scene.borrow().desc.material_index(&name);
    if name.is_empty() || known.is_some() {
        let problem = if name.is_empty() {
            "a material needs a name".to_owned()
        } else {
            format!("a material `{name}` already exists")
        };
        return Err(args.error(problem, None));
    }
    let path = format!("materials.{name}");
    let fields =
        strict::fields(&table, &MATERIAL_OPTIONS, &path, true).map_err(|e| args.locate_error(e))?;
    let mut made = match fields.text("from") {
        None => MaterialDesc::new(&name),
        Some(base) => {
            let scene = args.shared.scene.borrow();
            let Some(row) = scene.desc.material_index(base) else {
                let known = scene.desc.materials.iter().map(|m| m.name.as_str());
                return Err(args.locate_error(unknown_name(
                    &format!("{path}.from"),
                    base,
                    "material",
                    known,
                )));
            };
            MaterialDesc {
                name: name.clone(),
                ..scene.desc.materials[row].clone()
            }
        }
    };
    if let Some(Value::Bool(reflects)) = fields.values.get("emitter_reflects") {
        made.emitter_reflects = *reflects;
    }
    for (key, value) in &fields.extra {
        set(args, &mut made, &path, key, value)?;
    }
    args.shared.scene.borrow_mut().desc.materials.push(made);
    Ok(LuaValue::Nil)
}

/// Sets one parameter or texture of a material.
fn set(
    args: &Args,
    material: &mut MaterialDesc,
    path: &str,
    key: &str,
    value: &LuaValue,
) -> Result<(), ScriptError> {
    let at = format!("{path}.{key}");
    if let Some(row) = MATERIAL_PARAMS.iter().find(|row| row.name == key) {
        let value = strict::read(value, &at, key).map_err(|e| args.locate_error(e))?;
        row.ty
            .check(&at, key, &value)
            .map_err(|e| args.locate_error(e))?;
        return row
            .set(material, &at, &value)
            .map_err(|e| args.locate_error(e));
    }
    let Some(slot) = TextureSlot::from_name(key) else {
        let slots = TextureSlot::ALL.into_iter().map(TextureSlot::name);
        let options = MATERIAL_OPTIONS.fields.iter().map(|f| f.key);
        let known = MATERIAL_PARAMS
            .iter()
            .map(|row| row.name)
            .chain(slots)
            .chain(options);
        return Err(args.locate_error(unknown_name(&at, key, "material parameter", known)));
    };
    match texture::texture_from_value(args, value)? {
        Some(texture::TextureObject { texture, lookup }) => {
            material.set_mapped_texture(slot, texture, lookup)
        }
        None => {
            let problem = format!(
                "expected a texture or the name of an image, found {}",
                kind(value)
            );
            let help = Some("use texture.file(\"wood.png\") or texture.paint { .. }".to_owned());
            return Err(args.locate_error(SchemaError {
                path: at,
                problem,
                help,
                key: key.to_owned(),
            }));
        }
    }
    Ok(())
}
