//! Conversion of the table that a script's `render` function returns to a [`CellConfig`].

use std::collections::BTreeMap;
use std::path::Path;

use super::builder::Externals;
use super::find::{find_file, find_folder};
use super::render_schema::{BACKEND_NAMES, RENDER};
use crate::experiment::CellConfig;
use crate::experiment::plan::integrator_help;
use lumbre_light::film::layer::Layer;
use lumbre_light::scene::desc::TextureSlot;
use lumbre_light::transport::camera::{FilterKind, FilterSpec};
use lumbre_light::transport::integrator::external::is_declared;
use lumbre_light::transport::integrator::{IntegratorRow, integrator, integrators};
use lumbre_light::transport::path_time::Timing;
use lumbre_light::transport::sampler::SAMPLER_NAMES;
use lumbre_light::value::Value;
use lumbre_light::value::schema::{SchemaError, unknown_key, unknown_name};
use lumbre_render::denoise::Denoise;
use lumbre_render::external::technique::VALUES;
use lumbre_render::hierarchy::AccelSpec;
use lumbre_render::shaders::{BUILT_IN, ShaderFolder, Shaders};

/// Checks a render table and converts it. `externals` are the techniques that the script declares.
/// Error paths begin with `path`.
///
/// # Errors
/// Returns an error for the first field that is unknown, missing, of a wrong type, out of range, or
/// that names a missing file.
pub fn cell_config(
    map: &BTreeMap<String, Value>,
    folder: &Path,
    externals: &Externals,
    path: &str,
) -> Result<CellConfig, SchemaError> {
    let at = |key: &str| format!("{path}.{key}");
    check_names(map, externals, path)?;
    let name = map.get("integrator").and_then(Value::as_str);
    let row = name.and_then(integrator);
    let declared = name.and_then(|name| externals.get(name));
    let (common, params): (BTreeMap<_, _>, BTreeMap<_, _>) = map
        .iter()
        .map(|(k, v)| (k.clone(), v.clone()))
        .partition(|(k, _)| is_common(k));
    let fields = row.map(|r| r.params.fields).unwrap_or_default();
    let values = declared
        .and_then(|technique| technique.get(VALUES))
        .and_then(Value::as_map);
    let mut own: Vec<&str> = fields.iter().map(|f| f.key).collect();
    own.extend(
        values
            .into_iter()
            .flat_map(|v| v.keys().map(String::as_str)),
    );
    let unknown = params.iter().find(|(key, _)| !own.contains(&key.as_str()));
    if let Some((key, value)) = unknown {
        return Err(unknown_param(key, value, own, &at(key)));
    }
    RENDER.check(path, &common)?;
    let (Some(row), Some(name)) = (row, name) else {
        return Err(missing(path, "integrator"));
    };
    let params = match declared {
        Some(technique) => with_values(technique, params, path)?,
        None => {
            row.params.check(path, &params)?;
            params
        }
    };
    let Some(scene) = text(&common, "scene") else {
        return Err(missing(path, "scene"));
    };
    Ok(CellConfig {
        scene_file: find_file(&scene, folder, &at("scene"), "scene")?,
        scene,
        scene_options: scene_options(common.get("scene_options"), &at("scene_options"))?,
        integrator: name.to_owned(),
        params,
        max_depth: integer(common.get("max_depth")),
        resolution: resolution(&common, path)?,
        rr_start: integer(nested(&common, "rr", "start")),
        filter: filter(&common),
        set: scene_changes(&common, folder, path)?,
        films: films(common.get("films")),
        timing: timing(common.get("film"), &at("film"))?,
        denoise: denoise(&common),
        sampler: text(&common, "sampler").unwrap_or_else(|| SAMPLER_NAMES[0].to_owned()),
        accel: common
            .get("accel")
            .and_then(Value::as_map)
            .map(AccelSpec::from_map)
            .unwrap_or_default(),
        shaders: shaders(&common, folder, &at("shaders"))?,
        backend: text(&common, "backend").unwrap_or_else(|| "auto".to_owned()),
        fallback: None,
    })
}

/// Remedy for parameters of a technique that are not keys of the render table itself.
const WHERE_PARAMETERS_ARE: &str =
    "parameters of a technique are keys of the same table: integrator = \"nee\", mis = \"balance\"";

