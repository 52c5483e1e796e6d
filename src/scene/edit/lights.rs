//! Settings of lights without a surface and of the environment.

use super::{COORDINATE, POINT, name_and_param, problem, scalar, vector};
use crate::scene::desc::light::CUTOFF_RANGE;
use crate::scene::desc::{EnvironmentDesc, EnvironmentSource, LightDesc, LightKind, SceneDesc};
use crate::value::Value;
use crate::value::schema::{SchemaError, Ty, unknown_key, unknown_name};

const COLOR: Ty = Ty::Nums { len: 3, min: 0.0, max: 1e12 };
const DIRECTION: Ty = Ty::Nums { len: 3, min: -COORDINATE, max: COORDINATE };

/// A setting of one light without a surface.
#[derive(Debug)]
pub struct LightParam {
    /// The last part of the path: `lights.NAME.<name>`.
    pub name: &'static str,
    /// Type and range.
    pub ty: Ty,
    /// Meaning and unit in a sentence.
    pub doc: &'static str,
    /// Writes the setting and says so, unless the light has none; the value has been checked against `ty`.
    set_checked: fn(&mut LightKind, &Value) -> bool,
}

/// Every setting of a light without a surface.
pub const LIGHT_PARAMS: &[LightParam] = &[
    LightParam {
        name: "position",
        ty: POINT,
        doc: "Place of a point light or spot in scene units.",
        set_checked: |light, v| match light {
            LightKind::Point { position, .. } | LightKind::Spot { position, .. } => {
                *position = vector(v);
                true
            }
            LightKind::Directional { .. } => false,
        },
    },
    LightParam {
        name: "intensity",
        ty: COLOR,
        doc: "Radiant intensity of a point light, or of a spot along its axis: irradiance times squared distance.",
        set_checked: |light, v| match light {
            LightKind::Point { intensity, .. } | LightKind::Spot { intensity, .. } => {
                *intensity = vector(v);
                true
            }
            LightKind::Directional { .. } => false,
        },
    },
    LightParam {
        name: "direction",
        ty: DIRECTION,
        doc: "Direction in which a directional light travels, or axis of a spot, of any length but zero.",
        set_checked: |light, v| match light {
            LightKind::Directional { direction, .. } | LightKind::Spot { direction, .. } => {
                *direction = vector(v);
                true
            }
            LightKind::Point { .. } => false,
        },
    },
    LightParam {
        name: "irradiance",
        ty: COLOR,
        doc: "Irradiance of a directional light on a surface that faces it.",
        set_checked: |light, v| match light {
            LightKind::Directional { irradiance, .. } => {
                *irradiance = vector(v);
                true
            }
            LightKind::Point { .. } | LightKind::Spot { .. } => false,
        },
    },
    LightParam {
        name: "beam",
        ty: Ty::Num { min: 0.0, max: CUTOFF_RANGE[1] },
        doc: "Angle from the axis in degrees up to which a spot has its whole intensity, at most its cutoff.",
        set_checked: |light, v| match light {
            LightKind::Spot { cone, .. } => {
                cone.beam_deg = scalar(v);
                true
            }
            _ => false,
        },
    },
    LightParam {
        name: "cutoff",
        ty: Ty::Num { min: CUTOFF_RANGE[0], max: CUTOFF_RANGE[1] },
        doc: "Angle from the axis in degrees from which on a spot does not shine.",
        set_checked: |light, v| match light {
            LightKind::Spot { cone, .. } => {
                cone.cutoff_deg = scalar(v);
                true
            }
            _ => false,
        },
    },
];

/// A setting of the environment.
#[derive(Debug)]
pub struct EnvironmentParam {
    /// The last part of the path: `environment.<name>`.
    pub name: &'static str,
    /// Type and range.
    pub ty: Ty,
    /// Meaning and unit in a sentence.
    pub doc: &'static str,
    /// Writes the setting; the value has been checked against `ty`.
    set_checked: fn(&mut EnvironmentDesc, &Value),
}

