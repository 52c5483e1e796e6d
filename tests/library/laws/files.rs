//! Rules for files: names, printing, and no paths that exist on one machine only.

use super::source::{code_only, project_files, root, rust_files, sources, text, words};

#[test]
fn no_module_is_named_util_common_or_misc() {
    for file in sources() {
        let unspecific = file
            .split('/')
            .any(|p| ["util", "utils", "common", "misc"].contains(&p.trim_end_matches(".rs")));
        assert!(!unspecific, "{file}: name the module after its subject");
    }
}

#[test]
fn only_the_command_line_prints() {
    for file in sources()
        .into_iter()
        .filter(|f| !f.starts_with("src/cli/") && !f.contains("tests"))
    {
        let code = code_only(&text(&file));
        // Tests may print.
        let code = code
            .split("#[cfg(test)]\nmod tests {")
            .next()
            .unwrap_or_default();
        for name in ["println", "print", "eprintln", "eprint", "dbg"] {
            let calls = words(code, name).any(|at| code[at + name.len()..].starts_with('!'));
            assert!(!calls, "{file}: {name}! belongs to src/cli");
        }
    }
}

#[test]
fn skipped_tests_are_printed_past_the_harness() {
    // Assembled here so that this file does not match itself.
    let kept = ["println!(\"", "SKIPPED"].concat();
    for file in ["tests", "crates", "src"]
        .iter()
        .flat_map(|f| rust_files(f))
    {
        let words: String = text(&file).split_whitespace().collect();
        assert!(
            !words.contains(&kept),
            "{file}: tests that pass keep what they print; call `common::skipped`"
        );
    }
}

#[test]
fn no_file_names_a_home_or_work_folder() {
    // Assembled here so that this file does not match itself.
    let folders: Vec<String> = ["home", "Users", "root", "work"]
        .iter()
        .map(|p| format!("/{p}/"))
        .collect();
    let mut found = Vec::new();
    for path in project_files() {
        let Ok(text) = std::fs::read_to_string(&path) else {
            continue;
        };
        for (number, line) in text.lines().enumerate() {
            let absolute = |folder: &String| {
                line.match_indices(folder.as_str()).any(|(at, _)| {
                    !line[..at]
                        .chars()
                        .next_back()
                        .is_some_and(|c| c.is_alphanumeric() || "_-.*}/".contains(c))
                })
            };
            if folders.iter().any(absolute) {
                found.push(format!(
                    "{}:{}: {line}",
                    path.strip_prefix(root()).unwrap().display(),
                    number + 1
                ));
            }
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// The weights of luminance are constants of one module. Tests may have their own, as an
/// independent statement.
#[test]
fn weights_of_luminance_are_written_once() {
    let of_program = |path: &String| {
        let text = text(path);
        let end = text.find("#[cfg(test)]").unwrap_or(text.len());
        code_only(&text[..end]).contains("0.7152")
    };
    let found: Vec<String> = sources().into_iter().filter(of_program).collect();
    assert_eq!(found, ["crates/lumbre-light/src/math/luminance.rs"]);
}
