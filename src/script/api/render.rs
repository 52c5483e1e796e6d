//! The table that a script's `render` function returns, and how it becomes a [`CellConfig`].

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::experiment::CellConfig;
use crate::film::layer::{LAYER_NAMES, Layer};
use crate::render::BACKENDS;
use crate::render::hierarchy::{ACCEL, AccelSpec};
use crate::scene::desc::TextureSlot;
use crate::transport::camera::{FILTER_NAMES, FilterKind, FilterSpec};
use crate::transport::flight::Timing;
use crate::transport::integrator::external::EXTERNALS;
use crate::transport::integrator::{INTEGRATORS, integrator};
use crate::transport::sampler::SAMPLER_NAMES;
use crate::transport::timing::FILM;
use crate::value::Value;
use crate::value::schema::{Field, SchemaError, Table, Ty, unknown_key, unknown_name};

/// Names of the integrators, for the annotations.
const INTEGRATOR_NAMES: [&str; INTEGRATORS.len() + EXTERNALS.len()] = {
    let mut names = [""; INTEGRATORS.len() + EXTERNALS.len()];
    let mut i = 0;
    while i < names.len() {
        names[i] = if i < INTEGRATORS.len() { INTEGRATORS[i].name } else { EXTERNALS[i - INTEGRATORS.len()].name };
        i += 1;
    }
    names
};

/// Names of the backends, for the annotations.
const BACKEND_NAMES: [&str; BACKENDS.len() + 1] = {
    let mut names = ["auto"; BACKENDS.len() + 1];
    let mut i = 0;
    while i < BACKENDS.len() {
        names[i + 1] = BACKENDS[i].name;
        i += 1;
    }
    names
};

/// Largest coordinate and length in scene units.
const FAR: f64 = 1e9;

/// `aa` in the render table.
pub const AA: Table = Table {
    name: "Antialiasing",
    doc: "The pixel filter, sampled by importance.",
    fields: &[
        Field {
            key: "filter",
            ty: Ty::Word(&FILTER_NAMES),
            required: false,
            default: "box",
            doc: "constant, linear, a Gaussian cut off at three sigma, a smooth window, or the first source's Gaussian \
                  without end (sigma = 2 radius)",
        },
        Field {
            key: "radius",
            ty: Ty::Num { min: 0.0, max: 16.0 },
            required: false,
            default: "0.5",
            doc: "half width in pixels; a box of 0.5 is the pixel itself. Of antialiasing_radius half a sigma",
        },
    ],
};

/// `camera` in the render table.
pub const CAMERA: Table = Table {
    name: "CameraChanges",
    doc: "Changes to the scene's camera; what is left out stays as the scene says.",
    fields: &[
        Field {
            key: "aperture",
            ty: Ty::Num { min: 0.0, max: FAR },
            required: false,
            default: "",
            doc: "diameter of the lens in scene units; 0 is a pinhole",
        },
        Field {
            key: "f_number",
            ty: Ty::Num { min: 1e-3, max: 1e6 },
            required: false,
            default: "",
            doc: "focal length over the diameter of the lens, instead of aperture",
        },
        Field {
            key: "focal_length",
            ty: Ty::Num { min: 1e-9, max: 1e6 },
            required: false,
            default: "",
            doc: "focal length in scene units; together with sensor_height it decides fov",
        },
        Field {
            key: "sensor_height",
            ty: Ty::Num { min: 1e-9, max: 1e6 },
            required: false,
            default: "",
            doc: "height of the sensor in scene units; with fov alone, focal_length follows",
        },
        Field {
            key: "focus_distance",
            ty: Ty::Num { min: 1e-9, max: FAR },
            required: false,
            default: "",
            doc: "distance from the lens to the plane in focus, in scene units; the scene's, or that of target",
        },
        Field {
            key: "fov",
            ty: Ty::Num { min: 0.01, max: 179.0 },
            required: false,
            default: "",
            doc: "vertical field of view in degrees",
        },
        Field {
            key: "position",
            ty: Ty::Nums { len: 3, min: -FAR, max: FAR },
            required: false,
            default: "",
            doc: "centre of the lens",
        },
        Field {
            key: "target",
            ty: Ty::Nums { len: 3, min: -FAR, max: FAR },
            required: false,
            default: "",
            doc: "a point on the optical axis",
        },
        Field {
            key: "up",
            ty: Ty::Nums { len: 3, min: -FAR, max: FAR },
            required: false,
            default: "",
            doc: "the direction that is up in the picture",
        },
    ],
};

