//! Writes tables as CSV: one line for each cell, or one line for each row.

use super::Table;
use crate::format::exact;
use lumbre_night::columns::{TABLE, names};
use lumbre_night::text::csv_line;

impl Table {
    /// Formats the table as CSV in full precision, with one line for each cell: the labels, and the
    /// columns of [`TABLE`]. Missing values are empty.
    pub fn to_long_csv(&self) -> String {
        let mut header = self.label_headers.clone();
        header.extend(names(&TABLE));
        let mut text = csv_line(&header);
        let groups: Vec<&String> = self.column_groups().collect();
        for (labels, cells) in &self.rows {
            for ((column, group), cell) in self.columns.iter().zip(&groups).zip(cells) {
                let mut fields = labels.clone();
                fields.extend([(*group).clone(), column.clone()]);
                fields.push(cell.value.map(exact).unwrap_or_default());
                let ends = cell.value.zip(cell.interval).map(|(v, i)| i.ends(v));
                fields.push(ends.map(|e| exact(e.0)).unwrap_or_default());
                fields.push(ends.map(|e| exact(e.1)).unwrap_or_default());
                fields.push(cell.bound.name().to_owned());
                fields.push(u8::from(cell.best).to_string());
                let shown = cell.contrast.map(|contrast| contrast.shown());
                let interval = shown.and_then(|(_, interval)| interval);
                let contrast = [
                    shown.map(|(worse, _)| worse),
                    interval.map(|[low, _]| low),
                    interval.map(|[_, high]| high),
                    cell.contrast.map(|contrast| contrast.p),
                ];
                fields.extend(contrast.map(|number| number.map(exact).unwrap_or_default()));
                fields.push(u8::from(cell.at_floor).to_string());
                fields.extend([
                    cell.runs.to_string(),
                    self.unit.clone(),
                    cell.run_ids.join(" "),
                ]);
                text += &csv_line(&fields);
            }
        }
        text
    }

    /// Formats the table as CSV in full precision, with one line for each row: the label columns,
    /// then for each value column the value and its number of runs. If any value has a confidence
    /// interval, its half-width follows. Missing values and bounds are empty.
    pub fn to_wide_csv(&self) -> String {
        let has_intervals = self.cells().iter().any(|cell| cell.interval.is_some());
        let fields = |all: [String; 3]| all.into_iter().take(if has_intervals { 3 } else { 2 });
        let mut header = self.label_headers.clone();
        let named = self.headers().into_iter();
        header.extend(
            named.flat_map(|c| fields([c.clone(), format!("runs: {c}"), format!("±95 %: {c}")])),
        );
        let mut text = csv_line(&header);
        for (labels, cells) in &self.rows {
            let mut line = labels.clone();
            line.extend(cells.iter().flat_map(|cell| {
                let value = cell.value.filter(|_| !cell.bound.is_open());
                let half = value.zip(cell.interval).map(|(v, i)| i.half_width(v));
                let half = half.filter(|half| half.is_finite());
                fields([
                    value.map(exact).unwrap_or_default(),
                    cell.runs.to_string(),
                    half.map(exact).unwrap_or_default(),
                ])
            }));
            text += &csv_line(&line);
        }
        text
    }
}
