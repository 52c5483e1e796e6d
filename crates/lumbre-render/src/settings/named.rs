//! Settings that are given by name, as on the command line, and their places in a render table.

use std::collections::BTreeMap;

use super::keys::{SETTINGS, setting};
use lumbre_light::transport::integrator::integrators;
use lumbre_light::value::Value;
use lumbre_light::value::schema::Ty;

/// Beginnings of paths of values in a scene.
const SCENE: [&str; 5] = ["camera", "materials", "entities", "lights", "environment"];

/// Returns the keys that lead to a setting in a render table; `None` if the name is none. It is a
/// key of the table or, after a dot, of a table in it (`max_depth`, `aa.filter`), `technique` for
/// the integrator, a parameter of an integrator, or the path of a value in the scene, which is a key
/// of `set`.
fn keys(name: &str) -> Option<Vec<&str>> {
    let (head, rest) = name.split_once('.').unwrap_or((name, ""));
    let row = setting(head);
    let is_table = row.is_some_and(|row| matches!(row.field.ty, Ty::Table(_)));
    match row {
        _ if name == "technique" => Some(vec!["integrator"]),
        _ if SCENE.contains(&head) && !rest.is_empty() => Some(vec!["set", name]),
        Some(_) if rest.is_empty() => Some(vec![name]),
        Some(_) if is_table => Some(name.split('.').collect()),
        Some(_) if head == "scene_options" => Some(vec![head, rest]),
        _ => parameters().any(|key| key == name).then(|| vec![name]),
    }
}

/// Returns the names of the parameters of all integrators.
fn parameters() -> impl Iterator<Item = &'static str> {
    let all = integrators();
    all.flat_map(|row| row.params.fields.iter().map(|field| field.key))
}

/// Whether a name is that of a setting.
pub fn is_setting(name: &str) -> bool {
    keys(name).is_some()
}

/// Whether a name is that of a setting which a reference has in common with its cell, and which is
/// not its technique.
pub fn is_inherited(name: &str) -> bool {
    let key = keys(name).and_then(|keys| keys.first().copied());
    let key = key.filter(|key| *key != "integrator");
    key.and_then(setting).is_some_and(|row| row.inherited)
}

/// Returns the names of settings for suggestions; without paths of the scene.
pub fn names() -> impl Iterator<Item = &'static str> {
    let rows = SETTINGS.iter().map(|row| row.field.key);
    rows.chain(["technique"]).chain(parameters())
}

/// Writes a setting into a render table. A name that is no setting becomes a key of the table, which
/// then refuses it. Two numbers with an `x` between are a resolution.
pub fn set(table: &mut BTreeMap<String, Value>, name: &str, value: Value) {
    let keys = keys(name).unwrap_or_else(|| vec![name]);
    let value = match (keys.as_slice(), &value) {
        (["resolution"], Value::Str(text)) => size(text).unwrap_or(value),
        _ => value,
    };
    let Some((last, outer)) = keys.split_last() else {
        return;
    };
    let mut inner = table;
    for key in outer {
        let entry = inner.entry((*key).to_owned());
        let table = entry.or_insert_with(|| Value::Map(BTreeMap::new()));
        // What is no table yet gives way: an empty table of Lua is a list.
        if !matches!(table, Value::Map(_)) {
            *table = Value::Map(BTreeMap::new());
        }
        let Value::Map(fields) = table else { return };
        inner = fields;
    }
    inner.insert((*last).to_owned(), value);
}

/// Parses width and height such as `640x480`.
fn size(text: &str) -> Option<Value> {
    let (width, height) = text.split_once('x')?;
    let side = |text: &str| text.trim().parse().ok().map(Value::Int);
    Some(Value::List(vec![side(width)?, side(height)?]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(settings: &[(&str, Value)]) -> String {
        let mut table = BTreeMap::new();
        for (name, value) in settings {
            set(&mut table, name, value.clone());
        }
        Value::Map(table).to_string()
    }

    #[test]
    fn settings_go_where_scripts_have_them() {
        assert_eq!(table(&[("max_depth", Value::Int(3))]), "{max_depth = 3}");
        assert_eq!(table(&[("technique", "nee".into())]), "{integrator = nee}");
        assert_eq!(table(&[("mis", "none".into())]), "{mis = none}");
        let filter = [("aa.filter", "tent".into()), ("aa.radius", Value::Int(1))];
        assert_eq!(table(&filter), "{aa = {filter = tent, radius = 1}}");
        let time = [("film.time.bins", Value::Int(8))];
        assert_eq!(table(&time), "{film = {time = {bins = 8}}}");
        let scene = [("materials.a.b.roughness", Value::number(0.5))];
        assert_eq!(table(&scene), "{set = {materials.a.b.roughness = 0.5}}");
        let camera = [("camera.aperture", Value::Int(1)), ("view", "front".into())];
        assert_eq!(
            table(&camera),
            "{set = {camera.aperture = 1}, view = front}"
        );
        let size = [("resolution", "64x48".into())];
        assert_eq!(table(&size), "{resolution = [64, 48]}");
        let options = [("scene_options.light", "sun".into())];
        assert_eq!(table(&options), "{scene_options = {light = sun}}");
    }

    #[test]
    fn other_names_are_no_settings() {
        for name in ["maxdepth", "aperture", "max_depth.x", "samples"] {
            assert!(!is_setting(name), "{name}");
        }
        assert!(names().any(|name| name == "max_depth") && names().any(|name| name == "mis"));
    }
}
