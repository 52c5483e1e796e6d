//! Tables of numbers with their uncertainty, and their writers for Markdown, CSV, LaTeX and HTML.
//!
//! A [`Table`] is made by reports and by benchmarks.

mod csv;
mod html;
mod interval;
mod latex;
pub(super) mod markdown;
pub(super) mod ranking;

use super::censored;
use super::comparison::Contrast;
use super::format::significant;
use super::provenance::Provenance;
use super::quantity::{Bound, RunValue};
pub use interval::Interval;
use ranking::Ranking;

/// Number format of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Digits {
    /// Number of significant digits. Integers are written in full.
    Significant(usize),
    /// Percentage without decimals.
    Percent,
}

/// One number of a table, with its uncertainty and its runs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TableCell {
    /// The number; `None` is written as a dash.
    pub value: Option<f64>,
    /// Whether the number is a bound of a time.
    pub bound: Bound,
    /// Its 95 % confidence interval.
    pub interval: Option<Interval>,
    /// Whether the number is significantly better than all others of its group.
    pub best: bool,
    /// Comparison of the best number of its group with this one; `None` for the best.
    pub contrast: Option<Contrast>,
    /// Whether the number of a run is dominated by the noise of its reference.
    pub at_floor: bool,
    /// Number of runs averaged.
    pub runs: usize,
    /// Identities of the runs.
    pub run_ids: Vec<String>,
}

/// Subject of a table in a report, by which other code finds it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableKind {
    /// Final values of the metric with this index in the study.
    Final(usize),
    /// Values of a metric at equal render time.
    EqualTime(usize),
    /// Render times to an equal value of a metric.
    EqualError(usize),
    /// Render times to a threshold of a metric.
    TimeTo(usize),
    /// Any other subject.
    Other,
}

/// A table of numbers with labelled rows and columns.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Name of the table's files.
    pub name: String,
    /// Subject of the table.
    pub kind: TableKind,
    /// Heading of the page under which it is listed: the metric or the subject.
    pub section: String,
    /// Short title of the table.
    pub title: String,
    /// Description of the numbers.
    pub caption: String,
    /// Unit of the numbers, for CSV files; empty if there is none.
    pub unit: String,
    /// Headers of the label columns.
    pub label_headers: Vec<String>,
    /// Groups of columns: a heading, which may be empty, and the number of columns.
    pub groups: Vec<(String, usize)>,
    /// Headers of the number columns.
    pub columns: Vec<String>,
    /// Labels and cells of each row.
    pub rows: Vec<(Vec<String>, Vec<TableCell>)>,
    /// Format of the numbers.
    pub digits: Digits,
    /// Runs and plans that the table is made from.
    pub provenance: Provenance,
}

impl TableCell {
    /// Averages the values of some runs on the scale on which they are compared. If any value is a
    /// bound, returns the median, which may be one too.
    pub fn mean(samples: &[RunValue], ranking: Ranking) -> TableCell {
        let values: Vec<f64> = samples.iter().map(|sample| sample.number).collect();
        if values.is_empty() {
            return TableCell::default();
        }
        let has_bounds = samples.iter().any(|sample| sample.bound.is_open());
        let median = if has_bounds {
            censored::median(samples)
        } else {
            None
        };
        let (value, bound, interval) = match median {
            Some(median) => {
                let interval = median.interval.map(|[low, high]| Interval::Ends(low, high));
                (median.time, median.bound, interval)
            }
            None => {
                let (mean, interval) = ranking.mean(&values);
                (mean, Bound::Exact, interval)
            }
        };
        TableCell {
            value: Some(value),
            bound,
            interval,
            runs: values.len(),
            ..TableCell::default()
        }
    }
}

impl Table {
    /// Returns all cells, row by row.
    pub fn cells(&self) -> Vec<&TableCell> {
        self.rows.iter().flat_map(|(_, cells)| cells).collect()
    }

