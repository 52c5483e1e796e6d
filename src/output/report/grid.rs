//! Tables as Markdown, CSV and LaTeX (booktabs).

use super::item::{Item, Kind, Provenance};
use super::latex;
use crate::output::labels::{csv_line, exact, significant};

/// Columns that fit into one column of a page.
const NARROW: usize = 3;

/// How the numbers of a table are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Digits {
    /// So many significant digits; whole numbers are written whole.
    Significant(usize),
    /// Per cent of one, without digits after the point.
    Percent,
}

/// One entry.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Entry {
    /// The number; `None` is a dash.
    pub value: Option<f64>,
    /// Whether the true value is larger: a threshold that was not reached.
    pub more: bool,
    /// Half width of the 95 % confidence interval.
    pub half: Option<f64>,
    /// Whether it is the best of its group by more than chance.
    pub best: bool,
    /// How many runs are behind it.
    pub runs: usize,
    /// Their ids.
    pub of: Vec<String>,
}

/// A table.
#[derive(Clone, Debug)]
pub struct Grid {
    /// Its files' name.
    pub name: String,
    /// A few words.
    pub title: String,
    /// What the numbers are.
    pub caption: String,
    /// Unit of the numbers, for the headers of CSV files; empty if there is none.
    pub unit: String,
    /// Headers of the label columns.
    pub corner: Vec<String>,
    /// Groups of columns: a heading, which may be empty, and how many columns it spans.
    pub groups: Vec<(String, usize)>,
    /// Headers of the number columns.
    pub columns: Vec<String>,
    /// Labels and entries.
    pub rows: Vec<(Vec<String>, Vec<Entry>)>,
    /// How numbers are written.
    pub digits: Digits,
    /// What it was made of.
    pub provenance: Provenance,
}

impl Grid {
    /// Its files.
    pub fn item(self) -> Item {
        let extra = vec![
            ("md", self.to_markdown().into_bytes()),
            ("csv", self.to_csv().into_bytes()),
            ("tex", self.to_latex().into_bytes()),
        ];
        Item {
            kind: Kind::Table,
            stem: format!("tables/{}", self.name),
            title: self.title.clone(),
            caption: self.caption.clone(),
            svg: None,
            extra,
            provenance: self.provenance.clone(),
            grid: Some(Box::new(self)),
        }
    }

    fn number(&self, x: f64) -> String {
        match self.digits {
            Digits::Significant(_) if x.fract() == 0.0 && x.abs() < 1e9 => x.to_string(),
            Digits::Significant(n) => significant(x, n),
            Digits::Percent => format!("{:.0} %", 100.0 * x),
        }
    }

    /// Number, sign of a bound, and interval: `> 12.3`, `4.56 ± 0.07`.
    pub fn entry(&self, entry: &Entry) -> String {
        let Some(value) = entry.value else { return "–".to_owned() };
        let text = self.number(value);
        let Some(half) = entry.half.filter(|_| !entry.more) else {
            return format!("{}{text}", if entry.more { "> " } else { "" });
        };
        if text.contains('e') {
            return format!("{text} ± {}", significant(half, 1));
        }
        if self.digits == Digits::Percent {
            return format!("{text} ± {:.0}", 100.0 * half);
        }
        // Two digits of the interval, and the number as far as they go, but no more than the table has: what is beyond
        // would say nothing.
        let own = text.split_once('.').map_or(0, |(_, digits)| digits.len());
        let of_half = if half > 0.0 { 1 - half.log10().floor() as i32 } else { own as i32 };
        let after = own.min(usize::try_from(of_half).unwrap_or(0));
        format!("{value:.after$} ± {half:.after$}")
    }

    /// Headers of number columns with their groups.
    fn headers(&self) -> Vec<String> {
        let groups = self.groups.iter().flat_map(|(group, n)| std::iter::repeat_n(group, *n));
        let joined = groups.zip(&self.columns).map(|(group, column)| match (group.is_empty(), column.is_empty()) {
            (true, _) => column.clone(),
            (_, true) => group.clone(),
            _ => format!("{group}: {column}"),
        });
        joined.collect()
    }

