//! Checks of the axes and columns that figures, tables and sheets name.

use super::axis::known_axis;
use super::builder::Builder;
use super::measure::unknown_column;
use crate::error::ScriptError;
use crate::state::Shared;
use lumbre_light::value::Value;
use lumbre_light::value::schema::SchemaError;
use lumbre_light::value::suggest;
use lumbre_night::experiment::spec::{
    Axis, FigureKind, FigureSpec, RunColumn, SheetContent, SheetSpec, TableSpec, TableValue,
};

/// Checks every axis and column that figures, tables and sheets name, after the script has ended.
///
/// # Errors
/// Returns an error at the line of the figure, table or sheet for an undeclared name, or for an axis
/// that is used twice.
pub fn check(builder: &Builder, shared: &Shared) -> Result<(), ScriptError> {
    let axes = builder.axis_names();
    let columns = builder.columns();
    let plain: Vec<&str> = RunColumn::ALL.iter().map(|c| c.row().name).collect();
    let names = Names {
        builder,
        axes: &axes,
        columns: &columns,
        plain: &plain,
    };
    let locate = |place, e| shared.sources.borrow().locate_error(place, e);
    for (figure, place) in &builder.figures {
        check_figure(figure, &names).map_err(|e| locate(place, e))?;
    }
    for (table, place) in &builder.tables {
        check_table(table, &names).map_err(|e| locate(place, e))?;
    }
    for (sheet, place) in &builder.sheets {
        check_sheet(sheet, &axes).map_err(|e| locate(place, e))?;
    }
    Ok(())
}

/// Names that figures and tables may use.
struct Names<'a> {
    builder: &'a Builder,
    /// Names of the axes.
    axes: &'a [&'a str],
    /// Names of the metric columns.
    columns: &'a [&'a str],
    /// Names of the columns that exist in every experiment.
    plain: &'a [&'a str],
}

/// Checks the names in a figure.
fn check_figure(figure: &FigureSpec, names: &Names) -> Result<(), SchemaError> {
    let at = |key: &str| format!("figure.{}.{key}", figure.name);
    let over = match &figure.kind {
        FigureKind::Convergence { y, .. } => {
            y.iter()
                .try_for_each(|name| check_column(name, names.columns, &[], &at("y"), "y"))?;
            if y.is_empty() {
                let problem = "no metric column".to_owned();
                return Err(SchemaError::new(at("y"), "y", problem));
            }
            check_has_reference(names.builder, &at("y"), "y")?;
            None
        }
        FigureKind::Sweep { over, y } => {
            check_horizontal_axis(over, names.axes, &at("x"))?;
            y.iter()
                .try_for_each(|value| check_table_value(names, value, &at("y"), "y"))?;
            if y.is_empty() {
                let problem = "nothing to draw".to_owned();
                return Err(SchemaError::new(at("y"), "y", problem));
            }
            Some(over)
        }
    };
    figure
        .by
        .iter()
        .try_for_each(|name| check_axis(name, names.axes, &at("by"), "by"))?;
    figure
        .facet
        .iter()
        .try_for_each(|name| check_axis(name, names.axes, &at("facet"), "facet"))?;
    figure
        .only
        .iter()
        .try_for_each(|only| check_only_values(names, only, &at("only")))?;
    let all: Vec<&String> = figure.facet.iter().chain(&figure.by).chain(over).collect();
    check_distinct(&all, &at("facet"), "facet")
}

/// Checks the names in a table.
fn check_table(table: &TableSpec, names: &Names) -> Result<(), SchemaError> {
    let path = format!("table.{}", table.name);
    check_table_value(names, &table.value, &format!("{path}.value"), "value")?;
    check_rows_and_cols(&path, names.axes, &table.rows, &table.cols)
}

/// Checks the names in a sheet.
fn check_sheet(sheet: &SheetSpec, axes: &[&str]) -> Result<(), SchemaError> {
    let cols = match &sheet.content {
        SheetContent::Pictures { cols, .. } => cols.as_slice(),
        SheetContent::Frames { .. } => &[],
    };
    let path = format!("{}.{}", sheet.kind(), sheet.name);
    check_rows_and_cols(&path, axes, &sheet.rows, cols)
}

