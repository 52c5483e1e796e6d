//! `lights` and `environment` of `.scn`: additions of Lumbre, since the lights of the original
//! format are emissive entities.

use glam::Vec3;
use serde_json::Value as Json;

use super::material::TextureFiles;
use super::reader::{Diagnostics, JsonObject, numbers};
use crate::names::UniqueNames;
use lumbre_light::scene::SceneError;
use lumbre_light::scene::desc::{
    ConeDesc, ConeEdge, EnvironmentDesc, EnvironmentSource, LightDesc, LightKind, SpotImage,
};

const LIGHT_TYPES: [&str; 4] = ["point", "directional", "spot", "goniometric"];

/// Reads one entry of `lights`.
pub(super) fn read(
    place: &str,
    json: &Json,
    names: &mut UniqueNames,
    textures: &mut TextureFiles,
    diagnostics: &mut Diagnostics,
) -> Result<LightDesc, SceneError> {
    let mut object = JsonObject::new(place, json, diagnostics)?;
    let Some((at, what)) = object.string("type", diagnostics)? else {
        let problem = "a light needs a `type`: point, directional, spot or goniometric";
        return Err(diagnostics.error(place, problem));
    };
    let given = object
        .string("name", diagnostics)?
        .map(|(_, name)| name.to_owned());
    let Some([vector_key, color_key]) = required_keys(what) else {
        let problem = super::unknown_type("light", what, &LIGHT_TYPES);
        return Err(diagnostics.error(at, problem));
    };
    let missing = |key: &str, diagnostics: &Diagnostics| {
        diagnostics.error(place, format!("a {what} light needs `{key}`"))
    };
    let point = object
        .point(vector_key, diagnostics)?
        .ok_or_else(|| missing(vector_key, diagnostics))?;
    let vector = point.as_vec3();
    let color = color(color_key, &mut object, diagnostics)?
        .ok_or_else(|| missing(color_key, diagnostics))?;
    let kind = match what {
        "point" => LightKind::Point {
            position: vector,
            intensity: color,
        },
        "spot" => {
            let direction = object
                .vec3("direction", diagnostics)?
                .ok_or_else(|| missing("direction", diagnostics))?;
            let image = projected(direction, &mut object, textures, diagnostics)?;
            LightKind::Spot {
                position: vector,
                direction,
                intensity: color,
                cone: cone(place, direction, image.as_ref(), &mut object, diagnostics)?,
                image,
            }
        }
        "goniometric" => LightKind::Goniometric {
            position: vector,
            intensity: color,
            map: textures
                .load("map", &mut object, diagnostics)?
                .ok_or_else(|| missing("map", diagnostics))?,
            rotation_deg: rotation(&mut object, diagnostics)?,
        },
        _ if vector == Vec3::ZERO => {
            return Err(diagnostics.error(
                object.key_path(vector_key),
                "a direction needs a length above zero",
            ));
        }
        _ => LightKind::Directional {
            direction: vector,
            irradiance: color,
        },
    };
    let known = ["type", "name", vector_key, color_key];
    object.note_unknown(
        known.into_iter().chain([
            "direction",
            "cutoff",
            "beam",
            "map",
            "rotation",
            "angle",
            "up",
        ]),
        diagnostics,
    );
    let name = super::unique_name(names, given.as_deref(), what, place, diagnostics);
    Ok(LightDesc::placed(name, kind, point))
}

/// Returns the keys of vector and colour that a type of light needs, or `None` for an unknown type.
fn required_keys(light_type: &str) -> Option<[&'static str; 2]> {
    match light_type {
        "point" | "spot" | "goniometric" => Some(["position", "intensity"]),
        "directional" => Some(["direction", "irradiance"]),
        _ => None,
    }
}

