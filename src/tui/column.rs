//! The columns that tell cells apart.

use super::words;
use crate::experiment::Outline;
use crate::experiment::outline::CellOutline;

/// A column of the plan pane: an axis whose value differs between cells, or the number of the repeat.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    /// The axis.
    pub name: String,
    /// Its value in every cell.
    pub values: Vec<String>,
    /// Columns of the terminal that name and values take.
    pub width: usize,
    /// Whether every value is a number, which stands to the right.
    pub numeric: bool,
}

/// The axes whose values differ between cells, and the repeat if there are several.
pub fn columns(plan: &Outline) -> Vec<Column> {
    let mut columns = Vec::new();
    for (i, axis) in plan.axes.iter().enumerate() {
        let at = |cell: &CellOutline| cell.point.get(i).map(|(_, value)| value.clone());
        let first = plan.cells.first().and_then(at);
        if plan.cells.iter().any(|cell| at(cell) != first) {
            let values = plan.cells.iter().map(|c| at(c).map_or_else(String::new, |v| words::clean(&v.to_string())));
            let numeric = plan.cells.iter().all(|cell| at(cell).is_some_and(|v| v.as_f64().is_some()));
            columns.push(Column::new(axis, values.collect(), numeric));
        }
    }
    if plan.repeated {
        columns.push(Column::new("rep", plan.cells.iter().map(|cell| cell.repeat.to_string()).collect(), true));
    }
    columns
}

impl Column {
    fn new(name: &str, values: Vec<String>, numeric: bool) -> Column {
        let width = values.iter().map(|v| words::width(v)).chain([words::width(name)]).max().unwrap_or(0);
        Column { name: name.to_owned(), values, width, numeric }
    }
}
