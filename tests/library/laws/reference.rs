//! Generated reference pages of docs/reference match the tables of the program.

use super::source::{root, text};

/// Line that separates the hand-written introduction from the generated part.
const MARKER: &str = "<!-- Generated from the program's tables by tests/library/laws/reference.rs: do not edit below. -->\n";

/// Compares the part of `page` below the marker with `generated`. Writes the page and panics if
/// they differ.
fn check(page: &str, generated: &str) {
    let stored = text(page);
    let (introduction, part) = stored
        .split_once(MARKER)
        .expect("the page has no marker of its generated part");
    let expected = format!("\n{generated}");
    if part != expected {
        let new = format!("{introduction}{MARKER}{expected}");
        std::fs::write(root().join(page), new).unwrap();
        panic!("{page} was out of date and has been written again: commit it");
    }
}

#[test]
fn the_script_reference_is_up_to_date() {
    let pages = lumbre_lua::reference().map(|(file, text)| {
        let page = format!("docs/reference/{file}");
        std::panic::catch_unwind(|| check(&page, &text))
    });
    assert!(
        pages.iter().all(Result::is_ok),
        "a page was written again: commit it"
    );
}

#[test]
fn the_reference_of_metrics_is_up_to_date() {
    check("docs/reference/metrics.md", &lumbre_metrics::reference());
}

#[test]
fn the_reference_of_files_is_up_to_date() {
    check(
        "docs/reference/files.md",
        &lumbre_night::store::schema::reference(),
    );
}

#[test]
fn the_reference_of_the_command_line_is_up_to_date() {
    check("docs/reference/command-line.md", &lumbre::cli::reference());
}
