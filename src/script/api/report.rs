//! What is made of the results: figures and tables.

use std::rc::Rc;

use mlua::{Lua, UserData, Value as LuaValue};

use super::axis::known_axis;
use super::builder::Builder;
use super::{ApiFn, Args, Param, kind};
use crate::experiment::spec::{Axis, FigureKind, FigureSpec, FigureX, TableFormat, TableSpec, TableValue};
use crate::script::error::ScriptError;
use crate::script::source::Place;
use crate::script::state::Shared;
use crate::script::strict;
use crate::value::Value;
use crate::value::schema::{Field, SchemaError, Table, Ty, unknown_name};
use crate::value::suggest;

/// Most figures, and most tables, of one experiment.
const MAX_REPORTS: usize = 64;

/// The options of `x:figure`.
pub const FIGURE: Table = Table {
    name: "Figure",
    doc: "A figure, one picture for each combination of the facets.",
    fields: &[
        Field {
            key: "x",
            ty: Ty::Str,
            required: false,
            default: "render_s",
            doc: "horizontal axis: seconds inside the renderer, `samples` per pixel, or an axis of the sweep, over whose \
                  values it is drawn what finished runs have in the end",
        },
        Field {
            key: "y",
            ty: Ty::Object("string|TimeTo|(string|TimeTo)[]"),
            required: true,
            default: "",
            doc: "metric columns, one panel each; over an axis of the sweep whatever a table can show",
        },
        Field {
            key: "by",
            ty: Ty::Str,
            required: false,
            default: "one curve for each cell; over an axis, for each combination of the others that do not move with it",
            doc: "the axis that distinguishes curves",
        },
        Field {
            key: "facet",
            ty: Ty::OneOrMany(&Ty::Str),
            required: false,
            default: "one picture",
            doc: "the axes that distinguish pictures",
        },
        Field {
            key: "only",
            ty: Ty::Any("table<string, any>"),
            required: false,
            default: "everything",
            doc: "axes with the value or the list of values that are drawn: only = { builder = \"sah\" }",
        },
    ],
};

/// The options of `x:table`.
pub const TABLE: Table = Table {
    name: "ResultTable",
    doc: "A table over axes; other axes and repeats are averaged.",
    fields: &[
        Field {
            key: "value",
            ty: Ty::Object("string|TimeTo"),
            required: true,
            default: "",
            doc: "a metric column (its final value), `samples`, `render_s`, `mpaths_s`, `fps` (samples of every pixel \
                  per second of render time), `mrays_s`, of the hierarchy `accel_build_s`, `accel_nodes`, `accel_mib` and \
                  `accel_cost`, or time_to(column, threshold)",
        },
        Field {
            key: "rows",
            ty: Ty::OneOrMany(&Ty::Str),
            required: true,
            default: "",
            doc: "the axes whose values make the rows",
        },
        Field {
            key: "cols",
            ty: Ty::OneOrMany(&Ty::Str),
            required: false,
            default: "a single column",
            doc: "the axes whose values make the columns",
        },
        Field {
            key: "format",
            ty: Ty::OneOrMany(&Ty::Word(&["md", "csv"])),
            required: false,
            default: "both",
            doc: "the files that are written: Markdown, comma-separated values",
        },
    ],
};

/// The constructor of a table's value.
pub const GLOBALS: &[ApiFn] = &[ApiFn {
    name: "time_to",
    params: &[
        Param { name: "column", ty: "string", doc: "A metric column." },
        Param { name: "threshold", ty: "number", doc: "The value to reach, from the side that is worse." },
    ],
    returns: "TimeTo",
    doc: "For tables: render seconds until a metric first reached a threshold.",
    call: time_to,
}];

/// The methods that declare figures and tables.
pub const METHODS: &[ApiFn] = &[
    ApiFn {
        name: "x:table",
        params: &[
            Param { name: "name", ty: "string", doc: "The name of its files." },
            Param { name: "options", ty: "ResultTable", doc: "What it shows." },
        ],
        returns: "",
        doc: "Writes a table of the results.",
        call: table,
    },
    ApiFn {
        name: "x:figure",
        params: &[
            Param { name: "name", ty: "string", doc: "The name of its files." },
            Param { name: "options", ty: "Figure", doc: "What it shows." },
        ],
        returns: "",
        doc: "Draws curves of the results: errors as runs go on, or what they have in the end over an axis of the sweep.",
        call: figure,
    },
];

/// `time_to(column, threshold)` as scripts hold it.
#[derive(Clone, Debug)]
pub struct TimeToObject {
    column: String,
    threshold: f64,
}

impl UserData for TimeToObject {}

