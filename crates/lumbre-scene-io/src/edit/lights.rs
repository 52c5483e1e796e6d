//! Settings of lights without a surface and of the environment.

use std::path::Path;
use std::sync::Arc;

use super::{COORDINATE, POINT, Param, has_no, name_and_param, params, point, scalar, vector};
use crate::load;
use lumbre_light::scene::desc::light::CUTOFF_RANGE;
use lumbre_light::scene::desc::{
    EnvironmentDesc, EnvironmentSampling, EnvironmentSource, LightDesc, LightKind, SceneDesc,
    TextureDesc,
};
use lumbre_light::value::Value;
use lumbre_light::value::schema::{SchemaError, Ty, unknown_key, unknown_name};

/// Last component of the path of a map of directions.
const MAP: &str = "map";

const COLOR: Ty = Ty::nums(3, 0.0, 1e12);
const DIRECTION: Ty = Ty::nums(3, -COORDINATE, COORDINATE);

params! {
    /// Settings of lights without a surface.
    pub const LIGHT_PARAMS: LightDesc;
    "position": POINT, "Position of a point, spot or goniometric light in scene units.",
        |light, v| light.place(point(v));
    "intensity": COLOR,
        "Radiant intensity of a point light, of a spot light along its axis, or of a goniometric \
         light where its map is 1: irradiance times squared distance.",
        |light, v| match &mut light.kind {
            LightKind::Point { intensity, .. }
            | LightKind::Spot { intensity, .. }
            | LightKind::Goniometric { intensity, .. } => {
                *intensity = vector(v);
            }
            LightKind::Directional { .. } => {}
        };
    "direction": DIRECTION,
        "Direction in which a directional light travels, or axis of a spot light; any non-zero \
         length.",
        |light, v| match &mut light.kind {
            LightKind::Directional { direction, .. } | LightKind::Spot { direction, .. } => {
                *direction = vector(v);
            }
            LightKind::Point { .. } | LightKind::Goniometric { .. } => {}
        };
    "irradiance": COLOR, "Irradiance of a directional light on a surface that faces it.",
        |light, v| if let LightKind::Directional { irradiance, .. } = &mut light.kind {
            *irradiance = vector(v);
        };
    "beam": Ty::num(0.0, CUTOFF_RANGE[1]),
        "Angle from the axis in degrees up to which a spot light has its full intensity; at most \
         its cutoff.",
        |light, v| if let LightKind::Spot { cone, .. } = &mut light.kind {
            cone.beam_deg = scalar(v);
        };
    "cutoff": Ty::num(CUTOFF_RANGE[0], CUTOFF_RANGE[1]),
        "Angle from the axis in degrees beyond which a spot light emits nothing.",
        |light, v| if let LightKind::Spot { cone, .. } = &mut light.kind {
            cone.cutoff_deg = scalar(v);
        };
    "map": Ty::Str,
        "File of the map of a goniometric light (longitude over latitude), or of the image that a spot \
         light projects, relative to the current folder: the factor on its intensity.",
        |_, _| {};
    "rotation": Ty::num(-1e6, 1e6),
        "Rotation of the map of a goniometric light about +y in degrees, counter-clockwise seen \
         from above.",
        |light, v| if let LightKind::Goniometric { rotation_deg, .. } = &mut light.kind {
            *rotation_deg = scalar(v);
        };
}

params! {
    /// Settings of the environment.
    pub const ENVIRONMENT_PARAMS: EnvironmentDesc;
    "rotation": Ty::num(-1e6, 1e6),
        "Rotation of the map about +y in degrees, counter-clockwise seen from above.",
        |e, v| e.rotation_deg = scalar(v);
    "scale": Ty::num(0.0, 1e12), "Factor on the radiance.", |e, v| e.scale = scalar(v);
    "color": COLOR, "The same radiance from every direction; replaces a map.",
        |e, v| e.source = EnvironmentSource::Color(vector(v));
    "map": Ty::Str,
        "File of a map of all directions (longitude over latitude), relative to the current folder. \
         Like `color`, it makes the environment of a scene that has none.",
        |_, _| {};
    "sampling": Ty::Word(EnvironmentSampling::NAMES),
        "Distribution with which directions towards a map are sampled: in proportion to its \
         `luminance`, or `uniform` over the sphere, which has the same mean and more noise.",
        |e, v| {
            let chosen = v.as_str().and_then(EnvironmentSampling::from_name);
            e.sampling = chosen.unwrap_or(e.sampling);
        };
}

