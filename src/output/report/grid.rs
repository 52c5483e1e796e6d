//! Tables of the report as Markdown, CSV and LaTeX (booktabs).

use super::item::{ItemKind, Provenance, ReportItem};
use super::latex;
use crate::output::format::{exact, significant};
use crate::output::quantity::Bound;
use crate::output::table::export::markdown_table;
use crate::text::csv_line;

/// Maximum number of table columns that fit into one column of a page.
const NARROW: usize = 3;

/// Number format of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Digits {
    /// Number of significant digits. Integers are written in full.
    Significant(usize),
    /// Percentage without decimals.
    Percent,
}

/// The 95 % confidence interval of a mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Interval {
    /// The mean minus and plus this half-width.
    Half(f64),
    /// From the mean divided by this factor to the mean times it: the interval of a geometric mean.
    Factor(f64),
    /// Lower and upper end.
    Ends(f64, f64),
}

impl Interval {
    /// Returns the lower and the upper end for a mean.
    pub fn ends(self, mean: f64) -> (f64, f64) {
        match self {
            Interval::Half(half) => (mean - half, mean + half),
            Interval::Factor(factor) => (mean / factor, mean * factor),
            Interval::Ends(low, high) => (low, high),
        }
    }
}

/// One number of a table, with its uncertainty and its runs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GridCell {
    /// The number; `None` is written as a dash.
    pub value: Option<f64>,
    /// Whether the number is a bound of a time.
    pub bound: Bound,
    /// Its 95 % confidence interval.
    pub interval: Option<Interval>,
    /// Whether the number is significantly better than all others of its group.
    pub best: bool,
    /// Whether the number of a run is dominated by the noise of its reference.
    pub at_floor: bool,
    /// Number of runs averaged.
    pub runs: usize,
    /// Identities of the runs.
    pub run_ids: Vec<String>,
}

/// A table of the report.
#[derive(Clone, Debug)]
pub struct Grid {
    /// Name of the table's files.
    pub name: String,
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
    pub rows: Vec<(Vec<String>, Vec<GridCell>)>,
    /// Format of the numbers.
    pub digits: Digits,
    /// Runs and plans that the table is made from.
    pub provenance: Provenance,
}

impl Grid {
    /// Converts the table to an item of the report with its files.
    pub fn item(self) -> ReportItem {
        let extra = vec![
            ("md", self.to_markdown().into_bytes()),
            ("csv", self.to_csv().into_bytes()),
            ("tex", self.to_latex().into_bytes()),
        ];
        ReportItem {
            kind: ItemKind::Table,
            section: self.section.clone(),
            stem: format!("tables/{}", self.name),
            title: self.title.clone(),
            caption: self.caption.clone(),
            svg: None,
            extra,
            provenance: self.provenance.clone(),
            grid: Some(Box::new(self)),
        }
    }