fn time_to(shared: &Rc<Shared>, lua: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    args.at_most(shared, 2)?;
    let (column, threshold) = (args.text(shared, 0, "column")?, args.number(shared, 1, "threshold")?);
    let object = TimeToObject { column, threshold };
    Ok(LuaValue::UserData(lua.create_userdata(object).map_err(|e| shared.convert(&e))?))
}

/// The name of a figure or table, which becomes a file's.
fn file_name(shared: &Shared, args: &Args) -> Result<String, ScriptError> {
    args.at_most(shared, 2)?;
    let name = args.text(shared, 0, "name")?;
    let legal = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '.');
    if name.is_empty() || name.len() > 60 || name.starts_with('.') || !name.chars().all(legal) {
        let help = "letters, digits, `_`, `-` and `.`, not starting with a dot, at most 60".to_owned();
        return Err(args.error(shared, format!("`{name}` cannot name a file"), Some(help)));
    }
    Ok(name)
}

/// Rejects a second figure or table of the same name, and too many.
fn is_new<T>(
    shared: &Shared,
    args: &Args,
    name: &str,
    said: &[(T, Place)],
    name_of: fn(&T) -> &str,
) -> Result<(), ScriptError> {
    // File systems that ignore case would let one replace the other.
    if let Some((_, place)) = said.iter().find(|(t, _)| name_of(t).eq_ignore_ascii_case(name)) {
        return Err(args.error(shared, format!("`{name}` is already there, in line {}", place.line), None));
    }
    if said.len() >= MAX_REPORTS {
        return Err(args.error(shared, format!("more than {MAX_REPORTS} of them"), None));
    }
    Ok(())
}

/// The names in a field that is one name or a list of names.
fn names(value: Option<&Value>) -> Vec<String> {
    match value {
        Some(Value::Str(s)) => vec![s.clone()],
        Some(Value::List(items)) => items.iter().filter_map(Value::as_str).map(str::to_owned).collect(),
        _ => Vec::new(),
    }
}

fn figure(shared: &Rc<Shared>, _: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    let name = file_name(shared, args)?;
    let path = format!("figure.{name}");
    let options = args.table(shared, 1, "options")?;
    let read = || -> Result<FigureSpec, SchemaError> {
        let fields = strict::fields(&options, &FIGURE, &path, false)?;
        let word = |key: &str| fields.values.get(key).and_then(Value::as_str);
        let y = fields.objects.get("y").map_or(Ok(Vec::new()), |y| quantities(y, &path))?;
        let columns =
            |y: Vec<TableValue>| y.iter().map(|value| plain_column(value, &path)).collect::<Result<Vec<_>, _>>();
        let kind = match word("x").unwrap_or("render_s") {
            "render_s" => FigureKind::Convergence { x: FigureX::RenderS, y: columns(y)? },
            "samples" => FigureKind::Convergence { x: FigureX::Samples, y: columns(y)? },
            axis => FigureKind::Sweep { over: axis.to_owned(), y },
        };
        Ok(FigureSpec {
            name: name.clone(),
            kind,
            by: word("by").map(str::to_owned),
            facet: names(fields.values.get("facet")),
            only: kept(fields.values.get("only"), &path)?,
        })
    };
    let spec = read().map_err(|e| args.blame(shared, e))?;
    let mut builder = shared.builder.borrow_mut();
    is_new(shared, args, &name, &builder.figures, |f| &f.name)?;
    builder.figures.push((spec, args.place.clone()));
    Ok(LuaValue::Nil)
}

/// What a figure shows: one value, or a list of them.
fn quantities(y: &LuaValue, path: &str) -> Result<Vec<TableValue>, SchemaError> {
    let LuaValue::Table(list) = y else { return Ok(vec![table_value(y, path, "y")?]) };
    list.sequence_values::<LuaValue>()
        .map(|item| match item {
            Ok(item) => table_value(&item, path, "y"),
            Err(e) => Err(field_error(&format!("{path}.y"), "y", e.to_string(), None)),
        })
        .collect()
}

/// The column of a figure that shows measurements as a run goes on.
fn plain_column(value: &TableValue, path: &str) -> Result<String, SchemaError> {
    match value {
        TableValue::TimeTo { .. } => Err(field_error(
            &format!("{path}.y"),
            "y",
            "times to thresholds are one number for each run".to_owned(),
            Some("draw them over an axis of the sweep: x = \"depth\"".to_owned()),
        )),
        value => Ok(value.word()),
    }
}