/// Checks that rows and columns name axes, each once.
fn check_rows_and_cols(
    path: &str,
    axes: &[&str],
    rows: &[String],
    cols: &[String],
) -> Result<(), SchemaError> {
    for (key, names) in [("rows", rows), ("cols", cols)] {
        names
            .iter()
            .try_for_each(|name| check_axis(name, axes, &format!("{path}.{key}"), key))?;
    }
    let all: Vec<&String> = rows.iter().chain(cols).collect();
    check_distinct(&all, &format!("{path}.rows"), "rows")
}

/// Checks the value of a table, or of a figure over an axis.
fn check_table_value(
    names: &Names,
    value: &TableValue,
    path: &str,
    key: &str,
) -> Result<(), SchemaError> {
    match value {
        TableValue::Metric(name) => check_column(name, names.columns, names.plain, path, key)?,
        TableValue::TimeTo { column: name, .. } => {
            check_column(name, names.columns, &[], path, key)?;
        }
        _ => return Ok(()),
    }
    check_has_reference(names.builder, path, key)
}

/// Checks that `name` is an axis of the sweep; `render_s` and `samples` were handled before.
fn check_horizontal_axis(name: &str, axes: &[&str], path: &str) -> Result<(), SchemaError> {
    if axes.contains(&name) {
        return Ok(());
    }
    let known: Vec<&str> = axes
        .iter()
        .copied()
        .chain(["render_s", "samples"])
        .collect();
    let help = suggest::nearest(name, known.iter().copied()).map_or_else(
        || format!("known: {}", known.join(", ")),
        |near| format!("did you mean `{near}`?"),
    );
    let problem = format!("`{name}` is neither an axis of the sweep nor `render_s` or `samples`");
    Err(SchemaError::new(path, "x", problem).with_help(help))
}

/// Checks that an axis has the values that a figure selects.
fn check_only_values(
    names: &Names,
    (name, values): &(String, Vec<Value>),
    path: &str,
) -> Result<(), SchemaError> {
    check_axis(name, names.axes, path, name)?;
    let index = |a: &Axis| a.names.iter().position(|n| n == name);
    let axes = names.builder.axes.iter();
    let with_name = axes.filter_map(|a| Some((a, index(a)?)));
    let known: Vec<&Value> = with_name
        .flat_map(|(a, at)| a.steps.iter().map(move |step| &step[at]))
        .collect();
    match values.iter().find(|value| !known.contains(value)) {
        None => Ok(()),
        Some(value) => {
            let texts: Vec<String> = known.iter().map(ToString::to_string).collect();
            let near = suggest::nearest(&value.to_string(), texts.iter().map(String::as_str));
            let help = near.map_or_else(
                || format!("values: {}", texts.join(", ")),
                |n| format!("did you mean `{n}`?"),
            );
            let problem = format!("the axis `{name}` has no value `{value}`");
            Err(SchemaError::new(format!("{path}.{name}"), name, problem).with_help(help))
        }
    }
}

/// Checks that `name` is one of the metric columns or one of `plain`.
fn check_column(
    name: &str,
    columns: &[&str],
    plain: &[&str],
    path: &str,
    key: &str,
) -> Result<(), SchemaError> {
    if columns.contains(&name) {
        return Ok(());
    }
    let known: Vec<&str> = columns.iter().chain(plain).copied().collect();
    let mut error = unknown_column(path, name, &known);
    error.key = key.to_owned();
    Err(error)
}

/// Checks that `name` is an axis.
fn check_axis(name: &str, axes: &[&str], path: &str, key: &str) -> Result<(), SchemaError> {
    known_axis(name, axes)
        .map_err(|(problem, help)| SchemaError::new(path, key, problem).with_help(help))
}

/// Checks that no axis is used twice.
fn check_distinct(names: &[&String], path: &str, key: &str) -> Result<(), SchemaError> {
    match names
        .iter()
        .enumerate()
        .find(|(i, name)| names[..*i].contains(name))
    {
        Some((_, name)) => Err(SchemaError::new(
            path,
            key,
            format!("the axis `{name}` is used twice"),
        )),
        None => Ok(()),
    }
}

/// Checks that the experiment has a reference, which metrics need.
fn check_has_reference(builder: &Builder, path: &str, key: &str) -> Result<(), SchemaError> {
    match builder.reference {
        Some(_) => Ok(()),
        None => {
            let help = "add x:reference { stop = stop.samples(4096) }".to_owned();
            Err(SchemaError::new(
                path,
                key,
                "metrics need a reference, and the script has no x:reference",
            )
            .with_help(help))
        }
    }
}
