//! `x:figure`, `x:table`, `x:sheet` and `x:frames`: figures, tables and sheets of the results.

use mlua::{UserData, UserDataFields, Value as LuaValue};

use super::{ApiFn, Args, functions};
use crate::error::ScriptError;
use crate::kind::{KIND, kind};
use crate::source::SourcePlace;
use crate::strict;
use lumbre_light::value::Value;
use lumbre_light::value::schema::{SchemaError, Table, Ty};
use lumbre_night::experiment::spec::{
    FigureKind, FigureSpec, FigureX, RunColumn, SheetSpec, TableFormat, TableSpec, TableValue,
};

/// Largest number of figures, of tables, and of sheets of one experiment.
const MAX_REPORTS: usize = 64;

lumbre_light::table! {
    /// Options of `x:figure`.
    pub const FIGURE = "Figure",
        "Figure with curves; one picture for each combination of facet values.";
    x = "render_s": Ty::Str, FigureX::X_DOC;
    y: Ty::Object("string|TimeTo|(string|TimeTo)[]"),
        "metric columns, one panel each; over an axis of the sweep, everything that a table can \
         show";
    by = "one curve per cell; over an axis, one per combination of the other axes": Ty::Str,
        "axis whose values are different curves";
    facet = "one picture": Ty::OneOrMany(&Ty::Str), "axes whose values are different pictures";
    only = "all values": Ty::Any("table<string, any>"),
        "values of axes to draw, one value or a list for each axis: only = { builder = \"sah\" }";
}

lumbre_light::table! {
    /// Options of `x:table`.
    pub const TABLE = "ResultTable",
        "Table over axes. Values of all other axes and of repeats are averaged.";
    value: Ty::Object("string|TimeTo"), RunColumn::VALUE_DOC;
    rows: Ty::OneOrMany(&Ty::Str), "axes whose values are the rows";
    cols = "a single column": Ty::OneOrMany(&Ty::Str), "axes whose values are the columns";
    format = "both": Ty::OneOrMany(&Ty::Word(&["md", "csv"])),
        "file formats: `md` is Markdown, `csv` is comma-separated values";
}

lumbre_light::table! {
    /// Options of `x:sheet`.
    pub const SHEET = "Sheet",
        "Sheet of the pictures of runs side by side: at most 400 pictures in at most 24 columns. Of \
         all other axes it shows the first value, and of repeats the first; its caption states \
         them. A run without a picture leaves a gap, which states why.";
    rows = "pictures fill rows of up to six": Ty::OneOrMany(&Ty::Str),
        "axes whose values are the rows";
    cols = "a single column": Ty::OneOrMany(&Ty::Str), "axes whose values are the columns";
    at = "\"end\"": Ty::Any("string|integer"),
        "picture of each run: `\"end\"`, or the kept one nearest to a render time such as \
         `\"10s\"` or to samples per pixel such as `64`, which needs keep = { exr = \"pow2\" } in \
         x:measure";
    display = "that of x:report, or else of x:measure": Ty::Any("Tonemap"),
        "tone map of all pictures";
}

lumbre_light::table! {
    /// Options of `x:frames`.
    pub const FRAMES = "Frames",
        "Sheet of the frames of runs with a time axis: a row for each run, a column for each \
         moment, and one exposure. Its limits, and what it shows of other axes and of repeats, are \
         those of x:sheet.";
    at: Ty::OneOrMany(&Ty::num(-1e9, 1e9)),
        "moments as optical lengths in scene units; a frame is the time bin that contains the \
         moment";
    rows = "one row for each point of the sweep": Ty::OneOrMany(&Ty::Str),
        "axes whose values are the rows";
    density = "no densities": Ty::Str,
        "name of a material; each row begins with the density of its delay, and an arrow for light \
         that is delayed by a constant. All rows have the same scales";
    static = "false": Ty::Bool,
        "whether the picture without time precedes the frames, with the tone map of x:report, or \
         else of x:measure";
    display = "sRGB with one exposure for all frames": Ty::Any("Tonemap"), "tone map of the frames";
}

functions! {
    /// Constructor of a table's value.
    pub const GLOBALS;
    "time_to" -> "TimeTo" = time_to,
        "Returns a value for tables and figures over axes: render time in seconds until a metric \
         reached a threshold for good." {
        "column": "string", "Name of a metric column of x:measure.";
        "threshold": "number",
            "Value to reach, coming from worse values, in the unit of the metric.";
    }
}

