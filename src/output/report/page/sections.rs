//! Sections of the page: the answer, the tables and the figures.

use std::collections::BTreeMap;

use super::views::View;
use crate::output::plot::svg::{base64, escape};
use crate::output::report::item::{ItemKind, ReportItem};
use crate::output::report::study::Study;
use crate::output::report::tables::TEST;
use crate::output::report::verdict::{EXPLANATION, Verdict, Winner, is_root_of_shown};
use crate::output::table::Table;

/// Writes the answer: sentences, the winners of every facet with a thumbnail of its reference, and
/// what weakens them. `notes` is the number of notes at the end of the page.
pub fn answer(study: &Study, verdict: &Verdict, views: &[View], notes: usize) -> String {
    let mut out = "<section id=\"answer\">\n".to_owned();
    for sentence in &verdict.sentences {
        out += &format!("<p class=\"answer\">{}</p>\n", escape(sentence));
    }
    out += "<div id=\"findings\">\n";
    if !verdict.columns.is_empty() {
        out += "<div class=\"scroll\">\n<table id=\"verdict\"><thead><tr><th></th><th></th>";
        for column in &verdict.columns {
            out += &format!("<th>{}</th>", escape(&column.heading));
        }
        out += "</tr></thead><tbody>\n";
        for facet in 0..study.facets.len().min(verdict.rows.len()) {
            out += &winners(verdict, facet, views);
        }
        out += &format!("</tbody></table>\n<p class=\"note\">{EXPLANATION}</p>\n</div>\n");
    }
    let mut caveats: Vec<String> = verdict.caveats.iter().map(|c| prose(c)).collect();
    if notes > 0 {
        let plural = if notes == 1 { "note" } else { "notes" };
        caveats.push(format!(
            "<a href=\"#notes\">{notes} {plural} on what was left out</a>"
        ));
    }
    if !caveats.is_empty() {
        let items: String = caveats.iter().map(|c| format!("<li>{c}</li>\n")).collect();
        out += &format!(
            "<div id=\"caveats\"><b>Before you believe it</b>\n<ul>\n{items}</ul></div>\n"
        );
    }
    out + "</div>\n</section>\n"
}

/// Escapes a sentence and marks what is between two backticks as code.
pub fn prose(text: &str) -> String {
    let escaped = escape(text);
    let mut parts = escaped.split('`').peekable();
    let (mut out, mut is_code) = (String::new(), false);
    while let Some(part) = parts.next() {
        // A backtick without a second one stays.
        match (is_code, parts.peek()) {
            (true, Some(_)) => out += &format!("<code>{part}</code>"),
            (true, None) => out += &format!("`{part}"),
            (false, _) => out += part,
        }
        is_code = !is_code;
    }
    out
}

/// Writes one row of the table of winners.
fn winners(verdict: &Verdict, facet: usize, views: &[View]) -> String {
    let view = views.iter().position(|view| view.facet == facet);
    let thumbnail = view.map_or(String::new(), |index| {
        let png = base64(&views[index].thumbnail);
        format!(
            "<a href=\"#viewer\" data-view=\"{index}\"><img alt=\"reference\" \
             src=\"data:image/png;base64,{png}\"></a>"
        )
    });
    let mut out = format!(
        "<tr><td>{thumbnail}</td><td>{}</td>",
        escape(&verdict.rows[facet])
    );
    for column in &verdict.columns {
        let winner = column.winners[facet].as_ref();
        let text = winner.map_or("–".to_owned(), Winner::text);
        out += &if winner.is_some_and(|w| w.is_significant) {
            format!("<td><b>{}</b></td>", escape(&text))
        } else {
            format!("<td class=\"open\">{}</td>", escape(&text))
        };
    }
    out + "</tr>\n"
}