/// `rr` in the render table.
pub const ROULETTE: Table = Table {
    name: "RussianRoulette",
    doc: "Russian roulette: ends paths at random without changing the mean.",
    fields: &[Field {
        key: "start",
        ty: Ty::Int { min: 1, max: 10_000 },
        required: true,
        default: "",
        doc: "first path edge after which a path may end",
    }],
};

/// The table that `render` returns, without the integrators' own parameters.
pub const RENDER: Table = Table {
    name: "Render",
    doc: "What one cell renders. The integrator's own parameters stand in the same table.",
    fields: &[
        Field {
            key: "scene",
            ty: Ty::Str,
            required: true,
            default: "",
            doc: "the scene's file, relative to the current folder or else to the script's",
        },
        Field {
            key: "scene_options",
            ty: Ty::Any("table<string, string|number|boolean>"),
            required: false,
            default: "the scene's",
            doc: "what is chosen of a Lua scene's options: { light = \"sun\" }",
        },
        Field {
            key: "view",
            ty: Ty::Str,
            required: false,
            default: "the scene's camera",
            doc: "one of the scene's named views, to which the changes of camera then apply",
        },
        Field { key: "integrator", ty: Ty::Word(&INTEGRATOR_NAMES), required: true, default: "", doc: "the technique" },
        Field {
            key: "max_depth",
            ty: Ty::Int { min: 1, max: 10_000 },
            required: false,
            default: "the scene's",
            doc: "greatest number of path edges from camera to light: 1 = emission only, 2 = direct light",
        },
        Field {
            key: "resolution",
            ty: Ty::Nums { len: 2, min: 1.0, max: 16384.0 },
            required: false,
            default: "the scene's",
            doc: "width and height in pixels",
        },
        Field { key: "aa", ty: Ty::Table(&AA), required: false, default: "the pixel", doc: "the pixel filter" },
        Field {
            key: "sampler",
            ty: Ty::Word(&SAMPLER_NAMES),
            required: false,
            default: "independent",
            doc: "where the numbers of samples come from; sobol spreads them evenly, which mostly makes less noise than \
                  standard errors say",
        },
        Field {
            key: "camera",
            ty: Ty::Table(&CAMERA),
            required: false,
            default: "the scene's",
            doc: "changes to the camera",
        },
        Field {
            key: "set",
            ty: Ty::Any("table<string, number|string|boolean|number[]>"),
            required: false,
            default: "",
            doc: "changes to the scene by path: { [\"materials.egg.ior\"] = 1.5 }",
        },
        Field {
            key: "films",
            ty: Ty::OneOrMany(&Ty::Word(&LAYER_NAMES)),
            required: false,
            default: "none",
            doc: "layers to keep beside the picture, under films/ in the run's folder: { \"depth\", \"strategies\" }; a \
                  reference does not inherit them",
        },
        Field {
            key: "film",
            ty: Ty::Table(&FILM),
            required: false,
            default: "the picture alone",
            doc: "a time axis: { time = { bin = 0.01, bins = 300 } }; a reference does not inherit it",
        },
        Field { key: "rr", ty: Ty::Table(&ROULETTE), required: false, default: "never", doc: "Russian roulette" },
        Field {
            key: "accel",
            ty: Ty::Table(&ACCEL),
            required: false,
            default: "ploc",
            doc: "how the hierarchy is built through which rays are traced; only times depend on it",
        },
        Field {
            key: "backend",
            ty: Ty::Word(&BACKEND_NAMES),
            required: false,
            default: "auto",
            doc: "where it renders; auto is the first usable one",
        },
    ],
};