/// Axes with the values that are drawn.
fn kept(value: Option<&Value>, path: &str) -> Result<Vec<(String, Vec<Value>)>, SchemaError> {
    let values = |value: &Value| match value {
        Value::List(values) => values.clone(),
        one => vec![one.clone()],
    };
    match value {
        None => Ok(Vec::new()),
        Some(Value::Map(axes)) => Ok(axes.iter().map(|(axis, kept)| (axis.clone(), values(kept))).collect()),
        Some(_) => Err(field_error(
            &format!("{path}.only"),
            "only",
            "expected axes with their values".to_owned(),
            Some("only = { depth = { 3, 5 } }".to_owned()),
        )),
    }
}

fn table(shared: &Rc<Shared>, _: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    let name = file_name(shared, args)?;
    let path = format!("table.{name}");
    let options = args.table(shared, 1, "options")?;
    let read = || -> Result<TableSpec, SchemaError> {
        let fields = strict::fields(&options, &TABLE, &path, false)?;
        let value = match fields.objects.get("value") {
            Some(value) => table_value(value, &path, "value")?,
            None => TableValue::Samples,
        };
        let formats = match names(fields.values.get("format")) {
            words if words.is_empty() => vec![TableFormat::Md, TableFormat::Csv],
            words => {
                let said = |word: &str| words.iter().any(|w| w == word);
                [("md", TableFormat::Md), ("csv", TableFormat::Csv)]
                    .iter()
                    .filter(|(w, _)| said(w))
                    .map(|(_, f)| *f)
                    .collect()
            }
        };
        let (rows, cols) = (names(fields.values.get("rows")), names(fields.values.get("cols")));
        Ok(TableSpec { name: name.clone(), value, rows, cols, formats })
    };
    let spec = read().map_err(|e| args.blame(shared, e))?;
    let mut builder = shared.builder.borrow_mut();
    is_new(shared, args, &name, &builder.tables, |t| &t.name)?;
    builder.tables.push((spec, args.place.clone()));
    Ok(LuaValue::Nil)
}

fn table_value(value: &LuaValue, path: &str, key: &str) -> Result<TableValue, SchemaError> {
    let wrong = |help: Option<String>| SchemaError {
        path: format!("{path}.{key}"),
        problem: format!("expected the name of a column or time_to(column, threshold), found {}", kind(value)),
        help,
        key: key.to_owned(),
    };
    match value {
        LuaValue::String(s) => {
            let name = s.to_string_lossy();
            let plain = TableValue::PLAIN.iter().find(|(n, _)| *n == name);
            Ok(plain.map_or(TableValue::Metric(name), |(_, v)| v.clone()))
        }
        LuaValue::UserData(data) => match data.borrow::<TimeToObject>() {
            Ok(t) => Ok(TableValue::TimeTo { column: t.column.clone(), threshold: t.threshold }),
            Err(_) => Err(wrong(Some(format!("a metric is named by its column: {key} = \"rmse\"")))),
        },
        _ => Err(wrong(None)),
    }
}

/// Checks every axis and column that figures and tables name; the script has said everything by now.
///
/// # Errors
/// A name that nobody declared, at its line, or an axis that stands in two places.
pub fn check(builder: &Builder, shared: &Shared) -> Result<(), ScriptError> {
    let axes = builder.axis_names();
    let columns = builder.columns();
    let plain: Vec<&str> = TableValue::PLAIN.iter().map(|(name, _)| *name).collect();
    for (figure, place) in &builder.figures {
        let at = |key: &str| format!("figure.{}.{key}", figure.name);
        let check = || -> Result<(), SchemaError> {
            match &figure.kind {
                FigureKind::Convergence { y, .. } => {
                    y.iter().try_for_each(|name| column(name, &columns, &[], &at("y"), "y"))?;
                    if y.is_empty() {
                        return Err(field_error(&at("y"), "y", "no metric column".to_owned(), None));
                    }
                    measured(builder, &at("y"), "y")?;
                }
                FigureKind::Sweep { over, y } => {
                    horizontal(over, &axes, &at("x"))?;
                    y.iter().try_for_each(|value| quantity(builder, value, &columns, &plain, &at("y"), "y"))?;
                    if y.is_empty() {
                        return Err(field_error(&at("y"), "y", "nothing to draw".to_owned(), None));
                    }
                }
            }
            figure.by.iter().try_for_each(|name| axis(name, &axes, &at("by"), "by"))?;
            figure.facet.iter().try_for_each(|name| axis(name, &axes, &at("facet"), "facet"))?;
            figure.only.iter().try_for_each(|kept| drawn(&builder.axes, &axes, kept, &at("only")))?;
            let over = match &figure.kind {
                FigureKind::Sweep { over, .. } => Some(over),
                FigureKind::Convergence { .. } => None,
            };
            let all: Vec<&String> = figure.facet.iter().chain(&figure.by).chain(over).collect();
            twice(&all, &at("facet"), "facet")
        };
        check().map_err(|e| shared.sources.borrow().blame(place, e))?;
    }
    for (table, place) in &builder.tables {
        let at = |key: &str| format!("table.{}.{key}", table.name);
        let check = || -> Result<(), SchemaError> {
            quantity(builder, &table.value, &columns, &plain, &at("value"), "value")?;
            table.rows.iter().try_for_each(|name| axis(name, &axes, &at("rows"), "rows"))?;
            table.cols.iter().try_for_each(|name| axis(name, &axes, &at("cols"), "cols"))?;
            let all: Vec<&String> = table.rows.iter().chain(&table.cols).collect();
            twice(&all, &at("rows"), "rows")
        };
        check().map_err(|e| shared.sources.borrow().blame(place, e))?;
    }
    Ok(())
}

