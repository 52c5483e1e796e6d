//! The import rule: the table of modules in `src/lib.rs` agrees with the code.

use std::collections::BTreeMap;

use super::source::{code_only, rust_files, text, words};

/// Crates that only some modules may name, as paths below `src/`.
const CONFINED: &[(&str, &[&str])] = &[
    ("mlua", &["script"]),
    ("ratatui", &["tui", "explore"]),
    ("base64", &["output", "tui"]),
    ("crossterm", &["tui", "explore"]),
    ("clap", &["cli"]),
    ("signal_hook", &["cli"]),
    ("tracing_subscriber", &["cli"]),
    ("tev_client", &["cli"]),
    ("annotate_snippets", &["cli"]),
    ("maud", &["output"]),
    ("resvg", &["output"]),
    ("epaint_default_fonts", &["output"]),
    ("roxmltree", &["output", "scene"]),
    ("exr", &["output"]),
    ("flate2", &["cli", "output"]),
    ("pdf_writer", &["output"]),
    ("png", &["output", "tui"]),
    ("ttf_parser", &["output"]),
];

/// Returns the modules and their levels, read from the table.
fn levels() -> BTreeMap<String, u32> {
    let mut levels = BTreeMap::new();
    for line in text("src/lib.rs")
        .lines()
        .filter_map(|l| l.strip_prefix("//! |"))
    {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        let Ok(level) = cells[0].parse::<u32>() else {
            continue;
        };
        for module in cells[1].split(',') {
            levels.insert(
                module.trim().trim_matches(['[', ']', '`']).to_owned(),
                level,
            );
        }
    }
    levels
}

/// Returns the modules that code names by `crate::module` or `crate::{module, ..}`.
fn modules_named(code: &str) -> Vec<String> {
    let mut named = Vec::new();
    for at in words(code, "crate") {
        let Some(rest) = code[at + "crate".len()..].trim_start().strip_prefix("::") else {
            continue;
        };
        let rest = rest.trim_start();
        match rest.strip_prefix('{') {
            None => named.push(first_word(rest)),
            Some(group) => {
                let mut depth = 0;
                let mut item = String::new();
                for c in group.chars() {
                    match c {
                        '{' => depth += 1,
                        '}' if depth == 0 => break,
                        '}' => depth -= 1,
                        ',' if depth == 0 => {
                            named.push(first_word(std::mem::take(&mut item).trim_start()))
                        }
                        _ if depth == 0 => item.push(c),
                        _ => {}
                    }
                }
                named.push(first_word(item.trim_start()));
            }
        }
    }
    named.retain(|n| !n.is_empty());
    named
}

fn first_word(text: &str) -> String {
    text.chars()
        .take_while(|c| c.is_alphanumeric() || *c == '_')
        .collect()
}

#[test]
fn modules_import_only_modules_of_a_lower_level() {
    let levels = levels();
    assert!(
        levels.len() >= 8,
        "too few modules were found in the table of src/lib.rs: {levels:?}"
    );
    let mut broken = Vec::new();
    for file in rust_files("src") {
        let Some((module, _)) = file.trim_start_matches("src/").split_once('/') else {
            continue;
        };
        let level = *levels
            .get(module)
            .unwrap_or_else(|| panic!("src/{module} is not in the table of src/lib.rs"));
        for target in modules_named(&code_only(&text(&file))) {
            match levels.get(&target) {
                _ if target == module => {}
                Some(other) if *other < level => {}
                Some(other) => broken.push(format!(
                    "{file} (level {level}) imports {target} (level {other})"
                )),
                None => broken.push(format!(
                    "{file} imports crate::{target}, which is not in the table"
                )),
            }
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

#[test]
fn the_table_lists_exactly_the_declared_modules() {
    let library = text("src/lib.rs");
    for module in levels().keys() {
        assert!(
            library.contains(&format!("pub mod {module};")),
            "{module} is in the table but not declared"
        );
    }
    let declared = library
        .lines()
        .filter(|l| l.starts_with("pub mod "))
        .count();
    assert_eq!(
        declared,
        levels().len(),
        "a declared module is missing in the table"
    );
}

#[test]
fn super_does_not_leave_a_top_level_module() {
    let mut broken = Vec::new();
    for file in rust_files("src") {
        let parts: Vec<&str> = file
            .trim_start_matches("src/")
            .trim_end_matches(".rs")
            .split('/')
            .collect();
        if parts.len() < 2 {
            continue;
        }
        let depth = parts.len() - usize::from(parts.last() == Some(&"mod"));
        let code = code_only(&text(&file));
        let inline = code.find("mod tests {").unwrap_or(code.len());
        for (at, _) in code.match_indices("super::") {
            if code[..at].ends_with("super::") {
                continue;
            }
            let mut chain = 0;
            while code[at + chain * 7..].starts_with("super::") {
                chain += 1;
            }
            if chain >= depth + usize::from(at > inline) {
                broken.push(format!(
                    "{file}: {}",
                    code[at..].lines().next().unwrap_or_default()
                ));
            }
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

#[test]
fn confined_crates_are_used_only_in_their_modules() {
    let mut broken = Vec::new();
    for file in rust_files("src") {
        let code = code_only(&text(&file));
        for (name, modules) in CONFINED {
            if is_local_module(&code, name) {
                continue;
            }
            let allowed = modules
                .iter()
                .any(|module| file.starts_with(&format!("src/{module}/")));
            let used = words(&code, name).any(|at| {
                // `exr::..` or `use exr;`, but not the end of a path such as
                // `crate::output::exr::..`.
                let path = code[at + name.len()..].starts_with("::") && !code[..at].ends_with("::");
                path || code[..at].trim_end().ends_with("use")
            });
            if used && !allowed {
                broken.push(format!(
                    "{file} uses {name}, which belongs to {}",
                    modules.join(" and ")
                ));
            }
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

/// Returns whether a name means a local module in this file: `output::exr` has the name of the
/// crate `exr`.
fn is_local_module(code: &str, name: &str) -> bool {
    let ours = |statement: &&str| {
        let path = statement
            .trim_start()
            .trim_start_matches("pub ")
            .trim_start();
        ["use crate::", "use super::", "use self::"]
            .iter()
            .any(|start| path.starts_with(start))
    };
    code.split(';')
        .filter(ours)
        .any(|statement| words(statement, name).next().is_some())
}

#[test]
fn a_local_module_may_have_the_name_of_a_crate() {
    assert!(is_local_module(
        "use std::fs;\nuse crate::output::{exr, png};",
        "exr"
    ));
    assert!(!is_local_module(
        "use exr::prelude::*;\nuse crate::output::png;",
        "exr"
    ));
}

#[test]
fn modules_are_found_in_nested_groups_of_imports() {
    let code = "use crate::{film::{Image, Film}, scene::desc as d, value}; \
                let x = crate::tui::y(); mycrate::no";
    assert_eq!(modules_named(code), ["film", "scene", "value", "tui"]);
}
