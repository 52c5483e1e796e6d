//! Columns of the plan pane that distinguish cells from each other.

use crate::experiment::PlanOutline;
use crate::experiment::plan_outline::CellOutline;
use crate::tui::format;

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
pub fn columns(plan: &PlanOutline) -> Vec<Column> {
    let mut columns = Vec::new();
    for (i, axis) in plan.axes.iter().enumerate() {
        let at = |cell: &CellOutline| cell.point.get(i).map(|(_, value)| value.clone());
        if plan.varying.get(i) == Some(&true) {
            let values = plan
                .cells
                .iter()
                .map(|c| at(c).map_or_else(String::new, |v| format::clean(&v.to_string())));
            let numeric = plan
                .cells
                .iter()
                .all(|cell| at(cell).is_some_and(|v| v.as_f64().is_some()));
            columns.push(Column::new(axis, values.collect(), numeric));
        }
    }
    if plan.repeated {
        columns.push(Column::new(
            "rep",
            plan.cells
                .iter()
                .map(|cell| cell.repeat.to_string())
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