/// Checks what a table or a figure over an axis shows.
fn quantity(
    builder: &Builder,
    value: &TableValue,
    columns: &[&str],
    plain: &[&str],
    path: &str,
    key: &str,
) -> Result<(), SchemaError> {
    match value {
        TableValue::Metric(name) => column(name, columns, plain, path, key)?,
        TableValue::TimeTo { column: name, .. } => column(name, columns, &[], path, key)?,
        _ => return Ok(()),
    }
    measured(builder, path, key)
}

/// Checks that a figure's horizontal axis is one of the sweep, since it is none of the others.
fn horizontal(name: &str, axes: &[&str], path: &str) -> Result<(), SchemaError> {
    if axes.contains(&name) {
        return Ok(());
    }
    let known: Vec<&str> = axes.iter().copied().chain(["render_s", "samples"]).collect();
    let help = suggest::nearest(name, known.iter().copied())
        .map_or_else(|| format!("known: {}", known.join(", ")), |near| format!("did you mean `{near}`?"));
    let problem = format!("`{name}` is neither an axis of the sweep nor `render_s` or `samples`");
    Err(field_error(path, "x", problem, Some(help)))
}

/// Checks that an axis has the values that a figure is to show.
fn drawn(
    declared: &[Axis],
    axes: &[&str],
    (name, values): &(String, Vec<Value>),
    path: &str,
) -> Result<(), SchemaError> {
    axis(name, axes, path, name)?;
    let place = |a: &Axis| a.names.iter().position(|n| n == name);
    let own = declared.iter().filter_map(|a| Some((a, place(a)?)));
    let known: Vec<&Value> = own.flat_map(|(a, at)| a.steps.iter().map(move |step| &step[at])).collect();
    match values.iter().find(|value| !known.contains(value)) {
        None => Ok(()),
        Some(value) => {
            let texts: Vec<String> = known.iter().map(ToString::to_string).collect();
            let near = suggest::nearest(&value.to_string(), texts.iter().map(String::as_str));
            let help = near.map_or_else(|| format!("values: {}", texts.join(", ")), |n| format!("did you mean `{n}`?"));
            let problem = format!("the axis `{name}` has no value `{value}`");
            Err(field_error(&format!("{path}.{name}"), name, problem, Some(help)))
        }
    }
}

fn field_error(path: &str, key: &str, problem: String, help: Option<String>) -> SchemaError {
    SchemaError { path: path.to_owned(), problem, help, key: key.to_owned() }
}

fn column(name: &str, columns: &[&str], plain: &[&str], path: &str, key: &str) -> Result<(), SchemaError> {
    if columns.contains(&name) {
        return Ok(());
    }
    let known: Vec<&str> = columns.iter().chain(plain).copied().collect();
    let mut error = unknown_name(path, name, "metric column", known.iter().copied());
    if known.is_empty() {
        error.help = Some("x:measure declares no metric".to_owned());
    }
    error.key = key.to_owned();
    Err(error)
}

fn axis(name: &str, axes: &[&str], path: &str, key: &str) -> Result<(), SchemaError> {
    known_axis(name, axes).map_err(|(problem, help)| field_error(path, key, problem, Some(help)))
}

fn twice(names: &[&String], path: &str, key: &str) -> Result<(), SchemaError> {
    match names.iter().enumerate().find(|(i, name)| names[..*i].contains(name)) {
        Some((_, name)) => Err(field_error(path, key, format!("the axis `{name}` stands there twice"), None)),
        None => Ok(()),
    }
}

/// Metrics need something to be measured against.
fn measured(builder: &Builder, path: &str, key: &str) -> Result<(), SchemaError> {
    match builder.reference {
        Some(_) => Ok(()),
        None => {
            let help = "say what is true: x:reference { stop = stop.samples(4096) }".to_owned();
            Err(field_error(
                path,
                key,
                "metrics need a reference, and the script has no x:reference".to_owned(),
                Some(help),
            ))
        }
    }
}