/// Finds a file that a script names: as it is written from the current folder, or else from the script's folder.
///
/// # Errors
/// Naming both places when it is in neither; `path` and `key` say which field named it.
pub fn find_file(name: &str, folder: &Path, path: &str, key: &str) -> Result<PathBuf, SchemaError> {
    let written = PathBuf::from(name);
    let beside = folder.join(name);
    if !name.is_empty() {
        if written.is_file() {
            return Ok(written);
        }
        if beside.is_file() {
            return Ok(beside);
        }
    }
    let tried = if written.is_absolute() || beside == written {
        format!("{}", written.display())
    } else {
        format!("{} and {}", written.display(), beside.display())
    };
    Err(SchemaError {
        path: path.to_owned(),
        problem: format!("there is no file `{name}`"),
        help: Some(format!("tried {tried}")),
        key: key.to_owned(),
    })
}

/// Types a render table. `path` stands before the fields in errors.
///
/// # Errors
/// The first field that is unknown, missing, of a wrong type, out of range, or names nothing.
pub fn cell(map: &BTreeMap<String, Value>, folder: &Path, path: &str) -> Result<CellConfig, SchemaError> {
    let at = |key: &str| format!("{path}.{key}");
    if let Some(Value::Str(name)) = map.get("integrator")
        && integrator(name).is_none()
    {
        return Err(named(unknown_name(&at("integrator"), name, "integrator", INTEGRATOR_NAMES), "integrator"));
    }
    if let Some(Value::Str(name)) = map.get("backend")
        && !BACKEND_NAMES.contains(&name.as_str())
    {
        return Err(named(unknown_name(&at("backend"), name, "backend", BACKEND_NAMES), "backend"));
    }
    let row = map.get("integrator").and_then(Value::as_str).and_then(integrator);
    let (common, params): (BTreeMap<_, _>, BTreeMap<_, _>) =
        map.iter().map(|(k, v)| (k.clone(), v.clone())).partition(|(k, _)| is_common(k));
    let own = row.map(|r| r.params.fields).unwrap_or_default();
    if let Some(key) = params.keys().find(|key| !own.iter().any(|f| f.key == **key)) {
        return Err(unknown_key(&at(key), key, RENDER.fields.iter().chain(own).map(|f| f.key)));
    }
    RENDER.check(path, &common)?;
    let Some(row) = row else { return Err(missing(path, "integrator")) };
    row.params.check(path, &params)?;
    let Some(scene) = text(&common, "scene") else { return Err(missing(path, "scene")) };
    Ok(CellConfig {
        scene_file: find_file(&scene, folder, &at("scene"), "scene")?,
        scene,
        scene_options: scene_options(common.get("scene_options"), &at("scene_options"))?,
        integrator: row.name.to_owned(),
        params,
        max_depth: integer(common.get("max_depth")),
        resolution: resolution(&common, path)?,
        rr_start: integer(inner(&common, "rr", "start")),
        filter: filter(&common),
        set: changes(&common, folder, path)?,
        films: films(common.get("films")),
        timing: timing(common.get("film"), &at("film"))?,
        sampler: text(&common, "sampler").unwrap_or_else(|| SAMPLER_NAMES[0].to_owned()),
        accel: common.get("accel").and_then(Value::as_map).map(AccelSpec::from_map).unwrap_or_default(),
        backend: text(&common, "backend").unwrap_or_else(|| "auto".to_owned()),
        fallback: None,
    })
}

/// The options of a scene: named words, numbers and booleans.
fn scene_options(value: Option<&Value>, path: &str) -> Result<BTreeMap<String, Value>, SchemaError> {
    let key = "scene_options";
    let fail = |problem: String, key: &str| {
        Err(SchemaError { path: path.to_owned(), problem, help: None, key: key.to_owned() })
    };
    match value {
        None => Ok(BTreeMap::new()),
        Some(Value::List(items)) if items.is_empty() => Ok(BTreeMap::new()),
        Some(Value::Map(map)) => {
            let plain = |v: &Value| matches!(v, Value::Bool(_) | Value::Int(_) | Value::Num(_) | Value::Str(_));
            match map.iter().find(|(_, v)| !plain(v)) {
                Some((name, v)) => {
                    fail(format!("{name}: expected a word, a number or a boolean, found {}", v.kind()), name)
                }
                None => Ok(map.clone()),
            }
        }
        Some(other) => fail(format!("expected a table of options, found {}", other.kind()), key),
    }
}

