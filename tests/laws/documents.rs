//! Code that the documents mention exists.

use super::source::{root, text, words};

/// Returns the `file: name` pairs of docs/inside/transport.md.
fn pairs(page: &str) -> Vec<(String, String)> {
    let quoted = page.split('`').skip(1).step_by(2);
    let pair = |span: &str| {
        let (file, name) = span.split_once(": ")?;
        let is_file = file.ends_with(".rs") && !file.contains(' ');
        is_file.then(|| (file.to_owned(), name.to_owned()))
    };
    quoted.filter_map(pair).collect()
}

#[test]
fn the_map_of_symbols_names_what_is_in_the_code() {
    let pairs = pairs(&text("docs/inside/transport.md"));
    assert!(pairs.len() > 60, "the page was not understood: {pairs:?}");
    let mut lost = Vec::new();
    for (file, name) in pairs {
        let path = if file.starts_with("src/") {
            file.clone()
        } else {
            format!("src/transport/{file}")
        };
        let there = root().join(&path).is_file() && words(&text(&path), &name).next().is_some();
        if !there {
            lost.push(format!("{file}: {name}"));
        }
    }
    assert!(
        lost.is_empty(),
        "docs/inside/transport.md names what is not there:\n{}",
        lost.join("\n")
    );
}

#[test]
fn the_page_of_formats_has_every_loader_and_no_other() {
    let page = text("docs/reference/formats.md");
    let headings: Vec<&str> = page.lines().filter_map(|l| l.strip_prefix("## ")).collect();
    let names: Vec<&str> = lumbre::scene::load::FORMATS
        .iter()
        .map(|row| row.name)
        .collect();
    assert_eq!(
        headings, names,
        "docs/reference/formats.md against scene::load::FORMATS"
    );
}