/// Every setting of the environment.
pub const ENVIRONMENT_PARAMS: &[EnvironmentParam] = &[
    EnvironmentParam {
        name: "rotation",
        ty: Ty::Num { min: -1e6, max: 1e6 },
        doc: "Turn of the map about +y in degrees, counter-clockwise seen from above.",
        set_checked: |e, v| e.rotation_deg = scalar(v),
    },
    EnvironmentParam {
        name: "scale",
        ty: Ty::Num { min: 0.0, max: 1e12 },
        doc: "Factor on the radiance.",
        set_checked: |e, v| e.scale = scalar(v),
    },
    EnvironmentParam {
        name: "color",
        ty: COLOR,
        doc: "The same radiance from everywhere; it replaces a map.",
        set_checked: |e, v| e.source = EnvironmentSource::Color(vector(v)),
    },
];

/// The settings that a light has.
fn settings(light: &LightDesc) -> impl Iterator<Item = &'static str> {
    let names: &[&'static str] = match light.kind {
        LightKind::Point { .. } => &["position", "intensity"],
        LightKind::Directional { .. } => &["direction", "irradiance"],
        LightKind::Spot { .. } => &["position", "direction", "intensity", "beam", "cutoff"],
    };
    names.iter().copied()
}

/// Sets `lights.NAME.PARAM`; `rest` is what follows the first dot.
pub(super) fn set_light(desc: &mut SceneDesc, path: &str, rest: &str, value: &Value) -> Result<(), SchemaError> {
    let (name, param) = name_and_param(path, rest, "lights")?;
    let Some(i) = desc.lights.iter().position(|l| l.name == name) else {
        return Err(unknown_name(path, name, "light", desc.lights.iter().map(|l| l.name.as_str())));
    };
    let light = &mut desc.lights[i];
    let Some(row) = LIGHT_PARAMS.iter().find(|row| row.name == param) else {
        return Err(unknown_name(path, param, "light parameter", settings(light)));
    };
    row.ty.check(path, param, value)?;
    if param == "direction" && vector(value) == glam::Vec3::ZERO {
        return Err(problem(path, param, "expected a direction, found one of length zero".to_owned()));
    }
    if !(row.set_checked)(&mut light.kind, value) {
        let what = match light.kind {
            LightKind::Point { .. } => "a point",
            LightKind::Directional { .. } => "a direction",
            LightKind::Spot { .. } => "a spot",
        };
        let mut e = problem(path, param, format!("`{name}` is {what}, which has no `{param}`"));
        e.help = Some(format!("known: {}", settings(light).collect::<Vec<_>>().join(", ")));
        return Err(e);
    }
    Ok(())
}

/// Sets `environment.PARAM`.
pub(super) fn set_environment(desc: &mut SceneDesc, path: &str, param: &str, value: &Value) -> Result<(), SchemaError> {
    let Some(row) = ENVIRONMENT_PARAMS.iter().find(|row| row.name == param) else {
        return Err(unknown_key(path, param, ENVIRONMENT_PARAMS.iter().map(|row| row.name)));
    };
    row.ty.check(path, param, value)?;
    let Some(environment) = &mut desc.environment else {
        return Err(problem(path, param, "the scene has no environment".to_owned()));
    };
    (row.set_checked)(environment, value);
    Ok(())
}

/// Every path that leads to a light or to the environment of this scene.
pub(super) fn paths(desc: &SceneDesc) -> Vec<String> {
    let of_light = |l: &LightDesc| settings(l).map(|p| format!("lights.{}.{p}", l.name)).collect::<Vec<_>>();
    let mut paths: Vec<String> = desc.lights.iter().flat_map(of_light).collect();
    if desc.environment.is_some() {
        paths.extend(ENVIRONMENT_PARAMS.iter().map(|row| format!("environment.{}", row.name)));
    }
    paths
}
