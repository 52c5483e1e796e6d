//! Changes to the scene that settings make: the keys `set`, `view` and `camera` of scripts.

use std::collections::BTreeMap;

use super::find::find_file;
use super::given::Given;
use lumbre_light::scene::desc::{CAMERA_KIND_NAMES, TextureSlot, VIEW_HEIGHT_RANGE};
use lumbre_light::value::Value;
use lumbre_light::value::schema::{SchemaError, Ty};
use lumbre_scene_io::edit::WINDOW;

/// Largest coordinate and length, in scene units.
const MAX_COORDINATE: f64 = 1e9;

lumbre_light::table! {
    /// Option `camera` of the render table.
    pub(super) const CAMERA = "CameraChanges",
        "Changes to the scene's camera. Omitted keys keep the value of the scene.";
    aperture = "": Ty::num(0.0, MAX_COORDINATE),
        "diameter of the lens in scene units; 0 is a pinhole camera";
    f_number = "": Ty::num(1e-3, 1e6),
        "f-number: focal length over diameter of the lens; an alternative to `aperture` that needs \
         `focal_length` or `sensor_height`";
    focal_length = "": Ty::num(1e-9, 1e6),
        "focal length in scene units; together with `sensor_height` it determines `fov`";
    sensor_height = "": Ty::num(1e-9, 1e6),
        "height of the sensor in scene units; together with `fov` it determines `focal_length`";
    focus_distance = "": Ty::num(1e-9, MAX_COORDINATE),
        "distance from the lens to the plane in focus, in scene units; by default the scene's, or \
         the distance of `target`";
    fov = "": Ty::num(0.01, 179.0), "vertical field of view of a perspective camera in degrees";
    kind = "": Ty::Word(&CAMERA_KIND_NAMES),
        "how the camera maps the scene to its picture; `orthographic` and `spherical` cameras have \
         no lens";
    position = "": Ty::nums(3, -MAX_COORDINATE, MAX_COORDINATE),
        "centre of the lens in scene coordinates";
    target = "": Ty::nums(3, -MAX_COORDINATE, MAX_COORDINATE),
        "point on the optical axis in scene coordinates";
    up = "": Ty::nums(3, -MAX_COORDINATE, MAX_COORDINATE), "direction that is up in the picture";
    view_height = "": Ty::num(VIEW_HEIGHT_RANGE[0], VIEW_HEIGHT_RANGE[1]),
        "height of the picture of an orthographic camera in scene units";
    window = "": WINDOW,
        "part of the view that the picture shows: left, right, upper and lower edge, in fractions \
         of the whole from its upper left corner";
}

/// Path of the environment map in changes to a scene.
pub const ENVIRONMENT_MAP: &str = "environment.map";

/// Returns the changes to the scene from `set`, `view` and `camera`, by path.
pub(super) fn read_changes(given: &Given<'_>) -> Result<BTreeMap<String, Value>, SchemaError> {
    let Given { map, folder, path } = *given;
    let mut changes = BTreeMap::new();
    match map.get("set") {
        None => {}
        Some(Value::List(items)) if items.is_empty() => {}
        Some(Value::Map(set)) => {
            for (key, value) in set {
                check_change(key, value, path)?;
                let value = match value {
                    Value::Str(file) if names_texture(key) && !file.is_empty() => {
                        let found = find_file(file, folder, &format!("{path}.set.{key}"), key)?;
                        Value::Str(found.to_string_lossy().into_owned())
                    }
                    other => other.clone(),
                };
                changes.insert(key.clone(), value);
            }
        }
        Some(other) => {
            return Err(SchemaError::new(
                format!("{path}.set"),
                "set",
                format!(
                    "expected a table of changes by path, found {}",
                    other.kind()
                ),
            )
            .with_help("set = { [\"materials.egg.ior\"] = 1.5 }"));
        }
    }
    if let Some(view) = map.get("view")
        && changes.insert("camera".to_owned(), view.clone()).is_some()
    {
        return Err(SchemaError::new(
            format!("{path}.view"),
            "view",
            "given twice: `set` also has `camera`",
        ));
    }
    for (key, value) in given.table("camera").into_iter().flatten() {
        let change = format!("camera.{key}");
        if changes.insert(change.clone(), value.clone()).is_some() {
            return Err(SchemaError::new(
                format!("{path}.camera.{key}"),
                key.clone(),
                format!("given twice: `set` also has `{change}`"),
            ));
        }
    }
    Ok(changes)
}

/// Returns whether a path of `set` is a texture slot of a material.
fn names_texture(change: &str) -> bool {
    let is_slot = |param: &str| TextureSlot::from_name(param).is_some();
    change == ENVIRONMENT_MAP
        || change.starts_with("materials.") && change.rsplit('.').next().is_some_and(is_slot)
}

/// Checks the type of a value of `set`.
fn check_change(key: &str, value: &Value, path: &str) -> Result<(), SchemaError> {
    let number = |v: &Value| v.as_f64().is_some_and(f64::is_finite);
    let fits = match value {
        Value::Bool(_) | Value::Str(_) => true,
        Value::List(items) => !items.is_empty() && items.iter().all(number),
        other => number(other),
    };
    if fits {
        return Ok(());
    }
    let (problem, help) = match value {
        Value::Map(_) => (
            "expected a value, found a table".to_owned(),
            Some(format!(
                "write the whole path as the key: [\"{key}.FIELD\"] = value"
            )),
        ),
        other => (
            format!(
                "expected a finite number, a string, a boolean or a list of numbers, found {} \
                 `{other}`",
                other.kind()
            ),
            None,
        ),
    };
    Err(SchemaError {
        path: format!("{path}.set.{key}"),
        problem,
        help,
        key: key.to_owned(),
    })
}
