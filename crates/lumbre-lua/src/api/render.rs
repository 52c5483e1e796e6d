//! Conversion of the table that a script's `render` function returns to [`Settings`].

use std::collections::BTreeMap;
use std::path::Path;

use super::builder::Externals;
use super::render_schema::{BACKEND_NAMES, RENDER};
use lumbre_light::transport::integrator::external::is_declared;
use lumbre_light::transport::integrator::{IntegratorRow, integrator, integrators};
use lumbre_light::value::Value;
use lumbre_light::value::schema::{SchemaError, unknown_key, unknown_name};
use lumbre_night::experiment::plan::integrator_help;
use lumbre_render::Settings;
use lumbre_render::external::technique::VALUES;
use lumbre_render::settings::{Given, SETTINGS, setting};

/// Checks a render table and converts it. `externals` are the techniques that the script declares.
/// Error paths begin with `path`.
///
/// # Errors
/// Returns an error for the first field that is unknown, missing, of a wrong type, out of range, or
/// that names a missing file.
pub fn settings(
    map: &BTreeMap<String, Value>,
    folder: &Path,
    externals: &Externals,
    path: &str,
) -> Result<Settings, SchemaError> {
    let at = |key: &str| format!("{path}.{key}");
    check_names(map, externals, path)?;
    let name = map.get("integrator").and_then(Value::as_str);
    let row = name.and_then(integrator);
    let declared = name.and_then(|name| externals.get(name));
    let (common, params): (BTreeMap<_, _>, BTreeMap<_, _>) = map
        .iter()
        .map(|(k, v)| (k.clone(), v.clone()))
        .partition(|(k, _)| is_setting(k));
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
    let mut settings = Settings::new(name);
    settings.params = params;
    let given = Given {
        map: &common,
        folder,
        path,
    };
    for row in &SETTINGS {
        (row.read)(&mut settings, &given)?;
    }
    Ok(settings)
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
        return Err(SchemaError::new(
            format!("{path}.{key}"),
            key.clone(),
            format!(
                "expected text, a number or a boolean, found {}",
                value.kind()
            ),
        ));
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
    let mut error = SchemaError::new(path, "integrator", format!("unknown integrator `{name}`"))
        .with_help(integrator_help(name, declared));
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
            return Err(SchemaError::new(
                format!("{path}.integrator"),
                "integrator",
                format!("expected a name, found {}", table.kind()),
            )
            .with_help(WHERE_PARAMETERS_ARE));
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
        .filter(|(k, _)| setting(k).map_or(!other, |row| row.inherited))
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
pub fn is_setting(key: &str) -> bool {
    setting(key).is_some()
}

/// Sets the key of an error.
fn with_key(mut error: SchemaError, key: &str) -> SchemaError {
    error.key = key.to_owned();
    error
}

/// Returns the error for a missing field.
fn missing(path: &str, key: &str) -> SchemaError {
    SchemaError::new(path, "", format!("`{key}` is missing"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumbre_night::backends::BACKENDS;

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
        let both = map(&[("filter", "gauss".into()), ("radius", Value::Int(2))]);
        assert_eq!(merged["aa"], Value::Map(both));
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
    fn names_in_the_schema_are_those_of_the_backends() {
        assert_eq!(BACKEND_NAMES[0], "auto");
        assert!(BACKENDS.iter().all(|b| BACKEND_NAMES.contains(&b.name)));
    }
}
