//! Writes tables as Markdown and as CSV.

use super::{CellValue, TableCell, TableData};
use crate::output::format::{exact, significant};
use crate::text::{csv_line, wrap};

/// Maximum line length of a Markdown caption in characters.
const CAPTION_WIDTH: usize = 100;

impl TableData {
    /// Formats the table as Markdown with the caption above, padded so that the source is readable
    /// too. Numbers have four significant digits. An en dash marks a missing value; `> t` marks a
    /// threshold that was not reached in t seconds.
    pub fn to_markdown(&self) -> String {
        let escaped = |s: &String| s.replace('|', "\\|").replace(['\n', '\r'], " ");
        let header: Vec<String> = self
            .row_axes
            .iter()
            .chain(&self.columns)
            .map(escaped)
            .collect();
        let body: Vec<Vec<String>> = self
            .rows
            .iter()
            .map(|row| {
                let numbers = row.cells.iter().map(markdown_number);
                row.labels.iter().map(escaped).chain(numbers).collect()
            })
            .collect();
        let caption = wrap(&format!("{}: {}", self.name, self.caption), |line| {
            line.chars().count() <= CAPTION_WIDTH
        })
        .join("\n");
        format!(
            "{caption}\n\n{}",
            markdown_table(&header, &body, self.row_axes.len())
        )
    }

    /// Formats the table as CSV in full precision: the label columns, then for each value column
    /// the value and its number of runs. If any value has a confidence interval, its half-width
    /// follows. Missing values and lower bounds are empty.
    pub fn to_csv(&self) -> String {
        let has_intervals = self
            .rows
            .iter()
            .flat_map(|r| &r.cells)
            .any(|c| c.ci95_half.is_some());
        let fields = |all: [String; 3]| all.into_iter().take(if has_intervals { 3 } else { 2 });
        let mut header = self.row_axes.clone();
        let named = self
            .columns
            .iter()
            .map(|c| [c.clone(), format!("runs: {c}"), format!("±95 %: {c}")]);
        header.extend(named.flat_map(fields));
        let mut text = csv_line(&header);
        for row in &self.rows {
            let mut line = row.labels.clone();
            line.extend(row.cells.iter().flat_map(|cell| {
                let value = if let CellValue::Mean(x) = cell.value {
                    exact(x)
                } else {
                    String::new()
                };
                fields([
                    value,
                    cell.runs.to_string(),
                    cell.ci95_half.map(exact).unwrap_or_default(),
                ])
            }));
            text += &csv_line(&line);
        }
        text
    }
}

fn markdown_number(cell: &TableCell) -> String {
    let number = |x: f64| {
        if x.fract() == 0.0 && x.abs() < 1e9 {
            x.to_string()
        } else {
            significant(x, 4)
        }
    };
    match cell.value {
        CellValue::Empty => "–".to_owned(),
        CellValue::Mean(x) => match cell.ci95_half {
            Some(half) => format!("{} ± {}", number(x), significant(half, 2)),
            None => number(x),
        },
        CellValue::Bounded(x, bound) => format!("{}{}", bound.sign(), number(x)),
    }
}

/// Formats a padded Markdown table. The first `labels` columns are left-aligned, the others
/// right-aligned.
pub(in crate::output) fn markdown_table(
    header: &[String],
    body: &[Vec<String>],
    labels: usize,
) -> String {
    let width = |i: usize| {
        let texts = std::iter::once(header)
            .chain(body.iter().map(Vec::as_slice))
            .filter_map(|row| row.get(i));
        texts.map(|s| s.chars().count()).max().unwrap_or(0).max(3)
    };
    let widths: Vec<usize> = (0..header.len()).map(width).collect();
    let line = |row: &[String]| {
        let cell = |(i, text): (usize, &String)| {
            let pad = " ".repeat(widths[i].saturating_sub(text.chars().count()));
            if i < labels {
                format!(" {text}{pad} ")
            } else {
                format!(" {pad}{text} ")
            }
        };
        let cells: Vec<String> = row.iter().enumerate().map(cell).collect();
        format!("|{}|\n", cells.join("|"))
    };
    let rule = |(i, w): (usize, &usize)| {
        if i < labels {
            "-".repeat(w + 2)
        } else {
            format!("{}:", "-".repeat(w + 1))
        }
    };
    let rule: Vec<String> = widths.iter().enumerate().map(rule).collect();
    let rows: String = body.iter().map(|row| line(row)).collect();
    format!("{}|{}|\n{rows}", line(header), rule.join("|"))
}
