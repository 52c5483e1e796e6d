//! The copy of the repository in which the bugs are planted, and its test binaries.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::command::{cargo, output};

/// Folder of the copy in the root of the repository.
const TREE: &str = "target/bugs/tree";

/// Folder of what is built from the copy.
const BUILD: &str = "target/bugs/build";

/// Folder of the crate that planted code calls, in the copy.
const PLANTED: &str = "crates/lumbre-planted";

/// Manifest of that crate.
const PLANTED_MANIFEST: &str = r#"[package]
name = "lumbre-planted"
version = "0.1.0"
edition = "2024"

[lib]
test = false
doctest = false
"#;

/// Source of that crate.
const PLANTED_SOURCE: &str = r#"//! The planted bug of this process.

use std::sync::LazyLock;

static BUG: LazyLock<Option<u32>> =
    LazyLock::new(|| std::env::var("LUMBRE_BUG").ok()?.parse().ok());

/// Returns whether a bug is the one that the environment variable `LUMBRE_BUG` selects.
#[inline(always)]
pub fn on(bug: u32) -> bool {
    *BUG == Some(bug)
}
"#;

/// Options of cargo's profile `release` for the copy, as environment variables. Assertions are as in
/// the tests of the README. Builds are incremental, since a changed bug changes little code.
const PROFILE: [(&str, &str); 4] = [
    ("CARGO_INCREMENTAL", "1"),
    ("CARGO_PROFILE_RELEASE_CODEGEN_UNITS", "16"),
    ("CARGO_PROFILE_RELEASE_DEBUG_ASSERTIONS", "true"),
    ("CARGO_PROFILE_RELEASE_OVERFLOW_CHECKS", "true"),
];

/// A built test binary.
pub struct TestBinary {
    /// The executable.
    pub path: PathBuf,
    /// Folder of its package, in which cargo would start it.
    pub package: PathBuf,
}

/// Writes the copy: the files that git tracks or would track, changed ones only, so that builds are
/// incremental. `planted` has the texts of sources with bugs by path. Files that are no longer in
/// the repository are removed.
///
/// # Errors
/// Returns a message if a file cannot be read or written, or if git fails.
pub fn write(planted: &BTreeMap<String, String>) -> Result<(), String> {
    let (root, tree) = (crate::root(), crate::root().join(TREE));
    let mut git = Command::new("git");
    git.args(["ls-files", "-z", "--cached", "--others"])
        .arg("--exclude-standard")
        .current_dir(&root);
    let listed = String::from_utf8(output(&mut git)?).map_err(|e| e.to_string())?;
    let mut names: BTreeSet<String> = listed.split('\0').map(str::to_owned).collect();
    // Files that are removed, but not yet for git.
    names.retain(|name| root.join(name).is_file());
    for name in &names {
        let target = tree.join(name);
        match planted.get(name) {
            Some(text) => put(&target, text.as_bytes())?,
            None if name.ends_with("Cargo.toml") => {
                let text = read(&root.join(name))?;
                let text = String::from_utf8_lossy(&text).into_owned();
                put(&target, with_dependency(name, &text).as_bytes())?;
            }
            // Cargo adds the crate of the bugs to it.
            None if name == "Cargo.lock" && target.is_file() => {}
            None => copy(&root.join(name), &target)?,
        }
    }
    let own = [
        ("Cargo.toml", PLANTED_MANIFEST),
        ("src/lib.rs", PLANTED_SOURCE),
    ];
    for (name, text) in own {
        put(&tree.join(PLANTED).join(name), text.as_bytes())?;
        names.insert(format!("{PLANTED}/{name}"));
    }
    remove_others(&tree, &tree, &names)
}

/// Adds the crate of the bugs to the dependencies of a package of the product.
fn with_dependency(manifest: &str, text: &str) -> String {
    const SECTION: &str = "\n[dependencies]\n";
    let folder = manifest.trim_end_matches("Cargo.toml");
    let path = match folder {
        "" => PLANTED.to_owned(),
        _ if folder.starts_with("crates/") => "../lumbre-planted".to_owned(),
        _ => return text.to_owned(),
    };
    let line = format!("{SECTION}lumbre-planted = {{ path = \"{path}\" }}\n");
    text.replacen(SECTION, &line, 1)
}

/// Copies a file with its permissions if its contents differ.
fn copy(from: &Path, to: &Path) -> Result<(), String> {
    let bytes = read(from)?;
    put(to, &bytes)?;
    let permissions = |path: &Path| std::fs::metadata(path).map(|m| m.permissions());
    let message = |e: std::io::Error| format!("{}: {e}", to.display());
    let wanted = permissions(from).map_err(message)?;
    if permissions(to).map_err(message)? != wanted {
        std::fs::set_permissions(to, wanted).map_err(message)?;
    }
    Ok(())
}

