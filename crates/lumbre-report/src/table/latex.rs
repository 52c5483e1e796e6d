//! Writes tables as LaTeX with booktabs rules.

use super::{Table, TableCell};
use crate::latex;

/// Maximum number of table columns that fit into one column of a page.
const NARROW: usize = 3;

impl Table {
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
    fn latex_cell(&self, cell: &TableCell) -> String {
        let text = self.cell(cell);
        let text = match text.split_once('e') {
            Some((factor, power)) if cell.value.is_some() => {
                let (power, rest) = power
                    .split_once(' ')
                    .map_or((power, ""), |(p, rest)| (p, rest));
                let words = rest.split_whitespace().map(word);
                let rest: String = words.map(|word| format!(" {word}")).collect();
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

/// Formats a word of a cell after its value, with the power of ten of a number in math mode.
fn word(word: &str) -> String {
    let number = word.trim_matches(['(', ')', ',']);
    match number.split_once('e') {
        Some((factor, power)) if factor.parse::<f64>().is_ok() && power.parse::<i32>().is_ok() => {
            let shown = format!("${factor} \\times 10^{{{power}}}$");
            word.replace(number, &shown)
        }
        _ => latex::escape(word),
    }
}