/// The render table of a reference: the cell's own, with the overrides' fields in their place. Tables in it (`set`,
/// `aa`, `camera`, `rr`, `accel`, `scene_options`) are merged field by field. Another integrator does not inherit the parameters of the cell's, and
/// no reference inherits its layers, its time axis or its hierarchy: it is there to be measured against, whatever it took.
pub fn merge(own: &BTreeMap<String, Value>, overrides: &BTreeMap<String, Value>) -> BTreeMap<String, Value> {
    let other = overrides.get("integrator").is_some_and(|i| own.get("integrator") != Some(i));
    let mut merged: BTreeMap<String, Value> = own
        .iter()
        .filter(|(k, _)| (!other || is_common(k)) && !matches!(k.as_str(), "films" | "film" | "accel"))
        .map(|(k, v)| (k.clone(), v.clone()))
        .collect();
    for (key, value) in overrides {
        match (merged.get_mut(key), value) {
            (Some(Value::Map(inner)), Value::Map(changes)) => {
                inner.extend(changes.iter().map(|(k, v)| (k.clone(), v.clone())));
            }
            (Some(Value::Map(_)), Value::List(items)) if items.is_empty() => {}
            _ => {
                merged.insert(key.clone(), value.clone());
            }
        }
    }
    merged
}

fn is_common(key: &str) -> bool {
    RENDER.fields.iter().any(|f| f.key == key)
}

fn named(mut error: SchemaError, key: &str) -> SchemaError {
    error.key = key.to_owned();
    error
}

fn missing(path: &str, key: &str) -> SchemaError {
    SchemaError { path: path.to_owned(), problem: format!("`{key}` is missing"), help: None, key: String::new() }
}

fn text(map: &BTreeMap<String, Value>, key: &str) -> Option<String> {
    map.get(key).and_then(Value::as_str).map(str::to_owned)
}

fn integer(value: Option<&Value>) -> Option<u32> {
    value.and_then(Value::as_i64).and_then(|i| u32::try_from(i).ok())
}

fn inner<'a>(map: &'a BTreeMap<String, Value>, key: &str, field: &str) -> Option<&'a Value> {
    map.get(key).and_then(Value::as_map)?.get(field)
}

fn resolution(map: &BTreeMap<String, Value>, path: &str) -> Result<Option<[u32; 2]>, SchemaError> {
    let Some(items) = map.get("resolution").and_then(Value::as_list) else { return Ok(None) };
    match items.iter().map(|v| integer(Some(v))).collect::<Option<Vec<_>>>().as_deref() {
        Some([width, height]) => Ok(Some([*width, *height])),
        _ => Err(SchemaError {
            path: format!("{path}.resolution"),
            problem: "expected a whole number of pixels in each direction".to_owned(),
            help: None,
            key: "resolution".to_owned(),
        }),
    }
}

fn filter(map: &BTreeMap<String, Value>) -> FilterSpec {
    let named = inner(map, "aa", "filter").and_then(Value::as_str).and_then(FilterKind::from_name);
    let kind = named.unwrap_or(FilterKind::Box);
    FilterSpec { kind, radius: inner(map, "aa", "radius").and_then(Value::as_f64).map_or(0.5, |r| r as f32) }
}

/// The layers that a checked field names, in the order of their table, so that the order of asking decides nothing.
fn films(value: Option<&Value>) -> Vec<Layer> {
    let named = value.map(|v| v.as_list().unwrap_or(std::slice::from_ref(v))).unwrap_or_default();
    let mut layers: Vec<Layer> = named.iter().filter_map(|v| Layer::from_name(v.as_str()?)).collect();
    layers.sort();
    layers.dedup();
    layers
}

/// The time axis of a checked `film`.
fn timing(value: Option<&Value>, path: &str) -> Result<Option<Timing>, SchemaError> {
    value.and_then(Value::as_map).map_or(Ok(None), |film| Timing::from_film(film, path))
}

