//! Writes tables as Markdown.

use super::{Table, TableCell};
use lumbre_night::text::{visible, wrap};

/// Maximum line length of the caption of [`Table::to_text`] in characters.
const CAPTION_WIDTH: usize = 100;

impl Table {
    /// Formats the table as Markdown with the name and the caption above, in lines of limited
    /// width, so that it is readable in a terminal too.
    pub fn to_text(&self) -> String {
        let caption = wrap(&format!("{}: {}", self.name, self.caption), |line| {
            line.chars().count() <= CAPTION_WIDTH
        });
        format!("{}\n\n{}", caption.join("\n"), self.markdown_rows())
    }

    /// Formats the table as Markdown with title and caption above and the provenance in a comment
    /// below.
    pub fn to_markdown(&self) -> String {
        format!(
            "**{}.** {}\n\n{}\n{}",
            self.title,
            self.caption,
            self.markdown_rows(),
            self.provenance.markup_comment()
        )
    }

    /// Formats header and rows. Best values are bold.
    fn markdown_rows(&self) -> String {
        let escaped = |s: &String| {
            let line = s.replace('|', "\\|").replace(['\n', '\r'], " ");
            visible(&line).into_owned()
        };
        let number = |cell: &TableCell| {
            if cell.best {
                format!("**{}**", self.cell(cell))
            } else {
                self.cell(cell)
            }
        };
        let columns = self.headers();
        let header = self.label_headers.iter().chain(&columns).map(escaped);
        let row = |(labels, cells): &(Vec<String>, Vec<TableCell>)| -> Vec<String> {
            let labels = labels.iter().map(escaped);
            labels.chain(cells.iter().map(number)).collect()
        };
        let body: Vec<Vec<String>> = self.rows.iter().map(row).collect();
        markdown_table(&header.collect::<Vec<_>>(), &body, self.label_headers.len())
    }
}

/// Formats a padded Markdown table. The first `labels` columns are left-aligned, the others
/// right-aligned.
pub(crate) fn markdown_table(header: &[String], body: &[Vec<String>], labels: usize) -> String {
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