/// Writes items below one heading for each section, folded except the first.
fn folded(items: &[(&str, String)]) -> String {
    let mut sections: Vec<(&str, String)> = Vec::new();
    for (section, html) in items {
        match sections.iter_mut().find(|(name, _)| name == section) {
            Some((_, all)) => *all += html,
            None => sections.push((section, html.clone())),
        }
    }
    let fold = |(index, (section, html)): (usize, &(&str, String))| {
        let open = if index == 0 { " open" } else { "" };
        format!(
            "<details{open}><summary>{}</summary>\n<div class=\"items\">\n{html}</div>\n</details>\n",
            escape(section)
        )
    };
    sections.iter().enumerate().map(fold).collect()
}

/// Writes all tables.
pub fn tables(study: &Study, items: &[ReportItem]) -> String {
    let run_index: BTreeMap<&str, usize> = study
        .all()
        .enumerate()
        .map(|(i, m)| (m.run.id.as_str(), i))
        .collect();
    let all = || {
        items
            .iter()
            .filter_map(|item| Some((item, item.table.as_deref()?)))
    };
    let mut out = "<section id=\"tables\">\n<h2>Tables</h2>\n".to_owned();
    if all().any(|(_, table)| table.caption.contains(TEST)) {
        out += &format!(
            "<p class=\"note\">{} Click a number to list its runs.</p>\n",
            escape(TEST)
        );
    }
    let written: Vec<(&str, String)> = all()
        .map(|(item, data)| (item.section.as_str(), table(item, data, &run_index)))
        .collect();
    out + &folded(&written) + "</section>\n"
}

/// Writes all figures, but for those of MSE where RMSE is measured: they are the same curves, with
/// every number squared, and only files.
pub fn figures(study: &Study, items: &[ReportItem]) -> String {
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
        .filter(|item| item.kind == ItemKind::Figure && !repeats(item));
    let written: Vec<(&str, String)> = figures
        .map(|item| (item.section.as_str(), figure(item)))
        .collect();
    format!(
        "<section id=\"figures\">\n<h2>Figures</h2>\n{}</section>\n",
        folded(&written)
    )
}

/// Returns links to the files of an item.
fn file_links(item: &ReportItem) -> String {
    let link = |extension: &str| {
        format!(
            "<a href=\"{}.{extension}\">{extension}</a>",
            escape(&item.stem)
        )
    };
    let links: Vec<String> = item.extensions().into_iter().map(link).collect();
    links.join(" ")
}

/// Writes the title of an item with a link to itself.
fn heading(item: &ReportItem) -> String {
    let stem = escape(&item.stem);
    format!(
        "<h3>{} <a class=\"self\" href=\"#{stem}\">#</a></h3>\n",
        escape(&item.title)
    )
}

fn figure(item: &ReportItem) -> String {
    let svg = item.svg.as_deref().unwrap_or_default();
    // All drawings use the font embedded in the page.
    let svg = svg.replacen("font-family=\"Ubuntu,", "font-family=\"Lumbre, Ubuntu,", 1);
    format!(
        "<figure id=\"{}\">\n{}{svg}<figcaption>{} {}</figcaption>\n</figure>\n",
        escape(&item.stem),
        heading(item),
        prose(&item.caption),
        file_links(item)
    )
}

/// Writes a table with its title, caption and files. `run_index` maps identities of runs to their
/// index in the page's data.
fn table(item: &ReportItem, table: &Table, run_index: &BTreeMap<&str, usize>) -> String {
    let caption = table.caption.replace(&format!(" {TEST}"), "");
    format!(
        "<div class=\"table\" id=\"{}\">\n{}<div class=\"scroll\">{}</div>\n\
         <p class=\"note\">{} {} <button class=\"copy\" data-text=\"{}\">copy LaTeX</button></p>\n\
         </div>\n",
        escape(&item.stem),
        heading(item),
        table.to_html(run_index),
        prose(&caption),
        file_links(item),
        escape(&table.to_latex())
    )
}

#[cfg(test)]
mod tests {
    use super::prose;

    #[test]
    fn words_between_backticks_are_code() {
        assert_eq!(
            prose("`≤ t`: reached; `a < b` and `c"),
            "<code>≤ t</code>: reached; <code>a &lt; b</code> and `c"
        );
        assert_eq!(prose("plain"), "plain");
    }
}
