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
fn every_symbol_named_in_the_page_of_transport_exists() {
    let pairs = pairs(&text("docs/inside/transport.md"));
    assert!(pairs.len() > 60, "too few pairs were found: {pairs:?}");
    let mut missing = Vec::new();
    for (file, name) in pairs {
        let path = if file.contains("src/") {
            file.clone()
        } else {
            format!("crates/lumbre-light/src/transport/{file}")
        };
        let exists = root().join(&path).is_file() && words(&text(&path), &name).next().is_some();
        if !exists {
            missing.push(format!("{file}: {name}"));
        }
    }
    assert!(
        missing.is_empty(),
        "docs/inside/transport.md names symbols that do not exist:\n{}",
        missing.join("\n")
    );
}

#[test]
fn the_page_of_formats_has_one_heading_for_every_loader() {
    let page = text("docs/reference/formats.md");
    let headings: Vec<&str> = page.lines().filter_map(|l| l.strip_prefix("## ")).collect();
    let names: Vec<&str> = lumbre_light::scene::load::FORMATS
        .iter()
        .map(|row| row.name)
        .collect();
    assert_eq!(
        headings, names,
        "headings of docs/reference/formats.md and rows of scene::load::FORMATS"
    );
}

/// Rewrites the listing of Rust code of a page, and fails, if it is not this file.
fn check_listing(path: &str, file: &str) {
    let page = text(path);
    let (before, rest) = page.split_once("```rust\n").expect("no listing");
    let (listing, after) = rest.split_once("```\n").expect("the listing has no end");
    if listing != file {
        let whole = format!("{before}```rust\n{file}```\n{after}");
        std::fs::write(root().join(path), whole).unwrap();
        panic!("the listing of {path} was out of date and has been written again: commit it");
    }
}

#[test]
fn the_listing_of_an_integrator_is_the_file_that_tests_render() {
    let file = text("crates/own-technique/tests/ambient_occlusion/technique.rs");
    let inside = file.replace("lumbre_light::", "crate::");
    check_listing("docs/inside/extending/integrator.md", &inside);
}

#[test]
fn the_listing_of_a_technique_of_single_samples_is_the_file_that_tests_render() {
    let file = text("crates/own-technique/tests/single_samples/technique.rs");
    check_listing("docs/reference/own_technique.md", &file);
}
