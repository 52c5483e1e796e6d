//! Files of results are read and written by the structures of the schema of the store, never by
//! the names of their fields.

use super::source::{rust_files, text};

/// Rooms that read and write files of results.
const ROOMS: [&str; 4] = [
    "src",
    "crates/lumbre-night/src",
    "crates/lumbre-report/src",
    "crates/lumbre-tui/src/tui",
];

/// Returns whether a line of code indexes JSON by the name of a field.
fn indexes_by_name(line: &str) -> bool {
    let index = line.match_indices("[\"").any(|(at, _)| {
        let before = line[..at].chars().next_back();
        before.is_some_and(|c| c.is_alphanumeric() || "_)]".contains(c))
    });
    index || line.contains(".get(\"") || line.contains(".pointer(\"")
}

#[test]
fn no_json_is_indexed_by_the_name_of_a_field() {
    let mut found = Vec::new();
    let files = ROOMS.map(rust_files);
    for file in files.concat().iter().filter(|file| !file.contains("tests")) {
        let source = text(file);
        let code = source.split("#[cfg(test)]\nmod tests {").next();
        for (number, line) in code.unwrap_or_default().lines().enumerate() {
            if !line.trim_start().starts_with("//") && indexes_by_name(line) {
                found.push(format!("{file}:{}: {line}", number + 1));
            }
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn indexing_is_told_from_lists_of_names() {
    assert!(indexes_by_name("let run = done[\"run\"].as_str();"));
    assert!(indexes_by_name("let run = done.get(\"run\")?;"));
    assert!(!indexes_by_name(
        "for name in [\"done.json\", \"ref.json\"] {"
    ));
}
