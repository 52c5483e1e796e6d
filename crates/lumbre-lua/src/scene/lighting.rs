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
    ConeDesc, ConeEdge, EnvironmentDesc, EnvironmentSource, LightDesc, LightKind, SpotImage,
    TextureDesc,
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
        if let Some(direction) = vector("direction") {
            return projector(args, fields, [position, direction, intensity], map);
        }
        let others = ["irradiance", "cutoff", "beam", "angle", "up"];
        if let Some(other) = others.iter().find(|key| fields.values.contains_key(**key)) {
            let problem = format!("a light with a `map` and no `direction` has no `{other}`");
            return Err(args.error(problem, None));
        }
        return Ok(LightKind::Goniometric {
            position,
            intensity,
            map,
            rotation_deg: angle("rotation").unwrap_or(0.0),
        });
    }
    let of_maps = ["rotation", "angle", "up"];
    if let Some(key) = of_maps.iter().find(|key| fields.values.contains_key(**key)) {
        return Err(args.error(format!("`{key}` applies to lights with a `map`"), None));
    }
    Ok(
        match (
            vector("position"),
            vector("intensity"),
            vector("direction"),
            vector("irradiance"),
        ) {
            (Some(position), Some(intensity), Some(direction), None) => LightKind::Spot {
                position,
                direction,
                intensity,
                cone: cone(args, fields, 20.0)?,
                image: None,
            },
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

/// Returns a spot light that projects an image.
fn projector(
    args: &Args,
    fields: &Fields,
    [position, direction, intensity]: [Vec3; 3],
    map: Arc<TextureDesc>,
) -> Result<LightKind, ScriptError> {
    if let Some(key) = ["irradiance", "rotation"]
        .iter()
        .find(|key| fields.values.contains_key(**key))
    {
        let problem = format!("a light with a `map` and a `direction` has no `{key}`");
        return Err(args.error(problem, None));
    }
    let up = fields.numbers("up").map_or(Vec3::Y, Vec3::from_array);
    let angle = fields.f32("angle").unwrap_or(SpotImage::ANGLE as f32);
    let image = SpotImage::projected(map, direction, up, angle);
    let cone = match fields.f32("cutoff") {
        Some(cutoff) => cone(args, fields, cutoff)?,
        None => image.cone(),
    };
    Ok(LightKind::Spot {
        position,
        direction,
        intensity,
        cone,
        image: Some(image),
    })
}

/// Returns the cone of a spot light, which has this cutoff by default.
fn cone(args: &Args, fields: &Fields, cutoff: f32) -> Result<ConeDesc, ScriptError> {
    let cutoff_deg = fields.f32("cutoff").unwrap_or(cutoff);
    let cone = ConeDesc {
        beam_deg: fields.f32("beam").unwrap_or(0.75 * cutoff_deg),
        cutoff_deg,
        edge: ConeEdge::Linear,
    };
    if cone.is_possible() {
        return Ok(cone);
    }
    Err(args.error(
        "the `beam` of a spot light must not exceed its `cutoff`",
        None,
    ))
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