/// Writes a file if its contents differ.
fn put(path: &Path, bytes: &[u8]) -> Result<(), String> {
    if std::fs::read(path).is_ok_and(|old| old == bytes) {
        return Ok(());
    }
    let folder = path.parent().unwrap_or(path);
    let done = std::fs::create_dir_all(folder).and_then(|()| std::fs::write(path, bytes));
    done.map_err(|e| format!("{}: {e}", path.display()))
}

/// Reads a file.
fn read(path: &Path) -> Result<Vec<u8>, String> {
    std::fs::read(path).map_err(|e| format!("{}: {e}", path.display()))
}

/// Removes the files of the copy that are not listed.
fn remove_others(tree: &Path, folder: &Path, names: &BTreeSet<String>) -> Result<(), String> {
    let message = |e: std::io::Error| format!("{}: {e}", folder.display());
    for entry in std::fs::read_dir(folder).map_err(message)?.flatten() {
        let path = entry.path();
        let name = path.strip_prefix(tree).unwrap_or(&path).to_string_lossy();
        if path.is_dir() {
            remove_others(tree, &path, names)?;
        } else if name != "Cargo.lock" && !names.contains(name.as_ref()) {
            std::fs::remove_file(&path).map_err(message)?;
        }
    }
    Ok(())
}

/// Builds the test binaries of the README's test command, and returns them by name: libraries for
/// unit tests, and test targets.
///
/// # Errors
/// Returns a message if the build fails.
pub fn build() -> Result<BTreeMap<String, TestBinary>, String> {
    let mut build = cargo();
    build
        .args(["test", "--release", "--offline", "--no-run"])
        .arg("--message-format=json-render-diagnostics")
        .current_dir(crate::root().join(TREE))
        .env("CARGO_TARGET_DIR", crate::root().join(BUILD))
        .env("RUSTFLAGS", "-Awarnings")
        .envs(PROFILE)
        .stderr(std::process::Stdio::inherit());
    let messages = output(&mut build)?;
    Ok(binaries(&String::from_utf8_lossy(&messages)))
}

/// Returns the test binaries that messages of cargo name.
fn binaries(messages: &str) -> BTreeMap<String, TestBinary> {
    let messages = messages
        .lines()
        .filter_map(|l| serde_json::from_str::<Value>(l).ok());
    let mut found = BTreeMap::new();
    for message in messages {
        let target = &message["target"];
        let kind = target["kind"][0].as_str().unwrap_or_default();
        let manifest = Path::new(message["manifest_path"].as_str().unwrap_or_default());
        let executable = message["executable"].as_str();
        if let Some(path) = executable.filter(|_| ["lib", "test"].contains(&kind)) {
            let name = target["name"]
                .as_str()
                .unwrap_or_default()
                .replace('-', "_");
            let binary = TestBinary {
                path: path.into(),
                package: manifest.parent().unwrap_or(manifest).to_owned(),
            };
            found.insert(name, binary);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_packages_of_the_product_depend_on_the_crate_of_bugs() {
        let manifest = "[package]\nname = \"a\"\n\n[dependencies]\nb = \"1\"\n";
        let expected = |path: &str| {
            format!(
                "[package]\nname = \"a\"\n\n[dependencies]\n\
                 lumbre-planted = {{ path = \"{path}\" }}\nb = \"1\"\n"
            )
        };
        let cases = [
            ("Cargo.toml", expected("crates/lumbre-planted")),
            (
                "crates/lumbre-light/Cargo.toml",
                expected("../lumbre-planted"),
            ),
            ("xtask/Cargo.toml", manifest.to_owned()),
        ];
        for (path, text) in cases {
            assert_eq!(with_dependency(path, manifest), text, "{path}");
        }
    }

    #[test]
    fn libraries_and_test_targets_are_test_binaries_and_programs_are_not() {
        let artifact = |name: &str, kind: &str, executable: &str| {
            format!(
                r#"{{"manifest_path":"/p/Cargo.toml","target":{{"name":"{name}","kind":["{kind}"]}},"executable":{executable}}}"#
            )
        };
        let messages = [
            artifact("lumbre", "bin", "\"/t/lumbre\""),
            artifact("lumbre-light", "lib", "\"/t/light\""),
            artifact("program", "test", "\"/t/program\""),
            artifact("glam", "lib", "null"),
        ];
        let found = binaries(&messages.join("\n"));
        let names: Vec<&str> = found.keys().map(String::as_str).collect();
        assert_eq!(names, ["lumbre_light", "program"]);
        assert_eq!(found["program"].package, Path::new("/p"));
    }
}
