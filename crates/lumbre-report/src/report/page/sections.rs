//! Sections of the page: the answer, the tables and the figures.

use std::collections::BTreeMap;

use maud::{Markup, PreEscaped, html};

use super::views::View;
use crate::plot::svg::base64;
use crate::report::item::{ItemKind, ReportItem};
use crate::report::requested::SECTION;
use crate::report::study::Study;
use crate::report::tables::TEST;
use crate::report::verdict::{EXPLANATION, Verdict, Winner, is_root_of_shown};
use crate::table::Table;

/// Writes the answer: sentences, the winners of every facet with a thumbnail of its reference, and
/// what weakens them. `notes` is the number of notes at the end of the page.
pub fn answer(study: &Study, verdict: &Verdict, views: &[View], notes: usize) -> Markup {
    html! {
        section #answer {
            @for sentence in &verdict.sentences { p.answer { (sentence) } }
            div #findings {
                @if !verdict.columns.is_empty() {
                    div.scroll {
                        table #verdict {
                            thead {
                                tr {
                                    th {} th {}
                                    @for column in &verdict.columns { th { (column.heading) } }
                                }
                            }
                            tbody {
                                @for facet in 0..study.facets.len().min(verdict.rows.len()) {
                                    (winners(verdict, facet, views))
                                }
                            }
                        }
                        p.note { (EXPLANATION) }
                    }
                }
                @if notes > 0 || !verdict.caveats.is_empty() {
                    div #caveats {
                        b { "Before you believe it" }
                        ul {
                            @for caveat in &verdict.caveats { li { (prose(caveat)) } }
                            @if notes > 0 {
                                li {
                                    a href="#notes" {
                                        (notes) @if notes == 1 { " note" } @else { " notes" }
                                        " on what was left out"
                                    }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// Marks what is between two backticks of a sentence as code.
pub fn prose(text: &str) -> Markup {
    // A backtick without a second one stays.
    let (paired, last) = match text.matches('`').count() % 2 {
        0 => (text, None),
        _ => text
            .rsplit_once('`')
            .map_or((text, None), |(paired, last)| (paired, Some(last))),
    };
    html! {
        @for (index, part) in paired.split('`').enumerate() {
            @if index % 2 == 1 { code { (part) } } @else { (part) }
        }
        @if let Some(last) = last { "`" (last) }
    }
}

/// Writes one row of the table of winners.
fn winners(verdict: &Verdict, facet: usize, views: &[View]) -> Markup {
    let view = views.iter().position(|view| view.facet == facet);
    html! {
        tr {
            td {
                @if let Some(index) = view {
                    a href="#viewer" data-view=(index) {
                        img alt="reference"
                            src={ "data:image/png;base64," (base64(&views[index].thumbnail)) };
                    }
                }
            }
            td { (verdict.rows[facet]) }
            @for column in &verdict.columns {
                @let winner = column.winners[facet].as_ref();
                @let text = winner.map_or("–".to_owned(), Winner::text);
                @if winner.is_some_and(|w| w.is_significant) {
                    td { b { (text) } }
                } @else {
                    td.open { (text) }
                }
            }
        }
    }
}

/// Writes items below one heading for each section, folded except the first.
fn folded<'a>(items: impl Iterator<Item = (&'a ReportItem, Markup)>) -> Markup {
    let mut sections: Vec<(&str, Vec<Markup>)> = Vec::new();
    for (item, html) in items {
        match sections.iter_mut().find(|(name, _)| *name == item.section) {
            Some((_, all)) => all.push(html),
            None => sections.push((&item.section, vec![html])),
        }
    }
    html! {
        @for (index, (section, items)) in sections.iter().enumerate() {
            details open[index == 0] {
                summary { (section) }
                div.items { @for item in items { (item) } }
            }
        }
    }
}

/// Returns the index of every run in the page's data by its identity.
fn run_index<'a>(study: &'a Study) -> BTreeMap<&'a str, usize> {
    let runs = study.all().enumerate();
    runs.map(|(i, m)| (m.run.id.as_str(), i)).collect()
}

/// Writes the figures and tables that the script requests, if there are any.
pub fn requested(study: &Study, items: &[ReportItem]) -> Option<Markup> {
    let run_index = run_index(study);
    let requested = items.iter().filter(|item| item.section == SECTION);
    let parts: Vec<Markup> = requested
        .map(|item| match item.table.as_deref() {
            Some(data) => table(item, data, &run_index),
            None => figure(item),
        })
        .collect();
    let is_empty = parts.is_empty();
    let section = html! {
        section #requested {
            h2 { (SECTION) }
            div.items { @for part in parts { (part) } }
        }
    };
    (!is_empty).then_some(section)
}

