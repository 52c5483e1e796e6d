//! Every dependency has its reason in `docs/dependencies.md`, and every reason there has its
//! dependency.

use std::collections::BTreeSet;

use super::source::{code_only, text, words};

/// Manifests of the workspace.
const MANIFESTS: [&str; 12] = [
    "Cargo.toml",
    "crates/lumbre-light/Cargo.toml",
    "crates/lumbre-lua/Cargo.toml",
    "crates/lumbre-metrics/Cargo.toml",
    "crates/lumbre-night/Cargo.toml",
    "crates/lumbre-render/Cargo.toml",
    "crates/lumbre-report/Cargo.toml",
    "crates/lumbre-scene-io/Cargo.toml",
    "crates/lumbre-tui/Cargo.toml",
    "crates/lumbre-vulkan/Cargo.toml",
    "crates/own-technique/Cargo.toml",
    "xtask/Cargo.toml",
];

/// Returns the names in the dependency sections of all manifests, without this project's crates.
fn declared() -> BTreeSet<String> {
    let manifests = MANIFESTS.iter().flat_map(|path| declared_in(&text(path)));
    manifests
        .filter(|name| !name.starts_with("lumbre"))
        .collect()
}

/// Returns the names in the dependency sections of a manifest.
fn declared_in(manifest: &str) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    let mut inside = false;
    for line in manifest.lines() {
        if let Some(section) = line.trim().strip_prefix('[') {
            inside = section.trim_end_matches(']').ends_with("dependencies");
        } else if inside && let Some((name, _)) = line.split_once('=') {
            // Keys that continue a table spread over several lines are indented.
            if !line.starts_with([' ', '\t', '#']) {
                let name = name.trim().trim_end_matches(".workspace");
                names.insert(name.to_owned());
            }
        }
    }
    names
}

/// Returns the names in the first column of the document's tables.
fn explained() -> BTreeSet<String> {
    let text = text("docs/dependencies.md");
    let first = |line: &str| Some(line.strip_prefix("| `")?.split_once('`')?.0.to_owned());
    text.lines().filter_map(first).collect()
}

#[test]
fn every_dependency_has_a_reason_and_every_reason_a_dependency() {
    let (declared, explained) = (declared(), explained());
    assert!(
        declared.len() > 10,
        "too few dependencies were found in Cargo.toml: {declared:?}"
    );
    let missing: Vec<_> = declared.difference(&explained).collect();
    assert!(
        missing.is_empty(),
        "docs/dependencies.md gives no reason for {missing:?}"
    );
    let stale: Vec<_> = explained.difference(&declared).collect();
    assert!(
        stale.is_empty(),
        "docs/dependencies.md explains {stale:?}, which Cargo.toml does not have"
    );
}

/// Returns the cells of the rows of a section's table.
fn rows(section: &str) -> Vec<Vec<String>> {
    let text = text("docs/dependencies.md");
    let (_, section) = text.split_once(section).unwrap();
    let section = section.split("\n## ").next().unwrap_or_default();
    let cells = |line: &str| -> Vec<String> {
        let cells = line.trim_matches('|').split('|');
        cells.map(|cell| cell.trim().to_owned()).collect()
    };
    let lines = section.lines().filter(|line| line.starts_with("| `"));
    lines.map(cells).collect()
}

#[test]
fn every_dependency_of_the_program_states_its_seconds_of_compilation() {
    let rows = rows("## Of the program");
    assert!(rows.len() > 20, "{} rows", rows.len());
    for row in &rows {
        assert_eq!(row.len(), 4, "{row:?}");
        let seconds = row[1].parse::<f64>();
        assert!(
            row[1] == "off" || seconds.is_ok_and(f64::is_finite),
            "{row:?}"
        );
        assert!(row.iter().all(|cell| !cell.is_empty()), "{row:?}");
    }
}

#[test]
fn every_dependency_of_the_tests_has_three_cells_with_text() {
    for row in rows("## Of the tests") {
        assert_eq!(row.len(), 3, "{row:?}");
        assert!(row.iter().all(|cell| !cell.is_empty()), "{row:?}");
    }
}

/// Packages that the project was asked to have.
const REQUESTED: [&str; 9] = [
    "mlua",
    "ash",
    "glam",
    "obvhs",
    "tobj",
    "exr",
    "image",
    "ratatui",
    "crossterm",
];

#[test]
fn every_requested_package_is_called_in_the_named_file() {
    let rows = rows("## Requested packages");
    let names: Vec<&str> = rows.iter().map(|row| row[0].trim_matches('`')).collect();
    assert_eq!(names, REQUESTED);
    for row in &rows {
        assert_eq!(row.len(), 4, "{row:?}");
        let [name, _, file, call] = [0, 1, 2, 3].map(|i| row[i].trim_matches('`'));
        let code = code_only(&text(file));
        let code = code.split("#[cfg(test)]").next().unwrap_or_default();
        // `obvhs::..` in an import or in a path.
        let named = words(code, name).any(|at| code[at + name.len()..].starts_with("::"));
        let last = call.rsplit("::").next().unwrap_or_default();
        let called = words(code, last).any(|at| {
            let rest = &code[at + last.len()..];
            code[..at].ends_with(call.strip_suffix(last).unwrap_or_default())
                && (rest.starts_with('(') || rest.starts_with("::<"))
        });
        assert!(named && called, "{file} does not call `{call}` of {name}");
    }
}
