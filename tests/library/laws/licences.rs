//! Licences and sources of all packages that a build of the workspace may contain.

use std::collections::BTreeSet;
use std::process::{Command, Output};

use super::source::root;

/// Licences under which a package may be used. They allow use in programs of any licence.
const ALLOWED: [&str; 15] = [
    "0BSD",
    "Apache-2.0",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "BSL-1.0",
    "CC0-1.0",
    "ISC",
    "MIT",
    "MIT-0",
    "OFL-1.1",
    "Ubuntu-font-1.0",
    "Unicode-3.0",
    "Unlicense",
    "Zlib",
    "Apache-2.0 WITH LLVM-exception",
];

/// Returns whether an SPDX expression can be satisfied with the allowed licences. `/` is an old
/// form of `OR`.
fn is_allowed(expression: &str) -> bool {
    let spaced = expression.replace('(', " ( ").replace(')', " ) ");
    let words: Vec<String> = spaced
        .replace('/', " OR ")
        .split_whitespace()
        .map(str::to_owned)
        .collect();
    let mut at = 0;
    let allowed = any(&words, &mut at);
    allowed && at == words.len()
}

/// Reads alternatives, joined by `OR`, from `words[*at]` on.
fn any(words: &[String], at: &mut usize) -> bool {
    let mut allowed = all(words, at);
    while words.get(*at).is_some_and(|word| word == "OR") {
        *at += 1;
        allowed |= all(words, at);
    }
    allowed
}

/// Reads requirements, joined by `AND`.
fn all(words: &[String], at: &mut usize) -> bool {
    let mut allowed = one(words, at);
    while words.get(*at).is_some_and(|word| word == "AND") {
        *at += 1;
        allowed &= one(words, at);
    }
    allowed
}

/// Reads one licence with its exception, or an expression in parentheses.
fn one(words: &[String], at: &mut usize) -> bool {
    let Some(word) = words.get(*at) else {
        return false;
    };
    *at += 1;
    if word == "(" {
        let allowed = any(words, at);
        *at += 1;
        return allowed;
    }
    let mut licence = word.clone();
    if words.get(*at).is_some_and(|word| word == "WITH") {
        let exception = words.get(*at + 1).map_or("", String::as_str);
        licence = format!("{licence} WITH {exception}");
        *at += 2;
    }
    ALLOWED.contains(&licence.as_str())
}

/// Returns each package with its licence on a line, as cargo knows them without the network.
fn packages(options: &[&str]) -> Output {
    Command::new(env!("CARGO"))
        .args([
            "tree",
            "--locked",
            "--offline",
            "--prefix",
            "none",
            "--format",
            "{p}|{l}",
        ])
        .args(options)
        .current_dir(root())
        .output()
        .unwrap()
}

#[test]
fn every_package_has_an_allowed_licence_and_comes_from_the_registry() {
    // A machine that has only built the program has no packages of other systems and of chores.
    let output = packages(&["--workspace", "--target", "all"]);
    let output = match output.status.success() {
        true => output,
        false => packages(&[]),
    };
    let problem = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{problem}");
    let text = String::from_utf8(output.stdout).unwrap();
    let packages: BTreeSet<&str> = text.lines().filter(|line| !line.is_empty()).collect();
    assert!(packages.len() > 100, "{} packages", packages.len());
    for package in packages {
        let (name, licence) = package.split_once('|').unwrap();
        // A package that stands in the tree again is marked.
        let licence = licence.trim_end_matches(" (*)");
        assert!(is_allowed(licence), "{name} has the licence `{licence}`");
    }
    let lock = std::fs::read_to_string(root().join("Cargo.lock")).unwrap();
    let sources = lock.lines().filter(|line| line.starts_with("source = "));
    for source in sources {
        assert!(source.starts_with("source = \"registry+"), "{source}");
    }
}

#[test]
fn expressions_of_licences_are_understood() {
    for allowed in [
        "MIT",
        "MIT/Apache-2.0",
        "GPL-3.0 OR MIT",
        "(MIT OR GPL-3.0) AND Zlib",
        "Apache-2.0 WITH LLVM-exception OR GPL-2.0",
    ] {
        assert!(is_allowed(allowed), "{allowed}");
    }
    for refused in ["", "GPL-3.0", "MIT AND GPL-3.0", "MIT MIT", "MIT AND"] {
        assert!(!is_allowed(refused), "{refused}");
    }
}
