//! Columns of the plan pane that distinguish cells from each other.

use crate::tui::format;
use lumbre_night::experiment::Night;
use lumbre_night::experiment::night::run::Run;

/// A column of the plan pane: an axis whose value differs between cells, or the repeat number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    /// Name of the axis.
    pub name: String,
    /// Value of the axis in every cell, in plan order.
    pub values: Vec<String>,
    /// Terminal columns that the name and the widest value need.
    pub width: usize,
    /// Whether every value is a number; numbers are right-aligned.
    pub numeric: bool,
}

/// Returns a column for each axis whose value differs between cells, and one for the repeat
/// number if there are several repeats.
pub fn columns(night: &Night) -> Vec<Column> {
    let mut columns = Vec::new();
    for (i, axis) in night.plan.axes.iter().enumerate() {
        let at = |run: &Run| run.point.get(i).map(|(_, value)| value.clone());
        if night.plan.varying.get(i) == Some(&true) {
            let values = night
                .runs
                .iter()
                .map(|run| at(run).map_or_else(String::new, |v| format::clean(&v.to_string())));
            let numeric = night
                .runs
                .iter()
                .all(|run| at(run).is_some_and(|v| v.as_f64().is_some()));
            columns.push(Column::new(axis, values.collect(), numeric));
        }
    }
    if night.plan.is_repeated {
        columns.push(Column::new(
            "rep",
            night
                .runs
                .iter()
                .map(|run| run.repeat.to_string())
                .collect(),
            true,
        ));
    }
    columns
}

impl Column {
    fn new(name: &str, values: Vec<String>, numeric: bool) -> Column {
        let width = values
            .iter()
            .map(|v| format::width(v))
            .chain([format::width(name)])
            .max()
            .unwrap_or(0);
        Column {
            name: name.to_owned(),
            values,
            width,
            numeric,
        }
    }
}
