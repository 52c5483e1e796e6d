//! `x:measure`, and the constructors `metric.NAME` and `tonemap.NAME`, one for each row of their
//! tables.

use std::collections::BTreeMap;
use std::rc::Rc;

use mlua::{Lua, MultiValue, UserData, UserDataFields, Value as LuaValue};

use super::axis::is_name;
use super::{ApiFn, Args, functions};
use crate::error::ScriptError;
use crate::kind::{KIND, kind};
use crate::state::Shared;
use crate::strict;
use lumbre_light::value::schema::{SchemaError, Ty, duration_s, unknown_name};
use lumbre_light::value::{Value, suggest};
use lumbre_metrics::tonemap::{TONEMAPS, Tonemap};
use lumbre_metrics::{METRICS, MetricSpec};
use lumbre_night::experiment::spec::{MeasureSpec, Snapshots};

/// Largest number of metric columns of one experiment.
const MAX_COLUMNS: usize = 64;

/// Shortest time between two measurements in seconds. Shorter ones would take longer to measure
/// than to render.
const MIN_EVERY_S: f64 = 0.01;

/// Names of the other columns in the same files.
const RESERVED: &[&str] = &[
    "wave",
    "samples",
    "render_s",
    "wall_s",
    "measure_s",
    "paths",
    "rays",
    "invalid",
    "mpaths_s",
    "cell",
    "rep",
    "outcome",
    "stop",
];

lumbre_light::table! {
    /// Option `keep` of `x:measure`.
    pub const KEEP = "Keep", "Pictures that are stored for every run.";
    exr = "last": Ty::Word(&["last", "pow2"]),
        "OpenEXR pictures: `last` stores the final picture, `pow2` also one at every power of two \
         of samples per pixel";
    png = "last": Ty::Word(&["last", "every"]),
        "PNG pictures, tone-mapped by `display`: `last` stores the final picture, `every` also one \
         at every measurement";
    films = "picture": Ty::Word(&["picture", "files"]),
        "layers of `films` that are a single film: `picture` stores them as channels of the final \
         OpenEXR picture, `files` each in a file of its own";
}

lumbre_light::table! {
    /// Argument of `x:measure`; every other key is a metric column.
    pub const MEASURE = "Measure",
        "Measurements of a cell while it renders. Every other key names a column and holds a \
         metric: rmse = metric.rmse().";
    every = "\"0.5s\"": Ty::Duration,
        "longest render time between two measurements, at least 0.01 s";
    keep = "": Ty::Table(&KEEP), "pictures that are stored for every run";
    display = "tonemap.srgb()": Ty::Any("Tonemap"), "tone map of PNG files and of the live picture";
}

functions! {
    /// Method that declares the measurements.
    pub const METHODS;
    "x:measure" = measure,
        "Declares the metrics that compare a cell with its reference while it renders, and the \
         pictures that are stored." {
        "options": "Measure", "Metric columns, interval and stored pictures.";
    }
}

/// Lua object of a metric that is not yet assigned to a column.
#[derive(Clone, Debug)]
pub struct MetricObject(MetricSpec);

impl UserData for MetricObject {
    fn add_fields<F: UserDataFields<Self>>(fields: &mut F) {
        fields.add_meta_field(KIND, "a metric");
    }
}

/// Adds the functions `metric.NAME` and `tonemap.NAME` to the globals, one for each row of their
/// tables.
///
/// # Errors
/// Returns an error if the memory limit is exceeded.
pub fn register(lua: &Lua, shared: &Rc<Shared>) -> mlua::Result<()> {
    let metrics = lua.create_table()?;
    for row in METRICS {
        let shared = Rc::clone(shared);
        metrics.raw_set(
            row.name,
            lua.create_function(move |lua, values: MultiValue| {
                let path = format!("metric.{}", row.name);
                let made = options(values, &path).and_then(|o| MetricSpec::new(&path, row.name, o));
                match made {
                    Ok(spec) => lua.create_userdata(MetricObject(spec)),
                    Err(e) => Err(locate_error_here(&shared, lua, e)),
                }
            })?,
        )?;
    }
    lua.globals().raw_set("metric", metrics)?;
    let tonemaps = lua.create_table()?;
    for (name, _) in TONEMAPS {
        let shared = Rc::clone(shared);
        tonemaps.raw_set(
            *name,
            lua.create_function(move |lua, values: MultiValue| {
                let path = format!("tonemap.{name}");
                let made = options(values, &path).and_then(|mut map| {
                    if map.insert("kind".to_owned(), Value::from(*name)).is_some() {
                        let known = TONEMAPS
                            .iter()
                            .filter(|(n, _)| n == name)
                            .flat_map(|(_, t)| t.fields);
                        return Err(unknown_name(
                            &format!("{path}.kind"),
                            "kind",
                            "key",
                            known.map(|f| f.key),
                        ));
                    }
                    Tonemap::from_value(&path, &Value::Map(map.clone())).map(|_| map)
                });
                match made {
                    Ok(map) => data_table(lua, &map),
                    Err(e) => Err(locate_error_here(&shared, lua, e)),
                }
            })?,
        )?;
    }
    lua.globals().raw_set("tonemap", tonemaps)
}

/// Converts a schema error to a Lua error at the current call.
fn locate_error_here(shared: &Shared, lua: &Lua, error: SchemaError) -> mlua::Error {
    let place = shared.call_site(lua);
    mlua::Error::external(shared.sources.borrow().locate_error(&place, error))
}