/// Returns the names of the settings that a light has.
fn settings(light: &LightDesc) -> impl Iterator<Item = &'static str> {
    let names: &[&'static str] = match light.kind {
        LightKind::Point { .. } => &["position", "intensity"],
        LightKind::Directional { .. } => &["direction", "irradiance"],
        LightKind::Spot { image: None, .. } => {
            &["position", "direction", "intensity", "beam", "cutoff"]
        }
        LightKind::Spot { .. } => &["position", "direction", "intensity", "beam", "cutoff", MAP],
        LightKind::Goniometric { .. } => &["position", "intensity", MAP, "rotation"],
    };
    names.iter().copied()
}

/// Sets `lights.NAME.PARAM`; `rest` is what follows the first dot.
pub(super) fn set_light(
    desc: &mut SceneDesc,
    path: &str,
    rest: &str,
    value: &Value,
) -> Result<(), SchemaError> {
    let (name, param) = name_and_param(path, rest, "lights")?;
    let Some(i) = desc.lights.iter().position(|l| l.name == name) else {
        return Err(unknown_name(
            path,
            name,
            "light",
            desc.lights.iter().map(|l| l.name.as_str()),
        ));
    };
    let light = &mut desc.lights[i];
    let Some(row) = LIGHT_PARAMS.iter().find(|row| row.name == param) else {
        return Err(unknown_name(
            path,
            param,
            "light parameter",
            settings(light),
        ));
    };
    row.ty.check(path, param, value)?;
    if param == "direction" && vector(value) == glam::Vec3::ZERO {
        return Err(SchemaError::new(
            path,
            param,
            "expected a direction, found a vector of length zero",
        ));
    }
    if !settings(light).any(|name| name == param) {
        let what = match light.kind {
            LightKind::Point { .. } => "a point light",
            LightKind::Directional { .. } => "a directional light",
            LightKind::Spot { image: None, .. } => "a spot light without an image",
            LightKind::Spot { .. } => "a spot light",
            LightKind::Goniometric { .. } => "a goniometric light",
        };
        return Err(has_no(path, name, what, param, settings(light)));
    }
    match &mut light.kind {
        LightKind::Goniometric { map, .. } if param == MAP => *map = read_map(path, value)?,
        LightKind::Spot {
            image: Some(image), ..
        } if param == MAP => image.texture = read_map(path, value)?,
        _ => (row.set_checked)(light, value),
    }
    Ok(())
}

/// Sets one value of the environment by `environment.PARAM`.
pub(super) fn set_environment(
    desc: &mut SceneDesc,
    path: &str,
    param: &str,
    value: &Value,
) -> Result<(), SchemaError> {
    let Some(row) = ENVIRONMENT_PARAMS.iter().find(|row| row.name == param) else {
        return Err(unknown_key(
            path,
            param,
            ENVIRONMENT_PARAMS.iter().map(|row| row.name),
        ));
    };
    row.ty.check(path, param, value)?;
    let source = match param {
        MAP => Some(EnvironmentSource::Map(read_map(path, value)?)),
        "color" => Some(EnvironmentSource::Color(vector(value))),
        _ => None,
    };
    match (source, &mut desc.environment) {
        (Some(source), Some(environment)) => environment.source = source,
        (Some(source), None) => {
            desc.environment = Some(EnvironmentDesc::new(source));
        }
        (None, Some(environment)) => (row.set_checked)(environment, value),
        (None, None) => {
            return Err(SchemaError::new(
                path,
                param,
                "the scene has no environment",
            ));
        }
    }
    Ok(())
}

/// Reads the file of a map of directions.
fn read_map(path: &str, file: &Value) -> Result<Arc<TextureDesc>, SchemaError> {
    let file = Path::new(file.as_str().unwrap_or_default());
    // Notes about the file are reported where a scene names it, not here.
    let read = load::texture(file, &mut Vec::new());
    let read = read.map_err(|e| SchemaError::new(path, MAP, e.to_string()))?;
    Ok(Arc::new(read))
}

/// Returns every path that leads to a number or word of a light or of the environment of this scene.
pub(super) fn paths(desc: &SceneDesc) -> Vec<String> {
    let light_paths = |l: &LightDesc| {
        settings(l)
            .filter(|name| *name != MAP)
            .map(|p| format!("lights.{}.{p}", l.name))
            .collect::<Vec<_>>()
    };
    let mut paths: Vec<String> = desc.lights.iter().flat_map(light_paths).collect();
    if desc.environment.is_some() {
        paths.extend(
            ENVIRONMENT_PARAMS
                .iter()
                .filter(|row| row.name != MAP)
                .map(|row| format!("environment.{}", row.name)),
        );
    }
    paths
}