    /// Markdown with the caption above and the runs in a comment below; the best are in bold.
    pub fn to_markdown(&self) -> String {
        let escaped = |s: &String| s.replace('|', "\\|").replace(['\n', '\r'], " ");
        let header: Vec<String> = self.corner.iter().chain(&self.headers()).map(escaped).collect();
        let body: Vec<Vec<String>> = self
            .rows
            .iter()
            .map(|(labels, entries)| {
                let number = |e: &Entry| if e.best { format!("**{}**", self.entry(e)) } else { self.entry(e) };
                labels.iter().map(escaped).chain(entries.iter().map(number)).collect()
            })
            .collect();
        let widths: Vec<usize> = (0..header.len())
            .map(|i| {
                let texts = std::iter::once(&header).chain(&body).filter_map(|row| row.get(i));
                texts.map(|t| t.chars().count()).max().unwrap_or(0).max(3)
            })
            .collect();
        let line = |row: &Vec<String>| {
            let cell = |(i, text): (usize, &String)| {
                let pad = " ".repeat(widths[i].saturating_sub(text.chars().count()));
                if i < self.corner.len() { format!(" {text}{pad} ") } else { format!(" {pad}{text} ") }
            };
            format!("|{}|\n", row.iter().enumerate().map(cell).collect::<Vec<_>>().join("|"))
        };
        let rule: Vec<String> = widths
            .iter()
            .enumerate()
            .map(|(i, w)| if i < self.corner.len() { "-".repeat(w + 2) } else { format!("{}:", "-".repeat(w + 1)) })
            .collect();
        let rows: String = body.iter().map(line).collect();
        format!(
            "**{}.** {}\n\n{}|{}|\n{rows}\n<!--\n{}\n-->\n",
            self.title,
            self.caption,
            line(&header),
            rule.join("|"),
            self.provenance.text().replace("--", "- -")
        )
    }

    /// One line for each entry: labels, group, column, value, half width of the interval, whether it is a lower bound,
    /// whether it is the best, the number of runs, the unit, and the runs' ids. Full precision; what has no value is empty.
    pub fn to_csv(&self) -> String {
        let mut header = self.corner.clone();
        header.extend(
            ["group", "column", "value", "ci95_half", "lower_bound", "best", "runs", "unit", "run_ids"]
                .map(str::to_owned),
        );
        let mut text = csv_line(&header);
        let groups: Vec<&String> = self.groups.iter().flat_map(|(group, n)| std::iter::repeat_n(group, *n)).collect();
        for (labels, entries) in &self.rows {
            for ((column, group), entry) in self.columns.iter().zip(&groups).zip(entries) {
                let mut fields = labels.clone();
                fields.extend([(*group).clone(), column.clone()]);
                fields.push(entry.value.map(exact).unwrap_or_default());
                fields.push(entry.half.map(exact).unwrap_or_default());
                fields.extend([entry.more, entry.best].map(|b| u8::from(b).to_string()));
                fields.extend([entry.runs.to_string(), self.unit.clone(), entry.of.join(" ")]);
                text += &csv_line(&fields);
            }
        }
        text
    }

    /// A `table` environment with booktabs' rules; groups span their columns.
    pub fn to_latex(&self) -> String {
        let n = self.corner.len();
        let mut out = self.provenance.comment("% ");
        // What is wider than a column of a page takes both.
        let table = if n + self.columns.len() > NARROW { "table*" } else { "table" };
        out += &format!(
            "% Needs \\usepackage{{booktabs}}.\n\\begin{{{table}}}\n  \\centering\\small\\setlength{{\\belowcaptionskip}}{{4pt}}\n"
        );
        out += &format!("  \\caption{{{}. {}}}\n", latex::escape(&self.title), latex::escape(&self.caption));
        out += &format!("  \\label{{tab:{}}}\n", self.name);
        out += &format!("  \\begin{{tabular}}{{{}{}}}\n    \\toprule\n", "l".repeat(n), "r".repeat(self.columns.len()));
        if self.groups.iter().any(|(group, _)| !group.is_empty()) {
            let (mut heads, mut rules, mut at) = (vec![String::new(); n], String::new(), n + 1);
            for (group, span) in &self.groups {
                heads.push(format!("\\multicolumn{{{span}}}{{c}}{{{}}}", latex::escape(group)));
                rules += &format!("\\cmidrule(lr){{{at}-{}}}", at + span - 1);
                at += span;
            }
            out += &format!("    {} \\\\\n    {rules}\n", heads.join(" & "));
        }
        let header: Vec<String> = self.corner.iter().chain(&self.columns).map(|h| latex::escape(h)).collect();
        out += &format!("    {} \\\\\n    \\midrule\n", header.join(" & "));
        for (labels, entries) in &self.rows {
            let number = |e: &Entry| {
                let text = self.entry(e);
                let text = match text.split_once('e') {
                    Some((factor, power)) if e.value.is_some() => {
                        let (power, rest) = power.split_once(' ').map_or((power, ""), |(p, rest)| (p, rest));
                        let rest = if rest.is_empty() { String::new() } else { format!(" {}", latex::escape(rest)) };
                        format!("${} \\times 10^{{{power}}}${rest}", factor.replace("> ", ">"))
                    }
                    _ => latex::escape(&text).replace("\\textgreater{} ", "$>$\\,"),
                };
                if e.best { format!("\\textbf{{\\boldmath {text}}}") } else { text }
            };
            let cells: Vec<String> =
                labels.iter().map(|l| latex::escape(l)).chain(entries.iter().map(number)).collect();
            out += &format!("    {} \\\\\n", cells.join(" & "));
        }
        out + &format!("    \\bottomrule\n  \\end{{tabular}}\n\\end{{{table}}}\n")
    }
}
