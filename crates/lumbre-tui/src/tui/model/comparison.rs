//! Selection of the cells that the chart compares: those that differ only in their technique, as in
//! the report.

use std::collections::BTreeMap;

use super::column::Column;
use lumbre_light::transport::integrator::{canonical_name, external, integrators};
use lumbre_night::experiment::Night;

/// The compared column of the plan and its values.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Comparison {
    /// Index of the compared column.
    column: usize,
    /// Number of columns of axes; the repeat number, if there is one, follows.
    axes: usize,
    /// Number of every distinct value of the compared column in plan order.
    values: BTreeMap<String, usize>,
}

impl Comparison {
    /// Chooses the column: the axis whose values are techniques, or else the last axis that varies.
    /// Returns `None` if no axis varies.
    pub fn new(night: &Night, columns: &[Column]) -> Option<Comparison> {
        let axes = columns.len() - usize::from(night.plan.is_repeated && !columns.is_empty());
        let is_technique = |value: &String| {
            value.starts_with(external::PREFIX)
                || integrators().any(|row| row.name == canonical_name(value))
        };
        let names_techniques = |column: &Column| column.values.iter().all(is_technique);
        let column = columns[..axes].iter().position(names_techniques);
        let column = column.or(axes.checked_sub(1))?;
        let mut values = BTreeMap::new();
        for value in &columns[column].values {
            let next = values.len();
            values.entry(value.clone()).or_insert(next);
        }
        Some(Comparison {
            column,
            axes,
            values,
        })
    }

    /// Returns the index and the name of a cell's series.
    pub fn series(&self, columns: &[Column], cell: usize) -> Option<(usize, &str)> {
        let value = columns.get(self.column)?.values.get(cell)?;
        let (value, index) = self.values.get_key_value(value)?;
        Some((*index, value))
    }

    /// Returns whether two cells differ in nothing but series and repeat number.
    pub fn are_comparable(&self, columns: &[Column], a: usize, b: usize) -> bool {
        let mut others = columns.iter().take(self.axes).enumerate();
        others.all(|(index, column)| {
            index == self.column || column.values.get(a) == column.values.get(b)
        })
    }
}