functions! {
    /// Methods that declare figures, tables and sheets.
    pub const METHODS;
    "x:table" = table, "Adds a table of the results, which is written when the night ends." {
        "name": "string",
            "Name of its files, without extension: at most 60 letters, digits, `_`, `-` and `.`.";
        "options": "ResultTable", "Value, rows and columns.";
    }
    "x:figure" = figure,
        "Adds a figure: errors over the course of runs, or final results over an axis of the \
         sweep." {
        "name": "string",
            "Name of its files, without extension: at most 60 letters, digits, `_`, `-` and `.`.";
        "options": "Figure", "Axes and columns to draw.";
    }
    "x:sheet" = sheet,
        "Adds a sheet of pictures side by side, such as materials in rows and their parameters in \
         columns. It is drawn when the night ends, and in reports; it needs no reference." {
        "name": "string",
            "Name of its files, without extension: at most 60 letters, digits, `_`, `-` and `.`.";
        "options": "Sheet", "Axes of its rows and columns.";
    }
    "x:frames" = frames,
        "Adds a sheet of moments of runs with a time axis. It is drawn when the night ends, and in \
         reports." {
        "name": "string",
            "Name of its files, without extension: at most 60 letters, digits, `_`, `-` and `.`.";
        "options": "Frames", "Moments, and the columns before them.";
    }
}

/// Lua object of `time_to(column, threshold)`.
#[derive(Clone, Debug)]
pub struct TimeToObject {
    column: String,
    threshold: f64,
}

impl UserData for TimeToObject {
    fn add_fields<F: UserDataFields<Self>>(fields: &mut F) {
        fields.add_meta_field(KIND, "a time_to value");
    }
}

fn time_to(args: &Args) -> Result<LuaValue, ScriptError> {
    let (column, threshold) = (args.text(0, "column")?, args.number(1, "threshold")?);
    args.object(TimeToObject { column, threshold })
}

/// Returns the name of a figure, table or sheet, which becomes a file name.
fn file_name(args: &Args) -> Result<String, ScriptError> {
    let name = args.text(0, "name")?;
    let legal = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '.');
    if name.is_empty() || name.len() > 60 || name.starts_with('.') || !name.chars().all(legal) {
        let help =
            "use at most 60 letters, digits, `_`, `-` and `.`, not starting with a dot".to_owned();
        return Err(args.error(format!("`{name}` cannot name a file"), Some(help)));
    }
    Ok(name)
}

/// Rejects a second figure, table or sheet of the same name, and more than [`MAX_REPORTS`].
fn check_name_is_new<T>(
    args: &Args,
    name: &str,
    declared: &[(T, SourcePlace)],
    name_of: fn(&T) -> &str,
) -> Result<(), ScriptError> {
    // On file systems that ignore case, one file would replace the other.
    if let Some((_, place)) = declared
        .iter()
        .find(|(t, _)| name_of(t).eq_ignore_ascii_case(name))
    {
        return Err(args.error(
            format!("`{name}` is already defined in line {}", place.line),
            None,
        ));
    }
    if declared.len() >= MAX_REPORTS {
        return Err(args.error(format!("called more than {MAX_REPORTS} times"), None));
    }
    Ok(())
}

/// Returns the names in a field that is one name or a list of names.
fn names(value: Option<&Value>) -> Vec<String> {
    let items = value.map_or(&[][..], Value::one_or_many).iter();
    items.filter_map(Value::as_str).map(str::to_owned).collect()
}

fn figure(args: &Args) -> Result<LuaValue, ScriptError> {
    let name = file_name(args)?;
    let path = format!("figure.{name}");
    let options = args.table(1, "options")?;
    let read = || -> Result<FigureSpec, SchemaError> {
        let fields = strict::fields(&options, &FIGURE, &path, false)?;
        let word = |key: &str| fields.text(key);
        let y = fields
            .objects
            .get("y")
            .map_or(Ok(Vec::new()), |y| figure_values(y, &path))?;
        let columns = |y: Vec<TableValue>| {
            y.iter()
                .map(|value| curve_column(value, &path))
                .collect::<Result<Vec<_>, _>>()
        };
        let x = word("x").unwrap_or(FigureX::ALL[0].row().name);
        let kind = match FigureX::named(x) {
            Some(x) => FigureKind::Convergence { x, y: columns(y)? },
            None => FigureKind::Sweep {
                over: x.to_owned(),
                y,
            },
        };
        Ok(FigureSpec {
            name: name.clone(),
            kind,
            by: word("by").map(str::to_owned),
            facet: names(fields.values.get("facet")),
            only: only_values(fields.values.get("only"), &path)?,
        })
    };
    let spec = read().map_err(|e| args.locate_error(e))?;
    let mut builder = args.shared.builder.borrow_mut();
    check_name_is_new(args, &name, &builder.figures, |f| &f.name)?;
    builder.figures.push((spec, args.place.clone()));
    Ok(LuaValue::Nil)
}

/// Converts the option `y` of a figure: one value, or a list of values.
fn figure_values(y: &LuaValue, path: &str) -> Result<Vec<TableValue>, SchemaError> {
    let LuaValue::Table(list) = y else {
        return Ok(vec![table_value(y, path, "y")?]);
    };
    list.sequence_values::<LuaValue>()
        .map(|item| match item {
            Ok(item) => table_value(&item, path, "y"),
            Err(e) => Err(SchemaError::new(format!("{path}.y"), "y", e.to_string())),
        })
        .collect()
}

