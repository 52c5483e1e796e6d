//! `s:light` and `s:environment`: lights of scenes.

use std::sync::Arc;

use glam::Vec3;
use mlua::Value as LuaValue;

use super::schema::{ENVIRONMENT, POINT_LIGHT};
use super::texture;
use crate::api::Args;
use crate::error::ScriptError;
use crate::kind::kind;
use crate::strict::Fields;
use lumbre_light::scene::desc::{
    ConeDesc, ConeEdge, EnvironmentDesc, EnvironmentSource, LightDesc, LightKind, TextureDesc,
};
use lumbre_light::value::schema::SchemaError;

/// Implements `s:light`: adds a point, directional, spot or goniometric light.
///
/// # Errors
/// Returns an error for an invalid combination of options or a duplicate name.
pub fn light(args: &Args) -> Result<LuaValue, ScriptError> {
    let fields = args.fields(0, "options", &POINT_LIGHT, "light")?;
    let kind = light_kind(args, &fields)?;
    let mut builder = args.shared.scene.borrow_mut();
    let given = fields.text("name").map(str::to_owned);
    let name = given.unwrap_or_else(|| format!("light_{}", builder.desc.lights.len() + 1));
    if builder.desc.lights.iter().any(|l| l.name == name) {
        return Err(args.error(format!("a light `{name}` already exists"), None));
    }
    let mut light = LightDesc::new(name, kind);
    if let Some(position) = super::part::place(&fields, "position") {
        light.place(position);
    }
    builder.desc.lights.push(light);
    Ok(LuaValue::Nil)
}

/// Returns the kind of a light from the combination of its options.
fn light_kind(args: &Args, fields: &Fields) -> Result<LightKind, ScriptError> {
    let vector = |key: &str| fields.numbers(key).map(Vec3::from_array);
    let angle = |key: &str| fields.f32(key);
    let angles = (angle("cutoff"), angle("beam"));
    let map = match fields.objects.get("map") {
        Some(map) => Some(map_texture(args, map, "light.map")?),
        None => None,
    };
    if let Some(map) = map {
        let (Some(position), Some(intensity)) = (vector("position"), vector("intensity")) else {
            let problem = "a light with a `map` needs `position` and `intensity`";
            return Err(args.error(problem, None));
        };
        let others = ["direction", "irradiance", "cutoff", "beam"];
        if let Some(other) = others.iter().find(|key| fields.values.contains_key(**key)) {
            let problem = format!("a light with a `map` has no `{other}`");
            return Err(args.error(problem, None));
        }
        return Ok(LightKind::Goniometric {
            position,
            intensity,
            map,
            rotation_deg: angle("rotation").unwrap_or(0.0),
        });
    }
    if angle("rotation").is_some() {
        return Err(args.error("`rotation` applies to lights with a `map`", None));
    }
    Ok(
        match (
            vector("position"),
            vector("intensity"),
            vector("direction"),
            vector("irradiance"),
        ) {
            (Some(position), Some(intensity), Some(direction), None) => {
                let cutoff_deg = angles.0.unwrap_or(20.0);
                let cone = ConeDesc {
                    beam_deg: angles.1.unwrap_or(0.75 * cutoff_deg),
                    cutoff_deg,
                    edge: ConeEdge::Linear,
                };
                if !cone.is_possible() {
                    return Err(args.error(
                        "the `beam` of a spot light must not exceed its `cutoff`",
                        None,
                    ));
                }
                LightKind::Spot {
                    position,
                    direction,
                    intensity,
                    cone,
                }
            }
            _ if angles != (None, None) => {
                let problem = "`cutoff` and `beam` apply to spot lights, which need `position`, \
                           `direction` and `intensity`";
                return Err(args.error(problem, None));
            }
            (Some(position), Some(intensity), None, None) => LightKind::Point {
                position,
                intensity,
            },
            (None, None, Some(direction), Some(irradiance)) => LightKind::Directional {
                direction,
                irradiance,
            },
            _ => {
                let problem = "expected `position` and `intensity` (and `direction` for a spot light), \
                           or `direction` and `irradiance`";
                return Err(args.error(problem, None));
            }
        },
    )
}

/// Returns the texture of a map of directions, which is the option with this path.
///
/// # Errors
/// Returns an error for a value that is no texture, and for an unreadable file.
fn map_texture(args: &Args, map: &LuaValue, path: &str) -> Result<Arc<TextureDesc>, ScriptError> {
    if let Some(map) = texture::texture_from_value(args, map)? {
        return Ok(map.texture);
    }
    let problem = format!(
        "expected a texture or the name of an image, found {}",
        kind(map)
    );
    let key = "map".to_owned();
    Err(args.locate_error(SchemaError::new(path.to_owned(), key, problem)))
}

/// Implements `s:environment`: sets the light from the environment.
///
/// # Errors
/// Returns an error for invalid options, an unreadable map, or a second environment.
pub fn environment(args: &Args) -> Result<LuaValue, ScriptError> {
    let fields = args.fields(0, "options", &ENVIRONMENT, "environment")?;
    let source = match (fields.numbers("color"), fields.objects.get("map")) {
        (Some(color), None) => EnvironmentSource::Color(Vec3::from_array(color)),
        (None, Some(map)) => EnvironmentSource::Map(map_texture(args, map, "environment.map")?),
        _ => return Err(args.error("expected either a `color` or a `map`", None)),
    };
    let number = |key: &str, default: f32| fields.f64(key).map_or(default, |x| x as f32);
    let mut builder = args.shared.scene.borrow_mut();
    if builder.desc.environment.is_some() {
        return Err(args.error("called twice: a scene has one environment", None));
    }
    let (rotation_deg, scale) = (number("rotation", 0.0), number("scale", 1.0));
    builder.desc.environment = Some(EnvironmentDesc {
        rotation_deg,
        scale,
        ..EnvironmentDesc::new(source)
    });
    Ok(LuaValue::Nil)
}
