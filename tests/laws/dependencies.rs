//! Every dependency has its reason in `docs/dependencies.md`, and every reason there has its
//! dependency.

use std::collections::BTreeSet;

use super::source::{root, text};

/// Returns the names in the dependency sections of `Cargo.toml`.
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

/// Returns the names in the first column of the document's tables.
fn explained() -> BTreeSet<String> {
    let text = text("docs/dependencies.md");
    let first = |line: &str| Some(line.strip_prefix("| `")?.split_once('`')?.0.to_owned());
    text.lines().filter_map(first).collect()
}

#[test]
fn every_dependency_has_its_reason() {
    let (declared, explained) = (declared(), explained());
    assert!(
        declared.len() > 10,
        "Cargo.toml was not understood: {declared:?}"
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

#[test]
fn every_reason_says_what_would_be_hand_written() {
    for line in text("docs/dependencies.md")
        .lines()
        .filter(|l| l.starts_with("| `"))
    {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        assert_eq!(cells.len(), 3, "{line}");
        assert!(cells.iter().all(|c| !c.is_empty()), "{line}");
    }
}

/// Returns `1.95` or `1.95.0` as numbers.
fn version(text: &str) -> Vec<u32> {
    let numbers: Vec<u32> = text
        .split('.')
        .map(|n| n.parse().unwrap_or_else(|_| panic!("{text} is a version")))
        .collect();
    numbers.into_iter().take(2).collect()
}

/// Checks that the minimum Rust version builds every dependency, and that the documents and recipes
/// name that version.
#[test]
fn the_rust_that_is_asked_for_is_new_enough_for_every_dependency() {
    let manifest = text("Cargo.toml");
    let ours = manifest
        .lines()
        .find_map(|line| line.strip_prefix("rust-version = \"")?.strip_suffix('"'))
        .unwrap();
    let named = format!("rust:{ours}-bookworm");
    for recipe in ["containers/Dockerfile", "containers/lumbre.def"] {
        assert!(
            text(recipe).contains(&named),
            "{recipe} does not build with {named}"
        );
    }
    assert!(
        text("README.md").contains(&format!("Rust {ours} or newer")),
        "README.md promises another Rust than {ours}"
    );
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    let mut asked = std::process::Command::new(cargo);
    // Dependencies of other systems may be absent on this one.
    asked.args([
        "metadata",
        "--locked",
        "--format-version",
        "1",
        "--filter-platform",
        "x86_64-unknown-linux-gnu",
    ]);
    let answer = asked.current_dir(root()).output().unwrap();
    if !answer.status.success() {
        return println!(
            "SKIPPED: cargo knows not all packages: {}",
            String::from_utf8_lossy(&answer.stderr)
        );
    }
    let json: serde_json::Value = serde_json::from_slice(&answer.stdout).unwrap();
    let packages = json["packages"].as_array().unwrap();
    assert!(packages.len() > 100, "{} packages", packages.len());
    let newer = packages
        .iter()
        .filter_map(|package| Some((&package["name"], package["rust_version"].as_str()?)));
    let newer: Vec<_> = newer
        .filter(|(_, needed)| version(needed) > version(ours))
        .collect();
    assert!(
        newer.is_empty(),
        "Cargo.toml promises Rust {ours}, which does not build {newer:?}"
    );
}