/// Returns the error of a key that is neither common nor one of the technique's `own`: the most
/// similar key, the techniques that have it, or the place of the parameters that `value` contains.
fn unknown_param(key: &str, value: &Value, own: Vec<&str>, path: &str) -> SchemaError {
    let known = RENDER.fields.iter().map(|f| f.key);
    let mut error = unknown_key(path, key, known.chain(own));
    let owners = |key: &str| -> Vec<String> {
        let has_it = |row: &&IntegratorRow| row.params.fields.iter().any(|f| f.key == key);
        let owners = integrators().filter(has_it);
        owners.map(|row| format!("`{}`", row.name)).collect()
    };
    let mut inside = value.as_map().into_iter().flat_map(BTreeMap::keys);
    let of = owners(key);
    if !of.is_empty() {
        error.help = Some(format!("it is a key of {}", of.join(", ")));
    } else if inside.any(|key| !owners(key).is_empty()) {
        error.help = Some(WHERE_PARAMETERS_ARE.to_owned());
    }
    error
}

/// Returns the parameters of a declared technique with the values that a render table gives.
fn with_values(
    technique: &BTreeMap<String, Value>,
    given: BTreeMap<String, Value>,
    path: &str,
) -> Result<BTreeMap<String, Value>, SchemaError> {
    if let Some((key, value)) = given
        .iter()
        .find(|(_, value)| matches!(value, Value::Nil | Value::List(_) | Value::Map(_)))
    {
        return Err(SchemaError {
            path: format!("{path}.{key}"),
            problem: format!(
                "expected text, a number or a boolean, found {}",
                value.kind()
            ),
            help: None,
            key: key.clone(),
        });
    }
    let mut technique = technique.clone();
    if let Some(Value::Map(values)) = technique.get_mut(VALUES) {
        values.extend(given);
    }
    Ok(technique)
}

/// Returns the error if an integrator is neither in the table nor declared by the script.
///
/// # Errors
/// Returns an error with the most similar name, or the known ones.
pub fn check_integrator(name: &str, externals: &Externals, path: &str) -> Result<(), SchemaError> {
    let is_known = integrator(name).is_some_and(|row| !is_declared(row));
    if is_known || externals.contains_key(name) {
        return Ok(());
    }
    let declared = externals.keys().map(String::as_str);
    let mut error = SchemaError {
        path: path.to_owned(),
        problem: format!("unknown integrator `{name}`"),
        help: Some(integrator_help(name, declared)),
        key: "integrator".to_owned(),
    };
    if let Some(name) = name.strip_prefix("external:") {
        error.help = Some(format!(
            "declare another renderer by external {{ name = \"{name}\", command = .. }}"
        ));
    }
    Err(error)
}

/// Checks the names of integrator and backend, so that errors list the known ones.
fn check_names(
    map: &BTreeMap<String, Value>,
    externals: &Externals,
    path: &str,
) -> Result<(), SchemaError> {
    match map.get("integrator") {
        Some(Value::Str(name)) => {
            check_integrator(name, externals, &format!("{path}.integrator"))?;
        }
        Some(table @ (Value::Map(_) | Value::List(_))) => {
            return Err(SchemaError {
                path: format!("{path}.integrator"),
                problem: format!("expected a name, found {}", table.kind()),
                help: Some(WHERE_PARAMETERS_ARE.to_owned()),
                key: "integrator".to_owned(),
            });
        }
        _ => {}
    }
    if let Some(Value::Str(name)) = map.get("backend")
        && !BACKEND_NAMES.contains(&name.as_str())
    {
        return Err(with_key(
            unknown_name(&format!("{path}.backend"), name, "backend", BACKEND_NAMES),
            "backend",
        ));
    }
    Ok(())
}

/// Checks the options of a scene: named strings, numbers and booleans.
fn scene_options(
    value: Option<&Value>,
    path: &str,
) -> Result<BTreeMap<String, Value>, SchemaError> {
    let key = "scene_options";
    let fail = |problem: String, key: &str| {
        Err(SchemaError {
            path: path.to_owned(),
            problem,
            help: None,
            key: key.to_owned(),
        })
    };
    match value {
        None => Ok(BTreeMap::new()),
        Some(Value::List(items)) if items.is_empty() => Ok(BTreeMap::new()),
        Some(Value::Map(map)) => {
            let plain = |v: &Value| {
                matches!(
                    v,
                    Value::Bool(_) | Value::Int(_) | Value::Num(_) | Value::Str(_)
                )
            };
            match map.iter().find(|(_, v)| !plain(v)) {
                Some((name, v)) => fail(
                    format!(
                        "{name}: expected a string, a number or a boolean, found {}",
                        v.kind()
                    ),
                    name,
                ),
                None => Ok(map.clone()),
            }
        }
        Some(other) => fail(
            format!("expected a table of options, found {}", other.kind()),
            key,
        ),
    }
}

