//! `lights` and `environment`: additions of Lumbre, since the format's own lights are emissive entities only.

use glam::Vec3;
use serde_json::Value as Json;

use super::material::Textures;
use super::reader::{Object, Report, numbers, shorten};
use crate::scene::SceneError;
use crate::scene::desc::{ConeDesc, ConeEdge, EnvironmentDesc, EnvironmentSource, LightDesc, LightKind};
use crate::scene::names::Names;
use crate::value::suggest;

const LIGHT_TYPES: [&str; 3] = ["point", "directional", "spot"];

/// Reads one entry of `lights`.
pub(super) fn read(place: &str, json: &Json, names: &mut Names, report: &mut Report) -> Result<LightDesc, SceneError> {
    let mut object = Object::new(place, json, report)?;
    let Some((at, what)) = object.string("type", report)? else {
        return Err(report.error(place, "a light needs a `type`: point, directional or spot"));
    };
    let given = object.string("name", report)?.map(|(_, name)| name.to_owned());
    let [place_key, color_key] = match what {
        "point" | "spot" => ["position", "intensity"],
        "directional" => ["direction", "irradiance"],
        other => {
            let help = match suggest::nearest(other, LIGHT_TYPES) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("known: {}", LIGHT_TYPES.join(", ")),
            };
            return Err(report.error(at, format!("unknown type of light `{}` ({help})", shorten(other))));
        }
    };
    let missing = |key: &str, report: &Report| report.error(place, format!("a {what} light needs `{key}`"));
    let at_or_along = object.vec3(place_key, report)?.ok_or_else(|| missing(place_key, report))?;
    let color = color(color_key, &mut object, report)?.ok_or_else(|| missing(color_key, report))?;
    let kind = match what {
        "point" => LightKind::Point { position: at_or_along, intensity: color },
        "spot" => {
            let direction = object.vec3("direction", report)?.ok_or_else(|| missing("direction", report))?;
            let cutoff_deg = object.number("cutoff", report)?.map_or(20.0, |(_, x)| x as f32);
            let beam_deg = object.number("beam", report)?.map_or(0.75 * cutoff_deg, |(_, x)| x as f32);
            let cone = ConeDesc { beam_deg, cutoff_deg, edge: ConeEdge::Linear };
            if direction == Vec3::ZERO || !cone.is_possible() {
                let problem = "a spot needs a `direction`, a `cutoff` below 180 degrees and a `beam` of at most that";
                return Err(report.error(place, problem));
            }
            LightKind::Spot { position: at_or_along, direction, intensity: color, cone }
        }
        _ if at_or_along == Vec3::ZERO => {
            return Err(report.error(object.at(place_key), "a direction needs a length above zero"));
        }
        _ => LightKind::Directional { direction: at_or_along, irradiance: color },
    };
    object.note_unknown(["type", "name", place_key, color_key, "direction", "cutoff", "beam"], report);
    Ok(LightDesc { name: super::name(names, given.as_deref(), what, place, report), kind })
}

/// Reads `environment`.
pub(super) fn environment(
    place: &str,
    json: &Json,
    textures: &mut Textures,
    report: &mut Report,
) -> Result<EnvironmentDesc, SceneError> {
    let mut object = Object::new(place, json, report)?;
    let map = textures.load("file", &mut object, report)?;
    let color = color("color", &mut object, report)?;
    let source = match (map, color) {
        (Some(map), None) => EnvironmentSource::Map(map),
        (None, Some(color)) => EnvironmentSource::Color(color),
        (Some(_), Some(_)) => {
            return Err(report.error(place, "an environment has a `file` or a `color`, not both"));
        }
        (None, None) => return Err(report.error(place, "an environment needs a `file` or a `color`")),
    };
    let rotation_deg = object.number("rotation", report)?.map_or(0.0, |(_, degrees)| degrees.rem_euclid(360.0)) as f32;
    let scale = match object.number("scale", report)? {
        Some((at, scale)) if !(0.0..=f64::from(f32::MAX)).contains(&scale) => {
            return Err(report.error(at, format!("expected a number that is not negative, found {scale}")));
        }
        Some((_, scale)) => scale as f32,
        None => 1.0,
    };
    object.note_unknown(["file", "color", "rotation", "scale"], report);
    Ok(EnvironmentDesc { source, rotation_deg, scale })
}

/// Three numbers that are not negative, if the key is there.
fn color(key: &str, object: &mut Object, report: &Report) -> Result<Option<Vec3>, SceneError> {
    let Some((at, json)) = object.take(key) else { return Ok(None) };
    let rgb = numbers::<3>(&at, json, report)?;
    if let Some(bad) = rgb.iter().find(|x| !(0.0..=f64::from(f32::MAX)).contains(*x)) {
        return Err(report.error(at, format!("expected numbers that are not negative, found {bad}")));
    }
    Ok(Some(Vec3::from_array(rgb.map(|x| x as f32))))
}