    fn number(&self, x: f64) -> String {
        match self.digits {
            Digits::Significant(_) if x.fract() == 0.0 && x.abs() < 1e9 => x.to_string(),
            Digits::Significant(n) => significant(x, n),
            Digits::Percent => format!("{:.0} %", 100.0 * x),
        }
    }

    /// Formats a cell as number, bound or number with interval, such as `> 12.3`, `4.56 ± 0.07` or
    /// `4.56 ×÷ 1.02`. A dagger follows a number that is dominated by the noise of its reference.
    pub fn cell(&self, cell: &TableCell) -> String {
        let mark = if cell.at_floor { "†" } else { "" };
        let Some(value) = cell.value else {
            return "–".to_owned();
        };
        let number = match cell.interval {
            None => format!("{}{mark}", self.number(value)),
            Some(interval) => self.number_with_interval(value, interval, mark),
        };
        format!("{}{number}", cell.bound.sign())
    }

    fn number_with_interval(&self, value: f64, interval: Interval, mark: &str) -> String {
        let text = self.number(value);
        let Digits::Significant(digits) = self.digits else {
            return format!("{text}{mark} ± {:.0}", 100.0 * interval.half_width(value));
        };
        // The number has no more decimals than the second significant digit of its interval, and no
        // more than the table's format allows. A number that this would round to 0 has two digits.
        let most = decimals_of(&significant(value, digits));
        let decimals = decimals_of_two_digits(interval.half_width(value)).map_or(
            decimals_of(&text),
            |decimals| {
                let is_zero = value.abs() < 0.5 * 0.1f64.powi(decimals as i32);
                let shown = decimals_of_two_digits(value.abs()).filter(|_| is_zero);
                shown.unwrap_or(decimals).min(most)
            },
        );
        let rounded = |x: f64| {
            if text.contains('e') {
                self.number(x)
            } else {
                format!("{x:.decimals$}")
            }
        };
        let mean = rounded(value);
        match interval {
            Interval::Half(half) if text.contains('e') => {
                format!("{mean}{mark} ± {}", significant(half, 1))
            }
            Interval::Half(half) => format!("{mean}{mark} ± {half:.decimals$}"),
            Interval::Factor(factor) => {
                let decimals = decimals_of_two_digits(factor - 1.0).map_or(0, |d| d.min(4));
                format!("{mean}{mark} ×÷ {factor:.decimals$}")
            }
            Interval::Ends(low, f64::INFINITY) => {
                format!("{mean}{mark} ({} or more)", rounded(low))
            }
            Interval::Ends(low, high) => {
                format!("{mean}{mark} ({} to {})", rounded(low), rounded(high))
            }
        }
    }

    /// Returns the heading of the group of each number column.
    fn column_groups(&self) -> impl Iterator<Item = &String> {
        self.groups
            .iter()
            .flat_map(|(group, n)| std::iter::repeat_n(group, *n))
    }

    /// Returns the headers of the number columns with their groups.
    fn headers(&self) -> Vec<String> {
        let joined = self
            .column_groups()
            .zip(&self.columns)
            .map(
                |(group, column)| match (group.is_empty(), column.is_empty()) {
                    (true, _) => column.clone(),
                    (_, true) => group.clone(),
                    _ => format!("{group}: {column}"),
                },
            );
        joined.collect()
    }
}

/// Returns the number of decimals of a number without an exponent.
fn decimals_of(number: &str) -> usize {
    let decimals = number.split_once('.').filter(|_| !number.contains('e'));
    decimals.map_or(0, |(_, digits)| digits.len())
}

