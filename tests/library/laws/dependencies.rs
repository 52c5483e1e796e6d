//! Every dependency has its reason in `docs/dependencies.md`, and every reason there has its
//! dependency.

use std::collections::BTreeSet;

use super::source::{root, text};

/// Manifests of the workspace.
const MANIFESTS: [&str; 5] = [
    "Cargo.toml",
    "crates/lumbre-light/Cargo.toml",
    "crates/lumbre-render/Cargo.toml",
    "crates/lumbre-vulkan/Cargo.toml",
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

#[test]
fn every_row_of_a_dependency_has_three_cells_with_text() {
    for line in text("docs/dependencies.md")
        .lines()
        .filter(|l| l.starts_with("| `"))
    {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        assert_eq!(cells.len(), 3, "{line}");
        assert!(cells.iter().all(|c| !c.is_empty()), "{line}");
    }
}

/// Returns the first two numbers of a version such as `1.95` or `1.95.0`.
fn version(text: &str) -> Vec<u32> {
    let numbers: Vec<u32> = text
        .split('.')
        .map(|n| {
            n.parse()
                .unwrap_or_else(|_| panic!("{text} is not a version"))
        })
        .collect();
    numbers.into_iter().take(2).collect()
}

/// Checks that the minimum Rust version builds every dependency, and that the documents and recipes
/// name that version.
#[test]
fn the_stated_rust_version_builds_every_dependency() {
    let manifest = text("Cargo.toml");
    let stated = manifest
        .lines()
        .find_map(|line| line.strip_prefix("rust-version = \"")?.strip_suffix('"'))
        .unwrap();
    let named = format!("rust:{stated}-bookworm");
    for recipe in ["containers/Dockerfile", "containers/lumbre.def"] {
        assert!(
            text(recipe).contains(&named),
            "{recipe} does not build with {named}"
        );
    }
    assert!(
        text("README.md").contains(&format!("Rust {stated} or newer")),
        "README.md does not name Rust {stated} as the oldest version"
    );
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    let mut command = std::process::Command::new(cargo);
    // Dependencies of other operating systems may be absent on this machine.
    command.args([
        "metadata",
        "--locked",
        "--format-version",
        "1",
        "--filter-platform",
        "x86_64-unknown-linux-gnu",
    ]);
    let output = command.current_dir(root()).output().unwrap();
    if !output.status.success() {
        return println!(
            "SKIPPED: `cargo metadata` failed: {}",
            String::from_utf8_lossy(&output.stderr)
        );
    }
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let packages = json["packages"].as_array().unwrap();
    assert!(packages.len() > 100, "{} packages", packages.len());
    let too_new = packages
        .iter()
        .filter_map(|package| Some((&package["name"], package["rust_version"].as_str()?)));
    let too_new: Vec<_> = too_new
        .filter(|(_, needed)| version(needed) > version(stated))
        .collect();
    assert!(
        too_new.is_empty(),
        "Cargo.toml states Rust {stated}, which does not build {too_new:?}"
    );
}
