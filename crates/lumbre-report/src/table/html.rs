//! Writes tables as HTML.

use std::collections::BTreeMap;

use maud::{Markup, html};

use super::{Table, TableCell};

impl Table {
    /// Formats the table as an HTML `table` element. Numbers link to their runs: `run_index` maps
    /// identities of runs to their index in the data of the page.
    pub fn to_html(&self, run_index: &BTreeMap<&str, usize>) -> Markup {
        html! {
            table {
                thead {
                    @if self.groups.iter().any(|(group, _)| !group.is_empty()) {
                        tr {
                            @for _ in &self.label_headers { th {} }
                            @for (group, span) in &self.groups {
                                th.g colspan=(span) { (group) }
                            }
                        }
                    }
                    tr {
                        @for header in &self.label_headers { th { (header) } }
                        @for header in &self.columns { th.n { (header) } }
                    }
                }
                tbody {
                    @for (labels, cells) in &self.rows {
                        tr {
                            @for label in labels { td { (label) } }
                            @for cell in cells { td.n { (self.html_number(cell, run_index)) } }
                        }
                    }
                }
            }
        }
    }

    /// Formats a number with a link to its runs.
    fn html_number(&self, cell: &TableCell, run_index: &BTreeMap<&str, usize>) -> Markup {
        let text = self.cell(cell);
        let number = html! { @if cell.best { b { (text) } } @else { (text) } };
        let ids = cell.run_ids.iter();
        let runs = ids.filter_map(|id| run_index.get(id.as_str()));
        let runs: Vec<String> = runs.map(usize::to_string).collect();
        html! {
            @if runs.is_empty() {
                (number)
            } @else {
                a href="#run-table" data-runs=(runs.join(" ")) { (number) }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use crate::provenance::Provenance;
    use crate::table::{Digits, Table, TableCell, TableKind};

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
        let html = table.to_html(&BTreeMap::new()).into_string();
        for place in ["label header", "group", "column", "label"] {
            let escaped = format!(">&lt;{place}&gt; &amp; co</t");
            assert!(html.contains(&escaped), "{place}: {html}");
        }
    }
}
