//! Settings of lights without a surface and of the environment.

use super::{COORDINATE, POINT, name_and_param, scalar, vector};
use lumbre_light::scene::desc::light::CUTOFF_RANGE;
use lumbre_light::scene::desc::{
    EnvironmentDesc, EnvironmentSampling, EnvironmentSource, LightDesc, LightKind, SceneDesc,
};
use lumbre_light::value::Value;
use lumbre_light::value::schema::{SchemaError, Ty, unknown_key, unknown_name};

const COLOR: Ty = Ty::Nums {
    len: 3,
    min: 0.0,
    max: 1e12,
};
const DIRECTION: Ty = Ty::Nums {
    len: 3,
    min: -COORDINATE,
    max: COORDINATE,
};

/// A setting of one light without a surface.
#[derive(Debug)]
pub struct LightParam {
    /// Last component of the path: `lights.NAME.<name>`.
    pub name: &'static str,
    /// Type and range.
    pub ty: Ty,
    /// Meaning and unit, in a sentence.
    pub doc: &'static str,
    /// Stores a value that has been checked against `ty`. Returns false if the light has no such
    /// setting.
    set_checked: fn(&mut LightKind, &Value) -> bool,
}

/// Settings of lights without a surface.
pub const LIGHT_PARAMS: &[LightParam] = &[
    LightParam {
        name: "position",
        ty: POINT,
        doc: "Position of a point or spot light in scene units.",
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
        doc: "Radiant intensity of a point light, or of a spot light along its axis: irradiance \
              times squared distance.",
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
        doc: "Direction in which a directional light travels, or axis of a spot light; any \
              non-zero length.",
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
        ty: Ty::Num {
            min: 0.0,
            max: CUTOFF_RANGE[1],
        },
        doc: "Angle from the axis in degrees up to which a spot light has its full intensity; at \
              most its cutoff.",
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
        ty: Ty::Num {
            min: CUTOFF_RANGE[0],
            max: CUTOFF_RANGE[1],
        },
        doc: "Angle from the axis in degrees beyond which a spot light emits nothing.",
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
    /// Last component of the path: `environment.<name>`.
    pub name: &'static str,
    /// Type and range.
    pub ty: Ty,
    /// Meaning and unit, in a sentence.
    pub doc: &'static str,
    /// Stores a value that has been checked against `ty`.
    set_checked: fn(&mut EnvironmentDesc, &Value),
}

/// Settings of the environment.
pub const ENVIRONMENT_PARAMS: &[EnvironmentParam] = &[
    EnvironmentParam {
        name: "rotation",
        ty: Ty::Num {
            min: -1e6,
            max: 1e6,
        },
        doc: "Rotation of the map about +y in degrees, counter-clockwise seen from above.",
        set_checked: |e, v| e.rotation_deg = scalar(v),
    },
    EnvironmentParam {
        name: "scale",
        ty: Ty::Num {
            min: 0.0,
            max: 1e12,
        },
        doc: "Factor on the radiance.",
        set_checked: |e, v| e.scale = scalar(v),
    },
    EnvironmentParam {
        name: "color",
        ty: COLOR,
        doc: "The same radiance from every direction; replaces a map.",
        set_checked: |e, v| e.source = EnvironmentSource::Color(vector(v)),
    },
    EnvironmentParam {
        name: "sampling",
        ty: Ty::Word(EnvironmentSampling::NAMES),
        doc: "Distribution with which directions towards a map are sampled: in proportion to its \
              `luminance`, or `uniform` over the sphere, which has the same mean and more noise.",
        set_checked: |e, v| {
            let chosen = EnvironmentSampling::ALL
                .into_iter()
                .find(|sampling| v.as_str() == Some(sampling.name()));
            e.sampling = chosen.unwrap_or(e.sampling);
        },
    },
];

/// Returns the names of the settings that a light has.
fn settings(light: &LightDesc) -> impl Iterator<Item = &'static str> {
    let names: &[&'static str] = match light.kind {
        LightKind::Point { .. } => &["position", "intensity"],
        LightKind::Directional { .. } => &["direction", "irradiance"],
        LightKind::Spot { .. } => &["position", "direction", "intensity", "beam", "cutoff"],
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
            "expected a direction, found a vector of length zero".to_owned(),
        ));
    }
    if !(row.set_checked)(&mut light.kind, value) {
        let what = match light.kind {
            LightKind::Point { .. } => "a point light",
            LightKind::Directional { .. } => "a directional light",
            LightKind::Spot { .. } => "a spot light",
        };
        let mut e = SchemaError::new(
            path,
            param,
            format!("`{name}` is {what}, which has no `{param}`"),
        );
        e.help = Some(format!(
            "known: {}",
            settings(light).collect::<Vec<_>>().join(", ")
        ));
        return Err(e);
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
    let Some(environment) = &mut desc.environment else {
        return Err(SchemaError::new(
            path,
            param,
            "the scene has no environment".to_owned(),
        ));
    };
    (row.set_checked)(environment, value);
    Ok(())
}

/// Returns every path that leads to a light or to the environment of this scene.
pub(super) fn paths(desc: &SceneDesc) -> Vec<String> {
    let light_paths = |l: &LightDesc| {
        settings(l)
            .map(|p| format!("lights.{}.{p}", l.name))
            .collect::<Vec<_>>()
    };
    let mut paths: Vec<String> = desc.lights.iter().flat_map(light_paths).collect();
    if desc.environment.is_some() {
        paths.extend(
            ENVIRONMENT_PARAMS
                .iter()
                .map(|row| format!("environment.{}", row.name)),
        );
    }
    paths
}
