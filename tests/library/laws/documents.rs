//! Code that the documents mention exists.

use super::source::{from_root, project_files, root, text, words};

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
    let names: Vec<&str> = lumbre_scene_io::load::FORMATS
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

/// Folders of the project at the top level whose files documents name.
const FOLDERS: [&str; 14] = [
    ".ci",
    ".cargo",
    "containers",
    "crates",
    "docs",
    "fuzz",
    "python",
    "scenes",
    "scripts",
    "shaders",
    "src",
    "templates",
    "tests",
    "xtask",
];

/// Words in documents that look like paths of the project and are not: files that a reader writes,
/// and names of shader modules. May only shrink.
const NO_FILES: [&str; 8] = [
    "ao.rs",
    "scenes/two_spheres.lua",
    "tests/technique.rs",
    "bdpt.floats.comp",
    "bdpt.floats.query.comp",
    "bdpt.floats.rgen",
    "bpt.rgen",
    "nee.rgen",
];

/// Returns the paths of project files that a document names: words that begin with a folder of the
/// project, or end like a source file. Words with a placeholder, `NAME` or `*`, are left out.
fn named_paths(page: &str) -> Vec<String> {
    let is_part = |c: char| c.is_alphanumeric() || "._-/{},*".contains(c);
    page.split(|c: char| !is_part(c))
        .map(|word| word.trim_end_matches(['.', ',', '-']))
        .filter(|word| !word.contains("rustup.rs"))
        .filter(|word| !word.contains("NAME") && !word.contains('*'))
        .flat_map(expand_braces)
        .filter(|path| {
            let folder = path.split_once('/').map(|(folder, _)| folder);
            folder.is_some_and(|folder| FOLDERS.contains(&folder))
                || [".rs", ".glsl", ".comp", ".rgen", ".rahit"]
                    .iter()
                    .any(|end| path.ends_with(end) && path.len() > end.len())
        })
        .collect()
}

/// Returns what a word with one list in braces stands for: `a/{b,c}.rs` is `a/b.rs` and `a/c.rs`.
fn expand_braces(word: &str) -> Vec<String> {
    let parts = word
        .split_once('{')
        .and_then(|(before, rest)| Some((before, rest.split_once('}')?)));
    match parts {
        None => vec![word.to_owned()],
        Some((before, (list, after))) => list
            .split(',')
            .flat_map(|item| expand_braces(&format!("{before}{item}{after}")))
            .collect(),
    }
}

#[test]
fn every_path_that_documents_name_exists() {
    let files: Vec<String> = project_files().iter().map(|path| from_root(path)).collect();
    let ends: std::collections::BTreeSet<&str> = files
        .iter()
        .flat_map(|path| path.match_indices('/').map(|(at, _)| &path[at + 1..]))
        .collect();
    let mut missing = Vec::new();
    let mut count = 0;
    let mut unused = std::collections::BTreeSet::from(NO_FILES);
    for page in files.iter().filter(|path| path.ends_with(".md")) {
        // This page lists scenes of Mitsuba's repositories by their paths there.
        if page.starts_with("fuzz/") || page == "docs/reference/fidelity-scenes.md" {
            continue;
        }
        for path in named_paths(&text(page)) {
            count += 1;
            let exists = root().join(&path).exists() || ends.contains(path.as_str());
            unused.remove(path.as_str());
            if !exists && !NO_FILES.contains(&path.as_str()) {
                missing.push(format!("{page}: {path}"));
            }
        }
    }
    assert!(count > 500, "only {count} paths were found");
    assert!(unused.is_empty(), "no document names these: {unused:?}");
    assert!(
        missing.is_empty(),
        "documents name files that do not exist:\n{}",
        missing.join("\n")
    );
}

#[test]
fn paths_of_a_document_are_found_with_lists_and_without_placeholders() {
    let page =
        "`src/{a,b}.rs: f`, [x](../docs/c.md), scripts/d.lua. `e.rs` scenes/NAME.lua src/*.rs";
    assert_eq!(
        named_paths(page),
        ["src/a.rs", "src/b.rs", "scripts/d.lua", "e.rs"]
    );
}