/// Returns the column of a figure that shows measurements over the course of a run.
fn curve_column(value: &TableValue, path: &str) -> Result<String, SchemaError> {
    match value {
        TableValue::TimeTo { .. } => Err(SchemaError::new(
            format!("{path}.y"),
            "y",
            "time_to(..) is one number per run and has no curve",
        )
        .with_help("draw it over an axis of the sweep: x = \"depth\"")),
        value => Ok(value.name()),
    }
}

/// Converts the option `only` of a figure to axes with their values.
fn only_values(
    value: Option<&Value>,
    path: &str,
) -> Result<Vec<(String, Vec<Value>)>, SchemaError> {
    match value {
        None => Ok(Vec::new()),
        Some(Value::Map(axes)) => Ok(axes
            .iter()
            .map(|(axis, kept)| (axis.clone(), kept.one_or_many().to_vec()))
            .collect()),
        Some(_) => Err(SchemaError::new(
            format!("{path}.only"),
            "only",
            "expected a table of axes with their values",
        )
        .with_help("only = { depth = { 3, 5 } }")),
    }
}

fn table(args: &Args) -> Result<LuaValue, ScriptError> {
    let name = file_name(args)?;
    let path = format!("table.{name}");
    let options = args.table(1, "options")?;
    let read = || -> Result<TableSpec, SchemaError> {
        let fields = strict::fields(&options, &TABLE, &path, false)?;
        let value = match fields.objects.get("value") {
            Some(value) => table_value(value, &path, "value")?,
            None => TableValue::Run(RunColumn::Samples),
        };
        let formats = match names(fields.values.get("format")) {
            words if words.is_empty() => vec![TableFormat::Md, TableFormat::Csv],
            words => {
                let is_given = |word: &str| words.iter().any(|w| w == word);
                [("md", TableFormat::Md), ("csv", TableFormat::Csv)]
                    .iter()
                    .filter(|(w, _)| is_given(w))
                    .map(|(_, f)| *f)
                    .collect()
            }
        };
        let (rows, cols) = (
            names(fields.values.get("rows")),
            names(fields.values.get("cols")),
        );
        Ok(TableSpec {
            name: name.clone(),
            value,
            rows,
            cols,
            formats,
        })
    };
    let spec = read().map_err(|e| args.locate_error(e))?;
    let mut builder = args.shared.builder.borrow_mut();
    check_name_is_new(args, &name, &builder.tables, |t| &t.name)?;
    builder.tables.push((spec, args.place.clone()));
    Ok(LuaValue::Nil)
}

fn sheet(args: &Args) -> Result<LuaValue, ScriptError> {
    declare_sheet(args, "sheet", &SHEET)
}

fn frames(args: &Args) -> Result<LuaValue, ScriptError> {
    declare_sheet(args, "frames", &FRAMES)
}

/// Adds the sheet that a call of the method `kind` declares, with options of a schema.
fn declare_sheet(args: &Args, kind: &str, schema: &Table) -> Result<LuaValue, ScriptError> {
    let name = file_name(args)?;
    let options = args.table(1, "options")?;
    let fields = strict::fields(&options, schema, &format!("{kind}.{name}"), false);
    let spec = fields.and_then(|mut fields| {
        let declared = [("kind", kind), ("name", &name)];
        let declared = declared.map(|(key, text)| (key.to_owned(), text.into()));
        fields.values.extend(declared);
        SheetSpec::new(fields.values)
    });
    let spec = spec.map_err(|e| args.locate_error(e))?;
    let mut builder = args.shared.builder.borrow_mut();
    check_name_is_new(args, &name, &builder.sheets, |s| &s.name)?;
    builder.sheets.push((spec, args.place.clone()));
    Ok(LuaValue::Nil)
}

/// Converts the name of a column, or a `time_to` object, to a table value.
fn table_value(value: &LuaValue, path: &str, key: &str) -> Result<TableValue, SchemaError> {
    let wrong = |help: Option<String>| SchemaError {
        path: format!("{path}.{key}"),
        problem: format!(
            "expected the name of a column or time_to(column, threshold), found {}",
            kind(value)
        ),
        help,
        key: key.to_owned(),
    };
    match value {
        LuaValue::String(s) => Ok(TableValue::named(s.to_string_lossy())),
        LuaValue::UserData(data) => match data.borrow::<TimeToObject>() {
            Ok(t) => Ok(TableValue::TimeTo {
                column: t.column.clone(),
                threshold: t.threshold,
            }),
            Err(_) => Err(wrong(Some(format!(
                "use the name of a metric column: {key} = \"rmse\""
            )))),
        },
        _ => Err(wrong(None)),
    }
}