/// Returns the options of a constructor, which takes no argument or one table.
fn options(values: MultiValue, path: &str) -> Result<BTreeMap<String, Value>, SchemaError> {
    let fail = |problem: String| Err(SchemaError::new(path, "", problem));
    if values.len() > 1 {
        return fail(format!(
            "expected one table of options, found {} arguments",
            values.len()
        ));
    }
    match values.into_iter().next() {
        None | Some(LuaValue::Nil) => Ok(BTreeMap::new()),
        Some(LuaValue::Table(table)) => {
            let mut map = BTreeMap::new();
            for (key, value) in strict::entries(&table, path)? {
                let value = strict::read(&value, &format!("{path}.{key}"), &key)?;
                map.insert(key, value);
            }
            Ok(map)
        }
        Some(other) => fail(format!(
            "expected a table of options, found {}",
            kind(&other)
        )),
    }
}

/// Converts a flat map of numbers and text to a Lua table.
fn data_table(lua: &Lua, map: &BTreeMap<String, Value>) -> mlua::Result<mlua::Table> {
    let table = lua.create_table()?;
    for (key, value) in map {
        match value {
            Value::Int(i) => table.raw_set(key.as_str(), *i)?,
            Value::Num(x) => table.raw_set(key.as_str(), *x)?,
            other => table.raw_set(key.as_str(), other.to_string())?,
        }
    }
    Ok(table)
}

fn measure(args: &Args) -> Result<LuaValue, ScriptError> {
    let table = args.table(0, "options")?;
    let (spec, display) = read_measure(&table).map_err(|e| args.locate_error(e))?;
    let mut builder = args.shared.builder.borrow_mut();
    args.only_once(builder.measure.as_ref().map(|(_, place)| place))?;
    builder.measure = Some((spec, args.place.clone()));
    builder.display = display;
    Ok(LuaValue::Nil)
}

/// Converts the argument of `x:measure`. Returns the tone map too if the script sets it.
fn read_measure(table: &mlua::Table) -> Result<(MeasureSpec, Option<Tonemap>), SchemaError> {
    let fields = strict::fields(table, &MEASURE, "measure", true)?;
    let mut measure = MeasureSpec::default();
    if let Some(every) = fields.values.get("every").and_then(duration_s) {
        if every < MIN_EVERY_S {
            let problem = format!("{every} s is too short: expected at least {MIN_EVERY_S} s");
            return Err(SchemaError::new("measure.every", "every", problem));
        }
        measure.every_s = every;
    }
    let keep = |kind: &str| fields.values.get("keep")?.as_map()?.get(kind)?.as_str();
    if keep("exr") == Some("pow2") {
        measure.snapshots = Snapshots::Pow2;
    }
    measure.captures = keep("png") == Some("every");
    measure.film_files = keep("films") == Some("files");
    let display = fields.values.get("display");
    let display = display
        .map(|display| Tonemap::from_value("measure.display", display))
        .transpose()?;
    measure.display = display.unwrap_or(measure.display);
    for (column, value) in &fields.extra {
        measure.metrics.push(metric_column(column, value)?);
    }
    if measure.metrics.len() > MAX_COLUMNS {
        let problem = format!("more than {MAX_COLUMNS} metric columns");
        return Err(SchemaError::new("measure", "", problem));
    }
    Ok((measure, display))
}

/// Returns the error for a name that is no metric column, or none of `known`. A metric that is not
/// measured can be added.
pub fn unknown_column(path: &str, name: &str, known: &[&str]) -> SchemaError {
    let mut error = unknown_name(path, name, "metric column", known.iter().copied());
    if METRICS.iter().any(|row| row.name == name) {
        error.help = Some(format!("add {name} = metric.{name}() to x:measure"));
    } else if known.is_empty() {
        error.help = Some("x:measure declares no metric".to_owned());
    }
    error
}

/// Converts an entry of `x:measure` to a metric column.
fn metric_column(column: &str, value: &LuaValue) -> Result<MetricSpec, SchemaError> {
    let path = format!("measure.{column}");
    let fail = |problem: String, help: Option<String>| {
        Err(SchemaError {
            path: path.clone(),
            problem,
            help,
            key: column.to_owned(),
        })
    };
    let object = match value {
        LuaValue::UserData(data) => data.borrow::<MetricObject>().ok().map(|m| m.0.clone()),
        _ => None,
    };
    let Some(mut spec) = object else {
        // A misspelt option is not a metric; a metric without parentheses is a function.
        let options = MEASURE.fields.iter().map(|f| f.key);
        let help = match (value, suggest::nearest(column, options)) {
            (LuaValue::Function(_), _) => Some("add parentheses: metric.rmse()".to_owned()),
            (_, Some(near)) => Some(format!("did you mean `{near}`?")),
            _ => Some("a column holds a metric, such as metric.rmse()".to_owned()),
        };
        return fail(format!("expected a metric, found {}", kind(value)), help);
    };
    if !is_name(column) {
        return fail(
            "cannot name a column".to_owned(),
            Some("use at most 40 letters, digits and `_`, not starting with a digit".to_owned()),
        );
    }
    if RESERVED.contains(&column) {
        return fail(
            format!("`{column}` is always recorded: choose another name for the metric"),
            None,
        );
    }
    spec.column = column.to_owned();
    Ok(spec)
}