/// `set` and `camera` together: every change to the scene, by path.
fn changes(map: &BTreeMap<String, Value>, folder: &Path, path: &str) -> Result<BTreeMap<String, Value>, SchemaError> {
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
            return Err(SchemaError {
                path: format!("{path}.set"),
                problem: format!("expected a table of changes by path, found {}", other.kind()),
                help: Some("set = { [\"materials.egg.ior\"] = 1.5 }".to_owned()),
                key: "set".to_owned(),
            });
        }
    }
    if let Some(view) = map.get("view")
        && changes.insert("camera".to_owned(), view.clone()).is_some()
    {
        return Err(SchemaError {
            path: format!("{path}.view"),
            problem: "said twice: `set` has `camera` as well".to_owned(),
            help: None,
            key: "view".to_owned(),
        });
    }
    for (key, value) in map.get("camera").and_then(Value::as_map).into_iter().flatten() {
        let change = format!("camera.{key}");
        if changes.insert(change.clone(), value.clone()).is_some() {
            return Err(SchemaError {
                path: format!("{path}.camera.{key}"),
                problem: format!("said twice: `set` has `{change}` as well"),
                help: None,
                key: key.clone(),
            });
        }
    }
    Ok(changes)
}

/// Whether a change puts a file into a texture slot of a material.
fn names_texture(change: &str) -> bool {
    change.starts_with("materials.")
        && change.rsplit('.').next().is_some_and(|param| TextureSlot::from_name(param).is_some())
}

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
            Some(format!("paths are written in one piece: [\"{key}.FIELD\"] = value")),
        ),
        other => (
            format!(
                "expected a finite number, a string, a boolean or a list of numbers, found {} `{other}`",
                other.kind()
            ),
            None,
        ),
    };
    Err(SchemaError { path: format!("{path}.set.{key}"), problem, help, key: key.to_owned() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(pairs: &[(&str, Value)]) -> BTreeMap<String, Value> {
        pairs.iter().map(|(k, v)| ((*k).to_owned(), v.clone())).collect()
    }

    #[test]
    fn merging_is_one_level_deep_and_another_integrator_starts_without_parameters() {
        let aa = Value::Map(map(&[("filter", "gauss".into()), ("radius", 0.5.into())]));
        let own = map(&[("integrator", "nee".into()), ("mis", "power".into()), ("aa", aa), ("scene", "a.scn".into())]);
        let wide = Value::Map(map(&[("radius", 2.0.into())]));
        let merged = merge(&own, &map(&[("aa", wide.clone())]));
        assert_eq!(inner(&merged, "aa", "filter"), Some(&"gauss".into()));
        assert_eq!(inner(&merged, "aa", "radius"), Some(&Value::Int(2)));
        assert!(merged.contains_key("mis"));
        let with_films = merge(&map(&[("films", "depth".into()), ("scene", "a.scn".into())]), &BTreeMap::new());
        assert_eq!(with_films, map(&[("scene", "a.scn".into())]), "a reference keeps no films");
        assert!(merge(&own, &map(&[("films", "depth".into())])).contains_key("films"), "unless it asks for them");
        let merged = merge(&own, &map(&[("integrator", "bpt".into())]));
        assert!(!merged.contains_key("mis") && merged.contains_key("scene"));
        let merged = merge(&own, &map(&[("integrator", "nee".into()), ("aa", Value::List(Vec::new()))]));
        assert_eq!(merged, own);
    }

    #[test]
    fn layers_are_in_the_order_of_their_table_each_once() {
        let asked = ["normal", "depth", "albedo", "depth"].map(Value::from).to_vec();
        assert_eq!(films(Some(&Value::List(asked))), [Layer::Depth, Layer::Albedo, Layer::Normal]);
        assert_eq!(films(Some(&"rays".into())), [Layer::Rays]);
        assert!(films(None).is_empty() && films(Some(&Value::List(Vec::new()))).is_empty());
    }

    #[test]
    fn names_in_the_annotations_are_those_of_the_tables() {
        assert!(INTEGRATOR_NAMES.iter().all(|n| integrator(n).is_some()));
        assert_eq!(BACKEND_NAMES[0], "auto");
        assert!(BACKENDS.iter().all(|b| BACKEND_NAMES.contains(&b.name)));
    }
}
