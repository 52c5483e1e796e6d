//! Writes tables as HTML.

use std::collections::BTreeMap;

use super::{Table, TableCell};
use crate::output::plot::svg::escape;

impl Table {
    /// Formats the table as an HTML `table` element. Numbers link to their runs: `run_index` maps
    /// identities of runs to their index in the data of the page.
    pub fn to_html(&self, run_index: &BTreeMap<&str, usize>) -> String {
        let mut out = "<table><thead>".to_owned();
        if self.groups.iter().any(|(group, _)| !group.is_empty()) {
            out += "<tr>";
            out += &"<th></th>".repeat(self.label_headers.len());
            for (group, span) in &self.groups {
                out += &format!("<th class=\"g\" colspan=\"{span}\">{}</th>", escape(group));
            }
            out += "</tr>";
        }
        out += "<tr>";
        for header in &self.label_headers {
            out += &format!("<th>{}</th>", escape(header));
        }
        for header in &self.columns {
            out += &format!("<th class=\"n\">{}</th>", escape(header));
        }
        out += "</tr></thead><tbody>\n";
        for (labels, cells) in &self.rows {
            out += "<tr>";
            for label in labels {
                out += &format!("<td>{}</td>", escape(label));
            }
            for cell in cells {
                out += &self.html_cell(cell, run_index);
            }
            out += "</tr>\n";
        }
        out + "</tbody></table>"
    }

    /// Formats a number with a link to its runs.
    fn html_cell(&self, cell: &TableCell, run_index: &BTreeMap<&str, usize>) -> String {
        let text = escape(&self.cell(cell));
        let text = if cell.best {
            format!("<b>{text}</b>")
        } else {
            text
        };
        let runs: Vec<String> = cell
            .run_ids
            .iter()
            .filter_map(|id| run_index.get(id.as_str()))
            .map(usize::to_string)
            .collect();
        let text = if runs.is_empty() {
            text
        } else {
            let runs = runs.join(" ");
            format!("<a href=\"#run-table\" data-runs=\"{runs}\">{text}</a>")
        };
        format!("<td class=\"n\">{text}</td>")
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use crate::output::provenance::Provenance;
    use crate::output::table::{Digits, Table, TableCell, TableKind};

    #[test]
    fn names_are_escaped_wherever_a_table_has_them() {
        let name = |place: &str| format!("<{place}> & co");
        let table = Table {
            name: String::new(),
            kind: TableKind::Other,
            section: String::new(),
            title: String::new(),
            caption: String::new(),
            unit: String::new(),
            label_headers: vec![name("label header")],
            groups: vec![(name("group"), 1)],
            columns: vec![name("column")],
            rows: vec![(vec![name("label")], vec![TableCell::default()])],
            digits: Digits::Significant(3),
            provenance: Provenance::default(),
        };
        let html = table.to_html(&BTreeMap::new());
        for place in ["label header", "group", "column", "label"] {
            let escaped = format!(">&lt;{place}&gt; &amp; co</t");
            assert!(html.contains(&escaped), "{place}: {html}");
        }
    }
}