/// Reads the image that a spot light projects: `map`, with the `angle` of its width, and `up`.
fn projected(
    direction: Vec3,
    object: &mut JsonObject,
    textures: &mut TextureFiles,
    diagnostics: &mut Diagnostics,
) -> Result<Option<SpotImage>, SceneError> {
    let Some(texture) = textures.load("map", object, diagnostics)? else {
        return Ok(None);
    };
    let (at, angle) = object
        .number("angle", diagnostics)?
        .unwrap_or_else(|| (String::new(), SpotImage::ANGLE));
    if !(angle > 0.0 && angle < 179.0) {
        return Err(diagnostics.error(
            at,
            "the angle of an image must be between 0 and 179 degrees",
        ));
    }
    let up = object.vec3("up", diagnostics)?.unwrap_or(Vec3::Y);
    let image = SpotImage::projected(texture, direction, up, angle as f32);
    Ok(Some(image))
}

/// Reads the cone of a spot light. That of one with an image contains the image by default.
fn cone(
    place: &str,
    direction: Vec3,
    image: Option<&SpotImage>,
    object: &mut JsonObject,
    diagnostics: &Diagnostics,
) -> Result<ConeDesc, SceneError> {
    let cutoff = object.number("cutoff", diagnostics)?;
    if let (None, Some(image)) = (&cutoff, image) {
        return Ok(image.cone());
    }
    let cutoff_deg = cutoff.map_or(20.0, |(_, x)| x as f32);
    let beam_deg = object
        .number("beam", diagnostics)?
        .map_or(0.75 * cutoff_deg, |(_, x)| x as f32);
    let cone = ConeDesc {
        beam_deg,
        cutoff_deg,
        edge: ConeEdge::Linear,
    };
    if direction == Vec3::ZERO || !cone.is_possible() {
        let problem = "a spot needs a `direction`, a `cutoff` below 180 degrees and a `beam` of at \
                       most the cutoff";
        return Err(diagnostics.error(place, problem));
    }
    Ok(cone)
}

/// Reads the object `environment`.
pub(super) fn environment(
    place: &str,
    json: &Json,
    textures: &mut TextureFiles,
    diagnostics: &mut Diagnostics,
) -> Result<EnvironmentDesc, SceneError> {
    let mut object = JsonObject::new(place, json, diagnostics)?;
    let map = textures.load("file", &mut object, diagnostics)?;
    let color = color("color", &mut object, diagnostics)?;
    let source = match (map, color) {
        (Some(map), None) => EnvironmentSource::Map(map),
        (None, Some(color)) => EnvironmentSource::Color(color),
        (Some(_), Some(_)) => {
            return Err(diagnostics.error(
                place,
                "`file` and `color` of an environment exclude each other; give only one of them",
            ));
        }
        (None, None) => {
            return Err(diagnostics.error(place, "an environment needs a `file` or a `color`"));
        }
    };
    let rotation_deg = rotation(&mut object, diagnostics)?;
    let scale = match object.number("scale", diagnostics)? {
        Some((at, scale)) if !(0.0..=f64::from(f32::MAX)).contains(&scale) => {
            return Err(
                diagnostics.error(at, format!("expected a number of 0 or more, found {scale}"))
            );
        }
        Some((_, scale)) => scale as f32,
        None => 1.0,
    };
    object.note_unknown(["file", "color", "rotation", "scale"], diagnostics);
    Ok(EnvironmentDesc {
        rotation_deg,
        scale,
        ..EnvironmentDesc::new(source)
    })
}

/// Reads the rotation of a map in degrees, from 0 to 360.
fn rotation(object: &mut JsonObject, diagnostics: &Diagnostics) -> Result<f32, SceneError> {
    let given = object.number("rotation", diagnostics)?;
    Ok(given.map_or(0.0, |(_, degrees)| degrees.rem_euclid(360.0)) as f32)
}

/// Returns three numbers of at least 0, if the key is present.
fn color(
    key: &str,
    object: &mut JsonObject,
    diagnostics: &Diagnostics,
) -> Result<Option<Vec3>, SceneError> {
    let Some((at, json)) = object.get(key) else {
        return Ok(None);
    };
    let rgb = numbers::<3>(&at, json, diagnostics)?;
    if let Some(bad) = rgb
        .iter()
        .find(|x| !(0.0..=f64::from(f32::MAX)).contains(*x))
    {
        return Err(diagnostics.error(at, format!("expected numbers of 0 or more, found {bad}")));
    }
    Ok(Some(Vec3::from_array(rgb.map(|x| x as f32))))
}
