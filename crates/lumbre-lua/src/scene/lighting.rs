//! `s:light` and `s:environment`: lights of scenes.

use std::rc::Rc;

use glam::Vec3;
use mlua::{Lua, Value as LuaValue};

use super::schema::{ENVIRONMENT, POINT_LIGHT};
use super::{numbers, texture};
use crate::api::Args;
use crate::error::ScriptError;
use crate::kind::kind;
use crate::state::Shared;
use crate::strict::{self, Fields};
use lumbre_light::scene::desc::{
    ConeDesc, ConeEdge, EnvironmentDesc, EnvironmentSource, LightDesc, LightKind,
};
use lumbre_light::value::Value;
use lumbre_light::value::schema::SchemaError;

/// Implements `s:light`: adds a point, directional or spot light.
///
/// # Errors
/// Returns an error for an invalid combination of options or a duplicate name.
pub fn light(shared: &Rc<Shared>, _: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    args.at_most(shared, 1)?;
    let table = args.table(shared, 0, "options")?;
    let fields = strict::fields(&table, &POINT_LIGHT, "light", false)
        .map_err(|e| args.locate_error(shared, e))?;
    let kind = light_kind(shared, args, &fields)?;
    let mut builder = shared.scene.borrow_mut();
    let given = fields
        .values
        .get("name")
        .and_then(Value::as_str)
        .map(str::to_owned);
    let name = given.unwrap_or_else(|| format!("light_{}", builder.desc.lights.len() + 1));
    if builder.desc.lights.iter().any(|l| l.name == name) {
        return Err(args.error(shared, format!("a light `{name}` already exists"), None));
    }
    builder.desc.lights.push(LightDesc { name, kind });
    Ok(LuaValue::Nil)
}

/// Returns the kind of a light from the combination of its options.
fn light_kind(shared: &Shared, args: &Args, fields: &Fields) -> Result<LightKind, ScriptError> {
    let vector = |key: &str| fields.values.get(key).map(|v| Vec3::from(numbers::<3>(v)));
    let angle = |key: &str| {
        fields
            .values
            .get(key)
            .and_then(Value::as_f64)
            .map(|x| x as f32)
    };
    let angles = (angle("cutoff"), angle("beam"));
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
                        shared,
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
                return Err(args.error(shared, problem, None));
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
                return Err(args.error(shared, problem, None));
            }
        },
    )
}

/// Implements `s:environment`: sets the light from the environment.
///
/// # Errors
/// Returns an error for invalid options, an unreadable map, or a second environment.
pub fn environment(shared: &Rc<Shared>, _: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    args.at_most(shared, 1)?;
    let table = args.table(shared, 0, "options")?;
    let fields = strict::fields(&table, &ENVIRONMENT, "environment", false)
        .map_err(|e| args.locate_error(shared, e))?;
    let source = match (fields.values.get("color"), fields.objects.get("map")) {
        (Some(color), None) => EnvironmentSource::Color(Vec3::from(numbers::<3>(color))),
        (None, Some(map)) => match texture::texture_from_value(shared, args, map)? {
            Some(map) => EnvironmentSource::Map(map.texture),
            None => {
                let (path, key) = ("environment.map".to_owned(), "map".to_owned());
                let problem = format!(
                    "expected a texture or the name of an image, found {}",
                    kind(map)
                );
                return Err(args.locate_error(
                    shared,
                    SchemaError {
                        path,
                        problem,
                        help: None,
                        key,
                    },
                ));
            }
        },
        _ => return Err(args.error(shared, "expected either a `color` or a `map`", None)),
    };
    let number = |key: &str, default: f32| {
        fields
            .values
            .get(key)
            .and_then(Value::as_f64)
            .map_or(default, |x| x as f32)
    };
    let mut builder = shared.scene.borrow_mut();
    if builder.desc.environment.is_some() {
        return Err(args.error(shared, "called twice: a scene has one environment", None));
    }
    let (rotation_deg, scale) = (number("rotation", 0.0), number("scale", 1.0));
    builder.desc.environment = Some(EnvironmentDesc {
        source,
        rotation_deg,
        scale,
        sampling: Default::default(),
    });
    Ok(LuaValue::Nil)
}