/// Keys of a cell's render table that its reference does not inherit.
const NOT_INHERITED: [&str; 6] = ["films", "film", "denoise", "atrous", "accel", "shaders"];

/// Returns the render table of a reference: the cell's own with the fields of `overrides`. Nested
/// tables (`set`, `aa`, `camera`, `rr`, `accel`, `scene_options`) are merged key by key. A
/// different integrator does not inherit the parameters of the cell's integrator. Layers, time axis
/// and acceleration structure are never inherited, since they do not affect the picture; nor are a
/// denoiser and modified shaders, since their bias would be that of the reference.
pub fn merge(
    own: &BTreeMap<String, Value>,
    overrides: &BTreeMap<String, Value>,
) -> BTreeMap<String, Value> {
    let other = overrides
        .get("integrator")
        .is_some_and(|i| own.get("integrator") != Some(i));
    let mut merged: BTreeMap<String, Value> = own
        .iter()
        .filter(|(k, _)| (!other || is_common(k)) && !NOT_INHERITED.contains(&k.as_str()))
        .map(|(k, v)| (k.clone(), v.clone()))
        .collect();
    for (key, value) in overrides {
        match (merged.get_mut(key), value) {
            (Some(Value::Map(fields)), Value::Map(changes)) => {
                fields.extend(changes.iter().map(|(k, v)| (k.clone(), v.clone())));
            }
            (Some(Value::Map(_)), Value::List(items)) if items.is_empty() => {}
            _ => {
                merged.insert(key.clone(), value.clone());
            }
        }
    }
    merged
}

/// Returns whether a key belongs to the render table itself, not to an integrator.
pub fn is_common(key: &str) -> bool {
    RENDER.fields.iter().any(|f| f.key == key)
}

/// Sets the key of an error.
fn with_key(mut error: SchemaError, key: &str) -> SchemaError {
    error.key = key.to_owned();
    error
}

/// Returns the error for a missing field.
fn missing(path: &str, key: &str) -> SchemaError {
    SchemaError {
        path: path.to_owned(),
        problem: format!("`{key}` is missing"),
        help: None,
        key: String::new(),
    }
}

fn text(map: &BTreeMap<String, Value>, key: &str) -> Option<String> {
    map.get(key).and_then(Value::as_str).map(str::to_owned)
}

fn integer(value: Option<&Value>) -> Option<u32> {
    value
        .and_then(Value::as_i64)
        .and_then(|i| u32::try_from(i).ok())
}

/// Returns a field of a nested table.
fn nested<'a>(map: &'a BTreeMap<String, Value>, key: &str, field: &str) -> Option<&'a Value> {
    map.get(key).and_then(Value::as_map)?.get(field)
}

fn resolution(map: &BTreeMap<String, Value>, path: &str) -> Result<Option<[u32; 2]>, SchemaError> {
    let Some(items) = map.get("resolution").and_then(Value::as_list) else {
        return Ok(None);
    };
    match items
        .iter()
        .map(|v| integer(Some(v)))
        .collect::<Option<Vec<_>>>()
        .as_deref()
    {
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
    let named = nested(map, "aa", "filter")
        .and_then(Value::as_str)
        .and_then(FilterKind::from_name);
    let kind = named.unwrap_or(FilterKind::Box);
    FilterSpec {
        kind,
        radius: nested(map, "aa", "radius")
            .and_then(Value::as_f64)
            .map_or(0.5, |r| r as f32),
    }
}

/// Returns the layers of a checked field in the order of their table, so that the order in the
/// script has no effect.
fn films(value: Option<&Value>) -> Vec<Layer> {
    let named = value
        .map(|v| v.as_list().unwrap_or(std::slice::from_ref(v)))
        .unwrap_or_default();
    let mut layers: Vec<Layer> = named
        .iter()
        .filter_map(|v| Layer::from_name(v.as_str()?))
        .collect();
    layers.sort();
    layers.dedup();
    layers
}

/// Returns the time axis of a checked `film`.
fn timing(value: Option<&Value>, path: &str) -> Result<Option<Timing>, SchemaError> {
    value
        .and_then(Value::as_map)
        .map_or(Ok(None), |film| Timing::from_film(film, path))
}

/// Returns the denoiser of a checked table.
fn denoise(map: &BTreeMap<String, Value>) -> Option<Denoise> {
    let none = BTreeMap::new();
    let parameters = map.get("atrous").and_then(Value::as_map).unwrap_or(&none);
    Denoise::from_name(map.get("denoise")?.as_str()?, parameters)
}

/// Returns the shaders of a table.
fn shaders(
    map: &BTreeMap<String, Value>,
    folder: &Path,
    path: &str,
) -> Result<Shaders, SchemaError> {
    match text(map, "shaders") {
        None => Ok(Shaders::Unset),
        Some(name) if name == BUILT_IN => Ok(Shaders::BuiltIn),
        Some(name) => Ok(Shaders::Folder(ShaderFolder {
            path: find_folder(&name, folder, path, "shaders")?,
            hash: String::new(),
        })),
    }
}

/// Returns the changes to the scene from `set`, `view` and `camera`, by path.
fn scene_changes(
    map: &BTreeMap<String, Value>,
    folder: &Path,
    path: &str,
) -> Result<BTreeMap<String, Value>, SchemaError> {
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
                problem: format!(
                    "expected a table of changes by path, found {}",
                    other.kind()
                ),
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
            problem: "given twice: `set` also has `camera`".to_owned(),
            help: None,
            key: "view".to_owned(),
        });
    }
    for (key, value) in map
        .get("camera")
        .and_then(Value::as_map)
        .into_iter()
        .flatten()
    {
        let change = format!("camera.{key}");
        if changes.insert(change.clone(), value.clone()).is_some() {
            return Err(SchemaError {
                path: format!("{path}.camera.{key}"),
                problem: format!("given twice: `set` also has `{change}`"),
                help: None,
                key: key.clone(),
            });
        }
    }
    Ok(changes)
}

