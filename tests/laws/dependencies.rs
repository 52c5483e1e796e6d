//! Every dependency has its reason in `docs/dependencies.md`, and every reason there has its dependency.

use std::collections::BTreeSet;

use super::source::text;

/// Names in the dependency sections of `Cargo.toml`.
fn declared() -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    let mut inside = false;
    for line in text("Cargo.toml").lines() {
        if let Some(section) = line.trim().strip_prefix('[') {
            inside = section.trim_end_matches(']').ends_with("dependencies");
        } else if inside && let Some((name, _)) = line.split_once('=') {
            // Keys that continue a table spread over several lines are indented.
            if !line.starts_with([' ', '\t', '#']) {
                names.insert(name.trim().to_owned());
            }
        }
    }
    names
}

/// Names in the first column of the tables of the document.
fn explained() -> BTreeSet<String> {
    let text = text("docs/dependencies.md");
    let first = |line: &str| Some(line.strip_prefix("| `")?.split_once('`')?.0.to_owned());
    text.lines().filter_map(first).collect()
}

#[test]
fn every_dependency_has_its_reason() {
    let (declared, explained) = (declared(), explained());
    assert!(declared.len() > 10, "Cargo.toml was not understood: {declared:?}");
    let missing: Vec<_> = declared.difference(&explained).collect();
    assert!(missing.is_empty(), "docs/dependencies.md gives no reason for {missing:?}");
    let stale: Vec<_> = explained.difference(&declared).collect();
    assert!(stale.is_empty(), "docs/dependencies.md explains {stale:?}, which Cargo.toml does not have");
}

#[test]
fn every_reason_says_what_would_be_hand_written() {
    for line in text("docs/dependencies.md").lines().filter(|l| l.starts_with("| `")) {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        assert_eq!(cells.len(), 3, "{line}");
        assert!(cells.iter().all(|c| !c.is_empty()), "{line}");
    }
}