/// Returns the number of decimals that show two significant digits of a positive number; `None`
/// for any other number.
fn decimals_of_two_digits(x: f64) -> Option<usize> {
    let decimals = (x > 0.0 && x.is_finite()).then(|| 1 - x.log10().floor() as i32)?;
    Some(usize::try_from(decimals).unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_digits_that_their_interval_leaves() {
        let table = |digits| Table {
            name: String::new(),
            kind: TableKind::Other,
            section: String::new(),
            title: String::new(),
            caption: String::new(),
            unit: String::new(),
            label_headers: Vec::new(),
            groups: Vec::new(),
            columns: Vec::new(),
            rows: Vec::new(),
            digits,
            provenance: Provenance::default(),
        };
        let four = table(Digits::Significant(4));
        let written = |value, interval| {
            four.cell(&TableCell {
                value: Some(value),
                interval: Some(interval),
                ..TableCell::default()
            })
        };
        assert_eq!(written(0.43215, Interval::Half(0.0123)), "0.432 ± 0.012");
        assert_eq!(written(0.43215, Interval::Factor(1.0284)), "0.432 ×÷ 1.028");
        assert_eq!(written(125.0, Interval::Factor(2.513)), "125 ×÷ 2.5");
        // An interval that is wider than the number does not round it to 0.
        assert_eq!(written(0.3341, Interval::Factor(1628.3)), "0.33 ×÷ 1628");
        assert_eq!(written(0.0021, Interval::Half(0.93)), "0.0021 ± 0.9300");
        assert_eq!(written(125.3, Interval::Factor(14.2)), "125 ×÷ 14");
        assert_eq!(
            written(0.95312, Interval::Ends(0.9501, 0.9555)),
            "0.9531 (0.9501 to 0.9555)"
        );
        assert_eq!(
            written(3.5, Interval::Ends(2.25, f64::INFINITY)),
            "3.500 (2.250 or more)"
        );
        assert_eq!(written(3.25e-7, Interval::Factor(1.25)), "3.250e-7 ×÷ 1.25");
        assert_eq!(written(2.0, Interval::Factor(1.0)), "2 ×÷ 1");
        assert_eq!(written(2.0, Interval::Half(2.48)), "2.0 ± 2.5");
        let cell = TableCell {
            value: Some(0.5),
            at_floor: true,
            ..TableCell::default()
        };
        assert_eq!(four.cell(&cell), "0.5000†");
        assert_eq!(table(Digits::Percent).cell(&cell), "50 %†");
    }

    #[test]
    fn csv_files_name_groups_and_columns_and_leave_bounds_out_of_wide_rows() {
        let cell = |value, bound, interval| TableCell {
            value: Some(value),
            bound,
            interval,
            runs: 3,
            run_ids: vec!["a".to_owned(), "b".to_owned()],
            ..TableCell::default()
        };
        let contrast = Contrast {
            difference: 2.5,
            interval: Some([2.0, 3.0]),
            p: 0.01,
            difference_of_means: None,
        };
        let table = Table {
            name: "t".to_owned(),
            kind: TableKind::Other,
            section: String::new(),
            title: String::new(),
            caption: String::new(),
            unit: "s".to_owned(),
            label_headers: vec!["scene".to_owned()],
            groups: vec![("depth 2".to_owned(), 1), ("depth 9".to_owned(), 1)],
            columns: vec!["nee".to_owned(), "bpt".to_owned()],
            rows: vec![(
                vec!["box".to_owned()],
                vec![
                    cell(4.0, Bound::Exact, Some(Interval::Half(0.5))),
                    TableCell {
                        contrast: Some(contrast),
                        ..cell(60.0, Bound::Lower, None)
                    },
                ],
            )],
            digits: Digits::Significant(4),
            provenance: Provenance::default(),
        };
        let long = table.to_long_csv();
        let lines: Vec<&str> = long.lines().skip(1).collect();
        assert_eq!(
            lines,
            [
                "box,depth 2,nee,4,3.5,4.5,,0,,,,,0,3,s,a b",
                "box,depth 9,bpt,60,,,lower,0,2.5,2,3,0.01,0,3,s,a b",
            ]
        );
        let wide = table.to_wide_csv();
        assert_eq!(
            wide.lines().nth(1),
            Some("box,4,3,0.5,,3,"),
            "the bound has runs, but no value"
        );
    }
}