/// Returns whether a path of `set` is a texture slot of a material.
fn names_texture(change: &str) -> bool {
    change.starts_with("materials.")
        && change
            .rsplit('.')
            .next()
            .is_some_and(|param| TextureSlot::from_name(param).is_some())
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backends::BACKENDS;

    fn map(pairs: &[(&str, Value)]) -> BTreeMap<String, Value> {
        pairs
            .iter()
            .map(|(k, v)| ((*k).to_owned(), v.clone()))
            .collect()
    }

    #[test]
    fn merging_is_one_level_deep_and_another_integrator_starts_without_parameters() {
        let aa = Value::Map(map(&[("filter", "gauss".into()), ("radius", 0.5.into())]));
        let own = map(&[
            ("integrator", "nee".into()),
            ("mis", "power".into()),
            ("aa", aa),
            ("scene", "a.scn".into()),
        ]);
        let wide = Value::Map(map(&[("radius", 2.0.into())]));
        let merged = merge(&own, &map(&[("aa", wide.clone())]));
        assert_eq!(nested(&merged, "aa", "filter"), Some(&"gauss".into()));
        assert_eq!(nested(&merged, "aa", "radius"), Some(&Value::Int(2)));
        assert!(merged.contains_key("mis"));
        let with_films = merge(
            &map(&[("films", "depth".into()), ("scene", "a.scn".into())]),
            &BTreeMap::new(),
        );
        assert_eq!(
            with_films,
            map(&[("scene", "a.scn".into())]),
            "a reference does not inherit films"
        );
        assert!(
            merge(&own, &map(&[("films", "depth".into())])).contains_key("films"),
            "but may set its own"
        );
        let merged = merge(&own, &map(&[("integrator", "bpt".into())]));
        assert!(!merged.contains_key("mis") && merged.contains_key("scene"));
        let merged = merge(
            &own,
            &map(&[
                ("integrator", "nee".into()),
                ("aa", Value::List(Vec::new())),
            ]),
        );
        assert_eq!(merged, own);
    }

    #[test]
    fn layers_are_in_the_order_of_their_table_each_once() {
        let asked = ["normal", "depth", "albedo", "depth"]
            .map(Value::from)
            .to_vec();
        assert_eq!(
            films(Some(&Value::List(asked))),
            [Layer::Depth, Layer::Albedo, Layer::Normal]
        );
        assert_eq!(films(Some(&"rays".into())), [Layer::Rays]);
        assert!(films(None).is_empty() && films(Some(&Value::List(Vec::new()))).is_empty());
    }

    #[test]
    fn names_in_the_schema_are_those_of_the_tables() {
        assert!(
            super::super::render_schema::INTEGRATOR_NAMES
                .iter()
                .all(|n| integrator(n).is_some())
        );
        assert_eq!(BACKEND_NAMES[0], "auto");
        assert!(BACKENDS.iter().all(|b| BACKEND_NAMES.contains(&b.name)));
    }
}