/// Writes all other tables.
pub fn tables(study: &Study, items: &[ReportItem]) -> Markup {
    let run_index = run_index(study);
    let all = || {
        let others = items.iter().filter(|item| item.section != SECTION);
        others.filter_map(|item| Some((item, item.table.as_deref()?)))
    };
    html! {
        section #tables {
            h2 { "Tables" }
            @if all().any(|(_, table)| table.caption.contains(TEST)) {
                p.note { (TEST) " Click a number to list its runs." }
            }
            (folded(all().map(|(item, data)| (item, table(item, data, &run_index)))))
        }
    }
}

/// Writes all other figures, but for those of MSE where RMSE is measured: they are the same curves, with
/// every number squared, and only files.
pub fn figures(study: &Study, items: &[ReportItem]) -> Markup {
    let repeated: Vec<String> = (0..study.metrics.len())
        .filter(|metric| is_root_of_shown(study, *metric))
        .map(|metric| format!("-{}", study.metrics[metric].column))
        .collect();
    let repeats = |item: &ReportItem| {
        let stem = item.stem.trim_end_matches(|c: char| c.is_ascii_digit());
        let stem = stem.trim_end_matches('-');
        repeated.iter().any(|metric| stem.ends_with(metric))
    };
    let figures = items
        .iter()
        .filter(|item| item.kind == ItemKind::Figure && item.section != SECTION)
        .filter(|item| !repeats(item));
    html! {
        section #figures {
            h2 { "Figures" }
            (folded(figures.map(|item| (item, figure(item)))))
        }
    }
}

/// Writes links to the files of an item.
fn file_links(item: &ReportItem) -> Markup {
    html! {
        @for extension in item.extensions() {
            " " a href={ (item.stem) "." (extension) } { (extension) }
        }
    }
}

/// Writes the title of an item with a link to itself.
fn heading(item: &ReportItem) -> Markup {
    html! { h3 { (item.title) " " a.self href={ "#" (item.stem) } { "#" } } }
}

fn figure(item: &ReportItem) -> Markup {
    let svg = item.svg.as_deref().unwrap_or_default();
    // All drawings use the font embedded in the page.
    let svg = svg.replacen("font-family=\"Ubuntu,", "font-family=\"Lumbre, Ubuntu,", 1);
    html! {
        figure id=(item.stem) {
            (heading(item))
            (PreEscaped(svg))
            figcaption { (prose(&item.caption)) (file_links(item)) }
        }
    }
}

/// Writes a table with its title, caption and files. `run_index` maps identities of runs to their
/// index in the page's data.
fn table(item: &ReportItem, table: &Table, run_index: &BTreeMap<&str, usize>) -> Markup {
    let caption = table.caption.replace(&format!(" {TEST}"), "");
    html! {
        div.table id=(item.stem) {
            (heading(item))
            div.scroll { (table.to_html(run_index)) }
            p.note {
                (prose(&caption)) (file_links(item)) " "
                button.copy data-text=(table.to_latex()) { "copy LaTeX" }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::prose;

    #[test]
    fn words_between_backticks_are_code() {
        assert_eq!(
            prose("`≤ t`: reached; `a < b` and `c").into_string(),
            "<code>≤ t</code>: reached; <code>a &lt; b</code> and `c"
        );
        assert_eq!(prose("plain").into_string(), "plain");
    }
}