    /// Returns all cells, row by row.
    pub fn cells(&self) -> Vec<&GridCell> {
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
    pub fn cell(&self, cell: &GridCell) -> String {
        let mark = if cell.at_floor { "†" } else { "" };
        let Some(value) = cell.value else {
            return "–".to_owned();
        };
        match cell.interval.filter(|_| cell.bound == Bound::Exact) {
            None => format!("{}{}{mark}", cell.bound.sign(), self.number(value)),
            Some(interval) => self.number_with_interval(value, interval, mark),
        }
    }

    fn number_with_interval(&self, value: f64, interval: Interval, mark: &str) -> String {
        let text = self.number(value);
        if self.digits == Digits::Percent {
            let (low, high) = interval.ends(value);
            return format!("{text}{mark} ± {:.0}", 50.0 * (high - low));
        }
        // The number has no more decimals than the second significant digit of its interval, and no
        // more than the table's format allows.
        let (low, high) = interval.ends(value);
        let own_decimals = text.split_once('.').map_or(0, |(_, digits)| digits.len());
        let decimals = decimals_of_two_digits(0.5 * (high - low))
            .map_or(own_decimals, |d| own_decimals.min(d));
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

    /// Formats the table as Markdown with the caption above and the provenance in a comment below.
    /// Best values are bold.
    pub fn to_markdown(&self) -> String {
        let escaped = |s: &String| s.replace('|', "\\|").replace(['\n', '\r'], " ");
        let number = |cell: &GridCell| {
            if cell.best {
                format!("**{}**", self.cell(cell))
            } else {
                self.cell(cell)
            }
        };
        let header: Vec<String> = self
            .label_headers
            .iter()
            .chain(&self.headers())
            .map(escaped)
            .collect();
        let row = |(labels, cells): &(Vec<String>, Vec<GridCell>)| -> Vec<String> {
            let labels = labels.iter().map(escaped);
            labels.chain(cells.iter().map(number)).collect()
        };
        let body: Vec<Vec<String>> = self.rows.iter().map(row).collect();
        format!(
            "**{}.** {}\n\n{}\n<!--\n{}\n-->\n",
            self.title,
            self.caption,
            markdown_table(&header, &body, self.label_headers.len()),
            self.provenance.text().replace("--", "- -")
        )
    }

    /// Formats the table as CSV in full precision, with one line for each cell: labels, group,
    /// column, value, ends of the interval, kind of bound, whether it is the best, whether it is at
    /// the noise floor, number of runs, unit, and identities of the runs. Missing values are empty.
    pub fn to_csv(&self) -> String {
        let mut header = self.label_headers.clone();
        header.extend(
            [
                "group",
                "column",
                "value",
                "ci95_low",
                "ci95_high",
                "bound",
                "best",
                "at_floor",
                "runs",
                "unit",
                "run_ids",
            ]
            .map(str::to_owned),
        );
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
                fields.extend([
                    cell.bound.name().to_owned(),
                    u8::from(cell.best).to_string(),
                    u8::from(cell.at_floor).to_string(),
                ]);
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

    /// Formats the table as a LaTeX `table` environment with booktabs rules.
    pub fn to_latex(&self) -> String {
        let labels = self.label_headers.len();
        // Wide tables span both columns of a page.
        let table = if labels + self.columns.len() > NARROW {
            "table*"
        } else {
            "table"
        };
        let mut out = self.provenance.comment("% ");
        out += &format!(
            "% Needs \\usepackage{{booktabs}}.\n\\begin{{{table}}}\n  \
             \\centering\\small\\setlength{{\\belowcaptionskip}}{{4pt}}\n"
        );
        out += &format!(
            "  \\caption{{{}. {}}}\n",
            latex::escape(&self.title),
            latex::escape(&self.caption)
        );
        out += &format!("  \\label{{tab:{}}}\n", self.name);
        out += &format!(
            "  \\begin{{tabular}}{{{}{}}}\n    \\toprule\n",
            "l".repeat(labels),
            "r".repeat(self.columns.len())
        );
        out += &self.latex_header();
        for (labels, cells) in &self.rows {
            let fields: Vec<String> = labels
                .iter()
                .map(|l| latex::escape(l))
                .chain(cells.iter().map(|cell| self.latex_cell(cell)))
                .collect();
            out += &format!("    {} \\\\\n", fields.join(" & "));
        }
        out + &format!("    \\bottomrule\n  \\end{{tabular}}\n\\end{{{table}}}\n")
    }

    /// Formats the header rows. Groups span their columns.
    fn latex_header(&self) -> String {
        let mut out = String::new();
        if self.groups.iter().any(|(group, _)| !group.is_empty()) {
            let labels = self.label_headers.len();
            let mut heads = vec![String::new(); labels];
            let (mut rules, mut first) = (String::new(), labels + 1);
            for (group, span) in &self.groups {
                heads.push(format!(
                    "\\multicolumn{{{span}}}{{c}}{{{}}}",
                    latex::escape(group)
                ));
                rules += &format!("\\cmidrule(lr){{{first}-{}}}", first + span - 1);
                first += span;
            }
            out += &format!("    {} \\\\\n    {rules}\n", heads.join(" & "));
        }
        let header: Vec<String> = self
            .label_headers
            .iter()
            .chain(&self.columns)
            .map(|h| latex::escape(h))
            .collect();
        out + &format!("    {} \\\\\n    \\midrule\n", header.join(" & "))
    }

    /// Formats a cell, with powers of ten in math mode and the best value in bold.
    fn latex_cell(&self, cell: &GridCell) -> String {
        let text = self.cell(cell);
        let text = match text.split_once('e') {
            Some((factor, power)) if cell.value.is_some() => {
                let (power, rest) = power
                    .split_once(' ')
                    .map_or((power, ""), |(p, rest)| (p, rest));
                let rest = if rest.is_empty() {
                    String::new()
                } else {
                    format!(" {}", latex::escape(rest))
                };
                format!(
                    "${} \\times 10^{{{power}}}${rest}",
                    factor.replace("> ", ">")
                )
            }
            _ => latex::escape(&text).replace("\\textgreater{} ", "$>$\\,"),
        };
        if cell.best {
            format!("\\textbf{{\\boldmath {text}}}")
        } else {
            text
        }
    }
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
        let grid = |digits| Grid {
            name: String::new(),
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
        let four = grid(Digits::Significant(4));
        let written = |value, interval| {
            four.cell(&GridCell {
                value: Some(value),
                interval: Some(interval),
                ..GridCell::default()
            })
        };
        assert_eq!(written(0.43215, Interval::Half(0.0123)), "0.432 ± 0.012");
        assert_eq!(written(0.43215, Interval::Factor(1.0284)), "0.432 ×÷ 1.028");
        assert_eq!(written(125.0, Interval::Factor(2.513)), "125 ×÷ 2.5");
        assert_eq!(written(125.3, Interval::Factor(14.2)), "125 ×÷ 14");
        assert_eq!(
            written(0.95312, Interval::Ends(0.9501, 0.9555)),
            "0.9531 (0.9501 to 0.9555)"
        );
        assert_eq!(written(3.25e-7, Interval::Factor(1.25)), "3.250e-7 ×÷ 1.25");
        assert_eq!(written(2.0, Interval::Factor(1.0)), "2 ×÷ 1");
        let cell = GridCell {
            value: Some(0.5),
            at_floor: true,
            ..GridCell::default()
        };
        assert_eq!(four.cell(&cell), "0.5000†");
        assert_eq!(grid(Digits::Percent).cell(&cell), "50 %†");
    }
}
